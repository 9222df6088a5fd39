//! MJCF as plain data: bodies in a flat list with parents, one struct per element.
//!
//! Only what both MuJoCo lines have in common; [`super::write`](mod@super::write) knows the differences.

use super::part::MjcfPart;
use crate::light_cfg::LampKind;
use kinetoscope_scene::Pose;
use kinetoscope_scene::source::Source;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A whole document.
#[derive(Clone, Debug, PartialEq)]
pub struct Mjcf {
    /// Name of the model.
    pub model: String,
    /// Lines of a comment at the top.
    pub comments: Vec<String>,
    /// Physics options.
    pub option: PhysicsOption,
    /// Mesh assets.
    pub meshes: Vec<MeshAsset>,
    /// Height fields.
    pub height_fields: Vec<HeightFieldAsset>,
    /// Image files of materials.
    pub textures: Vec<TextureAsset>,
    /// Materials.
    pub materials: Vec<MaterialAsset>,
    /// `bodies[0]` is the world; a body's parent stands before it.
    pub bodies: Vec<Body>,
    /// Lights fixed in the world.
    pub lights: Vec<Light>,
    /// Pairs of bodies that never collide.
    pub excludes: Vec<(String, String)>,
    /// Couplings of joints.
    pub equalities: Vec<JointEquality>,
    /// Welds that hold when they are told to.
    pub welds: Vec<WeldEquality>,
    /// Dry friction of driven joints, as tendons of one joint each.
    pub friction_tendons: Vec<FrictionTendon>,
    /// Actuators.
    pub actuators: Vec<Actuator>,
    /// Named positions of all joints.
    pub keyframes: Vec<Keyframe>,
    /// MJCF files that are parts of the scene.
    pub parts: Vec<Arc<MjcfPart>>,
}

/// `<option>`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhysicsOption {
    /// Physics step \[s\].
    pub timestep: f64,
    /// Gravity \[m/s²\].
    pub gravity: Vector3<f64>,
    /// Integrator.
    pub integrator: Integrator,
    /// Friction cone.
    pub cone: Cone,
    /// Ratio of frictional to normal impedance.
    pub impratio: f64,
    /// Largest number of solver iterations.
    pub iterations: u32,
    /// Sliding, torsional and rolling friction of geoms that set none.
    pub friction: [f64; 3],
}

/// Integrators that the two lines know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Integrator {
    /// Semi-implicit Euler.
    #[default]
    Euler,
    /// Runge-Kutta of order 4.
    Rk4,
    /// Implicit in velocity.
    Implicit,
    /// Implicit in velocity without Coriolis terms: MuJoCo 4.x.
    #[serde(alias = "implicitfast")]
    ImplicitFast,
}

impl Integrator {
    /// MuJoCo's word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Euler => "Euler",
            Self::Rk4 => "RK4",
            Self::Implicit => "implicit",
            Self::ImplicitFast => "implicitfast",
        }
    }
}

/// Friction cones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Cone {
    /// Four-sided pyramid.
    #[default]
    Pyramidal,
    /// Quadratic cone.
    Elliptic,
}

/// `<mesh>`.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshAsset {
    /// Unique name.
    pub name: String,
    /// The triangles.
    pub content: MeshContent,
    /// Only seen: may be flat or open.
    pub visual: bool,
    /// Where the mesh is named.
    pub source: Option<Source>,
}

/// Where a mesh is.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshContent {
    /// In the document.
    Inline {
        /// Vertices \[m\].
        vertices: Vec<[f32; 3]>,
        /// Triangles.
        triangles: Vec<[u32; 3]>,
    },
    /// In a file next to the document.
    File(String),
}

/// `<hfield>`.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightFieldAsset {
    /// Unique name.
    pub name: String,
    /// MuJoCo's binary file next to the document.
    pub file: String,
    /// Half length along x, half length along y, height of elevation 1, depth of the floor below elevation 0 \[m\].
    pub size: [f64; 4],
}

/// `<texture type="2d">`.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureAsset {
    /// Unique name.
    pub name: String,
    /// PNG file next to the document.
    pub file: String,
}

/// `<material>`.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialAsset {
    /// Unique name.
    pub name: String,
    /// Colour.
    pub rgba: [f64; 4],
    /// Name of the texture.
    pub texture: Option<String>,
}

/// `<body>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Unique name.
    pub name: String,
    /// Index of the parent.
    pub parent: usize,
    /// Pose in the parent's frame.
    pub pose: Pose,
    /// Mass properties.
    pub inertial: Option<Inertial>,
    /// Joints to the parent, in order.
    pub joints: Vec<Joint>,
    /// Moved by hand: a child of the world without joints, with a pose of its own in every environment.
    pub mocap: bool,
    /// Shapes.
    pub geoms: Vec<Geom>,
    /// Named frames.
    pub sites: Vec<Site>,
    /// The link it comes from.
    pub source: Option<Source>,
}

/// `<inertial>` in principal axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Mass \[kg\].
    pub mass: f64,
    /// Centre of mass in the body frame \[m\].
    pub com: Vector3<f64>,
    /// Principal axes in the body frame.
    pub axes: UnitQuaternion<f64>,
    /// Principal moments \[kg m²\].
    pub moments: Vector3<f64>,
    /// Where it is given.
    pub source: Option<Source>,
}

/// `<joint>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique name.
    pub name: String,
    /// Kind.
    pub kind: JointType,
    /// Axis in the body frame (hinge, slide).
    pub axis: Vector3<f64>,
    /// Limits \[rad or m\].
    pub range: Option<[f64; 2]>,
    /// Viscous damping.
    pub damping: f64,
    /// Dry friction.
    pub frictionloss: f64,
    /// Rotor inertia.
    pub armature: f64,
    /// Where it is described.
    pub source: Option<Source>,
}

impl Joint {
    /// A joint that leaves a child of the world free.
    pub fn free(name: impl Into<String>, source: Option<Source>) -> Self {
        Self {
            name: name.into(),
            kind: JointType::Free,
            axis: Vector3::z(),
            range: None,
            damping: 0.0,
            frictionloss: 0.0,
            armature: 0.0,
            source,
        }
    }
}

/// Kinds of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JointType {
    /// Six degrees of freedom, on a child of the world only.
    Free,
    /// Rotation.
    Ball,
    /// Rotation about an axis.
    Hinge,
    /// Translation along an axis.
    Slide,
}

/// `<geom>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Geom {
    /// Unique name, if any.
    pub name: Option<String>,
    /// Shape.
    pub shape: Shape,
    /// Pose in the body frame.
    pub pose: Pose,
    /// What it is for.
    pub role: GeomRole,
    /// Sliding, torsional and rolling friction; the document's default if unset.
    pub friction: Option<[f64; 3]>,
    /// How contacts give way; MuJoCo's defaults if unset.
    pub surface: Option<Surface>,
    /// Colour; MuJoCo's grey if unset.
    pub rgba: Option<[f64; 4]>,
    /// Name of a material.
    pub material: Option<String>,
    /// Where it is described.
    pub source: Option<Source>,
}

/// How contacts of a geom give way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// Distance at which contacts begin to push \[m\].
    pub margin: f64,
    /// MuJoCo's `solref`, `solimp` and `solmix`; its defaults if unset.
    pub solver: Option<ContactSolver>,
}

/// Reference, impedance and weight of contacts, as MuJoCo has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSolver {
    /// `solref`.
    pub reference: [f64; 2],
    /// `solimp`.
    pub impedance: [f64; 5],
    /// `solmix`.
    pub weight: f64,
}

/// What a geom is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeomRole {
    /// Collides, by bits: two geoms collide if one's `contype` and the other's `conaffinity` share a bit.
    Collision {
        /// MuJoCo's `contype`.
        contype: i32,
        /// MuJoCo's `conaffinity`.
        conaffinity: i32,
        /// It is seen as well: the ground, objects. Collision shapes of robots stand behind their visuals.
        seen: bool,
    },
    /// Is only seen.
    Visual,
}

/// Shapes of geoms, with MuJoCo's meaning of the numbers (half lengths).
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Half lengths of what is drawn; the plane itself is infinite.
    Plane([f64; 2]),
    /// Radius.
    Sphere(f64),
    /// Radius and half length of the cylindrical part.
    Capsule(f64, f64),
    /// Radius and half length.
    Cylinder(f64, f64),
    /// Half lengths.
    Box([f64; 3]),
    /// Name of a mesh.
    Mesh(String),
    /// Name of a height field.
    HeightField(String),
}

/// `<site>`: a named frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Unique name.
    pub name: String,
    /// Pose in the body frame.
    pub pose: Pose,
}

/// `<light>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Unique name.
    pub name: String,
    /// Position \[m\].
    pub position: Vector3<f64>,
    /// Direction in which it shines.
    pub direction: Vector3<f64>,
    /// Diffuse colour.
    pub diffuse: [f64; 3],
    /// What kind of lamp it is.
    pub kind: LampKind,
    /// Constant, linear and quadratic attenuation.
    pub attenuation: [f64; 3],
    /// Radius of the lamp \[m\], which MuJoCo 2.2.2 does not know.
    pub radius: f64,
    /// Whether it casts shadows.
    pub cast_shadow: bool,
}

/// `<equality><joint>`: `follower = offset + multiplier * driver`.
#[derive(Clone, Debug, PartialEq)]
pub struct JointEquality {
    /// Unique name.
    pub name: String,
    /// The joint that follows.
    pub follower: String,
    /// The joint that is followed.
    pub driver: String,
    /// Ratio.
    pub multiplier: f64,
    /// Offset \[rad or m\].
    pub offset: f64,
    /// Where it is given.
    pub source: Option<Source>,
}

/// `<equality><weld>` that does not hold at first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeldEquality {
    /// Unique name.
    pub name: String,
    /// The one body.
    pub first: String,
    /// The other one.
    pub second: String,
}

/// `<tendon><fixed>` of one joint, with dry friction.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionTendon {
    /// Unique name.
    pub name: String,
    /// The joint.
    pub joint: String,
    /// Dry friction \[N m or N\].
    pub frictionloss: f64,
}

/// `<actuator><general>`: force = clamp(gain ctrl - kp q - kd v).
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Unique name.
    pub name: String,
    /// The joint.
    pub joint: String,
    /// Gain of the control.
    pub gain: f64,
    /// Stiffness.
    pub kp: f64,
    /// Damping.
    pub kd: f64,
    /// Largest force.
    pub force_limit: Option<f64>,
    /// Range of the control.
    pub ctrl_range: Option<[f64; 2]>,
    /// The joint's place.
    pub source: Option<Source>,
}

/// `<key>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// Name.
    pub name: String,
    /// Positions of all joints in MuJoCo's order.
    pub qpos: Vec<f64>,
    /// Controls of all actuators in order.
    pub ctrl: Vec<f64>,
}

impl Mjcf {
    /// An empty world.
    pub fn new(model: impl Into<String>, option: PhysicsOption) -> Self {
        let world = Body {
            name: "world".into(),
            parent: 0,
            pose: Pose::identity(),
            inertial: None,
            joints: Vec::new(),
            mocap: false,
            geoms: Vec::new(),
            sites: Vec::new(),
            source: None,
        };
        Self {
            model: model.into(),
            comments: Vec::new(),
            option,
            meshes: Vec::new(),
            height_fields: Vec::new(),
            textures: Vec::new(),
            materials: Vec::new(),
            bodies: vec![world],
            lights: Vec::new(),
            excludes: Vec::new(),
            equalities: Vec::new(),
            welds: Vec::new(),
            friction_tendons: Vec::new(),
            actuators: Vec::new(),
            keyframes: Vec::new(),
            parts: Vec::new(),
        }
    }
}
