//! Drives with explicit models that are told other gains, types and limits while they run, each model of the list.
//!
//! A wheel of constant inertia M without other loads goes v' = v + h tau / M, q' = q + h v', with
//! tau = clamp(kp (q* - q) + kd (v* - v) + tau_ff, ±limit) of what the model hears in that step: below its stall effort and
//! far from its speed without load a motor gives just that. Gains of type `acceleration` are multiplied by M, type `none`
//! has none. Tolerance 1e-9 over 240 steps, as in `actuators.rs`: rounding of 1e-16 a step, which stable gains do not let grow.

use crate::drives::worlds::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

const EXACT: f64 = 1e-9;
const H: f64 = 0.01;
const ENVS: usize = 3;
/// Two wheels with the model, and one without.
const M: [f64; 3] = [0.2, 0.5, 0.3];
const LIMIT: f64 = 0.9;
const STEPS: i32 = 240;

/// What each drive is told, by environment and joint.
#[derive(Clone, Debug, PartialEq)]
struct Told {
    stiffness: Array2<f64>,
    damping: Array2<f64>,
    limit: Array2<f64>,
    kind: Array2<DriveType>,
}

impl Told {
    fn at_first() -> Self {
        let all = |value| Array2::from_elem((ENVS, 3), value);
        Self { stiffness: all(3.0), damping: all(0.4), limit: all(LIMIT), kind: Array2::default((ENVS, 3)) }
    }

    fn of(world: &World) -> Self {
        let view = world.view();
        let (stiffness, damping) = (view.get_stiffness(), view.get_damping());
        Self { stiffness, damping, limit: view.qf_limits(), kind: view.get_drive_types() }
    }
}

fn wheels(model: ActuatorModel) -> World {
    let joints = [("a", M[0]), ("b", M[1]), ("c", M[2])].map(|(name, m)| Joint::wheel(name, m).effort(LIMIT));
    let drive = DriveCfg { actuators: vec![("[ab]".into(), model)], max_velocity: Some(1e6.into()), ..gains(3.0, 0.4) };
    world(&joints, drive, SimulationManagerCfg { num_envs: ENVS, ..weightless() })
}

/// All three targets of step n, wobbling widely enough to reach the limit.
fn wobble(n: i32, joint: usize) -> [f64; 3] {
    let (n, phase) = (f64::from(n), joint as f64);
    [0.6 * (0.13 * n + phase).sin(), 0.2 * (0.7 * n + phase).cos(), 0.1 * (1.1 * n - phase).sin()]
}

fn set_targets(world: &mut World, n: i32) {
    let targets = [0, 1, 2].map(|joint| wobble(n, joint));
    let of = |k: usize| row(&targets.map(|target| target[k]));
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_qpos(&of(0), None, None).unwrap();
    robot.set_qvel(&of(1), None, None).unwrap();
    robot.set_qf(&of(2), None, None).unwrap();
}

/// What is said at step n, to single joints in single environments; the table is changed alike.
fn tell(world: &mut World, told: &mut Told, n: i32) {
    const A: Option<&[JointIndex]> = Some(&[JointIndex(0)]);
    const B: Option<&[JointIndex]> = Some(&[JointIndex(1)]);
    let (one, two) = ([EnvId(1)], [EnvId(2)]);
    let mut robot = world.sim.robot_mut(world.robot);
    match n {
        40 => {
            robot.set_stiffness(&array![[6.0], [1.5]], A, Some(&[EnvId(2), EnvId(1)])).unwrap();
            (told.stiffness[(2, 0)], told.stiffness[(1, 0)]) = (6.0, 1.5);
        }
        80 => {
            robot.set_damping(&array![[0.9]], B, Some(&one)).unwrap();
            told.damping[(1, 1)] = 0.9;
            robot.set_qf_limits(&array![[0.3]], B, Some(&two)).unwrap();
            told.limit[(2, 1)] = 0.3;
        }
        120 => {
            robot.set_drive_type(DriveType::Acceleration, A, Some(&one)).unwrap();
            told.kind[(1, 0)] = DriveType::Acceleration;
            robot.set_drive_type(DriveType::None, B, Some(&two)).unwrap();
            told.kind[(2, 1)] = DriveType::None;
        }
        160 => {
            // A number that is set while it does not act, acts when it does.
            robot.set_stiffness(&array![[5.0]], B, Some(&two)).unwrap();
            told.stiffness[(2, 1)] = 5.0;
            robot.set_drive_type(DriveType::Force, None, None).unwrap();
            told.kind.fill(DriveType::Force);
        }
        200 => {
            let drawn = Randomization::new().with(Property::MaxEffort, "robot/a", Draw::Set([0.5, 0.5]));
            world.sim.randomize(&drawn, Some(&one)).unwrap();
            told.limit[(1, 0)] = 0.5;
        }
        _ => return,
    }
    assert_eq!(Told::of(world), *told, "step {n}");
}

#[test]
fn every_model_follows_what_single_drives_are_told_while_they_run() {
    let mut models = ActuatorModel::examples();
    models.push(DelayedPd { delay: 3, max_delay: 3 }.into());
    for model in models {
        let name = model.law().name();
        let delay = if let ActuatorModel::DelayedPd(model) = model { model.delay as i32 } else { 0 };
        let (mut world, mut untold) = (wheels(model), wheels(model));
        let mut told = Told::at_first();
        assert_eq!(Told::of(&world), told, "{name}");
        // In the second round everything that was told before the reset holds from the start.
        for round in 0..2 {
            let (mut x, mut u) = (Array2::<f64>::zeros((ENVS, 2)), Array2::<f64>::zeros((ENVS, 2)));
            let (mut saturated, mut free, mut apart) = (0, 0, 0.0_f64);
            for n in 0..STEPS {
                if round == 0 {
                    tell(&mut world, &mut told, n);
                }
                for world in [&mut world, &mut untold] {
                    set_targets(world, n);
                    world.step(1);
                }
                let (q, v, effort) = (world.view().get_qpos(), world.view().get_qvel(), world.view().get_qf());
                let others = untold.view().get_qpos();
                for env in 0..ENVS {
                    for (joint, &moment) in M.iter().enumerate().take(2) {
                        let [aim, v_aim, ff] = if n < delay { [0.0; 3] } else { wobble(n - delay, joint) };
                        let at = (env, joint);
                        let unit = match told.kind[at] {
                            DriveType::Force => 1.0,
                            DriveType::Acceleration => moment,
                            DriveType::None => 0.0,
                        };
                        let (kp, kd, limit) = (unit * told.stiffness[at], unit * told.damping[at], told.limit[at]);
                        let asked = kp * (aim - x[at]) + kd * (v_aim - u[at]) + ff;
                        let tau = asked.min(limit).max(-limit);
                        if tau == asked {
                            free += 1
                        } else {
                            saturated += 1
                        }
                        u[at] += H * tau / moment;
                        x[at] += H * u[at];
                        let what = format!("{name}, round {round}, step {n}, environment {env}, joint {joint}");
                        assert_close(effort[at], tau, EXACT, &format!("effort, {what}"));
                        assert_close(v[at], u[at], EXACT, &format!("velocity, {what}"));
                        assert_close(q[at], x[at], EXACT, &format!("position, {what}"));
                    }
                    // Nobody told the wheel without a model anything.
                    assert_close(q[(env, 2)], others[(env, 2)], EXACT, "the wheel with a row");
                    for joint in 0..2 {
                        apart = apart.max((q[(env, joint)] - others[(env, joint)]).abs());
                    }
                }
                assert_eq!(q.row(0), others.row(0), "environment 0 was not named: {name}, step {n}");
            }
            assert!(saturated > 50 && free > 50, "{name}: both sides of the limit: {saturated} {free}");
            assert!(apart > 0.05, "{name}: the control: what is told matters: {apart}");
            for world in [&mut world, &mut untold] {
                world.sim.reset(None).unwrap();
            }
            assert_eq!(Told::of(&world), told, "{name}: it stays through a reset");
        }
        world.assert_well();
    }
}

/// A motor's own demands hold for what is drawn as for what is set: an effort limit must be finite.
#[test]
fn what_is_drawn_must_be_right_for_the_model() {
    for model in ActuatorModel::examples() {
        let mut world = wheels(model);
        let unlimited = |sim: &mut SimulationManager| {
            sim.randomize_with(Some(&[EnvId(2)]), |_, _, properties| {
                properties.set(Property::MaxEffort, "robot/b", &[f64::INFINITY])
            })
        };
        match (model, unlimited(&mut world.sim)) {
            (ActuatorModel::DcMotor(_), result) => {
                let error = result.unwrap_err();
                assert!(
                    matches!(&error, Error::Randomization(RandomizationError::Model { env: 2, name, .. }) if name == "robot/b"),
                    "{error:?}"
                );
                for part in ["environment 2", "max_effort", "\"robot/b\"", "dc_motor", "finite"] {
                    assert!(error.to_string().contains(part), "{part:?} is not in {error}");
                }
                assert_eq!(Told::of(&world), Told::at_first(), "nothing is set");
                // The wheel without a model may have no limit.
                world
                    .sim
                    .randomize_with(None, |_, _, all| all.set(Property::MaxEffort, "robot/c", &[f64::INFINITY]))
                    .unwrap();
            }
            (_, result) => {
                result.unwrap();
                assert_eq!(world.view().qf_limits()[(2, 1)], f64::INFINITY);
            }
        }
    }
}
