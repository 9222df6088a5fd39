//! Real robots: reading agrees with their vendors' files and with urdf_rs, and writing loses nothing.

use super::assert_same;
use kinetoscope::prelude::*;
use kinetoscope::sim::description::{Geometry, JointKind, Material};
use kinetoscope::sim::diagnostic::count_by_name;
use kinetoscope::sim::urdf::{Assembly, assemble, parse_file, write_urdf};
use kinetoscope::sim::{DiagnosticKind, RobotDescription};
use testkit::needs::{files_below, robot, robots_dir};
use testkit::worlds::{cfg, sim, urdf_robot};

const SR5: &str = "rokae_description/urdf/SR5.urdf";
const HAND: &str = "inspire_hand/DFQ_left_hand.urdf";
const ANYMAL: &str = "anymal_c_simple_description/urdf/anymal.urdf";

fn load(name: &str) -> Assembly {
    assemble(&UrdfCfg::single(robot(name))).unwrap_or_else(|e| panic!("{e}"))
}

fn count(robot: &RobotDescription, kind: JointKind) -> usize {
    robot.joints.iter().filter(|j| j.kind == kind).count()
}

/// The scales of the collision meshes, whose files exist.
fn mesh_scales(robot: &RobotDescription) -> Vec<f64> {
    let scale = |geometry: &Geometry| match geometry {
        Geometry::Mesh { path, scale, .. } if path.is_file() => scale.x,
        other => panic!("{other:?}"),
    };
    robot.links.iter().flat_map(|link| &link.collisions).map(|c| scale(&c.geometry)).collect()
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_sr5() {
    let Assembly { description: robot, diagnostics } = load(SR5);
    assert_eq!((robot.name.as_str(), count(&robot, JointKind::Revolute)), ("xMateSR5", 6));
    assert!((robot.total_mass() - 13.622).abs() < 1e-12, "{}", robot.total_mass());
    assert_eq!(robot.link(robot.root).name, "world");
    let efforts: Vec<_> = robot.drivable_joints().map(|(_, j)| j.limit.as_ref().unwrap().effort.unwrap()).collect();
    assert_eq!(efforts, [113.0, 113.0, 70.0, 25.0, 25.0, 19.0]);
    assert!(mesh_scales(&robot).iter().all(|&scale| scale == 0.001));
    let rgba = robot.links[1].visuals[0].material.as_ref().unwrap().rgba;
    assert_eq!(rgba, Some([1.0; 4]), "the material \"white\" is defined at the top of the file");
    assert_eq!(diagnostics.len(), 1, "{diagnostics:#?}");
    assert_eq!(diagnostics[0].kind, DiagnosticKind::ReferenceUnknown);
    let text = diagnostics[0].to_string();
    assert!(text.contains("SR5.urdf:64: ") && diagnostics[0].message.contains("xMateSR5_joint_7"), "{text}");
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_inspire_hand() {
    let Assembly { description: robot, diagnostics } = load(HAND);
    assert_eq!(count(&robot, JointKind::Revolute), 12);
    assert_eq!(robot.joints.iter().filter(|j| j.mimic.is_some()).count(), 6);
    let (driver, multiplier, _) = robot.mimic_driver(robot.joint_id("L_thumb_distal_joint").unwrap());
    assert_eq!((robot.joint(driver).name.as_str(), multiplier), ("L_thumb_proximal_pitch_joint", 2.4));
    assert!(robot.link(robot.root).inertial.is_none(), "the mount is empty");
    mesh_scales(&robot);
    assert_eq!(count_by_name(&diagnostics), Default::default());
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn anymal() {
    let Assembly { description: robot, diagnostics } = load(ANYMAL);
    assert!((robot.total_mass() - 52.135).abs() < 5e-4, "{}", robot.total_mass());
    assert_eq!((count(&robot, JointKind::Revolute), count(&robot, JointKind::Fixed)), (12, 65));
    assert_eq!(robot.link(robot.root).name, "base");
    assert_eq!(diagnostics.len(), 1, "{diagnostics:#?}");
    assert_eq!(diagnostics[0].kind, DiagnosticKind::MaterialUndefined);
    assert!(diagnostics[0].to_string().contains("anymal.urdf:430: material \"orange\""));
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_arm_with_hand() {
    let components = vec![ComponentCfg::new("arm", robot(SR5)), ComponentCfg::new("hand", robot(HAND))];
    let robot = assemble(&UrdfCfg { components, ..Default::default() }).unwrap().description;
    let connector = robot.joint(robot.joint_id("arm_TO_hand_CONNECTOR").unwrap());
    assert_eq!(robot.link(connector.parent).name, "xMateSR5_link6");
    assert_eq!(robot.link(connector.child).name, "left_wrist_yaw_link");
    assert_eq!((robot.drivable_joints().count(), robot.name.as_str()), (18, "xMateSR5_Lhand"));
}

/// Materials and meshes, exactly, without the URIs of the meshes.
fn looks(robot: &RobotDescription) -> Vec<(Option<Material>, Geometry)> {
    let shape = |geometry: &Geometry| match geometry.clone() {
        Geometry::Mesh { path, scale, .. } => Geometry::Mesh { uri: String::new(), path, scale },
        other => other,
    };
    let of = robot.links.iter().map(|link| {
        let visuals = link.visuals.iter().map(|v| (v.material.clone(), shape(&v.geometry)));
        visuals.chain(link.collisions.iter().map(|c| (None, shape(&c.geometry)))).collect::<Vec<_>>()
    });
    of.flatten().collect()
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_written_and_read() {
    for name in [SR5, HAND, ANYMAL] {
        let Assembly { description: robot, diagnostics } = load(name);
        let files = testkit::urdf::Files::default();
        let text = write_urdf(&robot);
        assert_eq!(text, write_urdf(&robot));
        let again = assemble(&UrdfCfg::single(files.write("written.urdf", text)));
        let again = again.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_same(&robot, &again.description);
        assert_eq!(looks(&robot), looks(&again.description));
        let unknown = diagnostics.iter().filter(|d| d.kind == DiagnosticKind::ReferenceUnknown).count();
        assert_eq!(again.diagnostics.len(), diagnostics.len() - unknown, "{name}: transmissions are not written");
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_numbers_of_urdf_rs() {
    for name in [SR5, HAND, ANYMAL] {
        let path = robot(name);
        let ours = parse_file(&path).unwrap().robot;
        let theirs = urdf_rs::read_file(&path).unwrap();
        let link = |l: &urdf_rs::Link| {
            let of = &l.inertial;
            (l.name.clone(), l.visual.len(), l.collision.len(), of.mass.value, of.inertia.iyz, of.origin.xyz)
        };
        let joint =
            |j: &urdf_rs::Joint| (j.name.clone(), j.joint_type.clone(), j.origin.rpy, j.limit.lower, j.limit.effort);
        assert!(ours.links.iter().map(link).eq(theirs.links.iter().map(link)), "{name}");
        assert!(ours.joints.iter().map(joint).eq(theirs.joints.iter().map(joint)), "{name}");
    }
}

/// Every URDF of every vendor: a robot that steps with finite numbers, or a typed error that names the file.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn every_real_robot() {
    let (files, mut worked) = (files_below(&robots_dir(), "urdf"), 0);
    for file in &files {
        let name = file.file_name().unwrap().to_string_lossy();
        if let Err(error) = assemble(&UrdfCfg::single(file)) {
            assert!(error.to_string().contains(&*name), "{}: {error}", file.display());
            continue;
        }
        let mut sim = sim(cfg(1, 1));
        let Ok(id) = sim.add_robot(urdf_robot("robot", file)) else { continue };
        sim.update(10);
        let robot = sim.robot(id);
        for numbers in [robot.get_qpos(), robot.get_qvel(), robot.get_qf()] {
            assert!(numbers.iter().all(|x| x.is_finite()), "{}: {numbers}", file.display());
        }
        assert!(sim.diverged().is_empty(), "{}: {:?}", file.display(), sim.diverged());
        worked += 1;
    }
    assert!(worked > 0, "none of {} files", files.len());
}
