//! The request of a frame: scene, poses, view, and the settings of drawing.

use crate::lens::LensRays;
use crate::shade::tone::ToneCurve;
use crate::visibility::View;
use kinetoscope_scene::{Light, PoseF32, RenderScene};
use serde::{Deserialize, Serialize};

/// How frames are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RasterCfg {
    /// Samples per pixel for the color: 1 or 4. All other channels see the pixel's center.
    pub samples: u8,
    /// True if lights cast shadows (directional lights and spots, the first four of them).
    pub shadows: bool,
    /// True if planar mirrors (material `reflectance` of planes and of the +z face of boxes) show what is before them: one ray
    /// from each sample that shows a mirror, and the light where it ends. Path tracing mirrors always.
    pub reflections: bool,
    /// Texels along the side of a shadow map; 0 chooses by the image's size.
    pub shadow_size: usize,
    /// Rays from each sample of a color for ambient occlusion, of [`Renderer::Hybrid`](crate::renderer::Renderer::Hybrid) only; 0 switches it off. Ambient light is then
    /// what arrives of [`RenderScene::ambient`] past what is in the way, as [`Renderer::RayTraced`](crate::renderer::Renderer::RayTraced) has it without bounces:
    /// exact where nothing is in the way of flat surfaces (of a mesh with smooth normals, what lies below a facet is in the way),
    /// with the noise of so many rays elsewhere, which depends on the point and nothing else.
    pub occlusion_rays: u16,
    /// How light becomes the bytes of the color.
    pub tone: ToneCurve,
    /// Geom groups that are drawn: bit k is group k.
    pub groups: u32,
    /// Draw dense meshes coarser where that is hardly seen (level of detail).
    ///
    /// The surface that is drawn instead of a mesh is joined to it by a continuous map that moves no point by more than
    /// 1 mm, nor by more than half a pixel anywhere in the image (both are proven, see [`kinetoscope_scene::shape::RenderMesh::levels`];
    /// vertices are snapped to 1/256 pixel besides, with or without levels). So:
    /// - what is seen at a pixel is seen within half a pixel of it without levels; of things that are less than 2 mm
    ///   behind each other, either may be seen;
    /// - depth, distance and position are those of a point not farther than 1 mm from a point of the mesh that is seen
    ///   within half a pixel; where a surface is seen at a slant, or near a silhouette, depth changes by more than that
    ///   within half a pixel, and may differ by as much;
    /// - flat normals are those of the larger triangles: on smooth surfaces within some degrees of the mesh's, and
    ///   arbitrary on features that are smaller than half a pixel or 1 mm. Shading normals are blended from normals of the
    ///   mesh's own vertices, and no new triangle faces more than 40° away from them;
    /// - shadow maps follow the same rule in texels.
    ///
    /// The level depends on the mesh, its pose and the view, on nothing else in the image. Meshes of fewer than 1000
    /// triangles, with texture coordinates, that reach behind the near plane, and terrain are drawn as they are. The
    /// levels of a mesh are made when a image first needs one, and shared by all environments.
    pub lod: bool,
}

impl Default for RasterCfg {
    /// Four samples and shadows; geom groups 0, 1 and 2, as in MuJoCo's own viewers: collision shapes are in group 3.
    fn default() -> Self {
        Self {
            samples: 4,
            shadows: true,
            reflections: true,
            shadow_size: 0,
            occlusion_rays: 0,
            tone: ToneCurve::Soft,
            groups: 0b111,
            lod: true,
        }
    }
}

/// The request of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// What can be seen.
    pub scene: &'a RenderScene,
    /// Pose of each instance: world from instance.
    pub poses: &'a [PoseF32],
    /// The camera.
    pub view: &'a View,
    /// Lights instead of the scene's, for those that move.
    pub lights: Option<&'a [Light]>,
    /// The rays of a lens, instead of the view's focal lengths and principal point; `None` is a pinhole.
    pub lens: Option<&'a LensRays>,
    /// The previous frame, for [`Flow`](crate::frame::Flow) only.
    pub before: Option<Before<'a>>,
}

/// The previous frame.
#[derive(Clone, Copy, Debug)]
pub struct Before<'a> {
    /// Pose of each instance then: world from instance.
    pub poses: &'a [PoseF32],
    /// The camera. Behind a lens, its focal lengths and principal point tell the intrinsics from those of
    /// [`Shot::view`]: where both are the same, the lens had the same ones.
    pub view: &'a View,
}
