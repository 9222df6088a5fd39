//! The robot of the tutorials: an arm and a hand from two URDF files.

use super::{Result, user_or_asset};
use clap::Args;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sim::Robot;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// Files and joints of an arm with a hand.
#[derive(Clone, Debug, Args)]
pub(crate) struct ArmWithHand {
    /// One URDF or MJCF (.xml) file of an arm with its hand, instead of --arm-urdf and --hand-urdf
    #[arg(long, value_name = "FILE", conflicts_with_all = ["arm_urdf", "hand_urdf"])]
    robot: Option<PathBuf>,
    /// URDF of the arm
    #[arg(long, alias = "arm_urdf", default_value = "sr5/SR5.urdf")]
    arm_urdf: PathBuf,
    /// URDF of the hand
    #[arg(long, alias = "hand_urdf", default_value = "revo1_left/revo1_left.urdf")]
    hand_urdf: PathBuf,
    /// Joints of the arm: a regular expression that matches whole names
    #[arg(long, alias = "arm_joints", default_value = "JOINT[1-6]")]
    arm_joints: String,
    /// Joints of the hand: a regular expression that matches whole names
    #[arg(long, alias = "hand_joints", default_value = "LEFT_.*")]
    hand_joints: String,
}

impl ArmWithHand {
    /// The configuration of the robot with the tutorial's gains: arm and hand merged, the hand turned and moved onto
    /// the flange, or the single file of `--robot`.
    ///
    /// # Errors
    /// A file neither exists nor is a bundled asset.
    pub(crate) fn cfg(&self) -> Result<RobotCfg> {
        if let Some(file) = &self.robot {
            let file = user_or_asset(file)?;
            let cfg = driven(&self.arm_joints, &self.hand_joints);
            return Ok(if file.extension().is_some_and(|extension| extension == "xml") {
                RobotCfg { mjcf: Some(MjcfFile::new(file)), ..cfg }
            } else {
                RobotCfg { urdf: UrdfCfg::single(file), ..cfg }
            });
        }
        merged(&self.arm_urdf, &self.hand_urdf, &self.arm_joints, &self.hand_joints)
    }
}

fn merged(arm_urdf: &Path, hand_urdf: &Path, arm_joints: &str, hand_joints: &str) -> Result<RobotCfg> {
    let hand = ComponentCfg {
        transform: from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]),
        ..ComponentCfg::new("hand", user_or_asset(hand_urdf)?)
    };
    let components = vec![ComponentCfg::new("arm", user_or_asset(arm_urdf)?), hand];
    Ok(RobotCfg { urdf: UrdfCfg { components, ..Default::default() }, ..driven(arm_joints, hand_joints) })
}

/// A robot with the control parts `arm` and `hand` and the tutorial's gains.
fn driven(arm_joints: &str, hand_joints: &str) -> RobotCfg {
    RobotCfg {
        uid: "sr5_with_brainco".into(),
        control_parts: vec![("arm".into(), vec![arm_joints.into()]), ("hand".into(), vec![hand_joints.into()])],
        drive: DriveCfg {
            stiffness: [(arm_joints, 1e4), (hand_joints, 1e3)].into(),
            damping: [(arm_joints, 1e3), (hand_joints, 1e2)].into(),
            ..Default::default()
        },
        ..Default::default()
    }
}

/// The link that carries the hand, as `uid/link`; the root link if arm and hand come from one file.
pub(crate) fn tip(robot: Robot<'_>) -> String {
    let description = robot.description();
    let joins = |parent: &str, child: &str| parent == "arm" && child == "hand";
    let joint = description
        .joints
        .iter()
        .find(|j| joins(&description.link(j.parent).component, &description.link(j.child).component));
    let link = joint.map_or(description.root, |j| j.parent);
    format!("{}/{}", robot.uid(), description.link(link).name)
}
