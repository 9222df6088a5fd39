//! Errors of tasks and their terms.

use kinetoscope_scene::pattern::PatternError;
use std::fmt;

/// Result of this crate.
pub type Result<T, E = EnvError> = std::result::Result<T, E>;

/// Error of a term's function: any error type.
pub type TermError = Box<dyn std::error::Error + Send + Sync>;

/// Result of the function of a term.
pub type TermResult<T = ()> = std::result::Result<T, TermError>;

/// Kinds of terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TermKind {
    /// [`ActionTerm`](crate::ActionTerm).
    Action,
    /// [`CommandTerm`](crate::CommandTerm).
    Command,
    /// [`CurriculumTerm`](crate::CurriculumTerm).
    Curriculum,
    /// [`EventTerm`](crate::EventTerm).
    Event,
    /// [`ObservationTerm`](crate::ObservationTerm) or [`ImageTerm`](crate::ImageTerm).
    Observation,
    /// [`RewardTerm`](crate::RewardTerm).
    Reward,
    /// [`TerminationTerm`](crate::TerminationTerm).
    Termination,
}

impl TermKind {
    /// Label of the result of a term's function, for error messages.
    pub(crate) fn result_label(self, name: &str) -> String {
        format!("the result of the {self} term {name:?}")
    }
}

impl fmt::Display for TermKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Action => "action",
            Self::Command => "command",
            Self::Curriculum => "curriculum",
            Self::Event => "event",
            Self::Observation => "observation",
            Self::Reward => "reward",
            Self::Termination => "termination",
        })
    }
}

/// Error of building, resetting or stepping a task.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvError {
    /// The simulation returned an error.
    #[error(transparent)]
    Sim(#[from] kinetoscope_sim::Error),
    /// A number of the configuration or of a term is out of range, or the name of an observation group is invalid.
    #[error("{field} is {value}; {expected}")]
    Config {
        /// The field.
        field: String,
        /// The value given.
        value: String,
        /// Accepted values.
        expected: &'static str,
    },
    /// A task has no column of a kind that it needs.
    #[error("the task has no {kind} column; add at least one {kind} term")]
    NoTerm {
        /// The missing kind of term.
        kind: TermKind,
    },
    /// The name of a term is empty or contains a slash, the separator of keys and column names.
    #[error("{kind} term {name:?}: a name must not be empty or contain a slash")]
    TermName {
        /// The kind of the term.
        kind: TermKind,
        /// Its name.
        name: String,
    },
    /// Two terms of one kind, or of one observation group, have the same name.
    #[error("there are two {kind} terms with the name {name:?}; give them different names")]
    RepeatedTerm {
        /// Their kind.
        kind: TermKind,
        /// Their name.
        name: String,
    },
    /// Two columns of one term have the same name.
    #[error("there are two columns with the name {column:?}; give them different names")]
    RepeatedColumn {
        /// Their name.
        column: String,
    },
    /// Bounds of a column that hold no number.
    #[error("the bounds of column {column:?} are {low} and {high}; the first must be at most the second")]
    Bounds {
        /// The column.
        column: String,
        /// The lower one.
        low: f64,
        /// The upper one.
        high: f64,
    },
    /// The function of a term failed.
    #[error("the {kind} term {name:?} failed: {error}")]
    Term {
        /// Kind of the term.
        kind: TermKind,
        /// Its name.
        name: String,
        /// Error of the function.
        #[source]
        error: TermError,
    },
    /// The function of a term panicked.
    #[error("the {kind} term {name:?} panicked: {message}")]
    TermPanic {
        /// Kind of the term.
        kind: TermKind,
        /// Its name.
        name: String,
        /// Message of the panic.
        message: String,
    },
    /// The images of a term have another type of components than its space.
    #[error("{what} has components of type {found:?}; expected {expected:?}")]
    Element {
        /// The images.
        what: String,
        /// Type given.
        found: crate::ImageElement,
        /// Type of the space.
        expected: crate::ImageElement,
    },
    /// A task as text is invalid.
    #[error("{place}: {error}")]
    TaskText {
        /// The term or key, such as `rewards.upright`.
        place: String,
        /// The mistake, with the expected keys or values.
        error: String,
    },
    /// A term of a task as text cannot be created.
    #[error("{place}: {error}")]
    TaskTerm {
        /// The term, such as `rewards.upright`.
        place: String,
        /// The mistake.
        #[source]
        error: Box<EnvError>,
    },
    /// There is no such name.
    #[error("unknown {what} {name:?}; known names: {}", .candidates.join(", "))]
    UnknownName {
        /// Kind of name.
        what: &'static str,
        /// The name given.
        name: String,
        /// Names that exist, the nearest first; at most 12.
        candidates: Vec<String>,
    },
    /// A pattern of names is invalid or matches nothing, or two patterns match one name.
    #[error("{field}: {error}")]
    Pattern {
        /// The field of a term.
        field: String,
        /// The mistake, with candidates.
        #[source]
        error: Box<PatternError>,
    },
    /// An array has the wrong shape.
    #[error("{what} has shape {found:?}; expected {expected:?} ({meaning})")]
    Shape {
        /// The array.
        what: String,
        /// Shape given.
        found: Vec<usize>,
        /// Expected shape.
        expected: Vec<usize>,
        /// Meaning of the axes.
        meaning: &'static str,
    },
    /// A number is NaN or infinite.
    #[error("{what} of environment {env}, column {column:?}, is {value}; it must be finite")]
    NotFinite {
        /// The array.
        what: String,
        /// The environment.
        env: usize,
        /// Name of the column.
        column: String,
        /// The value.
        value: f64,
    },
    /// An environment whose episode has ended was stepped without a reset, in the mode
    /// [`AutoresetMode::Disabled`](crate::AutoresetMode::Disabled).
    #[error(
        "the episode of environment {env} has ended, and automatic resets are disabled: reset it by a mask before the \
         next step"
    )]
    EpisodeEnded {
        /// The environment.
        env: usize,
    },
    /// An environment without an episode was stepped: it was never reset, or its last reset or the last step failed.
    #[error(
        "environment {env} has no episode: call `reset(None, ..)` before the first step, and after a step that failed"
    )]
    ResetFirst {
        /// The environment.
        env: usize,
    },
}

impl EnvError {
    /// Creates [`Term`](Self::Term).
    pub(crate) fn term(kind: TermKind, name: &str, error: TermError) -> Self {
        Self::Term { kind, name: name.into(), error }
    }

    /// Creates [`Pattern`](Self::Pattern) for the field of a term.
    pub(crate) fn pattern(kind: TermKind, name: &str, field: &str, error: PatternError) -> Self {
        Self::Pattern { field: format!("{field} of the {kind} term {name:?}"), error: Box::new(error) }
    }

    /// Creates [`UnknownName`](Self::UnknownName) with the candidates nearest to `name`.
    pub(crate) fn unknown<'n>(what: &'static str, name: &str, names: impl IntoIterator<Item = &'n str>) -> Self {
        let candidates =
            kinetoscope_scene::pattern::closest_names(name, names).into_iter().map(str::to_string).collect();
        Self::UnknownName { what, name: name.into(), candidates }
    }
}
