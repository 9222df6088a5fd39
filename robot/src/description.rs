//! Robot description: the merged links and joints as the files define them.
//! [`complete`](crate::shape_inertia::complete) adds missing mass properties. The MJCF writer repairs impossible
//! inertias of fused bodies.
//!
//! The URDF and MJCF readers build it (`urdf::merge`, and `mjcf::robot_file` of the simulation crate). Dynamics,
//! kinematics, the MJCF writer and the drives read it. Names are unique, elements keep the order of the files, and each
//! element has its [`SourceLocation`].

use kinetoscope_scene::Pose;
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::{Matrix3, Unit, Vector3};
use std::path::PathBuf;

/// Index of a link in [`RobotDescription::links`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LinkId(pub usize);

/// Index of a joint in [`RobotDescription::joints`] (all joints, fixed ones included).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JointId(pub usize);

/// A robot: a tree of links joined by joints.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotDescription {
    /// Name of the robot: for URDF files, [`UrdfCfg::name`](crate::urdf::UrdfCfg::name), else the names in the files
    /// joined by `_`, else `robot`; for an MJCF file, the uid.
    pub name: String,
    /// All links; [`root`](Self::root) is the only one without a parent joint. [Auxiliary
    /// frames](Link::is_auxiliary_frame) come last.
    pub links: Vec<Link>,
    /// All joints, fixed ones included. Joints of URDF files have the order of the files; a joint that connects two
    /// components precedes the joints of the attached component.
    pub joints: Vec<Joint>,
    /// Root link of the tree.
    pub root: LinkId,
}

/// A link of the description: a rigid body, or a frame without mass (a site, an auxiliary frame).
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Unique name.
    pub name: String,
    /// Location of the link element (URDF), or of the body, site or joint that the link stands for (MJCF). An added
    /// base link has the location of the root link of the first component.
    pub source: SourceLocation,
    /// Component of the robot that the link comes from (`arm`, `hand`, ...). It is empty for an added base link, and
    /// the name of the robot in a robot from MJCF.
    pub component: String,
    /// Mass properties; `None` for a link without any. For a URDF they are those of `<inertial>`, completed or replaced
    /// by [`complete`](crate::shape_inertia::complete); for an MJCF file, those of the compiled body.
    pub inertial: Option<Inertial>,
    /// Mass properties of an incomplete `<inertial>`; `inertial` is `None` then.
    /// [`complete`](crate::shape_inertia::complete) takes this value and sets `inertial`.
    pub partial_inertial: Option<PartialInertial>,
    /// Visual shapes.
    pub visuals: Vec<Visual>,
    /// Collision shapes.
    pub collisions: Vec<Collision>,
    /// The joint whose child this link is; `None` for the root.
    pub parent_joint: Option<JointId>,
    /// Joints whose parent this link is, in file order.
    pub child_joints: Vec<JointId>,
    /// True for an auxiliary frame of an MJCF body. Such frames are added if the body has several joints, or if the
    /// anchor of a joint is not at the body's origin. An auxiliary frame has no mass, no shape and no body in MuJoCo.
    /// Lists of links for users omit it.
    pub is_auxiliary_frame: bool,
}

/// Mass properties of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Location of the `<inertial>` element; that of the link (URDF) or body (MJCF) if the values are computed.
    pub source: SourceLocation,
    /// Pose of the center-of-mass frame in the link frame.
    pub link_from_com: Pose,
    /// Mass \[kg\].
    pub mass: f64,
    /// Inertia tensor \[kg m²\] about the center of mass, in the axes of the center-of-mass frame.
    pub inertia: Matrix3<f64>,
}

/// Partly specified mass properties of a link. `None` marks a missing value; a complete set is an [`Inertial`].
#[derive(Clone, Debug, PartialEq)]
pub struct PartialInertial {
    /// Location of the `<inertial>` element.
    pub source: SourceLocation,
    /// Pose of the center-of-mass frame in the link frame.
    pub link_from_com: Option<Pose>,
    /// Mass \[kg\].
    pub mass: Option<f64>,
    /// Density \[kg/m³\], an extension of Isaac Gym; `None` if the mass is given.
    pub density: Option<f64>,
    /// Inertia tensor \[kg m²\] about the center of mass, in the axes of the center-of-mass frame.
    pub inertia: Option<Matrix3<f64>>,
}

/// Visual shape of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// Location in the file.
    pub source: SourceLocation,
    /// Pose of the shape in the link frame.
    pub link_from_shape: Pose,
    /// Shape and size.
    pub geometry: Geometry,
    /// Material; `None` if the `<visual>` has no `<material>`.
    pub material: Option<Material>,
}

/// Collision shape of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Collision {
    /// Location in the file.
    pub source: SourceLocation,
    /// Pose of the shape in the link frame.
    pub link_from_shape: Pose,
    /// Shape and size.
    pub geometry: Geometry,
}

/// Shape of a visual or collision element, with the size conventions of URDF.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Box, centered at the origin of the shape.
    Box {
        /// Edge lengths along x, y, z \[m\].
        size: Vector3<f64>,
    },
    /// Cylinder along z, centered at the origin of the shape.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Full length \[m\].
        length: f64,
    },
    /// Capsule along z, centered at the origin of the shape.
    Capsule {
        /// Radius \[m\].
        radius: f64,
        /// Length of the cylindrical part \[m\].
        length: f64,
    },
    /// Sphere, centered at the origin of the shape.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// Mesh file.
    Mesh {
        /// URI as written in the file.
        uri: String,
        /// Resolved path. The file of a visual may be missing; a diagnostic then reports it.
        path: PathBuf,
        /// Scale per axis; negative values mirror.
        scale: Vector3<f64>,
    },
}

/// Material of a visual. If the `<visual>` gives a color or a texture, its own values apply alone; otherwise those of
/// the named material of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, if any.
    pub name: Option<String>,
    /// RGBA in 0..=1, a display color (sRGB); `None` where the file gives no color.
    pub rgba: Option<[f64; 4]>,
    /// Resolved path of the texture file; `None` without a texture or if the file does not exist.
    pub texture: Option<PathBuf>,
}

/// A joint of the description.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique name.
    pub name: String,
    /// Location in the file.
    pub source: SourceLocation,
    /// Joint type.
    pub kind: JointKind,
    /// Parent link.
    pub parent: LinkId,
    /// Child link.
    pub child: LinkId,
    /// Pose of the joint frame (= child link frame at zero) in the parent link frame.
    pub parent_from_joint: Pose,
    /// Unit axis in the joint frame. It is x for fixed and floating joints, and where a URDF has no `<axis>`.
    pub axis: Unit<Vector3<f64>>,
    /// Limits; `None` where a URDF has no `<limit>`, and for an MJCF joint without a range and a force limit.
    pub limit: Option<JointLimit>,
    /// Passive viscous damping \[N m s/rad or N s/m\]; `None` where the file gives no value.
    pub damping: Option<f64>,
    /// Dry friction \[N m or N\]; `None` where the file gives no value.
    pub friction: Option<f64>,
    /// Linear coupling to another joint. `None` for other couplings of MJCF files; see [`FileActuation::Coupled`].
    pub mimic: Option<Mimic>,
    /// Joint properties that only MJCF has; `None` for joints of a URDF file and for fixed joints.
    pub defaults: Option<JointDefaults>,
}

/// Joint properties that MJCF has and URDF lacks: defaults for values that the robot configuration does not set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointDefaults {
    /// Rotor inertia \[kg m² or kg\].
    pub armature: f64,
    /// Initial position \[rad or m\] (`ref`, MuJoCo's `qpos0`).
    pub position: f64,
    /// Actuation of the joint in the file. A drive replaces it.
    pub drive: FileActuation,
}

/// Actuation of a joint as an MJCF file defines it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FileActuation {
    /// The file has no actuators at all.
    Unspecified,
    /// The file has actuators, but they give this joint no drive. A mimic joint is passive, too: its actuators count
    /// for the joint that it follows.
    Passive,
    /// Actuated without stiffness and damping: the control is an effort.
    Effort,
    /// Actuated by actuators with stiffness or damping, on the joint, on a fixed tendon or on joints that mimic this
    /// joint. The gains are those at the joint, summed over the actuators.
    Servo {
        /// Stiffness \[N m/rad or N/m\].
        stiffness: f64,
        /// Damping \[N m s/rad or N s/m\].
        damping: f64,
    },
    /// Positioned by a joint equality that is not a [`Mimic`], so the joint must not be driven. The polynomial is
    /// `None` if several equalities act on the joint, or if the couplings form a cycle.
    Coupled(Option<CouplingPolynomial>),
}

/// Polynomial coupling of a joint to another joint with the position x:
/// `position = follower_start + Σ coefficients[k] (x - driver_start)ᵏ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingPolynomial {
    /// Followed joint; `None` for the constant position `follower_start + coefficients[0]`.
    pub joint: Option<JointId>,
    /// Position of the followed joint \[rad or m\] in MuJoCo's `qpos0`; 0 without a followed joint.
    pub driver_start: f64,
    /// Position of the following joint \[rad or m\] in MuJoCo's `qpos0`.
    pub follower_start: f64,
    /// Coefficients in ascending order, the constant first.
    pub coefficients: [f64; 5],
}

impl CouplingPolynomial {
    /// Position of the following joint \[rad or m\] for the position `driver` of the followed joint.
    pub fn position(&self, driver: f64) -> f64 {
        let by = driver - self.driver_start;
        self.follower_start + self.coefficients.iter().rev().fold(0.0, |sum, c| sum * by + c)
    }
}

/// Joint types of URDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// No motion.
    Fixed,
    /// Rotation about the axis with limits; the limits may be missing or invalid ([`Joint::limit`]).
    Revolute,
    /// Rotation about the axis without limits; position limits of the file are ignored.
    Continuous,
    /// Translation along the axis; without limits for an MJCF slide without a range.
    Prismatic,
    /// Six degrees of freedom.
    Floating,
    /// Two translations in the plane normal to the axis and a rotation about it.
    Planar,
}

impl JointKind {
    /// Name of the joint type in URDF.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Revolute => "revolute",
            Self::Continuous => "continuous",
            Self::Prismatic => "prismatic",
            Self::Floating => "floating",
            Self::Planar => "planar",
        }
    }

    /// True for joint types with one degree of freedom, which a drive can act on.
    pub fn is_drivable(self) -> bool {
        matches!(self, Self::Revolute | Self::Continuous | Self::Prismatic)
    }
}

/// Limits of a joint as the file gives them; `None` where the file has no value. Both position limits are `None` if the
/// lower one exceeds the upper one (in a URDF, a missing one counts as 0). Drives ignore the position limits of a
/// continuous joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimit {
    /// Location of the declaration.
    pub source: SourceLocation,
    /// Lower position \[rad or m\]. If only the upper one is given, drives use 0, the default of URDF.
    pub lower: Option<f64>,
    /// Upper position \[rad or m\]. If only the lower one is given, drives use 0, the default of URDF.
    pub upper: Option<f64>,
    /// Largest effort \[N m or N\]. Drives treat 0 as unlimited.
    pub effort: Option<f64>,
    /// Largest speed \[rad/s or m/s\]. Drives treat 0 as unlimited. It does not limit the motion; actuator models may
    /// use it, such as `DcMotor` as the no-load speed.
    pub velocity: Option<f64>,
}

/// Mimic coupling of a joint: `position = multiplier * position(joint) + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// Location of the declaration.
    pub source: SourceLocation,
    /// Followed joint. It may follow another joint itself; [`mimic_driver`](RobotDescription::mimic_driver) resolves
    /// such chains.
    pub joint: JointId,
    /// Factor of the position of the followed joint; negative for opposite directions.
    pub multiplier: f64,
    /// Offset \[rad or m\].
    pub offset: f64,
}

impl Link {
    /// Creates a link without mass, shapes and joints.
    pub fn new(name: String, source: SourceLocation, component: String) -> Self {
        Self {
            name,
            source,
            component,
            inertial: None,
            partial_inertial: None,
            visuals: Vec::new(),
            collisions: Vec::new(),
            parent_joint: None,
            child_joints: Vec::new(),
            is_auxiliary_frame: false,
        }
    }
}

impl RobotDescription {
    /// All links except [auxiliary frames](Link::is_auxiliary_frame), indexed by [`LinkId`]. Users see only these
    /// links.
    pub fn named_links(&self) -> &[Link] {
        let named = self.links.iter().position(|link| link.is_auxiliary_frame).unwrap_or(self.links.len());
        &self.links[..named]
    }

    /// Finds the link called `name` among the [`named_links`](Self::named_links); `None` if there is no such link.
    pub fn link_id(&self, name: &str) -> Option<LinkId> {
        self.named_links().iter().position(|l| l.name == name).map(LinkId)
    }

    /// Finds the joint called `name`, fixed joints included; `None` if there is no such joint.
    pub fn joint_id(&self, name: &str) -> Option<JointId> {
        self.joints.iter().position(|j| j.name == name).map(JointId)
    }

    /// Returns the link with this id.
    ///
    /// # Panics
    /// The id is out of range: it belongs to another description.
    #[track_caller]
    pub fn link(&self, id: LinkId) -> &Link {
        &self.links[id.0]
    }

    /// Returns the joint with this id.
    ///
    /// # Panics
    /// The id is out of range: it belongs to another description.
    #[track_caller]
    pub fn joint(&self, id: JointId) -> &Joint {
        &self.joints[id.0]
    }

    /// Revolute, continuous and prismatic joints in the order of [`joints`](Self::joints), mimic joints included: the
    /// columns of `qpos` of the robot.
    pub fn drivable_joints(&self) -> impl Iterator<Item = (JointId, &Joint)> {
        self.joints.iter().enumerate().filter(|(_, j)| j.kind.is_drivable()).map(|(i, j)| (JointId(i), j))
    }

    /// Sum of the link masses \[kg\]. Links without mass properties count as 0.
    pub fn total_mass(&self) -> f64 {
        self.links.iter().filter_map(|l| l.inertial.as_ref()).map(|i| i.mass).sum()
    }

    /// Resolves a chain of mimic joints to its end. Returns driver, multiplier and offset:
    /// `position(id) = multiplier * position(driver) + offset`. For a joint without a mimic, these are the joint
    /// itself, 1 and 0.
    ///
    /// Mimic chains are free of cycles: `urdf::merge` rejects cycles, and `mjcf::robot_file` creates none.
    ///
    /// # Panics
    /// The id is out of range: it belongs to another description.
    #[track_caller]
    pub fn mimic_driver(&self, id: JointId) -> (JointId, f64, f64) {
        let (mut driver, mut multiplier, mut offset) = (id, 1.0, 0.0);
        while let Some(mimic) = &self.joint(driver).mimic {
            offset += multiplier * mimic.offset;
            multiplier *= mimic.multiplier;
            driver = mimic.joint;
        }
        (driver, multiplier, offset)
    }
}
