//! The point of view that a program gives to windows, browser views and screenshots.

/// A point of view onto all environments, in the frame of the overview \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position of the viewer.
    pub eye: [f64; 3],
    /// Point in the middle of the image.
    pub target: [f64; 3],
    /// Number of calls of [`SceneViewMut::set_camera_view`](crate::SceneViewMut::set_camera_view) so far: open views follow a change.
    pub changes: u64,
}
