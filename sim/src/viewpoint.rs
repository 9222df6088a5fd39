//! Point of view of windows, browser views and screenshots.

/// Point of view onto all environments, in the frame of the overview \[m\], +z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position of the eye, in the frame of the overview \[m\].
    pub eye: [f64; 3],
    /// Point in the center of the image, in the frame of the overview \[m\].
    pub target: [f64; 3],
    /// Number of successful calls of [`SceneViewMut::set_camera_view`](crate::SceneViewMut::set_camera_view) so far.
    /// Open views move to this point of view when the number changes.
    pub revision: u64,
}
