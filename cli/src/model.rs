//! Which model is meant: URDF files, or one MJCF file.

use crate::Result;
use kinetoscope::assets;
use kinetoscope::prelude::*;
use kinetoscope::sim::mjcf::robot_file::RobotFileError;
use std::path::{Path, PathBuf};

/// The files of a model.
#[derive(Debug, clap::Args)]
pub(crate) struct ModelArgs {
    /// URDF files, of which each further one hangs from the tip of the one before; or one MJCF file
    #[arg(required = true, value_name = "FILE.urdf|FILE.xml")]
    files: Vec<PathBuf>,
    /// Let the root of a robot move freely
    #[arg(long, alias = "floating_base")]
    pub(crate) floating_base: bool,
    /// Folder of a package of package:// addresses; may be repeated
    #[arg(long, value_name = "NAME=DIR", value_parser = package)]
    package: Vec<(String, PathBuf)>,
    /// Folder in which meshes and packages are searched that are not found from the URDF, as Isaac Gym's asset root
    #[arg(long, value_name = "DIR", value_parser = folder)]
    asset_root: Option<PathBuf>,
    /// Refuse URDF files with departures from the format that are otherwise warnings
    #[arg(long)]
    strict: bool,
}

/// What the files are.
pub(crate) enum Files {
    Urdf(UrdfCfg),
    Mjcf(PathBuf),
}

impl ModelArgs {
    /// What the files are, by their names.
    ///
    /// # Errors
    /// An MJCF file is not alone, or packages are named for one.
    pub(crate) fn files(&self) -> Result<Files> {
        let files: Vec<PathBuf> = self.files.iter().map(|file| user_or_asset(file)).collect();
        match files.iter().position(|file| file.extension().is_some_and(|e| e.eq_ignore_ascii_case("xml"))) {
            None => {
                let packages = self.package.iter().cloned().collect();
                let strictness = if self.strict { Strictness::Strict } else { Strictness::Lenient };
                let asset_root = self.asset_root.clone();
                Ok(Files::Urdf(UrdfCfg { packages, asset_root, strictness, ..UrdfCfg::chain(&files) }))
            }
            Some(0) if files.len() == 1 && !self.package.is_empty() => {
                let (file, name) = (files[0].display(), &self.package[0].0);
                Err(format!(
                    "--package {name}: {file} is an MJCF file, which has no package:// addresses; leave it out"
                )
                .into())
            }
            Some(0) if files.len() == 1 && (self.strict || self.asset_root.is_some()) => {
                let flag = if self.strict { "--strict" } else { "--asset-root" };
                Err(format!("{flag}: {} is an MJCF file, the flag is for URDF files; leave it out", files[0].display())
                    .into())
            }
            Some(0) if files.len() == 1 => Ok(Files::Mjcf(files[0].clone())),
            Some(at) => {
                let file = files[at].display();
                Err(format!("{file}: an MJCF file is a model of its own: give it alone, or URDF files only").into())
            }
        }
    }

    /// A simulation of the model as a robot, in each of some environments.
    ///
    /// # Errors
    /// Whatever is wrong in the files.
    pub(crate) fn simulation(&self, cfg: SimulationManagerCfg) -> Result<(SimulationManager, RobotId)> {
        let mut sim = SimulationManager::new(cfg)?;
        let mut robot = RobotCfg { uid: "robot".into(), fix_base: !self.floating_base, ..Default::default() };
        match self.files()? {
            Files::Urdf(urdf) => robot.urdf = urdf,
            Files::Mjcf(path) => robot.mjcf = Some(MjcfFile::new(path)),
        }
        let id = sim.add_robot(robot)?;
        Ok((sim, id))
    }

    /// A simulation of the model to be looked at: as [`simulation`](Self::simulation), but an MJCF file that is no robot
    /// (several bodies, balls, nothing that turns or slides) is there as it is, with what stands in its world, and no ground
    /// beside its own.
    ///
    /// # Errors
    /// Whatever is wrong in the files.
    pub(crate) fn scene(&self, cfg: SimulationManagerCfg) -> Result<SimulationManager> {
        let refused = match self.simulation(cfg.clone()) {
            Ok((sim, _)) => return Ok(sim),
            Err(refused) => refused,
        };
        let is_scene = matches!(refused.downcast_ref(), Some(Error::RobotFile { error, .. }) if is_scene(error));
        match self.files()? {
            Files::Mjcf(path) if is_scene => {
                let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..cfg })?;
                sim.add_mjcf(MjcfCfg::file("scene", path))?;
                Ok(sim)
            }
            _ => Err(refused),
        }
    }

    /// The files as they were given.
    pub(crate) fn names(&self) -> String {
        let names: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        names.join(" ")
    }
}

/// Whether what is no robot may be a scene.
fn is_scene(error: &RobotFileError) -> bool {
    use RobotFileError::{Actuator, BallJoint, MocapBody, NeedsWorld, NoBody, NoJoint, SeveralRoots};
    matches!(
        error,
        NoBody
            | SeveralRoots { .. }
            | NoJoint
            | BallJoint { .. }
            | MocapBody { .. }
            | Actuator { .. }
            | NeedsWorld { .. }
    )
}

/// A file of the user, else an asset, else the path as it is: the loader says that there is none.
fn user_or_asset(file: &Path) -> PathBuf {
    if file.exists() { file.to_path_buf() } else { assets::path(file).unwrap_or_else(|_| file.to_path_buf()) }
}

fn package(text: &str) -> std::result::Result<(String, PathBuf), String> {
    let (name, folder) = text.split_once('=').ok_or("write NAME=DIR, such as my_robot=robots/my_robot")?;
    if name.is_empty() {
        return Err("the package has no name; write NAME=DIR".to_owned());
    }
    Ok((name.to_owned(), self::folder(folder)?))
}

fn folder(text: &str) -> std::result::Result<PathBuf, String> {
    let folder = PathBuf::from(text);
    if folder.is_dir() { Ok(folder) } else { Err(format!("{text} is no folder")) }
}
