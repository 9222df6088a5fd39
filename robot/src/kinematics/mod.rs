//! Where frames of a robot are, how joints move them, and which joint positions put them somewhere: kinematics of a
//! [`RobotDescription`](crate::description::RobotDescription), of our own and without MuJoCo.
//!
//! [`Chain`] is the way from a base link to a frame, with everything that does not move folded together; it gives the
//! pose of the frame ([`Chain::pose`]) and its Jacobian ([`Chain::jacobian`]). [`IkSolver`] turns it round. All of them
//! work in the axes of the base link; `Robot::compute_fk`,
//! `Robot::jacobian` and `Robot::compute_ik` do so for the
//! environments of a simulation, and in their frames.
//!
//! Mimic joints are no variables: they follow, and what they do is part of what the joint does that they follow.
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
//! // Beyond the end of the rail: as near as it gets, and said so.
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

pub use cfg::{IkCfg, IkTask, Posture, Tip};
pub use chain::Chain;
pub use error::KinematicsError;
pub use inverse::{IkSolution, IkSolver};

pub use cfg::TipName;
pub use forward::link_poses;
