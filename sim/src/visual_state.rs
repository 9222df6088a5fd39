//! Visual state of one environment, for viewers.

use kinetoscope_scene::{EnvScene, Light, Pose, PoseF32};

/// Visual state of one environment at the current time, in the frame of the environment. See
/// [`SceneViewMut::read_visual_state`](crate::SceneViewMut::read_visual_state).
#[derive(Clone, Debug, Default)]
pub struct EnvVisualState {
    /// Simulation time \[s\].
    pub time: f64,
    /// Reason of the divergence; `None` while the environment runs.
    pub diverged: Option<String>,
    /// Scene with the environment's own sizes or colors, or with shapes that
    /// [deform](kinetoscope_scene::Instance::is_deformable); empty if the environment uses the shared
    /// [`VisualScene::scene`](crate::VisualScene::scene).
    pub env_scene: EnvScene,
    /// Poses of the instances, in the order of the instances of [`VisualScene::scene`](crate::VisualScene::scene).
    pub instances: Vec<PoseF32>,
    /// Lights of that scene at their current poses.
    pub lights: Vec<Light>,
    /// Poses of links, objects, and bodies and sites of MJCF parts, in the order of
    /// [`Entities::body_names`](crate::Entities::body_names).
    pub bodies: Vec<Pose>,
    /// Center of mass \[m\] and mass \[kg\] of each MuJoCo body with a mass.
    pub mass_points: Vec<([f64; 3], f64)>,
    /// Axes of all hinge and slide joints.
    pub joints: Vec<JointAxis>,
}

/// Axis of a joint with one degree of freedom, in the frame of the environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointAxis {
    /// A point on the axis \[m\].
    pub anchor: [f64; 3],
    /// Direction of the axis, a unit vector.
    pub axis: [f64; 3],
    /// True for a slide joint, false for a hinge joint.
    pub is_slide: bool,
}

/// Pose, velocities and carried mass of a link, an object, or a body of an MJCF part; see
/// [`SceneView::body_motion`](crate::SceneView::body_motion).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyMotion {
    /// Pose of the body frame in the environment.
    pub pose: Pose,
    /// Velocity of the origin of the body frame \[m/s\], in world axes.
    pub linear: [f64; 3],
    /// Angular velocity \[rad/s\], in world axes.
    pub angular: [f64; 3],
    /// Mass of the body and of all bodies below it in the kinematic tree \[kg\]. Links that fixed joints connect are
    /// one body.
    pub carried_mass: f64,
    /// True if no force moves the body: it is welded to the world, or it is a mocap body.
    pub is_fixed: bool,
}
