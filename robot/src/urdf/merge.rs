//! Merging of several URDF files into one [`RobotDescription`].
//!
//! Components are merged parents first. A fixed joint, `<parent>_TO_<child>_CONNECTOR`, attaches each component to the
//! tip of its parent: the leaf at the end of the longest chain of joints. The attachment to a chassis is its root
//! instead, since the leaves of a chassis are wheels. If several components have no parent, or the first of them has a
//! transform, they stand on an added massless link (`base_link`), from which the connectors `BASE_TO_<child>_CONNECTOR`
//! start.

use super::components::ComponentTree;
use super::config::{ComponentCfg, UrdfCfg};
use super::error::UrdfError;
use super::file::UrdfFile;
use super::names::NameRegistry;
use super::parse::parse_file_with;
use super::shapes::ShapeConverter;
use super::tree::owned;
use crate::description::{Inertial, Joint, JointId, JointKind, JointLimit, Link, LinkId, Mimic, RobotDescription};
use crate::diagnostic::Diagnostic;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pattern::{MAX_CANDIDATES, closest_names};
use kinetoscope_scene::pose::from_xyz_rpy;
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::{Matrix3, Unit, Vector3};

/// Merged robot with the warnings about its files.
#[derive(Clone, Debug, PartialEq)]
pub struct MergedRobot {
    /// Links and joints of all files. Missing mass properties are not completed.
    pub description: RobotDescription,
    /// Warnings, file by file in the order of merging.
    pub diagnostics: Vec<Diagnostic>,
}

/// Reads and merges the files of a robot.
///
/// Mass properties are those of the files. [`MissingInertia`](super::MissingInertia) is applied when a robot is added
/// to a simulation; the description of that robot is complete.
///
/// Links and joints have the order of the components (parents first, else as given) and, within a component, the order
/// of its file.
///
/// # Errors
/// A file or the configuration is invalid, or a collision mesh does not exist. A missing visual mesh is a warning.
pub fn assemble(cfg: &UrdfCfg) -> Result<MergedRobot, UrdfError> {
    let components = ComponentTree::new(cfg)?;
    let mut files = Vec::with_capacity(cfg.components.len());
    for component in &cfg.components {
        files.push(parse_file_with(&component.urdf, cfg.strictness)?);
    }
    let root = components.order[0];
    let mut merge = Merge {
        cfg,
        components: &components,
        links: Vec::new(),
        joints: Vec::new(),
        link_names: NameRegistry::new("link", cfg.name_case.link),
        joint_names: NameRegistry::new("joint", cfg.name_case.joint),
        first_link: vec![0; files.len()],
        diagnostics: Vec::new(),
    };
    let is_moved = cfg.components[root].transform != Pose::identity();
    let needs_base = components.roots() > 1 || is_moved;
    if needs_base {
        let source = files[root].links[files[root].tree.root].source.clone();
        merge.links.push(Link::new(String::new(), source, String::new()));
    }
    for &id in &components.order {
        merge.add(id, &files)?;
    }
    if needs_base {
        // The base is named last: a `base_link` of a file keeps its name.
        let source = merge.links[0].source.clone();
        merge.links[0].name = merge.link_names.claim(&cfg.base_link_name, "", "", &source, &mut merge.diagnostics);
    }
    let root = if needs_base { 0 } else { files[root].tree.root };
    let name = cfg.name.clone().unwrap_or_else(|| name_of(&components, &files));
    let description = RobotDescription { name, links: merge.links, joints: merge.joints, root: LinkId(root) };
    Ok(MergedRobot { description, diagnostics: merge.diagnostics })
}

/// Joins the names of the files' robots.
fn name_of(components: &ComponentTree, files: &[UrdfFile]) -> String {
    let names = components.order.iter().map(|&c| files[c].robot.name.trim()).filter(|n| !n.is_empty());
    let name = names.collect::<Vec<_>>().join("_");
    if name.is_empty() { "robot".to_owned() } else { name }
}

struct Merge<'c> {
    cfg: &'c UrdfCfg,
    components: &'c ComponentTree,
    links: Vec<Link>,
    joints: Vec<Joint>,
    link_names: NameRegistry,
    joint_names: NameRegistry,
    /// Index, in `links`, of the first link of each component.
    first_link: Vec<usize>,
    diagnostics: Vec<Diagnostic>,
}

impl Merge<'_> {
    fn add(&mut self, id: usize, files: &[UrdfFile]) -> Result<(), UrdfError> {
        let (component, file) = (&self.cfg.components[id], &files[id]);
        self.diagnostics.extend(file.diagnostics.iter().cloned());
        let prefix = match &component.prefix {
            Some(prefix) => prefix.as_str(),
            None if files.len() == 1 => "",
            None if component.name.starts_with("left_") => "left_",
            None if component.name.starts_with("right_") => "right_",
            None => "",
        };
        check_child_link(component, file)?;
        let attach = self.attach_link(id, files)?;
        self.first_link[id] = self.links.len();
        self.add_links(component, file, prefix)?;
        if let Some(attach) = attach {
            self.connect(id, attach, file);
        }
        self.add_joints(id, file, prefix);
        Ok(())
    }

    /// Finds the merged link that the component is attached to; `None` for a root that needs no base.
    fn attach_link(&self, id: usize, files: &[UrdfFile]) -> Result<Option<usize>, UrdfError> {
        let component = &self.cfg.components[id];
        let Some(parent) = self.components.parents[id] else {
            return match &component.parent_link {
                Some(link) => {
                    Err(UrdfError::ParentLinkWithoutParent { component: component.name.clone(), link: link.clone() })
                }
                // The base link, if needed, is added before the first component.
                None => Ok((!self.links.is_empty()).then_some(0)),
            };
        };
        let (parent_cfg, file) = (&self.cfg.components[parent], &files[parent]);
        let first = self.first_link[parent];
        let merged = &self.links[first..first + file.links.len()];
        if let Some(wanted) = &component.parent_link {
            // The name in the file, or the name after merging.
            let in_file = file.robot.links.iter().position(|l| l.name == *wanted);
            return match in_file.or_else(|| merged.iter().position(|l| l.name == *wanted)) {
                Some(link) => Ok(Some(first + link)),
                None => Err(link_unknown(component, "parent_link", wanted, parent_cfg, file)),
            };
        }
        if parent_cfg.name == "chassis" {
            return Ok(Some(first + file.tree.root));
        }
        match file.tree.tips()[..] {
            [tip] => Ok(Some(first + tip)),
            ref tips => Err(UrdfError::TipAmbiguous {
                component: component.name.clone(),
                parent: parent_cfg.name.clone(),
                candidates: tips.iter().take(MAX_CANDIDATES).map(|&t| file.robot.links[t].name.clone()).collect(),
                total: tips.len(),
            }),
        }
    }

    fn add_links(&mut self, component: &ComponentCfg, file: &UrdfFile, prefix: &str) -> Result<(), UrdfError> {
        let mut shapes = ShapeConverter::new(file, self.cfg);
        for (model, notes) in file.robot.links.iter().zip(&file.links) {
            let names = &mut self.link_names;
            let name = names.claim(&model.name, prefix, &component.name, &notes.source, &mut self.diagnostics);
            let mut link = Link::new(name, notes.source.clone(), component.name.clone());
            link.inertial = notes.inertial.as_ref().map(|source| inertial(&model.inertial, source.clone()));
            link.partial_inertial = notes.partial_inertial.clone();
            for (visual, notes) in model.visual.iter().zip(&notes.visuals) {
                link.visuals.push(shapes.visual(visual, notes, &model.name, &mut self.diagnostics)?);
            }
            for (collision, source) in model.collision.iter().zip(&notes.collisions) {
                link.collisions.push(shapes.collision(collision, source, &model.name, &mut self.diagnostics)?);
            }
            self.links.push(link);
        }
        Ok(())
    }

    /// Adds the fixed joint between `attach` and the root of the component.
    fn connect(&mut self, id: usize, attach: usize, file: &UrdfFile) {
        let component = &self.cfg.components[id];
        let parent = self.components.parents[id].map_or("BASE", |p| self.cfg.components[p].name.as_str());
        let source = file.links[file.tree.root].source.clone();
        let name = format!("{parent}_TO_{}_CONNECTOR", component.name);
        let name = self.joint_names.claim(&name, "", &component.name, &source, &mut self.diagnostics);
        let child = self.first_link[id] + file.tree.root;
        self.push(Joint {
            name,
            source,
            kind: JointKind::Fixed,
            parent: LinkId(attach),
            child: LinkId(child),
            parent_from_joint: component.transform,
            axis: Vector3::x_axis(),
            limit: None,
            damping: None,
            friction: None,
            mimic: None,
            defaults: None,
        });
    }

    fn add_joints(&mut self, id: usize, file: &UrdfFile, prefix: &str) {
        let component = &self.cfg.components[id].name;
        let (first_link, first_joint) = (self.first_link[id], self.joints.len());
        for (index, (model, notes)) in file.robot.joints.iter().zip(&file.joints).enumerate() {
            let names = &mut self.joint_names;
            let name = names.claim(&model.name, prefix, component, &notes.source, &mut self.diagnostics);
            let (parent, child) = file.tree.joint_links[index];
            let limit = notes.limit.as_ref().map(|given| JointLimit {
                source: given.source.clone(),
                lower: given.lower.then_some(model.limit.lower),
                upper: given.upper.then_some(model.limit.upper),
                effort: given.effort.then_some(model.limit.effort),
                velocity: given.velocity.then_some(model.limit.velocity),
            });
            let dynamics = model.dynamics.as_ref();
            let mimic = file.tree.mimics[index].zip(notes.mimic.as_ref()).zip(model.mimic.as_ref());
            self.push(Joint {
                name,
                source: notes.source.clone(),
                kind: kind_of(&model.joint_type),
                parent: LinkId(first_link + parent),
                child: LinkId(first_link + child),
                parent_from_joint: pose_of(&model.origin),
                // The parser normalized the axis; a second division would only change the last digit.
                axis: Unit::new_unchecked(Vector3::from(model.axis.xyz.0)),
                limit,
                damping: dynamics.filter(|_| notes.damping).map(|d| d.damping),
                friction: dynamics.filter(|_| notes.friction).map(|d| d.friction),
                mimic: mimic.map(|((followed, source), model)| Mimic {
                    source: source.clone(),
                    joint: JointId(first_joint + followed),
                    multiplier: model.multiplier.unwrap_or(1.0),
                    offset: model.offset.unwrap_or(0.0),
                }),
                defaults: None,
            });
        }
    }

    fn push(&mut self, joint: Joint) {
        let id = JointId(self.joints.len());
        self.links[joint.parent.0].child_joints.push(id);
        self.links[joint.child.0].parent_joint = Some(id);
        self.joints.push(joint);
    }
}

fn check_child_link(component: &ComponentCfg, file: &UrdfFile) -> Result<(), UrdfError> {
    let Some(wanted) = &component.child_link else { return Ok(()) };
    match file.robot.links.iter().position(|l| l.name == *wanted) {
        Some(link) if link == file.tree.root => Ok(()),
        Some(_) => Err(UrdfError::ChildLinkNotRoot {
            component: component.name.clone(),
            link: wanted.clone(),
            root: file.robot.links[file.tree.root].name.clone(),
        }),
        None => Err(link_unknown(component, "child_link", wanted, component, file)),
    }
}

fn link_unknown(
    component: &ComponentCfg,
    field: &'static str,
    wanted: &str,
    of: &ComponentCfg,
    file: &UrdfFile,
) -> UrdfError {
    UrdfError::AttachLinkUnknown {
        component: component.name.clone(),
        field,
        link: wanted.to_owned(),
        of: of.name.clone(),
        candidates: owned(closest_names(wanted, file.robot.links.iter().map(|l| l.name.as_str()))),
        total: file.robot.links.len(),
    }
}

fn inertial(model: &urdf_rs::Inertial, source: SourceLocation) -> Inertial {
    let i = &model.inertia;
    Inertial {
        source,
        link_from_com: pose_of(&model.origin),
        mass: model.mass.value,
        inertia: Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz),
    }
}

/// Converts an origin element to a pose.
pub(super) fn pose_of(origin: &urdf_rs::Pose) -> Pose {
    from_xyz_rpy(origin.xyz.0, origin.rpy.0)
}

fn kind_of(model: &urdf_rs::JointType) -> JointKind {
    match model {
        urdf_rs::JointType::Revolute => JointKind::Revolute,
        urdf_rs::JointType::Continuous => JointKind::Continuous,
        urdf_rs::JointType::Prismatic => JointKind::Prismatic,
        urdf_rs::JointType::Floating => JointKind::Floating,
        urdf_rs::JointType::Planar => JointKind::Planar,
        // The parser rejects spherical joints.
        urdf_rs::JointType::Fixed | urdf_rs::JointType::Spherical => JointKind::Fixed,
    }
}
