//! `RobotDescription`: the merged robot as the files describe it, unrepaired, before MuJoCo sees it.
//!
//! Made by `urdf::merge` and `mjcf::robot_file`, read by `dynamics`, `kinematics`, `mjcf::robot` and `drive`. Names are
//! unique, order is the order of the files, every element knows its [`Source`].

use kinetoscope_scene::Pose;
use kinetoscope_scene::source::Source;
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
    /// Name of the robot.
    pub name: String,
    /// All links; `links[root.0]` is the only one without a parent joint. Those that are [`between_joints`](Link::between_joints)
    /// stand behind all others.
    pub links: Vec<Link>,
    /// All joints, fixed ones included, in the order of the merged files.
    pub joints: Vec<Joint>,
    /// The root of the tree.
    pub root: LinkId,
}

/// A rigid body of the description.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Unique name.
    pub name: String,
    /// Where the link is described.
    pub source: Source,
    /// The component it came from (`arm`, `hand`, ...).
    pub component: String,
    /// Mass properties; `None` where the file has no `<inertial>`.
    pub inertial: Option<Inertial>,
    /// Mass properties of an `<inertial>` that is not complete; `inertial` is `None` until the rest is computed from the shapes.
    pub partial_inertial: Option<PartialInertial>,
    /// What is seen.
    pub visuals: Vec<Visual>,
    /// What collides.
    pub collisions: Vec<Collision>,
    /// The joint whose child this link is; `None` for the root.
    pub parent_joint: Option<JointId>,
    /// Joints whose parent this link is, in file order.
    pub child_joints: Vec<JointId>,
    /// It is no body but a frame between two joints of one, as MJCF has them: without mass, shape or place of its own in
    /// MuJoCo, and no user is told of it.
    pub between_joints: bool,
}

/// Mass properties of a link as the file gives them.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Place of the declaration.
    pub source: Source,
    /// Pose of the centre-of-mass frame in the link frame.
    pub link_from_com: Pose,
    /// Mass \[kg\].
    pub mass: f64,
    /// Inertia tensor \[kg m²\] about the centre of mass, in the axes of the centre-of-mass frame.
    pub inertia: Matrix3<f64>,
}

/// Mass properties that a file gives in part. Several are `None`; a complete set is an [`Inertial`].
#[derive(Clone, Debug, PartialEq)]
pub struct PartialInertial {
    /// Place of the declaration.
    pub source: Source,
    /// Pose of the centre-of-mass frame in the link frame.
    pub link_from_com: Option<Pose>,
    /// Mass \[kg\].
    pub mass: Option<f64>,
    /// Density \[kg/m³\], an extension of Isaac Gym.
    pub density: Option<f64>,
    /// Inertia tensor \[kg m²\] about the centre of mass, in the axes of the centre-of-mass frame.
    pub inertia: Option<Matrix3<f64>>,
}

/// A shape that is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// Where it is described.
    pub source: Source,
    /// Pose of the shape in the link frame.
    pub link_from_shape: Pose,
    /// The shape.
    pub geometry: Geometry,
    /// Its look; `None` where the file gives none.
    pub material: Option<Material>,
}

/// A shape that collides.
#[derive(Clone, Debug, PartialEq)]
pub struct Collision {
    /// Where it is described.
    pub source: Source,
    /// Pose of the shape in the link frame.
    pub link_from_shape: Pose,
    /// The shape.
    pub geometry: Geometry,
}

/// Shapes of a URDF, with URDF's meaning of the numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Full edge lengths \[m\].
    Box {
        /// Edge lengths along x, y, z \[m\].
        size: Vector3<f64>,
    },
    /// Axis along z, centred.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Full length \[m\].
        length: f64,
    },
    /// Axis along z, centred.
    Capsule {
        /// Radius \[m\].
        radius: f64,
        /// Length of the cylindrical part \[m\].
        length: f64,
    },
    /// Centred.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// A file.
    Mesh {
        /// The URI as written.
        uri: String,
        /// The resolved file. For visuals it may not exist (a diagnostic says so).
        path: PathBuf,
        /// Scale per axis; negative values mirror.
        scale: Vector3<f64>,
    },
}

/// The look of a visual.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, if any.
    pub name: Option<String>,
    /// Linear rgba in 0..=1; `None` where the file gives no colour.
    pub rgba: Option<[f64; 4]>,
    /// Resolved texture file.
    pub texture: Option<PathBuf>,
}

/// A joint of the description.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique name.
    pub name: String,
    /// Where it is described.
    pub source: Source,
    /// How it moves.
    pub kind: JointKind,
    /// Parent link.
    pub parent: LinkId,
    /// Child link.
    pub child: LinkId,
    /// Pose of the joint frame (= child link frame at zero) in the parent link frame.
    pub parent_from_joint: Pose,
    /// Axis in the joint frame; x where the file gives none.
    pub axis: Unit<Vector3<f64>>,
    /// Limits; `None` where the file has no `<limit>`.
    pub limit: Option<JointLimit>,
    /// Passive viscous damping \[N m s/rad or N s/m\]; `None` where the file has none.
    pub damping: Option<f64>,
    /// Dry friction \[N m or N\]; `None` where the file has none.
    pub friction: Option<f64>,
    /// Coupling to another joint.
    pub mimic: Option<Mimic>,
    /// What the file says beyond URDF; `None` from a URDF.
    pub defaults: Option<JointDefaults>,
}

/// What an MJCF file says of a joint beyond what a URDF can say: it holds where the configuration says nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointDefaults {
    /// Rotor inertia \[kg m² or kg\].
    pub armature: f64,
    /// Position in which the file starts \[rad or m\].
    pub position: f64,
    /// How it is driven.
    pub drive: FileDrive,
}

/// How a file drives a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FileDrive {
    /// The file has no actuators at all.
    Unsaid,
    /// The file has actuators, and none of them acts on the joint.
    Passive,
    /// By an effort: the gains are not the file's.
    Effort,
    /// By actuators that follow positions or velocities.
    Servo {
        /// Stiffness \[N m/rad or N/m\].
        stiffness: f64,
        /// Damping \[N m s/rad or N s/m\].
        damping: f64,
    },
    /// A coupling that no mimic says decides where it is: nothing may drive it. `None` where no curve says where that is, since
    /// several couplings do, or they go in a circle.
    Coupled(Option<Curve>),
}

/// `position = start + Σ coefficients[k] (position(joint) - at)ᵏ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// The joint that is followed; `None` where the position is `start + coefficients[0]`.
    pub joint: Option<JointId>,
    /// Where the followed joint is at the start \[rad or m\].
    pub at: f64,
    /// Where the follower is at the start \[rad or m\].
    pub start: f64,
    /// Coefficients, the constant first.
    pub coefficients: [f64; 5],
}

impl Curve {
    /// The position \[rad or m\] where the followed joint is at `driver`.
    pub fn position(&self, driver: f64) -> f64 {
        let by = driver - self.at;
        self.start + self.coefficients.iter().rev().fold(0.0, |sum, c| sum * by + c)
    }
}

/// Joint types of URDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// No motion.
    Fixed,
    /// Rotation about the axis, limited.
    Revolute,
    /// Rotation about the axis, unlimited.
    Continuous,
    /// Translation along the axis, limited.
    Prismatic,
    /// Six degrees of freedom.
    Floating,
    /// Two translations in the plane normal to the axis and a rotation about it.
    Planar,
}

impl JointKind {
    /// The word URDF uses.
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

    /// One degree of freedom that a drive can act on.
    pub fn is_drivable(self) -> bool {
        matches!(self, Self::Revolute | Self::Continuous | Self::Prismatic)
    }
}

/// Limits of a joint as the file gives them: absent is not zero.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimit {
    /// Place of the declaration.
    pub source: Source,
    /// Lower position \[rad or m\].
    pub lower: Option<f64>,
    /// Upper position \[rad or m\].
    pub upper: Option<f64>,
    /// Largest effort \[N m or N\].
    pub effort: Option<f64>,
    /// Largest speed \[rad/s or m/s\]; reported, not enforced.
    pub velocity: Option<f64>,
}

/// `position = multiplier * position(joint) + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// Where it is given.
    pub source: Source,
    /// The joint that is followed, as the file says (it may itself follow another).
    pub joint: JointId,
    /// Ratio.
    pub multiplier: f64,
    /// Offset \[rad or m\].
    pub offset: f64,
}

impl Link {
    /// A link that has nothing yet.
    pub fn new(name: String, source: Source, component: String) -> Self {
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
            between_joints: false,
        }
    }
}

impl RobotDescription {
    /// The links that a user knows, indexed by [`LinkId`]: all but the frames between joints of one body.
    pub fn named_links(&self) -> &[Link] {
        let named = self.links.iter().position(|link| link.between_joints).unwrap_or(self.links.len());
        &self.links[..named]
    }

    /// The link called `name`, of those that a user knows.
    pub fn link_id(&self, name: &str) -> Option<LinkId> {
        self.named_links().iter().position(|l| l.name == name).map(LinkId)
    }

    /// The joint called `name`, fixed ones included.
    pub fn joint_id(&self, name: &str) -> Option<JointId> {
        self.joints.iter().position(|j| j.name == name).map(JointId)
    }

    /// The link.
    ///
    /// # Panics
    /// There is no such link: the id is of another description.
    #[track_caller]
    pub fn link(&self, id: LinkId) -> &Link {
        &self.links[id.0]
    }

    /// The joint.
    ///
    /// # Panics
    /// There is no such joint: the id is of another description.
    #[track_caller]
    pub fn joint(&self, id: JointId) -> &Joint {
        &self.joints[id.0]
    }

    /// Revolute, continuous and prismatic joints in file order, mimic ones included: the columns of `qpos`.
    pub fn drivable_joints(&self) -> impl Iterator<Item = (JointId, &Joint)> {
        self.joints.iter().enumerate().filter(|(_, j)| j.kind.is_drivable()).map(|(i, j)| (JointId(i), j))
    }

    /// Sum of the link masses \[kg\].
    pub fn total_mass(&self) -> f64 {
        self.links.iter().filter_map(|l| l.inertial.as_ref()).map(|i| i.mass).sum()
    }

    /// The joint at the end of a chain of mimic joints, with the composed ratio and offset:
    /// `position(id) = multiplier * position(driver) + offset`. For a joint that follows none: itself, 1, 0.
    ///
    /// Mimic chains are free of cycles by construction (`urdf::merge` refuses them, and `mjcf::robot_file` makes none).
    ///
    /// # Panics
    /// There is no such joint: the id is of another description.
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
