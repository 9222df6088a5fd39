#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod assets;

pub use ndarray;
pub use scene;
pub use sensors;
pub use sim;

/// What most programs need: `use kinetoscope::prelude::*;`.
pub mod prelude {
    pub use crate::assets;
    pub use scene::Pose;
    pub use sim::{
        ComponentCfg, Diagnostic, DriveCfg, DriveModel, DriveType, EnvId, Error, Integrator, JointIndex, NameCase,
        NameCaseCfg, PerJoint, Result, RobotCfg, RobotId, SimulationManager, SimulationManagerCfg, UrdfCfg,
    };
}
