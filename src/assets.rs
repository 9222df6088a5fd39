//! Bundled robots: their files, and configurations that can be added to a simulation directly.
//!
//! ```
//! use kinetoscope::prelude::*;
//!
//! let mut sim = SimulationManager::new(SimulationManagerCfg::legged())?;
//! let robot = sim.add_robot(RobotCfg { uid: "scout".into(), ..assets::quadruped()? })?;
//! assert_eq!(sim.robot(robot).dof(), 12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use kinetoscope_robot::urdf::{ComponentCfg, UrdfCfg};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::from_xyz_rpy;
use kinetoscope_sim::{DriveCfg, RobotCfg};
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Error of [`path`] and of the functions for robots: an asset was not found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssetNotFound {
    /// Requested path.
    pub asset: PathBuf,
    /// All paths that were tried.
    pub tried: Vec<PathBuf>,
}

impl std::fmt::Display for AssetNotFound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "asset {} was not found; tried ", self.asset.display())?;
        for (i, place) in self.tried.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{}", place.display())?;
        }
        write!(f, "; set KINETOSCOPE_ASSETS to the folder that contains it")
    }
}

impl std::error::Error for AssetNotFound {}

/// Returns the path of an asset such as `sr5/SR5.urdf`.
///
/// An absolute path that exists is returned unchanged. Other paths are looked up below the folder `KINETOSCOPE_ASSETS`,
/// then below the folder of [`set_folder`], then below the folder that comes with this crate, unless it is built with the
/// feature `relocated-assets`.
///
/// # Errors
/// The asset is in none of these places; the error lists them.
pub fn path(asset: impl AsRef<Path>) -> Result<PathBuf, AssetNotFound> {
    resolve(asset.as_ref(), std::env::var_os("KINETOSCOPE_ASSETS").map(PathBuf::from), INSTALLED.get().cloned())
}

/// Folder of assets that a program installs with itself.
static INSTALLED: OnceLock<PathBuf> = OnceLock::new();

/// Names the folder of assets of an installed program, where assets are looked up before the folder of this crate. The
/// first call counts: returns false if another folder was named before.
pub fn set_folder(folder: impl Into<PathBuf>) -> bool {
    let folder = folder.into();
    *INSTALLED.get_or_init(|| folder.clone()) == folder
}

/// Quadruped with a free base, standing with bent knees, its base 0.6 m above the origin; drives of 80 N m/rad and 5 N
/// m s/rad. Uid `quadruped`.
///
/// The initial pose is that of Isaac Lab's `ANYMAL_C_CFG`.
///
/// # Errors
/// The asset is missing.
pub fn quadruped() -> Result<RobotCfg, AssetNotFound> {
    let standing = [(".*HAA", 0.0), (".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)];
    Ok(RobotCfg {
        uid: "quadruped".into(),
        urdf: UrdfCfg::single(path("quadruped/quadruped.urdf")?),
        fix_base: false,
        init_pose: Pose::translation(0.0, 0.0, 0.6),
        init_qpos: standing.map(|(joints, angle)| (joints.to_string(), angle)).to_vec(),
        drive: DriveCfg { stiffness: 80.0.into(), damping: 5.0.into(), ..Default::default() },
        ..Default::default()
    })
}

/// SR5 arm with the control part `arm`; drives of 10⁴ N m/rad and 10³ N m s/rad. Uid `sr5`.
///
/// # Errors
/// The asset is missing.
pub fn sr5() -> Result<RobotCfg, AssetNotFound> {
    Ok(RobotCfg {
        uid: "sr5".into(),
        urdf: UrdfCfg::single(path("sr5/SR5.urdf")?),
        control_parts: vec![("arm".into(), vec![ARM.into()])],
        drive: DriveCfg { stiffness: [(ARM, 1e4)].into(), damping: [(ARM, 1e3)].into(), ..Default::default() },
        ..Default::default()
    })
}

/// Left hand with the control part `hand`; drives of 10³ N m/rad and 10² N m s/rad. Uid `revo1_left`.
///
/// # Errors
/// The asset is missing.
pub fn revo1_left() -> Result<RobotCfg, AssetNotFound> {
    Ok(RobotCfg {
        uid: "revo1_left".into(),
        urdf: UrdfCfg::single(path("revo1_left/revo1_left.urdf")?),
        control_parts: vec![("hand".into(), vec![HAND.into()])],
        drive: DriveCfg { stiffness: [(HAND, 1e3)].into(), damping: [(HAND, 1e2)].into(), ..Default::default() },
        ..Default::default()
    })
}

/// SR5 arm with the left hand on its flange, with the control parts and drives of both. Uid `sr5_with_brainco`.
///
/// This is the robot of EmbodiChain's tutorials.
///
/// # Errors
/// An asset is missing.
pub fn sr5_with_hand() -> Result<RobotCfg, AssetNotFound> {
    let (arm, hand) = (sr5()?, revo1_left()?);
    let on_flange = from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]);
    let components = vec![
        ComponentCfg::new("arm", path("sr5/SR5.urdf")?),
        ComponentCfg { transform: on_flange, ..ComponentCfg::new("hand", path("revo1_left/revo1_left.urdf")?) },
    ];
    Ok(RobotCfg {
        uid: "sr5_with_brainco".into(),
        urdf: UrdfCfg { components, ..Default::default() },
        control_parts: arm.control_parts.into_iter().chain(hand.control_parts).collect(),
        drive: DriveCfg {
            stiffness: [(ARM, 1e4), (HAND, 1e3)].into(),
            damping: [(ARM, 1e3), (HAND, 1e2)].into(),
            ..Default::default()
        },
        ..Default::default()
    })
}

/// Pattern of the arm's joints.
const ARM: &str = "JOINT[1-6]";
/// Pattern of the hand's joints.
const HAND: &str = "LEFT_.*";

/// Folder of the assets of this crate; `None` with the feature `relocated-assets`: a program for other machines must
/// not contain the path of the machine that builds it.
fn shipped() -> Option<PathBuf> {
    #[cfg(feature = "relocated-assets")]
    return None;
    #[cfg(not(feature = "relocated-assets"))]
    Some(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets"))
}

fn resolve(asset: &Path, own: Option<PathBuf>, installed: Option<PathBuf>) -> Result<PathBuf, AssetNotFound> {
    let tried: Vec<PathBuf> = if asset.is_absolute() {
        vec![asset.to_path_buf()]
    } else {
        own.into_iter().chain(installed).chain(shipped()).map(|folder| folder.join(asset)).collect()
    };
    match tried.iter().find(|place| place.exists()) {
        Some(place) => Ok(place.clone()),
        None => Err(AssetNotFound { asset: asset.to_path_buf(), tried }),
    }
}
