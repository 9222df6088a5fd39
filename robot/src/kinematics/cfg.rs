//! What is to be reached, by which joints, and how hard to try.

use super::KinematicsError;
use kinetoscope_scene::Pose;
use serde::{Deserialize, Serialize};

/// A frame of a robot, and the joints that are there to move it.
///
/// Where one is wanted a name does too: `"arm"` is the control part of that name, or else the link.
///
/// ```
/// use kinetoscope_scene::Pose;
/// use kinetoscope_robot::kinematics::Tip;
///
/// // 0.12 m in front of the flange, moved by the arm.
/// let tip = Tip::of_part("arm").at("ee_link").with_tcp(Pose::translation(0.0, 0.0, 0.12));
/// # let _ = tip;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip<'n> {
    /// The part or link that it ends.
    pub name: TipName<'n>,
    /// A link of that part to use instead of its last one.
    pub link: Option<&'n str>,
    /// Tool centre point in the frame of the link \[m\].
    pub tcp: Pose,
}

/// The name of a tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TipName<'n> {
    /// A control part: its last link.
    Part(&'n str),
    /// A link.
    Link(&'n str),
    /// A control part or, if no part has that name, a link.
    Either(&'n str),
}

impl<'n> Tip<'n> {
    /// The end of a control part, moved by the joints of the part. It is the link that the last joint of the part moves,
    /// or the one that hangs on it by fixed joints: they are followed as long as there is exactly one, and inside one
    /// component of the URDF.
    pub fn of_part(part: &'n str) -> Self {
        Self { name: TipName::Part(part), link: None, tcp: Pose::identity() }
    }

    /// A link, fused ones too, moved by all joints of the robot.
    pub fn of_link(link: &'n str) -> Self {
        Self { name: TipName::Link(link), link: None, tcp: Pose::identity() }
    }

    /// The same joints, but this link, fused ones too.
    #[must_use]
    pub fn at(self, link: &'n str) -> Self {
        Self { link: Some(link), ..self }
    }

    /// The same link, but a frame on it: `link_from_frame`, the "tool centre point".
    #[must_use]
    pub fn with_tcp(self, link_from_frame: Pose) -> Self {
        Self { tcp: link_from_frame, ..self }
    }
}

impl<'n> From<&'n str> for Tip<'n> {
    fn from(name: &'n str) -> Self {
        Self { name: TipName::Either(name), link: None, tcp: Pose::identity() }
    }
}

/// What of a pose is to be reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IkTask {
    /// Position and rotation.
    #[default]
    Pose,
    /// The position only; the frame may be turned in any way.
    Position,
}

/// Where joints are to be as far as the frame leaves them a choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Posture {
    /// Positions \[rad or m\], one for each column of the joints in question; those of mimic joints count for nothing.
    pub rest: Vec<f64>,
    /// Part of the way to go there in one step, above 0 to 1.
    #[serde(default = "whole")]
    pub gain: f64,
}

fn whole() -> f64 {
    1.0
}

impl Posture {
    /// The whole way.
    pub fn at(rest: impl Into<Vec<f64>>) -> Self {
        Self { rest: rest.into(), gain: whole() }
    }
}

/// How inverse kinematics are solved: see [`IkSolver`](super::IkSolver).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IkCfg {
    /// What is to be reached.
    pub task: IkTask,
    /// Distance from the target that is near enough \[m\].
    pub position_tolerance: f64,
    /// Angle to the target that is near enough \[rad\].
    pub rotation_tolerance: f64,
    /// Steps from each start, at least 1.
    pub max_iterations: u32,
    /// Damping at each start, in multiples of half the squared error; above 0. Small: bold first steps.
    pub damping: f64,
    /// Starts, at least 1: the first from the initial positions, all others from random ones.
    pub num_seeds: u32,
    /// Seed of the random starts. The same target from the same initial positions gives the same bits, in any batch.
    pub seed: u64,
    /// What to do with joints that the target leaves free.
    pub posture: Option<Posture>,
}

impl Default for IkCfg {
    fn default() -> Self {
        Self {
            task: IkTask::Pose,
            position_tolerance: 1e-4,
            rotation_tolerance: 1e-3,
            max_iterations: 60,
            damping: 0.1,
            num_seeds: 64,
            seed: 0,
            posture: None,
        }
    }
}

/// Rooms for random starts are made at once.
const MOST_SEEDS: u32 = 100_000;

impl IkCfg {
    /// Checks every number; `joints` is the number of columns.
    ///
    /// # Errors
    /// A number is out of its range.
    pub fn validate(&self, joints: usize) -> Result<(), KinematicsError> {
        let check = |right: bool, field, value: &dyn std::fmt::Debug, expected| {
            if right {
                Ok(())
            } else {
                Err(KinematicsError::OutOfRange { field, value: format!("{value:?}"), expected })
            }
        };
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let above_zero = "it must be finite and above 0";
        check(positive(self.position_tolerance), "position_tolerance", &self.position_tolerance, above_zero)?;
        check(positive(self.rotation_tolerance), "rotation_tolerance", &self.rotation_tolerance, above_zero)?;
        check(positive(self.damping), "damping", &self.damping, above_zero)?;
        check(self.max_iterations > 0, "max_iterations", &self.max_iterations, "there must be at least 1")?;
        let seeds = (1..=MOST_SEEDS).contains(&self.num_seeds);
        check(seeds, "num_seeds", &self.num_seeds, "it must be from 1 to 100000")?;
        let Some(Posture { rest, gain }) = &self.posture else { return Ok(()) };
        if rest.len() != joints {
            return Err(KinematicsError::WrongLength { what: "posture.rest", expected: joints, found: rest.len() });
        }
        if rest.iter().any(|x| !x.is_finite()) {
            return Err(KinematicsError::NotFinite { what: "posture.rest" });
        }
        check(*gain > 0.0 && *gain <= 1.0, "posture.gain", gain, "it must be above 0 and at most 1")
    }
}
