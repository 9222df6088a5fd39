//! Sources of the streams: copies values from the simulation.

mod camera;

use crate::error::{RecordError, Result};
use crate::overview::{OverviewCfg, OverviewRenderer};
use crate::packet::{StreamRows, ValueBuffer};
use crate::stream::{ElementType, StreamField, StreamKind, StreamSchema};
use camera::{DISPARITY, StereoSide, timing_camera};
use kinetoscope_sensors::camera::StereoCamera;
use kinetoscope_sensors::ray::RayCaster;
use kinetoscope_sensors::{Imu, Sampled, Sensor};
use kinetoscope_sim::{MjcfId, RigidObjectId, RobotId, SimulationManager, StepResult};
use ndarray::{Array2, ArrayBase, ArrayView2, Axis, Data, Dimension};
use std::any::Any;

/// A stream and the source of its values.
#[derive(Debug)]
pub(crate) struct StreamSource {
    pub(crate) stream: StreamSchema,
    kind: SourceKind,
    /// The sensor whose measurements are recorded; `None` for states that are read at any step.
    pub(crate) sensor: Option<String>,
    /// Row of each environment of the stream in the arrays of the source.
    rows: Vec<usize>,
    /// Number of measurements of each row at the last read, for sensors.
    counts: Vec<u64>,
    /// Simulation time at the last read of each row \[s\], for states.
    last_times: Vec<f64>,
    /// Physics step of the simulation at which the next row is due.
    pub(crate) next_step: u64,
    /// Physics steps between two rows; `None` for task results, and for a sensor that is recorded whenever it measures.
    pub(crate) period_steps: Option<u64>,
    /// Renderer of the overview image; `None` for other streams.
    overview_renderer: Option<OverviewRenderer>,
}

#[derive(Clone, Debug, PartialEq)]
enum SourceKind {
    JointStates(RobotId),
    Targets(RobotId),
    LinkPoses(RobotId),
    ObjectPose(RigidObjectId),
    MjcfState(MjcfId),
    Image { uid: String, eye: StereoSide, channel: &'static str },
    CameraInfo(String, StereoSide),
    Numbers(String),
    Points(String),
    BodyPoses(MjcfId),
    EngineStates,
    TaskResults,
    Overview(OverviewCfg),
}

impl StreamSource {
    fn new(
        name: String,
        kind: StreamKind,
        element_type: ElementType,
        fields: Vec<StreamField>,
        envs: &[usize],
        what: SourceKind,
    ) -> Self {
        let stream = StreamSchema { name, kind, element_type, fields, env_ids: envs.to_vec() };
        let (rows, n) = (envs.to_vec(), envs.len());
        Self {
            stream,
            kind: what,
            sensor: None,
            rows,
            counts: vec![0; n],
            last_times: vec![f64::NAN; n],
            next_step: 0,
            period_steps: None,
            overview_renderer: None,
        }
    }

    /// True for the results of task steps.
    pub(crate) fn is_task_result(&self) -> bool {
        self.kind == SourceKind::TaskResults
    }

    /// True for the overview image.
    pub(crate) fn is_overview(&self) -> bool {
        matches!(self.kind, SourceKind::Overview(_))
    }

    pub(crate) fn body_poses(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let id = sim.entities().mjcf_id(uid)?;
        let frames: Vec<String> = sim.mjcf_part(id).body_names().iter().map(|body| format!("{uid}/{body}")).collect();
        let parts = vec![StreamField::new("", [frames.len(), 7])];
        let (name, kind) = (format!("{uid}/body_poses"), StreamKind::Poses { frames });
        Ok(Self::new(name, kind, ElementType::F64, parts, envs, SourceKind::BodyPoses(id)))
    }

    pub(crate) fn engine_states(sim: &SimulationManager, envs: &[usize]) -> Self {
        let [positions, velocities] = sim.entities().engine_states().map(|table| table.ncols());
        let parts = [("clock", 1), ("qpos", positions), ("qvel", velocities)]
            .map(|(part, width)| StreamField::new(part, [width]));
        Self::new(
            "engine_state".into(),
            StreamKind::EngineState,
            ElementType::F64,
            parts.to_vec(),
            envs,
            SourceKind::EngineStates,
        )
    }

    pub(crate) fn task_results(envs: &[usize]) -> Self {
        let parts = ["reward", "terminated", "truncated"].map(|part| StreamField::new(part, [])).to_vec();
        // Results of task steps are never due by a number of steps.
        let next_step = u64::MAX;
        Self {
            next_step,
            ..Self::new("task".into(), StreamKind::TaskResult, ElementType::F64, parts, envs, SourceKind::TaskResults)
        }
    }

    /// The overview image of all environments, recorded as that of the first of `envs`.
    pub(crate) fn overview(sim: &mut SimulationManager, cfg: &OverviewCfg, envs: &[usize]) -> Result<Self> {
        let renderer = OverviewRenderer::new(sim, cfg)?;
        let [width, height] = cfg.size;
        let kind = StreamKind::Image { camera: "stage".into(), channel: "color".into(), height, width };
        let (parts, what) = (vec![StreamField::new("", [height, width, 4])], SourceKind::Overview(cfg.clone()));
        let period_steps = Some(cfg.period_steps(sim.cfg().physics_dt));
        let first = envs.get(..1).unwrap_or_default();
        let source = Self::new("stage/color".into(), kind, ElementType::U8, parts, first, what);
        Ok(Self { period_steps, overview_renderer: Some(renderer), ..source })
    }

    pub(crate) fn joint_states(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        Self::joints(sim, uid, envs, "joint_states", SourceKind::JointStates)
    }

    pub(crate) fn targets(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        Self::joints(sim, uid, envs, "targets", SourceKind::Targets)
    }

    fn joints(
        sim: &SimulationManager,
        uid: &str,
        envs: &[usize],
        topic: &str,
        what: fn(RobotId) -> SourceKind,
    ) -> Result<Self> {
        let id = sim.entities().articulated_id(uid)?;
        let names = sim.robot(id).joint_names().to_vec();
        let parts = ["positions", "velocities", "efforts"].map(|part| StreamField::new(part, [names.len()])).to_vec();
        Ok(Self::new(format!("{uid}/{topic}"), StreamKind::Joints { names }, ElementType::F64, parts, envs, what(id)))
    }

    pub(crate) fn link_poses(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let id = sim.entities().articulated_id(uid)?;
        let frames: Vec<String> = sim.robot(id).link_names().iter().map(|link| format!("{uid}/{link}")).collect();
        let parts = vec![StreamField::new("", [frames.len(), 7])];
        let name = format!("{uid}/link_poses");
        Ok(Self::new(name, StreamKind::Poses { frames }, ElementType::F64, parts, envs, SourceKind::LinkPoses(id)))
    }

    pub(crate) fn object_pose(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let what = SourceKind::ObjectPose(sim.entities().rigid_object_id(uid)?);
        let kind = StreamKind::Poses { frames: vec![uid.into()] };
        Ok(Self::new(format!("{uid}/pose"), kind, ElementType::F64, vec![StreamField::new("", [1, 7])], envs, what))
    }

    pub(crate) fn mjcf_state(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Self> {
        let id = sim.entities().mjcf_id(uid)?;
        let part = sim.mjcf_part(id);
        let widths = [part.qpos().ncols(), part.qvel().ncols(), part.ctrl().ncols()];
        let names = ["positions", "velocities", "controls"];
        let parts = names.iter().zip(widths).map(|(name, width)| StreamField::new(name, [width])).collect();
        Ok(Self::new(
            format!("{uid}/state"),
            StreamKind::unnamed(),
            ElementType::F64,
            parts,
            envs,
            SourceKind::MjcfState(id),
        ))
    }

    /// All streams of a sensor.
    pub(crate) fn sensor(sim: &SimulationManager, uid: &str, envs: &[usize]) -> Result<Vec<Self>> {
        let sensor = sim.entities().sensor_by_uid(uid)?;
        let any: &dyn Any = sensor;
        let mut sources = Vec::new();
        let eyes = StereoSide::of(any);
        if !eyes.is_empty() {
            for &eye in eyes {
                for (channel, ..) in eye.channels(any) {
                    sources.push(Self::camera_channel(sim, uid, eye, channel, envs)?);
                }
                let ((height, width), distortion) = (eye.image_shape(any), eye.distortion(any));
                let kind = StreamKind::CameraInfo { camera: eye.name(uid), height, width, distortion };
                let mut parts = vec![StreamField::new("intrinsics", [3, 3]), StreamField::new("pose", [7])];
                if eye.rectification(any).is_some() {
                    parts.extend([StreamField::new("rectification", [3, 3]), StreamField::new("projection", [3, 4])]);
                }
                let name = format!("{}/lens", eye.name(uid));
                let lens =
                    Self::new(name, kind, ElementType::F64, parts, envs, SourceKind::CameraInfo(uid.into(), eye));
                sources.push(lens.with_sensor(uid, sensor)?);
            }
            if any.downcast_ref().is_some_and(StereoCamera::has_disparity) {
                sources.push(Self::camera_channel(sim, uid, StereoSide::Left, DISPARITY, envs)?);
            }
        } else if let Some(caster) = any.downcast_ref::<RayCaster>() {
            let rays = caster.num_rays();
            let parts = vec![
                StreamField::new("hits", [rays, 3]),
                StreamField::new("distances", [rays]),
                StreamField::new("normals", [rays, 3]),
                StreamField::new("ids", [rays]),
                StreamField::new("pos_w", [3]),
                StreamField::new("quat_w", [4]),
            ];
            let points = SourceKind::Points(uid.into());
            sources.push(
                Self::new(uid.into(), StreamKind::RayHits, ElementType::F64, parts, envs, points)
                    .with_sensor(uid, sensor)?,
            );
        } else if let Some(sampled) = sensor.sampled() {
            let kind = if any.is::<Imu>() { StreamKind::Imu } else { values_kind(sampled) };
            let parts = sampled.sampler().channels().map(StreamField::of_channel).collect();
            let numbers = SourceKind::Numbers(uid.into());
            sources.push(Self::new(uid.into(), kind, ElementType::F64, parts, envs, numbers).with_sensor(uid, sensor)?);
        } else {
            return Err(RecordError::NoChannels { sensor: uid.into() });
        }
        Ok(sources)
    }

    /// One channel of a camera; for a stereo camera `left/depth`, `right/depth` or `disparity`.
    pub(crate) fn camera_image(sim: &SimulationManager, uid: &str, channel: &str, envs: &[usize]) -> Result<Self> {
        let any: &dyn Any = sim.entities().sensor_by_uid(uid)?;
        let (eye, asked) = StereoSide::split_channel(channel);
        let pair = any.downcast_ref().is_some_and(StereoCamera::has_disparity);
        if pair && channel == DISPARITY {
            return Self::camera_channel(sim, uid, StereoSide::Left, DISPARITY, envs);
        }
        // Resolves aliases of channel names.
        let own = kinetoscope_render::frame::Channels::from_names(&[asked]).map(|one| one.names()).unwrap_or_default();
        let known = eye.channels(any);
        match known.iter().find(|(name, ..)| own.contains(name)) {
            Some((name, ..)) => Self::camera_channel(sim, uid, eye, name, envs),
            None => {
                let of = |eye: &StereoSide| {
                    let camera = eye.name(uid);
                    eye.channels(any).into_iter().map(move |(name, ..)| format!("{camera}/{name}"))
                };
                let candidates = StereoSide::of(any).iter().flat_map(of);
                let candidates = candidates.chain(pair.then(|| format!("{uid}/{DISPARITY}"))).collect();
                Err(RecordError::UnknownName { what: "channel", name: format!("{uid}/{channel}"), candidates })
            }
        }
    }

    /// One existing channel of a camera, by its own name.
    fn camera_channel(
        sim: &SimulationManager,
        uid: &str,
        eye: StereoSide,
        channel: &'static str,
        envs: &[usize],
    ) -> Result<Self> {
        let sensor = sim.entities().sensor_by_uid(uid)?;
        let found = eye.channels(sensor).into_iter().find(|(name, ..)| *name == channel);
        let (_, element, components) = found.unwrap_or((DISPARITY, ElementType::F32, 1));
        let (height, width) = eye.image_shape(sensor);
        let shape = if components == 1 { vec![height, width] } else { vec![height, width, components] };
        // The disparity belongs to the pair and is in the frame of the left camera.
        let stream =
            if channel == DISPARITY { format!("{uid}/{channel}") } else { format!("{}/{channel}", eye.name(uid)) };
        let kind = StreamKind::Image { camera: eye.name(uid), channel: channel.into(), height, width };
        let what = SourceKind::Image { uid: uid.into(), eye, channel };
        Self::new(stream, kind, element, vec![StreamField::new("", shape)], envs, what).with_sensor(uid, sensor)
    }

    /// Connects the stream to a sensor. A camera may exist in some of the environments only.
    fn with_sensor(mut self, uid: &str, sensor: &dyn Sensor) -> Result<Self> {
        self.sensor = Some(uid.into());
        let any: &dyn Any = sensor;
        if let Some(camera) = timing_camera(any) {
            let place = |env: &usize| camera.env_ids().iter().position(|seen| seen == env).map(|row| (row, *env));
            (self.rows, self.stream.env_ids) = self.stream.env_ids.iter().filter_map(place).unzip();
            self.counts.truncate(self.rows.len());
            self.last_times.truncate(self.rows.len());
        }
        if self.rows.is_empty() {
            return Err(RecordError::SensorNotInEnvs { sensor: uid.into() });
        }
        // Earlier measurements are not new.
        self.update_counts(sensor);
        Ok(self)
    }

    /// True if another source records the same stream.
    pub(crate) fn records_same(&self, other: &Self) -> bool {
        self.kind == other.kind && self.stream == other.stream
    }

    /// Updates the measurement counts; returns true for each row whose count has changed.
    fn update_counts(&mut self, sensor: &dyn Sensor) -> Vec<bool> {
        let any: &dyn Any = sensor;
        let counts = match (timing_camera(any), sensor.sampled()) {
            (Some(camera), _) => Some(camera.frame_counts()),
            (None, sampled) => sampled.map(|sampled| sampled.sample_counts()),
        };
        let now = |row: &usize| counts.and_then(|counts| counts.get(*row).copied()).unwrap_or(0);
        let rows = self.rows.iter().map(now);
        self.counts.iter_mut().zip(rows).map(|(count, now)| std::mem::replace(count, now) != now).collect()
    }

    /// Updates the measurement counts after a reset or a write in `envs`: their sensor values are no new measurements.
    /// Other environments keep their counts, so that their pending measurements are still recorded.
    pub(crate) fn resync_counts(&mut self, sim: &SimulationManager, envs: &[usize]) -> Result<()> {
        if let Some(uid) = self.sensor.clone() {
            let were = self.counts.clone();
            self.update_counts(sim.entities().sensor_by_uid(&uid)?);
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
        self.last_times.truncate(1);
    }

    /// Copies the present values.
    ///
    /// - `times`: simulation times of all environments \[s\].
    /// - `changed_envs`: environments whose state was changed by a reset or a write; their states are new in any case.
    /// - `due`: states of the other environments are new only if this is true.
    /// - `result`: the result of the task step that has just ended.
    pub(crate) fn read(
        &mut self,
        sim: &mut SimulationManager,
        times: &[f64],
        changed_envs: &[usize],
        due: bool,
        result: Option<&StepResult>,
        block: &mut StreamRows,
    ) -> Result<()> {
        if let Some(uid) = &self.sensor {
            let sensor = sim.entities().sensor_by_uid(uid)?;
            block.is_new = self.update_counts(sensor);
            let stamps = CaptureTimes::of(sensor);
            if !block.is_new.contains(&true) {
                return Ok(());
            }
            let all_forces = !self.stream.fields.is_empty() && self.stream.fields.iter().all(|part| part.at_force_time);
            let times = if all_forces { &stamps.forces } else { &stamps.states };
            let of_rows = |stamps: &[f64], to: &mut Vec<f64>| {
                to.extend(self.rows.iter().map(|row| stamps.get(*row).copied().unwrap_or(f64::NAN)));
            };
            of_rows(times, &mut block.times);
            if self.stream.has_two_stamps() {
                of_rows(&stamps.forces, &mut block.force_times);
            }
        } else {
            let now = self.stream.env_ids.iter().map(|env| times[*env]);
            block.times.extend(now);
            for ((env, last), now) in self.stream.env_ids.iter().zip(&mut self.last_times).zip(&block.times) {
                // A diverged environment does not advance, so that its rows are not new.
                let fresh = (due && (*last != *now || self.overview_renderer.is_some()))
                    || changed_envs.binary_search(env).is_ok();
                if fresh {
                    *last = *now;
                }
                block.is_new.push(fresh);
            }
            if !due && !block.is_new.contains(&true) {
                return Ok(());
            }
        }
        match (&mut self.overview_renderer, &mut block.values) {
            (Some(renderer), ValueBuffer::U8(pixels)) => renderer.render(sim, pixels)?,
            _ => self.copy(sim, result, &mut block.values)?,
        }
        let wanted = self.rows.len() * self.stream.width();
        if block.values.len() != wanted {
            return Err(self.changed());
        }
        block.has_content = true;
        Ok(())
    }

    fn changed(&self) -> RecordError {
        RecordError::StreamChanged { path: Default::default(), stream: self.stream.name.clone() }
    }

    fn copy(&self, sim: &SimulationManager, result: Option<&StepResult>, values: &mut ValueBuffer) -> Result<()> {
        match &self.kind {
            SourceKind::JointStates(id) => {
                let robot = sim.robot(*id);
                self.append_concatenated(values, &[robot.qpos().view(), robot.qvel().view(), robot.qf().view()]);
            }
            SourceKind::Targets(id) => {
                let robot = sim.robot(*id);
                let targets = [robot.qpos_target(), robot.qvel_target(), robot.qf_target()];
                self.append_concatenated(values, &[targets[0].view(), targets[1].view(), targets[2].view()]);
            }
            SourceKind::LinkPoses(id) => self.append_rows(values, &sim.robot(*id).link_poses()),
            SourceKind::ObjectPose(id) => self.append_rows(values, &sim.rigid_object(*id).pose()),
            SourceKind::MjcfState(id) => {
                let part = sim.mjcf_part(*id);
                self.append_concatenated(values, &[part.qpos().view(), part.qvel().view(), part.ctrl().view()]);
            }
            SourceKind::BodyPoses(id) => {
                let part = sim.mjcf_part(*id);
                let poses: Vec<Array2<f64>> = part
                    .body_names()
                    .iter()
                    .map(|body| part.body_pose(body))
                    .collect::<kinetoscope_sim::Result<_>>()?;
                self.append_concatenated(values, &poses.iter().map(|poses| poses.view()).collect::<Vec<_>>());
            }
            SourceKind::EngineStates => {
                let [positions, velocities] = sim.entities().engine_states();
                let times = Array2::from_shape_vec((sim.num_envs(), 1), sim.time()).map_err(|_| self.changed())?;
                self.append_concatenated(values, &[times.view(), positions.view(), velocities.view()]);
            }
            SourceKind::TaskResults => {
                let number = |is: bool| f64::from(u8::from(is));
                if let (Some(result), ValueBuffer::F64(values)) = (result, values) {
                    for &row in self.rows.iter().filter(|row| **row < result.rewards.len()) {
                        let ends = [result.terminated[row], result.truncated[row]].map(number);
                        values.extend([result.rewards[row], ends[0], ends[1]]);
                    }
                }
            }
            // The overview image is drawn, not copied.
            SourceKind::Overview(_) => {}
            SourceKind::Image { uid, eye, channel } => {
                self.copy_image(sim.entities().sensor_by_uid(uid)?, *eye, channel, values)?
            }
            SourceKind::CameraInfo(uid, eye) => {
                let sensor: &dyn Any = sim.entities().sensor_by_uid(uid)?;
                let (intrinsics, poses) = eye.intrinsics_and_poses(sensor).ok_or_else(|| self.changed())?;
                let rows = intrinsics.len_of(Axis(0));
                let flat = intrinsics.into_shape_with_order((rows, 9)).map_err(|_| self.changed())?;
                let rectified = eye.rectification(sensor).unwrap_or_else(|| Array2::zeros((rows, 0)));
                self.append_concatenated(values, &[flat.view(), poses.view(), rectified.view()]);
            }
            SourceKind::Numbers(uid) => {
                let sensor = sim.entities().sensor_by_uid(uid)?;
                let sampler = sensor.sampled().ok_or_else(|| self.changed())?.sampler();
                if !sampler.channels().map(|channel| channel.name).eq(self.stream.fields.iter().map(|part| &*part.name))
                {
                    return Err(self.changed());
                }
                let all: Vec<ArrayView2<'_, f64>> =
                    sampler.channels().map(|channel| sampler.latest_delivered(channel.name)).collect();
                self.append_concatenated(values, &all);
            }
            SourceKind::Points(uid) => {
                let any: &dyn Any = sim.entities().sensor_by_uid(uid)?;
                let caster = any.downcast_ref::<RayCaster>().ok_or_else(|| self.changed())?;
                let hits = caster.latest_delivered_hits();
                // In the order of the fields after `hits`.
                let others = ["distances", "normals", "ids", "pos_w", "quat_w"];
                let others = others.map(|channel| caster.sampler().latest_delivered(channel));
                for &row in self.rows.iter().filter(|row| **row < hits.len_of(Axis(0))) {
                    if let ValueBuffer::F64(values) = values {
                        values.extend(hits.index_axis(Axis(0), row));
                        others.iter().for_each(|table| values.extend(table.row(row)));
                    }
                }
            }
        }
        Ok(())
    }

    /// Appends the rows of several tables, concatenated by environment.
    fn append_concatenated(&self, values: &mut ValueBuffer, tables: &[ArrayView2<'_, f64>]) {
        let ValueBuffer::F64(values) = values else { return };
        for &row in &self.rows {
            for table in tables.iter().filter(|table| row < table.nrows()) {
                values.extend(table.row(row));
            }
        }
    }

    /// Appends the rows of an array.
    fn append_rows<T: BufferElement, S: Data<Elem = T>, D: Dimension>(
        &self,
        values: &mut ValueBuffer,
        array: &ArrayBase<S, D>,
    ) {
        let Some(values) = T::buffer_of(values) else { return };
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

/// A type of numbers in [`ValueBuffer`].
trait BufferElement: Copy {
    const ELEMENT: ElementType;

    fn buffer_of(values: &mut ValueBuffer) -> Option<&mut Vec<Self>>;
}

macro_rules! number {
    ($($number:ty: $Variant:ident),*) => {$(
        impl BufferElement for $number {
            const ELEMENT: ElementType = ElementType::$Variant;

            fn buffer_of(values: &mut ValueBuffer) -> Option<&mut Vec<Self>> {
                if let ValueBuffer::$Variant(values) = values { Some(values) } else { None }
            }
        }
    )*};
}

number!(u8: U8, i32: I32, f32: F32, f64: F64);

/// Capture times of the last arrived measurement, for all rows of a sensor \[s\].
struct CaptureTimes {
    /// Time stamps of positions and velocities.
    states: Vec<f64>,
    /// Time stamps of forces, efforts and accelerations.
    forces: Vec<f64>,
}

impl CaptureTimes {
    /// Returns the stamps of the last arrived measurement, even if the sensor does not show it.
    fn of(sensor: &dyn Sensor) -> Self {
        let any: &dyn Any = sensor;
        if let Some(camera) = timing_camera(any) {
            let states = camera.latest_delivered_stamps().to_vec();
            return Self { forces: states.clone(), states };
        }
        let Some(sampled) = sensor.sampled() else { return Self { states: Vec::new(), forces: Vec::new() } };
        Self {
            states: sampled.latest_delivered_stamps().to_vec(),
            forces: sampled.latest_delivered_force_stamps().to_vec(),
        }
    }
}

/// Metadata of a sensor's values, with row names and contact filters.
fn values_kind(sensor: &dyn Sampled) -> StreamKind {
    StreamKind::SensorValues { rows: sensor.columns().to_vec(), filters: sensor.filters().to_vec() }
}

fn sim_error(source: &StreamSource) -> impl Fn(kinetoscope_sensors::SensorError) -> RecordError + '_ {
    move |error| {
        let sensor = source.sensor.clone().unwrap_or_default();
        RecordError::from(kinetoscope_sim::Error::Sensor { sensor, error: Box::new(error) })
    }
}
