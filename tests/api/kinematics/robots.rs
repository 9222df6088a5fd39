//! Robots, and MuJoCo as the judge of where they are.

use kinetoscope::ndarray::{Array2, ArrayView1, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::Random;
use kinetoscope::scene::pose::from_row;
use std::path::{Path, PathBuf};

pub(crate) fn simulation(num_envs: usize, robot: RobotCfg) -> (SimulationManager, RobotId) {
    let cfg = SimulationManagerCfg { num_envs, ground: None, threads: Some(1), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}

pub(crate) fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/arms").join(name)
}

/// All movable joints of a file are the part `arm`.
pub(crate) fn arm(urdf: impl Into<PathBuf>) -> RobotCfg {
    RobotCfg {
        urdf: UrdfCfg::single(urdf.into()),
        control_parts: vec![("arm".into(), vec![".*".into()])],
        ..Default::default()
    }
}

pub(crate) fn sr5() -> RobotCfg {
    arm(assets::path("sr5/SR5.urdf").unwrap())
}

pub(crate) fn seven_axes() -> RobotCfg {
    arm(file("seven_axes.urdf"))
}

pub(crate) fn six_axes() -> RobotCfg {
    arm(file("six_axes.urdf"))
}

/// The bundled arm and hand, as the tutorials put them together.
pub(crate) fn arm_and_hand() -> RobotCfg {
    let hand = ComponentCfg {
        transform: kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.02], [1.5, 0.1, 0.0]),
        ..ComponentCfg::new("hand", assets::path("revo1_left/revo1_left.urdf").unwrap())
    };
    let arm = ComponentCfg::new("arm", assets::path("sr5/SR5.urdf").unwrap());
    RobotCfg {
        urdf: UrdfCfg { components: vec![arm, hand], ..UrdfCfg::default() },
        control_parts: vec![("arm".into(), vec!["JOINT[1-6]".into()]), ("hand".into(), vec!["LEFT_.*".into()])],
        ..Default::default()
    }
}

/// The vendor's SR5, where it is there.
pub(crate) fn vendors_sr5() -> RobotCfg {
    arm(testkit::needs::robot("rokae_description/urdf/SR5.urdf"))
}

/// A robot of links and joints, each link a ball of 1 kg.
pub(crate) fn written(links: &[&str], joints: &[String]) -> tempfile::TempDir {
    let link = |name: &&str| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"1\"/>\
             <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link>"
        )
    };
    let text = links.iter().map(link).chain(joints.iter().cloned()).collect::<String>();
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("r.urdf"), format!("<robot name=\"r\">{text}</robot>")).unwrap();
    dir
}

/// `inside` goes behind the axis.
pub(crate) fn joint(name: &str, kind: &str, between: [&str; 2], xyz: &str, axis: &str, inside: &str) -> String {
    let [parent, child] = between;
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
         <origin xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/>{inside}</joint>"
    )
}

/// Uniformly random positions within the limits (within a turn where there are none); mimic joints where they belong.
pub(crate) fn random_qpos(sim: &SimulationManager, robot: RobotId, rows: usize, seed: u64) -> Array2<f64> {
    let robot = sim.robot(robot);
    let limits = robot.qpos_limits();
    let mut qpos = Array2::from_shape_fn((rows, robot.dof()), |(row, joint)| {
        let (low, high) = (limits[(0, joint, 0)].max(-3.2), limits[(0, joint, 1)].min(3.2));
        let (low, high) = if limits[(0, joint, 0)].is_finite() && limits[(0, joint, 1)].is_finite() {
            (limits[(0, joint, 0)], limits[(0, joint, 1)])
        } else {
            (low, high)
        };
        low + (high - low) * Random::keyed(seed, row as u64, &joint.to_string()).uniform()
    });
    for (joint, (driver, ratio, offset)) in robot.mimic_drivers().into_iter().enumerate() {
        if driver.0 != joint {
            for mut row in qpos.rows_mut() {
                row[joint] = ratio * row[driver.0] + offset;
            }
        }
    }
    qpos
}

pub(crate) fn pose(row: ArrayView1<'_, f64>) -> Pose {
    from_row(&std::array::from_fn(|k| row[k]))
}

/// Largest distance \[m\] and angle \[rad\] between rows of poses.
pub(crate) fn apart(a: &Array2<f64>, b: &Array2<f64>) -> (f64, f64) {
    assert_eq!(a.dim(), b.dim());
    let each = a.axis_iter(Axis(0)).zip(b.axis_iter(Axis(0))).map(|(a, b)| errors(&pose(a), &pose(b)));
    each.fold((0.0, 0.0), |most, one| (f64::max(most.0, one.0), f64::max(most.1, one.1)))
}

/// Distance \[m\] and angle \[rad\] between poses.
pub(crate) fn errors(a: &Pose, b: &Pose) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation))
}
