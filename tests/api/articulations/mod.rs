//! Articulations that are no robots: they move as their files say, and as what touches them makes them.

mod mistakes;
mod mjcf;
mod moves;
mod stands;

use kinetoscope::prelude::*;
use std::path::PathBuf;

/// Short steps: what closed forms say of continuous time is compared with them.
const DT: f64 = 1e-3;

fn cabinet_urdf() -> PathBuf {
    assets::path("cabinet/cabinet.urdf").unwrap()
}

/// The bundled cabinet, its front towards +x.
fn cabinet() -> ArticulationCfg {
    ArticulationCfg { uid: "cabinet".into(), urdf: UrdfCfg::single(cabinet_urdf()), ..Default::default() }
}

fn sim(num_envs: usize) -> SimulationManager {
    SimulationManager::new(SimulationManagerCfg { num_envs, physics_dt: DT, ..Default::default() }).unwrap()
}

/// An articulation of a file with this text.
fn of_text(uid: &str, text: &str) -> (tempfile::TempDir, ArticulationCfg) {
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join(format!("{uid}.urdf"));
    std::fs::write(&path, text).unwrap();
    (files, ArticulationCfg { uid: uid.into(), urdf: UrdfCfg::single(path), ..Default::default() })
}

/// A door on hinges along z, without friction or damping.
const DOOR: &str = r#"<robot name="door">
  <link name="frame"/>
  <link name="leaf"><inertial><origin xyz="0.4 0 1"/><mass value="20"/>
    <inertia ixx="7" ixy="0" ixz="0" iyy="8" iyz="0" izz="1.1"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="frame"/><child link="leaf"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1.6" effort="50" velocity="2"/></joint>
</robot>"#;
