//! Tasks for agents: a batch of environments that is observed, acted on, rewarded, and begun again.
//!
//! ```text
//! actions -> ActionTerm -> SimulationManager -> TerminationTerm, RewardTerm -> EventTerm -> ObservationTerm -> Step
//! ```
//!
//! [`VectorEnv`] is what Gymnasium calls so: spaces, `reset`, `step`. An [`Env`] is one that is made of terms as tasks of Isaac Lab
//! are: each term is a plain value with a name and a function of the simulation ([`Now`]). Environments whose episode ends begin the next one in the same
//! step ([`Env::step`] says what can be relied on). Random numbers of a task are keyed by its seed, the global index of
//! the environment, the number of the episode and the name of the term: bits depend neither on the number of environments, of
//! threads and of processes, nor on what other environments do.
//!
//! ```
//! use kinetoscope_tasks::{ActionTerm, EnvBuilder, EnvCfg, EventTerm, ObservationTerm, RewardTerm, Space, TerminationTerm};
//! use ndarray::{Array2, array};
//! use kinetoscope_sim::{DriveCfg, DriveType, JointIndex, MjcfFile, RobotCfg, SimulationManager, SimulationManagerCfg};
//!
//! let cart = r#"<mujoco><worldbody><body name="rail"><geom size="0.01"/><body name="cart">
//!     <joint name="slide" type="slide" axis="1 0 0"/><geom size="0.1" mass="2"/></body></body></worldbody></mujoco>"#;
//! let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 4, ..Default::default() })?;
//! let cart = sim.add_robot(RobotCfg {
//!     mjcf: Some(MjcfFile::text(cart)),
//!     drive: DriveCfg { drive_type: DriveType::None, ..Default::default() },
//!     ..Default::default()
//! })?;
//! let mut env = EnvBuilder::new(sim, EnvCfg { episode_steps: Some(100), ..Default::default() })
//!     .action(ActionTerm::new("push", Space::uniform(["slide"], [-5.0, 5.0])?, move |sim, forces| {
//!         Ok(sim.robot_mut(cart).set_qf_target(forces, None, None)?)
//!     }))
//!     .observation(ObservationTerm::new("place", ["slide"], move |now| Ok(now.sim().robot(cart).qpos())))
//!     .reward(RewardTerm::new("near", -1.0, move |now| {
//!         Ok(now.sim().robot(cart).qpos().column(0).mapv(f64::abs))
//!     }))
//!     .termination(TerminationTerm::new("far", move |now| {
//!         Ok(now.sim().robot(cart).qpos().column(0).mapv(|x| x.abs() > 1.0))
//!     }))
//!     .event(EventTerm::on_reset("scatter", move |sim, dice| {
//!         for die in dice {
//!             let start = array![[die.between(-0.5, 0.5)]];
//!             sim.robot_mut(cart).write_qpos(&start, Some(&[JointIndex(0)]), Some(&[die.env()]))?;
//!         }
//!         Ok(())
//!     }))
//!     .build()?;
//!
//! let mut observations = env.reset(None, Some(7))?;
//! for _ in 0..200 {
//!     let step = env.step(&observations.mapv(|x| -5.0 * x))?;
//!     observations = step.observations;
//! }
//! assert_eq!(observations.dim(), (4, 1));
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! ```
#![forbid(unsafe_code)]

mod action;
mod builder;
mod cfg;
mod check;
mod command;
mod dice;
mod environment;
mod error;
mod event;
mod now;
mod observation;
mod reward;
mod space;
mod step;
mod termination;
pub mod terms;
mod vector;
mod watch;

pub use action::ActionTerm;
pub use builder::EnvBuilder;
pub use cfg::EnvCfg;
pub use check::{Apart, Finding, check};
pub use command::CommandTerm;
pub use dice::{Dice, env_ids};
pub use environment::Env;
pub use error::{EnvError, Result, TermError, TermKind, TermResult};
pub use event::{EventTerm, When};
pub use now::Now;
pub use observation::{Noise, ObservationTerm};
pub use reward::RewardTerm;
pub use space::Space;
pub use step::{EndReason, Ended, Info, Step};
pub use termination::TerminationTerm;
pub use vector::VectorEnv;
