//! Sensor errors.

use crate::camera::{CalibrationError, CameraError};
use crate::ray::RayError;
use kinetoscope_scene::StateFields;

/// Errors of building or updating a sensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// The physics step is not a positive number.
    #[error("the physics step is {dt} s; it must be a positive number")]
    InvalidTimeStep {
        /// The physics step \[s\].
        dt: f64,
    },
    /// The sensor panicked. It is not called again until it is rebuilt.
    #[error("the sensor panicked: {message}")]
    Panicked {
        /// Message of the panic.
        message: String,
    },
    /// The update period is negative, infinite, not a number, or at least 2^53 physics steps.
    #[error("update_period is {update_period} s; it must be 0 (every step) or a positive number")]
    InvalidPeriod {
        /// The period \[s\].
        update_period: f64,
    },
    /// The update period is not a whole number of physics steps.
    #[error(
        "update_period {update_period} s is {steps} physics steps of {dt} s; use a whole number of steps, such as \
         {nearest} s, or set round_period"
    )]
    PeriodNotMultiple {
        /// The period \[s\].
        update_period: f64,
        /// The physics step \[s\].
        dt: f64,
        /// The period in physics steps.
        steps: f64,
        /// Nearest valid period \[s\].
        nearest: f64,
    },
    /// An index is out of range.
    #[error("{what} {index} does not exist; there are {count} (0 to {})", count.saturating_sub(1))]
    IndexOutOfRange {
        /// Kind of item.
        what: &'static str,
        /// The given index.
        index: usize,
        /// Number of items.
        count: usize,
    },
    /// The state lacks fields that the sensor requires.
    #[error("the state lacks {missing}, which the {sensor} sensor requires")]
    MissingFields {
        /// Kind of sensor.
        sensor: &'static str,
        /// Missing fields.
        missing: StateFields,
    },
    /// The state does not belong to the scene that the sensor was built for.
    #[error("the state has {found} {what}, but the sensor was built for {expected}")]
    WrongShape {
        /// Kind of item.
        what: &'static str,
        /// Number of items at construction.
        expected: usize,
        /// Number of items in the state.
        found: usize,
    },
    /// A name is unknown.
    #[error("unknown {what} {name:?}; {}", known_names(.candidates))]
    UnknownName {
        /// Kind of item.
        what: &'static str,
        /// The given name.
        name: String,
        /// Known names, nearest first, at most 12.
        candidates: Vec<String>,
    },
    /// A name without its prefix matches several items.
    #[error("{what} {name:?} is ambiguous: it may be any of {}; give the full name", quoted(.candidates))]
    AmbiguousName {
        /// Kind of item.
        what: &'static str,
        /// The given name.
        name: String,
        /// Full names of the matching items.
        candidates: Vec<String>,
    },
    /// A name pattern is not a regular expression, two patterns match the same name, or the noise of a camera channel
    /// is given by two names of the channel. The string is the message.
    #[error("{0}")]
    Pattern(String),
    /// A number of the configuration is out of range.
    #[error("{field} is {value}; {expected}")]
    OutOfRange {
        /// Name of the number.
        field: String,
        /// The given value.
        value: f64,
        /// Accepted values.
        expected: &'static str,
    },
    /// A contact sensor has no bodies.
    #[error("the contact sensor has no bodies; add patterns of body names{}", if .candidates.is_empty() { String::new() } else { format!(", such as {}", quoted(.candidates)) })]
    NoBodies {
        /// Names of existing bodies, at most 12.
        candidates: Vec<String>,
    },
    /// The configuration selects nothing to measure.
    #[error("the {sensor} sensor has nothing to measure: no {what} is selected by {field}; {}", known_names(.candidates))]
    EmptySelection {
        /// Kind of sensor.
        sensor: &'static str,
        /// Name of the configuration field.
        field: &'static str,
        /// Kind of item that the field selects.
        what: &'static str,
        /// First existing names, at most 12.
        candidates: Vec<String>,
    },
    /// The filter of a contact sensor matches only its single watched body.
    #[error("the filter {filter:?} matches only {body:?}, the only watched body; a body has no contact with itself")]
    SelfFilter {
        /// Name of the body.
        body: String,
        /// Pattern of the filter.
        filter: String,
    },
    /// A contact sensor reports forces by filter, but has no filters.
    #[error(
        "{field} reports forces per filter, but there are no filters; name counterparts in `filters` (the sum over all \
         counterparts is always available as {total_channel})"
    )]
    NoFilters {
        /// Name of the configuration field.
        field: &'static str,
        /// Name of the channel with the sum over all counterparts.
        total_channel: &'static str,
    },
    /// A link is fused to another link by fixed joints, so it has no joint of its own.
    #[error(
        "the link {link:?} is fused to {moving_link:?} by fixed joints; measure the joint of {moving_link:?} instead"
    )]
    FusedLink {
        /// Name of the link.
        link: String,
        /// Name of the link that moves it.
        moving_link: String,
    },
    /// Two items of a sensor have the same name.
    #[error("there are two {what}s with the name {name:?}; give them different names")]
    DuplicateName {
        /// Kind of item.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// The measurements of history and latency need more than 4 GiB.
    #[error(
        "{rows} measurements of {width} numbers in {num_envs} environments do not fit into memory; reduce history_length \
         or latency_steps"
    )]
    TooLarge {
        /// Measurements to keep in each environment.
        rows: usize,
        /// Numbers in a measurement.
        width: usize,
        /// Number of environments.
        num_envs: usize,
    },
    /// A camera error.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// An error of one camera of a stereo camera.
    #[error("the {side} camera: {error}")]
    StereoCamera {
        /// `left` or `right`.
        side: &'static str,
        /// The error.
        error: Box<SensorError>,
    },
    /// A calibration error.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A ray caster error.
    #[error(transparent)]
    Ray(#[from] RayError),
}

impl SensorError {
    /// Wraps an error of one camera of a stereo camera.
    pub(crate) fn of_stereo_camera(side: &'static str) -> impl FnOnce(Self) -> Self {
        move |error| Self::StereoCamera { side, error: Box::new(error) }
    }
}

fn quoted(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("{n:?}")).collect();
    quoted.join(", ")
}

fn known_names(candidates: &[String]) -> String {
    if candidates.is_empty() { "no names are defined".into() } else { format!("known names: {}", quoted(candidates)) }
}

impl From<kinetoscope_scene::pattern::UnknownName> for SensorError {
    fn from(error: kinetoscope_scene::pattern::UnknownName) -> Self {
        Self::UnknownName { what: error.what, name: error.name, candidates: error.candidates }
    }
}

impl From<kinetoscope_render::OpticsError> for SensorError {
    fn from(error: kinetoscope_render::OpticsError) -> Self {
        Self::Camera(error.into())
    }
}
