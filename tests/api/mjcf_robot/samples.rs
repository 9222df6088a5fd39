//! MuJoCo's own models as robots, where the library's package brings them.

use super::empty;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use std::io::Write;
use std::path::Path;

/// Those that are robots, with the number of their joints.
const ROBOTS: [(&str, usize); 2] = [("humanoid/humanoid.xml", 21), ("humanoid/22_humanoids.xml", 0)];

/// Where each joint of the humanoid comes to rest with its trunk held, from the posture in which it starts: static
/// equilibrium of springs, gravity and the drive. The judge of the torque is MuJoCo's bias and passive force there, which the
/// stiffness of the drive turns into a sag: `kp (q* - q) = τ`. Without drives the same robot moves by radians.
#[test]
fn the_humanoid_sags_by_what_it_carries_over_its_gains() {
    let dir = Path::new("/usr/share/mujoco/model");
    if !dir.is_dir() {
        // Past the harness, which keeps what passing tests print.
        let _ = writeln!(std::io::stderr(), "SKIPPED: {} is not here, no sample model was loaded", dir.display());
        return;
    }
    for (name, joints) in ROBOTS {
        let of_file = || RobotCfg { mjcf: Some(MjcfFile::new(dir.join(name))), ..Default::default() };
        let mut sim = empty(2);
        if joints == 0 {
            let error = sim.add_robot(of_file()).unwrap_err().to_string();
            assert!(error.contains("bodies in its world"), "{name}: {error}");
            continue;
        }
        let id = sim.add_robot(of_file()).unwrap();
        let robot = sim.robot(id);
        assert_eq!((robot.dof(), robot.get_qpos().dim(), robot.get_root_pose().dim()), (joints, (2, joints), (2, 7)));
        let mass: f64 = sim.batch().read(0, |env| env.data().model().body_mass().iter().sum());
        assert!((robot.total_mass() - mass).abs() < 1e-9 * mass && mass > 30.0, "{} {mass}", robot.total_mass());
        let (start, kp) = (robot.get_qpos(), robot.get_stiffness());
        sim.update(2000);
        assert!(sim.diverged().is_empty());
        let (off, speed) = (&start - &sim.robot(id).get_qpos(), sim.robot(id).get_qvel());
        let load = sim.batch().read(0, |env| {
            let (bias, passive) = (env.data().qfrc_bias().to_vec(), env.data().qfrc_passive().to_vec());
            bias.iter().zip(&passive).map(|(bias, passive)| bias - passive).collect::<Vec<f64>>()
        });
        assert_eq!(load.len(), joints);
        // The solver stops at 1e-8 of the scale of the scene; 1e-3 of the largest load is far above and far below a wrong sign.
        let largest = load.iter().fold(0.0f64, |largest, load| largest.max(load.abs()));
        assert!(largest > 1.0, "something is carried: {load:?}");
        for joint in 0..joints {
            assert!(speed[(0, joint)].abs() < 1e-4, "joint {joint} rests: {}", speed[(0, joint)]);
            let held = kp[(0, joint)] * off[(0, joint)];
            assert!((held - load[joint]).abs() < 1e-2 * largest, "joint {joint}: {held} N m, {} N m", load[joint]);
        }
        // The control is the same experiment without drives.
        let mut limp = empty(1);
        let drive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
        let other = limp.add_robot(RobotCfg { drive, ..of_file() }).unwrap();
        limp.update(500);
        let off = limp.robot(other).get_qpos() - start.row(0);
        assert!(off.iter().any(|d| d.abs() > 0.3), "{off}");
    }
}

/// Everything else that the package brings is a robot or a typed error, never a panic, and steps. What MuJoCo compiles alone it
/// compiles in the scene: an error of the scene's document is ours.
#[test]
fn every_other_sample_model_is_a_robot_or_an_error() {
    let dir = Path::new("/usr/share/mujoco/model");
    let (mut robots, mut refused) = (0, 0);
    for folder in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        for file in std::fs::read_dir(folder.path()).into_iter().flatten().flatten() {
            if file.path().extension().is_none_or(|extension| extension != "xml") {
                continue;
            }
            for fix_base in [true, false] {
                let cfg = RobotCfg { mjcf: Some(MjcfFile::new(file.path())), fix_base, ..Default::default() };
                let mut sim = empty(1);
                match sim.add_robot(cfg) {
                    Ok(id) => {
                        let rows = Array2::zeros((1, sim.robot(id).dof()));
                        sim.robot_mut(id).set_qpos(&rows, None, None).unwrap();
                        sim.update(5);
                        assert!(sim.diverged().is_empty(), "{}: {:?}", file.path().display(), sim.diverged());
                        robots += 1;
                    }
                    Err(error) => {
                        assert!(matches!(error, Error::RobotFile { .. }), "{}: {error}", file.path().display());
                        refused += 1;
                    }
                }
            }
        }
    }
    println!("{robots} robots, {refused} refused");
    assert!(!dir.is_dir() || robots >= 2 && refused >= 10, "{robots} {refused}");
}
