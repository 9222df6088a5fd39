//! List of the properties that can differ between environments.

use serde::{Deserialize, Serialize};

/// Property of the model that can differ between environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Property {
    /// Mass of a link or object that can move \[kg\], 1 number. Setting it replaces the moments of inertia by the
    /// nominal ones scaled in proportion, as another density would. Values computed from the files stay nominal:
    /// `total_mass` and `nominal_mass`, the inertias behind the gains of [`crate::DriveType`](crate::DriveType), and
    /// [`dynamics`](kinetoscope_robot::dynamics) of a description.
    Mass,
    /// Center of mass in the link's (object's) own frame \[m\], 3 numbers. MuJoCo 4.x does not support it for a freely
    /// moving body of an MJCF file that is nominally centered: see
    /// [`super::RandomizationError`](super::RandomizationError).
    CenterOfMass,
    /// Principal moments of inertia about the center of mass \[kg m²\], 3 numbers; the axes stay.
    Inertia,
    /// Sliding friction of the shapes of a link, an object, a terrain or the ground, 1 number. In a contact, MuJoCo
    /// takes the larger value of the two surfaces: a slippery object needs a slippery ground, too.
    Friction,
    /// Torsional friction of shapes \[m\], 1 number.
    TorsionalFriction,
    /// Rolling friction of shapes \[m\], 1 number.
    RollingFriction,
    /// Viscous damping of a joint \[N m s/rad or N s/m\], 1 number.
    JointDamping,
    /// Rotor inertia of a joint \[kg m² or kg\], 1 number.
    Armature,
    /// Dry friction of a joint \[N m or N\], 1 number. A joint with an implicit drive has dry friction only if
    /// [`DriveCfg::friction`](crate::DriveCfg::friction) or its file sets a value; 0 in the configuration is enough.
    DryFriction,
    /// Gravity \[m/s²\], 3 numbers; the name is `gravity`. An [`Imu`](kinetoscope_sensors::Imu) still adds the nominal
    /// gravity, unless its `gravity_bias` gives another.
    Gravity,
    /// Proportional gain of a drive, 1 number \[N m/rad or N/m\], in these units for every
    /// [`DriveType`](crate::DriveType); the name is that of the joint. Drives of
    /// [`DriveModel::Actuator`](crate::DriveModel::Actuator) do not have the properties of gains and limits.
    Stiffness,
    /// Derivative gain of a drive, 1 number \[N m s/rad or N s/m\], in these units for every drive type.
    DriveDamping,
    /// Largest effort of a drive \[N m or N\], 1 number, which may be infinite.
    MaxEffort,
    /// Sizes of a shape of a link or object \[m\], 3 numbers as in MuJoCo: half lengths of a box, radii of an
    /// ellipsoid; radius and half length of a cylinder, and of the straight part of a capsule; radius of a sphere.
    /// Numbers that a shape does not have are 0 and stay 0. Cameras, ray casters and contacts use the same sizes. A
    /// random factor scales all shapes of a body alike, each about its own center, which stays.
    ///
    /// Meshes, planes and height fields have no size of their own in an environment; in a body with other shapes they
    /// stay as they are. MuJoCo stores the vertices of a mesh and the heights of a field once for all uses, with the
    /// values that its compiler derives from them. A plane collides everywhere, whatever its size. A size for a body
    /// without any other shape is the error
    /// [`RandomizationError::NoSizeProperty`](super::RandomizationError::NoSizeProperty), which suggests alternatives.
    ///
    /// Mass, center of mass and moments stay: they are properties of their own. Sizes of sites stay too: a touch sensor
    /// of an MJCF file measures contacts in its nominal volume. Frames of links and joints stay in place, so that
    /// [`compute_fk`](crate::Robot::compute_fk) and [`compute_ik`](crate::Robot::compute_ik) are valid in every
    /// environment. Use [`TipFrame::with_tcp`](kinetoscope_robot::kinematics::TipFrame::with_tcp) for the tip of a link
    /// that became longer.
    Size,
    /// Color and opacity of the visible shapes of a link, an object or a terrain, not of the ground: 4 sRGB numbers
    /// from 0 to 1. It multiplies a texture, and overrides the colors of materials and mesh files, for all parts of a
    /// mesh. The nominal color is MuJoCo's, which is gray 0.5 for a mesh file with colors of its own. Setting the
    /// nominal color restores the colors of the file.
    Color,
    /// Position of a static object in the environment \[m\], 3 numbers.
    Position,
    /// Rotation of a static object: a quaternion w, x, y, z of length 1, 4 numbers. It is meant to be set rather than
    /// randomized.
    Rotation,
    /// Linear damping of an object, or of another freely moving body \[N s/m\], 1 number: a force against the velocity
    /// of its frame.
    LinearDamping,
    /// Angular damping of such a body \[N m s/rad\], 1 number: a torque against its angular velocity.
    AngularDamping,
}

impl Property {
    /// All properties.
    pub const ALL: [Self; 19] = [
        Self::Mass,
        Self::CenterOfMass,
        Self::Inertia,
        Self::Friction,
        Self::TorsionalFriction,
        Self::RollingFriction,
        Self::JointDamping,
        Self::Armature,
        Self::DryFriction,
        Self::Gravity,
        Self::Stiffness,
        Self::DriveDamping,
        Self::MaxEffort,
        Self::Size,
        Self::Color,
        Self::Position,
        Self::Rotation,
        Self::LinearDamping,
        Self::AngularDamping,
    ];

    /// Name in configuration files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mass => "mass",
            Self::CenterOfMass => "center_of_mass",
            Self::Inertia => "inertia",
            Self::Friction => "friction",
            Self::TorsionalFriction => "torsional_friction",
            Self::RollingFriction => "rolling_friction",
            Self::JointDamping => "joint_damping",
            Self::Armature => "armature",
            Self::DryFriction => "dry_friction",
            Self::Gravity => "gravity",
            Self::Stiffness => "stiffness",
            Self::DriveDamping => "drive_damping",
            Self::MaxEffort => "max_effort",
            Self::Size => "size",
            Self::Color => "color",
            Self::Position => "position",
            Self::Rotation => "rotation",
            Self::LinearDamping => "linear_damping",
            Self::AngularDamping => "angular_damping",
        }
    }

    /// Number of values of the property for one element: 1, 3 or 4.
    pub fn width(self) -> usize {
        match self {
            Self::CenterOfMass | Self::Inertia | Self::Gravity | Self::Size | Self::Position => 3,
            Self::Color | Self::Rotation => Self::MAX_WIDTH,
            _ => 1,
        }
    }

    /// Largest number of values of any property.
    pub(super) const MAX_WIDTH: usize = 4;

    /// Description of the elements that have the property, for messages.
    pub(super) fn element_description(self) -> &'static str {
        match self {
            Self::Mass | Self::CenterOfMass | Self::Inertia => "moving body",
            Self::Friction | Self::TorsionalFriction | Self::RollingFriction => "colliding body or ground",
            Self::JointDamping | Self::Armature => "joint",
            Self::DryFriction => {
                "joint with dry friction (a robot's joints have it if drive.friction is set; 0 is enough)"
            }
            Self::Gravity => "gravity entry",
            Self::Stiffness | Self::DriveDamping | Self::MaxEffort => {
                "joint with an implicit or explicit drive (not DriveModel::Actuator)"
            }
            Self::Size => "body with a box, sphere, capsule, cylinder or ellipsoid",
            Self::Color => "body or terrain",
            Self::Position | Self::Rotation => "static object",
            Self::LinearDamping | Self::AngularDamping => "body with a free joint",
        }
    }

    /// True for a property that is stored with the environment's drives instead of its model.
    pub(super) fn is_gain(self) -> bool {
        self.gain().is_some()
    }

    /// Index among proportional gain, derivative gain and effort limit; `None` for other properties.
    pub(crate) fn gain(self) -> Option<usize> {
        [Self::Stiffness, Self::DriveDamping, Self::MaxEffort].iter().position(|gain| *gain == self)
    }

    /// Describes the accepted values if these are invalid. A size that is nominally 0 may be 0.
    pub(crate) fn invalid_reason(self, values: &[f64], nominal: &[f64]) -> Option<&'static str> {
        let all = |good: fn(f64) -> bool| values.iter().all(|&value| good(value));
        match self {
            Self::Mass => {
                // MuJoCo's mjMINVAL: its compiler rejects a moving body with less mass.
                (!all(|m| m.is_finite() && m >= 1e-15)).then_some("a mass must be finite and at least 1e-15 kg")
            }
            Self::Inertia => {
                let largest = values.iter().copied().fold(0.0, f64::max);
                let sum: f64 = values.iter().sum();
                let good = all(|i| i.is_finite() && i >= 1e-15) && 2.0 * largest <= sum * (1.0 + 1e-6);
                (!good).then_some("moments of inertia must be positive, and none larger than the sum of the others")
            }
            Self::Size => {
                let good = |(x, nominal): (&f64, &f64)| (1e-6..=1e6).contains(x) || (*nominal == 0.0 && *x == 0.0);
                (!values.iter().zip(nominal).all(good)).then_some("every size must be 1e-6 to 1e6 m")
            }
            Self::Color => {
                (!all(|x| (0.0..=1.0).contains(&x))).then_some("each of red, green, blue and opacity must be 0 to 1")
            }
            Self::Rotation => {
                let length = values.iter().map(|x| x * x).sum::<f64>().sqrt();
                let good = (length - 1.0).abs() <= 1e-6;
                (!good).then_some("it must be a unit quaternion w, x, y, z")
            }
            Self::CenterOfMass | Self::Gravity | Self::Position => {
                (!all(f64::is_finite)).then_some("every number must be finite")
            }
            Self::MaxEffort => (!all(|x| x >= 0.0)).then_some("it must be a number >= 0; infinity means no limit"),
            _ => (!all(|x| x.is_finite() && x >= 0.0)).then_some("it must be a finite number >= 0"),
        }
    }
}
