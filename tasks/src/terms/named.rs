//! The ready-made terms by name: the default [`TermRegistry`].

use super::*;
use crate::command::CommandTerm;
use crate::error::Result as EnvResult;
use crate::event::EventMode;
use crate::registry::{TermArgs, TermRegistry};
use kinetoscope_scene::terrain::TerrainGrid;
use kinetoscope_sensors::ContactSensor;
use kinetoscope_sensors::camera::Camera;
use kinetoscope_sensors::ray::RayCaster;
use kinetoscope_sim::{PerJoint, RandomizationOp};
use serde::Deserialize;

/// Declares the parameters of terms in files: their keys, and the defaults of keys that may be left out.
macro_rules! params {
    ($($Name:ident { $($field:ident: $Type:ty $(= $default:literal)?),* $(,)? })*) => {$(
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct $Name {
            $($(#[serde(default = $default)])? $field: $Type,)*
        }
    )*};
}

params! {
    Nothing {}
    OfRobot { robot: Option<String> }
    OfJoints { robot: Option<String>, joints: Vec<String> = "every_joint" }
    Efforts { robot: Option<String>, joints: Vec<String> = "every_joint", bound: f64 }
    Steps { robot: Option<String>, joints: Vec<String> = "every_joint", step: f64 }
    Numbers { columns: toml::Table, resampling_time: Option<[f64; 2]> }
    Positions { robot: Option<String>, joints: Vec<String> = "every_joint", scale: PerJoint = "unscaled", clip: [f64; 2] = "unbounded" }
    OfCommand { command: String }
    Tracking { robot: Option<String>, command: String, std: f64 }
    Angle { robot: Option<String>, angle: f64 }
    Height { robot: Option<String>, height: f64 }
    Force { sensor: String, force: f64 }
    AirTime { sensor: String, command: String, threshold: f64 }
    Scan { sensor: String, offset: f64 = "isaac_scan_offset" }
    Limit { steps: u64 }
    OfCamera { camera: String }
    Depth { camera: String, range: [f32; 2] }
    JointRanges { robot: Option<String>, joints: Vec<String> = "every_joint", positions: [f64; 2], velocities: [f64; 2] = "zero" }
    Root { robot: Option<String>, position: [[f64; 2]; 3] = "zeros", rpy: [[f64; 2]; 3] = "zeros", linear: [[f64; 2]; 3] = "zeros", angular: [[f64; 2]; 3] = "zeros" }
    Push { robot: Option<String>, mode: Mode, linear: [[f64; 2]; 3] = "zeros", angular: [[f64; 2]; 3] = "zeros" }
    RandomProperty { bodies: Vec<String>, op: RandomizationOp, mode: Mode = "at_startup" }
    OnTerrain { robot: Option<String>, grid: TerrainGrid, curriculum: String, position: [[f64; 2]; 3] = "zeros", rpy: [[f64; 2]; 3] = "zeros", linear: [[f64; 2]; 3] = "zeros", angular: [[f64; 2]; 3] = "zeros" }
    Levels { robot: Option<String>, grid: TerrainGrid, max_initial_level: Option<usize>, command: Option<String>, episode_seconds: f64 = "episode_seconds" }
    Velocity {
        robot: Option<String>,
        lin_vel_x: [f64; 2],
        lin_vel_y: [f64; 2],
        ang_vel_z: [f64; 2],
        heading: Option<[f64; 2]>,
        rel_heading_envs: f64 = "one",
        heading_stiffness: f64 = "one",
        rel_standing_envs: f64 = "no",
        resampling_time: Option<[f64; 2]>,
    }
}

fn every_joint() -> Vec<String> {
    vec![".*".into()]
}

fn zero() -> [f64; 2] {
    [0.0; 2]
}

fn zeros() -> [[f64; 2]; 3] {
    [[0.0; 2]; 3]
}

fn one() -> f64 {
    1.0
}

fn no() -> f64 {
    0.0
}

fn unscaled() -> PerJoint {
    PerJoint::default()
}

fn unbounded() -> [f64; 2] {
    [f64::NEG_INFINITY, f64::INFINITY]
}

/// The default of Isaac Lab's `height_scan` \[m\].
fn isaac_scan_offset() -> f64 {
    0.5
}

fn at_startup() -> Mode {
    Mode::Startup
}

/// Time at which an event happens, in files: `"startup"`, `"reset"` or `{ interval = [500, 750] }`, in steps of the
/// task.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Mode {
    Startup,
    Reset,
    Interval([u64; 2]),
}

impl From<Mode> for EventMode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Startup => Self::Startup,
            Mode::Reset => Self::Reset,
            Mode::Interval(steps) => Self::Interval { steps },
        }
    }
}

fn episode_seconds() -> f64 {
    TerrainLevelsCfg::default().episode_seconds
}

/// Creates a term of joints: `make` gets the robot and the patterns.
fn joints<T>(
    args: &TermArgs<'_>,
    make: impl FnOnce(&SimulationManager, &str, RobotId, &[&str]) -> EnvResult<T>,
) -> EnvResult<T> {
    let OfJoints { robot, joints } = args.params()?;
    make(args.sim(), args.name(), args.robot(robot.as_deref())?, &patterns(&joints))
}

fn patterns(joints: &[String]) -> Vec<&str> {
    joints.iter().map(String::as_str).collect()
}

/// Creates a term of a robot.
fn of_robot<T>(args: &TermArgs<'_>, make: impl FnOnce(&str, RobotId) -> T) -> EnvResult<T> {
    let OfRobot { robot } = args.params()?;
    Ok(make(args.name(), args.robot(robot.as_deref())?))
}

/// Checks that a number of a term is finite: comparisons with NaN are false, which would hide the mistake.
fn finite(args: &TermArgs<'_>, field: &str, value: f64) -> EnvResult<f64> {
    if value.is_finite() { Ok(value) } else { Err(args.error(format!("{field} is {value}; it must be finite"))) }
}

/// Checks that a command term has at least `columns` columns.
fn check_command(args: &TermArgs<'_>, command: &str, columns: usize) -> EnvResult<()> {
    let found = args.command_columns(command)?.len();
    if found >= columns {
        return Ok(());
    }
    Err(args.error(format!("the command {command:?} has {found} columns; it needs at least {columns}")))
}

/// Robot, command and standard deviation of a reward for tracking a command.
fn tracking(args: &TermArgs<'_>, columns: usize) -> EnvResult<(RobotId, String, f64)> {
    let Tracking { robot, command, std } = args.params()?;
    check_command(args, &command, columns)?;
    if !(std.is_finite() && std > 0.0) {
        return Err(args.error(format!("std is {std}; it must be above 0")));
    }
    Ok((args.robot(robot.as_deref())?, command, std))
}

impl Default for TermRegistry {
    /// The ready-made terms of [`terms`](mod@crate::terms), by the names of their functions.
    fn default() -> Self {
        let mut all = Self::empty();
        actions_and_commands(&mut all);
        observations(&mut all);
        rewards_and_terminations(&mut all);
        events_and_curricula(&mut all);
        all
    }
}

fn actions_and_commands(all: &mut TermRegistry) {
    all.add_action("joint_efforts", |args| {
        let Efforts { robot, joints, bound } = args.params()?;
        joint_efforts(args.sim(), args.name(), args.robot(robot.as_deref())?, &patterns(&joints), bound)
    });
    all.add_action("joint_positions", |args| {
        let Positions { robot, joints, scale, clip } = args.params()?;
        let cfg = JointPositionsCfg { scale, bounds: clip };
        joint_positions(args.sim(), args.name(), args.robot(robot.as_deref())?, &patterns(&joints), cfg)
    });
    all.add_action("relative_joint_positions", |args| {
        let Steps { robot, joints, step } = args.params()?;
        relative_joint_positions(args.sim(), args.name(), args.robot(robot.as_deref())?, &patterns(&joints), step)
    });
    all.add_command("uniform_command", |args| {
        let Numbers { columns, resampling_time } = args.params()?;
        let range = |(column, range): (String, toml::Value)| match range.try_into::<[f64; 2]>() {
            Ok(range) => Ok((column, range)),
            Err(error) => Err(args.error(format!("columns.{column}: {}", error.message()))),
        };
        let columns = columns.into_iter().map(range).collect::<EnvResult<Vec<(String, [f64; 2])>>>()?;
        let term = uniform_command(args.name(), columns)?;
        Ok(resampling_time.into_iter().fold(term, CommandTerm::resampled_every))
    });
    all.add_command("uniform_velocity", |args| {
        let of: Velocity = args.params()?;
        let cfg = UniformVelocityCfg {
            lin_vel_x: of.lin_vel_x,
            lin_vel_y: of.lin_vel_y,
            ang_vel_z: of.ang_vel_z,
            heading: of.heading,
            rel_heading_envs: of.rel_heading_envs,
            heading_stiffness: of.heading_stiffness,
            rel_standing_envs: of.rel_standing_envs,
            resampling_time: of.resampling_time,
        };
        uniform_velocity(args.name(), args.robot(of.robot.as_deref())?, cfg)
    });
}

fn observations(all: &mut TermRegistry) {
    all.add_observation("joint_pos", |args| joints(args, joint_pos));
    all.add_observation("joint_pos_rel", |args| joints(args, joint_pos_rel));
    all.add_observation("joint_vel", |args| joints(args, joint_vel));
    all.add_observation("joint_effort", |args| joints(args, joint_effort));
    all.add_observation("base_pos_z", |args| of_robot(args, base_pos_z));
    all.add_observation("base_lin_vel", |args| of_robot(args, base_lin_vel));
    all.add_observation("base_ang_vel", |args| of_robot(args, base_ang_vel));
    all.add_observation("projected_gravity", |args| of_robot(args, projected_gravity));
    all.add_observation("height_scan", |args| {
        let Scan { sensor, offset } = args.params()?;
        height_scan(args.sim(), args.name(), args.sensor::<RayCaster>(&sensor)?, offset)
    });
    all.add_observation("last_action", |args| {
        args.params::<Nothing>()?;
        Ok(last_action(args.name(), args.action_columns().to_vec()))
    });
    all.add_observation("generated_commands", |args| {
        let OfCommand { command } = args.params()?;
        let columns = args.command_columns(&command)?.to_vec();
        Ok(generated_commands(args.name(), command, columns))
    });
    all.add_image("camera_rgb", |args| {
        let OfCamera { camera } = args.params()?;
        camera_rgb(args.sim(), args.name(), args.sensor::<Camera>(&camera)?)
    });
    all.add_image("camera_depth", |args| {
        let Depth { camera, range } = args.params()?;
        camera_depth(args.sim(), args.name(), args.sensor::<Camera>(&camera)?, range)
    });
    all.add_image("camera_mask", |args| {
        let OfCamera { camera } = args.params()?;
        camera_mask(args.sim(), args.name(), args.sensor::<Camera>(&camera)?)
    });
}

fn rewards_and_terminations(all: &mut TermRegistry) {
    all.add_reward("is_alive", |args| {
        args.params::<Nothing>()?;
        Ok(is_alive(args.name(), args.weight()))
    });
    all.add_reward("action_rate", |args| {
        args.params::<Nothing>()?;
        Ok(action_rate(args.name(), args.weight()))
    });
    all.add_reward("flat_orientation", |args| {
        of_robot(args, |name, robot| flat_orientation(name, args.weight(), robot))
    });
    all.add_reward("joint_torques_l2", |args| {
        joints(args, |sim, name, robot, patterns| joint_torques_l2(sim, name, args.weight(), robot, patterns))
    });
    all.add_reward("track_lin_vel", |args| {
        let (robot, command, std) = tracking(args, 2)?;
        Ok(track_lin_vel(args.name(), args.weight(), robot, command, std))
    });
    all.add_reward("track_ang_vel", |args| {
        let (robot, command, std) = tracking(args, 3)?;
        Ok(track_ang_vel(args.name(), args.weight(), robot, command, std))
    });
    all.add_reward("lin_vel_z_l2", |args| of_robot(args, |name, robot| lin_vel_z_l2(name, args.weight(), robot)));
    all.add_reward("ang_vel_xy_l2", |args| of_robot(args, |name, robot| ang_vel_xy_l2(name, args.weight(), robot)));
    all.add_reward("joint_acc_l2", |args| {
        joints(args, |sim, name, robot, patterns| joint_acc_l2(sim, name, args.weight(), robot, patterns))
    });
    all.add_reward("joint_deviation_l1", |args| {
        joints(args, |sim, name, robot, patterns| joint_deviation_l1(sim, name, args.weight(), robot, patterns))
    });
    all.add_reward("feet_air_time", |args| {
        let AirTime { sensor, command, threshold } = args.params()?;
        check_command(args, &command, 2)?;
        let sensor = args.sensor::<ContactSensor>(&sensor)?;
        feet_air_time(args.sim(), args.name(), args.weight(), sensor, command, threshold)
    });
    all.add_reward("undesired_contacts", |args| {
        let Force { sensor, force } = args.params()?;
        let force = finite(args, "force", force)?;
        Ok(undesired_contacts(args.name(), args.weight(), args.sensor::<ContactSensor>(&sensor)?, force))
    });
    all.add_termination("bad_orientation", |args| {
        let Angle { robot, angle } = args.params()?;
        let angle = finite(args, "angle", angle)?;
        Ok(bad_orientation(args.name(), args.robot(robot.as_deref())?, angle))
    });
    all.add_termination("root_height_below_minimum", |args| {
        let Height { robot, height } = args.params()?;
        let height = finite(args, "height", height)?;
        Ok(root_height_below_minimum(args.name(), args.robot(robot.as_deref())?, height))
    });
    all.add_termination("illegal_contact", |args| {
        let Force { sensor, force } = args.params()?;
        let force = finite(args, "force", force)?;
        Ok(illegal_contact(args.name(), args.sensor::<ContactSensor>(&sensor)?, force))
    });
    all.add_termination("joint_out_of_limits", |args| joints(args, joint_out_of_limits));
    all.add_termination("time_out", |args| {
        let Limit { steps } = args.params()?;
        Ok(time_out(args.name(), steps))
    });
}

fn events_and_curricula(all: &mut TermRegistry) {
    all.add_event("reset_joints_by_offset", |args| {
        let JointRanges { robot, joints, positions, velocities } = args.params()?;
        let robot = args.robot(robot.as_deref())?;
        reset_joints_by_offset(args.sim(), args.name(), robot, &patterns(&joints), positions, velocities)
    });
    all.add_event("reset_root_uniform", |args| {
        let Root { robot, position, rpy, linear, angular } = args.params()?;
        let ranges = RootRanges { position, rpy, linear, angular };
        reset_root_uniform(args.name(), args.robot(robot.as_deref())?, ranges)
    });
    all.add_event("push_by_setting_velocity", |args| {
        let Push { robot, mode, linear, angular } = args.params()?;
        push_by_setting_velocity(args.name(), mode.into(), args.robot(robot.as_deref())?, linear, angular)
    });
    all.add_event("randomize_mass", |args| {
        let RandomProperty { bodies, op, mode } = args.params()?;
        randomize_mass(args.sim(), args.name(), mode.into(), &patterns(&bodies), op)
    });
    all.add_event("randomize_friction", |args| {
        let RandomProperty { bodies, op, mode } = args.params()?;
        randomize_friction(args.sim(), args.name(), mode.into(), &patterns(&bodies), op)
    });
    all.add_event("reset_root_on_terrain", |args| {
        let OnTerrain { robot, grid, curriculum, position, rpy, linear, angular } = args.params()?;
        let ranges = RootRanges { position, rpy, linear, angular };
        reset_root_on_terrain(args.name(), args.robot(robot.as_deref())?, &grid, curriculum, ranges)
    });
    all.add_curriculum("terrain_levels", |args| {
        let Levels { robot, grid, max_initial_level, command, episode_seconds } = args.params()?;
        if let Some(command) = &command {
            args.command_columns(command)?;
        }
        let cfg = TerrainLevelsCfg { max_initial_level, command, episode_seconds };
        terrain_levels(args.name(), args.robot(robot.as_deref())?, &grid, cfg)
    });
}
