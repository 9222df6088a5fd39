//! Target frames and solver settings of inverse kinematics.

use super::KinematicsError;
use kinetoscope_scene::Pose;
use serde::{Deserialize, Serialize};

/// Frame of a robot, such as a tool center point, and the joints that inverse kinematics may move.
///
/// A name converts to a tip: `"arm"` is the control part of that name or, if there is no such part, the link.
///
/// ```
/// use kinetoscope_scene::Pose;
/// use kinetoscope_robot::kinematics::TipFrame;
///
/// // 0.12 m in front of the flange, moved by the arm.
/// let tip = TipFrame::of_part("arm").at("ee_link").with_tcp(Pose::translation(0.0, 0.0, 0.12));
/// # let _ = tip;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipFrame<'n> {
    /// Control part or link that selects the joints and, unless [`link`](Self::link) is set, the link.
    pub name: TipSelector<'n>,
    /// Link that the frame is fixed to; `None` for the link that [`name`](Self::name) selects.
    pub link: Option<&'n str>,
    /// Pose of the tool center point in the frame of the link \[m\].
    pub tcp: Pose,
}

/// Name that selects the link and the joints of a [`TipFrame`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TipSelector<'n> {
    /// Control part: selects its joints and its last link.
    Part(&'n str),
    /// Link: selects this link and all joints of the robot.
    Link(&'n str),
    /// Control part or, if no part has this name, link.
    PartOrLink(&'n str),
}

impl<'n> TipFrame<'n> {
    /// Selects the last link of a control part, moved by the joints of the part. A part that ends in several links is
    /// an error when the frame is used.
    ///
    /// The link is the child of the last joint of the part. Fixed joints below that child are followed while there is
    /// exactly one of them, within one component of the URDF.
    pub fn of_part(part: &'n str) -> Self {
        Self { name: TipSelector::Part(part), link: None, tcp: Pose::identity() }
    }

    /// Selects a link, moved by all joints of the robot. Links that are fused into their parent are allowed.
    pub fn of_link(link: &'n str) -> Self {
        Self { name: TipSelector::Link(link), link: None, tcp: Pose::identity() }
    }

    /// Selects another link for the same joints. Links that are fused into their parent are allowed.
    #[must_use]
    pub fn at(self, link: &'n str) -> Self {
        Self { link: Some(link), ..self }
    }

    /// Sets the tool center point: its pose in the frame of the link \[m\].
    #[must_use]
    pub fn with_tcp(self, link_from_frame: Pose) -> Self {
        Self { tcp: link_from_frame, ..self }
    }
}

impl<'n> From<&'n str> for TipFrame<'n> {
    fn from(name: &'n str) -> Self {
        Self { name: TipSelector::PartOrLink(name), link: None, tcp: Pose::identity() }
    }
}

/// Part of a target pose to reach.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IkTask {
    /// Position and rotation.
    #[default]
    Pose,
    /// Position only; the rotation of the frame is free.
    Position,
}

/// Preferred joint positions, for joints that the target leaves free (null-space posture).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NullSpacePosture {
    /// Preferred positions \[rad or m\]: one for each joint of the tip's control part, in the order of the part, or for
    /// each joint of the robot if the tip is a link. For an [`IkSolver`](super::IkSolver), one for each variable of its
    /// chain. Entries of mimic joints are ignored.
    pub rest: Vec<f64>,
    /// Fraction of the remaining distance to the posture that one step covers, above 0 and at most 1.
    #[serde(default = "default_gain")]
    pub gain: f64,
}

fn default_gain() -> f64 {
    1.0
}

impl NullSpacePosture {
    /// Creates a posture with gain 1.
    pub fn at(rest: impl Into<Vec<f64>>) -> Self {
        Self { rest: rest.into(), gain: default_gain() }
    }
}

/// Settings of an inverse-kinematics solver; see [`IkSolver`](super::IkSolver).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IkCfg {
    /// Part of the target pose to reach.
    pub task: IkTask,
    /// Largest position error at which the target counts as reached \[m\], above 0.
    pub position_tolerance: f64,
    /// Largest angle to the target at which the target counts as reached \[rad\], above 0; unused with
    /// [`IkTask::Position`].
    pub rotation_tolerance: f64,
    /// Maximum number of steps from each start, at least 1. The refinement of the result takes further steps.
    pub max_iterations: u32,
    /// Initial damping of each start, in multiples of half the squared error; above 0. Small values give large first
    /// steps.
    pub damping: f64,
    /// Maximum number of starts, 1 to 100000. The first starts at the initial positions, all others at random
    /// positions. The search ends at the first start that reaches the target.
    pub num_seeds: u32,
    /// Seed of the random starts. The same target and initial positions give bit-identical results in any batch.
    pub seed: u64,
    /// Preferred posture of joints that the target leaves free, approached after the target is reached. `None` keeps
    /// them where the solver finds them.
    pub posture: Option<NullSpacePosture>,
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

/// Upper bound of `num_seeds`: memory for all random starts is allocated at once.
const MAX_SEEDS: u32 = 100_000;

impl IkCfg {
    /// Checks every number. `joints` is the expected length of [`NullSpacePosture::rest`].
    ///
    /// # Errors
    /// A number is out of its range, or the posture has another length or a value that is not finite.
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
        let seeds = (1..=MAX_SEEDS).contains(&self.num_seeds);
        check(seeds, "num_seeds", &self.num_seeds, "it must be from 1 to 100000")?;
        let Some(NullSpacePosture { rest, gain }) = &self.posture else { return Ok(()) };
        if rest.len() != joints {
            return Err(KinematicsError::WrongLength { what: "posture.rest", expected: joints, found: rest.len() });
        }
        if rest.iter().any(|x| !x.is_finite()) {
            return Err(KinematicsError::NotFinite { what: "posture.rest" });
        }
        check(*gain > 0.0 && *gain <= 1.0, "posture.gain", gain, "it must be above 0 and at most 1")
    }
}
