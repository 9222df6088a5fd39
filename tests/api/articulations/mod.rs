//! Passive articulations: they move as their joints and contacts allow.

mod entities;
mod mjcf;
mod motion;

use kinetoscope::prelude::*;
use kinetoscope::sim::ArticulationId;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::text_robot;

/// Short time step, because results are compared with closed forms in continuous time \[s\].
const DT: f64 = 1e-3;

fn cabinet_urdf() -> UrdfCfg {
    UrdfCfg::single(assets::path("cabinet/cabinet.urdf").unwrap())
}

/// The bundled cabinet, with its front facing +x.
fn cabinet() -> ArticulationCfg {
    ArticulationCfg { uid: "cabinet".into(), urdf: cabinet_urdf(), ..Default::default() }
}

fn sim(num_envs: usize) -> SimulationManager {
    kinetoscope_testkit::worlds::sim(SimulationManagerCfg { num_envs, physics_dt: DT, ..Default::default() })
}

/// A simulation with one articulation.
fn with(num_envs: usize, cfg: ArticulationCfg) -> (SimulationManager, ArticulationId) {
    let mut sim = sim(num_envs);
    let id = sim.add_articulation(cfg).unwrap();
    (sim, id)
}

/// A door on hinges along z, without friction or damping.
fn door(files: &TempFiles) -> ArticulationCfg {
    let urdf = r#"<robot name="door">
  <link name="frame"/>
  <link name="leaf"><inertial><origin xyz="0.4 0 1"/><mass value="20"/>
    <inertia ixx="7" ixy="0" ixz="0" iyy="8" iyz="0" izz="1.1"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="frame"/><child link="leaf"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1.6" effort="50" velocity="2"/></joint>
</robot>"#;
    ArticulationCfg { uid: "door".into(), urdf: text_robot(files, "door", urdf).urdf, ..Default::default() }
}
