//! Robots of the input tests.

use kinetoscope::mujoco::{BUILD_VERSION, Model, SupportedVersion, compile_file};
use kinetoscope::prelude::*;
use kinetoscope_testkit::urdf;
pub(crate) use kinetoscope_testkit::worlds::all_bits as bits;
use std::path::Path;

pub(crate) const INERTIAL: &str =
    r#"<inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>"#;
pub(crate) const LIMIT: &str = r#"<limit lower="-1" upper="1" effort="10" velocity="1"/>"#;

/// A tetrahedron as STL text.
pub(crate) const TETRAHEDRON: &str = "solid t\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0.1 0\nvertex 0.1 0 0\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0.1 0 0\nvertex 0 0 0.1\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 0.1\nvertex 0 0.1 0\nendloop\nendfacet\n\
    facet normal 0 0 0\nouter loop\nvertex 0.1 0 0\nvertex 0 0.1 0\nvertex 0 0 0.1\nendloop\nendfacet\nendsolid t\n";

pub(crate) fn cfg(num_envs: usize) -> SimulationManagerCfg {
    kinetoscope_testkit::worlds::cfg(num_envs, 2)
}

pub(crate) fn sim(num_envs: usize) -> SimulationManager {
    kinetoscope_testkit::worlds::sim(cfg(num_envs))
}

/// Writes `robot.urdf` into `dir`.
pub(crate) fn robot(dir: &Path, uid: &str, urdf: &str) -> RobotCfg {
    let path = dir.join("robot.urdf");
    std::fs::write(&path, urdf).unwrap();
    kinetoscope_testkit::worlds::urdf_robot(uid, path)
}

/// Two links and a hinge with this content; the moving link is in line 3.
pub(crate) fn hinge_with(link: &str, joint: &str) -> String {
    let joint = urdf::joint("hinge", "revolute", ["root", "arm"], [0.0, 0.0, 1.0], "0 1 0", joint);
    urdf::robot("r", &format!("<link name=\"root\"/>\n<link name=\"arm\">{link}</link>\n{joint}"))
}

/// Two links and a hinge between them.
pub(crate) fn hinge() -> String {
    hinge_with(INERTIAL, LIMIT)
}

/// One link with a collision sphere of 0.1 m.
pub(crate) fn ball() -> String {
    let collision = urdf::collision("<sphere radius=\"0.1\"/>", [0.0; 3]);
    urdf::robot("ball", &format!("<link name=\"ball\">{INERTIAL}{collision}</link>"))
}

/// Links `l0`, `l1`, ..., one per line, with joints `j1`, `j2`, ... about y of this kind and content.
pub(crate) fn chain(links: usize, kind: &str, more: &str) -> String {
    let mut elements = format!("<link name=\"l0\">{INERTIAL}</link>\n");
    for i in 1..links {
        let ends = [format!("l{}", i - 1), format!("l{i}")];
        elements += &format!("<link name=\"l{i}\">{INERTIAL}</link>");
        elements += &urdf::joint(&format!("j{i}"), kind, [&ends[0], &ends[1]], [0.0; 3], "0 1 0", more);
    }
    urdf::robot("chain", &elements)
}

/// The exported model of a dump, compiled by plain MuJoCo.
pub(crate) fn exported(dir: &Path) -> Result<Model, String> {
    let file = match BUILD_VERSION {
        SupportedVersion::V2 => "robot.mjcf2.xml",
        SupportedVersion::V4 => "robot.mjcf4.xml",
    };
    compile_file(dir.join(file)).map(|compiled| compiled.into_model()).map_err(|e| format!("the export: {e}"))
}
