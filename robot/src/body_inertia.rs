//! Mass properties of a rigid body made of one or several links, with the warnings MuJoCo would otherwise make of them.

use crate::description::{JointKind, LinkId, RobotDescription};
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use crate::inertia::RigidInertia;
use kinetoscope_scene::Pose;
use kinetoscope_scene::source::Source;
use nalgebra::Matrix3;

/// Stand-in mass of a moving body without any \[kg\]: a milligram disturbs no robot, and is far above MuJoCo's minimum.
const MASSLESS_MASS: f64 = 1e-6;
/// Its moment of inertia \[kg m²\]: that mass at 3 cm.
const MASSLESS_MOMENT: f64 = 1e-9;

/// Links that move as one.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidBody {
    /// Its links and their poses in the frame of the first.
    pub links: Vec<(LinkId, Pose)>,
    /// Whether anything above it, or its own base, can move.
    pub moves: bool,
}

/// Links joined by fixed joints, grouped; the root's group comes first.
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

/// What MuJoCo is told about a body.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyInertia {
    /// Mass properties in the body frame, repaired where no rigid body has them.
    pub inertia: RigidInertia,
    /// Where the first of its inertias is given.
    pub source: Option<Source>,
}

/// Fuses the links of a body. A warning for every link whose own inertia no rigid body can have, and for a body that
/// moves without mass; `None` for one that stands still without mass.
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
    if is_nothing(&fused) {
        if !body.moves {
            return None;
        }
        let lightest = description.link(body.links[0].0);
        diagnostics.push(Diagnostic::new(
            DiagnosticKind::MasslessLink,
            lightest.source.clone(),
            format!(
                "link {:?} moves but has no mass; MuJoCo needs some, so it gets {MASSLESS_MASS} kg and \
                 {MASSLESS_MOMENT} kg m² (not counted in total_mass)",
                lightest.name
            ),
        ));
        fused.mass = MASSLESS_MASS;
        fused.inertia = Matrix3::identity() * MASSLESS_MOMENT;
    }
    let (repaired, _) = fused.repaired();
    report_faults(description, body, fused.check().is_err(), diagnostics);
    Some(BodyInertia { inertia: repaired, source })
}

fn report_faults(
    description: &RobotDescription,
    body: &RigidBody,
    body_is_faulty: bool,
    diagnostics: &mut Vec<Diagnostic>,
) {
    for &(link, _) in &body.links {
        let described = description.link(link);
        let Some(inertial) = &described.inertial else { continue };
        let own = RigidInertia::from_inertial(inertial);
        if is_nothing(&own) {
            continue;
        }
        if let Err(fault) = own.check() {
            let outcome = match (body.links.len() > 1, body_is_faulty) {
                (true, false) => "sound after fusing with the links it is fixed to",
                (true, true) => "repaired after fusing with the links it is fixed to",
                (false, _) => "repaired",
            };
            diagnostics.push(Diagnostic::new(
                DiagnosticKind::InertiaRepaired,
                inertial.source.clone(),
                format!("link {:?}: {fault}; {outcome}, in the MJCF only", described.name),
            ));
        }
    }
}

fn is_nothing(inertia: &RigidInertia) -> bool {
    inertia.mass == 0.0 && inertia.inertia.norm() == 0.0
}
