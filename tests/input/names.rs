//! Names of any kind go through the URDF, the MJCF and back.

use super::support::{INERTIAL, TETRAHEDRON, cfg, robot};
use kinetoscope::prelude::*;
use std::path::Path;

fn escaped(name: &str) -> String {
    name.chars()
        .map(|c| match c {
            '&' => "&amp;".into(),
            '<' => "&lt;".into(),
            '>' => "&gt;".into(),
            '"' => "&quot;".into(),
            '\'' => "&apos;".into(),
            '\n' | '\t' | '\r' => format!("&#{};", c as u32),
            _ => c.to_string(),
        })
        .collect()
}

/// A root and two links that collide by a mesh, with joints of the same names.
fn two_links(dir: &Path, uid: &str, first: &str, second: &str) -> RobotCfg {
    std::fs::write(dir.join("t.stl"), TETRAHEDRON).unwrap();
    let link = |name: &str| {
        let name = escaped(name);
        format!(
            "<link name=\"{name}\">{INERTIAL}<visual><geometry><mesh filename=\"t.stl\"/></geometry></visual>\
             <collision><geometry><mesh filename=\"t.stl\"/></geometry></collision></link>\
             <joint name=\"{name}\" type=\"revolute\"><parent link=\"root\"/><child link=\"{name}\"/><origin xyz=\"0 0 1\"/>\
             <axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"10\" velocity=\"1\"/>\
             <dynamics damping=\"0.1\" friction=\"0.1\"/></joint>"
        )
    };
    let urdf =
        format!("<robot name=\"{}\"><link name=\"root\"/>{}{}</robot>", escaped(first), link(first), link(second));
    RobotCfg { self_collision: true, ..robot(dir, uid, &urdf) }
}

fn export_of(sim: &SimulationManager, out: &Path) -> Result<(), String> {
    sim.dump(out).map_err(|e| format!("dump: {e}"))?;
    let file = match kinetoscope::sim::mj::TARGET {
        kinetoscope::sim::mj::Target::V2 => "robot.mjcf2.xml",
        kinetoscope::sim::mj::Target::V4 => "robot.mjcf4.xml",
    };
    let compiled = kinetoscope::sim::mj::compile_file(&out.join(file)).map_err(|e| format!("the export: {e}"))?;
    assert_eq!(compiled.into_model().njnt(), sim.batch().model().njnt());
    Ok(())
}

#[test]
fn names_of_any_kind_work() {
    let long = "long".repeat(2500);
    let pairs = [
        ("a\"b", "a'b"),
        ("a<b>&c", "&lt;"),
        ("größe", "日本語"),
        ("a b", " a  b"),
        ("a/b", "a//b"),
        ("Link", "link"),
        ("É", "é"),
        ("base", "world"),
        ("ground", "light0"),
        ("a", "a/collision0"),
        ("a", "a/friction"),
        ("%s%n%d", "{}"),
        ("--", "-->"),
        (&long, "short"),
        ("\u{200b}", "\u{1f600}"),
    ];
    let mut wrong = Vec::new();
    for (first, second) in pairs {
        for fix_base in [true, false] {
            let dir = tempfile::tempdir().unwrap();
            let result = (|| -> Result<(), String> {
                let mut sim = SimulationManager::new(cfg(1)).map_err(|e| e.to_string())?;
                let cfg = RobotCfg { fix_base, ..two_links(dir.path(), "r", first, second) };
                let id = sim.add_robot(cfg).map_err(|e| format!("refused: {e}"))?;
                for (i, name) in [first, second].into_iter().enumerate() {
                    let joint = sim.robot(id).joint_id(name).map_err(|e| e.to_string())?;
                    assert_eq!(joint, JointIndex(i));
                    sim.robot(id).link_pose(name).map_err(|e| e.to_string())?;
                }
                sim.robot_mut(id).set_qpos(&kinetoscope::ndarray::array![[0.5, -0.5]], None, None).unwrap();
                sim.update(100);
                let q = sim.robot(id).get_qpos();
                if (q[(0, 0)] - 0.5).abs() > 0.1 || (q[(0, 1)] + 0.5).abs() > 0.1 {
                    return Err(format!("joints are at {q}"));
                }
                export_of(&sim, &dir.path().join("out"))
            })();
            if let Err(mut message) = result {
                message.truncate(500);
                wrong.push(format!("{:.20?}, {second:?}, fix_base {fix_base}: {message}", first));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// `x.x` is what the document calls the first degree of freedom of a planar joint `x`.
#[test]
fn names_that_the_document_makes_up_do_not_clash() {
    let dir = tempfile::tempdir().unwrap();
    for kind in ["planar", "floating"] {
        let mut urdf =
            format!("<robot name=\"r\"><link name=\"root\">{INERTIAL}</link><link name=\"m\">{INERTIAL}</link>");
        urdf += "<joint name=\"m\" type=\"continuous\"><parent link=\"root\"/><child link=\"m\"/></joint>";
        for (name, kind) in [("x", kind), ("x.x", "continuous"), ("x.yaw", "continuous"), ("x.ball", "continuous")] {
            urdf += &format!(
                "<link name=\"{name}\">{INERTIAL}</link>\
                 <joint name=\"{name}\" type=\"{kind}\"><parent link=\"m\"/><child link=\"{name}\"/></joint>"
            );
        }
        let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..cfg(1) }).unwrap();
        let id = sim.add_robot(robot(dir.path(), "r", &(urdf + "</robot>"))).unwrap();
        sim.robot_mut(id).write_qpos(&kinetoscope::ndarray::array![[0.1, 0.2, 0.3, 0.4]], None, None).unwrap();
        assert_eq!(sim.robot(id).get_qpos(), kinetoscope::ndarray::array![[0.1, 0.2, 0.3, 0.4]]);
        sim.update(3);
    }
}

/// Robots whose uids differ in case only have meshes of their own.
#[test]
fn uids_that_differ_in_case_share_nothing() {
    let (small, large) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    for (uid, dir, scale) in [("arm", &small, "0.1"), ("ARM", &large, "0.7")] {
        let cfg = two_links(dir.path(), uid, "l", "m");
        std::fs::write(dir.path().join("t.stl"), TETRAHEDRON.replace("0.1", scale)).unwrap();
        sim.add_robot(cfg).unwrap();
    }
    let model = sim.batch().model();
    let radius = |uid: &str| {
        let geom = model.id(kinetoscope::sim::mj::ObjectKind::Geom, &format!("{uid}/l/collision0")).unwrap();
        model.geom_size()[3 * geom..3 * geom + 3].iter().fold(0.0_f64, |a, &b| a.max(b))
    };
    assert!((radius("ARM") / radius("arm") - 7.0).abs() < 0.1, "{} {}", radius("ARM"), radius("arm"));
    export_of(&sim, &small.path().join("out")).unwrap();
}

#[test]
fn odd_uids_work() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    for uid in ["world", "ground", "a\"b<c>&'", "日本", " ", "...", "%s", "İ", "i̇", "robot"] {
        let cfg = two_links(dir.path(), uid, "l", "m");
        let id = sim.add_robot(cfg).unwrap_or_else(|e| panic!("{uid:?}: {e}"));
        assert_eq!(sim.robot_id(uid).unwrap(), id);
    }
    // Names become parts of paths, of files too.
    for uid in [".", "..", "a/b", "a\\b", "a\nb", ""] {
        let error = sim.add_robot(two_links(dir.path(), uid, "l", "m")).unwrap_err();
        assert!(matches!(error, Error::InvalidUid(_)), "{uid:?}: {error}");
    }
    sim.update(2);
    export_of(&sim, &dir.path().join("out")).unwrap();
}
