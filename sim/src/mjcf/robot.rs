//! Converter of a robot to MJCF bodies: fixed joints fused, inertias in principal axes, one actuator per driven joint.

use super::document::{
    Actuator, Body, FrictionTendon, Geom, GeomRole, Inertial, Integrator, Joint, JointEquality, JointType,
    MaterialAsset, MeshAsset, MeshContent, Mjcf, Shape, Site,
};
use super::error::{MAX_BODY_DEPTH, RobotMjcfError};
use crate::drive::plan::JointPlan;
use kinetoscope_robot::body_inertia::{BodyInertia, RigidBody, fuse};
use kinetoscope_robot::description::{Geometry, JointId, JointKind, LinkId, RobotDescription};
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_robot::mesh_key::MeshKey;
use kinetoscope_scene::Pose;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;

/// Use of the document: simulation or export.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum MjcfDialect<'a> {
    /// Simulation by this crate. Each visual mesh becomes a proxy geom that only has a pose. With `friction_tendons`,
    /// dry friction of driven joints is a tendon, since the joint's own friction row carries the drive, and this crate
    /// applies the damping.
    Simulation {
        /// True if drives are friction rows.
        friction_tendons: bool,
    },
    /// Export to other programs: real meshes, and a site for every link.
    Export(&'a VisualAssets),
}

/// Visual meshes written next to an exported document, by file and scale.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct VisualAssets {
    /// Parts of each mesh.
    pub parts: BTreeMap<MeshKey, Vec<VisualSubmesh>>,
}

/// Part of a visual mesh with one material.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VisualSubmesh {
    /// Name of the mesh asset in the document.
    pub mesh: String,
    /// Name of the material asset; `None` if the mesh file gives no material.
    pub material: Option<String>,
}

/// Settings for adding a robot to the document.
#[derive(Clone, Debug)]
pub(crate) struct RobotMjcfCfg<'a> {
    /// Prefix of all names: `uid/link`.
    pub uid: &'a str,
    /// Contact bits of all its colliding geoms.
    pub contact: GeomRole,
    /// True if the root link is fixed in the world.
    pub fix_base: bool,
    /// Pose of the root link in the environment; for an MJCF file, pose of the file's world.
    pub base_pose: Pose,
    /// Plan of each drivable joint, in the order of the description.
    pub plans: &'a [JointPlan],
    /// Convex hulls of collision meshes.
    pub hulls: &'a BTreeMap<MeshKey, TriMesh>,
    /// True if every driven joint gets a tendon for dry friction, even without friction at first.
    pub reserve_friction_tendons: bool,
    /// Use of the document.
    pub dialect: MjcfDialect<'a>,
}

/// Elements of the robot in the document: names, link frames and damped joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct RobotLayout {
    /// Body and frame of every link, fused links included, in the order of the description.
    pub links: Vec<LinkFrame>,
    /// Name of the free joint of the root link; `None` for a fixed base.
    pub free_joint: Option<String>,
    /// Pairs of bodies that touch by construction: a fixed base and its first children.
    pub base_contact_exclusions: Vec<(String, String)>,
    /// Link and visual of every geom of the robot, those of fused links included. Geoms of the world of an MJCF file
    /// are not included.
    pub geoms: Vec<GeomOwner>,
    /// Joints whose damping is integrated with the drives; see [`crate::drive::implicit`].
    pub damped: Vec<DampedJoint>,
}

/// Link and visual that a geom belongs to.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GeomOwner {
    /// Name of the geom in the document.
    pub geom: String,
    /// Link of the geom, fused or not.
    pub link: LinkId,
    /// Index of the visual of the link; `None` for a collision shape, and for every geom of an MJCF robot.
    pub visual: Option<usize>,
}

/// Joint whose viscous damping is left out of the document. Its armature in the document includes the time step times
/// the damping (see `drive::implicit`).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DampedJoint {
    /// Name of the joint in the document.
    pub joint: String,
    /// Number of its degrees of freedom.
    pub dofs: usize,
    /// Damping of each degree of freedom \[N m s/rad or N s/m\].
    pub damping: f64,
    /// Armature of each degree of freedom, without the addition for damping \[kg m² or kg\].
    pub armature: f64,
}

/// Frame of a link in its body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LinkFrame {
    /// Name of the body in the document.
    pub body: String,
    /// Pose of the link in the body.
    pub body_from_link: Pose,
}

/// Adds the bodies, joints and actuators of a robot to `mjcf`, and returns its layout there.
///
/// # Errors
/// A chain of the tree has more than [`MAX_BODY_DEPTH`] bodies, the root included.
pub(crate) fn add(
    description: &RobotDescription,
    cfg: &RobotMjcfCfg<'_>,
    mjcf: &mut Mjcf,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<RobotLayout, RobotMjcfError> {
    let mut emitter = RobotWriter {
        description,
        cfg,
        mjcf,
        diagnostics,
        plan_of: cfg.plans.iter().map(|p| (p.joint, p)).collect(),
        free_joint: None,
        depth: BTreeMap::new(),
        link_frames: vec![None; description.links.len()],
        fused_links: BTreeMap::new(),
        geoms: Vec::new(),
        damped: Vec::new(),
    };
    emitter.bodies()?;
    emitter.inertias();
    emitter.couplings_and_actuators();
    let base_contact_exclusions = emitter.base_pairs();
    let links = emitter
        .link_frames
        .iter()
        .map(|placed| {
            // Every link is reachable from the root: `urdf::merge` rejects any other robot.
            let (body, body_from_link) = placed.unwrap_or((0, Pose::identity()));
            LinkFrame { body: emitter.mjcf.bodies[body].name.clone(), body_from_link }
        })
        .collect();
    let RobotWriter { free_joint, geoms, damped, .. } = emitter;
    Ok(RobotLayout { links, free_joint, base_contact_exclusions, geoms, damped })
}

struct RobotWriter<'a, 'm> {
    description: &'a RobotDescription,
    cfg: &'a RobotMjcfCfg<'a>,
    mjcf: &'m mut Mjcf,
    diagnostics: &'m mut Vec<Diagnostic>,
    plan_of: BTreeMap<JointId, &'a JointPlan>,
    /// Name of the free joint of the root link; `None` for a fixed base.
    free_joint: Option<String>,
    /// Number of bodies from the top of this robot to each of its bodies, both included.
    depth: BTreeMap<usize, usize>,
    /// Body and frame of each link; `None` for a link that is not placed yet.
    link_frames: Vec<Option<(usize, Pose)>>,
    /// Links fused into each body.
    fused_links: BTreeMap<usize, Vec<LinkId>>,
    geoms: Vec<GeomOwner>,
    damped: Vec<DampedJoint>,
}

impl RobotWriter<'_, '_> {
    fn name(&self, name: &str) -> String {
        format!("{}/{name}", self.cfg.uid)
    }

    fn unused_joint_name(&self, own: &str) -> String {
        unused_joint_name(self.description, self.cfg.uid, own)
    }

    /// Adds the links depth first from the root, with a body for each link that moves.
    fn bodies(&mut self) -> Result<(), RobotMjcfError> {
        let root = self.description.root;
        let root_joints =
            if self.cfg.fix_base { Vec::new() } else { vec![Joint::free(self.unused_joint_name("base"), None)] };
        self.free_joint = root_joints.first().map(|joint| joint.name.clone());
        let body = self.push_body(root, 0, self.cfg.base_pose, root_joints)?;
        self.place(root, body, Pose::identity());
        let mut stack: Vec<JointId> = self.description.link(root).child_joints.iter().rev().copied().collect();
        while let Some(id) = stack.pop() {
            let joint = self.description.joint(id);
            // Parents are placed before their children are pushed.
            let (parent_body, body_from_parent) = self.link_frames[joint.parent.0].unwrap_or((0, Pose::identity()));
            let body_from_joint = body_from_parent * joint.parent_from_joint;
            if joint.kind == JointKind::Fixed {
                self.place(joint.child, parent_body, body_from_joint);
            } else {
                let (parent, pose) = self.parent_for(joint.kind, parent_body, body_from_joint);
                let mut joints = self.joints(id, parent);
                self.move_damping_to_armature(&mut joints);
                let body = self.push_body(joint.child, parent, pose, joints)?;
                self.place(joint.child, body, Pose::identity());
            }
            stack.extend(self.description.link(joint.child).child_joints.iter().rev());
        }
        Ok(())
    }

    /// Returns the parent body, and the pose in its frame, of the body that a joint moves. MuJoCo allows free joints
    /// only on children of the world: a floating link below a fixed base becomes a child of the world.
    fn parent_for(&self, kind: JointKind, parent: usize, pose: Pose) -> (usize, Pose) {
        let is_root = self.mjcf.bodies[parent].parent == 0;
        if kind == JointKind::Floating && self.cfg.fix_base && is_root {
            (0, self.mjcf.bodies[parent].pose * pose)
        } else {
            (parent, pose)
        }
    }

    fn push_body(
        &mut self,
        link: LinkId,
        parent: usize,
        pose: Pose,
        joints: Vec<Joint>,
    ) -> Result<usize, RobotMjcfError> {
        let depth = self.depth.get(&parent).map_or(1, |d| d + 1);
        let described = self.description.link(link);
        if depth > MAX_BODY_DEPTH {
            return Err(RobotMjcfError::TooDeep {
                link: described.name.clone(),
                source_line: described.source.clone(),
                depth,
            });
        }
        let index = self.mjcf.bodies.len();
        self.depth.insert(index, depth);
        self.mjcf.bodies.push(Body {
            name: self.name(&described.name),
            parent,
            pose,
            inertial: None,
            joints,
            mocap: false,
            geoms: Vec::new(),
            sites: Vec::new(),
            source: Some(described.source.clone()),
        });
        Ok(index)
    }

    /// Sets the body and the frame of a link, and adds its shapes to the body, in an export also a site.
    fn place(&mut self, link: LinkId, body: usize, body_from_link: Pose) {
        self.link_frames[link.0] = Some((body, body_from_link));
        self.fused_links.entry(body).or_default().push(link);
        let described = self.description.link(link);
        for (i, collision) in described.collisions.iter().enumerate() {
            let name = self.name(&format!("{}/collision{i}", described.name));
            let shape = self.collision_shape(&collision.geometry, &collision.source);
            self.geoms.push(GeomOwner { geom: name.clone(), link, visual: None });
            self.mjcf.bodies[body].geoms.push(Geom {
                name: Some(name),
                shape,
                pose: body_from_link * collision.link_from_shape,
                role: self.cfg.contact,
                friction: None,
                surface: None,
                rgba: None,
                material: None,
                source: Some(collision.source.clone()),
            });
        }
        for (i, visual) in described.visuals.iter().enumerate() {
            let name = self.name(&format!("{}/visual{i}", described.name));
            let geoms = self.visual_geoms(&visual.geometry, visual.material.as_ref().and_then(|m| m.rgba));
            let several = geoms.len() > 1;
            for (part, (shape, rgba, material)) in geoms.into_iter().enumerate() {
                let geom = if several { format!("{name}.{part}") } else { name.clone() };
                self.geoms.push(GeomOwner { geom: geom.clone(), link, visual: Some(i) });
                self.mjcf.bodies[body].geoms.push(Geom {
                    name: Some(geom),
                    shape,
                    pose: body_from_link * visual.link_from_shape,
                    role: GeomRole::Visual,
                    friction: None,
                    surface: None,
                    rgba,
                    material,
                    source: Some(visual.source.clone()),
                });
            }
        }
        if matches!(self.cfg.dialect, MjcfDialect::Export(_)) {
            let site = Site { name: self.name(&described.name), pose: body_from_link };
            self.mjcf.bodies[body].sites.push(site);
        }
    }

    fn collision_shape(&mut self, geometry: &Geometry, source: &SourceLocation) -> Shape {
        match geometry {
            Geometry::Mesh { path, scale, .. } => Shape::Mesh(self.hull_asset(path, scale, source)),
            primitive => primitive_shape(primitive),
        }
    }

    /// Adds the hull of a collision mesh as an inline asset, once per file and scale. Returns the name of the asset.
    fn hull_asset(&mut self, path: &Path, scale: &Vector3<f64>, source: &SourceLocation) -> String {
        let key = MeshKey::new(path, scale);
        let index = self.cfg.hulls.keys().position(|k| *k == key).unwrap_or(usize::MAX);
        // The slash keeps the name distinct from exported meshes, the uid from hulls of other robots.
        let name = format!("{}/hull{index}", self.cfg.uid);
        if !self.mjcf.meshes.iter().any(|m| m.name == name)
            && let Some(hull) = self.cfg.hulls.get(&key)
        {
            self.mjcf.meshes.push(MeshAsset {
                name: name.clone(),
                content: MeshContent::Inline { vertices: hull.positions.clone(), triangles: hull.triangles.clone() },
                visual: false,
                source: Some(source.clone()),
            });
        }
        name
    }

    fn visual_geoms(
        &mut self,
        geometry: &Geometry,
        rgba: Option<[f64; 4]>,
    ) -> Vec<(Shape, Option<[f64; 4]>, Option<String>)> {
        /// Size of a proxy \[m\]: it has a pose, no mass and no contact.
        const PROXY: f64 = 1e-3;
        match (&self.cfg.dialect, geometry) {
            (MjcfDialect::Simulation { .. }, Geometry::Mesh { .. }) => vec![(Shape::Sphere(PROXY), rgba, None)],
            (MjcfDialect::Simulation { .. }, primitive) => vec![(primitive_shape(primitive), rgba, None)],
            (MjcfDialect::Export(assets), Geometry::Mesh { path, scale, .. }) => {
                let parts = assets.parts.get(&MeshKey::new(path, scale));
                // A material of the URDF overrides those of the mesh file (as RViz does).
                parts
                    .into_iter()
                    .flatten()
                    .map(|part| {
                        let material = if rgba.is_some() { None } else { part.material.clone() };
                        (Shape::Mesh(part.mesh.clone()), rgba, material)
                    })
                    .collect()
            }
            (MjcfDialect::Export(_), primitive) => vec![(primitive_shape(primitive), rgba, None)],
        }
    }

    /// MuJoCo joints of one URDF joint: several for a planar joint, and for a floating joint below another body; empty
    /// for a fixed joint.
    fn joints(&self, id: JointId, parent: usize) -> Vec<Joint> {
        let joint = self.description.joint(id);
        let name = self.name(&joint.name);
        let plain = |suffix: &str, kind, axis| Joint {
            name: if suffix.is_empty() {
                name.clone()
            } else {
                self.unused_joint_name(&format!("{}{suffix}", joint.name))
            },
            kind,
            axis,
            range: None,
            damping: joint.damping.unwrap_or(0.0),
            frictionloss: joint.friction.unwrap_or(0.0),
            armature: 0.0,
            source: Some(joint.source.clone()),
        };
        match joint.kind {
            JointKind::Fixed => Vec::new(),
            JointKind::Floating if parent == 0 => vec![Joint::free(name, Some(joint.source.clone()))],
            // Below a moving body, the six degrees of freedom are three slides and a ball.
            JointKind::Floating => vec![
                plain(".x", JointType::Slide, Vector3::x()),
                plain(".y", JointType::Slide, Vector3::y()),
                plain(".z", JointType::Slide, Vector3::z()),
                plain(".ball", JointType::Ball, Vector3::z()),
            ],
            JointKind::Planar => {
                let [a, b] = kinetoscope_robot::dynamics::planar_axes(&joint.axis);
                vec![
                    plain(".x", JointType::Slide, a.into_inner()),
                    plain(".y", JointType::Slide, b.into_inner()),
                    plain(".yaw", JointType::Hinge, joint.axis.into_inner()),
                ]
            }
            JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => {
                let plan = self.plan_of[&id];
                let kind = if joint.kind == JointKind::Prismatic { JointType::Slide } else { JointType::Hinge };
                let tendon = plan.actuator.is_some() && self.friction_is_tendon();
                vec![Joint {
                    range: plan.limit.map(widen_range),
                    damping: plan.damping,
                    frictionloss: if tendon { 0.0 } else { plan.friction },
                    armature: plan.armature,
                    ..plain("", kind, joint.axis.into_inner())
                }]
            }
        }
    }

    /// Removes viscous damping B from the document and integrates it implicitly, if drives are friction rows and the
    /// integrator is not RK4. `h B` is added to the armature, and each step applies `-B v`. The armature is in the
    /// document, so that constants that MuJoCo derives from the inertia include it.
    fn move_damping_to_armature(&mut self, joints: &mut [Joint]) {
        // RK4 evaluates forces inside its step, where no code of this crate runs, and row drives do not support RK4.
        if !self.friction_is_tendon() || self.mjcf.option.integrator == Integrator::Rk4 {
            return;
        }
        for joint in joints.iter_mut().filter(|joint| joint.kind != JointType::Free) {
            // Joints without damping too: an environment may set damping at run time.
            let (damping, armature) = (std::mem::take(&mut joint.damping), joint.armature);
            joint.armature += self.mjcf.option.timestep * damping;
            let dofs = if joint.kind == JointType::Ball { 3 } else { 1 };
            self.damped.push(DampedJoint { joint: joint.name.clone(), dofs, damping, armature });
        }
    }

    fn friction_is_tendon(&self) -> bool {
        matches!(self.cfg.dialect, MjcfDialect::Simulation { friction_tendons: true })
    }

    /// Sets the mass properties of every body from the links fused into it, repaired where they are physically
    /// impossible.
    fn inertias(&mut self) {
        let masses = std::mem::take(&mut self.fused_links);
        for (body, links) in masses {
            let pose = |link: LinkId| {
                self.link_frames[link.0].map_or_else(Pose::identity, |(_, body_from_link)| body_from_link)
            };
            let links = links.into_iter().map(|link| (link, pose(link))).collect();
            let rigid = RigidBody { links, moves: is_moving(&self.mjcf.bodies, body) };
            let Some(BodyInertia { inertia, source }) = fuse(self.description, &rigid, self.diagnostics) else {
                continue;
            };
            let (moments, axes) = inertia.principal();
            self.mjcf.bodies[body].inertial =
                Some(Inertial { mass: inertia.mass, com: inertia.com, axes, moments, source });
        }
    }

    fn couplings_and_actuators(&mut self) {
        for plan in self.cfg.plans {
            let joint = self.description.joint(plan.joint);
            let name = self.name(&joint.name);
            if let Some((driver, multiplier, offset)) = plan.mimic {
                self.mjcf.equalities.push(JointEquality {
                    name: name.clone(),
                    follower: name.clone(),
                    driver: self.name(&self.description.joint(driver).name),
                    multiplier,
                    offset,
                    source: joint.mimic.as_ref().map(|m| m.source.clone()),
                });
            }
            let tendon = self.friction_is_tendon() && (plan.friction > 0.0 || self.cfg.reserve_friction_tendons);
            add_drive(self.mjcf, self.cfg.uid, joint, plan, tendon);
        }
    }

    /// Pairs of a fixed base and its child bodies. MuJoCo does not exclude contacts of a body with a parent that is
    /// fixed in the world.
    fn base_pairs(&self) -> Vec<(String, String)> {
        let Some((base, _)) = self.link_frames[self.description.root.0].filter(|_| self.cfg.fix_base) else {
            return Vec::new();
        };
        let bodies = &self.mjcf.bodies;
        (base + 1..bodies.len())
            .filter(|&b| bodies[b].parent == base)
            .map(|b| (bodies[base].name.clone(), bodies[b].name.clone()))
            .collect()
    }
}

/// Full name of an added joint: `own`, with primes appended while a joint of the files has that name.
pub(super) fn unused_joint_name(description: &RobotDescription, uid: &str, own: &str) -> String {
    let mut own = own.to_owned();
    while description.joint_id(&own).is_some() {
        own.push('\'');
    }
    format!("{uid}/{own}")
}

/// Adds the actuator of a driven joint and, with `friction_tendon`, a tendon for its dry friction.
pub(super) fn add_drive(
    mjcf: &mut Mjcf,
    uid: &str,
    joint: &kinetoscope_robot::description::Joint,
    plan: &JointPlan,
    friction_tendon: bool,
) {
    let Some(actuator) = plan.actuator else { return };
    let name = format!("{uid}/{}", joint.name);
    // Without stiffness the control is a velocity; without stiffness and damping it is an effort.
    let gain = [actuator.kp, actuator.kd, 1.0].into_iter().find(|&g| g > 0.0).unwrap_or(1.0);
    let positions = actuator.kp > 0.0 && plan.target_range.iter().all(|end| end.is_finite());
    mjcf.actuators.push(Actuator {
        name: name.clone(),
        joint: name.clone(),
        gain,
        kp: actuator.kp,
        kd: actuator.kd,
        force_limit: Some(plan.max_effort.max(MIN_FORCE_LIMIT)).filter(|limit| limit.is_finite()),
        ctrl_range: positions.then_some(plan.target_range).map(widen_range),
        source: Some(joint.source.clone()),
    });
    if friction_tendon {
        mjcf.friction_tendons.push(FrictionTendon {
            name: format!("{name}/friction"),
            joint: name,
            frictionloss: plan.friction,
        });
    }
}

/// Smallest force limit \[N m or N\]: MuJoCo rejects an empty force range.
const MIN_FORCE_LIMIT: f64 = 1e-12;

/// Widens equal limits, which lock a joint, by a tiny amount: MuJoCo rejects an empty range.
fn widen_range([low, high]: [f64; 2]) -> [f64; 2] {
    const MIN_WIDTH: f64 = 1e-9;
    let hair = MIN_WIDTH * low.abs().max(1.0);
    if high - low < hair { [low - hair, high + hair] } else { [low, high] }
}

/// True if the body or a body above it has a joint.
fn is_moving(bodies: &[Body], mut body: usize) -> bool {
    while body != 0 {
        if !bodies[body].joints.is_empty() {
            return true;
        }
        body = bodies[body].parent;
    }
    false
}

fn primitive_shape(geometry: &Geometry) -> Shape {
    match geometry {
        Geometry::Box { size } => Shape::Box((size / 2.0).into()),
        Geometry::Cylinder { radius, length } => Shape::Cylinder(*radius, length / 2.0),
        Geometry::Capsule { radius, length } => Shape::Capsule(*radius, length / 2.0),
        Geometry::Sphere { radius } => Shape::Sphere(*radius),
        Geometry::Mesh { path, .. } => Shape::Mesh(path.to_string_lossy().into_owned()),
    }
}

impl VisualAssets {
    /// Adds a mesh part and its material to the document.
    pub(crate) fn declare(mjcf: &mut Mjcf, mesh: MeshAsset, material: Option<MaterialAsset>) -> VisualSubmesh {
        let part = VisualSubmesh { mesh: mesh.name.clone(), material: material.as_ref().map(|m| m.name.clone()) };
        mjcf.meshes.push(mesh);
        if let Some(material) = material
            && !mjcf.materials.iter().any(|m| m.name == material.name)
        {
            mjcf.materials.push(material);
        }
        part
    }
}
