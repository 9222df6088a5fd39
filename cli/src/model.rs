//! Model arguments of commands: URDF files, an MJCF file, or a scene file.

use crate::command_status::Result;
use crate::excerpt;
use crate::file_kind::FileKind;
use kinetoscope::assets;
use kinetoscope::mujoco;
use kinetoscope::prelude::*;
use kinetoscope::robot::description::LinkId;
use kinetoscope::robot::urdf::{self, Strictness};
use kinetoscope::sim::{Error, FrictionCone, MjcfId, RobotFileError};
use std::path::{Path, PathBuf};

/// Files and loading options of a model.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct ModelArgs {
    /// URDF files, each attached to the tip of the previous one; or one MJCF file; or one scene file (TOML, YAML, JSON)
    #[arg(required = true, value_name = "FILE.urdf|FILE.xml|SCENE.toml")]
    files: Vec<PathBuf>,
    /// Let the root of a robot move freely instead of fixing it in the world; not for scenes
    #[arg(long, alias = "floating_base")]
    pub(crate) floating_base: bool,
    /// Folder of a ROS package for package:// URIs; may be repeated
    #[arg(long, value_name = "NAME=DIR", value_parser = parse_package)]
    package: Vec<(String, PathBuf)>,
    /// Additional search folder for meshes and packages that are not found relative to the URDF, like Isaac Gym's asset
    /// root
    #[arg(long, value_name = "DIR", value_parser = parse_folder)]
    asset_root: Option<PathBuf>,
    /// Treat deviations from the URDF format as errors instead of warnings
    #[arg(long)]
    strict: bool,
}

/// Initial height of a robot, and the ground.
#[derive(Debug, Default, clap::Args)]
pub(crate) struct SpawnArgs {
    /// Initial height of the robot's lowest collision point above the ground [default: the root link starts at height
    /// 0, or at the pose of an MJCF file; with --floating-base, or with a floating joint at its root, a URDF robot
    /// starts on the ground; with --floating-base, an MJCF robot is raised if it would start below the ground]
    #[arg(long, alias = "spawn_height", value_name = "METERS", allow_negative_numbers = true)]
    pub(crate) spawn_height: Option<f64>,
    /// Omit the ground below a robot; the ground of a scene stays
    #[arg(long, alias = "no_ground")]
    pub(crate) no_ground: bool,
}

/// Input files by kind.
#[derive(Clone, Debug)]
pub(crate) enum Files {
    Urdf(UrdfCfg),
    Mjcf(PathBuf),
    Scene(PathBuf),
}

/// Settings of the simulation of a command.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    /// Number of environments; `None` uses that of a scene file, else `default_envs`.
    pub(crate) num_envs: Option<usize>,
    pub(crate) default_envs: usize,
    /// Distance between environments \[m\]; `None` uses that of a scene file, else `default_arena_space`.
    pub(crate) arena_space: Option<f64>,
    pub(crate) default_arena_space: f64,
    /// Number of stepping threads; `None` uses that of a scene file, else every core.
    pub(crate) threads: Option<usize>,
    /// True to add a ground plane below a robot; ignored for scenes.
    pub(crate) ground: bool,
    pub(crate) spawn_height: Option<f64>,
    /// Options of an MJCF file; `None` for the defaults of simulations.
    pub(crate) options: Option<FileOptions>,
}

/// Options of an MJCF file that apply to its simulation. Values that no simulation accepts, and the integrator, which
/// must fit the drives, are those of simulations, with a warning.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FileOptions {
    /// Time step \[s\].
    timestep: f64,
    /// Gravity \[m/s²\].
    gravity: [f64; 3],
    cone: FrictionCone,
    impratio: f64,
    iterations: u32,
}

impl FileOptions {
    /// Reads the options of an MJCF file; `None` if it does not compile, which is reported later.
    fn read(path: &Path) -> Option<Self> {
        let model = mujoco::compile_file(path).ok()?.into_model();
        let options = model.options();
        let text = |name: &str| options.iter().find(|(known, _)| *known == name).map(|(_, value)| value.as_str());
        let defaults = SimulationManagerCfg::default();
        let number = |name: &str| text(name).and_then(|value| value.parse::<f64>().ok()).filter(|value| *value > 0.0);
        let timestep = Some(model.timestep()).filter(|timestep| (1e-9..=1.0).contains(timestep));
        Some(Self {
            timestep: timestep.unwrap_or(defaults.physics_dt),
            gravity: model.gravity(),
            cone: if text("cone") == Some("elliptic") { FrictionCone::Elliptic } else { FrictionCone::Pyramidal },
            impratio: number("impratio").unwrap_or(defaults.impratio),
            iterations: number("iterations").map_or(defaults.solver_iterations, |count| count.min(1e6) as u32),
        })
    }
}

impl Setup {
    /// One environment without a ground, for commands that do not step.
    pub(crate) const STATIC: Self = Self {
        num_envs: Some(1),
        default_envs: 1,
        arena_space: None,
        default_arena_space: 2.0,
        threads: None,
        ground: false,
        spawn_height: None,
        options: None,
    };

    /// Settings of commands that step.
    pub(crate) fn moving(num_envs: Option<usize>, threads: Option<usize>, spawn: &SpawnArgs) -> Self {
        let SpawnArgs { spawn_height, no_ground } = *spawn;
        Self { num_envs, threads, ground: !no_ground, spawn_height, ..Self::STATIC }
    }

    /// These settings with the options of an MJCF file, which is the whole simulation.
    fn with_options_of(&self, path: &Path) -> Self {
        Self { options: FileOptions::read(path), ..self.clone() }
    }

    /// Returns the configuration of a simulation with one robot, or with an MJCF file.
    fn cfg(&self) -> SimulationManagerCfg {
        let defaults = match self.options {
            None => SimulationManagerCfg::default(),
            Some(FileOptions { timestep, gravity, cone, impratio, iterations }) => SimulationManagerCfg {
                physics_dt: timestep,
                gravity: gravity.into(),
                cone,
                impratio,
                solver_iterations: iterations,
                ..Default::default()
            },
        };
        SimulationManagerCfg {
            num_envs: self.num_envs.unwrap_or(self.default_envs),
            arena_space: self.arena_space.unwrap_or(self.default_arena_space),
            threads: self.threads,
            ground: defaults.ground.filter(|_| self.ground),
            ..defaults
        }
    }
}

/// A simulation with the loaded model.
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) sim: SimulationManager,
    /// Robot of the input files; `None` for an MJCF scene or a scene file.
    pub(crate) robot: Option<RobotId>,
    /// MJCF file that is a scene; `None` for other input.
    pub(crate) mjcf: Option<MjcfId>,
    /// Warnings of the command itself.
    warnings: Vec<String>,
}

impl Model {
    fn of(sim: SimulationManager) -> Self {
        Self { sim, robot: None, mjcf: None, warnings: Vec::new() }
    }

    /// Prints all warnings. Returns true if there were any.
    pub(crate) fn print_warnings(&self) -> bool {
        self.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        excerpt::print_warnings(self.sim.diagnostics()) || !self.warnings.is_empty()
    }

    /// Adds a warning if a robot on a fixed base starts partly below the ground.
    fn warn_if_in_ground(&mut self, id: RobotId) -> Result<()> {
        /// Tolerance for rounded numbers in files \[m\].
        const SLACK: f64 = 1e-3;
        let robot = self.sim.robot(id);
        let (names, heights) = (robot.link_names(), robot.link_lowest_heights());
        let mut lowest = (-SLACK, None);
        for (link, &height) in heights.row(0).iter().enumerate() {
            // Links that never move do not collide with the ground.
            if height < lowest.0 && !robot.is_link_fixed(LinkId(link))? {
                lowest = (height, Some(link));
            }
        }
        if let (height, Some(link)) = lowest {
            let (uid, name, depth) = (robot.uid(), names[link], -height);
            let warning = format!(
                "{uid}: link {name:?} starts {depth:.3} m below the ground, and the base is fixed: lift the robot with \
                 --spawn-height 0, let it stand with --floating-base, or leave the ground out with --no-ground"
            );
            self.warnings.push(warning);
        }
        Ok(())
    }
}

impl ModelArgs {
    /// Returns the files by kind.
    ///
    /// # Errors
    /// A file of another kind, an MJCF or scene file together with other files, or flags of another kind of file.
    pub(crate) fn files(&self) -> Result<Files> {
        let files: Vec<PathBuf> = self.files.iter().map(|file| resolve_file(file)).collect();
        let kinds: Vec<FileKind> = files.iter().map(|file| FileKind::of(file)).collect();
        for (file, kind) in files.iter().zip(&kinds) {
            if let FileKind::Other(what, hint) = kind {
                let file = file.display();
                return Err(format!(
                    "{file} is {what}; this command takes URDF files (.urdf), an MJCF file (.xml) or a scene file (.toml, \
                     .yaml, .json){hint}"
                )
                .into());
            }
        }
        let Some(at) = kinds.iter().position(|kind| *kind != FileKind::Urdf) else {
            let packages = self.package.iter().cloned().collect();
            let strictness = if self.strict { Strictness::Strict } else { Strictness::Lenient };
            let asset_root = self.asset_root.clone();
            return Ok(Files::Urdf(UrdfCfg { packages, asset_root, strictness, ..UrdfCfg::chain(&files) }));
        };
        let file = files[at].display();
        let (what, whole) = match kinds[at] {
            FileKind::Scene => ("a scene file", "a complete scene"),
            _ => ("an MJCF file", "a complete model"),
        };
        if files.len() > 1 {
            return Err(format!("{file}: {what} is {whole}: give it alone, or give URDF files only").into());
        }
        let package = self.package.first().map(|(name, _)| format!("--package {name}"));
        let strict = self.strict.then(|| "--strict".to_string());
        let asset_root = self.asset_root.is_some().then(|| "--asset-root".to_string());
        if let Some(flag) = package.or(strict).or(asset_root) {
            return Err(format!("{flag}: {file} is {what}, the flag is for URDF files; leave it out").into());
        }
        let path = files[at].clone();
        Ok(if kinds[at] == FileKind::Scene { Files::Scene(path) } else { Files::Mjcf(path) })
    }

    /// Returns an error if `--floating-base` is given for an MJCF file that is rendered as it is.
    pub(crate) fn refuse_floating_base(&self, path: &Path) -> Result<()> {
        if self.floating_base {
            let path = path.display();
            return Err(format!("--floating-base: {path} is rendered as the file has it; leave the flag out").into());
        }
        Ok(())
    }

    /// Builds the simulation. URDF files form one robot. An MJCF file forms a robot. If a robot cannot be made of it,
    /// for a reason in [`may_be_scene`] (such as several root bodies or ball joints), it forms a scene with its own
    /// world geoms and no additional ground. A scene file forms its scene. `setup.ground` applies to robots only.
    ///
    /// # Errors
    /// A file cannot be loaded, the spawn height is not finite, or a flag does not apply to files of this kind.
    pub(crate) fn build(&self, setup: &Setup) -> Result<Model> {
        if let Some(height) = setup.spawn_height.filter(|height| !height.is_finite()) {
            return Err(format!("--spawn-height {height}: must be a height in meters, such as 0.1").into());
        }
        match self.files()? {
            Files::Urdf(urdf) => {
                // The empty link that the floating joint of the file hangs on stays fixed to the world.
                let floats = has_floating_root(&urdf);
                let args = Self { floating_base: self.floating_base && !floats, ..self.clone() };
                let on_ground = self.floating_base || floats && setup.ground;
                let clearance = setup.spawn_height.or(on_ground.then_some(0.0));
                args.robot(setup, RobotCfg { urdf, ..Default::default() }, clearance)
            }
            Files::Mjcf(path) => self.mjcf(setup, &path),
            Files::Scene(path) => self.scene(setup, &path),
        }
    }

    /// Builds a robot with its lowest collision point at `clearance` above the ground; `None` keeps the initial pose.
    fn robot(&self, setup: &Setup, robot: RobotCfg, clearance: Option<f64>) -> Result<Model> {
        let mut model = Model::of(SimulationManager::new(setup.cfg())?);
        let (uid, fix_base) = ("robot".into(), !self.floating_base);
        let id = model.sim.add_robot(RobotCfg { uid, fix_base, ground_clearance: clearance, ..robot })?;
        model.robot = Some(id);
        if fix_base && setup.ground {
            model.warn_if_in_ground(id)?;
        }
        Ok(model)
    }

    /// Builds a robot, or a scene. Without a spawn height, a robot on a free base starts at the pose of the file; with
    /// a ground, it is raised if it would start below it.
    fn mjcf(&self, setup: &Setup, path: &Path) -> Result<Model> {
        /// Tolerance for rounding \[m\].
        const SLACK: f64 = 1e-6;
        let setup = &setup.with_options_of(path);
        let robot = || RobotCfg { mjcf: Some(MjcfFile::new(path)), ..Default::default() };
        let refused = match self.robot(setup, robot(), setup.spawn_height) {
            Ok(model) => {
                let free = self.floating_base && setup.ground && setup.spawn_height.is_none();
                let in_ground = |id| model.sim.robot(id).lowest_heights()[0] < -SLACK;
                return if free && model.robot.is_some_and(in_ground) {
                    self.robot(setup, robot(), Some(0.0))
                } else {
                    Ok(model)
                };
            }
            Err(refused) => refused,
        };
        let Some(Error::RobotFile { error, .. }) = refused.downcast_ref::<Error>() else { return Err(refused) };
        if !may_be_scene(error) {
            return Err(refused);
        }
        self.refuse_robot_flags(setup, path)?;
        let mut model = Model::of(SimulationManager::new(SimulationManagerCfg { ground: None, ..setup.cfg() })?);
        model.mjcf = Some(model.sim.add_mjcf(MjcfPartCfg::file("scene", path))?);
        Ok(model)
    }

    /// Builds the scene of a scene file.
    fn scene(&self, setup: &Setup, path: &Path) -> Result<Model> {
        self.refuse_robot_flags(setup, path)?;
        let mut cfg = SceneCfg::from_file(path)?;
        let simulation = &mut cfg.simulation;
        simulation.num_envs = setup.num_envs.unwrap_or(simulation.num_envs);
        simulation.arena_space = setup.arena_space.unwrap_or(simulation.arena_space);
        simulation.threads = setup.threads.or(simulation.threads);
        Ok(Model::of(InteractiveScene::new(cfg)?.into_sim()))
    }

    /// Returns an error if `--floating-base` or `--spawn-height` is given for a scene.
    fn refuse_robot_flags(&self, setup: &Setup, path: &Path) -> Result<()> {
        let flags = [("--floating-base", self.floating_base), ("--spawn-height", setup.spawn_height.is_some())];
        match flags.iter().find(|(_, given)| *given) {
            Some((flag, _)) => {
                let path = path.display();
                Err(format!(
                    "{flag}: {path} is a scene, not one robot: everything starts as the file says; leave the flag out"
                )
                .into())
            }
            None => Ok(()),
        }
    }

    /// Returns the file paths as given on the command line.
    pub(crate) fn file_names(&self) -> String {
        let names: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        names.join(" ")
    }
}

/// True if an MJCF file that was rejected as a robot may be a scene.
pub(crate) fn may_be_scene(error: &RobotFileError) -> bool {
    use RobotFileError::{Actuator, BallJoint, MocapBody, MultipleRoots, NeedsWorld, NoBody, NoJoint};
    matches!(
        error,
        NoBody
            | MultipleRoots { .. }
            | NoJoint
            | BallJoint { .. }
            | MocapBody { .. }
            | Actuator { .. }
            | NeedsWorld { .. }
    )
}

/// Resolves a path: an existing file, else a bundled asset, else the path unchanged, so that the loader reports the
/// missing file.
fn resolve_file(file: &Path) -> PathBuf {
    if file.exists() { file.to_path_buf() } else { assets::path(file).unwrap_or_else(|_| file.to_path_buf()) }
}

fn parse_package(text: &str) -> std::result::Result<(String, PathBuf), String> {
    let (name, folder) = text.split_once('=').ok_or("write NAME=DIR, such as my_robot=robots/my_robot")?;
    if name.is_empty() {
        return Err("the package has no name; write NAME=DIR".to_owned());
    }
    Ok((name.to_owned(), self::parse_folder(folder)?))
}

fn parse_folder(text: &str) -> std::result::Result<PathBuf, String> {
    let folder = PathBuf::from(text);
    if folder.is_dir() { Ok(folder) } else { Err(format!("{text} is not a folder")) }
}

/// True if the robot of a URDF floats by itself: the root of its first component is an empty link, and its only joint is
/// floating.
pub(crate) fn has_floating_root(urdf: &UrdfCfg) -> bool {
    let file = urdf.components.first().and_then(|first| urdf::parse_file(&first.urdf).ok());
    file.is_some_and(|file| {
        let (joints, links) = (&file.robot.joints, file.robot.links.iter().zip(&file.links));
        let mut root = links.filter(|(link, _)| joints.iter().all(|joint| joint.child.link != link.name));
        root.next().is_some_and(|(root, metadata)| {
            let has_mass = metadata.inertial.is_some() || metadata.partial_inertial.is_some();
            let mut below = joints.iter().filter(|joint| joint.parent.link == root.name);
            let floats = below.next().is_some_and(|joint| joint.joint_type == urdf::urdf_rs::JointType::Floating);
            floats && below.next().is_none() && !has_mass && root.visual.is_empty() && root.collision.is_empty()
        })
    })
}
