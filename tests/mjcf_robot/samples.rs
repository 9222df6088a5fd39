//! MuJoCo's own models as robots, where the library's package brings them.

use super::empty;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use std::io::Write;
use std::path::Path;

/// Those that are robots, with the number of their joints.
const ROBOTS: [(&str, usize); 2] = [("humanoid/humanoid.xml", 21), ("humanoid/22_humanoids.xml", 0)];

/// The humanoid floats and is held by drives at the posture in which it starts: for one second its joints stay there, as the
/// gains say: 1e4 N m/rad carry a few 10 N m with a few mrad, efforts are the file's.
#[test]
fn the_humanoid_holds_its_posture_for_a_second() {
    let dir = Path::new("/usr/share/mujoco/model");
    if !dir.is_dir() {
        // Past the harness, which keeps what passing tests print.
        let _ = writeln!(std::io::stderr(), "SKIPPED: {} is not here, no sample model was loaded", dir.display());
        return;
    }
    for (name, joints) in ROBOTS {
        let cfg = RobotCfg { mjcf: Some(MjcfFile::new(dir.join(name))), fix_base: false, ..Default::default() };
        let mut sim = empty(2);
        if joints == 0 {
            let error = sim.add_robot(cfg).unwrap_err().to_string();
            assert!(error.contains("bodies in its world"), "{name}: {error}");
            continue;
        }
        let id = sim.add_robot(cfg).unwrap();
        let robot = sim.robot(id);
        assert_eq!((robot.dof(), robot.get_qpos().dim(), robot.get_root_pose().dim()), (joints, (2, joints), (2, 7)));
        let mass = robot.total_mass();
        assert!(mass > 30.0 && mass < 60.0, "{mass}");
        let start = robot.get_qpos();
        let (height, com) = (robot.get_root_pose()[(0, 2)], com_height(&sim));
        for step in 0..500 {
            sim.update(1);
            let (off, kinetic) = (&sim.robot(id).get_qpos() - &start, kinetic_energy(&sim));
            let far = off.iter().fold(0.0f64, |far, d| far.max(d.abs()));
            assert!(far < 0.05, "step {step}: {far}");
            // It falls as one: no more than all of it can have from falling so far.
            let fallen = com - com_height(&sim);
            assert!(
                kinetic.is_finite() && kinetic < mass * 9.81 * fallen * 1.01 + 5.0,
                "step {step}: {kinetic} J, {fallen} m"
            );
        }
        assert!(sim.diverged().is_empty());
        // Nothing is below it: the file's floor is no part of the robot. Euler's rule falls by g h² n (n + 1) / 2.
        let fallen = com - com_height(&sim);
        let expected = 9.81 * 0.002f64.powi(2) * 500.0 * 501.0 / 2.0;
        assert!((fallen - expected).abs() < 1e-4, "{fallen} {expected}");
        assert!(sim.robot(id).get_root_pose()[(0, 2)] < height - 4.0);
        // The control: without drives the joints move.
        let mut limp = empty(2);
        let drive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
        let mjcf = Some(MjcfFile::new(dir.join(name)));
        let other = limp.add_robot(RobotCfg { mjcf, fix_base: true, drive, ..Default::default() }).unwrap();
        limp.update(500);
        let off = &limp.robot(other).get_qpos() - &start;
        assert!(off.iter().any(|d| d.abs() > 0.3), "{off}");
    }
}

fn kinetic_energy(sim: &SimulationManager) -> f64 {
    sim.batch().read(0, |env| {
        let (data, nv) = (env.data(), env.data().model().nv());
        let (matrix, v) = (data.mass_matrix().unwrap(), data.qvel());
        let product = |(i, v_i): (usize, &f64)| v_i * (0..nv).map(|j| matrix[i * nv + j] * v[j]).sum::<f64>();
        v.iter().enumerate().map(product).sum::<f64>() / 2.0
    })
}

/// Height of the centre of mass of everything \[m\].
fn com_height(sim: &SimulationManager) -> f64 {
    sim.batch().read(0, |env| env.data().subtree_com()[2])
}

/// Everything else that the package brings is a robot or a typed error, never a panic, and steps.
#[test]
fn every_other_sample_model_is_a_robot_or_an_error() {
    let dir = Path::new("/usr/share/mujoco/model");
    let (mut robots, mut refused) = (0, 0);
    for folder in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        for file in std::fs::read_dir(folder.path()).into_iter().flatten().flatten() {
            if file.path().extension().is_none_or(|extension| extension != "xml") {
                continue;
            }
            let mut sim = empty(1);
            for fix_base in [true, false] {
                let uid = format!("robot{fix_base}");
                let cfg = RobotCfg { uid, mjcf: Some(MjcfFile::new(file.path())), fix_base, ..Default::default() };
                match sim.add_robot(cfg) {
                    Ok(id) => {
                        let rows = Array2::zeros((1, sim.robot(id).dof()));
                        sim.robot_mut(id).set_qpos(&rows, None, None).unwrap();
                        robots += 1;
                    }
                    Err(error) => {
                        assert!(matches!(error, Error::RobotFile { .. } | Error::Compile(_)), "{error}");
                        refused += 1;
                    }
                }
            }
            sim.update(5);
        }
    }
    println!("{robots} robots, {refused} refused");
    assert!(!dir.is_dir() || robots >= 2 && refused >= 10, "{robots} {refused}");
}
