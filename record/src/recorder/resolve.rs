//! Resolution of a configuration in a simulation: the recorded streams and the file writer.

use crate::animation::{self, Animation};
use crate::cfg::RecorderCfg;
use crate::error::{RecordError, Result};
use crate::file::{PartialFile, StorageFactory, parent_dir};
use crate::format::Format;
use crate::image_folder::ImageFolderWriter;
use crate::mcap_writer::McapWriter;
use crate::npz::{self, NpzWriter};
use crate::ros_writer;
use crate::scene_file::{self, SCENE_ARCHIVE};
use crate::source::StreamSource;
use crate::stream::{StreamKind, StreamSchema};
use crate::topic::Topic;
use crate::writer::FormatWriter;
use kinetoscope_sim::{SimulationManager, StepResult};

/// Resolves the topics of a configuration in a simulation. Also returns what was left out.
pub(super) fn resolve(
    sim: &mut SimulationManager,
    cfg: &RecorderCfg,
    format: Format,
) -> Result<(Vec<StreamSource>, Vec<String>)> {
    let count = sim.num_envs();
    let mut envs: Vec<usize> = match &cfg.envs {
        Some(envs) => envs.iter().map(|env| env.0).collect(),
        None => (0..count).collect(),
    };
    if envs.is_empty() {
        return Err(RecordError::OutOfRange { field: "the number of envs", value: 0, min: 1 });
    }
    envs.sort_unstable();
    let twice = envs.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0]);
    if let Some(env) = twice.or_else(|| envs.iter().copied().find(|env| *env >= count)) {
        return Err(RecordError::Env { env, count });
    }
    let (mut sources, mut left_out): (Vec<StreamSource>, _) = (Vec::new(), Vec::new());
    for topic in &cfg.topics {
        let found = match topic {
            Topic::Everything => all_streams(sim, cfg, &envs, format, &mut left_out)?,
            Topic::JointStates(uid) => vec![StreamSource::joint_states(sim, uid, &envs)?],
            Topic::Targets(uid) => vec![StreamSource::targets(sim, uid, &envs)?],
            Topic::LinkPoses(uid) => vec![StreamSource::link_poses(sim, uid, &envs)?],
            Topic::ObjectPose(uid) => vec![StreamSource::object_pose(sim, uid, &envs)?],
            Topic::MjcfState(uid) => vec![StreamSource::mjcf_state(sim, uid, &envs)?],
            Topic::BodyPoses(uid) => vec![StreamSource::body_poses(sim, uid, &envs)?],
            Topic::EngineStates => vec![StreamSource::engine_states(sim, &envs)],
            Topic::TaskResults if !sim.observers().is_published::<StepResult>() => {
                return Err(RecordError::NoTask { path: cfg.path.clone() });
            }
            Topic::TaskResults => vec![StreamSource::task_results(&envs)],
            Topic::Overview => vec![StreamSource::overview(sim, &cfg.overview, &envs)?],
            Topic::Sensor(uid) => StreamSource::sensor(sim, uid, &envs)?,
            Topic::Channel { sensor, channel } => vec![StreamSource::camera_image(sim, sensor, channel, &envs)?],
            Topic::Events if !format.supports_events() => {
                return Err(RecordError::UnsupportedTopic {
                    path: cfg.path.clone(),
                    format,
                    topic: format!("{topic:?}"),
                });
            }
            Topic::Events => Vec::new(),
        };
        let any = !found.is_empty();
        let (supported, without): (Vec<_>, Vec<_>) =
            found.into_iter().partition(|source| format.supports(&source.stream));
        if any && supported.is_empty() {
            return Err(RecordError::UnsupportedTopic { path: cfg.path.clone(), format, topic: format!("{topic:?}") });
        }
        let no_place =
            |source: &StreamSource| format!("{} ({} does not support it)", source.stream.name, format.name());
        left_out.extend(without.iter().map(no_place));
        for source in supported {
            match sources.iter().find(|known| known.stream.name == source.stream.name) {
                None => sources.push(source),
                // The same stream was requested twice.
                Some(known) if known.records_same(&source) => {}
                Some(_) => return Err(RecordError::DuplicateName { path: cfg.path.clone(), name: source.stream.name }),
            }
        }
    }
    if format == Format::Npz {
        let mut names: Vec<String> = sources.iter().flat_map(|source| npz::array_names(&source.stream)).collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(RecordError::DuplicateName { path: cfg.path.clone(), name: pair[0].clone() });
        }
    }
    if format == Format::Mcap
        && let Some(name) =
            ros_writer::topic_conflict(&sources.iter().map(|source| &source.stream).collect::<Vec<_>>(), cfg.scene)
    {
        return Err(RecordError::DuplicateName { path: cfg.path.clone(), name });
    }
    if format == Format::Mcap {
        left_out.extend(sources.iter().filter_map(|source| source.camera_info_gap(sim)));
    }
    set_periods(&mut sources, cfg, format)?;
    if sources.is_empty() && !cfg.topics.contains(&Topic::Events) {
        return Err(RecordError::NothingToRecord { path: cfg.path.clone(), format });
    }
    let images: usize = sources.iter().map(|source| source.stream.env_ids.len()).sum();
    if format.is_animation() && images != 1 {
        let names: Vec<String> = sources
            .iter()
            .map(|StreamSource { stream, .. }| format!("{} in {} environments", stream.name, stream.env_ids.len()))
            .collect();
        return Err(RecordError::NotSingleImage { path: cfg.path.clone(), found: names.join(", ") });
    }
    if let (true, Some(size)) = (format.is_animation(), sources.iter().find_map(|source| image_size(&source.stream))) {
        animation::check_size(&cfg.path, format, size)?;
    }
    Ok((sources, left_out))
}

/// Sets the number of physics steps between two rows of each stream.
fn set_periods(sources: &mut [StreamSource], cfg: &RecorderCfg, format: Format) -> Result<()> {
    // The overview has its own rate; results of task steps are recorded when they are published.
    let at_steps =
        |source: &&mut StreamSource| source.sensor.is_none() && !source.is_overview() && !source.is_task_result();
    for source in sources.iter_mut().filter(at_steps) {
        source.period_steps = Some(cfg.period_steps);
    }
    for (name, every) in &cfg.stream_periods {
        if *every == 0 {
            return Err(RecordError::OutOfRange { field: "a number of steps in stream_periods", value: 0, min: 1 });
        }
        if format == Format::LeRobot {
            let topic = format!("a separate period for {name:?}; all frames have the period of `period_steps`");
            return Err(RecordError::UnsupportedTopic { path: cfg.path.clone(), format, topic });
        }
        let is_of = |source: &&mut StreamSource| {
            let rest = source.stream.name.strip_prefix(name.as_str());
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/')) && !source.is_task_result()
        };
        let mut found = false;
        for source in sources.iter_mut().filter(is_of) {
            source.period_steps = Some(*every);
            found = true;
        }
        if !found {
            let candidates = sources.iter().map(|source| source.stream.name.clone()).collect();
            return Err(RecordError::UnknownName { what: "recorded topic", name: name.clone(), candidates });
        }
    }
    Ok(())
}

/// All streams of the simulation that the format supports, except engine states. An animation gets the first camera in
/// its first environment; without a camera, formats of images get the overview image.
fn all_streams(
    sim: &mut SimulationManager,
    cfg: &RecorderCfg,
    envs: &[usize],
    format: Format,
    left_out: &mut Vec<String>,
) -> Result<Vec<StreamSource>> {
    let mut sources = Vec::new();
    for uid in sim.entities().articulated_uids() {
        for of in [StreamSource::joint_states, StreamSource::targets, StreamSource::link_poses] {
            sources.push(of(sim, uid, envs)?);
        }
    }
    for uid in sim.entities().rigid_object_uids() {
        sources.push(StreamSource::object_pose(sim, uid, envs)?);
    }
    for uid in sim.entities().mjcf_uids() {
        sources.push(StreamSource::mjcf_state(sim, uid, envs)?);
        sources.push(StreamSource::body_poses(sim, uid, envs)?);
    }
    for uid in sim.entities().sensor_uids() {
        match StreamSource::sensor(sim, uid, envs) {
            Ok(found) => sources.extend(found),
            Err(error @ (RecordError::NoChannels { .. } | RecordError::SensorNotInEnvs { .. })) => {
                left_out.push(format!("{uid} ({error})"));
            }
            Err(error) => return Err(error),
        }
    }
    if sim.observers().is_published::<StepResult>() {
        sources.push(StreamSource::task_results(envs));
    }
    sources.retain(|source| format.supports(&source.stream) && source.stream.width() > 0);
    if sources.is_empty() && (format.is_animation() || format == Format::Images) {
        // Without a camera, the overview image is recorded.
        sources.push(StreamSource::overview(sim, &cfg.overview, envs)?);
    }
    if format.is_animation() {
        // An animation shows the first camera, in its first environment.
        sources.truncate(1);
        sources.iter_mut().for_each(StreamSource::keep_first);
    }
    Ok(sources)
}

/// Packs the scene, and lists what was left out of it. A scene that cannot be packed is `None`; it does not prevent the
/// recording.
pub(super) fn packed_scene(sim: &SimulationManager) -> (Option<Vec<u8>>, Vec<String>) {
    match scene_file::pack(sim) {
        Ok((scene, left_out)) => (Some(scene), left_out.iter().map(|what| format!("of the scene: {what}")).collect()),
        Err(error) => (None, vec![format!("the scene ({error})")]),
    }
}

/// Creates the writer of a format.
pub(super) fn create_writer(
    sim: &SimulationManager,
    cfg: &RecorderCfg,
    format: Format,
    streams: &[StreamSchema],
    scene: Option<&[u8]>,
    disk: &StorageFactory,
) -> Result<Box<dyn FormatWriter>> {
    if format == Format::Images {
        return Ok(Box::new(ImageFolderWriter::create(&cfg.path, cfg.overwrite, disk)?));
    }
    #[cfg(feature = "lerobot")]
    if format == Format::LeRobot {
        return crate::lerobot::create(cfg, streams, sim.cfg().physics_dt, disk);
    }
    let (part, file) = PartialFile::create(&cfg.path, cfg.overwrite, format == Format::Mcap)?;
    let storage = disk.storage(file);
    let sink: Result<Box<dyn FormatWriter>> = match format {
        Format::Mcap => {
            let start = start_time(sim);
            let (masks, dt) = (sim.scene().mask_ids(), sim.cfg().physics_dt);
            let about = npz::metadata(streams, masks, dt).to_string().into_bytes();
            let failed = |error| RecordError::file(&cfg.path, error);
            let snapshot = npz::snapshot_bytes(&sim.snapshot(None)?, parent_dir(&cfg.path)).map_err(failed)?;
            let scene = scene.map(|scene| (SCENE_ARCHIVE, "application/zip", scene.to_vec()));
            let mut held = vec![
                (npz::METADATA, "application/json", about),
                (npz::INITIAL_STATE, "application/octet-stream", snapshot),
            ];
            held.extend(scene);
            let file = McapWriter::create(part, storage, streams, &sim.cfg().env_origins(), masks, start, &held);
            file.map(|file| Box::new(file) as Box<dyn FormatWriter>)
                .map_err(|error| RecordError::file(&cfg.path, error))
        }
        Format::Npz => {
            let file = NpzWriter::create(
                part,
                storage,
                streams,
                sim.scene().mask_ids(),
                sim.cfg().physics_dt,
                &sim.snapshot(None)?,
                scene,
            );
            file.map(|file| Box::new(file) as Box<dyn FormatWriter>)
                .map_err(|error| RecordError::file(&cfg.path, error))
        }
        _ => {
            let size = streams.iter().find_map(image_size);
            // `resolve` ensures that there is an image.
            let size = size.ok_or_else(|| RecordError::NothingToRecord { path: cfg.path.clone(), format })?;
            Ok(Box::new(Animation::create(part, storage, format, size)?))
        }
    };
    sink
}

/// Time at which a recording of all environments begins \[s\]: the earliest one.
pub(super) fn start_time(sim: &SimulationManager) -> f64 {
    sim.time().iter().copied().fold(f64::INFINITY, f64::min)
}

/// Width and height of an image stream \[pixels\]; `None` for other streams.
fn image_size(stream: &StreamSchema) -> Option<[usize; 2]> {
    match stream.kind {
        StreamKind::Image { height, width, .. } => Some([width, height]),
        _ => None,
    }
}
