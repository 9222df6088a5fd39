//! What may differ between environments: one list.

use serde::{Deserialize, Serialize};

/// A property of the model that an environment may have for itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Property {
    /// Mass of a link or object \[kg\], 1 number. Setting it scales the moments of inertia in the same proportion, from
    /// their nominal ones, as another density would.
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
    /// Viscous damping of a joint \[N m s/rad or N s/m\], 1 number; of joints that nominally have some.
    JointDamping,
    /// Rotor inertia of a joint \[kg m² or kg\], 1 number.
    Armature,
    /// Dry friction of a joint \[N m or N\], 1 number above 0; of joints that nominally have some.
    DryFriction,
    /// Gravity \[m/s²\], 3 numbers; the name is `gravity`. An [`Imu`](sensors::Imu) still adds the nominal one, unless its
    /// `gravity_bias` says otherwise.
    Gravity,
    /// Proportional gain of an implicit drive \[N m/rad or N/m\], 1 number; the name is the joint's.
    Stiffness,
    /// Derivative gain of an implicit drive \[N m s/rad or N s/m\], 1 number.
    DriveDamping,
    /// Largest effort of an implicit drive \[N m or N\], 1 number, which may be infinite.
    MaxEffort,
}

impl Property {
    /// All properties.
    pub const ALL: [Self; 13] = [
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
        }
    }

    /// How many numbers it is.
    pub fn width(self) -> usize {
        match self {
            Self::CenterOfMass | Self::Inertia | Self::Gravity => 3,
            _ => 1,
        }
    }

    /// Whose property it is, as messages say it.
    pub(super) fn owner(self) -> &'static str {
        match self {
            Self::Mass | Self::CenterOfMass | Self::Inertia => "body that moves and is called",
            Self::Friction | Self::TorsionalFriction | Self::RollingFriction => "body or ground that collides, called",
            Self::JointDamping => "joint with damping called",
            Self::Armature => "joint called",
            Self::DryFriction => "joint with dry friction called",
            Self::Gravity => "gravity called",
            Self::Stiffness | Self::DriveDamping | Self::MaxEffort => "joint with an implicit drive called",
        }
    }

    /// Whether it is kept with the environment's drives, not with its model.
    pub(super) fn is_gain(self) -> bool {
        matches!(self, Self::Stiffness | Self::DriveDamping | Self::MaxEffort)
    }

    /// What a value must be, where this one is not.
    pub(super) fn fault(self, values: &[f64]) -> Option<&'static str> {
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
            Self::DryFriction => (!all(|f| f.is_finite() && f > 0.0))
                .then_some("dry friction must be finite and above 0: it may be small"),
            Self::CenterOfMass | Self::Gravity => (!all(f64::is_finite)).then_some("every number must be finite"),
            Self::MaxEffort => (!all(|x| x >= 0.0)).then_some("it must be a number >= 0; infinity is no limit"),
            _ => (!all(|x| x.is_finite() && x >= 0.0)).then_some("it must be a finite number >= 0"),
        }
    }
}
