//! Test bench of the laws: a simulation with robots from URDF text and rigid objects, and their states as vectors. A
//! law needs no other module.

pub(crate) use crate::law::{law, max_or_nan};
pub(crate) use crate::urdf::{Joint, Link, POINT_MOMENT, base, urdf};
use kinetoscope::ndarray::{Array2, Array3};
pub(crate) use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, to_row};
use kinetoscope::sim::{self, DriveModel, FrictionCone, Integrator, RigidObjectId, WrenchFrame};
use kinetoscope_testkit::urdf::TempFiles;
/// The default drive, evaluated at the end of the step, and the passive drive, with which joints move freely.
pub(crate) use kinetoscope_testkit::worlds::{gains as implicit, no_drive as passive};
use nalgebra::UnitQuaternion;
pub(crate) use nalgebra::Vector3;

/// Gravity on earth \[m/s²\].
pub(crate) const G: f64 = 9.81;

/// Time step of a millisecond, one thread, gravity, no ground, no light.
pub(crate) fn earth() -> SimulationManagerCfg {
    SimulationManagerCfg {
        physics_dt: 1e-3,
        ground: None,
        lights: Vec::new(),
        threads: Some(1),
        ..SimulationManagerCfg::default()
    }
}

/// As [`earth`], without gravity.
pub(crate) fn weightless() -> SimulationManagerCfg {
    SimulationManagerCfg { gravity: Vector3::zeros(), ..earth() }
}

/// Ratio of frictional to normal constraint impedance on a [`slope`].
pub(crate) const IMPRATIO: f64 = 100.0;

/// As [`earth`], with a ground plane and tilted gravity: a slope of `angle` \[rad\] down along x. Friction has elliptic
/// cones, and creeps a hundred times less than MuJoCo's default.
pub(crate) fn slope(angle: f64, friction: f64) -> SimulationManagerCfg {
    SimulationManagerCfg {
        gravity: G * Vector3::new(angle.sin(), 0.0, -angle.cos()),
        ground: Some(GroundCfg::default()),
        cone: FrictionCone::Elliptic,
        impratio: IMPRATIO,
        friction: [friction, 0.0, 0.0],
        ..earth()
    }
}

pub(crate) fn with_dt(dt: f64, cfg: SimulationManagerCfg) -> SimulationManagerCfg {
    SimulationManagerCfg { physics_dt: dt, ..cfg }
}

/// Runge-Kutta of order 4, for passive robots and robots with [`explicit`] drives.
pub(crate) fn rk4(cfg: SimulationManagerCfg) -> SimulationManagerCfg {
    SimulationManagerCfg { integrator: Integrator::Rk4, ..cfg }
}

/// MuJoCo's own actuators, evaluated at the start of the step.
pub(crate) fn explicit(stiffness: f64, damping: f64) -> DriveCfg {
    DriveCfg { model: DriveModel::Actuator, ..implicit(stiffness, damping) }
}

/// One simulation.
#[derive(Debug)]
pub(crate) struct Lab {
    pub(crate) sim: SimulationManager,
    files: TempFiles,
}

impl Lab {
    pub(crate) fn new(cfg: SimulationManagerCfg) -> Self {
        Self { sim: SimulationManager::new(cfg).unwrap(), files: TempFiles::default() }
    }

    /// Writes a file into the folder of this lab.
    pub(crate) fn file(&self, name: &str, text: &str) -> std::path::PathBuf {
        self.files.write(name, text)
    }

    /// Adds a robot from URDF text; `cfg` gives everything but the file.
    pub(crate) fn robot(&mut self, text: &str, cfg: RobotCfg) -> RobotId {
        let path = self.file(&format!("{}.urdf", cfg.uid), text);
        self.sim.add_robot(RobotCfg { urdf: UrdfCfg::single(path), ..cfg }).unwrap()
    }

    /// Adds a passive robot with a fixed base at the origin.
    pub(crate) fn mechanism(&mut self, text: &str) -> RobotId {
        self.robot(text, RobotCfg { drive: passive(), ..RobotCfg::default() })
    }

    /// Adds a passive robot with a floating base.
    pub(crate) fn free(&mut self, text: &str, at: [f64; 3]) -> RobotId {
        let init_pose = Pose::translation(at[0], at[1], at[2]);
        self.robot(text, RobotCfg { drive: passive(), fix_base: false, init_pose, ..RobotCfg::default() })
    }

    pub(crate) fn object(&mut self, cfg: RigidObjectCfg) -> RigidObjectId {
        self.sim.add_rigid_object(cfg).unwrap()
    }

    pub(crate) fn dt(&self) -> f64 {
        self.sim.cfg().physics_dt
    }

    /// Runs for `seconds`, which must be a whole number of steps.
    #[track_caller]
    pub(crate) fn run(&mut self, seconds: f64) {
        let steps = seconds / self.dt();
        assert!((steps - steps.round()).abs() < 1e-6, "{seconds} s are no whole number of steps");
        self.sim.update(steps.round() as u32);
        assert_healthy(&self.sim);
    }

    /// Takes `steps` steps and calls `on_step` after each with the time \[s\] since the call.
    pub(crate) fn run_with(&mut self, steps: u32, mut on_step: impl FnMut(f64, &SimulationManager)) {
        for step in 1..=steps {
            self.sim.update(1);
            on_step(f64::from(step) * self.dt(), &self.sim);
        }
        assert_healthy(&self.sim);
    }

    /// Period \[s\] of the only joint of a robot, from its zero crossings: five crossings, two per period, within
    /// `steps` steps. Crossings are linearly interpolated between steps.
    pub(crate) fn period(&mut self, robot: RobotId, steps: u32) -> f64 {
        let (mut before, mut times) = ([0.0, self.q(robot)[0]], Vec::new());
        self.run_with(steps, |t, sim| {
            let q = sim.robot(robot).qpos()[(0, 0)];
            if q * before[1] < 0.0 {
                times.push(before[0] + (t - before[0]) * before[1] / (before[1] - q));
            }
            before = [t, q];
        });
        (times[4] - times[0]) / 2.0
    }

    /// Writes positions and velocities of all joints, in their order.
    pub(crate) fn write_joints(&mut self, robot: RobotId, q: &[f64], v: &[f64]) {
        let mut robot = self.sim.robot_mut(robot);
        robot.write_qpos(&row(q), None, None).unwrap();
        robot.write_qvel(&row(v), None, None).unwrap();
    }

    /// Writes the velocity of the root link's frame and its angular velocity, in world axes.
    pub(crate) fn write_root_velocity(&mut self, robot: RobotId, linear: [f64; 3], angular: [f64; 3]) {
        let v = [linear, angular].concat();
        self.sim.robot_mut(robot).write_root_velocity(&row(&v), None).unwrap();
    }

    pub(crate) fn write_velocity(&mut self, object: RigidObjectId, linear: [f64; 3], angular: [f64; 3]) {
        let v = [linear, angular].concat();
        self.sim.rigid_object_mut(object).write_velocity(&row(&v), None).unwrap();
    }

    /// Sets the efforts of all joints from the next step on.
    pub(crate) fn set_joint_efforts(&mut self, robot: RobotId, efforts: &[f64]) {
        self.sim.robot_mut(robot).set_qf_target(&row(efforts), None, None).unwrap();
    }

    /// Sets a force at the center of mass of a link and a torque, in world axes, from the next step on.
    pub(crate) fn set_link_wrench(&mut self, robot: RobotId, link: &str, force: Vector3<f64>, torque: Vector3<f64>) {
        let link = self.sim.robot(robot).link_id(link).unwrap();
        let [force, torque] = [force, torque].map(|v| Array3::from_shape_fn((1, 1, 3), |(_, _, k)| v[k]));
        let mut robot = self.sim.robot_mut(robot);
        robot.set_external_wrench(&force, &torque, WrenchFrame::World, Some(&[link]), None).unwrap();
    }

    /// As [`set_link_wrench`](Self::set_link_wrench), for an object.
    pub(crate) fn set_object_wrench(&mut self, object: RigidObjectId, force: Vector3<f64>, torque: Vector3<f64>) {
        let (force, torque) = (row(force.as_slice()), row(torque.as_slice()));
        self.sim.rigid_object_mut(object).set_external_wrench(&force, &torque, WrenchFrame::World, None).unwrap();
    }

    pub(crate) fn q(&self, robot: RobotId) -> Vec<f64> {
        self.sim.robot(robot).qpos().row(0).to_vec()
    }

    pub(crate) fn v(&self, robot: RobotId) -> Vec<f64> {
        self.sim.robot(robot).qvel().row(0).to_vec()
    }

    /// Efforts of the drives in the last step.
    pub(crate) fn effort(&self, robot: RobotId) -> Vec<f64> {
        self.sim.robot(robot).qf().row(0).to_vec()
    }

    pub(crate) fn root(&self, robot: RobotId) -> Body {
        root(&self.sim, robot)
    }

    pub(crate) fn body(&self, object: RigidObjectId) -> Body {
        body(&self.sim, object)
    }
}

/// Asserts that no environment diverged, and that MuJoCo gave no warning.
#[track_caller]
pub(crate) fn assert_healthy(sim: &SimulationManager) {
    assert!(sim.diverged().is_empty(), "{:?}", sim.diverged());
    let counts = sim.warnings().counts();
    assert!(!counts.keys().any(|name| name.starts_with("mujoco")), "{counts:?}");
}

/// Pose and velocity of a body in the world; the velocity is that of its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub(crate) position: Vector3<f64>,
    pub(crate) rotation: UnitQuaternion<f64>,
    pub(crate) velocity: Vector3<f64>,
    pub(crate) angular_velocity: Vector3<f64>,
}

impl Body {
    fn new(pose: &Array2<f64>, velocity: &Array2<f64>) -> Self {
        let pose = from_row(&std::array::from_fn(|k| pose[(0, k)]));
        let at = |k: usize| Vector3::new(velocity[(0, k)], velocity[(0, k + 1)], velocity[(0, k + 2)]);
        Self { position: pose.translation.vector, rotation: pose.rotation, velocity: at(0), angular_velocity: at(3) }
    }
}

/// The root link of a robot.
pub(crate) fn root(sim: &SimulationManager, robot: RobotId) -> Body {
    let robot: sim::Robot<'_> = sim.robot(robot);
    Body::new(&robot.root_pose(), &robot.root_velocity())
}

/// A rigid object.
pub(crate) fn body(sim: &SimulationManager, object: RigidObjectId) -> Body {
    let object = sim.rigid_object(object);
    Body::new(&object.pose(), &object.velocity())
}

pub(crate) fn row(values: &[f64]) -> Array2<f64> {
    Array2::from_shape_vec((1, values.len()), values.to_vec()).unwrap()
}

/// A pose as a row of shape (1, 7).
pub(crate) fn pose_row(pose: &Pose) -> Array2<f64> {
    row(&to_row(pose))
}
