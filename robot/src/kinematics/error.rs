//! Errors of kinematics.

/// Error of a kinematics computation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum KinematicsError {
    /// A link does not exist.
    #[error("link {index} does not exist; there are {count}")]
    NoSuchLink {
        /// Index of the link in [`RobotDescription::links`](crate::description::RobotDescription::links).
        index: usize,
        /// Number of links of the robot.
        count: usize,
    },
    /// The links do not form a tree below the root.
    #[error("link {link:?} is not connected to the root by a chain of joints")]
    NotATree {
        /// Name of the link.
        link: String,
    },
    /// The base of a chain is not above its last link, or a floating or planar joint lies between them.
    #[error("link {base:?} is no base of a chain to link {link:?}; {}", bases_sentence(.above))]
    BaseNotAbove {
        /// Name of the base given.
        base: String,
        /// Name of the last link.
        link: String,
        /// Links above the last link that can be the base, the nearest first.
        above: Vec<String>,
    },
    /// A control part ends in several links, so its last link is ambiguous.
    #[error("control part {part:?} has several end links: {}; select one with TipFrame", quoted(.links))]
    AmbiguousTip {
        /// Name of the part.
        part: String,
        /// Last links of its branches.
        links: Vec<String>,
    },
    /// No joint of the control part (or of the robot) moves the link.
    #[error("no joint of {of} moves link {link:?}; {}", movers_sentence(.moving_joints))]
    NoMovingJoint {
        /// Owner of the joints: `control part "arm"`, `the robot`.
        of: String,
        /// Name of the link.
        link: String,
        /// Joints of the robot that move the link; drivers in place of their followers.
        moving_joints: Vec<String>,
    },
    /// A joint that moves the link follows a polynomial coupling, which inverse kinematics does not support.
    #[error(
        "joint {joint:?}, which moves link {link:?}, follows another joint by a nonlinear joint equality of its MJCF \
         file; inverse kinematics supports linear mimic joints only: select a link that this joint does not move, or a \
         control part that does not contain its leading joint"
    )]
    PolynomialCoupling {
        /// Name of the following joint.
        joint: String,
        /// Name of the link.
        link: String,
    },
    /// A number of a configuration is out of range.
    #[error("{field} is {value}; {expected}")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: String,
        /// Accepted values.
        expected: &'static str,
    },
    /// A list has the wrong length.
    #[error("{what}: expected {expected} numbers, one per joint; found {found}")]
    WrongLength {
        /// Name of the list.
        what: &'static str,
        /// Length that fits.
        expected: usize,
        /// Length of the list.
        found: usize,
    },
    /// A number is infinite or not a number.
    #[error("{what} must not contain NaN or infinity")]
    NotFinite {
        /// Name of the value.
        what: &'static str,
    },
}

fn quoted(names: &[String]) -> String {
    names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ")
}

/// Largest number of links in the message of a wrong base.
const MAX_BASES: usize = 12;

fn bases_sentence(above: &[String]) -> String {
    match above.len() {
        0 => "no other link is above it".into(),
        count if count > MAX_BASES => format!("nearest of {count} links above it: {}", quoted(&above[..MAX_BASES])),
        _ => format!("links above it: {}", quoted(above)),
    }
}

fn movers_sentence(movers: &[String]) -> String {
    if movers.is_empty() {
        "the link is fixed to the base".into()
    } else {
        format!("joints that move it: {}", quoted(movers))
    }
}
