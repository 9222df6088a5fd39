//! Kinematics of a [`RobotDescription`](crate::description::RobotDescription) without MuJoCo: poses of frames,
//! Jacobians, and inverse kinematics.
//!
//! [`Chain`] is the kinematic chain from a base link to a frame, with everything that does not move folded together. It
//! computes the pose of the frame ([`Chain::pose`]) and its Jacobian ([`Chain::jacobian`]). [`IkSolver`] finds
//! positions for a pose. All of them work in the axes of the base link. `Robot::compute_fk`, `Robot::jacobian` and
//! `Robot::compute_ik` of the simulation crate apply them to the environments of a simulation, in the frames of the
//! environments.
//!
//! Mimic joints are not variables: the motion of a mimic joint is part of the motion of its driver.
//!
//! ```
//! use nalgebra::Vector3;
//! use kinetoscope_scene::Pose;
//! use kinetoscope_robot::kinematics::{Chain, IkCfg, IkSolver};
//! # use kinetoscope_robot::urdf::{UrdfCfg, assemble};
//! # let urdf = std::env::temp_dir().join(format!("kinetoscope-slide-{}.urdf", std::process::id()));
//! # std::fs::write(&urdf, "<robot name='r'><link name='rail'/><link name='cart'/><joint name='slide' type='prismatic'>
//! #   <parent link='rail'/><child link='cart'/><axis xyz='0 0 1'/><limit lower='0' upper='2' effort='1' velocity='1'/>
//! #   </joint></robot>")?;
//! # let description = assemble(&UrdfCfg::single(&urdf))?.description;
//! # std::fs::remove_file(&urdf)?;
//! // A cart on a vertical rail of 2 m, and a hook 0.1 m above it.
//! let cart = description.link_id("cart").ok_or("no cart")?;
//! let hook = Pose::translation(0.0, 0.0, 0.1);
//! let chain = Chain::new(&description, cart, &hook)?;
//! assert_eq!(chain.pose(&[0.4]).translation.vector, Vector3::new(0.0, 0.0, 0.5));
//! let mut solver = IkSolver::new(chain, vec![[0.0, 2.0]], IkCfg::default())?;
//! let found = solver.solve(&Pose::translation(0.0, 0.0, 1.1), &[0.0])?;
//! assert!(found.success && (found.positions[0] - 1.0).abs() < 1e-4);
//! // Beyond the end of the rail: the solver returns the nearest position and reports the failure.
//! let found = solver.solve(&Pose::translation(0.0, 0.0, 2.6), &[0.0])?;
//! assert!(!found.success && (found.position_error - 0.5).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cfg;
mod chain;
mod error;
mod forward;
mod inverse;
mod jacobian;
mod least_squares;

pub use cfg::{IkCfg, IkTask, NullSpacePosture, TipFrame};
pub use chain::Chain;
pub use error::KinematicsError;
pub use inverse::{IkSolution, IkSolver};

pub use cfg::TipSelector;
pub use forward::link_poses;
