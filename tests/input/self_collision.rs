//! Self-collision: links that overlap at the start never collide with each other, and are listed.

use super::support::{INERTIAL, robot, sim};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope_testkit::urdf::collision;

/// A star of arms around a hub, with spheres of 0.05 m at 0.1 m from the hub; only near arms overlap.
fn star(arms: usize, spheres: usize) -> String {
    let sphere = |i: usize| collision("<sphere radius=\"0.05\"/>", [0.1 + 0.001 * i as f64, 0.0, 0.0]);
    let shapes: String = (0..spheres).map(sphere).collect();
    let arm = |i: usize| {
        format!(
            "<link name=\"a{i}\">{INERTIAL}{shapes}</link><joint name=\"j{i}\" type=\"continuous\"><parent link=\"hub\"/>\
             <child link=\"a{i}\"/><origin xyz=\"0 0 1\" rpy=\"0 0 {}\"/><axis xyz=\"0 0 1\"/></joint>",
            0.3 * i as f64
        )
    };
    format!("<robot name=\"star\"><link name=\"hub\"/>{}</robot>", (0..arms).map(arm).collect::<String>())
}

fn overlaps(sim: &SimulationManager) -> Vec<String> {
    sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::InitialOverlap).map(|d| d.message.clone()).collect()
}

fn world(self_collision: bool, urdf: &str) -> (SimulationManager, RobotId) {
    let (dir, mut sim) = (tempfile::tempdir().unwrap(), sim(2));
    let id = sim.add_robot(RobotCfg { self_collision, ..robot(dir.path(), "star", urdf) }).unwrap();
    (sim, id)
}

fn drift(sim: &SimulationManager, id: RobotId) -> f64 {
    sim.robot(id).qpos().iter().fold(0.0_f64, |most, q| most.max(q.abs()))
}

#[test]
fn overlapping_links() {
    let (mut sim, id) = world(true, &star(5, 1));
    let listed = overlaps(&sim);
    // Neighbors are 2 * 0.1 * sin(0.15) = 0.03 m apart, the next arms 0.059, 0.087 and 0.113 m.
    assert_eq!(listed.len(), 4 + 3 + 2, "{listed:#?}");
    assert!(listed[0].contains("\"star/a0\"") && listed[0].contains("\"star/a1\""), "{listed:#?}");
    assert!(sim.scene().mjcf().contains("<exclude body1=\"star/a0\" body2=\"star/a1\"/>"));
    sim.update(50);
    assert!(drift(&sim, id) < 1e-9, "they push each other away: {}", drift(&sim, id));
    // Arms that do not overlap still collide.
    sim.robot_mut(id).set_qpos_target(&array![[1.2, 0.0, 0.0, 0.0, 0.0]], None, None).unwrap();
    sim.update(200);
    assert!(sim.robot(id).qpos()[(0, 4)] > 0.01, "arm 4 is pushed: {}", sim.robot(id).qpos());
    // Without self-collision, no pair is excluded.
    let (mut sim, _) = world(false, &star(5, 1));
    assert!(overlaps(&sim).is_empty() && !sim.scene().mjcf().contains("<exclude"));
    sim.update(1);
    assert!(sim.batch().read(0, |env| env.data().contact().is_empty()));
}

/// Up to 144 contacts for each pair of neighbors: more than the contact buffer of an exported file holds.
#[test]
fn overlaps_beyond_the_contact_buffer() {
    let (mut sim, id) = world(true, &star(6, 12));
    let listed = overlaps(&sim);
    assert_eq!(listed.len(), 5 + 4 + 3, "{listed:#?}");
    sim.update(50);
    assert!(drift(&sim, id) < 1e-9, "{}", drift(&sim, id));
}

/// A diagnostic of one robot is listed once, independent of the number of robots added later.
#[test]
fn diagnostics_once() {
    let (dir, mut sim) = (tempfile::tempdir().unwrap(), sim(1));
    let unweighed = star(3, 1).replace(INERTIAL, "");
    for (i, n) in [3, 6, 9].into_iter().enumerate() {
        let cfg = RobotCfg { self_collision: true, ..robot(dir.path(), &format!("s{i}"), &unweighed) };
        sim.add_robot(cfg).unwrap();
        for kind in [DiagnosticKind::InertiaFromShapes, DiagnosticKind::InitialOverlap] {
            let found = sim.diagnostics().iter().filter(|d| d.kind == kind).count();
            assert_eq!(found, n, "{kind:?}: {:#?}", sim.diagnostics());
        }
    }
}
