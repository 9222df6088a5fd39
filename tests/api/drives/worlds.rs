//! Test worlds for the drive laws: URDF chains from a few numbers, loaded through the public API. The laws, derivations
//! and tolerances are at the top of each test file.

use kinetoscope::mujoco as mj;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::robot::dynamics::{Configuration, Dynamics, MimicPositions};
use kinetoscope::sim;
use kinetoscope::sim::env::{EnvStatus, SimEnv};
use kinetoscope::sim::{ActuatorModel, DriveModel, Error};
pub(crate) use kinetoscope_testkit::tolerance::{Tolerance, assert_number};
use kinetoscope_testkit::urdf::{TempFiles, joint, robot};
pub(crate) use kinetoscope_testkit::worlds::{gains, no_drive};
use kinetoscope_testkit::worlds::{text_robot, weightless_cfg};
use nalgebra::{DMatrix, DVector, Vector3};
use std::sync::Arc;

pub(crate) const EARTH: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
/// Time step \[s\].
pub(crate) const H: f64 = 0.01;

/// One joint and its child link.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) kind: &'static str,
    pub(crate) parent: String,
    pub(crate) origin: [f64; 3],
    pub(crate) axis: [f64; 3],
    /// Attributes of `<limit>`.
    pub(crate) limit: String,
    pub(crate) damping: f64,
    pub(crate) friction: f64,
    pub(crate) mimic: Option<(String, f64)>,
    pub(crate) mass: f64,
    pub(crate) com: [f64; 3],
    /// Moments about the center of mass.
    pub(crate) inertia: [f64; 3],
    /// Collision elements of the link.
    pub(crate) collision: String,
}

impl Joint {
    /// A joint without limits on `base`, with a point-like mass.
    pub(crate) fn new(name: &str, kind: &'static str) -> Self {
        Self {
            name: name.into(),
            kind,
            parent: "base".into(),
            origin: [0.0; 3],
            axis: [0.0, 1.0, 0.0],
            limit: String::new(),
            damping: 0.0,
            friction: 0.0,
            mimic: None,
            mass: 1.0,
            com: [0.0; 3],
            inertia: [1e-3; 3],
            collision: String::new(),
        }
    }

    /// A hinge about y with the moment of inertia `moment` about its axis, without gravity torque.
    pub(crate) fn wheel(name: &str, moment: f64) -> Self {
        Self { inertia: [moment; 3], mass: 0.01, ..Self::new(name, "continuous") }
    }

    /// A hinge about y with a mass at `length` along x: gravity (0, 0, -g) acts with the torque `m g length cos q`.
    pub(crate) fn lever(name: &str, mass: f64, length: f64, moment: f64) -> Self {
        Self { mass, com: [length, 0.0, 0.0], inertia: [moment; 3], ..Self::new(name, "continuous") }
    }

    /// A slide along x of `mass`, with distant limits.
    pub(crate) fn slide(name: &str, mass: f64) -> Self {
        Self { mass, axis: [1.0, 0.0, 0.0], ..Self::new(name, "prismatic") }.range(-1e3, 1e3).effort(0.0)
    }

    pub(crate) fn after(self, parent: &Joint, origin: [f64; 3]) -> Self {
        Self { parent: parent.link(), origin, ..self }
    }

    pub(crate) fn following(self, driver: &str, ratio: f64) -> Self {
        Self { mimic: Some((driver.into(), ratio)), ..self }
    }

    pub(crate) fn rough(self, friction: f64) -> Self {
        Self { friction, ..self }
    }

    pub(crate) fn damped(self, damping: f64) -> Self {
        Self { damping, ..self }
    }

    pub(crate) fn effort(self, effort: f64) -> Self {
        Self { limit: format!("{} effort=\"{effort}\" velocity=\"100\"", self.limit), ..self }
    }

    pub(crate) fn range(self, lower: f64, upper: f64) -> Self {
        let kind = if self.kind == "continuous" { "revolute" } else { self.kind };
        Self { kind, limit: format!("lower=\"{lower}\" upper=\"{upper}\" {}", self.limit), ..self }
    }

    pub(crate) fn link(&self) -> String {
        format!("{}_link", self.name)
    }
}

/// The joints as URDF, with the root `base`.
pub(crate) fn urdf(joints: &[Joint]) -> String {
    let v = |x: [f64; 3]| format!("{} {} {}", x[0], x[1], x[2]);
    let mut elements = String::from("<link name=\"base\"/>\n");
    for j in joints {
        let ([ixx, iyy, izz], link, mut more) = (j.inertia, j.link(), String::new());
        elements += &format!(
            "<link name=\"{link}\"><inertial><origin xyz=\"{}\"/><mass value=\"{}\"/><inertia ixx=\"{ixx}\" \
             iyy=\"{iyy}\" izz=\"{izz}\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>{}</link>",
            v(j.com),
            j.mass,
            j.collision,
        );
        if !j.limit.is_empty() {
            more += &format!("<limit {}/>", j.limit);
        }
        if j.damping != 0.0 || j.friction != 0.0 {
            more += &format!("<dynamics damping=\"{}\" friction=\"{}\"/>", j.damping, j.friction);
        }
        if let Some((driver, multiplier)) = &j.mimic {
            more += &format!("<mimic joint=\"{driver}\" multiplier=\"{multiplier}\"/>");
        }
        elements += &joint(&j.name, j.kind, [&j.parent, &link], j.origin, &v(j.axis), &more);
    }
    robot("test", &elements)
}

/// A simulation with one robot.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) sim: SimulationManager,
    pub(crate) robot: RobotId,
}

/// 100 Hz, one environment, one thread, no ground, no gravity.
pub(crate) fn weightless() -> SimulationManagerCfg {
    SimulationManagerCfg { threads: Some(1), ..weightless_cfg(1) }
}

/// As [`weightless`], in `num_envs` environments.
pub(crate) fn weightless_envs(num_envs: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { num_envs, ..weightless() }
}

pub(crate) fn with_gravity(gravity: Vector3<f64>) -> SimulationManagerCfg {
    SimulationManagerCfg { gravity, ..weightless() }
}

pub(crate) fn earth() -> SimulationManagerCfg {
    with_gravity(EARTH)
}

pub(crate) fn at_dt(dt: f64, cfg: SimulationManagerCfg) -> SimulationManagerCfg {
    SimulationManagerCfg { physics_dt: dt, ..cfg }
}

/// Gains with MuJoCo's own actuators.
pub(crate) fn native(kp: f64, kd: f64) -> DriveCfg {
    DriveCfg { model: DriveModel::Actuator, ..gains(kp, kd) }
}

/// Gains with an explicit model for the joints of a pattern, with a velocity limit of 7.5 rad/s.
pub(crate) fn modeled(joints: &str, model: impl Into<ActuatorModel>, kp: f64, kd: f64) -> DriveCfg {
    let actuators = vec![(joints.into(), model.into())];
    DriveCfg { actuators, max_velocity: Some(7.5.into()), ..gains(kp, kd) }
}

/// A robot of `joints`.
#[track_caller]
pub(crate) fn world(joints: &[Joint], drive: DriveCfg, cfg: SimulationManagerCfg) -> World {
    try_world(joints, drive, cfg).unwrap_or_else(|e| panic!("{e}"))
}

pub(crate) fn try_world(joints: &[Joint], drive: DriveCfg, cfg: SimulationManagerCfg) -> Result<World, Box<Error>> {
    let files = TempFiles::default();
    let mut sim = SimulationManager::new(cfg)?;
    let robot = sim.add_robot(RobotCfg { drive, ..text_robot(&files, "robot", &urdf(joints)) })?;
    Ok(World { sim, robot })
}

/// A simulation with one robot of any configuration.
#[track_caller]
pub(crate) fn load(cfg: RobotCfg, manager: SimulationManagerCfg) -> World {
    let mut sim = kinetoscope_testkit::worlds::sim(manager);
    let robot = sim.add_robot(cfg).unwrap_or_else(|e| panic!("{e}"));
    World { sim, robot }
}

impl World {
    pub(crate) fn view(&self) -> sim::Robot<'_> {
        self.sim.robot(self.robot)
    }

    pub(crate) fn robot(&mut self) -> sim::RobotMut<'_> {
        self.sim.robot_mut(self.robot)
    }

    pub(crate) fn q(&self) -> Vec<f64> {
        self.view().qpos().row(0).to_vec()
    }

    pub(crate) fn v(&self) -> Vec<f64> {
        self.view().qvel().row(0).to_vec()
    }

    pub(crate) fn effort(&self) -> Vec<f64> {
        self.view().qf().row(0).to_vec()
    }

    pub(crate) fn limits(&self) -> Vec<f64> {
        self.view().qf_limits().row(0).to_vec()
    }

    pub(crate) fn target(&self) -> Vec<f64> {
        self.view().qpos_target().row(0).to_vec()
    }

    /// Sets the position targets of all joints.
    pub(crate) fn set_position_targets(&mut self, targets: &[f64]) {
        self.robot().set_qpos_target(&row(targets), None, None).unwrap();
    }

    /// Sets the targets of position, velocity and effort of all joints.
    pub(crate) fn set_targets<const N: usize>(&mut self, targets: [[f64; 3]; N]) {
        let of = |k: usize| row(&targets.map(|target| target[k]));
        let mut robot = self.robot();
        robot.set_qpos_target(&of(0), None, None).unwrap();
        robot.set_qvel_target(&of(1), None, None).unwrap();
        robot.set_qf_target(&of(2), None, None).unwrap();
    }

    pub(crate) fn step(&mut self, steps: u32) {
        self.sim.update(steps);
    }

    /// A copy of the environment, for stepping below the public API.
    pub(crate) fn env(&self) -> SimEnv {
        let (model, drives, qpos, qvel) = self.sim.batch().read(0, |env| {
            let data = env.data();
            (data.model().clone(), env.drives.clone(), data.qpos().to_vec(), data.qvel().to_vec())
        });
        let mut env = SimEnv::new(&model, &Arc::clone(drives.table())).unwrap();
        env.drives = drives;
        set_state(&mut env, &qpos, &qvel);
        env
    }

    /// True if a warning reports unstable drives at this time step.
    pub(crate) fn has_stability_warning(&self) -> bool {
        self.sim.warnings().counts().keys().any(|name| name.contains("unstable"))
    }

    /// Asserts that no environment diverged and MuJoCo gave no warning.
    #[track_caller]
    pub(crate) fn assert_healthy(&self) {
        assert!(self.sim.diverged().is_empty(), "{:?}", self.sim.diverged());
        let counts = self.sim.warnings().counts();
        assert!(!counts.keys().any(|name| name.starts_with("mujoco")), "{counts:?}");
        assert!(self.q().iter().chain(&self.v()).all(|x| x.is_finite()));
    }

    /// Gravity load of every drive at the current positions: the joint's own torque plus those of its followers, each
    /// times its ratio (virtual work of `q_f = m q`).
    pub(crate) fn load_by_gravity(&self, gravity: &Vector3<f64>) -> Vec<f64> {
        let view = self.view();
        let mut at = Configuration::zero(view.description());
        (at.joint_positions, at.mimic) = (self.q(), MimicPositions::AsGiven);
        let kinematics = Dynamics::new(view.description(), &at).unwrap();
        let torque = kinematics.gravity_torque(gravity);
        let joints = view.description().drivable_joints();
        let own: Vec<f64> = joints.map(|(id, _)| torque[kinematics.dof_range(id).start]).collect();
        let mut load = vec![0.0; own.len()];
        for (i, (driver, multiplier, _)) in view.mimic_drivers().into_iter().enumerate() {
            load[driver.0] += multiplier * own[i];
        }
        load
    }

    /// Mass matrix and bias force at a state, computed by `kinetoscope_robot::dynamics` from the URDF.
    pub(crate) fn dynamics(&self, q: &[f64], v: &[f64], gravity: &Vector3<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let view = self.view();
        let mut at = Configuration::zero(view.description());
        at.joint_positions = q.to_vec();
        let kinematics = Dynamics::new(view.description(), &at).unwrap();
        (kinematics.mass_matrix(), kinematics.bias_force(&DVector::from_column_slice(v), gravity))
    }
}

pub(crate) fn row(values: &[f64]) -> Array2<f64> {
    Array2::from_shape_vec((1, values.len()), values.to_vec()).unwrap()
}

/// Sets the state of a separate environment.
pub(crate) fn set_state(env: &mut SimEnv, q: &[f64], v: &[f64]) {
    env.write(|data| {
        data.qpos_mut().copy_from_slice(q);
        data.qvel_mut().copy_from_slice(v);
    });
}

/// Sets the targets of the first drive of a separate environment.
pub(crate) fn set_drive_targets(env: &mut SimEnv, [position, velocity, effort]: [f64; 3]) {
    (env.drives.position[0], env.drives.velocity[0], env.drives.feedforward[0]) = (position, velocity, effort);
}

#[track_caller]
pub(crate) fn step(env: &mut SimEnv) {
    env.step(1);
    assert_eq!(*env.status(), EnvStatus::Running);
}

/// Compiles MJCF for stepping with plain MuJoCo.
pub(crate) fn plain(xml: &str) -> mj::Data {
    let compiled = mj::compile(xml, &[]).unwrap_or_else(|e| panic!("{e}\n{xml}"));
    mj::Data::new(&compiled.into_model()).unwrap()
}

/// MJCF of one body on a hinge about y with these attributes and a mass \[kg\] at `length` along x.
pub(crate) fn hinge_mjcf(option: &str, joint: &str, [mass, length, moment]: [f64; 3]) -> String {
    format!(
        "<mujoco><option timestep=\"{H}\" {option}/><worldbody><body><joint type=\"hinge\" axis=\"0 1 0\" {joint}/>\
         <inertial pos=\"{length} 0 0\" mass=\"{mass}\" diaginertia=\"{moment} {moment} {moment}\"/></body></worldbody>\
         </mujoco>"
    )
}

/// Six links of 6 to 1 kg and four fingers of three links of 20, 15 and 10 g, with the effort limits of such an arm
/// (150 N m down to 28) and hand (2 N m). No dry friction, no damping, no rotor inertia.
pub(crate) fn arm_and_hand() -> Vec<Joint> {
    const Y: [f64; 3] = [0.0, 1.0, 0.0];
    const Z: [f64; 3] = [0.0, 0.0, 1.0];
    let mut joints: Vec<Joint> = Vec::new();
    // Name, height above the previous joint, axis, mass, moments, height of the center of mass, effort limit.
    for (name, z, axis, mass, inertia, com, effort) in [
        ("a1", 0.15, Z, 6.0, [0.03, 0.03, 0.02], 0.05, 150.0),
        ("a2", 0.18, Y, 5.5, [0.08, 0.08, 0.012], 0.2, 150.0),
        ("a3", 0.4, Y, 3.5, [0.04, 0.04, 0.006], 0.15, 100.0),
        ("a4", 0.35, Z, 2.0, [0.006, 0.006, 0.004], 0.03, 28.0),
        ("a5", 0.10, Y, 1.5, [0.005, 0.005, 0.003], 0.02, 28.0),
        ("a6", 0.09, Z, 1.0, [0.005, 0.005, 0.002], 0.01, 28.0),
    ] {
        let parent = joints.last().map_or("base".into(), Joint::link);
        let joint = Joint { mass, inertia, com: [0.0, 0.0, com], axis, ..Joint::new(name, "continuous") };
        joints.push(Joint { parent, origin: [0.0, 0.0, z], ..joint }.range(-3.0, 3.0).effort(effort));
    }
    let wrist = joints[5].link();
    for (k, x) in [-0.03, -0.01, 0.01, 0.03].into_iter().enumerate() {
        let (mut parent, mut origin) = (wrist.clone(), [x, 0.0, 0.145]);
        for (s, (length, mass)) in [(0.04, 0.020), (0.03, 0.015), (0.025, 0.010_f64)].into_iter().enumerate() {
            // A rod of radius 8 mm.
            let across = mass * (length * length / 12.0 + 0.008 * 0.008 / 4.0);
            let inertia = [across, across, mass * 0.008 * 0.008 / 2.0];
            let (axis, com) = ([1.0, 0.0, 0.0], [0.0, 0.0, length / 2.0]);
            let joint = Joint { axis, mass, com, inertia, ..Joint::new(&format!("h{k}{s}"), "continuous") };
            let joint = Joint { parent, origin, ..joint };
            (parent, origin) = (joint.link(), [0.0, 0.0, length]);
            joints.push(joint.range(-0.3, 1.6).effort(2.0));
        }
    }
    joints
}

/// The tutorial's gains: 1e4 and 1e3 for the joints of the arm, 1e3 and 1e2 for those of the hand.
pub(crate) fn tutorial_gains(arm: &str, hand: &str) -> DriveCfg {
    let (stiffness, damping) = ([(arm, 1e4), (hand, 1e3)].into(), [(arm, 1e3), (hand, 1e2)].into());
    DriveCfg { stiffness, damping, ..Default::default() }
}
