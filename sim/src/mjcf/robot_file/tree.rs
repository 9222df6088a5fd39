//! Converter of bodies, joints and sites of a compiled file to links and joints of a description.
//!
//! In MuJoCo, the pose of a body in its parent is `T J1 J2 ...`. T is the pose in the file. Each joint rotates about
//! its axis through its anchor p by q - ref, or translates along it by that amount (`mj_kinematics`). A link of a
//! description rotates about its own origin. So the k-th joint of a body has its frame in p, rotated or translated back
//! by ref. Two joints of one body have an auxiliary frame without a body between them. Another auxiliary frame follows
//! the last joint if its anchor is not the origin of the body.

use super::couplings::{Coupling, PolynomialRelation};
use super::drives::{JointActuation, is_single_dof};
use super::error::RobotFileError;
use super::locations::SourceLocations;
use crate::mjcf::part::PartNames;
use kinetoscope_mujoco::{Model, mjcf_keywords};
use kinetoscope_robot::description::{
    CouplingPolynomial, FileActuation, Inertial, Joint, JointDefaults, JointId, JointKind, JointLimit, Link, LinkId,
    Mimic, RobotDescription,
};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::{Matrix3, Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::BTreeSet;

/// Root of the tree of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Root {
    /// Only child body of the file's world.
    pub(super) body: usize,
    /// Free joint of that body, if any.
    pub(super) free_joint: Option<usize>,
    /// True if the root link is the file's world, because hinges or slides attach the body to it.
    pub(super) is_world: bool,
}

/// Finds the only root body, and rejects features that robots do not support. If hinges or slides attach the root to
/// the world, `fix_base` must be set.
pub(super) fn root(
    model: &Model,
    names: &PartNames,
    places: &SourceLocations,
    fix_base: bool,
) -> Result<Root, RobotFileError> {
    let roots: Vec<usize> = (1..model.nbody()).filter(|&body| model.body_parentid()[body] == 0).collect();
    let body = match roots[..] {
        [] => return Err(RobotFileError::NoBody),
        [root] => root,
        _ => {
            let roots = roots.iter().map(|&body| format!("{:?}", names.bodies[body])).collect();
            return Err(RobotFileError::MultipleRoots { roots });
        }
    };
    let kind = |joint: usize| mjcf_keywords::joint(model.jnt_type()[joint]);
    if let Some(joint) = (0..model.njnt()).find(|&joint| kind(joint) == Some("ball")) {
        let name = &names.joints[joint];
        return Err(RobotFileError::BallJoint { at: places.get("joint", name), joint: name.clone() });
    }
    if let Some(body) = (1..model.nbody()).find(|&body| model.body_mocapid()[body] >= 0) {
        let name = &names.bodies[body];
        return Err(RobotFileError::MocapBody { at: places.get("body", name), body: name.clone() });
    }
    if !(0..model.njnt()).any(|joint| is_single_dof(model, joint)) {
        return Err(RobotFileError::NoJoint);
    }
    // MuJoCo allows a free joint only to a body in the world, as its only joint.
    let of_root = joints_of(model, body);
    let free_joint = of_root.iter().copied().find(|&joint| kind(joint) == Some("free"));
    let is_world = free_joint.is_none() && !of_root.is_empty();
    if is_world && !fix_base {
        let joint = &names.joints[of_root[0]];
        let (at, body) = (places.get("joint", joint), names.bodies[body].clone());
        return Err(RobotFileError::BaseNotFree { at, joint: joint.clone(), body });
    }
    Ok(Root { body, free_joint, is_world })
}

/// Joints of a body, in MuJoCo's order.
fn joints_of(model: &Model, body: usize) -> Vec<usize> {
    (0..model.njnt()).filter(|&joint| model.jnt_bodyid()[joint] as usize == body).collect()
}

/// Pose at `index` in MuJoCo's arrays of positions and quaternions.
fn pose_of(positions: &[f64], rotations: &[f64], index: usize) -> Pose {
    let (p, q) = (&positions[3 * index..3 * index + 3], &rotations[4 * index..4 * index + 4]);
    from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]])
}

pub(super) fn body_pose(model: &Model, body: usize) -> Pose {
    pose_of(model.body_pos(), model.body_quat(), body)
}

fn vector(values: &[f64], index: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&values[3 * index..3 * index + 3])
}

fn translation(by: Vector3<f64>) -> Pose {
    Pose::from_parts(Translation3::from(by), UnitQuaternion::identity())
}

/// Description with its relation to the file.
#[derive(Debug)]
pub(super) struct FileDescription {
    pub(super) description: RobotDescription,
    /// For each named link (body or site): index of its body in the file's model (0 is the world), and pose of the link
    /// in the frame of that body.
    pub(super) links: Vec<(usize, Pose)>,
    /// Joint of the description for each joint of the file; `None` for a free joint.
    pub(super) joints: Vec<Option<JointId>>,
}

/// Converter of a compiled file to a description.
pub(super) struct DescriptionBuilder<'a> {
    pub(super) uid: &'a str,
    /// Label of the robot in diagnostics.
    pub(super) owner: &'a str,
    pub(super) model: &'a Model,
    pub(super) names: &'a PartNames,
    pub(super) places: &'a SourceLocations,
    pub(super) root: Root,
    pub(super) actuation: &'a [JointActuation],
    pub(super) couplings: &'a [Option<Coupling>],
}

/// Set of names in use.
struct NameSet(BTreeSet<String>);

impl NameSet {
    /// Returns `name`, with `suffix` appended until the name is unused.
    fn unused(&mut self, name: &str, suffix: &str) -> String {
        let mut name = name.to_string();
        while !self.0.insert(name.clone()) {
            name.push_str(suffix);
        }
        name
    }
}

impl DescriptionBuilder<'_> {
    pub(super) fn build(&self, diagnostics: &mut Vec<Diagnostic>) -> FileDescription {
        let m = self.model;
        let mut names = NameSet(BTreeSet::new());
        let mut links = Vec::new();
        let mut placed = Vec::new();
        // Body b is link b - 1, or link b if the file's world is the root.
        let first = if self.root.is_world { 0 } else { 1 };
        for body in first..m.nbody() {
            let name = names.unused(&self.names.bodies[body], "'");
            let source = if body == 0 { self.places.file() } else { self.places.get("body", &self.names.bodies[body]) };
            links.push(Link { inertial: self.inertial(body, &source), ..self.link(name, source) });
            placed.push((body, Pose::identity()));
        }
        let sites: Vec<usize> =
            (0..m.nsite()).filter(|&site| self.names.named_sites[site] && m.site_bodyid()[site] > 0).collect();
        for &site in &sites {
            let wanted = &self.names.sites[site];
            let source = self.places.get("site", wanted);
            let name = names.unused(wanted, ".site");
            if name != *wanted {
                let message = format!(
                    "{}: the site {wanted:?} has the same name as a body; its link is named {name:?}",
                    self.owner
                );
                diagnostics.push(Diagnostic::new(DiagnosticKind::NameClash, source.clone(), message));
            }
            links.push(self.link(name, source));
            placed.push((m.site_bodyid()[site] as usize, pose_of(m.site_pos(), m.site_quat(), site)));
        }
        let named = links.len();
        let mut joint_names = NameSet(self.names.joints.iter().cloned().collect());
        let mut joints = Vec::new();
        let mut of_file = vec![None; m.njnt()];
        let link_of = |body: usize| LinkId(body - first);
        let all = (1..m.nbody()).filter(|&body| self.root.is_world || body != self.root.body);
        for body in all {
            let (mut parent, child) = (link_of(m.body_parentid()[body] as usize), link_of(body));
            // Pose of the next frame in the parent: the pose of the body, moved by `driver_start` in its axes.
            let (mut before, mut at) = (body_pose(m, body), Vector3::zeros());
            let of_body = joints_of(m, body);
            for (k, &joint) in of_body.iter().enumerate() {
                let slides = mjcf_keywords::joint(m.jnt_type()[joint]) == Some("slide");
                let (axis, reference) = (Unit::new_normalize(vector(m.jnt_axis(), joint)), self.start(joint));
                let parent_from_joint = if slides {
                    before * translation(axis.into_inner() * -reference)
                } else {
                    let anchor = vector(m.jnt_pos(), joint);
                    let to_anchor = translation(anchor - at);
                    at = anchor;
                    let back = UnitQuaternion::from_axis_angle(&axis, -reference);
                    before * to_anchor * Pose::from_parts(Translation3::identity(), back)
                };
                before = Pose::identity();
                let is_last = k + 1 == of_body.len() && at == Vector3::zeros();
                let end = if is_last {
                    child
                } else {
                    let name = names.unused(&format!("{}.frame", self.names.joints[joint]), "'");
                    let source = self.places.get("joint", &self.names.joints[joint]);
                    links.push(Link { is_auxiliary_frame: true, ..self.link(name, source) });
                    LinkId(links.len() - 1)
                };
                of_file[joint] = Some(JointId(joints.len()));
                joints.push(self.joint(joint, parent, end, parent_from_joint, axis));
                parent = end;
            }
            if of_body.is_empty() || at != Vector3::zeros() {
                let name = joint_names.unused(&format!("{}.fixed", links[child.0].name), "'");
                let source = links[child.0].source.clone();
                joints.push(fixed(name, source, parent, child, before * translation(-at)));
            }
        }
        for (k, &(body, body_from_site)) in placed.iter().enumerate().skip(named - sites.len()) {
            let name = joint_names.unused(&format!("{}.fixed", links[k].name), "'");
            let source = links[k].source.clone();
            joints.push(fixed(name, source, link_of(body), LinkId(k), body_from_site));
        }
        for (joint, coupling) in self.couplings.iter().enumerate() {
            let Some(id) = of_file[joint] else { continue };
            match coupling {
                None => {}
                Some(Coupling::Mimic { source, driver, multiplier, offset }) => {
                    if let Some(driver) = of_file[*driver] {
                        let (source, multiplier, offset) = (source.clone(), *multiplier, *offset);
                        joints[id.0].mimic = Some(Mimic { source, joint: driver, multiplier, offset });
                    }
                }
                Some(Coupling::Nonlinear(follows)) => {
                    let curve = follows.map(|PolynomialRelation { driver, coefficients }| CouplingPolynomial {
                        joint: driver.and_then(|driver| of_file[driver]),
                        driver_start: driver.map_or(0.0, |driver| self.start(driver)),
                        follower_start: self.start(joint),
                        coefficients,
                    });
                    if let Some(defaults) = &mut joints[id.0].defaults {
                        defaults.drive = FileActuation::Coupled(curve);
                    }
                }
            }
        }
        for (index, joint) in joints.iter().enumerate() {
            links[joint.parent.0].child_joints.push(JointId(index));
            links[joint.child.0].parent_joint = Some(JointId(index));
        }
        // The root is the first link: the world, or the first body.
        let description = RobotDescription { name: self.uid.into(), links, joints, root: LinkId(0) };
        FileDescription { description, links: placed, joints: of_file }
    }

    fn link(&self, name: String, source: SourceLocation) -> Link {
        Link::new(name, source, self.uid.into())
    }

    fn inertial(&self, body: usize, source: &SourceLocation) -> Option<Inertial> {
        let m = self.model;
        let (mass, moments) = (m.body_mass()[body], vector(m.body_inertia(), body));
        (body > 0 && (mass > 0.0 || moments.max() > 0.0)).then(|| Inertial {
            source: source.clone(),
            link_from_com: pose_of(m.body_ipos(), m.body_iquat(), body),
            mass,
            inertia: Matrix3::from_diagonal(&moments),
        })
    }

    /// Initial position of a joint in the file \[rad or m\].
    fn start(&self, joint: usize) -> f64 {
        self.model.qpos0()[self.model.jnt_qposadr()[joint] as usize]
    }

    fn joint(
        &self,
        joint: usize,
        parent: LinkId,
        child: LinkId,
        parent_from_joint: Pose,
        axis: Unit<Vector3<f64>>,
    ) -> Joint {
        let m = self.model;
        let (name, dof) = (self.names.joints[joint].clone(), m.jnt_dofadr()[joint] as usize);
        let source = self.places.get("joint", &name);
        let JointActuation { drive, effort } = self.actuation[joint];
        let range = m.jnt_limited(joint).then(|| [m.jnt_range()[2 * joint], m.jnt_range()[2 * joint + 1]]);
        let limit = (range.is_some() || effort.is_some()).then(|| JointLimit {
            source: source.clone(),
            lower: range.map(|[low, _]| low),
            upper: range.map(|[_, high]| high),
            effort,
            velocity: None,
        });
        let kind = match mjcf_keywords::joint(m.jnt_type()[joint]) {
            Some("slide") => JointKind::Prismatic,
            _ if range.is_some() => JointKind::Revolute,
            _ => JointKind::Continuous,
        };
        Joint {
            name,
            source,
            kind,
            parent,
            child,
            parent_from_joint,
            axis,
            limit,
            damping: Some(m.dof_damping()[dof]),
            friction: Some(m.dof_frictionloss()[dof]),
            mimic: None,
            defaults: Some(JointDefaults { armature: m.dof_armature()[dof], position: self.start(joint), drive }),
        }
    }
}

fn fixed(name: String, source: SourceLocation, parent: LinkId, child: LinkId, parent_from_joint: Pose) -> Joint {
    Joint {
        name,
        source,
        kind: JointKind::Fixed,
        parent,
        child,
        parent_from_joint,
        axis: Vector3::x_axis(),
        limit: None,
        damping: None,
        friction: None,
        mimic: None,
        defaults: None,
    }
}
