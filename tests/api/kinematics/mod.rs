//! Kinematics of robots: poses, Jacobians and inverse kinematics, compared with MuJoCo and with closed forms.

mod inverse;
mod mistakes;
mod planar;
mod references;
mod singular;

use kinetoscope::ndarray::{Array2, ArrayView1, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::KeyedRng;
use kinetoscope_testkit::urdf::{TempFiles, limit, link};
use kinetoscope_testkit::worlds::{pose_error, pose_of_row};
use std::path::{Path, PathBuf};

fn simulation(num_envs: usize, robot: RobotCfg) -> (SimulationManager, RobotId) {
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg {
        ground: None,
        ..kinetoscope_testkit::worlds::cfg(num_envs, 1)
    });
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/arms").join(name)
}

/// A robot whose movable joints form the part `arm`.
fn arm(urdf: impl AsRef<Path>) -> RobotCfg {
    RobotCfg {
        control_parts: vec![("arm".into(), vec![".*".into()])],
        ..kinetoscope_testkit::worlds::urdf_robot("robot", urdf.as_ref())
    }
}

fn sr5() -> RobotCfg {
    arm(assets::path("sr5/SR5.urdf").unwrap())
}

fn seven_axes() -> RobotCfg {
    arm(file("seven_axes.urdf"))
}

fn six_axes() -> RobotCfg {
    arm(file("six_axes.urdf"))
}

/// The bundled arm and hand, assembled as in the tutorials.
fn arm_and_hand() -> RobotCfg {
    let mut robot = kinetoscope_testkit::worlds::arm_and_hand("robot");
    robot.urdf.components[1].transform = kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.02], [1.5, 0.1, 0.0]);
    robot.control_parts = vec![("arm".into(), vec!["JOINT[1-6]".into()]), ("hand".into(), vec!["LEFT_.*".into()])];
    robot
}

/// A robot of links, each a ball of 1 kg, and joints, which form the part `arm`.
fn built(num_envs: usize, links: &[&str], joints: &[String]) -> (SimulationManager, RobotId) {
    let files = TempFiles::default();
    let links: String = links.iter().map(|name| link(name, 1.0, 0.01, [0.0; 3], "")).collect();
    simulation(num_envs, arm(files.write("r.urdf", kinetoscope_testkit::urdf::robot("r", &(links + &joints.concat())))))
}

fn wide(range: [f64; 2]) -> String {
    limit(range, 9.0, 9.0)
}

/// Uniformly random positions within the limits (within a turn for joints without limits); mimic joints follow their
/// drivers.
fn random_qpos(sim: &SimulationManager, robot: RobotId, rows: usize, seed: u64) -> Array2<f64> {
    let robot = sim.robot(robot);
    let limits = robot.qpos_limits();
    let mut qpos = Array2::from_shape_fn((rows, robot.dof()), |(row, joint)| {
        let (low, high) = (limits[(0, joint, 0)], limits[(0, joint, 1)]);
        let bounded = low.is_finite() && high.is_finite();
        let (low, high) = if bounded { (low, high) } else { (low.max(-3.2), high.min(3.2)) };
        low + (high - low) * KeyedRng::keyed(seed, row as u64, &joint.to_string()).uniform()
    });
    for (joint, (driver, ratio, offset)) in robot.mimic_drivers().into_iter().enumerate() {
        if driver.0 != joint {
            qpos.rows_mut().into_iter().for_each(|mut row| row[joint] = ratio * row[driver.0] + offset);
        }
    }
    qpos
}

fn pose(row: ArrayView1<'_, f64>) -> Pose {
    pose_of_row(&row.insert_axis(Axis(0)).to_owned(), 0)
}

fn row(q: &[f64]) -> Array2<f64> {
    Array2::from_shape_vec((1, q.len()), q.to_vec()).unwrap()
}

/// Largest distance \[m\] and angle \[rad\] between rows of poses.
fn max_pose_difference(a: &Array2<f64>, b: &Array2<f64>) -> (f64, f64) {
    assert_eq!(a.dim(), b.dim());
    let each = (0..a.nrows()).map(|row| pose_error(&pose_of_row(a, row), &pose_of_row(b, row)));
    each.fold((0.0, 0.0), |most, one| (f64::max(most.0, one.0), f64::max(most.1, one.1)))
}

/// MuJoCo's poses of a link at these joint positions.
fn mujoco_link_poses(sim: &mut SimulationManager, id: RobotId, qpos: &Array2<f64>, link: &str) -> Array2<f64> {
    sim.robot_mut(id).write_qpos(qpos, None, None).unwrap();
    sim.robot(id).link_pose(link).unwrap()
}

fn reaches((far, turned): (f64, f64)) -> bool {
    far <= 1e-4 && turned <= 1e-3
}
