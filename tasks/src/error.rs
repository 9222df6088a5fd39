//! What can be wrong with a task and with what it is told.

use std::fmt;

/// Result of this crate.
pub type Result<T, E = EnvError> = std::result::Result<T, E>;

/// What the function of a term fails with: anything.
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
    /// [`EventTerm`](crate::EventTerm).
    Event,
    /// [`ObservationTerm`](crate::ObservationTerm).
    Observation,
    /// [`RewardTerm`](crate::RewardTerm).
    Reward,
    /// [`TerminationTerm`](crate::TerminationTerm).
    Termination,
}

impl TermKind {
    /// What errors call what the function of a term gives.
    pub(crate) fn gives(self, name: &str) -> String {
        format!("what the {self} term {name:?} gives")
    }
}

impl fmt::Display for TermKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Action => "action",
            Self::Command => "command",
            Self::Event => "event",
            Self::Observation => "observation",
            Self::Reward => "reward",
            Self::Termination => "termination",
        })
    }
}

/// Why a task cannot be built, reset or stepped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvError {
    /// The simulation refused something.
    #[error(transparent)]
    Sim(#[from] kinetoscope_sim::Error),
    /// A number of the configuration or of a term is out of range.
    #[error("{field} is {value}; {expected}")]
    Config {
        /// The field.
        field: String,
        /// The value given.
        value: String,
        /// What would be right.
        expected: &'static str,
    },
    /// A task without terms that it cannot be without.
    #[error("there is no {kind} term; a task needs at least one")]
    NoTerm {
        /// What is missing.
        kind: TermKind,
    },
    /// A name that cannot be a part of others.
    #[error("{kind} term {name:?}: a name must not be empty, and without a slash")]
    TermName {
        /// The kind of the term.
        kind: TermKind,
        /// Its name.
        name: String,
    },
    /// Two terms of one kind have the same name.
    #[error("there are two {kind} terms called {name:?}; give each a name of its own")]
    RepeatedTerm {
        /// Their kind.
        kind: TermKind,
        /// Their name.
        name: String,
    },
    /// Two columns of one term have the same name.
    #[error("two columns are called {column:?}; give each a name of its own")]
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
        /// What it says.
        #[source]
        error: TermError,
    },
    /// There is no such name.
    #[error("there is no {what} {name:?}; there are: {}", .candidates.join(", "))]
    UnknownName {
        /// What was looked for.
        what: &'static str,
        /// The name given.
        name: String,
        /// Names that exist, the nearest first.
        candidates: Vec<String>,
    },
    /// An array has the wrong shape.
    #[error("{what} has shape {found:?}; expected {expected:?} ({meaning})")]
    Shape {
        /// The array.
        what: String,
        /// Shape given.
        found: Vec<usize>,
        /// Shape that would be right.
        expected: Vec<usize>,
        /// What the axes are.
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
    /// An environment was stepped that was never reset, or not since a step broke off.
    #[error(
        "environment {env} has no episode: call `reset(None, ..)` before the first step, and after a step that failed"
    )]
    ResetFirst {
        /// The environment.
        env: usize,
    },
}

impl EnvError {
    /// The function of a term failed.
    pub(crate) fn term(kind: TermKind, name: &str, error: TermError) -> Self {
        Self::Term { kind, name: name.into(), error }
    }

    /// There is no such name.
    pub(crate) fn unknown<'n>(what: &'static str, name: &str, names: impl IntoIterator<Item = &'n str>) -> Self {
        let candidates = kinetoscope_scene::pattern::closest(name, names).into_iter().map(str::to_string).collect();
        Self::UnknownName { what, name: name.into(), candidates }
    }
}
