//! MJCF files as parts of a scene: configuration, the loaded file, and its views of a running simulation.

use crate::capture::link_pose;
use crate::compile::{PartIndex, Simulation};
use crate::env::Env;
use crate::error::{Error, Result};
use crate::manager::EnvId;
use crate::mjcf::part::{MjcfPart as PartDocument, PartNames, PartOf, compare, sensors_left_out};
use crate::named::Named;
use crate::objects::robot::check_pose;
use crate::objects::rows::{Rows, Table, check_distinct, distinct_envs};
use crate::pattern;
use crate::sensor_list::SensorList;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco;
use kinetoscope_mujoco::{CompileError, LoadError, Model, words};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::source::Source;
use kinetoscope_sensors::EngineSensor;
use ndarray::{Array2, ArrayView2, AsArray, Ix2};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Configuration of an MJCF file as a part of a scene.
///
/// MuJoCo itself reads the file; what it made of it is put into the scene, every name with `uid/` before it. Bodies that the
/// file leaves free are free, others stand as the file says. Settings for the whole model (`option`, `visual`, ...) are the
/// scene's: what differs is a diagnostic.
///
/// ```
/// use kinetoscope_sim::{MjcfCfg, SimulationManager, SimulationManagerCfg};
///
/// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
/// let pendulum = r#"<mujoco><worldbody><body name="rod" pos="0 0 1">
///     <joint name="hinge" axis="0 1 0"/><geom size="0.05" pos="0.3 0 0"/></body></worldbody>
///   <actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"#;
/// let part = sim.add_mjcf(MjcfCfg::text("pendulum", pendulum))?;
/// let motor = sim.mjcf_part(part).actuator_ids(&["motor"])?;
/// sim.mjcf_part_mut(part).set_ctrl(&ndarray::array![[0.1]], Some(&motor), None)?;
/// sim.update(10);
/// assert!(sim.mjcf_part(part).get_qpos()[(0, 0)] > 0.0, "it falls");
/// # Ok::<(), kinetoscope_sim::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MjcfCfg {
    /// Name of the part, unique in the simulation; prefix of its names.
    pub uid: String,
    /// The file; with `text` only what errors call it.
    pub path: PathBuf,
    /// The MJCF itself, which names no files; the file's content where `None`.
    pub text: Option<String>,
    /// Pose of the file's world in the environment.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// What surfaces of bodies look like besides what the file says, by pattern of their names; `world` is what stands in the
    /// file's world. No body may be matched twice.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub surfaces: Vec<(String, SurfaceCfg)>,
    /// What kind of thing it is, for the table of mask ids; `mjcf` where `None`.
    pub semantic_class: Option<String>,
}

impl Default for MjcfCfg {
    /// No file yet.
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

impl MjcfCfg {
    /// A file where its own world is the environment.
    pub fn file(uid: impl Into<String>, path: impl Into<PathBuf>) -> Self {
        Self { uid: uid.into(), path: path.into(), ..Self::default() }
    }

    /// MJCF text, which names no files.
    pub fn text(uid: impl Into<String>, text: impl Into<String>) -> Self {
        Self { uid: uid.into(), path: "text".into(), text: Some(text.into()), ..Self::default() }
    }
}

/// Number of an actuator of a part: its column in `get_ctrl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ActuatorIndex(pub usize);

/// A body or a site of a part, as sensors see it.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// `uid/body` or `uid/site`.
    pub(crate) name: String,
    /// The body in the file.
    pub(crate) body: usize,
    /// Its pose in the body's frame.
    pub(crate) body_from_frame: Pose,
    /// Which frame of the part moves it.
    pub(crate) carrier: usize,
}

/// A file that was added: what does not change while the simulation runs.
#[derive(Debug)]
pub struct MjcfData {
    cfg: MjcfCfg,
    model: Model,
    names: PartNames,
    document: Arc<PartDocument>,
    files: Vec<mj::Asset>,
    frames: Vec<Frame>,
    sensors: Vec<EngineSensor>,
    sensor_names: Vec<String>,
    first_mask_id: i32,
    /// What is known of the surfaces of some bodies besides.
    surfaces: Vec<(usize, SurfaceCfg)>,
}

/// What the configuration says of the surfaces of bodies.
fn surfaces(cfg: &MjcfCfg, names: &PartNames) -> Result<Vec<(usize, SurfaceCfg)>> {
    cfg.surfaces.iter().try_for_each(|(_, surface)| surface.validate())?;
    let surfaces = pattern::assign(&cfg.surfaces, &BTreeMap::new(), &names.bodies, "body").map_err(|error| {
        Error::Surfaces { of: Named { what: "part", uid: cfg.uid.clone() }, error: Box::new(error) }
    })?;
    Ok(surfaces.into_iter().enumerate().filter_map(|(body, surface)| Some((body, surface?))).collect())
}

impl MjcfData {
    /// What is known of the surfaces of some bodies besides.
    pub(crate) fn surfaces(&self) -> &[(usize, SurfaceCfg)] {
        &self.surfaces
    }

    /// Reads and compiles the file, part number `index` of the simulation, whose model is `scene` so far.
    pub(crate) fn load(
        cfg: MjcfCfg,
        index: usize,
        first_mask_id: i32,
        scene: &Model,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Self> {
        check_pose("init_pose", &cfg.init_pose)?;
        let file = cfg.path.display().to_string();
        let (text, model) = read(&cfg.path, cfg.text.as_deref(), |error| Error::MjcfFile {
            part: cfg.uid.clone(),
            file: file.clone(),
            error: Box::new(error),
        })?;
        let names = PartNames::of_model(&model);
        let surfaces = surfaces(&cfg, &names)?;
        let (stem, source) = (format!("part{index}_"), Source::new(&cfg.path, 1));
        let of = PartOf { model: &model, names: &names, uid: &cfg.uid, pose: &cfg.init_pose, stem: &stem, rig: None };
        let document = PartDocument::new(&of, sensors_left_out(&model, &names), &source);
        let (document, files) = document
            .and_then(|document| Ok((document, of.files()?)))
            .map_err(|error| Error::MjcfPart { part: cfg.uid.clone(), file, error: Box::new(error) })?;
        let left_out = document.sensors_left_out();
        diagnostics.extend(compare(&format!("part {:?}", cfg.uid), &text, &cfg.path, &model, scene, left_out));
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
    pub fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// The configuration it was added with.
    pub fn cfg(&self) -> &MjcfCfg {
        &self.cfg
    }

    /// What MuJoCo made of the file alone.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Names of everything in the file, without the uid.
    pub fn names(&self) -> &PartNames {
        &self.names
    }

    pub(crate) fn document(&self) -> &Arc<PartDocument> {
        &self.document
    }

    /// The files that its lines name.
    pub(crate) fn files(&self) -> &[mj::Asset] {
        &self.files
    }

    /// Its bodies but the world, then its sites that have a name, as sensors see them.
    pub(crate) fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// MuJoCo's own sensors that the scene has; the first value is that among those of the part.
    pub(crate) fn sensors(&self) -> &[EngineSensor] {
        &self.sensors
    }

    /// Names of the joints with one degree of freedom, in MuJoCo's order.
    pub(crate) fn single_joints(&self) -> impl Iterator<Item = &str> {
        let names = self.names.joints.iter().zip(self.model.jnt_type());
        names.filter(|(_, kind)| matches!(words::joint(**kind), Some("hinge" | "slide"))).map(|(name, _)| name.as_str())
    }

    /// Name in the scene of something of the file.
    pub(crate) fn full(&self, name: &str) -> String {
        format!("{}/{name}", self.cfg.uid)
    }

    /// What the mask channel of cameras says of a body of the file; body 0 is what stands in its world.
    pub(crate) fn mask_id(&self, body: usize) -> i32 {
        self.first_mask_id + body as i32
    }
}

/// The text of a file, or the text itself, and what MuJoCo makes of it; `refused` is the error that its refusal is.
pub(crate) fn read(
    path: &Path,
    text: Option<&str>,
    refused: impl FnOnce(CompileError) -> Error,
) -> Result<(String, Model)> {
    let is_file = text.is_none();
    let (text, compiled) = match text {
        Some(text) => (text.to_string(), mj::compile(text, &[])),
        None => {
            let read = std::fs::read_to_string(path);
            let text = read.map_err(|error| Error::File { path: path.to_path_buf(), error })?;
            (text, mj::compile_file(path))
        }
    };
    let compiled = compiled.map_err(|error| match error {
        LoadError::Version(error) => Error::MujocoVersion(error),
        LoadError::Compile(error) if is_file => refused(located(error, path, &text)),
        LoadError::Compile(error) => refused(error),
    })?;
    Ok((text, compiled.into_model()))
}

/// With the line of the file that MuJoCo names; of a file that includes others it does not say whose line that is.
fn located(error: CompileError, path: &Path, text: &str) -> CompileError {
    let line = error.line.filter(|_| !text.contains("<include")).map(|line| Source::new(path, line));
    CompileError { source_line: error.source_line.clone().or(line), ..error }
}

/// Bodies and sites as frames. A site that is called as a body gets `.site` behind its name.
fn frames(uid: &str, model: &Model, names: &PartNames, diagnostics: &mut Vec<Diagnostic>) -> Vec<Frame> {
    // Frame k is body k + 1. A body that is welded to another moves with it; what never moves stands for itself.
    let carrier = |body: usize| match model.body_weldid()[body] as usize {
        0 => body - 1,
        moving => moving - 1,
    };
    let mut frames: Vec<Frame> = (1..model.nbody())
        .map(|body| Frame {
            name: format!("{uid}/{}", names.bodies[body]),
            body,
            body_from_frame: Pose::identity(),
            carrier: carrier(body),
        })
        .collect();
    for site in (0..model.nsite()).filter(|&site| names.named_sites[site]) {
        let body = model.site_bodyid()[site] as usize;
        let mut name = names.sites[site].clone();
        while frames.iter().any(|frame| frame.name.strip_prefix(uid).is_some_and(|rest| rest[1..] == *name)) {
            let message = format!("part {uid:?}: the site {name:?} is called as a body; its frame is \"{name}.site\"");
            diagnostics.push(Diagnostic::new(DiagnosticKind::NameClash, None, message));
            name.push_str(".site");
        }
        let (p, q) = (&model.site_pos()[3 * site..3 * site + 3], &model.site_quat()[4 * site..4 * site + 4]);
        let carrier = if body == 0 { frames.len() } else { carrier(body) };
        frames.push(Frame {
            name: format!("{uid}/{name}"),
            body,
            body_from_frame: from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]),
            carrier,
        });
    }
    frames
}

/// MuJoCo's own sensors of a file, those of `kept`.
pub(crate) fn engine_sensors(uid: &str, model: &Model, names: &PartNames, kept: &[usize]) -> Vec<EngineSensor> {
    let mut next = 0;
    kept.iter()
        .filter_map(|&s| {
            let word = words::sensor(model.sensor_type()[s])?;
            // Angles and lengths have different units; what is observed decides.
            let hinge = || {
                let joint = usize::try_from(model.sensor_objid()[s]).ok()?;
                words::joint(model.jnt_type()[joint]).map(|kind| kind == "hinge")
            };
            let unit = match word.word {
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
                kind: word.word.into(),
                unit: unit.map(Into::into),
                first,
                width,
                solved: words::is_solved(model.sensor_needstage()[s]),
                quaternion: word.quaternion,
            })
        })
        .collect()
}

/// A part, to read. Arrays have one row per environment.
#[derive(Clone, Copy, Debug)]
pub struct MjcfPart<'a> {
    data: &'a Arc<MjcfData>,
    simulation: &'a Simulation,
    index: usize,
}

impl<'a> MjcfPart<'a> {
    pub(crate) fn new(data: &'a Arc<MjcfData>, simulation: &'a Simulation, index: usize) -> Self {
        Self { data, simulation, index }
    }

    fn places(&self) -> &'a PartIndex {
        &self.simulation.parts[self.index]
    }

    /// Name of the part.
    pub fn uid(&self) -> &'a str {
        self.data.uid()
    }

    /// The configuration it was added with.
    pub fn cfg(&self) -> &'a MjcfCfg {
        self.data.cfg()
    }

    /// What MuJoCo made of the file alone.
    pub fn model(&self) -> &'a Model {
        self.data.model()
    }

    /// Names of its joints, in MuJoCo's order.
    pub fn joint_names(&self) -> &'a [String] {
        &self.data.names.joints
    }

    /// Names of its bodies, in MuJoCo's order, without the world.
    pub fn body_names(&self) -> &'a [String] {
        &self.data.names.bodies[1..]
    }

    /// Names of its sites, in MuJoCo's order; those that the file does not name are called `site` and their number.
    pub fn site_names(&self) -> &'a [String] {
        &self.data.names.sites
    }

    /// Names of its actuators, in MuJoCo's order: the columns of [`get_ctrl`](Self::get_ctrl).
    pub fn actuator_names(&self) -> &'a [String] {
        &self.data.names.actuators
    }

    /// Names of MuJoCo's own sensors in it, without those that a part cannot have (a diagnostic names each).
    pub fn sensor_names(&self) -> &'a [String] {
        &self.data.sensor_names
    }

    /// Numbers of the actuators that patterns match, in the order of the patterns.
    ///
    /// # Errors
    /// A pattern matches nothing (with the nearest names), or an actuator is matched twice.
    pub fn actuator_ids<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<ActuatorIndex>> {
        let found = self.select(patterns, self.actuator_names(), "actuator")?;
        Ok(found.into_iter().map(ActuatorIndex).collect())
    }

    /// Columns of [`get_qpos`](Self::get_qpos) of the joints that patterns match: 7 for a free joint (position, then w x y
    /// z), 4 for a ball, 1 for others.
    ///
    /// # Errors
    /// A pattern matches nothing (with the nearest names), or a joint is matched twice.
    pub fn qpos_columns<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<Range<usize>>> {
        self.columns(patterns, self.model().jnt_qposadr(), [7, 4, 1])
    }

    /// Columns of [`get_qvel`](Self::get_qvel) of the joints that patterns match: 6 for a free joint (velocity in the
    /// environment, then angular velocity in the body), 3 for a ball, 1 for others.
    ///
    /// # Errors
    /// As [`qpos_columns`](Self::qpos_columns).
    pub fn qvel_columns<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<Range<usize>>> {
        self.columns(patterns, self.model().jnt_dofadr(), [6, 3, 1])
    }

    fn columns<P: AsRef<str>>(&self, patterns: &[P], first: &[i32], widths: [usize; 3]) -> Result<Vec<Range<usize>>> {
        let [free, ball, one] = widths;
        let columns = |joint: usize| {
            let first = first[joint] as usize;
            let width = match words::joint(self.model().jnt_type()[joint]) {
                Some("free") => free,
                Some("ball") => ball,
                _ => one,
            };
            first..first + width
        };
        Ok(self.select(patterns, self.joint_names(), "joint")?.into_iter().map(columns).collect())
    }

    fn select<P: AsRef<str>>(&self, patterns: &[P], names: &[String], what: &'static str) -> Result<Vec<usize>> {
        pattern::select(patterns, names, what)
            .map_err(|error| Error::MjcfNames { part: self.uid().into(), error: Box::new(error) })
    }

    /// Sum of the masses of its bodies \[kg\], as the file has them. Masses that were drawn for an environment are not in it:
    /// see [`properties`](crate::SimulationManager::properties).
    pub fn total_mass(&self) -> f64 {
        self.model().body_mass().iter().sum()
    }

    /// Positions of its joints as MuJoCo has them \[m, rad, quaternions w x y z\], in the environment, shape (N, nq).
    pub fn get_qpos(&self) -> Array2<f64> {
        self.rows(&self.places().qpos, |env, place| env.data().qpos()[place])
    }

    /// Velocities of its joints as MuJoCo has them \[m/s, rad/s\], shape (N, nv).
    pub fn get_qvel(&self) -> Array2<f64> {
        self.rows(&self.places().dofs, |env, place| env.data().qvel()[place])
    }

    /// Controls of its actuators, in the units that the file gives them, shape (N, nu).
    pub fn get_ctrl(&self) -> Array2<f64> {
        self.rows(&self.places().controls, |env, place| env.data().ctrl()[place])
    }

    /// Forces of its actuators as MuJoCo last solved them \[N or N m\], shape (N, nu): in the last step; after a reset or a
    /// write 0, or those of the state as it is where a sensor asks for what is solved.
    pub fn get_actuator_force(&self) -> Array2<f64> {
        self.rows(&self.places().actuators, |env, place| env.data().actuator_force()[place])
    }

    fn rows(&self, places: &[usize], read: impl Fn(&Env, usize) -> f64) -> Array2<f64> {
        self.simulation.batch.gather(places, |env, &place| read(env, place))
    }

    /// Pose of a body in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    ///
    /// # Errors
    /// There is no such body; the error lists the nearest names.
    pub fn body_pose(&self, name: &str) -> Result<Array2<f64>> {
        let body = self.find("body", name, self.body_names())? + 1;
        Ok(self.poses(&(self.places().bodies[body], Pose::identity())))
    }

    /// Pose of a site in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    ///
    /// # Errors
    /// There is no such site; the error lists the nearest names.
    pub fn site_pose(&self, name: &str) -> Result<Array2<f64>> {
        let site = self.find("site", name, self.site_names())?;
        let (p, q) = (&self.model().site_pos()[3 * site..], &self.model().site_quat()[4 * site..]);
        let body = self.places().bodies[self.model().site_bodyid()[site] as usize];
        Ok(self.poses(&(body, from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]))))
    }

    fn find(&self, what: &'static str, name: &str, names: &[String]) -> Result<usize> {
        names.iter().position(|known| known == name).ok_or_else(|| Error::UnknownName {
            what,
            name: name.into(),
            candidates: pattern::closest(name, names.iter().map(String::as_str))
                .into_iter()
                .map(String::from)
                .collect(),
        })
    }

    fn poses(&self, frame: &(usize, Pose)) -> Array2<f64> {
        let mut poses = Array2::zeros((self.simulation.batch.num_envs(), 7));
        self.simulation.batch.for_each(|i, env| {
            for (k, value) in to_row(&link_pose(env.data(), frame)).into_iter().enumerate() {
                poses[(i, k)] = value;
            }
        });
        poses
    }
}

/// A part, to command and to write.
#[derive(Debug)]
pub struct MjcfPartMut<'a> {
    data: &'a Arc<MjcfData>,
    simulation: &'a mut Simulation,
    sensors: &'a mut SensorList,
    index: usize,
}

impl<'a> MjcfPartMut<'a> {
    pub(crate) fn new(
        data: &'a Arc<MjcfData>,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
        index: usize,
    ) -> Self {
        Self { data, simulation, sensors, index }
    }

    /// The part, to read.
    pub fn read(&self) -> MjcfPart<'_> {
        MjcfPart::new(self.data, self.simulation, self.index)
    }

    /// Sets controls, which stay until changed or reset, and are 0 at first: rows for `env_ids` (all where `None`; a single
    /// row is for all of them), columns for `actuators` (all where `None`). MuJoCo clamps them to the ranges of the file.
    ///
    /// # Errors
    /// Wrong shape, unknown actuator or environment, or one that is named twice, a value that is not finite; then nothing
    /// is set.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn set_ctrl<'t>(
        &mut self,
        controls: impl AsArray<'t, f64, Ix2>,
        actuators: Option<&[ActuatorIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let all = &self.simulation.parts[self.index].controls;
        let count = all.len();
        let exists = |&ActuatorIndex(index): &ActuatorIndex| {
            if index < count { Ok(index) } else { Err(Error::UnknownIndex { what: "actuator", index, count }) }
        };
        let chosen: Vec<usize> = match actuators {
            None => (0..count).collect(),
            Some(chosen) => chosen.iter().map(exists).collect::<Result<_>>()?,
        };
        let places: Vec<usize> = chosen.iter().map(|&index| all[index]).collect();
        let of = |column: usize| format!("actuator {:?}", self.data.names.actuators[chosen[column]]);
        check_distinct("set_ctrl", &chosen, &of)?;
        distinct_envs("set_ctrl", env_ids, self.simulation.batch.num_envs())?;
        let table = Table { argument: "set_ctrl", meaning: "environments, actuators", columns: chosen.len(), of: &of };
        let rows = Rows::check(table, controls.into(), env_ids, self.simulation.batch.num_envs())?;
        for (env, row) in rows.iter() {
            self.simulation.batch.write(env, |env| {
                env.set_controls(|controls| {
                    places.iter().zip(row).for_each(|(&place, &value)| controls[place] = value)
                });
            });
        }
        Ok(())
    }

    /// Writes positions of all joints into the state, as [`get_qpos`](MjcfPart::get_qpos) gives them: rows of nq numbers for
    /// `env_ids` (all where `None`; a single row is for all of them). Quaternions are normalised. A forward pass follows,
    /// so that everything that is read afterwards belongs to the new state.
    ///
    /// # Errors
    /// Wrong shape, unknown environment, or one that is named twice, a value that is not finite, a quaternion of length zero;
    /// then nothing is written.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_qpos<'t>(&mut self, positions: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let places = self.simulation.parts[self.index].qpos.clone();
        let rows = self.checked("write_qpos", positions.into(), &places, env_ids)?;
        let quaternions = self.quaternions();
        let normalised: Vec<(usize, Vec<f64>)> = rows
            .iter()
            .map(|(env, row)| {
                let mut row = row.to_vec();
                quaternions.iter().try_for_each(|&first| normalise("write_qpos", &mut row, first))?;
                Ok((env, row))
            })
            .collect::<Result<_>>()?;
        for (env, row) in normalised {
            self.simulation.batch.write(env, |env| {
                env.write(|data| {
                    let qpos = data.qpos_mut();
                    places.iter().zip(&row).for_each(|(&place, &value)| qpos[place] = value);
                });
            });
        }
        self.sensors.refresh(rows.envs(), self.simulation);
        Ok(())
    }

    /// Writes velocities of all joints into the state, as [`get_qvel`](MjcfPart::get_qvel) gives them: rows of nv numbers, as
    /// in [`write_qpos`](Self::write_qpos).
    ///
    /// # Errors
    /// Wrong shape, unknown environment, or one that is named twice, a value that is not finite; then nothing is written.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_qvel<'t>(&mut self, velocities: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let places = self.simulation.parts[self.index].dofs.clone();
        let rows = self.checked("write_qvel", velocities.into(), &places, env_ids)?;
        for (env, row) in rows.iter() {
            self.simulation.batch.write(env, |env| {
                env.write(|data| {
                    let qvel = data.qvel_mut();
                    places.iter().zip(row).for_each(|(&place, &value)| qvel[place] = value);
                });
            });
        }
        self.sensors.refresh(rows.envs(), self.simulation);
        Ok(())
    }

    /// Puts a body that the file says is moved by hand (`mocap="true"`) somewhere: rows `[x, y, z, qw, qx, qy, qz]` in the
    /// environment \[m\] for `env_ids` (all where `None`; a single row is for all of them), where it stays until it is put
    /// elsewhere or reset. Quaternions are normalised. A forward pass follows.
    ///
    /// # Errors
    /// There is no such body, or it is not moved by hand (with those that are); wrong shape, unknown environment, or one that
    /// is named twice, a value that is not finite, a quaternion of length zero; then nothing is written.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_mocap_pose<'t>(
        &mut self,
        body: &str,
        poses: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let (file, names) = (&self.data.model, &self.data.names.bodies);
        let by_hand: Vec<usize> = (1..file.nbody()).filter(|&b| file.body_mocapid()[b] >= 0).collect();
        let found = by_hand.iter().find(|&&b| names[b] == body).ok_or_else(|| Error::UnknownName {
            what: "body moved by hand (mocap) called",
            name: body.into(),
            candidates: pattern::closest(body, by_hand.iter().map(|&b| names[b].as_str()))
                .into_iter()
                .map(String::from)
                .collect(),
        })?;
        let here = self.simulation.parts[self.index].bodies[*found];
        let mocap = self.simulation.batch.model().body_mocapid()[here];
        let of = |_| format!("body {body:?}");
        let table =
            Table { argument: "write_mocap_pose", meaning: "environments, x y z qw qx qy qz", columns: 7, of: &of };
        distinct_envs(table.argument, env_ids, self.simulation.batch.num_envs())?;
        let rows = Rows::check(table, poses.into(), env_ids, self.simulation.batch.num_envs())?;
        let mut places: Vec<(usize, [f64; 7])> = rows.arrays::<7>().collect();
        places.iter_mut().try_for_each(|(_, pose)| normalise("write_mocap_pose", pose, 3))?;
        let mocap = usize::try_from(mocap).map_err(|_| Error::FixedBody(body.into()))?;
        for (env, [x, y, z, quaternion @ ..]) in places {
            self.simulation.batch.write(env, |env| {
                env.write(|data| {
                    data.mocap_pos_mut()[3 * mocap..3 * mocap + 3].copy_from_slice(&[x, y, z]);
                    data.mocap_quat_mut()[4 * mocap..4 * mocap + 4].copy_from_slice(&quaternion);
                });
            });
        }
        self.sensors.refresh(rows.envs(), self.simulation);
        Ok(())
    }

    /// First columns of the quaternions of `get_qpos`.
    fn quaternions(&self) -> Vec<usize> {
        let model = &self.data.model;
        let first = |joint: usize| {
            let first = model.jnt_qposadr()[joint] as usize;
            match words::joint(model.jnt_type()[joint]) {
                Some("free") => Some(first + 3),
                Some("ball") => Some(first),
                _ => None,
            }
        };
        (0..model.njnt()).filter_map(first).collect()
    }

    fn checked<'v>(
        &self,
        argument: &'static str,
        values: ArrayView2<'v, f64>,
        places: &[usize],
        env_ids: Option<&[EnvId]>,
    ) -> Result<Rows<'v>> {
        let of = |_| format!("part {:?}", self.data.uid());
        let table = Table { argument, meaning: "environments, numbers of the joints", columns: places.len(), of: &of };
        distinct_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        Rows::check(table, values, env_ids, self.simulation.batch.num_envs())
    }
}

/// Makes the quaternion at `first` in a row one of length 1.
fn normalise(argument: &'static str, row: &mut [f64], first: usize) -> Result<()> {
    let quaternion = &mut row[first..first + 4];
    let norm = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !(norm > 1e-9 && norm.is_finite()) {
        return Err(Error::Config {
            field: argument,
            value: format!("{quaternion:?} in columns {first} to {}", first + 3),
            expected: "a quaternion w, x, y, z must have a length that is not zero and not beyond all numbers",
        });
    }
    quaternion.iter_mut().for_each(|q| *q /= norm);
    Ok(())
}

impl MjcfCfg {
    /// Makes its path relative to a folder; an absolute one stays, and text has none.
    pub(crate) fn place_beside(&mut self, beside: impl Fn(&Path) -> PathBuf) {
        if self.text.is_none() {
            self.path = beside(&self.path);
        }
    }
}
