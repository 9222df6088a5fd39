//! The files of a dump against the simulation they come from.

use super::robots::{all, anymal, bundled, simulation};
use kinetoscope::prelude::*;
use kinetoscope::sim::DiagnosticKind;
use kinetoscope::sim::description::{Geometry, RobotDescription};
use kinetoscope::sim::mj::{Data, Model, ObjectKind, TARGET, Target, compile_file};
use kinetoscope::sim::urdf::assemble;
use std::collections::BTreeMap;
use std::path::Path;

fn exported(dir: &Path) -> Model {
    let file = match TARGET {
        Target::V2 => "robot.mjcf2.xml",
        Target::V4 => "robot.mjcf4.xml",
    };
    compile_file(&dir.join(file)).unwrap().into_model()
}

fn names(model: &Model, kind: ObjectKind) -> Vec<String> {
    (0..).map_while(|i| model.name(kind, i)).collect()
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn the_exported_model_is_the_one_that_runs() {
    for cfg in all() {
        let uid = cfg.uid.clone();
        let (sim, id) = simulation(cfg);
        let dir = tempfile::tempdir().unwrap();
        sim.dump(dir.path()).unwrap();
        let (run, export) = (sim.batch().model(), exported(dir.path()));
        for kind in [ObjectKind::Body, ObjectKind::Joint, ObjectKind::Actuator] {
            assert_eq!(names(run, kind), names(&export, kind), "{uid}");
        }
        assert_eq!(export.nq(), run.nq(), "{uid}");
        assert_eq!(export.qpos0(), run.qpos0(), "{uid}");
        assert_eq!(export.jnt_range(), run.jnt_range(), "{uid}");
        for (body, (mine, theirs)) in run.body_mass().iter().zip(export.body_mass()).enumerate() {
            assert!((mine - theirs).abs() < 1e-9, "{uid}: body {body} has {mine} and {theirs} kg");
        }
        let total: f64 = export.body_mass().iter().sum();
        assert!((total - run.body_mass().iter().sum::<f64>()).abs() < 1e-9, "{uid}");
        for (mine, theirs) in [
            (run.body_inertia(), export.body_inertia()),
            (run.body_ipos(), export.body_ipos()),
            (run.body_pos(), export.body_pos()),
            (run.body_quat(), export.body_quat()),
        ] {
            assert!(mine.iter().zip(theirs).all(|(a, b)| (a - b).abs() < 1e-12), "{uid}");
        }
        // A link that was fused keeps its frame: as a site here, by its name there.
        let mut data = Data::new(&export).unwrap();
        data.qpos_mut().copy_from_slice(&sim.batch().read(0, |env| env.data().qpos().to_vec()));
        data.forward().unwrap();
        let sites = names(&export, ObjectKind::Site);
        for link in sim.robot(id).link_names() {
            assert!(sites.contains(&format!("{uid}/{link}")), "{uid}: no site of {link}");
            sim.robot(id).link_pose(link).unwrap();
        }
        assert!(export.nmesh() >= run.nmesh(), "{uid}");
    }
}

/// The exported model, in plain MuJoCo, with its own actuators: a second at its own time step, targets at the start.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn the_exported_model_steps() {
    for cfg in all() {
        let uid = cfg.uid.clone();
        let (sim, _) = simulation(cfg);
        let dir = tempfile::tempdir().unwrap();
        sim.dump(dir.path()).unwrap();
        let mut data = Data::new(&exported(dir.path())).unwrap();
        data.qpos_mut().copy_from_slice(&sim.batch().read(0, |env| env.data().qpos().to_vec()));
        for _ in 0..100 {
            data.step().unwrap();
        }
        let warnings = data.take_warnings();
        assert_eq!(warnings.diverged(), None, "{uid}: {warnings:?}");
        assert_eq!(warnings.overflow(), None, "{uid}: {warnings:?}");
    }
}

fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![dir.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(dir).unwrap().to_string_lossy().into_owned();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn two_dumps_are_the_same_bytes() {
    for cfg in all() {
        let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let (mut sim, _) = simulation(cfg.clone());
        sim.dump(first.path()).unwrap();
        let (again, _) = simulation(cfg);
        again.dump(second.path()).unwrap();
        let (a, b) = (files(first.path()), files(second.path()));
        assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
        for (name, bytes) in &a {
            assert!(*bytes == b[name], "{name} differs");
        }
        // Into the same folder, after some steps: a dump is of the model, not of its state.
        sim.update(5);
        sim.dump(first.path()).unwrap();
        assert!(files(first.path()) == a);
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn diagnostics_are_all_in_the_dump() {
    for cfg in all() {
        let (sim, _) = simulation(cfg);
        let dir = tempfile::tempdir().unwrap();
        sim.dump(dir.path()).unwrap();
        let text = std::fs::read_to_string(dir.path().join("diagnostics.txt")).unwrap();
        let expected: String = sim.diagnostics().iter().map(|d| format!("{d}\n")).collect();
        assert_eq!(text, expected);
    }
    let (sim, _) = simulation(anymal());
    assert!(sim.diagnostics().len() > 5);
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn the_dumped_urdf_is_the_same_robot() {
    for cfg in all() {
        let (sim, id) = simulation(cfg);
        let dir = tempfile::tempdir().unwrap();
        sim.dump(dir.path()).unwrap();
        let again = assemble(&UrdfCfg::single(dir.path().join("robot.urdf"))).unwrap().description;
        assert_same(sim.robot(id).description(), &again);
    }
}

fn assert_same(a: &RobotDescription, b: &RobotDescription) {
    let near = |x: &Pose, y: &Pose| {
        (x.translation.vector - y.translation.vector).norm() < 1e-12 && x.rotation.angle_to(&y.rotation) < 1e-12
    };
    let same_shape = |x: &Geometry, y: &Geometry| match (x, y) {
        (Geometry::Mesh { path: p, scale: s, .. }, Geometry::Mesh { path: q, scale: t, .. }) => {
            s == t && (p == q || p.canonicalize().ok() == q.canonicalize().ok())
        }
        _ => x == y,
    };
    assert_eq!((&a.name, a.root, a.links.len(), a.joints.len()), (&b.name, b.root, b.links.len(), b.joints.len()));
    for (x, y) in a.links.iter().zip(&b.links) {
        assert_eq!((&x.name, x.parent_joint, &x.child_joints), (&y.name, y.parent_joint, &y.child_joints));
        assert_eq!(x.inertial.is_some(), y.inertial.is_some(), "{}", x.name);
        if let (Some(x), Some(y)) = (&x.inertial, &y.inertial) {
            assert_eq!((x.mass, x.inertia), (y.mass, y.inertia));
            assert!(near(&x.link_from_com, &y.link_from_com));
        }
        assert_eq!((x.visuals.len(), x.collisions.len()), (y.visuals.len(), y.collisions.len()), "{}", x.name);
        for (x, y) in x.visuals.iter().zip(&y.visuals) {
            assert!(near(&x.link_from_shape, &y.link_from_shape) && same_shape(&x.geometry, &y.geometry));
            assert_eq!(x.material.as_ref().map(|m| m.rgba), y.material.as_ref().map(|m| m.rgba));
        }
        for (x, y) in x.collisions.iter().zip(&y.collisions) {
            assert!(near(&x.link_from_shape, &y.link_from_shape) && same_shape(&x.geometry, &y.geometry));
        }
    }
    for (x, y) in a.joints.iter().zip(&b.joints) {
        assert_eq!((&x.name, x.kind, x.parent, x.child), (&y.name, y.kind, y.parent, y.child));
        assert_eq!((x.damping, x.friction), (y.damping, y.friction), "{}", x.name);
        assert!(near(&x.parent_from_joint, &y.parent_from_joint), "{}", x.name);
        assert!((x.axis.into_inner() - y.axis.into_inner()).norm() < 1e-15, "{}", x.name);
        let limit = |j: &kinetoscope::sim::description::Joint| {
            j.limit.as_ref().map(|l| (l.lower, l.upper, l.effort, l.velocity))
        };
        assert_eq!(limit(x), limit(y), "{}", x.name);
        let mimic =
            |j: &kinetoscope::sim::description::Joint| j.mimic.as_ref().map(|m| (m.joint, m.multiplier, m.offset));
        assert_eq!(mimic(x), mimic(y), "{}", x.name);
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn anymal_keeps_its_textures_its_mass_and_its_feet() {
    let cfg = anymal();
    let (sim, id) = simulation(cfg);
    let dir = tempfile::tempdir().unwrap();
    sim.dump(dir.path()).unwrap();
    let export = exported(dir.path());
    let pictures = files(dir.path()).keys().filter(|name| name.ends_with(".png")).count();
    assert_eq!(pictures, 17, "17 JPEG files");
    assert_eq!(export.ntex(), 17);
    assert!(export.nmesh() > 17, "{}", export.nmesh());
    assert!((sim.robot(id).total_mass() - 52.135).abs() < 5e-4, "{}", sim.robot(id).total_mass());
    let total: f64 = export.body_mass().iter().sum();
    assert!((total - sim.robot(id).total_mass()).abs() < 1e-9, "{total}");
    for (foot, front, left) in
        [("LF_FOOT", 1.0, 1.0), ("RF_FOOT", 1.0, -1.0), ("LH_FOOT", -1.0, 1.0), ("RH_FOOT", -1.0, -1.0)]
    {
        let pose = sim.robot(id).link_pose(foot).unwrap();
        assert!(pose[(0, 0)] * front > 0.2 && pose[(0, 1)] * left > 0.1, "{foot} is at {pose}");
        assert!(!names(sim.batch().model(), ObjectKind::Body).contains(&format!("anymal/{foot}")), "it is fused");
    }
    let repaired: Vec<_> = sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::InertiaRepaired).collect();
    assert_eq!(repaired.len(), 5, "{repaired:#?}");
    let urdf = std::fs::read_to_string(sim.robot(id).description().links[0].source.file.as_path()).unwrap();
    for diagnostic in repaired {
        let source = diagnostic.source.as_ref().unwrap();
        assert!(source.file.ends_with("anymal.urdf"), "{diagnostic}");
        let link = diagnostic.message.split('"').nth(1).unwrap();
        // The line is of the inertial element, which stands in the link of that name.
        let before: Vec<&str> = urdf.lines().take(source.line as usize).collect();
        assert!(before.last().unwrap().contains("<inertial"), "{diagnostic}");
        let opened = before.iter().rev().find(|line| line.contains("<link")).unwrap();
        assert!(opened.contains(&format!("\"{link}\"")), "{diagnostic}: {opened}");
    }
}

/// Meshes whose names are alike do not overwrite each other.
#[test]
fn meshes_with_names_alike_stay_apart() {
    let dir = tempfile::tempdir().unwrap();
    let mtl = "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n";
    std::fs::write(dir.path().join("two.mtl"), mtl).unwrap();
    let corners = |s: f64| format!("v 0 0 0\nv {s} 0 0\nv 0 {s} 0\nv 0 0 {s}\n");
    let two = format!("mtllib two.mtl\n{}usemtl red\nf 1 3 2\nf 1 2 4\nusemtl blue\nf 1 4 3\nf 2 3 4\n", corners(0.1));
    let one = |s| format!("{}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", corners(s));
    let mut urdf = String::from("<robot name=\"r\"><link name=\"l\">");
    for (file, text) in [
        ("a.obj", two.clone()),
        ("a_0.obj", one(0.2)),
        ("A.obj", one(0.3)),
        ("a_v2.obj", one(0.4)),
        ("a b.obj", one(0.5)),
        ("a.b.obj", one(0.6)),
        ("robot_hull0.obj", one(0.7)),
        ("é.obj", one(0.8)),
    ] {
        std::fs::write(dir.path().join(file), text).unwrap();
        urdf += &format!(
            "<visual><geometry><mesh filename=\"{file}\"/></geometry></visual>\
             <collision><geometry><mesh filename=\"{file}\"/></geometry></collision>"
        );
    }
    let path = dir.path().join("r.urdf");
    std::fs::write(&path, urdf + "</link></robot>").unwrap();
    let (sim, _) = simulation(RobotCfg { urdf: UrdfCfg::single(path), ..Default::default() });
    assert!(sim.diagnostics().is_empty(), "{:?}", sim.diagnostics());
    let out = dir.path().join("out");
    sim.dump(&out).unwrap();
    let objs = files(&out).keys().filter(|name| name.ends_with(".obj")).count();
    assert_eq!(objs, 2 + 7, "{:?}", files(&out).keys().collect::<Vec<_>>());
    let export = exported(&out);
    assert_eq!(export.nmesh(), 2 + 7 + 8, "two parts, seven files, eight hulls");
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn a_dump_of_several_robots_loads() {
    let other = super::robots::vendor_arm_and_hand();
    let cfg = SimulationManagerCfg { threads: Some(1), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    for (i, robot) in [bundled(), other.clone(), RobotCfg { uid: "third".into(), ..other }].into_iter().enumerate() {
        sim.add_robot(RobotCfg { init_pose: Pose::translation(2.0 * i as f64, 0.0, 0.0), ..robot }).unwrap();
    }
    let dir = tempfile::tempdir().unwrap();
    sim.dump(dir.path()).unwrap();
    assert_eq!(names(&exported(dir.path()), ObjectKind::Body), names(sim.batch().model(), ObjectKind::Body));
    for uid in ["sr5", "inspire", "third"] {
        assert!(dir.path().join(format!("{uid}.urdf")).is_file());
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_an_error() {
    let (sim, _) = simulation(bundled());
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "").unwrap();
    let message = sim.dump(&file).unwrap_err().to_string();
    assert!(message.contains("file"), "{message}");
}
