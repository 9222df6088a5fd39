//! How rays turn with the body they hang on.

use kinetoscope_scene::{Pose, PoseF64};
use serde::{Deserialize, Serialize};

/// How rays turn with the body they hang on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RayAlignment {
    /// As the body does.
    #[default]
    Base,
    /// About the vertical only, by the body's yaw: starts and directions both. A height scanner stays level when its robot
    /// does not.
    Yaw,
    /// Not at all: along the axes of the environment.
    World,
}

impl RayAlignment {
    /// The name, as Isaac Lab has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Yaw => "yaw",
            Self::World => "world",
        }
    }

    /// World from the frame of the rays, on a body at `pose`.
    pub(crate) fn align(self, pose: &Pose) -> PoseF64 {
        let translation = pose.translation.vector.into();
        match self {
            Self::Base => PoseF64::from(pose),
            Self::World => PoseF64::from_translation(translation),
            Self::Yaw => {
                let q = &pose.rotation;
                // Yaw of the intrinsic order z, y, x; by its sine and cosine, up to a common length.
                let (sine, cosine) = (2.0 * (q.w * q.k + q.i * q.j), 1.0 - 2.0 * (q.j * q.j + q.k * q.k));
                let length = sine.hypot(cosine);
                // Looking straight up or down there is no yaw: atan2(0, 0) is 0.
                let (s, c) = if length > 0.0 { (sine / length, cosine / length) } else { (0.0, 1.0) };
                PoseF64 { rotation: [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], translation }
            }
        }
    }
}
