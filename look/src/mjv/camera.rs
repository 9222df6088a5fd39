//! The camera of a scene of MuJoCo's visualizer (`mjvGLCamera`).

use kinetoscope_scene::PoseF32;

/// Camera of MuJoCo's visualizer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MjvCamera {
    /// True for parallel rays: then the frustum is the visible part of any plane across them.
    pub orthographic: bool,
    /// Position in the world \[m\].
    pub position: [f64; 3],
    /// Viewing direction, in world axes; of any length but 0.
    pub forward: [f64; 3],
    /// Upward direction of the image, in world axes; it may lean toward the viewing direction.
    pub up: [f64; 3],
    /// Horizontal center of the frustum in the near plane, positive to the right \[m\].
    pub center: f64,
    /// Half width of the frustum in the near plane \[m\]; 0 for square pixels.
    pub half_width: f64,
    /// Lower end of the frustum in the near plane \[m\].
    pub bottom: f64,
    /// Upper end of the frustum in the near plane \[m\].
    pub top: f64,
    /// Depth of the near plane \[m\].
    pub near: f64,
    /// Depth of the far plane \[m\].
    pub far: f64,
}

/// Error of a camera whose axes are parallel, or whose frustum is empty.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the camera has no valid frustum or axes: {camera:?}")]
pub struct MjvCameraError {
    /// The camera.
    pub camera: Box<MjvCamera>,
}

impl MjvCamera {
    /// Returns the focal lengths and the principal point, fx, fy, cx, cy \[pixels\], for an image of `width` x
    /// `height`. The top left corner of the image is (0, 0), pixel centers are at half pixels. For an
    /// orthographic camera, fx and fy are pixels per meter.
    ///
    /// # Errors
    /// The frustum is empty, or `near` is not above 0.
    pub fn intrinsics(&self, width: usize, height: usize) -> Result<[f32; 4], MjvCameraError> {
        let (width, height) = (width as f64, height as f64);
        let side = self.top - self.bottom;
        let half_width = if self.half_width > 0.0 { self.half_width } else { 0.5 * side * width / height };
        let depth = if self.orthographic { 1.0 } else { self.near };
        let fx = 0.5 * width * depth / half_width;
        let fy = height * depth / side;
        let cx = 0.5 * width - self.center * fx / depth;
        let cy = self.top * fy / depth;
        let numbers = [fx, fy, cx, cy].map(|x| x as f32);
        if side > 0.0 && self.near > 0.0 && numbers.iter().all(|x| x.is_finite()) {
            Ok(numbers)
        } else {
            Err(self.error())
        }
    }

    /// Pose of the optical frame: x to the right of the image, y down, z forward.
    ///
    /// # Errors
    /// The viewing or the upward direction is 0, or they are parallel.
    pub fn world_from_camera(&self) -> Result<PoseF32, MjvCameraError> {
        let [z, up] = [self.forward, self.up].map(nalgebra::Vector3::from);
        let z = z.try_normalize(1e-12).ok_or_else(|| self.error())?;
        let x = z.cross(&up).try_normalize(1e-9).ok_or_else(|| self.error())?;
        let y = z.cross(&x);
        let rotation = [0, 1, 2].map(|k| [x[k] as f32, y[k] as f32, z[k] as f32]);
        Ok(PoseF32 { rotation, translation: self.position.map(|x| x as f32) })
    }

    fn error(&self) -> MjvCameraError {
        MjvCameraError { camera: Box::new(*self) }
    }
}
