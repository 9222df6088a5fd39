//! Readers that nobody here wrote: NumPy, the `mcap` package with its decoder of ROS 2 messages, Pillow.

use super::support::{PICTURE_EVERY, World};
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Names the python that has them.
const VARIABLE: &str = "KINETOSCOPE_PYTHON_READERS";
const STEPS: u32 = 4 * PICTURE_EVERY;

/// The python that `cargo xtask test` names.
fn python() -> Option<PathBuf> {
    let python = std::env::var_os(VARIABLE).map(PathBuf::from);
    if python.is_none() {
        eprintln!("skipped: no python with numpy, mcap and pillow; `cargo xtask test` brings one");
    }
    python
}

/// What a script says of a file.
fn said(python: &Path, script: &str, file: &Path) -> serde_json::Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/record").join(script);
    let output = Command::new(python).arg(script).arg(file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Numbers with a fraction as texts of their bits, as the scripts give them: nothing is lost between the programs.
fn bits(value: serde_json::Value) -> serde_json::Value {
    use serde_json::Value;
    match value {
        Value::Number(number) if number.is_f64() => number.as_f64().unwrap().to_bits().to_string().into(),
        Value::Array(values) => values.into_iter().map(bits).collect(),
        Value::Object(values) => values.into_iter().map(|(name, value)| (name, bits(value))).collect(),
        other => other,
    }
}

/// Records, and gives what the last row should be.
fn recorded(path: &Path) -> serde_json::Value {
    let mut world = World::new(2, 2);
    let recorder = world.sim.record(RecorderCfg::new(path)).unwrap();
    (0..STEPS).for_each(|step| world.step(step));
    let robot = world.sim.robot(world.arm);
    let camera = world.sim.sensor(world.camera).unwrap();
    let depth = camera.depth().unwrap().index_axis(Axis(0), 1).to_owned();
    let color = camera.color().unwrap().index_axis(Axis(0), 1).to_owned();
    let mask = camera.mask().unwrap().index_axis(Axis(0), 1).to_owned();
    let finite = depth.iter().copied().filter(|x| x.is_finite());
    let range = [finite.clone().fold(f32::INFINITY, f32::min), finite.fold(0.0, f32::max)].map(f64::from);
    let expected = serde_json::json!({
        "names": robot.joint_names(),
        "position": robot.get_qpos().row(1).to_vec(),
        "velocity": robot.get_qvel().row(1).to_vec(),
        "effort": robot.get_qf().row(1).to_vec(),
        "target": robot.get_target_qpos().row(1).to_vec(),
        "tip": robot.get_link_poses().index_axis(Axis(0), 1).outer_iter().last().unwrap().to_vec(),
        "tip_name": format!("env_1/arm/{}", robot.link_names().last().unwrap()),
        "cube": world.sim.rigid_object(world.cube).get_pose().row(1).to_vec(),
        "acceleration": world.sim.sensor(world.imu).unwrap().lin_acc_b().row(1).to_vec(),
        "orientation": world.sim.sensor(world.imu).unwrap().quat_w().row(1).to_vec(),
        "intrinsics": camera.intrinsic_matrices().index_axis(Axis(0), 1).iter().copied().collect::<Vec<f64>>(),
        "camera": camera.pose_w(CameraConvention::Ros).row(1).to_vec(),
        "nanoseconds": (world.sim.time()[1] * 1e9).round() as u64,
        "depth_shape": depth.shape(),
        "depth_finite": depth.iter().filter(|x| x.is_finite()).count(),
        "depth_range": range,
        "mask_sum": mask.iter().zip(1..).map(|(x, k)| i64::from(*x) * k).sum::<i64>(),
        // Without the opacity; each number by its place, so that none may stand for another.
        "color_sum": color.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]]).zip(1..).map(|(x, k)| u64::from(x) * k).sum::<u64>(),
        "rows": STEPS + 1,
        "pictures": STEPS / PICTURE_EVERY,
    });
    world.sim.finish_recording(recorder).unwrap();
    bits(expected)
}

#[test]
fn the_mcap_package_reads_every_message() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let expected = recorded(&path);
    assert_eq!(said(&python, "read_mcap.py", &path), expected);
}

#[test]
fn numpy_reads_every_array() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let expected = recorded(&path);
    assert_eq!(said(&python, "read_npz.py", &path), expected);
}
