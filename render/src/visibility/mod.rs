//! What a camera sees: which surface at which pixel.

pub(crate) mod primitive;
pub(crate) mod projection;
pub(crate) mod view;

pub(crate) use projection::Projection;
pub use view::View;

/// Why a image cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The image has no pixels or too many.
    #[error("a picture of {width} x {height} pixels cannot be drawn; both sides are 1 to {limit}")]
    Size {
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// The largest side.
        limit: usize,
    },
    /// Focal lengths or the principal point are no good.
    #[error("intrinsics fx {fx}, fy {fy}, cx {cx}, cy {cy}: all must be finite, fx and fy positive")]
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
    /// The scene with what sensors show in it.
    #[error("what sensors show cannot be drawn into the picture: {0}")]
    Markers(String),
    /// The range of depths is empty.
    #[error("near {near} m and far {far} m: both must be finite, with 0 < near < far")]
    Range {
        /// Smallest depth \[m\].
        near: f32,
        /// Largest depth \[m\].
        far: f32,
    },
    /// The camera's pose is not finite, or no rotation.
    #[error("the camera's pose is not a rigid transform: {pose:?}")]
    CameraPose {
        /// The pose.
        pose: kinetoscope_scene::PoseF32,
    },
    /// An instance's pose is not finite, or no rotation.
    #[error("the pose of instance {instance} is not a rigid transform: {pose:?}")]
    InstancePose {
        /// Which instance.
        instance: usize,
        /// The pose.
        pose: kinetoscope_scene::PoseF32,
    },
    /// There are not as many poses as instances.
    #[error("{found} poses for {expected} instances")]
    PoseCount {
        /// Instances of the scene.
        expected: usize,
        /// Poses given.
        found: usize,
    },
    /// A buffer has the wrong length.
    #[error("the {channel} buffer has {found} numbers; the picture needs {expected}")]
    BufferSize {
        /// The channel.
        channel: &'static str,
        /// How many numbers the image has.
        expected: usize,
        /// How many the buffer has.
        found: usize,
    },
    /// The eye is where the target is.
    #[error("the eye and the target of a view are the same point, or not finite")]
    LookAt,
    /// Paths per pixel that a ray tracer cannot have.
    #[error("{samples} paths per pixel; 1 to {limit} are possible")]
    Paths {
        /// The number.
        samples: u32,
        /// The most that is possible.
        limit: u32,
    },
    /// Bounces that a ray tracer cannot have.
    #[error("{max_bounces} bounces; 0 to {limit} are possible")]
    Bounces {
        /// The number.
        max_bounces: u32,
        /// The most that is possible.
        limit: u32,
    },
    /// A renderer that draws straight lines, and a lens that bends them.
    #[error(
        "the {lens} lens bends straight lines, which {renderer} does not; use renderer: FastRayTraced, Hybrid or RayTraced"
    )]
    LensRenderer {
        /// The lens.
        lens: &'static str,
        /// The renderer.
        renderer: &'static str,
    },
    /// What only paths can show, and a renderer that follows none.
    #[error(
        "{what}: colours come from paths all over the lens and the exposure, and {renderer} follows none; use renderer: RayTraced"
    )]
    NeedsPaths {
        /// What is to be shown.
        what: &'static str,
        /// The renderer.
        renderer: &'static str,
    },
    /// Ambient occlusion of a renderer that has none.
    #[error("{rays} rays for ambient occlusion: {renderer} casts none; use renderer: Hybrid (RayTraced needs none)")]
    Occlusion {
        /// How many rays.
        rays: u16,
        /// The renderer.
        renderer: &'static str,
    },
    /// A lens that no camera has.
    #[error("{what} of the aperture is {value}; it must be {allowed}")]
    Aperture {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
        /// Accepted values.
        allowed: &'static str,
    },
    /// A shutter that no camera has.
    #[error("{what} of the shutter is {value} s; it must be 0 or positive, and finite")]
    Shutter {
        /// Which number.
        what: &'static str,
        /// The number \[s\].
        value: f64,
    },
    /// The shutter was open before anybody knows where things were.
    #[error(
        "the shutter opens {span} s before the picture's instant, but where things were is known from {before} s before"
    )]
    Opened {
        /// From when poses are \[s\].
        before: f64,
        /// How long the shutter takes \[s\].
        span: f64,
    },
    /// Somebody broke the image off ([`RenderProgress::cancel`](crate::progress::RenderProgress::cancel)).
    #[error("the picture was broken off after {samples} of {total} paths")]
    Cancelled {
        /// Paths that were followed.
        samples: u64,
        /// Paths that there were to follow.
        total: u64,
    },
    /// Rays of a lens that are not those of the image.
    #[error(
        "rays of a lens for {found:?} pixels with {found_samples} samples, but the picture has {expected:?} pixels and needs \
         {samples}"
    )]
    LensRays {
        /// Pixels per row and rows of the image.
        expected: [usize; 2],
        /// Samples per pixel that its colors need.
        samples: u8,
        /// Pixels per row and rows that the rays are for.
        found: [usize; 2],
        /// Samples per pixel that they are for.
        found_samples: u8,
    },
    /// An exposure that is none.
    #[error("an exposure of {stops} stops; it must be -20 to 20")]
    Stops {
        /// The number.
        stops: f32,
    },
    /// A number of samples that is not offered.
    #[error("{samples} samples per pixel; 1 and 4 are possible")]
    Samples {
        /// The number.
        samples: u8,
    },
}
