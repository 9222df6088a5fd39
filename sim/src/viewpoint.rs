//! The point of view that a program gives to windows, browser views and screenshots.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;

/// A point of view onto all environments, in the frame of the overview \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position of the viewer.
    pub eye: [f64; 3],
    /// Point in the middle of the image.
    pub target: [f64; 3],
    /// Number of calls of [`SimulationManager::set_camera_view`] so far: open views follow a change.
    pub changes: u64,
}

impl SimulationManager {
    /// Sets the point of view of windows, browser views and screenshots, those that are open and those to come: from `eye` to
    /// `target` in the frame of the overview \[m\], up is +z. Users can move on from there; Home brings it back. Isaac Lab's
    /// `set_camera_view`.
    ///
    /// # Errors
    /// The points are the same, or not finite; the view stays then.
    pub fn set_camera_view(&mut self, eye: [f64; 3], target: [f64; 3]) -> Result<()> {
        let distance = eye.iter().zip(&target).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        if !(distance.is_finite() && distance > 1e-9) {
            return Err(Error::Config {
                field: "set_camera_view",
                value: format!("{eye:?}, {target:?}"),
                expected: "eye and target must be finite and apart from each other, in metres",
            });
        }
        let changes = self.viewpoint.map_or(0, |view| view.changes) + 1;
        self.viewpoint = Some(Viewpoint { eye, target, changes });
        Ok(())
    }

    /// The point of view that was set last; `None` before the first.
    pub fn viewpoint(&self) -> Option<Viewpoint> {
        self.viewpoint
    }
}
