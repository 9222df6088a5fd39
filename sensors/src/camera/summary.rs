//! Text forms of a camera: a summary for users and a short debug form.

use super::Camera;
use crate::summary;
use std::fmt;

impl fmt::Display for Camera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (height, width) = self.image_shape();
        summary::write(
            f,
            "Camera",
            self.path(),
            &[
                ("data types", &self.channels().names().join(", ")),
                ("update period (s)", &self.update_period()),
                ("shape", &format!("({height}, {width})")),
                ("number of sensors", &self.env_ids().len()),
            ],
        )
    }
}

/// Short: the scene and the images are left out.
impl fmt::Debug for Camera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (height, width) = self.image_shape();
        f.debug_struct("Camera")
            .field("path", &self.path())
            .field("width", &width)
            .field("height", &height)
            .field("channels", &self.channels().names())
            .field("environments", &self.env_ids().len())
            .finish_non_exhaustive()
    }
}
