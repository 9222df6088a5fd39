//! Sources of the streams: copies values from the simulation.

mod camera;

use crate::error::{RecordError, Result};
use crate::packet::{Block, Values};
use crate::stage::{Painter, StageCfg};
use crate::stream::{Element, Kind, Part, Stream};
use camera::{DISPARITY, Eye, timed};
use kinetoscope_sensors::camera::StereoCamera;
use kinetoscope_sensors::ray::RayCaster;
use kinetoscope_sensors::{Imu, Sampled, Sensor};
use kinetoscope_sim::{MjcfId, ObjectId, RobotId, SimulationManager, StepResult};
use ndarray::{Array2, ArrayBase, ArrayView2, Axis, Data, Dimension};
use std::any::Any;

/// A stream and the source of its values.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) stream: Stream,
    what: What,
    /// The sensor whose measurements are recorded; `None` for states that are read at any step.
    pub(crate) sensor: Option<String>,
    /// Row of each environment of the stream in the arrays of the source.
    rows: Vec<usize>,
    /// Number of measurements of each row so far, for sensors.
    counts: Vec<u64>,
    /// Simulation time at the last read of each row \[s\], for states.
    last: Vec<f64>,
    /// Simulation step at which the next row is due.
    pub(crate) due_at: u64,
    /// Steps between two rows; `None` for a sensor that is recorded whenever it measures.
    pub(crate) every: Option<u64>,
    /// Renderer of the overview image.
    painter: Option<Painter>,
}

#[derive(Clone, Debug, PartialEq)]
enum What {
    JointStates(RobotId),
    Targets(RobotId),
    LinkPoses(RobotId),
    ObjectPose(ObjectId),
    MjcfState(MjcfId),
    Picture { uid: String, eye: Eye, channel: &'static str },
    Lens(String, Eye),
    Numbers(String),
    Points(String),
    BodyPoses(MjcfId),
    EngineStates,
    Outcomes,
    Stage(StageCfg),
}

impl Source {
    fn new(name: String, kind: Kind, element: Element, parts: Vec<Part>, envs: &[usize], what: What) -> Self {
        let stream = Stream { name, kind, element, parts, env_ids: envs.to_vec() };
        let (rows, n) = (envs.to_vec(), envs.len());
        Self {
            stream,
            what,
            sensor: None,
            rows,
            counts: vec![0; n],
            last: vec![f64::NAN; n],
            due_at: 0,
            every: None,
            painter: None,
        }
    }

    /// True for the results of task steps.
    pub(crate) fn is_outcome(&self) -> bool {
        self.what == What::Outcomes
    }

    /// True for the overview image.
    pub(crate) fn is_stage(&self) -> bool {
        matches!(self.what, What::Stage(_))
    }

    pub(crate) fn body_poses(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let id = sim.entities().mjcf_id(uid)?;
        let frames: Vec<String> = sim.mjcf_part(id).body_names().iter().map(|body| format!("{uid}/{body}")).collect();
        let parts = vec![Part::new("", [frames.len(), 7])];
        let (name, kind) = (format!("{uid}/body_poses"), Kind::Poses { frames });
        Ok(Self::new(name, kind, Element::F64, parts, envs, What::BodyPoses(id)))
    }

    pub(crate) fn engine_states(sim: &SimulationManager, envs: &[usize]) -> Self {
        let [positions, velocities] = sim.entities().engine_states().map(|table| table.ncols());
        let parts =
            [("clock", 1), ("qpos", positions), ("qvel", velocities)].map(|(part, width)| Part::new(part, [width]));
        Self::new("engine_state".into(), Kind::EngineState, Element::F64, parts.to_vec(), envs, What::EngineStates)
    }

    pub(crate) fn outcomes(envs: &[usize]) -> Self {
        let parts = ["reward", "terminated", "truncated"].map(|part| Part::new(part, [])).to_vec();
        // Results of task steps are never due by a number of steps.
        let due_at = u64::MAX;
        Self { due_at, ..Self::new("task".into(), Kind::Outcome, Element::F64, parts, envs, What::Outcomes) }
    }

    /// The overview image of all environments, recorded as that of the first of `envs`.
    pub(crate) fn stage(sim: &mut SimulationManager, cfg: &StageCfg, envs: &[usize]) -> Result<Self> {
        let painter = Painter::new(sim, cfg)?;
        let [width, height] = cfg.size;
        let kind = Kind::Picture { camera: "stage".into(), channel: "color".into(), height, width };
        let (parts, what) = (vec![Part::new("", [height, width, 4])], What::Stage(cfg.clone()));
        let every = Some(cfg.every(sim.cfg().physics_dt));
        let first = envs.get(..1).unwrap_or_default();
        let source = Self::new("stage/color".into(), kind, Element::U8, parts, first, what);
        Ok(Self { every, painter: Some(painter), ..source })
    }

    pub(crate) fn joint_states(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        Self::joints(sim, uid, envs, "joint_states", What::JointStates)
    }

    pub(crate) fn targets(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        Self::joints(sim, uid, envs, "targets", What::Targets)
    }

    fn joints(
        sim: &SimulationManager,
        uid: &str,
        envs: &[usize],
        topic: &str,
        what: fn(RobotId) -> What,
    ) -> Result<Self> {
        let id = sim.entities().jointed_id(uid)?;
        let names = sim.robot(id).joint_names().to_vec();
        let parts = ["positions", "velocities", "efforts"].map(|part| Part::new(part, [names.len()])).to_vec();
        Ok(Self::new(format!("{uid}/{topic}"), Kind::Joints { names }, Element::F64, parts, envs, what(id)))
    }

    pub(crate) fn link_poses(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let id = sim.entities().jointed_id(uid)?;
        let frames: Vec<String> = sim.robot(id).link_names().iter().map(|link| format!("{uid}/{link}")).collect();
        let parts = vec![Part::new("", [frames.len(), 7])];
        let name = format!("{uid}/link_poses");
        Ok(Self::new(name, Kind::Poses { frames }, Element::F64, parts, envs, What::LinkPoses(id)))
    }

    pub(crate) fn object_pose(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let what = What::ObjectPose(sim.entities().rigid_object_id(uid)?);
        let kind = Kind::Poses { frames: vec![uid.into()] };
        Ok(Self::new(format!("{uid}/pose"), kind, Element::F64, vec![Part::new("", [1, 7])], envs, what))
    }

    pub(crate) fn mjcf_state(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let id = sim.entities().mjcf_id(uid)?;
        let part = sim.mjcf_part(id);
        let widths = [part.qpos().ncols(), part.qvel().ncols(), part.ctrl().ncols()];
        let names = ["positions", "velocities", "controls"];
        let parts = names.iter().zip(widths).map(|(name, width)| Part::new(name, [width])).collect();
        Ok(Self::new(format!("{uid}/state"), Kind::unnamed(), Element::F64, parts, envs, What::MjcfState(id)))
    }

    /// All streams of a sensor.
    pub(crate) fn sensor(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Vec<Self>> {
        let sensor = sim.entities().sensor_called(uid)?;
        let any: &dyn Any = sensor;
        let mut sources = Vec::new();
        let eyes = Eye::of(any);
        if !eyes.is_empty() {
            for &eye in eyes {
                for (channel, ..) in eye.channels(any) {
                    sources.push(Self::of_eye(sim, uid, eye, channel, envs)?);
                }
                let ((height, width), distortion) = (eye.image_shape(any), eye.distortion(any));
                let kind = Kind::Lens { camera: eye.name(uid), height, width, distortion };
                let mut parts = vec![Part::new("intrinsics", [3, 3]), Part::new("pose", [7])];
                if eye.rectified(any).is_some() {
                    parts.extend([Part::new("rectification", [3, 3]), Part::new("projection", [3, 4])]);
                }
                let name = format!("{}/lens", eye.name(uid));
                let lens = Self::new(name, kind, Element::F64, parts, envs, What::Lens(uid.into(), eye));
                sources.push(lens.of_sensor(uid, sensor)?);
            }
            if any.downcast_ref().is_some_and(StereoCamera::has_disparity) {
                sources.push(Self::of_eye(sim, uid, Eye::Left, DISPARITY, envs)?);
            }
        } else if let Some(caster) = any.downcast_ref::<RayCaster>() {
            let rays = caster.num_rays();
            let parts = vec![
                Part::new("hits", [rays, 3]),
                Part::new("distances", [rays]),
                Part::new("normals", [rays, 3]),
                Part::new("ids", [rays]),
                Part::new("pos_w", [3]),
                Part::new("quat_w", [4]),
            ];
            let points = What::Points(uid.into());
            sources
                .push(Self::new(uid.into(), Kind::Points, Element::F64, parts, envs, points).of_sensor(uid, sensor)?);
        } else if let Some(sampled) = sensor.sampled() {
            let kind = if any.is::<Imu>() { Kind::Imu } else { kind_of(sampled) };
            let parts = sampled.sampler().channels().map(Part::of_channel).collect();
            let numbers = What::Numbers(uid.into());
            sources.push(Self::new(uid.into(), kind, Element::F64, parts, envs, numbers).of_sensor(uid, sensor)?);
        } else {
            return Err(RecordError::Unreadable { sensor: uid.into() });
        }
        Ok(sources)
    }

    /// One channel of a camera; for a stereo camera `left/depth`, `right/depth` or `disparity`.
    pub(crate) fn picture(sim: &SimulationManager, uid: &str, channel: &str, envs: &[usize]) -> Result<Self> {
        let any: &dyn Any = sim.entities().sensor_called(uid)?;
        let (eye, asked) = Eye::in_front_of(channel);
        let pair = any.downcast_ref().is_some_and(StereoCamera::has_disparity);
        if pair && channel == DISPARITY {
            return Self::of_eye(sim, uid, Eye::Left, DISPARITY, envs);
        }
        // Resolves aliases of channel names.
        let own = kinetoscope_render::frame::Channels::from_names(&[asked]).map(|one| one.names()).unwrap_or_default();
        let known = eye.channels(any);
        match known.iter().find(|(name, ..)| own.contains(name)) {
            Some((name, ..)) => Self::of_eye(sim, uid, eye, name, envs),
            None => {
                let of = |eye: &Eye| {
                    let camera = eye.name(uid);
                    eye.channels(any).into_iter().map(move |(name, ..)| format!("{camera}/{name}"))
                };
                let candidates = Eye::of(any).iter().flat_map(of);
                let candidates = candidates.chain(pair.then(|| format!("{uid}/{DISPARITY}"))).collect();
                Err(RecordError::UnknownName { what: "channel", name: format!("{uid}/{channel}"), candidates })
            }
        }
    }

    /// One existing channel of a camera, by its own name.
    fn of_eye(sim: &SimulationManager, uid: &str, eye: Eye, channel: &'static str, envs: &[usize]) -> Result<Self> {
        let sensor = sim.entities().sensor_called(uid)?;
        let found = eye.channels(sensor).into_iter().find(|(name, ..)| *name == channel);
        let (_, element, components) = found.unwrap_or((DISPARITY, Element::F32, 1));
        let (height, width) = eye.image_shape(sensor);
        let shape = if components == 1 { vec![height, width] } else { vec![height, width, components] };
        // The disparity belongs to the pair and is in the frame of the left camera.
        let stream =
            if channel == DISPARITY { format!("{uid}/{channel}") } else { format!("{}/{channel}", eye.name(uid)) };
        let kind = Kind::Picture { camera: eye.name(uid), channel: channel.into(), height, width };
        let what = What::Picture { uid: uid.into(), eye, channel };
        Self::new(stream, kind, element, vec![Part::new("", shape)], envs, what).of_sensor(uid, sensor)
    }

    /// Connects the stream to a sensor. A camera may exist in some of the environments only.
    fn of_sensor(mut self, uid: &str, sensor: &dyn Sensor) -> Result<Self> {
        self.sensor = Some(uid.into());
        let any: &dyn Any = sensor;
        if let Some(camera) = timed(any) {
            let place = |env: &usize| camera.env_ids().iter().position(|seen| seen == env).map(|row| (row, *env));
            (self.rows, self.stream.env_ids) = self.stream.env_ids.iter().filter_map(place).unzip();
            self.counts.truncate(self.rows.len());
            self.last.truncate(self.rows.len());
        }
        if self.rows.is_empty() {
            return Err(RecordError::Elsewhere { sensor: uid.into() });
        }
        // Earlier measurements are not new.
        self.count(sensor);
        Ok(self)
    }

    /// True if another source records the same stream.
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.what == other.what && self.stream == other.stream
    }

    /// Updates the measurement counts; returns true for each row whose count has changed.
    fn count(&mut self, sensor: &dyn Sensor) -> Vec<bool> {
        let any: &dyn Any = sensor;
        let counts = match (timed(any), sensor.sampled()) {
            (Some(camera), _) => Some(camera.frame_counts()),
            (None, sampled) => sampled.map(|sampled| sampled.sample_counts()),
        };
        let now = |row: &usize| counts.and_then(|counts| counts.get(*row).copied()).unwrap_or(0);
        let rows = self.rows.iter().map(now);
        self.counts.iter_mut().zip(rows).map(|(count, now)| std::mem::replace(count, now) != now).collect()
    }

    /// Updates the measurement counts after a reset or a write in `envs`: their sensor values are no new measurements.
    /// Other environments keep their counts, so that their pending measurements are still recorded.
    pub(crate) fn recount(&mut self, sim: &SimulationManager, envs: &[usize]) -> Result<()> {
        if let Some(uid) = self.sensor.clone() {
            let were = self.counts.clone();
            self.count(sim.entities().sensor_called(&uid)?);
            for ((count, was), env) in self.counts.iter_mut().zip(were).zip(&self.stream.env_ids) {
                if !envs.contains(env) {
                    *count = was;
                }
            }
        }
        Ok(())
    }

    /// Removes all environments but the first.
    pub(crate) fn keep_first(&mut self) {
        self.stream.env_ids.truncate(1);
        self.rows.truncate(1);
        self.counts.truncate(1);
        self.last.truncate(1);
    }

    /// Copies the present values.
    ///
    /// - `times`: simulation times of all environments \[s\].
    /// - `renewed`: environments whose state was changed by a reset or a write; their states are new in any case.
    /// - `due`: states of the other environments are new only if this is true.
    /// - `result`: the result of the task step that has just ended.
    pub(crate) fn read(
        &mut self,
        sim: &mut SimulationManager,
        times: &[f64],
        renewed: &[usize],
        due: bool,
        result: Option<&StepResult>,
        block: &mut Block,
    ) -> Result<()> {
        if let Some(uid) = &self.sensor {
            let sensor = sim.entities().sensor_called(uid)?;
            block.fresh = self.count(sensor);
            let stamps = Stamps::of(sensor);
            if !block.fresh.contains(&true) {
                return Ok(());
            }
            let all_forces = !self.stream.parts.is_empty() && self.stream.parts.iter().all(|part| part.of_forces);
            let times = if all_forces { &stamps.forces } else { &stamps.states };
            let of_rows = |stamps: &[f64], to: &mut Vec<f64>| {
                to.extend(self.rows.iter().map(|row| stamps.get(*row).copied().unwrap_or(f64::NAN)));
            };
            of_rows(times, &mut block.times);
            if self.stream.is_mixed() {
                of_rows(&stamps.forces, &mut block.force_times);
            }
        } else {
            let now = self.stream.env_ids.iter().map(|env| times[*env]);
            block.times.extend(now);
            for ((env, last), now) in self.stream.env_ids.iter().zip(&mut self.last).zip(&block.times) {
                // A diverged environment does not advance, so that its rows are not new.
                let fresh = (due && (*last != *now || self.painter.is_some())) || renewed.binary_search(env).is_ok();
                if fresh {
                    *last = *now;
                }
                block.fresh.push(fresh);
            }
            if !due && !block.fresh.contains(&true) {
                return Ok(());
            }
        }
        match (&mut self.painter, &mut block.values) {
            (Some(painter), Values::U8(pixels)) => painter.draw(sim, pixels)?,
            _ => self.copy(sim, result, &mut block.values)?,
        }
        let wanted = self.rows.len() * self.stream.width();
        if block.values.len() != wanted {
            return Err(self.changed());
        }
        block.used = true;
        Ok(())
    }

    fn changed(&self) -> RecordError {
        RecordError::Changed { path: Default::default(), stream: self.stream.name.clone() }
    }

    fn copy(&self, sim: &SimulationManager, result: Option<&StepResult>, values: &mut Values) -> Result<()> {
        match &self.what {
            What::JointStates(id) => {
                let robot = sim.robot(*id);
                self.join(values, &[robot.qpos().view(), robot.qvel().view(), robot.qf().view()]);
            }
            What::Targets(id) => {
                let robot = sim.robot(*id);
                let targets = [robot.qpos_target(), robot.qvel_target(), robot.qf_target()];
                self.join(values, &[targets[0].view(), targets[1].view(), targets[2].view()]);
            }
            What::LinkPoses(id) => self.put(values, &sim.robot(*id).link_poses()),
            What::ObjectPose(id) => self.put(values, &sim.rigid_object(*id).pose()),
            What::MjcfState(id) => {
                let part = sim.mjcf_part(*id);
                self.join(values, &[part.qpos().view(), part.qvel().view(), part.ctrl().view()]);
            }
            What::BodyPoses(id) => {
                let part = sim.mjcf_part(*id);
                let poses: Vec<Array2<f64>> = part
                    .body_names()
                    .iter()
                    .map(|body| part.body_pose(body))
                    .collect::<kinetoscope_sim::Result<_>>()?;
                self.join(values, &poses.iter().map(|poses| poses.view()).collect::<Vec<_>>());
            }
            What::EngineStates => {
                let [positions, velocities] = sim.entities().engine_states();
                let times = Array2::from_shape_vec((sim.num_envs(), 1), sim.time()).map_err(|_| self.changed())?;
                self.join(values, &[times.view(), positions.view(), velocities.view()]);
            }
            What::Outcomes => {
                let number = |is: bool| f64::from(u8::from(is));
                if let (Some(result), Values::F64(values)) = (result, values) {
                    for &row in self.rows.iter().filter(|row| **row < result.rewards.len()) {
                        let ends = [result.terminated[row], result.truncated[row]].map(number);
                        values.extend([result.rewards[row], ends[0], ends[1]]);
                    }
                }
            }
            // The overview image is drawn, not copied.
            What::Stage(_) => {}
            What::Picture { uid, eye, channel } => {
                self.copy_picture(sim.entities().sensor_called(uid)?, *eye, channel, values)?
            }
            What::Lens(uid, eye) => {
                let sensor: &dyn Any = sim.entities().sensor_called(uid)?;
                let (intrinsics, poses) = eye.lenses(sensor).ok_or_else(|| self.changed())?;
                let rows = intrinsics.len_of(Axis(0));
                let flat = intrinsics.into_shape_with_order((rows, 9)).map_err(|_| self.changed())?;
                let rectified = eye.rectified(sensor).unwrap_or_else(|| Array2::zeros((rows, 0)));
                self.join(values, &[flat.view(), poses.view(), rectified.view()]);
            }
            What::Numbers(uid) => {
                let sensor = sim.entities().sensor_called(uid)?;
                let sampler = sensor.sampled().ok_or_else(|| self.changed())?.sampler();
                if !sampler.channels().map(|channel| channel.name).eq(self.stream.parts.iter().map(|part| &*part.name))
                {
                    return Err(self.changed());
                }
                let all: Vec<ArrayView2<'_, f64>> =
                    sampler.channels().map(|channel| sampler.arrived(channel.name)).collect();
                self.join(values, &all);
            }
            What::Points(uid) => {
                let any: &dyn Any = sim.entities().sensor_called(uid)?;
                let caster = any.downcast_ref::<RayCaster>().ok_or_else(|| self.changed())?;
                let hits = caster.arrived_hits();
                // In the order of the fields after `hits`.
                let others = ["distances", "normals", "ids", "pos_w", "quat_w"];
                let others = others.map(|channel| caster.sampler().arrived(channel));
                for &row in self.rows.iter().filter(|row| **row < hits.len_of(Axis(0))) {
                    if let Values::F64(values) = values {
                        values.extend(hits.index_axis(Axis(0), row));
                        others.iter().for_each(|table| values.extend(table.row(row)));
                    }
                }
            }
        }
        Ok(())
    }

    /// Appends the rows of several tables, concatenated by environment.
    fn join(&self, values: &mut Values, tables: &[ArrayView2<'_, f64>]) {
        let Values::F64(values) = values else { return };
        for &row in &self.rows {
            for table in tables.iter().filter(|table| row < table.nrows()) {
                values.extend(table.row(row));
            }
        }
    }

    /// Appends the rows of an array.
    fn put<T: Number, S: Data<Elem = T>, D: Dimension>(&self, values: &mut Values, array: &ArrayBase<S, D>) {
        let Some(values) = T::of(values) else { return };
        let width = self.stream.width();
        match array.as_slice() {
            Some(all) => {
                let rows = self.rows.iter().filter_map(|row| all.get(row * width..(row + 1) * width));
                rows.for_each(|row| values.extend_from_slice(row));
            }
            None => {
                let all: Vec<T> = array.iter().copied().collect();
                let rows = self.rows.iter().filter_map(|row| all.get(row * width..(row + 1) * width));
                rows.for_each(|row| values.extend_from_slice(row));
            }
        }
    }
}

/// A type of numbers in [`Values`].
trait Number: Copy {
    const ELEMENT: Element;

    fn of(values: &mut Values) -> Option<&mut Vec<Self>>;
}

macro_rules! number {
    ($($number:ty: $Variant:ident),*) => {$(
        impl Number for $number {
            const ELEMENT: Element = Element::$Variant;

            fn of(values: &mut Values) -> Option<&mut Vec<Self>> {
                if let Values::$Variant(values) = values { Some(values) } else { None }
            }
        }
    )*};
}

number!(u8: U8, i32: I32, f32: F32, f64: F64);

/// Capture times of the last arrived measurement, for all rows of a sensor \[s\].
struct Stamps {
    /// Time stamps of positions and velocities.
    states: Vec<f64>,
    /// Time stamps of forces, efforts and accelerations.
    forces: Vec<f64>,
}

impl Stamps {
    /// Returns the stamps of the last arrived measurement, even if the sensor does not show it.
    fn of(sensor: &dyn Sensor) -> Self {
        let any: &dyn Any = sensor;
        if let Some(camera) = timed(any) {
            let states = camera.arrived_stamps().to_vec();
            return Self { forces: states.clone(), states };
        }
        let Some(sampled) = sensor.sampled() else { return Self { states: Vec::new(), forces: Vec::new() } };
        Self { states: sampled.arrived_stamps().to_vec(), forces: sampled.arrived_force_stamps().to_vec() }
    }
}

/// Metadata of a sensor's values, with row names and contact filters.
fn kind_of(sensor: &dyn Sampled) -> Kind {
    Kind::Numbers { rows: sensor.columns().to_vec(), filters: sensor.filters().to_vec() }
}

fn sim_error(source: &Source) -> impl Fn(kinetoscope_sensors::SensorError) -> RecordError + '_ {
    move |error| {
        let sensor = source.sensor.clone().unwrap_or_default();
        RecordError::from(kinetoscope_sim::Error::Sensor { sensor, error: Box::new(error) })
    }
}
