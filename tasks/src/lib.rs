//! Reinforcement-learning tasks: a batch of environments with observations, actions, rewards, terminations and resets.
//!
//! ```text
//! actions -> ActionTerm -> SimulationManager -> TerminationTerm, RewardTerm -> EventTerm -> ObservationTerm -> Step
//! ```
//!
//! A task is built from terms, as in Isaac Lab. A term is a plain value: a name and a function of the simulation.
//!
//! | item | role |
//! |---|---|
//! | [`VectorEnv`] | interface for learning code: spaces, `reset`, `step`, as in Gymnasium |
//! | [`Env`], [`EnvBuilder`], [`EnvCfg`] | the implementation of [`VectorEnv`] with a simulation and terms |
//! | [`ActionTerm`], [`EventTerm`] | write to the simulation: actions, resets, pushes |
//! | [`ObservationTerm`], [`ImageTerm`], [`RewardTerm`], [`TerminationTerm`] | read from the simulation, through [`TermContext`] |
//! | [`CommandTerm`], [`CurriculumTerm`] | numbers of each environment: goals of an episode, levels of difficulty |
//! | [`ObservationGroup`] | observations for one network: numbers of both precisions, and images |
//! | [`mod@terms`] | ready-made terms for robots |
//! | [`TaskCfg`], [`TermRegistry`] | tasks as text, whose terms are named by their type |
//! | [`Space`], [`Step`] | named columns with bounds; the result of a step |
//! | [`EpisodeRng`] | random numbers of one environment, episode and term |
//! | [`fn@check`] | tests an implementation of [`VectorEnv`] |
//!
//! An environment whose episode ends begins the next one in the same step, in the next one, or when it is reset
//! ([`AutoresetMode`]). [`Env`] documents the order of a step.
//!
//! The random numbers of a task are keyed by its seed, the global index of the environment, the number of the episode
//! and the name of the term. The same keys give the same bits for any number of environments, threads and processes.
//!
//! ```
//! use kinetoscope_sim::{DriveCfg, DriveType, JointIndex, MjcfFile, RobotCfg, SimulationManager, SimulationManagerCfg};
//! use kinetoscope_tasks::{ActionTerm, EnvBuilder, EnvCfg, EventTerm, ObservationTerm, RewardTerm, Space};
//! use kinetoscope_tasks::TerminationTerm;
//! use ndarray::{Array2, array};
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
//!     .event(EventTerm::on_reset("scatter", move |sim, rngs| {
//!         for rng in rngs {
//!             let start = array![[rng.uniform_range(-0.5, 0.5)]];
//!             sim.robot_mut(cart).write_qpos(&start, Some(&[JointIndex(0)]), Some(&[rng.env()]))?;
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
mod autoreset;
mod builder;
mod cfg;
mod check;
mod command;
mod context;
mod curriculum;
mod environment;
mod episode_rng;
mod error;
mod event;
mod group;
mod guard;
mod image;
mod observation;
mod registry;
mod reset_monitor;
mod reward;
mod robot_cache;
mod space;
mod step;
mod stepping;
mod task_cfg;
mod termination;
pub mod terms;
mod vector;

pub use action::ActionTerm;
pub use autoreset::AutoresetMode;
pub use builder::EnvBuilder;
pub use cfg::EnvCfg;
pub use check::{Finding, RunDifference, check};
pub use command::CommandTerm;
pub use context::{EventContext, TermContext};
pub use curriculum::CurriculumTerm;
pub use environment::Env;
pub use episode_rng::{EpisodeRng, env_ids};
pub use error::{EnvError, Result, TermError, TermKind, TermResult};
pub use event::{EventMode, EventTerm};
pub use group::{ObservationGroup, POLICY_GROUP};
pub use image::{ImageBatch, ImageElement, ImageSpace, ImageTerm};
pub use observation::{Noise, ObservationTerm};
pub use registry::{TermArgs, TermRegistry};
pub use reward::RewardTerm;
pub use space::Space;
pub use step::{EndReason, EndedEpisode, Step, StepInfo};
pub use task_cfg::TaskCfg;
pub use termination::TerminationTerm;
pub use vector::VectorEnv;
