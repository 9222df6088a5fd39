//! Resolution of a configuration in a simulation: the recorded streams and the file writer.

use crate::animation::{self, Animation};
use crate::cfg::RecorderCfg;
use crate::error::{RecordError, Result};
use crate::file::{Disk, PartFile, folder_of};
use crate::format::Format;
use crate::lerobot;
use crate::mcap_file::{self, McapFile};
use crate::npz::{self, NpzFile};
use crate::picture_folder::PictureFolder;
use crate::scene_file::{self, SCENE};
use crate::source::Source;
use crate::stream::{Kind, Stream};
use crate::topic::Topic;
use crate::writer::Sink;
use kinetoscope_sim::{SimulationManager, StepResult};

/// Resolves the topics of a configuration in a simulation. Also returns what was left out.
pub(super) fn resolve(
    sim: &mut SimulationManager,
    cfg: &RecorderCfg,
    format: Format,
) -> Result<(Vec<Source>, Vec<String>)> {
    let count = sim.num_envs();
    let mut envs: Vec<usize> = match &cfg.envs {
        Some(envs) => envs.iter().map(|env| env.0).collect(),
        None => (0..count).collect(),
    };
    if envs.is_empty() {
        return Err(RecordError::OutOfRange { field: "the number of envs", value: 0, least: 1 });
    }
    envs.sort_unstable();
    let twice = envs.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0]);
    if let Some(env) = twice.or_else(|| envs.iter().copied().find(|env| *env >= count)) {
        return Err(RecordError::Env { env, count });
    }
    let (mut sources, mut left_out): (Vec<Source>, _) = (Vec::new(), Vec::new());
    for topic in &cfg.topics {
        let found = match topic {
            Topic::Everything => everything(sim, cfg, &envs, format, &mut left_out)?,
            Topic::JointStates(uid) => vec![Source::joint_states(sim, uid, &envs)?],
            Topic::Targets(uid) => vec![Source::targets(sim, uid, &envs)?],
            Topic::LinkPoses(uid) => vec![Source::link_poses(sim, uid, &envs)?],
            Topic::ObjectPose(uid) => vec![Source::object_pose(sim, uid, &envs)?],
            Topic::MjcfState(uid) => vec![Source::mjcf_state(sim, uid, &envs)?],
            Topic::BodyPoses(uid) => vec![Source::body_poses(sim, uid, &envs)?],
            Topic::EngineStates => vec![Source::engine_states(sim, &envs)],
            Topic::Outcomes if !sim.observers().is_published::<StepResult>() => {
                return Err(RecordError::NoTask { path: cfg.path.clone() });
            }
            Topic::Outcomes => vec![Source::outcomes(&envs)],
            Topic::Stage => vec![Source::stage(sim, &cfg.stage, &envs)?],
            Topic::Sensor(uid) => Source::sensor(sim, uid, &envs)?,
            Topic::Channel { sensor, channel } => vec![Source::picture(sim, sensor, channel, &envs)?],
            Topic::Events if !format.has_events() => {
                return Err(RecordError::NoPlace { path: cfg.path.clone(), format, topic: format!("{topic:?}") });
            }
            Topic::Events => Vec::new(),
        };
        let any = !found.is_empty();
        let (held, without): (Vec<_>, Vec<_>) = found.into_iter().partition(|source| format.holds(&source.stream));
        if any && held.is_empty() {
            return Err(RecordError::NoPlace { path: cfg.path.clone(), format, topic: format!("{topic:?}") });
        }
        let no_place = |source: &Source| format!("{} ({} has no place for it)", source.stream.name, format.name());
        left_out.extend(without.iter().map(no_place));
        for source in held {
            match sources.iter().find(|known| known.stream.name == source.stream.name) {
                None => sources.push(source),
                // The same stream was requested twice.
                Some(known) if known.is(&source) => {}
                Some(_) => return Err(RecordError::SameName { path: cfg.path.clone(), name: source.stream.name }),
            }
        }
    }
    if format == Format::Npz {
        let mut names: Vec<String> = sources.iter().flat_map(|source| npz::members(&source.stream)).collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(RecordError::SameName { path: cfg.path.clone(), name: pair[0].clone() });
        }
    }
    if format == Format::Mcap
        && let Some(name) =
            mcap_file::taken(&sources.iter().map(|source| &source.stream).collect::<Vec<_>>(), cfg.scene)
    {
        return Err(RecordError::SameName { path: cfg.path.clone(), name });
    }
    if format == Format::Mcap {
        left_out.extend(sources.iter().filter_map(|source| source.unspoken(sim)));
    }
    set_rates(&mut sources, cfg, format)?;
    if sources.is_empty() && !cfg.topics.contains(&Topic::Events) {
        return Err(RecordError::Nothing { path: cfg.path.clone(), format });
    }
    let pictures: usize = sources.iter().map(|source| source.stream.env_ids.len()).sum();
    if format.is_animation() && pictures != 1 {
        let names: Vec<String> = sources
            .iter()
            .map(|Source { stream, .. }| format!("{} in {} environments", stream.name, stream.env_ids.len()))
            .collect();
        return Err(RecordError::TooMany { path: cfg.path.clone(), found: names.join(", ") });
    }
    if let (true, Some(size)) = (format.is_animation(), sources.iter().find_map(|source| picture_size(&source.stream)))
    {
        animation::check(&cfg.path, format, size)?;
    }
    Ok((sources, left_out))
}

/// Sets the number of steps between two rows of each stream.
fn set_rates(sources: &mut [Source], cfg: &RecorderCfg, format: Format) -> Result<()> {
    // The overview has its own rate; results of task steps are recorded when they are published.
    let at_steps = |source: &&mut Source| source.sensor.is_none() && !source.is_stage() && !source.is_outcome();
    for source in sources.iter_mut().filter(at_steps) {
        source.every = Some(cfg.every);
    }
    for (name, every) in &cfg.rates {
        if *every == 0 {
            return Err(RecordError::OutOfRange { field: "a number of steps in rates", value: 0, least: 1 });
        }
        if matches!(format, Format::LeRobot | Format::Hdf5) {
            let topic = format!("a rate of its own for {name:?}: frames have one, `every`");
            return Err(RecordError::NoPlace { path: cfg.path.clone(), format, topic });
        }
        let is_of = |source: &&mut Source| {
            let rest = source.stream.name.strip_prefix(name.as_str());
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/')) && !source.is_outcome()
        };
        let mut found = false;
        for source in sources.iter_mut().filter(is_of) {
            source.every = Some(*every);
            found = true;
        }
        if !found {
            let candidates = sources.iter().map(|source| source.stream.name.clone()).collect();
            return Err(RecordError::UnknownName { what: "recorded topic", name: name.clone(), candidates });
        }
    }
    Ok(())
}

/// All streams of the simulation that the format supports.
fn everything(
    sim: &mut SimulationManager,
    cfg: &RecorderCfg,
    envs: &[usize],
    format: Format,
    left_out: &mut Vec<String>,
) -> Result<Vec<Source>> {
    let mut sources = Vec::new();
    for uid in sim.entities().jointed_uids() {
        for of in [Source::joint_states, Source::targets, Source::link_poses] {
            sources.push(of(sim, uid, envs)?);
        }
    }
    for uid in sim.entities().rigid_object_uids() {
        sources.push(Source::object_pose(sim, uid, envs)?);
    }
    for uid in sim.entities().mjcf_uids() {
        sources.push(Source::mjcf_state(sim, uid, envs)?);
        sources.push(Source::body_poses(sim, uid, envs)?);
    }
    for uid in sim.entities().sensor_uids() {
        match Source::sensor(sim, uid, envs) {
            Ok(found) => sources.extend(found),
            Err(error @ (RecordError::Unreadable { .. } | RecordError::Elsewhere { .. })) => {
                left_out.push(format!("{uid} ({error})"));
            }
            Err(error) => return Err(error),
        }
    }
    if sim.observers().is_published::<StepResult>() {
        sources.push(Source::outcomes(envs));
    }
    if format == Format::Hdf5 {
        sources.push(Source::engine_states(sim, envs));
    }
    sources.retain(|source| format.holds(&source.stream) && source.stream.width() > 0);
    if sources.is_empty() && (format.is_animation() || format == Format::Pictures) {
        // Without a camera, the overview image is recorded.
        sources.push(Source::stage(sim, &cfg.stage, envs)?);
    }
    if format.is_animation() {
        // An animation shows the first camera, in its first environment.
        sources.truncate(1);
        sources.iter_mut().for_each(Source::keep_first);
    }
    Ok(sources)
}

/// Packs the scene, and lists what was left out of it. A scene that cannot be packed does not prevent the recording.
pub(super) fn packed_scene(sim: &SimulationManager) -> (Option<Vec<u8>>, Vec<String>) {
    match scene_file::pack(sim) {
        Ok((scene, left_out)) => (Some(scene), left_out.iter().map(|what| format!("of the scene: {what}")).collect()),
        Err(error) => (None, vec![format!("the scene ({error})")]),
    }
}

/// Creates the writer of a format.
pub(super) fn open(
    sim: &SimulationManager,
    cfg: &RecorderCfg,
    format: Format,
    streams: &[Stream],
    scene: Option<&[u8]>,
    disk: &Disk,
) -> Result<Box<dyn Sink>> {
    if format == Format::Pictures {
        return Ok(Box::new(PictureFolder::create(&cfg.path, cfg.overwrite, disk)?));
    }
    if format == Format::LeRobot {
        return lerobot::create(cfg, streams, sim.cfg().physics_dt, disk);
    }
    #[cfg(feature = "hdf5")]
    if format == Format::Hdf5 {
        return crate::robomimic::create(cfg, streams, sim.cfg().physics_dt);
    }
    let (part, file) = PartFile::create(&cfg.path, cfg.overwrite, format == Format::Mcap)?;
    let storage = disk.storage(file);
    let sink: Result<Box<dyn Sink>> = match format {
        Format::Mcap => {
            let start = sim.time().iter().copied().fold(f64::INFINITY, f64::min);
            let (masks, dt) = (sim.scene().mask_ids(), sim.cfg().physics_dt);
            let about = npz::about(streams, masks, dt).to_string().into_bytes();
            let failed = |error| RecordError::file(&cfg.path, error);
            let snapshot = npz::snapshot_bytes(&sim.snapshot(None)?, folder_of(&cfg.path)).map_err(failed)?;
            let scene = scene.map(|scene| (SCENE, "application/zip", scene.to_vec()));
            let mut held =
                vec![(npz::ABOUT, "application/json", about), (npz::START, "application/octet-stream", snapshot)];
            held.extend(scene);
            let file = McapFile::create(part, storage, streams, &sim.cfg().env_origins(), masks, start, &held);
            file.map(|file| Box::new(file) as Box<dyn Sink>).map_err(|error| RecordError::file(&cfg.path, error))
        }
        Format::Npz => {
            let file = NpzFile::create(
                part,
                storage,
                streams,
                sim.scene().mask_ids(),
                sim.cfg().physics_dt,
                &sim.snapshot(None)?,
                scene,
            );
            file.map(|file| Box::new(file) as Box<dyn Sink>).map_err(|error| RecordError::file(&cfg.path, error))
        }
        _ => {
            let size = streams.iter().find_map(picture_size);
            // `resolve` ensures that there is an image.
            let size = size.ok_or_else(|| RecordError::Nothing { path: cfg.path.clone(), format })?;
            Ok(Box::new(Animation::create(part, storage, format, size)?))
        }
    };
    sink
}

/// Width and height of an image stream \[pixels\].
fn picture_size(stream: &Stream) -> Option<[usize; 2]> {
    match stream.kind {
        Kind::Picture { height, width, .. } => Some([width, height]),
        _ => None,
    }
}
