//! Data of MJCF parts: configuration, compiled model, frames.

use crate::entity_label::EntityLabel;
use crate::error::{Error, Result};
use crate::mjcf::part::{PartDocument, PartNames, PartSource, sensors_left_out, setting_warnings};
use crate::objects::robot_data::check_pose;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{CompileError, LoadError, Model, mjcf_keywords};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::Pose;
use kinetoscope_scene::input_file;
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::source_location::SourceLocation;
use kinetoscope_sensors::EngineSensor;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Configuration of an MJCF file as a part of a scene.
///
/// MuJoCo reads the file, and its compiled elements are added to the scene with `uid/` before every name. Bodies that
/// are free in the file are free; all others are attached as in the file. Global settings (`option`, `visual`, ...) are
/// those of the scene; diagnostics report the differences.
///
/// ```
/// use kinetoscope_sim::{MjcfPartCfg, SimulationManager, SimulationManagerCfg};
///
/// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
/// let pendulum = r#"<mujoco><worldbody><body name="rod" pos="0 0 1">
///     <joint name="hinge" axis="0 1 0"/><geom size="0.05" pos="0.3 0 0"/></body></worldbody>
///   <actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"#;
/// let part = sim.add_mjcf(MjcfPartCfg::text("pendulum", pendulum))?;
/// let motor = sim.mjcf_part(part).actuator_ids(&["motor"])?;
/// sim.mjcf_part_mut(part).set_ctrl(&ndarray::array![[0.1]], Some(&motor), None)?;
/// sim.update(10);
/// assert!(sim.mjcf_part(part).qpos()[(0, 0)] > 0.0, "it falls");
/// # Ok::<(), kinetoscope_sim::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MjcfPartCfg {
    /// Name of the part, unique in the simulation; prefix of the names of its elements (`uid/body`).
    pub uid: String,
    /// Path of the file. If `text` is set, no file is read and the path only appears in error messages.
    pub path: PathBuf,
    /// MJCF source text, without references to other files. `None` reads the file at `path`.
    pub text: Option<String>,
    /// Pose of the file's world in the environment.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// Surface properties for rendering, by pattern of body names in the file (without `uid/`). They replace those of
    /// the file; a property that is `None` keeps the value of the file. `world` selects the geoms of the file's world.
    /// A body may match only one pattern.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub surfaces: Vec<(String, SurfaceCfg)>,
    /// Semantic class in the table of mask ids; `None` for `mjcf`.
    pub semantic_class: Option<String>,
}

impl Default for MjcfPartCfg {
    /// Configuration without a file.
    fn default() -> Self {
        Self {
            uid: "mjcf".into(),
            path: PathBuf::new(),
            text: None,
            init_pose: Pose::identity(),
            surfaces: Vec::new(),
            semantic_class: None,
        }
    }
}

impl MjcfPartCfg {
    /// Creates the configuration of the file at `path`, placed so that the file's world coincides with the environment.
    pub fn file(uid: impl Into<String>, path: impl Into<PathBuf>) -> Self {
        Self { uid: uid.into(), path: path.into(), ..Self::default() }
    }

    /// Creates the configuration of MJCF text, which must not refer to files.
    pub fn text(uid: impl Into<String>, text: impl Into<String>) -> Self {
        Self { uid: uid.into(), path: "text".into(), text: Some(text.into()), ..Self::default() }
    }
}

/// Index of an actuator of a part: its column in `ctrl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ActuatorIndex(pub usize);

/// Body or site of a part, as a frame for sensors.
#[derive(Clone, Debug)]
pub(crate) struct SensorFrame {
    /// Name of the frame: `uid/body` or `uid/site`.
    pub(crate) name: String,
    /// Index of the body in the file.
    pub(crate) body: usize,
    /// Pose of the frame in the body.
    pub(crate) body_from_frame: Pose,
    /// Index of the frame of the moving body that carries this frame. For a frame that never moves, that of its own
    /// body, or its own index for a site of the file's world.
    pub(crate) moving_frame: usize,
}

/// MJCF file of a part: everything that does not change while the simulation runs.
#[derive(Debug)]
pub(crate) struct MjcfData {
    cfg: MjcfPartCfg,
    pub(super) model: Model,
    pub(super) names: PartNames,
    document: Arc<PartDocument>,
    files: Vec<mj::Asset>,
    frames: Vec<SensorFrame>,
    sensors: Vec<EngineSensor>,
    pub(super) sensor_names: Vec<String>,
    first_mask_id: i32,
    /// Surface properties of some bodies, in addition to those of the file.
    surfaces: Vec<(usize, SurfaceCfg)>,
}

impl MjcfData {
    /// Surface properties of some bodies, in addition to those of the file.
    pub(crate) fn surfaces(&self) -> &[(usize, SurfaceCfg)] {
        &self.surfaces
    }

    /// Reads and compiles the file of part `index` of the simulation. `scene` is the current model.
    pub(crate) fn load(
        cfg: MjcfPartCfg,
        index: usize,
        first_mask_id: i32,
        scene: &Model,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Self> {
        check_pose("init_pose", &cfg.init_pose)?;
        let file = cfg.path.display().to_string();
        let (text, model) = read_and_compile(&cfg.path, cfg.text.as_deref(), |error| Error::MjcfFile {
            uid: cfg.uid.clone(),
            file: file.clone(),
            error: Box::new(error),
        })?;
        let names = PartNames::of_model(&model);
        let named = EntityLabel { kind: "MJCF part", uid: cfg.uid.clone() };
        let surfaces = SurfaceCfg::assign(&cfg.surfaces, &names.bodies, "body", named)?;
        let (stem, source) = (format!("part{index}_"), SourceLocation::new(&cfg.path, 1));
        let of =
            PartSource { model: &model, names: &names, uid: &cfg.uid, pose: &cfg.init_pose, stem: &stem, rig: None };
        let document = PartDocument::new(&of, sensors_left_out(&model, &names), &source);
        let (document, files) = document
            .and_then(|document| Ok((document, of.files()?)))
            .map_err(|error| Error::MjcfAttach { uid: cfg.uid.clone(), file, error: Box::new(error) })?;
        let left_out = document.sensors_left_out();
        diagnostics.extend(setting_warnings(
            &format!("MJCF part {:?}", cfg.uid),
            &text,
            &cfg.path,
            &model,
            scene,
            left_out,
        ));
        let frames = frames(&cfg.uid, &model, &names, diagnostics);
        let is_kept = |s: &usize| left_out.iter().all(|(other, _)| other != s);
        let kept: Vec<usize> = (0..model.nsensor()).filter(is_kept).collect();
        let sensors = engine_sensors(&cfg.uid, &model, &names, &kept);
        let sensor_names = kept.iter().map(|&s| names.sensors[s].clone()).collect();
        Ok(Self {
            cfg,
            model,
            names,
            document: Arc::new(document),
            files,
            frames,
            sensors,
            sensor_names,
            first_mask_id,
            surfaces,
        })
    }

    /// Name of the part.
    pub(crate) fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// Configuration that the part was added with.
    pub(crate) fn cfg(&self) -> &MjcfPartCfg {
        &self.cfg
    }

    /// Compiled model of the file alone.
    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    /// Names of all elements of the file, without the uid.
    pub(crate) fn names(&self) -> &PartNames {
        &self.names
    }

    pub(crate) fn document(&self) -> &Arc<PartDocument> {
        &self.document
    }

    /// Generated asset files that the part's MJCF elements refer to.
    pub(crate) fn files(&self) -> &[mj::Asset] {
        &self.files
    }

    /// Frames for sensors: all bodies except the world, then the sites with a name.
    pub(crate) fn frames(&self) -> &[SensorFrame] {
        &self.frames
    }

    /// MuJoCo's own sensors of the part in the scene. The first value of each is counted among the values of the part.
    pub(crate) fn sensors(&self) -> &[EngineSensor] {
        &self.sensors
    }

    /// Names of the joints with one degree of freedom, in MuJoCo's order.
    pub(crate) fn single_dof_joints(&self) -> impl Iterator<Item = &str> {
        let names = self.names.joints.iter().zip(self.model.jnt_type());
        names
            .filter(|(_, kind)| matches!(mjcf_keywords::joint(**kind), Some("hinge" | "slide")))
            .map(|(name, _)| name.as_str())
    }

    /// Name in the scene of an element of the file.
    pub(crate) fn scoped_name(&self, name: &str) -> String {
        format!("{}/{name}", self.cfg.uid)
    }

    /// Value of the mask channel of cameras for a body of the file; body 0 stands for the geoms of the file's world.
    pub(crate) fn mask_id(&self, body: usize) -> i32 {
        self.first_mask_id + body as i32
    }
}

/// Reads MJCF from a file or from `text`, and compiles it. `refused` wraps the compile errors of MuJoCo.
pub(crate) fn read_and_compile(
    path: &Path,
    text: Option<&str>,
    refused: impl FnOnce(CompileError) -> Error,
) -> Result<(String, Model)> {
    let is_file = text.is_none();
    let (text, compiled) = match text {
        Some(text) => (text.to_string(), mj::compile_text(text)),
        None => {
            let read = input_file::read_named_text(path);
            let text = read.map_err(|error| Error::File { path: path.to_path_buf(), error })?;
            (text, mj::compile_file(path))
        }
    };
    let compiled = compiled.map_err(|error| match error {
        LoadError::Version(error) => Error::MujocoVersion(error),
        LoadError::Compile(error) if is_file => refused(with_location(error, path, &text)),
        LoadError::Compile(error) => refused(error),
    })?;
    Ok((text, compiled.into_model()))
}

/// Adds the location of the line that MuJoCo names. In a file with includes the file of that line is unknown, so
/// nothing is added.
fn with_location(error: CompileError, path: &Path, text: &str) -> CompileError {
    let line = error.line.filter(|_| !text.contains("<include")).map(|line| SourceLocation::new(path, line));
    CompileError { source_location: error.source_location.clone().or(line), ..error }
}

/// Frames of the bodies and the named sites. A site with the name of a body gets the suffix `.site`.
fn frames(uid: &str, model: &Model, names: &PartNames, diagnostics: &mut Vec<Diagnostic>) -> Vec<SensorFrame> {
    // Frame k is body k + 1. A body that is welded to a moving body moves with it; each static body carries itself.
    let carrier = |body: usize| match model.body_weldid()[body] as usize {
        0 => body - 1,
        moving => moving - 1,
    };
    let mut frames: Vec<SensorFrame> = (1..model.nbody())
        .map(|body| SensorFrame {
            name: format!("{uid}/{}", names.bodies[body]),
            body,
            body_from_frame: Pose::identity(),
            moving_frame: carrier(body),
        })
        .collect();
    for site in (0..model.nsite()).filter(|&site| names.named_sites[site]) {
        let body = model.site_bodyid()[site] as usize;
        let mut name = names.sites[site].clone();
        while frames.iter().any(|frame| frame.name.strip_prefix(uid).is_some_and(|rest| rest[1..] == *name)) {
            let message = format!(
                "MJCF part {uid:?}: the site {name:?} has the same name as a body; its frame is named \"{name}.site\""
            );
            diagnostics.push(Diagnostic::new(DiagnosticKind::NameClash, None, message));
            name.push_str(".site");
        }
        let (p, q) = (&model.site_pos()[3 * site..3 * site + 3], &model.site_quat()[4 * site..4 * site + 4]);
        let moving_frame = if body == 0 { frames.len() } else { carrier(body) };
        frames.push(SensorFrame {
            name: format!("{uid}/{name}"),
            body,
            body_from_frame: from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]),
            moving_frame,
        });
    }
    frames
}

/// Describes MuJoCo's own sensors of a file with the indices `kept`.
pub(crate) fn engine_sensors(uid: &str, model: &Model, names: &PartNames, kept: &[usize]) -> Vec<EngineSensor> {
    let mut next = 0;
    kept.iter()
        .filter_map(|&s| {
            let word = mjcf_keywords::sensor(model.sensor_type()[s])?;
            // Angles and lengths have different units: the observed joint decides.
            let hinge = || {
                let joint = usize::try_from(model.sensor_objid()[s]).ok()?;
                mjcf_keywords::joint(model.jnt_type()[joint]).map(|kind| kind == "hinge")
            };
            let unit = match word.keyword {
                "jointpos" | "jointlimitpos" => hinge().map(|hinge| if hinge { "rad" } else { "m" }),
                "jointvel" | "jointlimitvel" => hinge().map(|hinge| if hinge { "rad/s" } else { "m/s" }),
                "jointlimitfrc" | "jointactuatorfrc" => hinge().map(|hinge| if hinge { "N m" } else { "N" }),
                _ => word.unit,
            };
            let width = model.sensor_dim()[s] as usize;
            let first = next;
            next += width;
            Some(EngineSensor {
                name: format!("{uid}/{}", names.sensors[s]),
                kind: word.keyword.into(),
                unit: unit.map(Into::into),
                first,
                width,
                force_stage: mjcf_keywords::needs_acceleration_stage(model.sensor_needstage()[s]),
                is_quaternion: word.quaternion,
            })
        })
        .collect()
}

impl MjcfPartCfg {
    /// Replaces the path by the result of `beside`, unless `text` is set.
    pub(crate) fn resolve_path(&mut self, beside: impl Fn(&Path) -> PathBuf) {
        if self.text.is_none() {
            self.path = beside(&self.path);
        }
    }
}
