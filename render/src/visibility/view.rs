//! A camera with its pose.

use super::RenderError;
use kinetoscope_scene::PoseF32;

/// A pinhole camera without distortion, or an orthographic camera, with its pose.
///
/// The axes are ROS's optical ones: x to the right of the image, y down, z forward. The ray of pixel (u, v) goes
/// through (u + 0.5, v + 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// True for an orthographic camera: rays are parallel to the optical axis, `fx` and `fy` are pixels per meter, and
    /// (`cx`, `cy`) is the pixel on the axis. Supported by [`Renderer::Raster`](crate::renderer::Renderer::Raster) and
    /// [`Renderer::Hybrid`](crate::renderer::Renderer::Hybrid), without a lens.
    pub parallel: bool,
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length along x \[pixels\].
    pub fx: f32,
    /// Focal length along y \[pixels\].
    pub fy: f32,
    /// Principal point along x \[pixels\]; the center of the first pixel is 0.5.
    pub cx: f32,
    /// Principal point along y \[pixels\]; the center of the first pixel is 0.5.
    pub cy: f32,
    /// Smallest visible depth along the optical axis \[m\]; for lenses whose rays do not all go
    /// [forward](crate::lens::Lens::is_forward), the distance along the ray.
    pub near: f32,
    /// Largest visible depth along the optical axis \[m\], or distance as for `near`.
    pub far: f32,
    /// Pose of the camera's optical frame.
    pub world_from_camera: PoseF32,
}

impl View {
    /// Largest width or height of an image \[pixels\]. It is below the guard band of the rasterizer (16000 pixels),
    /// inside which edge functions are exact.
    pub const MAX_SIDE: usize = 8192;

    /// A camera at `eye` that looks at `target` \[m\], with the vertical field of view `fovy` \[rad\], square pixels
    /// and the principal point at the center; it sees depths from 1 cm to 100 m. The image's upward direction is as
    /// near to `up` as possible; for a view along `up`, it is +y of the world (or +x, if `up` is about ±y). An `up` of
    /// 0 is +z.
    ///
    /// # Errors
    ///
    /// [`RenderError::LookAt`] if eye and target coincide or are not finite, and the errors of [`View::validate`].
    pub fn look_at(
        size: [usize; 2],
        fovy: f32,
        eye: [f32; 3],
        target: [f32; 3],
        up: [f32; 3],
    ) -> Result<Self, RenderError> {
        use nalgebra::Vector3;
        let wide = |v: [f32; 3]| Vector3::from(v.map(f64::from));
        let z = (wide(target) - wide(eye)).try_normalize(1e-12).ok_or(RenderError::LookAt)?;
        let up = wide(up).try_normalize(1e-12).unwrap_or(Vector3::z());
        let other = if up.y.abs() > 0.9 { Vector3::x() } else { Vector3::y() };
        let x = [up, other].iter().find_map(|up| z.cross(up).try_normalize(1e-6)).ok_or(RenderError::LookAt)?;
        let y = z.cross(&x);
        let rotation = [0, 1, 2].map(|i| [x[i] as f32, y[i] as f32, z[i] as f32]);
        let f = 0.5 * size[1] as f32 / (0.5 * f64::from(fovy)).tan() as f32;
        let view = Self {
            parallel: false,
            width: size[0],
            height: size[1],
            fx: f,
            fy: f,
            cx: 0.5 * size[0] as f32,
            cy: 0.5 * size[1] as f32,
            near: 0.01,
            far: 100.0,
            world_from_camera: PoseF32 { rotation, translation: eye },
        };
        view.validate().map(|()| view)
    }

    /// Checks every number: sides of 1 to [`MAX_SIDE`](Self::MAX_SIDE) pixels, focal lengths of at least 0.001 pixels,
    /// focal lengths and principal point below 1e7 pixels in magnitude, 1e-6 m <= near < far, and a rigid pose.
    ///
    /// # Errors
    ///
    /// The error of the first invalid number.
    pub fn validate(&self) -> Result<(), RenderError> {
        let Self { parallel: _, width, height, fx, fy, cx, cy, near, far, world_from_camera } = *self;
        if width == 0 || height == 0 || width.max(height) > Self::MAX_SIDE {
            return Err(RenderError::Size { width, height, limit: Self::MAX_SIDE });
        }
        let finite = [fx, fy, cx, cy].iter().all(|x| x.is_finite() && x.abs() < 1e7);
        if !finite || fx < 1e-3 || fy < 1e-3 {
            return Err(RenderError::Intrinsics { fx, fy, cx, cy });
        }
        if !(near > 0.0 && near < far && far.is_finite() && near >= 1e-6) {
            return Err(RenderError::Range { near, far });
        }
        if !world_from_camera.is_rigid() {
            return Err(RenderError::CameraPose { pose: world_from_camera });
        }
        Ok(())
    }
}
