//! Self-collision: links that overlap at the start never collide with each other, and are listed.

use super::support::{INERTIAL, cfg, robot};
use kinetoscope::prelude::*;
use kinetoscope::sim::DiagnosticKind;

/// A star of arms around a root; two that are neighbours overlap, `apart` ones do not.
fn star(arms: usize, spheres: usize) -> String {
    let shapes: String = (0..spheres)
        .map(|i| {
            let x = 0.1 + 0.001 * i as f64;
            format!("<collision><origin xyz=\"{x} 0 0\"/><geometry><sphere radius=\"0.05\"/></geometry></collision>")
        })
        .collect();
    let mut urdf = String::from("<robot name=\"star\"><link name=\"hub\"/>");
    for i in 0..arms {
        let yaw = 0.3 * i as f64;
        urdf += &format!(
            "<link name=\"a{i}\">{INERTIAL}{shapes}</link><joint name=\"j{i}\" type=\"continuous\"><parent link=\"hub\"/>\
             <child link=\"a{i}\"/><origin xyz=\"0 0 1\" rpy=\"0 0 {yaw}\"/><axis xyz=\"0 0 1\"/></joint>"
        );
    }
    urdf + "</robot>"
}

fn overlaps(sim: &SimulationManager) -> Vec<String> {
    sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::InitialOverlap).map(|d| d.message.clone()).collect()
}

#[test]
fn overlapping_links_are_excluded_and_listed() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let id = sim.add_robot(RobotCfg { self_collision: true, ..robot(dir.path(), "star", &star(5, 1)) }).unwrap();
    let listed = overlaps(&sim);
    // Neighbours are 2 * 0.1 * sin(0.15) = 0.03 apart, the next ones 0.059, the next 0.087, and the next 0.113.
    assert_eq!(listed.len(), 4 + 3 + 2, "{listed:#?}");
    assert!(listed[0].contains("\"star/a0\"") && listed[0].contains("\"star/a1\""), "{listed:#?}");
    assert!(sim.mjcf().contains("<exclude body1=\"star/a0\" body2=\"star/a1\"/>"));
    sim.update(50);
    let drift = sim.robot(id).get_qpos().iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    assert!(drift < 1e-9, "they push each other away: {drift}");
    // The two that are apart still collide.
    sim.robot_mut(id).set_qpos(&kinetoscope::ndarray::array![[1.2, 0.0, 0.0, 0.0, 0.0]], None, None).unwrap();
    sim.update(200);
    let q = sim.robot(id).get_qpos();
    assert!(q[(0, 4)] > 0.01, "arm 4 is pushed: {q}");
}

#[test]
fn without_self_collision_nothing_is_excluded() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    sim.add_robot(robot(dir.path(), "star", &star(5, 1))).unwrap();
    assert!(overlaps(&sim).is_empty());
    assert!(!sim.mjcf().contains("<exclude"));
    sim.update(1);
    assert!(sim.batch().read(0, |env| env.data().contact().is_empty()));
}

/// More overlaps than the contact buffer of an export file has room for.
#[test]
fn a_thousand_overlapping_shapes_are_all_found() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let id = sim.add_robot(RobotCfg { self_collision: true, ..robot(dir.path(), "star", &star(6, 12)) }).unwrap();
    // 6 arms of 12 spheres: up to 144 contacts for each pair of neighbours.
    let listed = overlaps(&sim);
    assert_eq!(listed.len(), 5 + 4 + 3, "{listed:#?}");
    sim.update(50);
    assert!(sim.robot(id).get_qpos().iter().all(|q| q.abs() < 1e-9), "{}", sim.robot(id).get_qpos());
}

/// What was found in one robot is said once, however many robots follow.
#[test]
fn diagnostics_are_not_repeated() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let massless = star(3, 1).replace(INERTIAL, "");
    for (i, (n, overlap)) in [(3, 3), (6, 6), (9, 9)].into_iter().enumerate() {
        let cfg = RobotCfg { self_collision: true, ..robot(dir.path(), &format!("s{i}"), &massless) };
        sim.add_robot(cfg).unwrap();
        let of = |kind| sim.diagnostics().iter().filter(|d| d.kind == kind).count();
        assert_eq!(of(DiagnosticKind::MasslessLink), n, "{:#?}", sim.diagnostics());
        assert_eq!(of(DiagnosticKind::InitialOverlap), overlap, "{:#?}", sim.diagnostics());
    }
}
