//! What may differ between environments: one list.

use serde::{Deserialize, Serialize};

/// A property of the model that an environment may have for itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Property {
    /// Mass of a link or object \[kg\], 1 number. Setting it scales the moments of inertia in the same proportion, from
    /// their nominal ones, as another density would. What is computed from the files stays nominal: `mass` and `total_mass`,
    /// the inertias behind the gains of [`DriveType::Acceleration`](crate::DriveType), and
    /// [`dynamics`](kinetoscope_robot::dynamics) of a description.
    Mass,
    /// Centre of mass in the link's (object's) own frame \[m\], 3 numbers. With MuJoCo 4.x not of a body of an MJCF
    /// file that moves freely and is nominally centred: see [`RandomizationError::DiagonalInertia`](super::RandomizationError).
    CenterOfMass,
    /// Principal moments of inertia about the centre of mass \[kg m²\], 3 numbers; the axes stay.
    Inertia,
    /// Sliding friction of the shapes of a link, an object, a terrain or the ground, 1 number. MuJoCo takes the larger of
    /// the two that touch: for a slippery object the ground must be slippery, too.
    Friction,
    /// Torsional friction of shapes \[m\], 1 number.
    TorsionalFriction,
    /// Rolling friction of shapes \[m\], 1 number.
    RollingFriction,
    /// Viscous damping of a joint \[N m s/rad or N s/m\], 1 number.
    JointDamping,
    /// Rotor inertia of a joint \[kg m² or kg\], 1 number.
    Armature,
    /// Dry friction of a joint \[N m or N\], 1 number. A joint whose implicit drive takes the place of it has some only where
    /// [`DriveCfg::friction`](crate::DriveCfg::friction) or its file said so: 0 there makes room for more.
    DryFriction,
    /// Gravity \[m/s²\], 3 numbers; the name is `gravity`. An [`Imu`](kinetoscope_sensors::Imu) still adds the nominal one, unless its
    /// `gravity_bias` says otherwise.
    Gravity,
    /// Proportional gain of an implicit drive \[N m/rad or N/m\], 1 number; the name is the joint's.
    Stiffness,
    /// Derivative gain of an implicit drive \[N m s/rad or N s/m\], 1 number.
    DriveDamping,
    /// Largest effort of an implicit drive \[N m or N\], 1 number, which may be infinite.
    MaxEffort,
    /// Sizes of a shape of a link or object \[m\], 3 numbers as MuJoCo has them: half lengths of a box, radii of an
    /// ellipsoid; radius, half length of a cylinder and of the straight part of a capsule; radius of a ball. Numbers that a
    /// shape does not have are 0 and stay 0. Cameras, ray casters and contacts have them alike. A body with several shapes has
    /// them scaled by one factor where that is drawn, each about its own middle, which stays.
    ///
    /// Meshes, planes and height fields have no size of their own in an environment; where a body has other shapes, too,
    /// they stay as they are. MuJoCo keeps the vertices of a mesh, and the heights of a field, once for all that is made of
    /// them, with what its compiler derived from them; and a plane touches things everywhere, whatever its size. To ask for
    /// the size of what has no other shape is
    /// [`RandomizationError::Unsized`](super::RandomizationError::Unsized), which says what to do instead.
    ///
    /// Mass, centre of mass and moments stay: they are properties of their own. So do the sizes of sites: a touch sensor of an
    /// MJCF file feels contacts in its nominal volume. Frames of links and joints stay where they are, so that
    /// [`compute_fk`](crate::Robot::compute_fk) and [`compute_ik`](crate::Robot::compute_ik) are right in every environment;
    /// the tip of a link that became longer is where [`Tip::with_tcp`](kinetoscope_robot::kinematics::Tip::with_tcp) says.
    Size,
    /// Colour and opacity of what is seen of a link, an object or a terrain, 4 numbers from 0 to 1 for the screen (sRGB);
    /// it multiplies a texture, and goes over what a material or a mesh file says, for all parts of a mesh. Nominally what
    /// MuJoCo has: the grey 0.5 where a mesh file brings its own colours, which come back with it.
    Color,
    /// Where a static object stands in the environment \[m\], 3 numbers.
    Position,
    /// How a static object is turned: a quaternion w, x, y, z of length 1, 4 numbers. It is to be set, rather than drawn.
    Rotation,
    /// Force against the velocity of the frame of an object, or of another body that moves freely \[N s/m\], 1 number.
    LinearDamping,
    /// Torque against its angular velocity \[N m s/rad\], 1 number.
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

    /// How many numbers it is.
    pub fn width(self) -> usize {
        match self {
            Self::CenterOfMass | Self::Inertia | Self::Gravity | Self::Size | Self::Position => 3,
            Self::Color | Self::Rotation => Self::WIDEST,
            _ => 1,
        }
    }

    /// No property has more numbers.
    pub(super) const WIDEST: usize = 4;

    /// Whose property it is, as messages say it.
    pub(super) fn owner(self) -> &'static str {
        match self {
            Self::Mass | Self::CenterOfMass | Self::Inertia => "body that moves and is called",
            Self::Friction | Self::TorsionalFriction | Self::RollingFriction => "body or ground that collides, called",
            Self::JointDamping | Self::Armature => "joint called",
            Self::DryFriction => {
                "joint that can have dry friction (a robot's drive.friction makes room for it, 0 will do) called"
            }
            Self::Gravity => "gravity called",
            Self::Stiffness | Self::DriveDamping | Self::MaxEffort => "joint with an implicit drive called",
            Self::Size => "body with a box, ball, capsule, cylinder or ellipsoid called",
            Self::Color => "body or terrain called",
            Self::Position | Self::Rotation => "static object called",
            Self::LinearDamping | Self::AngularDamping => "body that moves freely and is called",
        }
    }

    /// Whether it is kept with the environment's drives, not with its model.
    pub(super) fn is_gain(self) -> bool {
        self.gain().is_some()
    }

    /// Its number among proportional gain, derivative gain and effort limit.
    pub(crate) fn gain(self) -> Option<usize> {
        [Self::Stiffness, Self::DriveDamping, Self::MaxEffort].iter().position(|gain| *gain == self)
    }

    /// What a value must be, where this one is not; of a size, numbers that are nominally 0 are none.
    pub(crate) fn fault(self, values: &[f64], nominal: &[f64]) -> Option<&'static str> {
        let all = |good: fn(f64) -> bool| values.iter().all(|&value| good(value));
        match self {
            Self::Mass => {
                // MuJoCo's mjMINVAL, below which a body that moves is refused by its compiler.
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
                (!values.iter().zip(nominal).all(good)).then_some("every size must be 1e-6 to 1e6 metres")
            }
            Self::Color => {
                (!all(|x| (0.0..=1.0).contains(&x))).then_some("each of red, green, blue and opacity must be 0 to 1")
            }
            Self::Rotation => {
                let length = values.iter().map(|x| x * x).sum::<f64>().sqrt();
                let good = (length - 1.0).abs() <= 1e-6;
                (!good).then_some("it must be a quaternion w, x, y, z of length 1")
            }
            Self::CenterOfMass | Self::Gravity | Self::Position => {
                (!all(f64::is_finite)).then_some("every number must be finite")
            }
            Self::MaxEffort => (!all(|x| x >= 0.0)).then_some("it must be a number >= 0; infinity is no limit"),
            _ => (!all(|x| x.is_finite() && x >= 0.0)).then_some("it must be a finite number >= 0"),
        }
    }
}
