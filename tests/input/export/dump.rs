//! The files of a dump, compared with the simulation that wrote them.

use super::robots::{anymal, bundled, dump, simulation};
use crate::support::exported;
use crate::urdf::assert_same;
use kinetoscope::mujoco::{Data, Model, ObjectKind};
use kinetoscope::prelude::*;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::robot::urdf::assemble;
use std::collections::BTreeMap;
use std::path::Path;

of_each_robot! { model steps same_bytes diagnostics urdf }

fn names(model: &Model, kind: ObjectKind) -> Vec<String> {
    (0..).map_while(|i| model.name(kind, i)).collect()
}

/// The exported model equals the running model.
fn model(cfg: RobotCfg) {
    let uid = cfg.uid.clone();
    let (sim, id) = simulation(cfg);
    let (run, export) = (sim.batch().model(), exported(dump(&sim).path()).unwrap());
    for kind in [ObjectKind::Body, ObjectKind::Joint, ObjectKind::Actuator] {
        assert_eq!(names(run, kind), names(&export, kind), "{uid}");
    }
    assert_eq!(export.nq(), run.nq(), "{uid}");
    assert_eq!(export.qpos0(), run.qpos0(), "{uid}");
    assert_eq!(export.jnt_range(), run.jnt_range(), "{uid}");
    for (what, tolerance, mine, theirs) in [
        ("mass", 1e-9, run.body_mass(), export.body_mass()),
        ("total mass", 1e-9, &[run.body_mass().iter().sum()], &[export.body_mass().iter().sum()]),
        ("inertia", 1e-12, run.body_inertia(), export.body_inertia()),
        ("ipos", 1e-12, run.body_ipos(), export.body_ipos()),
        ("pos", 1e-12, run.body_pos(), export.body_pos()),
        ("quat", 1e-12, run.body_quat(), export.body_quat()),
    ] {
        assert!(mine.iter().zip(theirs).all(|(a, b)| (a - b).abs() < tolerance), "{uid}: {what} {mine:?} {theirs:?}");
    }
    // A fused link keeps its frame: as a site in the export, by its name in the simulation.
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

/// The exported model runs in plain MuJoCo with its own actuators: 100 steps at its time step, targets at the start
/// positions.
fn steps(cfg: RobotCfg) {
    let uid = cfg.uid.clone();
    let (sim, _) = simulation(cfg);
    let mut data = Data::new(&exported(dump(&sim).path()).unwrap()).unwrap();
    data.qpos_mut().copy_from_slice(&sim.batch().read(0, |env| env.data().qpos().to_vec()));
    (0..100).for_each(|_| data.step().unwrap());
    let warnings = data.take_warnings();
    assert_eq!((warnings.diverged(), warnings.overflow()), (None, None), "{uid}: {warnings:?}");
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

fn same_bytes(cfg: RobotCfg) {
    let (mut sim, _) = simulation(cfg.clone());
    let first = dump(&sim);
    let (a, b) = (files(first.path()), files(dump(&simulation(cfg).0).path()));
    assert!(a.keys().eq(b.keys()), "{:?} {:?}", a.keys(), b.keys());
    for (name, bytes) in &a {
        assert!(*bytes == b[name], "{name} differs");
    }
    // A second dump into the same folder, after some steps: a dump holds the model, not its state.
    sim.update(5);
    sim.dump(first.path()).unwrap();
    assert!(files(first.path()) == a);
}

fn diagnostics(cfg: RobotCfg) {
    let least = if cfg.uid == "anymal" { 6 } else { 0 };
    let (sim, _) = simulation(cfg);
    let dir = dump(&sim);
    let text = std::fs::read_to_string(dir.path().join("diagnostics.txt")).unwrap();
    let of_export = sim.dump(dir.path()).unwrap();
    // The only difference of an export: drives are heavier on joints with mimic followers.
    assert!(of_export.iter().all(|d| d.kind == DiagnosticKind::ExportHeavier), "{of_export:?}");
    let expected: String = sim.diagnostics().iter().chain(&of_export).map(|d| format!("{d}\n")).collect();
    assert_eq!(text, expected);
    assert!(sim.diagnostics().len() >= least);
}

/// The dumped URDF describes the same robot.
fn urdf(cfg: RobotCfg) {
    let (sim, id) = simulation(cfg);
    let dir = dump(&sim);
    let again = assemble(&UrdfCfg::single(dir.path().join("robot.urdf"))).unwrap().description;
    assert_same(sim.robot(id).description(), &again);
}

/// Textures, mass, and the source lines of repaired inertias.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn anymal_c() {
    let (sim, id) = simulation(anymal());
    let (robot, dir) = (sim.robot(id), dump(&sim));
    let export = exported(dir.path()).unwrap();
    let images = files(dir.path()).keys().filter(|name| name.ends_with(".png")).count();
    assert_eq!((images, export.ntex()), (17, 17), "17 JPEG files");
    assert!(export.nmesh() > 17, "{}", export.nmesh());
    assert!((robot.total_mass() - 52.135).abs() < 5e-4, "{}", robot.total_mass());
    let repaired: Vec<_> = sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::InertiaRepaired).collect();
    assert_eq!(repaired.len(), 5, "{repaired:#?}");
    let urdf = std::fs::read_to_string(robot.description().links[0].source.file.as_path()).unwrap();
    for diagnostic in repaired {
        let source = diagnostic.source.as_ref().unwrap();
        assert!(source.file.ends_with("anymal.urdf"), "{diagnostic}");
        let link = diagnostic.message.split('"').nth(1).unwrap();
        // The line is that of the inertial element inside the link of that name.
        let before: Vec<&str> = urdf.lines().take(source.line as usize).collect();
        assert!(before.last().unwrap().contains("<inertial"), "{diagnostic}");
        let opened = before.iter().rev().find(|line| line.contains("<link")).unwrap();
        assert!(opened.contains(&format!("\"{link}\"")), "{diagnostic}: {opened}");
    }
}

/// Meshes with equal file names do not overwrite each other.
#[test]
fn equal_mesh_names() {
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
        let mesh = format!("<geometry><mesh filename=\"{file}\"/></geometry>");
        urdf += &format!("<visual>{mesh}</visual><collision>{mesh}</collision>");
    }
    let (sim, _) = simulation(super::super::support::robot(dir.path(), "robot", &(urdf + "</link></robot>")));
    assert!(sim.diagnostics().is_empty(), "{:?}", sim.diagnostics());
    let out = dump(&sim);
    let objs = files(out.path()).keys().filter(|name| name.ends_with(".obj")).count();
    assert_eq!(objs, 2 + 7, "{:?}", files(out.path()).keys());
    assert_eq!(exported(out.path()).unwrap().nmesh(), 2 + 7 + 8, "two parts, seven files, eight hulls");
}

#[test]
fn unwritable_folder() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let message = simulation(bundled()).0.dump(file.path()).unwrap_err().to_string();
    assert!(message.contains(&*file.path().file_name().unwrap().to_string_lossy()), "{message}");
}
