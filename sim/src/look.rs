//! One environment as a viewer sees it.

use kinetoscope_scene::{Light, OwnScene, Pose, PoseF32};

/// One environment as it is now; see [`SceneViewMut::look`](crate::SceneViewMut::look). Everything is in the frame of the environment.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// Simulation time \[s\].
    pub time: f64,
    /// Why the environment stands still, where it diverged.
    pub diverged: Option<String>,
    /// What it looks like, where its sizes or colours are its own or a shape [changes](kinetoscope_scene::Instance::deforms).
    pub own_scene: OwnScene,
    /// World from instance, in the order of the instances of [`Visible::scene`](crate::Visible::scene).
    pub instances: Vec<PoseF32>,
    /// The lamps of that scene where they are now.
    pub lights: Vec<Light>,
    /// Poses of links and objects, in the order of [`Entities::body_names`](crate::Entities::body_names).
    pub bodies: Vec<Pose>,
    /// Centres of mass \[m\] of what moves as one piece, and its mass \[kg\]; without what has none.
    pub masses: Vec<([f64; 3], f64)>,
    /// Axes of joints that turn or slide.
    pub joints: Vec<JointAxis>,
}

/// Axis of a joint with one degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointAxis {
    /// A point of it \[m\].
    pub anchor: [f64; 3],
    /// Its direction, of length 1.
    pub axis: [f64; 3],
    /// Whether the joint slides along it instead of turning about it.
    pub slides: bool,
}

/// How a link or an object moves; see [`SceneView::body_motion`](crate::SceneView::body_motion).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyMotion {
    /// Pose of its frame.
    pub pose: Pose,
    /// Velocity of its frame's origin \[m/s\], in world axes.
    pub linear: [f64; 3],
    /// Angular velocity \[rad/s\], in world axes.
    pub angular: [f64; 3],
    /// Mass of it and of all that hangs on it \[kg\].
    pub carried_mass: f64,
    /// Whether nothing that is done to it moves it: it is a part of the world, or moved by hand.
    pub is_fixed: bool,
}
