//! Mass properties of rigid bodies that consist of one or several links joined by fixed joints.
//!
//! Inertias that MuJoCo would reject or silently change are reported as warnings.

use crate::description::{JointKind, LinkId, RobotDescription};
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use crate::inertia::RigidInertia;
use kinetoscope_scene::Pose;
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::Matrix3;

/// Mass of a moving body without mass \[kg\]. One milligram disturbs no robot and is far above MuJoCo's minimum.
const MASSLESS_MASS: f64 = 1e-6;
/// Moment of inertia of a moving body without mass \[kg m²\]: about that of [`MASSLESS_MASS`] at a distance of 3 cm.
const MASSLESS_MOMENT: f64 = 1e-9;

/// Links joined by fixed joints, which move as one rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidBody {
    /// Links of the body and their poses in the frame of the first link, which is the root link or the child of a
    /// moving joint.
    pub links: Vec<(LinkId, Pose)>,
    /// False only for the body of the root link if the base is fixed.
    pub moves: bool,
}

/// Groups the links of a robot into rigid bodies. `floating_base` is true if the root link moves. The body of the root
/// link comes first.
pub fn rigid_bodies(description: &RobotDescription, floating_base: bool) -> Vec<RigidBody> {
    let mut bodies = vec![RigidBody { links: vec![(description.root, Pose::identity())], moves: floating_base }];
    let mut next = 0;
    while next < bodies.len() {
        let mut at = 0;
        while let Some(&(link, body_from_link)) = bodies[next].links.get(at) {
            at += 1;
            for &id in &description.link(link).child_joints {
                let joint = description.joint(id);
                if joint.kind == JointKind::Fixed {
                    bodies[next].links.push((joint.child, body_from_link * joint.parent_from_joint));
                } else {
                    bodies.push(RigidBody { links: vec![(joint.child, Pose::identity())], moves: true });
                }
            }
        }
        next += 1;
    }
    bodies
}

/// Mass properties of a rigid body as written to the MJCF.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyInertia {
    /// Mass properties in the frame of the first link of the body, repaired where they are physically impossible.
    pub inertia: RigidInertia,
    /// Location of the first `<inertial>` of the body; `None` where no link has one.
    pub source: Option<SourceLocation>,
}

/// Combines the mass properties of the links of a body.
///
/// Adds a warning for each link whose own inertia is physically impossible, and for a moving body without mass, which
/// gets 1e-6 kg and 1e-9 kg m². Returns `None` for a massless body that does not move.
pub fn fuse(
    description: &RobotDescription,
    body: &RigidBody,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<BodyInertia> {
    let mut fused = RigidInertia::ZERO;
    let mut source = None;
    for (link, body_from_link) in &body.links {
        let Some(inertial) = &description.link(*link).inertial else { continue };
        source.get_or_insert_with(|| inertial.source.clone());
        fused = fused.combine(&RigidInertia::from_inertial(inertial).transformed(body_from_link));
    }
    if is_massless(&fused) {
        if !body.moves {
            return None;
        }
        let lightest = description.link(body.links[0].0);
        diagnostics.push(Diagnostic::new(
            DiagnosticKind::MasslessLink,
            lightest.source.clone(),
            format!(
                "link {:?} moves but has no mass; MuJoCo requires a positive mass, so the link gets {MASSLESS_MASS} kg \
                 and {MASSLESS_MOMENT} kg m² (not counted in total_mass)",
                lightest.name
            ),
        ));
        fused.mass = MASSLESS_MASS;
        fused.inertia = Matrix3::identity() * MASSLESS_MOMENT;
    }
    let (repaired, _) = fused.repaired();
    warn_invalid_inertias(description, body, fused.check().is_err(), diagnostics);
    Some(BodyInertia { inertia: repaired, source })
}

fn warn_invalid_inertias(
    description: &RobotDescription,
    body: &RigidBody,
    body_is_faulty: bool,
    diagnostics: &mut Vec<Diagnostic>,
) {
    for &(link, _) in &body.links {
        let described = description.link(link);
        let Some(inertial) = &described.inertial else { continue };
        let own = RigidInertia::from_inertial(inertial);
        if is_massless(&own) {
            continue;
        }
        if let Err(fault) = own.check() {
            let outcome = match (body.links.len() > 1, body_is_faulty) {
                (true, false) => "valid after merging with the links attached by fixed joints",
                (true, true) => "repaired after merging with the links attached by fixed joints",
                (false, _) => "repaired",
            };
            diagnostics.push(Diagnostic::new(
                DiagnosticKind::InertiaRepaired,
                inertial.source.clone(),
                format!("link {:?}: {fault}; {outcome}, in the generated MJCF only", described.name),
            ));
        }
    }
}

fn is_massless(inertia: &RigidInertia) -> bool {
    inertia.mass == 0.0 && inertia.inertia.norm() == 0.0
}
