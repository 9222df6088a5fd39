//! Visibility: views, and the surface at each pixel.

pub(crate) mod primitive;
pub(crate) mod projection;
pub(crate) mod view;

pub(crate) use projection::Projection;
pub use view::View;

/// An error of rendering an image.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The image is empty or too large.
    #[error("an image of {width} x {height} pixels cannot be rendered; both sides must be 1 to {limit}")]
    Size {
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// The largest side.
        limit: usize,
    },
    /// Focal lengths or the principal point are invalid.
    #[error(
        "intrinsics fx {fx}, fy {fy}, cx {cx}, cy {cy}: all must be finite and below 1e7 in magnitude, fx and fy at least 0.001"
    )]
    Intrinsics {
        /// Focal length along x \[pixels\].
        fx: f32,
        /// Focal length along y \[pixels\].
        fy: f32,
        /// Principal point, x \[pixels\].
        cx: f32,
        /// Principal point, y \[pixels\].
        cy: f32,
    },
    /// Markers of sensors cannot be added to the scene.
    #[error("sensor markers cannot be added to the scene: {0}")]
    Markers(String),
    /// The range of depths is empty or invalid.
    #[error("near {near} m and far {far} m: both must be finite, with 1e-6 <= near < far")]
    Range {
        /// Smallest depth \[m\].
        near: f32,
        /// Largest depth \[m\].
        far: f32,
    },
    /// The camera's pose is not finite, or its matrix is not a rotation.
    #[error("the camera's pose is not a rigid transform: {pose:?}")]
    CameraPose {
        /// The pose.
        pose: kinetoscope_scene::PoseF32,
    },
    /// An instance's pose is not finite, or its matrix is not a rotation.
    #[error("the pose of instance {instance} is not a rigid transform: {pose:?}")]
    InstancePose {
        /// Index of the instance in the scene.
        instance: usize,
        /// The pose.
        pose: kinetoscope_scene::PoseF32,
    },
    /// The numbers of poses and instances differ.
    #[error("{found} poses for {expected} instances")]
    PoseCount {
        /// Number of instances in the scene.
        expected: usize,
        /// Number of given poses.
        found: usize,
    },
    /// A buffer has the wrong length.
    #[error("the {channel} buffer has {found} elements; the image needs {expected}")]
    BufferSize {
        /// Name of the channel.
        channel: &'static str,
        /// Length that the image needs.
        expected: usize,
        /// Length of the buffer.
        found: usize,
    },
    /// Eye and target of a view coincide, or are not finite.
    #[error("the camera position and the target of a view are the same point, or not finite")]
    LookAt,
    /// The number of paths per pixel is out of range.
    #[error("invalid number of paths per pixel: {samples}; it must be 1 to {limit}")]
    Paths {
        /// Paths per pixel.
        samples: u32,
        /// Largest number of paths per pixel.
        limit: u32,
    },
    /// The number of bounces is out of range.
    #[error("invalid number of bounces: {max_bounces}; it must be 0 to {limit}")]
    Bounces {
        /// Number of bounces.
        max_bounces: u32,
        /// Largest number of bounces.
        limit: u32,
    },
    /// The renderer draws straight lines only, but the lens bends them.
    #[error(
        "the renderer {renderer} supports pinhole cameras only, not the {lens} lens; use renderer: FastRayTraced, Hybrid or \
         RayTraced"
    )]
    LensRenderer {
        /// Name of the lens.
        lens: &'static str,
        /// Name of the renderer.
        renderer: &'static str,
    },
    /// The camera is orthographic, but the renderer or the lens is not.
    #[error("orthographic cameras need renderer: Raster or Hybrid, without a lens; the renderer is {renderer}")]
    Orthographic {
        /// Name of the renderer.
        renderer: &'static str,
    },
    /// A feature needs path tracing, but the renderer has none.
    #[error("{what} needs path tracing, which the renderer {renderer} does not support; use renderer: RayTraced")]
    NeedsPathTracing {
        /// Name of the feature.
        what: &'static str,
        /// Name of the renderer.
        renderer: &'static str,
    },
    /// Ambient occlusion is enabled for a renderer that does not support it.
    #[error(
        "{rays} rays for ambient occlusion, which the renderer {renderer} does not support; use renderer: Hybrid (RayTraced \
         includes ambient occlusion)"
    )]
    Occlusion {
        /// Rays per sample.
        rays: u16,
        /// Name of the renderer.
        renderer: &'static str,
    },
    /// A number of the aperture is out of range.
    #[error("{what} of the aperture is {value}; it must be {allowed}")]
    Aperture {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Accepted values.
        allowed: &'static str,
    },
    /// A time of the shutter is out of range.
    #[error("{what} of the shutter is {value} s; it must be 0 or positive, and finite")]
    Shutter {
        /// Name of the number.
        what: &'static str,
        /// Its value \[s\].
        value: f64,
    },
    /// The poses at shutter opening are more recent than the opening.
    #[error(
        "the shutter opens {span} s before the time stamp of the image, but the oldest known poses are from {age} s before it"
    )]
    ShutterPoses {
        /// Age of the poses at the time stamp of the image \[s\].
        age: f64,
        /// Time from shutter opening to the time stamp \[s\].
        span: f64,
    },
    /// Rendering was canceled by [`RenderProgress::cancel`](crate::progress::RenderProgress::cancel).
    #[error("rendering was canceled after {samples} of {total} paths")]
    Canceled {
        /// Number of traced paths.
        samples: u64,
        /// Number of paths of the batch.
        total: u64,
    },
    /// The rays of a lens do not match the image.
    #[error(
        "the lens rays are for {found:?} pixels with {found_samples} samples, but the image has {expected:?} pixels and needs \
         {samples}"
    )]
    LensRays {
        /// Pixels per row and rows of the image.
        expected: [usize; 2],
        /// Samples per pixel that the colors need.
        samples: u8,
        /// Pixels per row and rows of the rays.
        found: [usize; 2],
        /// Samples per pixel of the rays.
        found_samples: u8,
    },
    /// The exposure compensation is out of range.
    #[error("exposure compensation of {stops} stops; it must be -20 to 20")]
    ExposureCompensation {
        /// Exposure compensation in stops.
        stops: f32,
    },
    /// The number of samples is not supported.
    #[error("invalid number of samples per pixel: {samples}; it must be 1 or 4")]
    Samples {
        /// Samples per pixel.
        samples: u8,
    },
}
