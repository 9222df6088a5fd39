//! Camera errors.

use kinetoscope_render::OpticsError;
use kinetoscope_render::RenderError;

/// Errors of building, placing or reading a camera.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// Size, intrinsics, depth range, number of samples, aperture, shutter or renderer are invalid, or do not fit
    /// together.
    #[error("invalid camera view: {0}")]
    View(RenderError),
    /// The image of an environment cannot be rendered. It is rendered again after the next capture, or at the next read
    /// if rendering was canceled.
    #[error("environment {env} cannot be rendered: {error}")]
    Render {
        /// The environment.
        env: usize,
        /// Reason.
        error: RenderError,
    },
    /// A lens or its intrinsics are invalid.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// A pose has a number that is not finite (or too large for the renderer), or a quaternion of norm 0.
    #[error("pose {row} is not a rigid transform [x, y, z, qw, qx, qy, qz]: {pose:?}")]
    Pose {
        /// Index of the pose among the given ones.
        row: usize,
        /// The pose \[x, y, z, qw, qx, qy, qz\], with x, y, z in meters.
        pose: [f64; 7],
    },
    /// Rows of poses do not have seven numbers.
    #[error("a pose is a row of 7 numbers [x, y, z, qw, qx, qy, qz], not {columns}")]
    PoseColumns {
        /// Numbers per row.
        columns: usize,
    },
    /// The position of the camera and its target coincide, or a number is not finite (or too large for the renderer).
    #[error("a camera at {eye:?} cannot look at {target:?}: both must be finite, and they must differ")]
    LookAt {
        /// Position of the camera, in the frame of its parent or of the environment \[m\].
        eye: [f64; 3],
        /// Position of the target, in the same frame \[m\].
        target: [f64; 3],
    },
    /// The number of values does not match the number of environments.
    #[error("{found} {what} for {expected} environments; give one for each, or one for all")]
    Count {
        /// Name of the values.
        what: &'static str,
        /// Number of environments.
        expected: usize,
        /// Number of given values.
        found: usize,
    },
    /// The camera has no environment.
    #[error("a camera needs at least one environment")]
    NoEnvironments,
    /// An environment is named twice.
    #[error("environment {env} is named twice")]
    DuplicateEnvironment {
        /// The environment.
        env: usize,
    },
    /// The camera does not see this environment.
    #[error("the camera does not see environment {env}; it sees {}", first_ids(.seen))]
    NotSeen {
        /// The environment.
        env: usize,
        /// Environments of the camera.
        seen: Vec<usize>,
    },
    /// The camera has no channels.
    #[error("the camera has no channels; name at least one")]
    NoChannels,
    /// The camera does not measure this channel.
    #[error("the camera does not measure {channel}; it measures {}", .enabled.join(", "))]
    ChannelOff {
        /// Name of the channel.
        channel: &'static str,
        /// Measured channels.
        enabled: Vec<&'static str>,
    },
    /// Disparity needs parallel cameras side by side with equal fx, fy and cy.
    #[error("disparity needs a rectified stereo camera: {what} is {value}; it must be {expected}")]
    NotRectified {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Value in a rectified stereo pair.
        expected: String,
    },
    /// The images of the stereo pair cannot be rectified.
    #[error("this stereo camera cannot be rectified: {what} is {value}; it must be {expected}")]
    NotRectifiable {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Accepted values.
        expected: &'static str,
    },
    /// Two calibrations do not belong to a left and a right camera.
    #[error("the calibrations do not belong to a stereo camera: {what} is {value}; it must be {expected}")]
    NotAStereoPair {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: String,
        /// Value in a stereo pair.
        expected: String,
    },
    /// A feature is only defined for pinhole cameras.
    #[error("{what}: supported only by pinhole cameras, but this camera has the lens {lens}; remove one of the two")]
    PinholeOnly {
        /// Name of the feature.
        what: &'static str,
        /// Name of the lens.
        lens: &'static str,
    },
    /// A feature needs an optical axis, which the lens does not have.
    #[error("{what} needs an optical axis, which the lens {lens} does not have; remove it, or choose another lens")]
    NoAxis {
        /// Name of the feature.
        what: &'static str,
        /// Name of the lens.
        lens: &'static str,
    },
    /// Flow is combined with latency, dropout or a history.
    #[error(
        "flow relates two consecutive images: a camera with flow cannot have latency_steps, dropout or history_length"
    )]
    FlowWithLatency,
    /// The shutter is open for longer than the time between images.
    #[error(
        "the shutter span is {span} s, from the first light to the last row, but the image period is {period} s; reduce \
         row_time, exposure_time or the image height, or increase update_period"
    )]
    ShutterTooSlow {
        /// Span of the shutter, from the first light to the last row \[s\].
        span: f64,
        /// Time between images \[s\].
        period: f64,
    },
    /// Flow is combined with a shutter of nonzero span.
    #[error(
        "flow relates two instants: a camera with flow needs a shutter of one instant (row_time and exposure_time 0)"
    )]
    FlowWithShutterSpan,
    /// A mask id is invalid.
    #[error("mask id {id} {problem}")]
    MaskId {
        /// The mask id.
        id: i32,
        /// The problem.
        problem: &'static str,
    },
    /// The pose of an instance is not finite, so it has no box.
    #[error("the pose of the entity with mask id {id} in environment {env} is not finite, so it has no box")]
    EntityPose {
        /// The environment.
        env: usize,
        /// The mask id.
        id: i32,
    },
    /// The images of all environments do not fit into memory.
    #[error(
        "images of {views} environments with {width} x {height} pixels of {bytes_per_pixel} bytes{} do not fit into memory \
         (at most {limit} bytes)",
        if *.path_tracing_bytes > 0 { format!(", with {} bytes for path tracing,", .path_tracing_bytes) } else { String::new() }
    )]
    Memory {
        /// Number of environments.
        views: usize,
        /// Image width \[pixels\].
        width: usize,
        /// Image height \[pixels\].
        height: usize,
        /// Memory per pixel \[bytes\].
        bytes_per_pixel: usize,
        /// Memory of path tracing, needed once for all images \[bytes\].
        path_tracing_bytes: usize,
        /// Memory limit \[bytes\].
        limit: u64,
    },
    /// History and frames in flight do not fit into memory.
    #[error(
        "{images} images of history and {pending_frames} frames in flight, in each of {views} environments, do not fit into \
         memory (at most {limit} bytes); reduce history_length or latency_steps"
    )]
    HistoryMemory {
        /// Images in the history.
        images: usize,
        /// Frames in flight.
        pending_frames: usize,
        /// Number of environments.
        views: usize,
        /// Memory limit \[bytes\].
        limit: u64,
    },
    /// The camera was built without a scene.
    #[error("the camera was built without a scene")]
    NoScene,
    /// Nothing was captured yet.
    #[error("the camera has not captured environment {env} yet; reset or update it first")]
    NothingCaptured {
        /// The environment.
        env: usize,
    },
}

/// Lists the first eight ids, and counts the others.
fn first_ids(ids: &[usize]) -> String {
    let first: Vec<String> = ids.iter().take(8).map(usize::to_string).collect();
    let more = if ids.len() > 8 { format!(" and {} more", ids.len() - 8) } else { String::new() };
    first.join(", ") + &more
}

impl CameraError {
    /// Returns true if rendering was canceled. The first read after `RenderProgress::resume` renders the image.
    pub(super) fn is_cancelled(&self) -> bool {
        matches!(self, Self::Render { error: RenderError::Canceled { .. }, .. })
    }
}
