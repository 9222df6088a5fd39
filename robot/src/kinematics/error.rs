//! Why kinematics cannot be computed.

/// Why kinematics cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum KinematicsError {
    /// No such link.
    #[error("link {index} does not exist; there are {count}")]
    NoSuchLink {
        /// The number given.
        index: usize,
        /// How many links there are.
        count: usize,
    },
    /// The links are not a tree below the root.
    #[error("link {link:?} is not connected to the root by a chain of joints")]
    NotATree {
        /// The link.
        link: String,
    },
    /// A control part does not end in one link.
    #[error("control part {part:?} ends in several links: {}; say which with Tip::at", quoted(.links))]
    SeveralTips {
        /// The part.
        part: String,
        /// The last links of its branches.
        links: Vec<String>,
    },
    /// No joint that may be moved moves the link.
    #[error("no joint of {of} moves link {link:?}; {}", movers_sentence(.movers))]
    NothingMoves {
        /// Whose joints: `control part "arm"`, `the robot`.
        of: String,
        /// The link.
        link: String,
        /// The joints of the robot that move it, those that others follow instead of the followers.
        movers: Vec<String>,
    },
    /// A joint that moves the link follows by a curve, which the search does not know.
    #[error(
        "joint {joint:?}, which moves link {link:?}, is held on a curve by an equality of its MJCF file; inverse kinematics \
         knows followers by a line only: name a link that it does not move, or a part whose joints it does not follow"
    )]
    CurveFollower {
        /// The follower.
        joint: String,
        /// The link.
        link: String,
    },
    /// A number of a configuration is out of range.
    #[error("{field} is {value}; {expected}")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// The value given.
        value: String,
        /// What would be right.
        expected: &'static str,
    },
    /// A list has the wrong length.
    #[error("{what} has {found} numbers, one for each of {expected} joints is needed")]
    WrongLength {
        /// The list.
        what: &'static str,
        /// The length that fits.
        expected: usize,
        /// The length found.
        found: usize,
    },
    /// A number is infinite or not a number.
    #[error("{what} has a number that is not finite")]
    NotFinite {
        /// Where.
        what: &'static str,
    },
}

fn quoted(names: &[String]) -> String {
    names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ")
}

fn movers_sentence(movers: &[String]) -> String {
    if movers.is_empty() { "it stands fixed".into() } else { format!("those that do are {}", quoted(movers)) }
}
