//! Names with any characters survive the way through the URDF and the MJCF and back.

use super::support::{INERTIAL, LIMIT, TETRAHEDRON, cfg, exported, robot, sim};
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::Error;
use std::path::Path;

fn escaped(name: &str) -> String {
    let name = name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    name.replace('"', "&quot;").replace('\'', "&apos;").replace('\n', "&#10;")
}

/// A root and two links with mesh collision shapes of this size; joints have the names of their links.
fn two_links(dir: &Path, uid: &str, names: [&str; 2], size: &str) -> RobotCfg {
    std::fs::write(dir.join("t.stl"), TETRAHEDRON.replace("0.1", size)).unwrap();
    let links = names.map(|name| {
        let (name, mesh) = (escaped(name), "<geometry><mesh filename=\"t.stl\"/></geometry>");
        format!(
            "<link name=\"{name}\">{INERTIAL}<visual>{mesh}</visual><collision>{mesh}</collision></link><joint \
             name=\"{name}\" type=\"revolute\"><parent link=\"root\"/><child link=\"{name}\"/><origin xyz=\"0 0 1\"/>\
             <axis xyz=\"0 1 0\"/>{LIMIT}<dynamics damping=\"0.1\" friction=\"0.1\"/></joint>"
        )
    });
    let urdf = format!("<robot name=\"{}\"><link name=\"root\"/>{}</robot>", escaped(names[0]), links.concat());
    RobotCfg { self_collision: true, ..robot(dir, uid, &urdf) }
}

fn assert_exports(sim: &SimulationManager, out: &Path) {
    sim.dump(out).unwrap();
    assert_eq!(exported(out).unwrap().njnt(), sim.batch().model().njnt());
}

#[test]
fn links_and_joints() {
    let long = "long".repeat(2500);
    for names in [
        ["a\"b", "a'b"],
        ["a<b>&c", "&lt;"],
        ["größe", "日本語"],
        ["a b", " a  b"],
        ["a/b", "a//b"],
        ["Link", "link"],
        ["É", "é"],
        ["base", "world"],
        ["ground", "light0"],
        ["a", "a/collision0"],
        ["a", "a/friction"],
        ["%s%n%d", "{}"],
        ["--", "-->"],
        [&long, "short"],
        ["\u{200b}", "\u{1f600}"],
    ] {
        for fix_base in [true, false] {
            let what = format!("{:.20?}, {:?}, fix_base {fix_base}", names[0], names[1]);
            let dir = tempfile::tempdir().unwrap();
            let mut sim = sim(1);
            let cfg = RobotCfg { fix_base, ..two_links(dir.path(), "r", names, "0.1") };
            let id = sim.add_robot(cfg).unwrap_or_else(|e| panic!("{what}: {e:.500}"));
            for (i, name) in names.into_iter().enumerate() {
                assert_eq!(sim.robot(id).joint_id(name).unwrap(), JointIndex(i), "{what}");
                sim.robot(id).link_pose(name).unwrap();
            }
            sim.robot_mut(id).set_qpos_target(&array![[0.5, -0.5]], None, None).unwrap();
            sim.update(100);
            let q = sim.robot(id).qpos();
            assert!((q[(0, 0)] - 0.5).abs() < 0.1 && (q[(0, 1)] + 0.5).abs() < 0.1, "{what}: joints are at {q}");
            assert_exports(&sim, &dir.path().join("out"));
        }
    }
}

/// The document names the first degree of freedom of a planar joint `x` `x.x`, which may collide with a joint of that
/// name.
#[test]
fn generated_names() {
    let dir = tempfile::tempdir().unwrap();
    for free in ["planar", "floating"] {
        let mut elements = format!("<link name=\"root\">{INERTIAL}</link>");
        let continuous = ["x.x", "x.yaw", "x.ball"].map(|name| (name, "m", "continuous"));
        for (name, parent, kind) in [("m", "root", "continuous"), ("x", "m", free)].into_iter().chain(continuous) {
            elements += &format!(
                "<link name=\"{name}\">{INERTIAL}</link><joint name=\"{name}\" type=\"{kind}\"><parent \
                 link=\"{parent}\"/><child link=\"{name}\"/></joint>"
            );
        }
        let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg { ground: None, ..cfg(1) });
        let urdf = format!("<robot name=\"r\">{elements}</robot>");
        let id = sim.add_robot(robot(dir.path(), "r", &urdf)).unwrap();
        sim.robot_mut(id).write_qpos(&array![[0.1, 0.2, 0.3, 0.4]], None, None).unwrap();
        assert_eq!(sim.robot(id).qpos(), array![[0.1, 0.2, 0.3, 0.4]]);
        sim.update(3);
    }
}

#[test]
fn uids() {
    // Names that differ only in case have separate meshes.
    let dirs = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let mut sim = sim(1);
    for (uid, dir, size) in [("arm", &dirs[0], "0.1"), ("ARM", &dirs[1], "0.7")] {
        sim.add_robot(two_links(dir.path(), uid, ["l", "m"], size)).unwrap();
    }
    let model = sim.batch().model();
    let radius = |uid: &str| {
        let geom = model.id(ObjectKind::Geom, &format!("{uid}/l/collision0")).unwrap();
        model.geom_size()[3 * geom..3 * geom + 3].iter().fold(0.0_f64, |a, &b| a.max(b))
    };
    assert!((radius("ARM") / radius("arm") - 7.0).abs() < 0.1, "{} {}", radius("ARM"), radius("arm"));
    let dir = dirs[0].path();
    for uid in ["a\"b<c>&'", "日本", " ", "...", "%s", "İ", "i̇", "robot"] {
        let id = sim.add_robot(two_links(dir, uid, ["l", "m"], "0.1")).unwrap_or_else(|e| panic!("{uid:?}: {e}"));
        assert_eq!(sim.entities().robot_id(uid).unwrap(), id);
    }
    for uid in ["world", "ground"] {
        let error = sim.add_robot(two_links(dir, uid, ["l", "m"], "0.1")).unwrap_err();
        assert!(matches!(error, Error::DuplicateUid(_)), "{uid:?}: {error}");
    }
    // Names become parts of paths, including file paths.
    for uid in [".", "..", "a/b", "a\\b", "a\nb", ""] {
        let error = sim.add_robot(two_links(dir, uid, ["l", "m"], "0.1")).unwrap_err();
        assert!(matches!(error, Error::InvalidUid(_)), "{uid:?}: {error}");
    }
    sim.update(2);
    assert_exports(&sim, &dir.join("out"));
}
