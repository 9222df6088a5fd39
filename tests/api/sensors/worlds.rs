//! Small worlds: objects, and robots of one or two links written here.

use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use nalgebra::Vector3;
use std::path::Path;

pub(crate) const G: f64 = 9.81;

/// `num_envs` environments at 200 Hz.
pub(crate) fn cfg(num_envs: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { num_envs, threads: Some(2), ..SimulationManagerCfg::legged() }
}

/// A cube of this mass \[kg\] and side \[m\] with its centre at `at`.
pub(crate) fn cube(uid: &str, mass: f64, side: f64, at: [f64; 3]) -> RigidObjectCfg {
    RigidObjectCfg {
        uid: uid.into(),
        shape: ObjectShape::cube(side),
        mass: Some(mass),
        init_pose: Pose::translation(at[0], at[1], at[2]),
        ..RigidObjectCfg::default()
    }
}

/// A robot from the text of its links and joints, without drives.
pub(crate) fn robot(dir: &Path, uid: &str, content: &str, fix_base: bool) -> RobotCfg {
    let path = dir.join(format!("{uid}.urdf"));
    std::fs::write(&path, format!("<robot name=\"{uid}\">{content}</robot>")).unwrap();
    RobotCfg {
        uid: uid.into(),
        urdf: UrdfCfg::single(path),
        drive: DriveCfg { drive_type: DriveType::None, ..DriveCfg::default() },
        fix_base,
        ..RobotCfg::default()
    }
}

/// A link of this mass and moment of inertia (about each axis) with its centre of mass at `com`.
pub(crate) fn link(name: &str, mass: f64, moment: f64, com: [f64; 3], collision: &str) -> String {
    format!(
        r#"<link name="{name}"><inertial><origin xyz="{} {} {}"/><mass value="{mass}"/>
        <inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>{collision}</link>"#,
        com[0], com[1], com[2]
    )
}

/// A joint from `base`.
pub(crate) fn joint(name: &str, kind: &str, child: &str, at: [f64; 3], axis: &str) -> String {
    format!(
        r#"<joint name="{name}" type="{kind}"><parent link="base"/><child link="{child}"/>
        <origin xyz="{} {} {}"/><axis xyz="{axis}"/><limit effort="100" velocity="100"/></joint>"#,
        at[0], at[1], at[2]
    )
}

/// Row `env` of a batch as a vector.
pub(crate) fn row(values: &Array2<f64>, env: usize, first: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| values[(env, first + k)])
}

#[track_caller]
pub(crate) fn assert_near(found: impl IntoIterator<Item = f64>, expected: &[f64], tolerance: f64) {
    let found: Vec<f64> = found.into_iter().collect();
    assert_eq!(found.len(), expected.len());
    let near = found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= tolerance);
    assert!(near, "{found:?} instead of {expected:?} within {tolerance}");
}
