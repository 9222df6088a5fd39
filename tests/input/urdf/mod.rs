//! Reading URDF, alone and with the files it refers to.

use kinetoscope::prelude::*;
use kinetoscope::robot::description::{Geometry, Joint, RobotDescription};

mod assembly;
mod bad_input;
mod masses;
mod robots;
mod robustness;

/// Asserts that two descriptions are of the same robot, up to rounding in poses and axes, with meshes in the same
/// files.
pub(crate) fn assert_same(a: &RobotDescription, b: &RobotDescription) {
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
            assert!(near(&x.link_from_com, &y.link_from_com) && (x.mass, x.inertia) == (y.mass, y.inertia));
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
    let limit = |j: &Joint| j.limit.as_ref().map(|l| (l.lower, l.upper, l.effort, l.velocity));
    let mimic = |j: &Joint| j.mimic.as_ref().map(|m| (m.joint, m.multiplier, m.offset));
    for (x, y) in a.joints.iter().zip(&b.joints) {
        assert_eq!((&x.name, x.kind, x.parent, x.child), (&y.name, y.kind, y.parent, y.child));
        let numbers = |j: &Joint| (j.damping, j.friction, limit(j), mimic(j));
        assert_eq!(numbers(x), numbers(y), "{}", x.name);
        assert!(near(&x.parent_from_joint, &y.parent_from_joint), "{}", x.name);
        assert!((x.axis.into_inner() - y.axis.into_inner()).norm() < 1e-15, "{}", x.name);
    }
}
