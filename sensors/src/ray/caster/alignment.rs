//! Alignment of rays with their parent body.

use kinetoscope_scene::{Pose, PoseF64};
use serde::{Deserialize, Serialize};

/// Alignment of rays with their parent body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RayAlignment {
    /// Rays move and rotate with the body.
    #[default]
    Base,
    /// Rays move with the body and rotate with its yaw only, about the vertical: both origins and directions. A height
    /// scanner stays level when its robot tilts.
    Yaw,
    /// Rays move with the body and keep the axes of the environment.
    World,
}

impl RayAlignment {
    /// Name in Isaac Lab: `base`, `yaw` or `world`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Yaw => "yaw",
            Self::World => "world",
        }
    }

    /// Returns the pose of the ray frame in the world, for a body at `pose`.
    pub(crate) fn align(self, pose: &Pose) -> PoseF64 {
        let translation = pose.translation.vector.into();
        match self {
            Self::Base => PoseF64::from(pose),
            Self::World => PoseF64::from_translation(translation),
            Self::Yaw => {
                let q = &pose.rotation;
                // Yaw of the intrinsic order z, y, x, from its sine and cosine up to a common factor.
                let (sine, cosine) = (2.0 * (q.w * q.k + q.i * q.j), 1.0 - 2.0 * (q.j * q.j + q.k * q.k));
                let length = sine.hypot(cosine);
                // Looking straight up or down, the yaw is undefined; it is set to 0, as atan2(0, 0).
                let (s, c) = if length > 0.0 { (sine / length, cosine / length) } else { (0.0, 1.0) };
                PoseF64 { rotation: [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], translation }
            }
        }
    }
}
