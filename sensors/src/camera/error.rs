//! What can be wrong with a camera.

use kinetoscope_render::OpticsError;
use kinetoscope_render::RenderError;

/// Why a camera cannot be built, placed or read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// Size, intrinsics, depth range or number of samples are no good.
    #[error("the camera cannot see: {0}")]
    View(RenderError),
    /// An environment could not be drawn; it is tried again when it was captured anew, and at the next reading where somebody
    /// broke it off.
    #[error("environment {env} cannot be drawn: {error}")]
    Draw {
        /// The environment.
        env: usize,
        /// Why.
        error: RenderError,
    },
    /// A lens or intrinsics that cannot be used.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// A pose with a number that is not finite (or too large for the renderer), or without a rotation.
    #[error("pose {row} is not a rigid transform [x, y, z, qw, qx, qy, qz]: {pose:?}")]
    Pose {
        /// Which of those given.
        row: usize,
        /// The pose, as a row.
        pose: [f64; 7],
    },
    /// Rows of poses that have not seven numbers.
    #[error("a pose is a row of 7 numbers [x, y, z, qw, qx, qy, qz], not {columns}")]
    PoseColumns {
        /// Numbers in a row.
        columns: usize,
    },
    /// The eye is where the target is, or a number is not finite.
    #[error("a camera at {eye:?} cannot look at {target:?}: both must be finite and apart")]
    LookAt {
        /// Where the camera is \[m\].
        eye: [f64; 3],
        /// What it looks at \[m\].
        target: [f64; 3],
    },
    /// Too few or too many values for the environments.
    #[error("{found} {what} for {expected} environments; give one for each, or one for all")]
    Count {
        /// What is counted.
        what: &'static str,
        /// How many environments are meant.
        expected: usize,
        /// How many values were given.
        found: usize,
    },
    /// The camera would see no environment.
    #[error("a camera needs at least one environment")]
    NoEnvironments,
    /// An environment is named twice.
    #[error("environment {env} is named twice")]
    DuplicateEnvironment {
        /// The environment.
        env: usize,
    },
    /// The camera does not look into this environment.
    #[error("the camera does not see environment {env}; it sees {}", some(.seen))]
    NotSeen {
        /// The environment.
        env: usize,
        /// The environments of the camera.
        seen: Vec<usize>,
    },
    /// The camera would measure nothing.
    #[error("the camera has no channels; name at least one")]
    NoChannels,
    /// A channel that the camera was not asked to measure.
    #[error("the camera does not measure {channel}; it measures {}", .enabled.join(", "))]
    ChannelOff {
        /// The channel.
        channel: &'static str,
        /// Those it measures.
        enabled: Vec<&'static str>,
    },
    /// A disparity was asked of eyes that are not parallel, not side by side, or have different lenses.
    #[error("disparity is defined for a rectified pair of eyes: {what} is {value}, it must be {expected}")]
    NotRectified {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
        /// What it would be in a rectified pair.
        expected: String,
    },
    /// Eyes whose pictures cannot be turned so that both show a point in the same row.
    #[error("the pictures of these eyes cannot be rectified: {what} is {value}, it must be {expected}")]
    NotRectifiable {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
        /// Accepted values.
        expected: &'static str,
    },
    /// Two calibrations that are not those of a left and a right eye.
    #[error("these are no calibrations of a left and a right eye: {what} is {value}; it must be {expected}")]
    NotAPair {
        /// Which number of them.
        what: &'static str,
        /// What it is.
        value: String,
        /// What it would be of a pair.
        expected: String,
    },
    /// Something that is only known of pictures without a lens.
    #[error("{what}: only of a pinhole camera, and this one has the lens {lens}; leave it out, or the lens")]
    PinholeOnly {
        /// What was asked for.
        what: &'static str,
        /// The lens.
        lens: &'static str,
    },
    /// Something that needs an optical axis, of a lens that has none.
    #[error("{what}: the lens {lens} has no optical axis; take it away, or choose another lens")]
    NoAxis {
        /// What was asked for.
        what: &'static str,
        /// The lens.
        lens: &'static str,
    },
    /// Flow of a camera whose pictures come late, get lost, or are kept.
    #[error(
        "flow is from the picture before to the one now: a camera with flow has no latency_steps, dropout or history_length"
    )]
    FlowOfThePast,
    /// A shutter that is open longer than there is time between pictures.
    #[error(
        "the shutter takes {span} s, from the first light to the last row, and there is a picture every {period} s; make \
         row_time, exposure_time or the picture's height smaller, or update_period larger"
    )]
    ShutterTooSlow {
        /// How long the shutter takes \[s\].
        span: f64,
        /// Time between pictures \[s\].
        period: f64,
    },
    /// Flow of a picture whose rows are of several instants.
    #[error("flow is from one instant to another: a camera with flow has a shutter of one instant")]
    FlowOfRows,
    /// A mask id that no thing can have.
    #[error("mask id {id} {problem}")]
    MaskId {
        /// The id.
        id: i32,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A thing that is nowhere has no box.
    #[error("the pose of the thing with mask id {id} in environment {env} is not finite: it has no box")]
    ThingPose {
        /// The environment.
        env: usize,
        /// The mask id.
        id: i32,
    },
    /// The pictures of all environments do not fit into memory.
    #[error(
        "pictures of {views} environments with {width} x {height} pixels of {bytes_per_pixel} bytes{} do not fit into memory \
         (at most {limit} bytes)",
        if *.paths > 0 { format!(", with {} bytes for paths,", .paths) } else { String::new() }
    )]
    Memory {
        /// How many environments.
        views: usize,
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// Memory of a pixel \[bytes\].
        bytes_per_pixel: usize,
        /// What path tracing needs besides, for one picture at a time \[bytes\].
        paths: usize,
        /// The most that is allowed.
        limit: u64,
    },
    /// History and latency need more memory than can be given.
    #[error(
        "{pictures} past pictures and {captures} captures on their way, in each of {views} environments, do not fit into \
         memory (at most {limit} bytes); make history_length or latency_steps smaller"
    )]
    Past {
        /// Pictures of the history.
        pictures: usize,
        /// Captures on their way.
        captures: usize,
        /// How many environments.
        views: usize,
        /// The most that is allowed.
        limit: u64,
    },
    /// There is no scene to look at.
    #[error("the camera was built without a scene to look at")]
    NoScene,
    /// Nothing was captured yet.
    #[error("the camera has not seen environment {env} yet; it does after the first reset or update")]
    NothingCaptured {
        /// The environment.
        env: usize,
    },
}

/// The first few of a list.
fn some(ids: &[usize]) -> String {
    let first: Vec<String> = ids.iter().take(8).map(usize::to_string).collect();
    let more = if ids.len() > 8 { format!(" and {} more", ids.len() - 8) } else { String::new() };
    first.join(", ") + &more
}

impl CameraError {
    /// Whether somebody broke the drawing off: what is drawn again is another drawing.
    pub(super) fn is_cancelled(&self) -> bool {
        matches!(self, Self::Draw { error: RenderError::Cancelled { .. }, .. })
    }
}
