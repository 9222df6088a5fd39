//! Writers of states and properties, and randomization: calls with arrays of any shape and numbers of any size. A refused
//! call changes nothing.
#![no_main]

use arbitrary::Arbitrary;
use kinetoscope_fuzz::{accepted, simulation_of, write};
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_sim::{
    EnvId, JointIndex, Property, Randomization, RandomizationOp, RigidObjectCfg, RigidObjectId, RobotCfg, RobotId,
    SimulationManager, Snapshot, WrenchFrame,
};
use ndarray::Array2;
use std::cell::RefCell;

const ROBOT: &str = r#"<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>"#;

/// A number as users get it wrong, or any bits.
#[derive(Debug, Arbitrary)]
enum Number {
    Small(i8),
    Any(f64),
    Huge,
    Infinite,
    Nan,
}

impl Number {
    fn value(&self) -> f64 {
        match self {
            Self::Small(value) => f64::from(*value) / 16.0,
            Self::Any(value) => *value,
            Self::Huge => f64::MAX,
            Self::Infinite => f64::INFINITY,
            Self::Nan => f64::NAN,
        }
    }
}

/// An array, with selected environments and joints.
#[derive(Debug, Arbitrary)]
struct Rows {
    rows: u8,
    columns: u8,
    numbers: Vec<Number>,
    envs: Option<Vec<u8>>,
    joints: Option<Vec<u8>>,
}

impl Rows {
    /// The array; `columns` is the right number, which most inputs should have.
    fn array(&self, columns: usize) -> Array2<f64> {
        let columns = if self.columns < 192 { columns } else { usize::from(self.columns - 192) };
        let mut numbers = self.numbers.iter().cycle().map(Number::value);
        Array2::from_shape_simple_fn((usize::from(self.rows % 4), columns), || numbers.next().unwrap_or(0.25))
    }

    fn envs(&self) -> Option<Vec<EnvId>> {
        Some(self.envs.as_ref()?.iter().map(|env| EnvId(usize::from(env % 4))).collect())
    }

    fn joints(&self) -> Option<Vec<JointIndex>> {
        Some(self.joints.as_ref()?.iter().map(|joint| JointIndex(usize::from(joint % 3))).collect())
    }
}

#[derive(Debug, Arbitrary)]
enum Call {
    JointPositions(Rows),
    JointVelocities(Rows),
    JointAccelerations(Rows),
    PositionTargets(Rows),
    VelocityTargets(Rows),
    EffortTargets(Rows),
    ObjectPose(Rows),
    ObjectVelocity(Rows),
    Wrench(Rows, bool),
    Mass(Rows),
    CenterOfMass(Rows),
    Moments(Rows),
    Damping(Rows),
    Property { property: u8, name: u8, rows: Rows },
    Randomize { property: u8, pattern: u8, kind: u8, low: Number, high: Number, envs: Option<Vec<u8>> },
    Reset(Option<Vec<u8>>),
    Restore(Option<Vec<u8>>),
    Step,
}

struct Fixture {
    sim: SimulationManager,
    robot: RobotId,
    cube: RigidObjectId,
    start: Snapshot,
}

impl Fixture {
    fn new() -> Self {
        let mut sim = simulation_of(2);
        let urdf = UrdfCfg::single(write("robot.urdf", ROBOT.as_bytes()));
        let robot = sim.add_robot(RobotCfg { urdf, ..RobotCfg::default() }).expect("a robot");
        let cube = RigidObjectCfg { uid: "cube".into(), ..RigidObjectCfg::default() };
        let cube = sim.add_rigid_object(cube).expect("a cube");
        let start = sim.snapshot(None).expect("a snapshot");
        Self { sim, robot, cube, start }
    }

    /// True if the call was accepted.
    fn call(&mut self, call: &Call) -> bool {
        let Self { sim, robot, cube, start } = self;
        let property = |index: u8| Property::ALL[usize::from(index) % Property::ALL.len()];
        let names = ["cube", "hinge", "arm", "gravity", "ground", ".*", "none", "("];
        let name = |index: u8| names[usize::from(index) % names.len()];
        let ids = |envs: &Option<Vec<u8>>| -> Option<Vec<EnvId>> {
            Some(envs.as_ref()?.iter().map(|env| EnvId(usize::from(env % 4))).collect())
        };
        let result = match call {
            Call::JointPositions(of) => {
                sim.robot_mut(*robot).write_qpos(&of.array(1), of.joints().as_deref(), of.envs().as_deref())
            }
            Call::JointVelocities(of) => {
                sim.robot_mut(*robot).write_qvel(&of.array(1), of.joints().as_deref(), of.envs().as_deref())
            }
            Call::JointAccelerations(of) => {
                sim.robot_mut(*robot).write_qacc(&of.array(1), of.joints().as_deref(), of.envs().as_deref())
            }
            Call::PositionTargets(of) => {
                sim.robot_mut(*robot).set_qpos_target(&of.array(1), of.joints().as_deref(), of.envs().as_deref())
            }
            Call::VelocityTargets(of) => {
                sim.robot_mut(*robot).set_qvel_target(&of.array(1), of.joints().as_deref(), of.envs().as_deref())
            }
            Call::EffortTargets(of) => {
                sim.robot_mut(*robot).set_qf_target(&of.array(1), of.joints().as_deref(), of.envs().as_deref())
            }
            Call::ObjectPose(of) => sim.rigid_object_mut(*cube).write_pose(&of.array(7), of.envs().as_deref()),
            Call::ObjectVelocity(of) => sim.rigid_object_mut(*cube).write_velocity(&of.array(6), of.envs().as_deref()),
            Call::Wrench(of, in_link) => {
                let frame = if *in_link { WrenchFrame::Link } else { WrenchFrame::World };
                let wrench = of.array(3);
                sim.rigid_object_mut(*cube).set_external_wrench(&wrench, &wrench, frame, of.envs().as_deref())
            }
            Call::Mass(of) => {
                let masses = of.array(1);
                let masses = masses.iter().copied().collect::<Vec<_>>();
                sim.rigid_object_mut(*cube).set_mass(&masses[..], of.envs().as_deref())
            }
            Call::CenterOfMass(of) => {
                sim.rigid_object_mut(*cube).set_center_of_mass(&of.array(3), of.envs().as_deref())
            }
            Call::Moments(of) => sim.rigid_object_mut(*cube).set_inertia(&of.array(3), of.envs().as_deref()),
            Call::Damping(of) => sim.rigid_object_mut(*cube).set_damping(&of.array(2), of.envs().as_deref()),
            Call::Property { property: index, name: of, rows } => {
                let property = property(*index);
                let values = rows.array(property.width());
                sim.properties_mut().set(property, name(*of), &values, rows.envs().as_deref())
            }
            Call::Randomize { property: index, pattern, kind, low, high, envs } => {
                let range = [low.value(), high.value()];
                let draw = match kind % 3 {
                    0 => RandomizationOp::Scale(range),
                    1 => RandomizationOp::Add(range),
                    _ => RandomizationOp::Set(range),
                };
                let terms = Randomization::new().with(property(*index), name(*pattern), draw);
                sim.properties_mut().randomize(&terms, ids(envs).as_deref())
            }
            Call::Reset(envs) => sim.reset(ids(envs).as_deref()),
            Call::Restore(envs) => sim.restore(start, ids(envs).as_deref()),
            Call::Step => {
                sim.update(2);
                return true;
            }
        };
        accepted(result).is_some()
    }
}

thread_local! {
    static FIXTURE: RefCell<Fixture> = RefCell::new(Fixture::new());
}

libfuzzer_sys::fuzz_target!(|calls: Vec<Call>| {
    FIXTURE.with_borrow_mut(|fixture| {
        let start = fixture.start.clone();
        fixture.sim.properties_mut().restore(&start, None).expect("the state at the start");
        for call in calls.iter().take(16) {
            let before = fixture.sim.snapshot(None).expect("a snapshot").to_bytes();
            if !fixture.call(call) {
                let after = fixture.sim.snapshot(None).expect("a snapshot").to_bytes();
                assert!(before == after, "a refused call changed the state: {call:?}");
            }
        }
    });
});
