//! One update of a scene of MuJoCo's visualizer, ready for rendering.

use kinetoscope_scene::{Haze, HorizonHaze, Light, PoseF32, RenderScene};
use std::sync::Arc;

/// Background of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Background {
    /// True to draw the first skybox of the model, or, with `fog`, a background in the color of the fog. False draws a
    /// black background.
    pub skybox: bool,
    /// Haze at the end of infinite planes, ignored in fog; `None` for a sharp end.
    pub horizon: Option<HorizonHaze>,
    /// Fog over distant surfaces; `None` for clear air.
    pub fog: Option<Haze>,
}

/// Flags of a scene that change how its geoms are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawFlags {
    /// True if the backs of surfaces are invisible (`mjRND_CULL_FACE`).
    pub culls_backs: bool,
    /// True if transparent geoms are added to the color behind them (`mjRND_ADDITIVE`).
    pub is_additive: bool,
    /// True if the edges of polygons are drawn instead of surfaces (`mjRND_WIREFRAME`).
    pub is_wireframe: bool,
}

/// Instances, poses and lights of one update. The mask id of an instance is the index of its geom plus 1.
#[derive(Clone, Debug)]
pub struct MjvFrame {
    /// Scene of the color channel.
    pub scene: Arc<RenderScene>,
    /// Scene of depth and segmentation, without geoms that have no segmentation id; `None` if all geoms have one.
    pub segment_scene: Option<Arc<RenderScene>>,
    /// Pose of each instance: world from instance.
    pub poses: Vec<PoseF32>,
    /// Lights with their poses.
    pub lights: Vec<Light>,
    /// Object of each mask id, indexed by the id; element 0 is the background.
    pub objects: Vec<MjvObject>,
}

/// Object that a geom of a scene shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MjvObject {
    /// Object id; -1 for the background and for geoms without a segmentation id.
    pub id: i32,
    /// Object type (`mjtObj`); -1 for the background and for geoms without a segmentation id.
    pub kind: i32,
    /// Segmentation id; -1 for the background and for geoms without one.
    pub segment: i32,
}

impl MjvObject {
    /// The background.
    pub const NONE: Self = Self { id: -1, kind: -1, segment: -1 };
}

impl MjvFrame {
    /// Scene of depth and segmentation.
    pub fn segment_scene(&self) -> &RenderScene {
        self.segment_scene.as_deref().unwrap_or(&self.scene)
    }
}
