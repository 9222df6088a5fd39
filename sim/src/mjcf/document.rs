//! MJCF document as plain data: one struct per element, bodies in a flat list with parent indices.
//!
//! The document has the elements that both supported MuJoCo versions have in common; [`super::write`](mod@super::write)
//! handles the differences.

use super::part::PartDocument;
use crate::light_cfg::LightKindCfg;
use kinetoscope_scene::Pose;
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// MJCF document.
#[derive(Clone, Debug, PartialEq)]
pub struct Mjcf {
    /// Name of the model.
    pub model: String,
    /// Comments at the top of the document; each entry is an XML comment on one line.
    pub comments: Vec<String>,
    /// Physics options.
    pub option: PhysicsOption,
    /// Mesh assets.
    pub meshes: Vec<MeshAsset>,
    /// Height fields.
    pub height_fields: Vec<HeightFieldAsset>,
    /// Texture assets.
    pub textures: Vec<TextureAsset>,
    /// Material assets.
    pub materials: Vec<MaterialAsset>,
    /// Bodies. `bodies[0]` is the world, and parents precede their children.
    pub bodies: Vec<Body>,
    /// Lights fixed in the world.
    pub lights: Vec<Light>,
    /// Pairs of names of bodies that never collide.
    pub excludes: Vec<(String, String)>,
    /// Equality constraints between joints.
    pub equalities: Vec<JointEquality>,
    /// Weld constraints, inactive until they are switched on.
    pub welds: Vec<WeldEquality>,
    /// Tendons of one joint each, which apply dry friction to driven joints.
    pub friction_tendons: Vec<FrictionTendon>,
    /// Actuators.
    pub actuators: Vec<Actuator>,
    /// Keyframes: named positions of all joints and controls of all actuators.
    pub keyframes: Vec<Keyframe>,
    /// MJCF files that are embedded in the scene.
    pub parts: Vec<Arc<PartDocument>>,
}

/// Physics options: `<option>`, and the default friction of geoms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhysicsOption {
    /// Time step of MuJoCo \[s\]: the physics step divided by the number of substeps.
    pub timestep: f64,
    /// Gravity in world axes \[m/s²\].
    pub gravity: Vector3<f64>,
    /// Integrator.
    pub integrator: Integrator,
    /// Friction cone.
    pub cone: FrictionCone,
    /// Ratio of frictional to normal impedance.
    pub impratio: f64,
    /// Largest number of solver iterations.
    pub iterations: u32,
    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\], of geoms without friction of their own.
    pub friction: [f64; 3],
}

/// Integrators of the supported MuJoCo versions.
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
    /// Implicit in velocity without Coriolis terms; MuJoCo 4.x only.
    #[serde(alias = "implicitfast")]
    ImplicitFast,
}

impl Integrator {
    /// Name of the integrator in MJCF.
    pub fn name(self) -> &'static str {
        match self {
            Self::Euler => "Euler",
            Self::Rk4 => "RK4",
            Self::Implicit => "implicit",
            Self::ImplicitFast => "implicitfast",
        }
    }
}

/// Type of friction cone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FrictionCone {
    /// Pyramid inside the cone: 4 edges, or 6 and 10 for contacts with torsional and rolling friction (`condim` 4, 6).
    #[default]
    Pyramidal,
    /// Exact elliptic cone.
    Elliptic,
}

/// Mesh asset: `<mesh>`.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshAsset {
    /// Name of the mesh, unique in the document.
    pub name: String,
    /// Triangles of the mesh.
    pub content: MeshContent,
    /// True for a mesh of visual geoms only, which may be flat or open.
    pub visual: bool,
    /// Location of the element that names the mesh; `None` if no file does.
    pub source: Option<SourceLocation>,
}

/// Storage of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshContent {
    /// Inline, in the document.
    Inline {
        /// Vertices in the frame of the mesh \[m\].
        vertices: Vec<[f32; 3]>,
        /// Triangles as indices of vertices.
        triangles: Vec<[u32; 3]>,
    },
    /// File next to the document.
    File(String),
}

/// Height field asset: `<hfield>`.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightFieldAsset {
    /// Name of the height field, unique in the document.
    pub name: String,
    /// Name of the file of heights, in MuJoCo's binary format: beside the document, or an asset in memory.
    pub file: String,
    /// Half length along x, half length along y, height of elevation 1, depth of the floor below elevation 0 \[m\].
    pub size: [f64; 4],
}

/// Texture asset: `<texture type="2d">`.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureAsset {
    /// Name of the texture, unique in the document.
    pub name: String,
    /// PNG file next to the document.
    pub file: String,
}

/// Material asset: `<material>`.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialAsset {
    /// Name of the material, unique in the document.
    pub name: String,
    /// RGBA color.
    pub rgba: [f64; 4],
    /// Name of its [`TextureAsset`]; `None` for a plain color.
    pub texture: Option<String>,
}

/// Body: `<body>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name of the body, unique in the document.
    pub name: String,
    /// Index of the parent in [`Mjcf::bodies`].
    pub parent: usize,
    /// Pose in the parent's frame.
    pub pose: Pose,
    /// Mass properties; `None` for a massless link, and for an object that does not move.
    pub inertial: Option<Inertial>,
    /// Joints to the parent, in order.
    pub joints: Vec<Joint>,
    /// True for a mocap body: a child of the world without joints, whose pose is set in each environment.
    pub mocap: bool,
    /// Collision and visual geoms.
    pub geoms: Vec<Geom>,
    /// Named frames.
    pub sites: Vec<Site>,
    /// Location of the link that the body comes from; `None` for a body without a file.
    pub source: Option<SourceLocation>,
}

/// Mass properties in principal axes: `<inertial>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Mass \[kg\].
    pub mass: f64,
    /// Center of mass in the body frame \[m\].
    pub com: Vector3<f64>,
    /// Principal axes in the body frame, `body_from_principal`.
    pub axes: UnitQuaternion<f64>,
    /// Principal moments about the center of mass \[kg m²\].
    pub moments: Vector3<f64>,
    /// Location of the declaration; `None` for an element without a file.
    pub source: Option<SourceLocation>,
}

/// Joint: `<joint>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name of the joint, unique in the document.
    pub name: String,
    /// Free, ball, hinge or slide.
    pub kind: JointType,
    /// Axis in the body frame (hinge, slide).
    pub axis: Vector3<f64>,
    /// Limits \[rad or m\]; `None` without limits.
    pub range: Option<[f64; 2]>,
    /// Viscous damping \[N m s/rad or N s/m\].
    pub damping: f64,
    /// Dry friction \[N m or N\].
    pub frictionloss: f64,
    /// Rotor inertia \[kg m² or kg\]; may include the implicit damping of [`drive::implicit`](crate::drive::implicit).
    pub armature: f64,
    /// Location of the declaration; `None` for an element without a file.
    pub source: Option<SourceLocation>,
}

impl Joint {
    /// Creates a free joint, for a child of the world.
    pub fn free(name: impl Into<String>, source: Option<SourceLocation>) -> Self {
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

/// Types of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JointType {
    /// Six degrees of freedom, on a child of the world only.
    Free,
    /// Rotation with three degrees of freedom.
    Ball,
    /// Rotation about an axis.
    Hinge,
    /// Translation along an axis.
    Slide,
}

/// Shape of a body: `<geom>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Geom {
    /// Unique name, if any.
    pub name: Option<String>,
    /// Shape.
    pub shape: Shape,
    /// Pose in the body frame.
    pub pose: Pose,
    /// Collision (with its contact bits) or visual only.
    pub role: GeomRole,
    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\]; `None` for the document's default.
    pub friction: Option<[f64; 3]>,
    /// Contact compliance; `None` for MuJoCo's defaults.
    pub surface: Option<ContactParams>,
    /// RGBA color; `None` for the color of `material`, or MuJoCo's gray without a material.
    pub rgba: Option<[f64; 4]>,
    /// Name of the material; `None` without one.
    pub material: Option<String>,
    /// Location of the declaration; `None` for an element without a file.
    pub source: Option<SourceLocation>,
}

/// Contact compliance of a geom.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactParams {
    /// Distance at which contact forces begin \[m\]: MuJoCo's `margin`.
    pub margin: f64,
    /// MuJoCo's `solref`, `solimp` and `solmix`; `None` for its defaults.
    pub solver: Option<ContactSolver>,
}

/// Contact solver parameters of MuJoCo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSolver {
    /// MuJoCo's `solref`: time constant \[s\] and damping ratio, or, if negative, -stiffness and -damping.
    pub solref: [f64; 2],
    /// MuJoCo's `solimp`: smallest and largest impedance, width \[m\], midpoint and power of the transition.
    pub solimp: [f64; 5],
    /// Weight in a contact with another geom: MuJoCo's `solmix`.
    pub solmix: f64,
}

/// Role of a geom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeomRole {
    /// Geom that collides, by bits: two geoms collide if one's `contype` and the other's `conaffinity` share a bit.
    Collision {
        /// MuJoCo's `contype`.
        contype: i32,
        /// MuJoCo's `conaffinity`.
        conaffinity: i32,
        /// True if the geom is visible as well, like the ground and objects. Collision shapes of robots are not: the
        /// visuals stand in their place.
        visible: bool,
    },
    /// Visible geom without collisions.
    Visual,
}

/// Shape of a geom, with the size conventions of MuJoCo (half lengths) \[m\].
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Infinite plane, with half lengths of the rendered part.
    Plane([f64; 2]),
    /// Sphere with its radius.
    Sphere(f64),
    /// Capsule with its radius and the half length of the cylindrical part.
    Capsule(f64, f64),
    /// Cylinder with its radius and half length.
    Cylinder(f64, f64),
    /// Box with its half lengths.
    Box([f64; 3]),
    /// Mesh with the name of its asset.
    Mesh(String),
    /// Height field with the name of its asset.
    HeightField(String),
}

/// Named frame: `<site>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Name of the site, unique in the document.
    pub name: String,
    /// Pose in the body frame.
    pub pose: Pose,
}

/// Light: `<light>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name of the light, unique in the document.
    pub name: String,
    /// Position in the world \[m\]; unused by directional lights.
    pub position: Vector3<f64>,
    /// Unit direction of the emitted light, in the world; unused by point lights.
    pub direction: Vector3<f64>,
    /// Diffuse color, RGB in 0..=1.
    pub diffuse: [f64; 3],
    /// Type of the light. Never `Dome`: MuJoCo has no dome lights.
    pub kind: LightKindCfg,
    /// Constant, linear \[1/m\] and quadratic \[1/m²\] attenuation c, l, q: the intensity at distance d is divided by c
    /// + l d + q d².
    pub attenuation: [f64; 3],
    /// Radius of the light \[m\], `bulbradius` of MuJoCo 4.x. Omitted for MuJoCo 2.2.2 and for directional lights.
    pub radius: f64,
    /// True if the light casts shadows.
    pub cast_shadow: bool,
}

/// Equality constraint between joints, `<equality><joint>`: `follower = offset + multiplier * driver`.
#[derive(Clone, Debug, PartialEq)]
pub struct JointEquality {
    /// Name of the equality constraint, unique in the document.
    pub name: String,
    /// Name of the constrained joint, `joint1` in MJCF.
    pub follower: String,
    /// Name of the driving joint, `joint2` in MJCF.
    pub driver: String,
    /// Factor of the driver's position.
    pub multiplier: f64,
    /// Offset \[rad or m\].
    pub offset: f64,
    /// Location of the declaration; `None` for an element without a file.
    pub source: Option<SourceLocation>,
}

/// Weld constraint that is inactive at first: `<equality><weld>`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeldEquality {
    /// Name of the weld, unique in the document.
    pub name: String,
    /// Name of the first body.
    pub first: String,
    /// Name of the second body.
    pub second: String,
}

/// Tendon of one joint with dry friction: `<tendon><fixed>`.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionTendon {
    /// Name of the tendon, unique in the document.
    pub name: String,
    /// Name of the joint.
    pub joint: String,
    /// Dry friction \[N m or N\].
    pub frictionloss: f64,
}

/// Actuator, `<actuator><general>`: force = clamp(gain ctrl - kp q - kd v).
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Name of the actuator, unique in the document.
    pub name: String,
    /// Name of the joint.
    pub joint: String,
    /// Gain of the control.
    pub gain: f64,
    /// Stiffness \[N m/rad or N/m\].
    pub kp: f64,
    /// Damping \[N m s/rad or N s/m\].
    pub kd: f64,
    /// Largest force \[N m or N\]; `None` without a limit.
    pub force_limit: Option<f64>,
    /// Range of the control, in its unit; `None` without a limit.
    pub ctrl_range: Option<[f64; 2]>,
    /// Location of the joint; `None` for a joint without a file.
    pub source: Option<SourceLocation>,
}

/// Keyframe: `<key>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// Name of the keyframe.
    pub name: String,
    /// Positions of all joints in MuJoCo's layout of `qpos`.
    pub qpos: Vec<f64>,
    /// Controls of all actuators in order.
    pub ctrl: Vec<f64>,
}

impl Mjcf {
    /// Creates a document with an empty world.
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
