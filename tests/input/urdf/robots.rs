//! Real robots: what their vendors describe is what we read, and writing it back loses nothing.

use kinetoscope::sim::description::{Geometry, JointKind};
use kinetoscope::sim::diagnostic::count_by_name;
use kinetoscope::sim::urdf::{Assembly, ComponentCfg, UrdfCfg, assemble, parse_file, write_urdf};
use kinetoscope::sim::{DiagnosticKind, RobotDescription};
use testkit::needs::robot;

const SR5: &str = "rokae_description/urdf/SR5.urdf";
const HAND: &str = "inspire_hand/DFQ_left_hand.urdf";
const ANYMAL: &str = "anymal_c_simple_description/urdf/anymal.urdf";

fn load(name: &str) -> Assembly {
    assemble(&UrdfCfg::single(robot(name))).unwrap_or_else(|e| panic!("{e}"))
}

fn count(robot: &RobotDescription, kind: JointKind) -> usize {
    robot.joints.iter().filter(|j| j.kind == kind).count()
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn the_sr5_arm() {
    let Assembly { description: robot, diagnostics } = load(SR5);
    assert_eq!((robot.name.as_str(), count(&robot, JointKind::Revolute)), ("xMateSR5", 6));
    assert!((robot.total_mass() - 13.622).abs() < 1e-12, "{}", robot.total_mass());
    assert_eq!(robot.link(robot.root).name, "world");
    let efforts: Vec<_> = robot.drivable_joints().map(|(_, j)| j.limit.as_ref().unwrap().effort.unwrap()).collect();
    assert_eq!(efforts, [113.0, 113.0, 70.0, 25.0, 25.0, 19.0]);
    for link in &robot.links {
        for collision in &link.collisions {
            let Geometry::Mesh { path, scale, .. } = &collision.geometry else { panic!("{}", link.name) };
            assert!(path.is_file() && scale.x == 0.001, "{path:?}");
        }
    }
    let rgba = robot.links[1].visuals[0].material.as_ref().unwrap().rgba;
    assert_eq!(rgba, Some([1.0; 4]), "the material \"white\" is defined at the top of the file");
    let unknown = diagnostics.iter().filter(|d| d.kind == DiagnosticKind::ReferenceUnknown).collect::<Vec<_>>();
    assert_eq!(unknown.len(), 1);
    assert!(unknown[0].to_string().contains("SR5.urdf:64: ") && unknown[0].message.contains("xMateSR5_joint_7"));
    assert_eq!(diagnostics.len(), 1, "{diagnostics:#?}");
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn the_inspire_hand() {
    let Assembly { description: robot, diagnostics } = load(HAND);
    assert_eq!(count(&robot, JointKind::Revolute), 12);
    let mimics: Vec<_> = robot.joints.iter().filter(|j| j.mimic.is_some()).collect();
    assert_eq!(mimics.len(), 6);
    let (driver, multiplier, _) = robot.mimic_driver(robot.joint_id("L_thumb_distal_joint").unwrap());
    assert_eq!((robot.joint(driver).name.as_str(), multiplier), ("L_thumb_proximal_pitch_joint", 2.4));
    assert!(robot.link(robot.root).inertial.is_none(), "the mount is empty");
    assert!(robot.links.iter().flat_map(|l| &l.collisions).all(|c| match &c.geometry {
        Geometry::Mesh { path, .. } => path.is_file(),
        _ => false,
    }));
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
fn an_arm_with_a_hand() {
    let (arm, hand) = (robot(SR5), robot(HAND));
    let components = vec![ComponentCfg::new("arm", arm), ComponentCfg::new("hand", hand)];
    let robot = assemble(&UrdfCfg { components, ..Default::default() }).unwrap().description;
    let connector = robot.joint(robot.joint_id("arm_TO_hand_CONNECTOR").unwrap());
    assert_eq!(robot.link(connector.parent).name, "xMateSR5_link6");
    assert_eq!(robot.link(connector.child).name, "left_wrist_yaw_link");
    assert_eq!(robot.drivable_joints().count(), 18);
    assert_eq!(robot.name, "xMateSR5_Lhand");
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn what_is_written_reads_back_the_same() {
    for name in [SR5, HAND, ANYMAL] {
        let Assembly { description: robot, diagnostics } = load(name);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("written.urdf");
        let text = write_urdf(&robot);
        assert_eq!(text, write_urdf(&robot));
        std::fs::write(&path, text).unwrap();
        let again = assemble(&UrdfCfg::single(&path)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_same(&robot, &again.description);
        let unknown = diagnostics.iter().filter(|d| d.kind == DiagnosticKind::ReferenceUnknown).count();
        assert_eq!(again.diagnostics.len(), diagnostics.len() - unknown, "{name}: transmissions are not written");
    }
}

fn assert_same(a: &RobotDescription, b: &RobotDescription) {
    let close = |a: &kinetoscope::scene::Pose, b: &kinetoscope::scene::Pose| {
        (a.translation.vector - b.translation.vector).norm() <= 1e-12
            && (a.rotation.inverse() * b.rotation).vector().norm() <= 1e-12
    };
    assert_eq!((&a.name, a.links.len(), a.joints.len(), a.root), (&b.name, b.links.len(), b.joints.len(), b.root));
    let shape = |g: &Geometry| match g.clone() {
        Geometry::Mesh { path, scale, .. } => Geometry::Mesh { uri: String::new(), path, scale },
        other => other,
    };
    for (a, b) in a.links.iter().zip(&b.links) {
        assert_eq!((&a.name, a.parent_joint, &a.child_joints), (&b.name, b.parent_joint, &b.child_joints));
        assert_eq!((a.visuals.len(), a.collisions.len()), (b.visuals.len(), b.collisions.len()), "{}", a.name);
        assert_eq!(a.inertial.is_some(), b.inertial.is_some(), "{}", a.name);
        if let (Some(a), Some(b)) = (&a.inertial, &b.inertial) {
            assert!(close(&a.link_from_com, &b.link_from_com) && a.mass == b.mass && a.inertia == b.inertia);
        }
        for (a, b) in a.visuals.iter().zip(&b.visuals) {
            assert!(close(&a.link_from_shape, &b.link_from_shape) && a.material == b.material);
            assert_eq!(shape(&a.geometry), shape(&b.geometry));
        }
        for (a, b) in a.collisions.iter().zip(&b.collisions) {
            assert!(close(&a.link_from_shape, &b.link_from_shape));
            assert_eq!(shape(&a.geometry), shape(&b.geometry));
        }
    }
    for (a, b) in a.joints.iter().zip(&b.joints) {
        assert_eq!((&a.name, a.kind, a.parent, a.child), (&b.name, b.kind, b.parent, b.child));
        assert!(close(&a.parent_from_joint, &b.parent_from_joint), "{}", a.name);
        assert!((a.axis.into_inner() - b.axis.into_inner()).norm() <= 1e-12);
        let limit = |j: &kinetoscope::sim::description::Joint| {
            j.limit.as_ref().map(|l| (l.lower, l.upper, l.effort, l.velocity))
        };
        let mimic =
            |j: &kinetoscope::sim::description::Joint| j.mimic.as_ref().map(|m| (m.joint, m.multiplier, m.offset));
        assert_eq!((limit(a), mimic(a), a.damping, a.friction), (limit(b), mimic(b), b.damping, b.friction));
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn our_numbers_are_those_of_urdf_rs_alone() {
    for name in [SR5, HAND, ANYMAL] {
        let path = robot(name);
        let ours = parse_file(&path).unwrap().robot;
        let theirs = urdf_rs::read_file(&path).unwrap();
        assert_eq!((ours.links.len(), ours.joints.len()), (theirs.links.len(), theirs.joints.len()));
        for (a, b) in ours.links.iter().zip(&theirs.links) {
            assert_eq!((&a.name, a.visual.len(), a.collision.len()), (&b.name, b.visual.len(), b.collision.len()));
            assert_eq!(
                (a.inertial.mass.value, a.inertial.inertia.iyz),
                (b.inertial.mass.value, b.inertial.inertia.iyz)
            );
            assert_eq!(a.inertial.origin.xyz, b.inertial.origin.xyz);
        }
        for (a, b) in ours.joints.iter().zip(&theirs.joints) {
            assert_eq!((&a.name, &a.joint_type, a.origin.rpy), (&b.name, &b.joint_type, b.origin.rpy));
            assert_eq!((a.limit.lower, a.limit.effort), (b.limit.lower, b.limit.effort));
        }
    }
}
