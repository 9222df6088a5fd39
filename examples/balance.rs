//! Two-wheeled robots balance on an IMU and contact sensors in 16 environments.
//!
//! Each robot is dropped from 3 cm and pushed four times, at its own times and with its own forces. The third push also
//! lifts the robot off the floor.
//!
//! ```text
//! cargo run --release --example balance -- --headless --out images
//! cargo run --release --example balance -- --headless --no-feedback
//! ```
//!
//! The controller uses a gyroscope and an accelerometer, both with noise and bias, the wheel contacts with the floor,
//! and its own motor commands. It reads no pose, no velocity and no joint state; these only evaluate the result.
//!
//! The exit code is 0 if at least 15 of 16 robots stand at the end and their bodies have never touched the floor. It is
//! 1 for fewer robots, as with the second command, whose wheels stand still, and 2 for an error.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{Array2, Array3};
use kinetoscope::prelude::*;
use kinetoscope::robot::description::{Geometry, RobotDescription};
use kinetoscope::robot::urdf::assemble;
use kinetoscope::scene::KeyedRng;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sensors::NoiseCfg;
use kinetoscope::sim::WrenchFrame;
use launcher::trial::{self, ImageSeries, TrialResults};
use launcher::{Launcher, MainLoop, grip};
use nalgebra::{Matrix4, RowVector4, Vector3, Vector4};
use serde_json::json;
use std::process::ExitCode;

/// Balances pushed robots and counts the successes.
#[derive(Debug, Parser)]
#[command(name = "balance")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Turn the controller off: the wheels do not turn, and the robots fall
    #[arg(long, alias = "no_feedback")]
    no_feedback: bool,
    /// Scale factor of the pushes
    #[arg(long, default_value_t = 1.0)]
    push: f64,
}

const DT: f64 = 0.002;
/// Duration of the run \[s\].
const DURATION: f64 = 14.0;

const G: f64 = 9.81;
/// Drop height of the robots above the floor \[m\].
const DROP_HEIGHT: f64 = 0.03;

/// Limit of the commanded acceleration \[m/s²\]: tires with friction 1 slip at 9.8.
const MAX_ACCELERATION: f64 = 6.0;
/// Time constant with which the accelerometer corrects the gyroscope's tilt estimate \[s\].
const CORRECTION_TIME: f64 = 0.5;
/// Gain of the wheels' speed controllers \[N m s/rad\].
const WHEEL_SPEED_GAIN: f64 = 20.0;

/// Pushes at the center of mass of the body: range of start times \[s\], duration \[s\], range of forces \[N\], fore or
/// aft.
const PUSH_START_TIMES: [[f64; 2]; 4] = [[2.0, 2.5], [4.5, 5.0], [7.0, 7.5], [10.0, 10.5]];
const PUSH_DURATION: f64 = 0.15;
const PUSH_FORCES: [f64; 2] = [20.0, 35.0];
/// Upward force of the third push \[N\]: the robot weighs 94 N, and leaves the floor for about a quarter of a second.
const LIFT: f64 = 120.0;

/// Success at the end of the run: tilt below this \[rad\], speed below this \[m/s\], distance from the start below this
/// \[m\], along the floor.
const MAX_TILT: f64 = 0.05;
const MAX_SPEED: f64 = 0.1;
const MAX_DISTANCE: f64 = 0.5;

fn main() -> ExitCode {
    trial::run("balance", || run(&trial::parse()))
}

fn run(args: &Args) -> launcher::Result<bool> {
    if !(args.push.is_finite() && args.push >= 0.0) {
        return Err(format!("--push {}: it must be 0 or more", args.push).into());
    }
    let legged = SimulationManagerCfg::legged();
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        physics_dt: DT,
        cone: legged.cone,
        impratio: legged.impratio,
        arena_space: args.launcher.arena_space.unwrap_or(1.6),
        ..args.launcher.simulation()?
    })?;
    let urdf = UrdfCfg::single(assets::path("balancer/balancer.urdf")?);
    let plant = RobotModel::from_description(&assemble(&urdf)?.description)?;
    let robot = sim.add_robot(RobotCfg {
        uid: "balancer".into(),
        urdf,
        fix_base: false,
        init_pose: Pose::translation(0.0, 0.0, plant.radius + DROP_HEIGHT),
        // Speed controllers: no stiffness, only damping.
        drive: DriveCfg { stiffness: 0.0.into(), damping: WHEEL_SPEED_GAIN.into(), ..Default::default() },
        ..Default::default()
    })?;
    let imu = sim.add_sensor("imu", imu_cfg())?;
    let touch = sim.add_sensor("touch", ContactSensorCfg::for_bodies("balancer/.*"))?;
    let out = args.launcher.out.clone();
    let mut album = ImageSeries::new(&mut sim, "balance", out, [2.2, -2.6, 1.1], [0.2, 0.0, 0.3])?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;
    // The robots start slightly tilted.
    let tilts = grip::uniform_per_env::<1>(&sim, "tilt");
    let start: Vec<Pose> = tilts
        .iter()
        .map(|[tilt]| from_xyz_rpy([0.0, 0.0, plant.radius + DROP_HEIGHT], [0.0, 0.05 * tilt, 0.0]))
        .collect();
    sim.robot_mut(robot).write_root_pose(&trial::pose_rows(&start), None)?;
    let pushes: Vec<PushSchedule> = (0..sim.num_envs()).map(|env| PushSchedule::sample(&sim, env, args.push)).collect();
    let (body, tires) = (sim.robot(robot).link_id("body")?, ["left_tyre", "right_tyre"]);
    let watched: Vec<usize> = tires
        .iter()
        .chain(&["body"])
        .map(|link| Ok(sim.sensor(touch)?.find_bodies(&format!("balancer/{link}"))?[0]))
        .collect::<launcher::Result<_>>()?;

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let steps = (DURATION / DT).round() as u64;
    let progress = MainLoop::new(&args.launcher, steps);
    let gains = plant.gains();
    // Times of the images: before all pushes, after the first, in the air, landed, at the end.
    let end_of = |push: usize| pushes[0].list[push].time[1];
    let image_times = [1.0, end_of(0) + 0.1, end_of(2) + 0.04, end_of(2) + 0.4, DURATION];
    progress.print_line(&format!("Gains on distance, speed, tilt and its rate: {:.3?}", gains.as_slice()));
    let mut controllers = vec![Controller::default(); sim.num_envs()];
    let mut records = vec![RunStats::default(); sim.num_envs()];
    let mut speeds = Array2::zeros((sim.num_envs(), 2));
    let mut step = 0;
    while step < steps && !progress.should_stop(step) {
        let time = step as f64 * DT;
        let (read, forces) = (sim.sensor(imu)?, sim.sensor(touch)?.net_forces_w());
        for (env, (controller, record)) in controllers.iter_mut().zip(&mut records).enumerate() {
            let readings = SensorReadings {
                spin: Vector3::from_fn(|k, _| read.ang_vel_b()[(env, k)]),
                acceleration: Vector3::from_fn(|k, _| read.lin_acc_b()[(env, k)]),
                grounded: watched[..2].iter().all(|&tire| forces[(env, tire, 2)] > 1.0),
            };
            let speed = if args.no_feedback { 0.0 } else { controller.wheels(&readings, &gains, plant.radius) };
            speeds.row_mut(env).fill(speed);
            // For the result only: the controller does not use it.
            record.steps_without_contact += u64::from(!readings.grounded && time > 1.0);
            let touching = (0..3).map(|k| forces[(env, watched[2], k)].powi(2)).sum::<f64>().sqrt();
            record.fell |= touching > 1.0;
        }
        let push = Array3::from_shape_fn((sim.num_envs(), 1, 3), |(env, _, k)| pushes[env].force(time)[k]);
        let turn = Array3::zeros(push.dim());
        let mut robot_now = sim.robot_mut(robot);
        robot_now.set_external_wrench(&push, &turn, WrenchFrame::World, Some(&[body]), None)?;
        robot_now.set_qvel_target(&speeds, None, None)?;
        sim.update(1);
        step += 1;
        progress.advance(step);
        let poses = trial::poses(&sim.robot(robot).root_pose());
        for (record, pose) in records.iter_mut().zip(&poses) {
            record.tilt = record.tilt.max(tilt(pose));
        }
        if image_times.iter().any(|at| (at / DT).round() as u64 == step) {
            album.add(&sim)?;
        }
    }

    let rate = progress.env_steps_per_second(step, sim.num_envs());
    let (poses, velocities) = (trial::poses(&sim.robot(robot).root_pose()), sim.robot(robot).root_velocity());
    let diverged = trial::diverged(&sim);
    let mut table = Vec::new();
    for env in 0..sim.num_envs() {
        let (pose, record) = (&poses[env], &records[env]);
        let away = pose.translation.x.hypot(pose.translation.y);
        let speed = velocities[(env, 0)].hypot(velocities[(env, 1)]);
        let (last, airborne) = (tilt(pose), record.steps_without_contact as f64 * DT);
        let stands = !record.fell && last < MAX_TILT && speed < MAX_SPEED && away < MAX_DISTANCE;
        let success = step == steps && stands && diverged[env].is_none();
        table.push(json!({
            "env": env, "pushes": pushes[env].list.iter().map(|push| push.force).collect::<Vec<_>>(),
            "largest_tilt": record.tilt, "end_tilt": last, "end_speed": speed, "end_distance": away,
            "airborne": airborne, "body_touched_floor": record.fell, "diverged": diverged[env], "success": success,
        }));
        println!(
            "environment {env:>2}: tilted by {:.3} rad at most, in the air for {airborne:.2} s, {away:.3} m from the start, \
             {speed:.3} m/s: {}",
            record.tilt,
            if success {
                "stands"
            } else if record.fell {
                "fell"
            } else {
                "does not stand still"
            },
        );
    }
    let count = TrialResults {
        what: "robots stand",
        setting: ("push", args.push),
        table,
        steps: step,
        rate,
        overview: ("balance_all.png", [3.6, -4.2, 3.0], [0.0, 0.0, 0.2]),
    };
    recording.finish(&mut sim)?;
    trial::write_results(&args.launcher, &mut sim, count)
}

/// A low-cost IMU on the axle, where tilting does not accelerate it.
fn imu_cfg() -> ImuCfg {
    let noise = [
        ("ang_vel_b".to_string(), NoiseCfg { bias_std: 0.01, ..NoiseCfg::white(0.005) }),
        ("lin_acc_b".to_string(), NoiseCfg { bias_std: 0.02, ..NoiseCfg::white(0.05) }),
    ];
    ImuCfg { sampling: SamplingCfg { noise: noise.into(), ..Default::default() }, ..ImuCfg::on("balancer/body") }
}

/// The controller's model of a robot, taken from its URDF.
#[derive(Clone, Copy, Debug)]
struct RobotModel {
    /// Radius of the wheels \[m\].
    radius: f64,
    /// Mass of the body, and of both wheels \[kg\].
    body: f64,
    wheels: f64,
    /// Height of the body's center of mass above the axle \[m\].
    height: f64,
    /// Inertia of the body about its center of mass, and of both wheels about the axle \[kg m²\].
    body_inertia: f64,
    wheel_inertia: f64,
}

impl RobotModel {
    /// Takes the model from the links `body`, whose frame is at the middle of the axle, and the two tires.
    fn from_description(robot: &RobotDescription) -> launcher::Result<Self> {
        let link = |name: &str| robot.links.iter().find(|link| link.name == name).ok_or(format!("no link {name}"));
        let inertial = |name: &str| {
            let inertial = link(name)?.inertial.as_ref().ok_or(format!("the link {name} has no mass"))?;
            // Inertia about the axle (y), in the axes of the link.
            let turn = inertial.link_from_com.rotation.to_rotation_matrix();
            let about_y = (turn.matrix() * inertial.inertia * turn.matrix().transpose())[(1, 1)];
            Ok::<_, String>((inertial.mass, inertial.link_from_com.translation.z, about_y))
        };
        let Some(Geometry::Sphere { radius }) = link("left_tyre")?.collisions.first().map(|shape| &shape.geometry)
        else {
            return Err("the left tire does not touch the floor with a ball".into());
        };
        let ((body, height, body_inertia), left, right) =
            (inertial("body")?, inertial("left_tyre")?, inertial("right_tyre")?);
        let (wheels, wheel_inertia) = (left.0 + right.0, left.2 + right.2);
        Ok(Self { radius: *radius, body, wheels, height, body_inertia, wheel_inertia })
    }

    /// Feedback gains on distance, speed, tilt and tilt rate; their weighted sum gives the commanded acceleration.
    ///
    /// The axle accelerates by a. The body (mass m, center of mass h above the axle, inertia I about it) tilts by θ.
    /// The wheels (mass M, inertia J, radius r) are driven by a torque T, with the reaction on the body. H is the force
    /// of the axle on the body, F the force of the floor on the wheels. For small angles:
    ///
    /// ```text
    /// body, along:  m (a + h θ") = H             wheels, along:  M a = F - H
    /// body, turn:   I θ" = m g h θ - h H - T     wheels, turn:   J a / r = T - r F
    /// so            (I + m h² + m h r) θ" = m g h θ - (m h + (M + m) r + J / r) a
    /// ```
    ///
    /// The gains are those of the linear-quadratic regulator of x' = v, v' = a, θ' = ω, ω' = A θ - B a in steps of dt.
    /// The costs follow Bryson's rule: each is the inverse square of the largest acceptable value. The Riccati equation
    /// is iterated backward in time until the gains converge.
    fn gains(&self) -> RowVector4<f64> {
        let Self { radius, body, wheels, height, body_inertia, wheel_inertia } = *self;
        let inertia = body_inertia + body * height * height + body * height * radius;
        let (a, b) = (
            body * G * height / inertia,
            (body * height + (wheels + body) * radius + wheel_inertia / radius) / inertia,
        );
        #[rustfmt::skip]
        let forward = Matrix4::new(
            1.0, DT,  0.0,    0.0,
            0.0, 1.0, 0.0,    0.0,
            0.0, 0.0, 1.0,    DT,
            0.0, 0.0, a * DT, 1.0,
        );
        let input = Vector4::new(0.0, DT, 0.0, -b * DT);
        // Acceptable values: 0.5 m, 1 m/s, 0.2 rad, 1 rad/s, and 3 m/s².
        let cost = Matrix4::from_diagonal(&Vector4::new(4.0, 1.0, 25.0, 1.0));
        let effort = 1.0 / 9.0;
        let mut value = cost;
        let mut gains = RowVector4::zeros();
        loop {
            let weight = effort + input.dot(&(value * input));
            let next = (input.transpose() * value * forward) / weight;
            let change = (next - gains).abs().max();
            gains = next;
            value = cost + forward.transpose() * value * (forward - input * gains);
            if change < 1e-12 {
                return gains;
            }
        }
    }
}

/// Sensor readings of a robot.
struct SensorReadings {
    /// Angular velocity in the axes of the body \[rad/s\].
    spin: Vector3<f64>,
    /// Specific force (acceleration minus gravity) in the axes of the body \[m/s²\].
    acceleration: Vector3<f64>,
    /// True if both wheels touch the floor, with more than 1 N each.
    grounded: bool,
}

/// State of a controller: its estimates and its last commands.
#[derive(Clone, Debug, Default)]
struct Controller {
    /// Estimated forward tilt of the body \[rad\].
    tilt: f64,
    /// Acceleration, speed and distance, from the commands on the floor and from the accelerometer in the air \[m/s²,
    /// m/s, m\].
    acceleration: f64,
    speed: f64,
    distance: f64,
}

impl Controller {
    /// Speed of both wheels, of this radius \[m\], relative to the body \[rad/s\].
    fn wheels(&mut self, felt: &SensorReadings, gains: &RowVector4<f64>, radius: f64) -> f64 {
        self.tilt += DT * felt.spin.y;
        let (sin, cos) = self.tilt.sin_cos();
        self.acceleration = if felt.grounded {
            // At a tilt of θ, with the axle accelerated by a, the accelerometer reads a vector along (a cos θ - g sin
            // θ, a sin θ + g cos θ), at an angle of θ - atan(a / g).
            let tilt_measured = (-felt.acceleration.x).atan2(felt.acceleration.z) + self.acceleration.atan2(G);
            self.tilt += DT / CORRECTION_TIME * (tilt_measured - self.tilt);
            let state = Vector4::new(self.distance, self.speed, self.tilt, felt.spin.y);
            -(gains * state)[0].clamp(-MAX_ACCELERATION, MAX_ACCELERATION)
        } else {
            // In the air the accelerometer gives no vertical reference, and the wheels have no floor to push against.
            // The measured acceleration along the floor is that of the push: the wheels match the speed of the floor
            // before they land.
            felt.acceleration.x * cos + felt.acceleration.z * sin
        };
        self.speed += DT * self.acceleration;
        self.distance += DT * self.speed;
        // A wheel at rest on the floor turns backward relative to a body that tilts forward.
        self.speed / radius - felt.spin.y
    }
}

/// A push.
#[derive(Clone, Copy, Debug)]
struct Push {
    /// Start and end time \[s\].
    time: [f64; 2],
    /// Forward and upward force \[N\].
    force: [f64; 2],
}

/// The pushes of an environment.
#[derive(Clone, Debug)]
struct PushSchedule {
    list: Vec<Push>,
}

impl PushSchedule {
    fn sample(sim: &SimulationManager, env: usize, strength: f64) -> Self {
        let mut random = KeyedRng::keyed(sim.cfg().seed, (sim.cfg().first_env() + env) as u64, "pushes");
        let mut between = |[low, high]: [f64; 2]| random.uniform_range(low, high);
        let mut push = |(k, window): (usize, [f64; 2])| {
            let begin = between(window);
            let side = if between([-1.0, 1.0]) < 0.0 { -1.0 } else { 1.0 };
            let force = [side * strength * between(PUSH_FORCES), if k == 2 { strength * LIFT } else { 0.0 }];
            Push { time: [begin, begin + PUSH_DURATION], force }
        };
        Self { list: PUSH_START_TIMES.into_iter().enumerate().map(&mut push).collect() }
    }

    /// Force at a time, in world axes \[N\].
    fn force(&self, time: f64) -> [f64; 3] {
        let now = self.list.iter().find(|push| (push.time[0]..push.time[1]).contains(&time));
        now.map_or([0.0; 3], |push| [push.force[0], 0.0, push.force[1]])
    }
}

/// Statistics of a robot.
#[derive(Clone, Debug, Default)]
struct RunStats {
    /// The largest tilt \[rad\].
    tilt: f64,
    /// Steps after the first second in which at least one wheel is off the floor.
    steps_without_contact: u64,
    /// True if the body has touched the floor.
    fell: bool,
}

/// Angle between the body and the vertical \[rad\].
fn tilt(pose: &Pose) -> f64 {
    (pose.rotation * Vector3::z()).angle(&Vector3::z())
}
