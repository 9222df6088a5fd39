//! Robots of these tests.

use kinetoscope::prelude::*;
use std::path::Path;

pub(crate) const INERTIAL: &str =
    r#"<inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>"#;

pub(crate) fn cfg(num_envs: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { num_envs, threads: Some(2), ..Default::default() }
}

/// Writes `robot.urdf` into `dir`.
pub(crate) fn robot(dir: &Path, uid: &str, urdf: &str) -> RobotCfg {
    let path = dir.join("robot.urdf");
    std::fs::write(&path, urdf).unwrap();
    RobotCfg { uid: uid.into(), urdf: UrdfCfg::single(path), ..Default::default() }
}

/// Two links and a hinge between them.
pub(crate) fn hinge() -> String {
    hinge_with(INERTIAL, r#"<limit lower="-1" upper="1" effort="10" velocity="1"/>"#)
}

/// Two links and a hinge with this content.
pub(crate) fn hinge_with(link: &str, joint: &str) -> String {
    format!(
        r#"<robot name="r">
  <link name="root"/>
  <link name="arm">{link}</link>
  <joint name="hinge" type="revolute"><parent link="root"/><child link="arm"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
    {joint}
  </joint>
</robot>"#
    )
}

/// A tetrahedron as STL text.
pub(crate) const TETRAHEDRON: &str = "solid t
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 0 0.1 0
vertex 0.1 0 0
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 0.1 0 0
vertex 0 0 0.1
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 0 0 0.1
vertex 0 0.1 0
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 0.1 0 0
vertex 0 0.1 0
vertex 0 0 0.1
endloop
endfacet
endsolid t
";

/// Bits of everything that decides how a simulation goes on.
pub(crate) fn bits(sim: &SimulationManager) -> Vec<u64> {
    let mut bits = Vec::new();
    sim.batch().for_each(|_, env| {
        let data = env.data();
        for array in [&[data.time()], data.qpos(), data.qvel(), data.qacc_warmstart(), &env.drives.position] {
            bits.extend(array.iter().map(|x| x.to_bits()));
        }
    });
    bits
}
