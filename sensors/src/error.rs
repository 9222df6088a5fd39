//! What can be wrong with a sensor.

use crate::camera::{CalibrationError, CameraError};
use crate::ray::RayError;
use kinetoscope_scene::Requires;

/// Why a sensor cannot be built or updated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// The physics step is not a positive number.
    #[error("the physics step is {dt} s; it must be a positive number")]
    InvalidTimeStep {
        /// The physics step \[s\].
        dt: f64,
    },
    /// The sensor panicked while it measured.
    #[error("a panic broke its measurement off")]
    BrokenOff,
    /// The update period is negative, infinite or not a number.
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
        /// The period in steps.
        steps: f64,
        /// The nearest period that would do \[s\].
        nearest: f64,
    },
    /// An index names something that does not exist.
    #[error("there is no {what} {index}: there are {count}, counted from 0")]
    IndexOutOfRange {
        /// What is counted.
        what: &'static str,
        /// The index given.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// The state lacks what the sensor requires.
    #[error("the {sensor} sensor was given a state without {missing}")]
    MissingFields {
        /// The kind of sensor.
        sensor: &'static str,
        /// What is not there.
        missing: Requires,
    },
    /// The state is not of the scene that the sensor was built for.
    #[error("the state has {found} {what}, the sensor was built for {expected}")]
    WrongShape {
        /// What is counted.
        what: &'static str,
        /// What the sensor was built for.
        expected: usize,
        /// What the state has.
        found: usize,
    },
    /// Nothing is called so.
    #[error("there is no {what} {name:?}; {}", known(.candidates))]
    UnknownName {
        /// What kind of thing was looked for.
        what: &'static str,
        /// The name given.
        name: String,
        /// Names that exist, nearest first.
        candidates: Vec<String>,
    },
    /// Several things are called so.
    #[error("{what} {name:?} may be any of {}; give the full name", quoted(.candidates))]
    AmbiguousName {
        /// What kind of thing was looked for.
        what: &'static str,
        /// The name given.
        name: String,
        /// What it may mean.
        candidates: Vec<String>,
    },
    /// A name pattern is no regular expression, or two match the same name.
    #[error("{0}")]
    Pattern(String),
    /// A number of the configuration is out of range.
    #[error("{field} is {value}; {expected}")]
    OutOfRange {
        /// Which number.
        field: String,
        /// The value given.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A contact sensor without bodies.
    #[error("there are no bodies to watch; give patterns of their names{}", if .candidates.is_empty() { String::new() } else { format!(", such as {}", quoted(.candidates)) })]
    NoBodies {
        /// Bodies that exist.
        candidates: Vec<String>,
    },
    /// A sensor that is told to measure nothing at all.
    #[error("the {sensor} sensor would measure nothing: {field}: there is no {what}; {}", known(.candidates))]
    NothingChosen {
        /// The kind of sensor.
        sensor: &'static str,
        /// Which field of its configuration.
        field: &'static str,
        /// What it names.
        what: &'static str,
        /// Names that exist, the first of them.
        candidates: Vec<String>,
    },
    /// A contact sensor of one body that looks for contacts of that body with itself.
    #[error("the filter {filter:?} means only {body:?}, the one body that is watched: it does not touch itself")]
    OwnFilter {
        /// The body.
        body: String,
        /// The filter.
        filter: String,
    },
    /// A contact sensor that is to tell counterparts apart, without any.
    #[error(
        "{field} tells forces apart by filter, and there are no filters; name counterparts in `filters` (the sum over all of them is {always}, which is always there)"
    )]
    NoFilters {
        /// What was asked for.
        field: &'static str,
        /// What says the same of all counterparts together.
        always: &'static str,
    },
    /// A link that fixed joints fuse to another one: no joint holds it alone.
    #[error("the link {link:?} is fused to {carrier:?} by fixed joints; measure the joint of {carrier:?} instead")]
    FusedLink {
        /// The link.
        link: String,
        /// The link that moves it.
        carrier: String,
    },
    /// Two things of a sensor are called alike.
    #[error("there are two {what}s called {name:?}; give each a name of its own")]
    NameTaken {
        /// What they are.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// History and latency need more memory than can be given.
    #[error(
        "{rows} measurements of {width} numbers in {num_envs} environments do not fit into memory; make history_length \
         or latency_steps smaller"
    )]
    TooLarge {
        /// Measurements to keep in each environment.
        rows: usize,
        /// Numbers in a measurement.
        width: usize,
        /// Number of environments.
        num_envs: usize,
    },
    /// Something is wrong with a camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Something is wrong with one eye of a pair.
    #[error("the {eye} eye: {error}")]
    Eye {
        /// `left` or `right`.
        eye: &'static str,
        /// What is wrong with it.
        error: Box<SensorError>,
    },
    /// Something is wrong with a calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Something is wrong with a ray caster.
    #[error(transparent)]
    Ray(#[from] RayError),
}

impl SensorError {
    /// What is wrong with an eye of a pair.
    pub(crate) fn of_eye(eye: &'static str) -> impl FnOnce(Self) -> Self {
        move |error| Self::Eye { eye, error: Box::new(error) }
    }
}

fn quoted(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("{n:?}")).collect();
    quoted.join(", ")
}

fn known(candidates: &[String]) -> String {
    if candidates.is_empty() { "there are none".into() } else { format!("known are {}", quoted(candidates)) }
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
