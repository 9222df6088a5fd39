//! Ready-made terms for robots. Any other term is a function of the simulation.

// Terms with a file of their own.
macro_rules! terms {
    ($($file:ident: $($name:ident),+;)*) => {$(
        mod $file;
        pub use $file::{$($name),+};
    )*};
}

terms! {
    bad_orientation: bad_orientation;
    base_below: root_height_below_minimum;
    base_motion: base_lin_vel, base_ang_vel, base_pos_z, projected_gravity;
    base_motion_penalties: ang_vel_xy_l2, lin_vel_z_l2;
    camera_images: camera_rgb, camera_depth, camera_mask;
    feet_air_time: feet_air_time;
    flat_orientation: flat_orientation;
    height_scan: height_scan;
    illegal_contact: illegal_contact;
    joint_acc_l2: joint_acc_l2;
    joint_deviation_l1: joint_deviation_l1;
    joint_effort_squares: joint_torques_l2;
    joint_out_of_limits: joint_out_of_limits;
    joint_positions: joint_positions, JointPositionsCfg;
    joint_state: joint_effort, joint_pos;
    push_by_setting_velocity: push_by_setting_velocity;
    randomize_property: randomize_friction, randomize_mass;
    reset_joints_by_offset: reset_joints_by_offset;
    reset_root_uniform: reset_root_uniform, RootRanges;
    terrain_levels: reset_root_on_terrain, terrain_levels, TerrainLevelsCfg;
    time_out: time_out;
    track_ang_vel: track_ang_vel;
    track_lin_vel: track_lin_vel;
    uniform_command: uniform_command;
    undesired_contacts: undesired_contacts;
    uniform_velocity: uniform_velocity, UniformVelocityCfg;
}

mod named;

use crate::action::ActionTerm;
use crate::context::TermContext;
use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::observation::ObservationTerm;
use crate::reward::RewardTerm;
use crate::space::Space;
use kinetoscope_sim::{JointIndex, RobotId, RobotState, SimulationManager};
use ndarray::{Array1, Array2, ArrayView2, Axis};

/// Checks that both ends of the range `field` of a term are finite and in order.
fn check_range(kind: TermKind, name: &str, field: &str, [low, high]: [f64; 2]) -> Result<()> {
    if low.is_finite() && high.is_finite() && low <= high {
        return Ok(());
    }
    let field = format!("{field} of the {kind} term {name:?}");
    let (value, expected) = (format!("{low} to {high}"), "both numbers must be finite, in order");
    Err(EnvError::Config { field, value, expected })
}

/// Finds the joints of a robot that match `patterns`, with their names.
fn find_joints(sim: &SimulationManager, robot: RobotId, patterns: &[&str]) -> Result<(Vec<String>, Vec<JointIndex>)> {
    let robot = sim.robot(robot);
    let joints = robot.find_joints(patterns)?;
    Ok((joints.iter().map(|joint| robot.joint_names()[joint.0].clone()).collect(), joints))
}

fn select_joints(of: ArrayView2<'_, f64>, joints: &[JointIndex]) -> Array2<f64> {
    of.select(Axis(1), &joints.iter().map(|joint| joint.0).collect::<Vec<_>>())
}

/// Joint positions relative to the initial ones \[rad or m\]; one column for each joint that matches one of `patterns`
/// (whole names), in the order of [`find_joints`](kinetoscope_sim::Robot::find_joints).
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_pos_rel(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
) -> Result<ObservationTerm> {
    let initial = sim.robot(robot).default_qpos().row(0).to_owned();
    joint_observation(sim, name, robot, patterns, RobotState::qpos, move |joint, position| position - initial[joint])
}

/// Joint velocities \[rad/s or m/s\]; columns as in [`joint_pos_rel`].
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_vel(sim: &SimulationManager, name: &str, robot: RobotId, patterns: &[&str]) -> Result<ObservationTerm> {
    joint_observation(sim, name, robot, patterns, RobotState::qvel, |_, velocity| velocity)
}

/// Creates a term with one column for each joint that matches `patterns`: `convert`, of the index of the joint and its
/// number in `read`, which returns all joints, shape (N, dof).
fn joint_observation(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
    read: fn(&RobotState) -> ArrayView2<'_, f64>,
    convert: impl Fn(usize, f64) -> f64 + Send + 'static,
) -> Result<ObservationTerm> {
    let (names, joints) = find_joints(sim, robot, patterns)?;
    Ok(ObservationTerm::new(name, names, move |now| {
        let all = read(now.robot(robot));
        let value = |(env, k): (usize, usize)| convert(joints[k].0, all[(env, joints[k].0)]);
        Ok(Array2::from_shape_fn((now.num_envs(), joints.len()), value))
    }))
}

/// Sum over `joints`, for each environment, of `number`, of the index of the joint and its number in `all`, shape (N,
/// dof).
fn sum_over_joints(all: ArrayView2<'_, f64>, joints: &[JointIndex], number: impl Fn(usize, f64) -> f64) -> Array1<f64> {
    all.map_axis(Axis(1), |row| joints.iter().map(|joint| number(joint.0, row[joint.0])).sum())
}

/// [`TermContext::actions`]; `names` are the names of all columns of the action space, in its order.
pub fn last_action<N: Into<String>>(name: &str, names: impl IntoIterator<Item = N>) -> ObservationTerm {
    ObservationTerm::new(name, names, |now| Ok(now.actions().to_owned()))
}

/// Values of the command term called `command`; `names` are the names of its columns. If there is no such term,
/// observations fail.
pub fn generated_commands<N: Into<String>>(
    name: &str,
    command: impl Into<String>,
    names: impl IntoIterator<Item = N>,
) -> ObservationTerm {
    let command = command.into();
    ObservationTerm::new(name, names, move |now| Ok(now.command(&command)?.to_owned()))
}

/// Joint efforts \[N m or N\], from `-bound` to `bound`, set with
/// [`set_qf_target`](kinetoscope_sim::RobotMut::set_qf_target): they are added to the efforts of drives, and mimic
/// joints ignore them. Columns are as in [`joint_pos_rel`].
///
/// # Errors
/// A pattern is invalid or matches no joint, two patterns match the same joint, or `bound` is negative or NaN.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_efforts(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
    bound: f64,
) -> Result<ActionTerm> {
    let (names, joints) = find_joints(sim, robot, patterns)?;
    Ok(ActionTerm::new(name, Space::uniform(names, [-bound, bound])?, move |sim, efforts| {
        Ok(sim.robot_mut(robot).set_qf_target(efforts, Some(&joints), None)?)
    }))
}

/// Changes of joint position targets: actions are from -1 to 1, and an action of 1 adds `step` \[rad or m\] to the
/// current target in a step of the task. Targets stay within the limits of the joints. Columns are as in
/// [`joint_pos_rel`]; joints without a drive ignore them.
///
/// # Errors
/// A pattern is invalid or matches no joint, two patterns match the same joint, or `step` is not finite.
///
/// # Panics
/// The robot belongs to another manager.
pub fn relative_joint_positions(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
    step: f64,
) -> Result<ActionTerm> {
    if !step.is_finite() {
        let field = format!("step of the action term {name:?}");
        return Err(EnvError::Config { field, value: step.to_string(), expected: "it must be finite" });
    }
    let (names, joints) = find_joints(sim, robot, patterns)?;
    Ok(ActionTerm::new(name, Space::uniform(names, [-1.0, 1.0])?, move |sim, actions| {
        let targets =
            select_joints(sim.robot(robot).qpos_target().view(), &joints) + actions.mapv(|action| step * action);
        Ok(sim.robot_mut(robot).set_qpos_target(&targets, Some(&joints), None)?)
    }))
}

/// A reward of 1, times `weight`, in every step of an episode, including the last one.
pub fn is_alive(name: &str, weight: f64) -> RewardTerm {
    RewardTerm::new(name, weight, |now| Ok(Array1::ones(now.num_envs())))
}

/// Sum over all action columns of the squared changes since the previous step; the first step of an episode is compared
/// with 0. A penalty needs a negative `weight`.
pub fn action_rate(name: &str, weight: f64) -> RewardTerm {
    RewardTerm::new(name, weight, |now: &TermContext<'_>| -> TermResult<Array1<f64>> {
        let change = &now.actions() - &now.previous_actions();
        Ok(change.map_axis(Axis(1), |row| row.iter().map(|x| x * x).sum()))
    })
}
