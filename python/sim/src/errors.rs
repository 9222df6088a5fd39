//! Failures of calls, and the Python exception classes that report them.

use kinetoscope::assets::AssetNotFound;
use kinetoscope::record::RecordError;
use kinetoscope::render::OpticsError;
use kinetoscope::robot::dynamics::DynamicsError;
use kinetoscope::robot::kinematics::KinematicsError;
use kinetoscope::scene::terrain::TerrainError;
use kinetoscope::sensors::SensorError;
use kinetoscope::sim::inspect::InspectError;
use kinetoscope::sim::{DeviceError, Error};
use kinetoscope::viewer::{PlayError, ScreenshotError, ServeError, WindowError};
use pyo3::prelude::*;
use std::any::Any;

/// Name of an exception class of `kinetoscope.errors`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Other,
    Config,
    Device,
    Model,
    UnknownName,
    OutOfRange,
    Argument,
    Sensor,
    Snapshot,
    File,
    Recording,
    Viewer,
    Destroyed,
    ForeignHandle,
    Fork,
    Internal,
}

impl Class {
    fn name(self) -> &'static str {
        match self {
            Self::Other => "KinetoscopeError",
            Self::Config => "ConfigError",
            Self::Device => "DeviceError",
            Self::Model => "ModelError",
            Self::UnknownName => "UnknownNameError",
            Self::OutOfRange => "OutOfRangeError",
            Self::Argument => "ArgumentError",
            Self::Sensor => "SensorError",
            Self::Snapshot => "SnapshotError",
            Self::File => "FileError",
            Self::Recording => "RecordingError",
            Self::Viewer => "ViewerError",
            Self::Destroyed => "DestroyedError",
            Self::ForeignHandle => "ForeignHandleError",
            Self::Fork => "ForkError",
            Self::Internal => "InternalError",
        }
    }
}

/// Failure of a call: exception class and message. It can be created without the interpreter.
#[derive(Debug)]
pub(crate) struct Failure {
    class: Class,
    message: String,
}

impl Failure {
    pub(crate) fn new(class: Class, message: impl Into<String>) -> Self {
        Self { class, message: message.into() }
    }

    /// Failure of an argument, named in the message.
    pub(crate) fn argument(name: &str, problem: impl std::fmt::Display) -> Self {
        Self::new(Class::Argument, format!("{name}: {problem}"))
    }

    /// Failure with the messages of an error and of its causes.
    pub(crate) fn caused(class: Class, error: &dyn std::error::Error) -> Self {
        let mut message = error.to_string();
        let mut next = error.source();
        while let Some(cause) = next {
            let cause_message = cause.to_string();
            if !message.contains(&cause_message) {
                message = format!("{message}: {cause_message}");
            }
            next = cause.source();
        }
        Self { class, message }
    }

    /// Failure of a call that panicked.
    pub(crate) fn panic(payload: &(dyn Any + Send)) -> Self {
        let text = payload.downcast_ref::<&str>().map(ToString::to_string);
        let text = text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into());
        let message = format!("bug in Kinetoscope, please report it: {text}");
        Self { class: Class::Internal, message }
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| {
            let class = py.import("kinetoscope.errors").and_then(|errors| errors.getattr(failure.class.name()));
            match class.and_then(|class| class.call1((failure.message,))) {
                Ok(exception) => PyErr::from_value(exception),
                Err(error) => error,
            }
        })
    }
}

impl Class {
    /// Class of an error of a simulation.
    pub(crate) fn of(error: &Error) -> Self {
        match error {
            Error::Config { .. }
            | Error::SceneFile { .. }
            | Error::Exclusion { .. }
            | Error::Entity { .. }
            | Error::DrivePlan { .. }
            | Error::ControlPart { .. }
            | Error::ControlPartRepeated { .. }
            | Error::Payload { .. }
            | Error::Surfaces { .. }
            | Error::Terrain(_)
            | Error::DuplicateUid(_)
            | Error::InvalidUid(_)
            | Error::Integrator { .. }
            | Error::UnsupportedIntegrator { .. }
            | Error::Shard(_) => Self::Config,
            Error::Urdf(_)
            | Error::CollisionMesh { .. }
            | Error::ObjectMesh { .. }
            | Error::Compile(_)
            | Error::MjcfFile { .. }
            | Error::RobotFile { .. }
            | Error::MjcfAttach { .. }
            | Error::MjcfWrite(_) => Self::Model,
            Error::UnknownName { .. } | Error::RobotNames { .. } | Error::MjcfNames { .. } => Self::UnknownName,
            Error::UnknownIndex { .. } => Self::OutOfRange,
            Error::Shape { .. }
            | Error::NotFinite { .. }
            | Error::OutOfRange { .. }
            | Error::RepeatedColumn { .. }
            | Error::RepeatedItem { .. }
            | Error::Randomization(_)
            | Error::Kinematics { .. }
            | Error::EntityType { .. } => Self::Argument,
            Error::Sensor { .. } | Error::SensorFault { .. } | Error::SensorRequires { .. } => Self::Sensor,
            Error::Device(_) => Self::Device,
            Error::Snapshot(_) => Self::Snapshot,
            Error::File { .. } => Self::File,
            _ => Self::Other,
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let class = Class::of(&error);
        // A configuration from Python has no lines.
        if let Error::SceneFile { at, reason } = &error
            && at.file.as_path() == std::path::Path::new(crate::cfg::PYTHON)
        {
            return Self::new(class, reason);
        }
        Self::caused(class, &error)
    }
}

impl From<SensorError> for Failure {
    fn from(error: SensorError) -> Self {
        let class = match &error {
            SensorError::UnknownName { .. } | SensorError::AmbiguousName { .. } => Class::UnknownName,
            SensorError::IndexOutOfRange { .. } => Class::OutOfRange,
            _ => Class::Sensor,
        };
        Self::caused(class, &error)
    }
}

/// Declares the exception class of error types.
macro_rules! classes {
    ($($Error:ty => $class:ident),* $(,)?) => {
        $(impl From<$Error> for Failure {
            fn from(error: $Error) -> Self {
                Self::caused(Class::$class, &error)
            }
        })*
    };
}

classes! {
    RecordError => Recording,
    PlayError => Recording,
    ServeError => Viewer,
    WindowError => Viewer,
    ScreenshotError => Viewer,
    AssetNotFound => File,
    toml::ser::Error => Config,
    serde_json::Error => Internal,
    InspectError => Model,
    DynamicsError => Argument,
    KinematicsError => Argument,
    OpticsError => Argument,
    TerrainError => Config,
    DeviceError => Device,
}

impl Failure {
    /// Failure of a simulation whose state is unknown after a panic.
    pub(crate) fn broken() -> Self {
        Self::new(Class::Internal, BROKEN)
    }
}

/// Message of a simulation that is not usable any more.
const BROKEN: &str = "an earlier call failed inside Kinetoscope (InternalError), and the state of this simulation is \
                      unknown; create a new simulation";
