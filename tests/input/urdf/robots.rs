//! Real robots: the parsed robots agree with their vendors' files and with urdf_rs, and a written URDF keeps all
//! content.

use super::assert_same;
use kinetoscope::prelude::*;
use kinetoscope::robot::description::RobotDescription;
use kinetoscope::robot::description::{Geometry, JointKind, Material};
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::robot::urdf::{MergedRobot, assemble, parse_file, write_urdf};
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope_testkit::test_resources::{files_below, robot, robots_dir};
use kinetoscope_testkit::worlds::{cfg, sim, urdf_robot};

const SR5: &str = "rokae_description/urdf/SR5.urdf";
const HAND: &str = "inspire_hand/DFQ_left_hand.urdf";
const ANYMAL: &str = "anymal_c_simple_description/urdf/anymal.urdf";

fn load(name: &str) -> MergedRobot {
    assemble(&UrdfCfg::single(robot(name))).unwrap_or_else(|e| panic!("{e}"))
}

fn count(robot: &RobotDescription, kind: JointKind) -> usize {
    robot.joints.iter().filter(|j| j.kind == kind).count()
}

/// The scales of the collision meshes; asserts that their files exist.
fn mesh_scales(robot: &RobotDescription) -> Vec<f64> {
    let scale = |geometry: &Geometry| match geometry {
        Geometry::Mesh { path, scale, .. } if path.is_file() => scale.x,
        other => panic!("{other:?}"),
    };
    robot.links.iter().flat_map(|link| &link.collisions).map(|c| scale(&c.geometry)).collect()
}

/// Joint counts, masses, roots and diagnostics of the vendors' files, and of two of them combined.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendors() {
    let [sr5, hand, anymal] = [SR5, HAND, ANYMAL].map(load);
    let diagnostics_text =
        |of: &MergedRobot| of.diagnostics.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for (of, joints, mass, root, parts) in [
        (&sr5, (6, None), (13.622, 1e-12), "world", ["SR5.urdf:64: ", "xMateSR5_joint_7"]),
        (&anymal, (12, Some(65)), (52.135, 5e-4), "base", ["anymal.urdf:430: ", "material \"orange\""]),
    ] {
        let robot = &of.description;
        assert_eq!(count(robot, JointKind::Revolute), joints.0, "{}", robot.name);
        assert!(joints.1.is_none_or(|fixed| count(robot, JointKind::Fixed) == fixed), "{}", robot.name);
        assert!((robot.total_mass() - mass.0).abs() < mass.1, "{}", robot.total_mass());
        assert_eq!((robot.link(robot.root).name.as_str(), of.diagnostics.len()), (root, 1));
        assert!(parts.iter().all(|part| diagnostics_text(of).contains(part)), "{}", diagnostics_text(of));
    }
    let (robot, fingers) = (&sr5.description, &hand.description);
    let efforts: Vec<_> = robot.drivable_joints().map(|(_, j)| j.limit.as_ref().unwrap().effort.unwrap()).collect();
    assert_eq!(efforts, [113.0, 113.0, 70.0, 25.0, 25.0, 19.0]);
    assert!(mesh_scales(robot).iter().all(|&scale| scale == 0.001));
    let rgba = robot.links[1].visuals[0].material.as_ref().unwrap().rgba;
    assert_eq!(rgba, Some([1.0; 4]), "the material \"white\" is defined at the top of the file");
    let followers = fingers.joints.iter().filter(|j| j.mimic.is_some()).count();
    assert_eq!((count(fingers, JointKind::Revolute), followers, diagnostics_text(&hand).as_str()), (12, 6, ""));
    let (driver, multiplier, _) = fingers.mimic_driver(fingers.joint_id("L_thumb_distal_joint").unwrap());
    assert_eq!((fingers.joint(driver).name.as_str(), multiplier), ("L_thumb_proximal_pitch_joint", 2.4));
    assert!(fingers.link(fingers.root).inertial.is_none(), "the mount is empty");
    mesh_scales(fingers);

    let components = vec![
        ComponentCfg::new("arm", kinetoscope_testkit::test_resources::robot(SR5)),
        ComponentCfg::new("hand", kinetoscope_testkit::test_resources::robot(HAND)),
    ];
    let both = assemble(&UrdfCfg { components, ..Default::default() }).unwrap().description;
    let connector = both.joint(both.joint_id("arm_TO_hand_CONNECTOR").unwrap());
    assert_eq!(both.link(connector.parent).name, "xMateSR5_link6");
    assert_eq!(both.link(connector.child).name, "left_wrist_yaw_link");
    assert_eq!((both.drivable_joints().count(), both.name.as_str()), (18, "xMateSR5_Lhand"));
}

/// Materials and meshes without the URIs of the meshes, for exact comparison.
fn materials_and_meshes(robot: &RobotDescription) -> Vec<(Option<Material>, Geometry)> {
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
        let MergedRobot { description: robot, diagnostics } = load(name);
        let files = kinetoscope_testkit::urdf::TempFiles::default();
        let text = write_urdf(&robot);
        assert_eq!(text, write_urdf(&robot));
        let again = assemble(&UrdfCfg::single(files.write("written.urdf", text)));
        let again = again.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_same(&robot, &again.description);
        assert_eq!(materials_and_meshes(&robot), materials_and_meshes(&again.description));
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

/// Every URDF of every vendor gives a robot that steps with finite numbers, or a typed error that names the file.
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
        // Above the ground: with the root at 0, legs begin far inside it, and such contacts diverge.
        let init_pose = from_xyz_rpy([0.0, 0.0, 5.0], [0.0; 3]);
        let Ok(id) = sim.add_robot(RobotCfg { init_pose, ..urdf_robot("robot", file) }) else { continue };
        sim.update(10);
        let robot = sim.robot(id);
        for numbers in [robot.qpos(), robot.qvel(), robot.qf()] {
            assert!(numbers.iter().all(|x| x.is_finite()), "{}: {numbers}", file.display());
        }
        assert!(sim.diverged().is_empty(), "{}: {:?}", file.display(), sim.diverged());
        worked += 1;
    }
    assert!(worked > 0, "none of {} files", files.len());
}
