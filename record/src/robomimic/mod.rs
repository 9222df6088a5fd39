//! HDF5 datasets for robomimic.
//!
//! | content | shape | |
//! |---|---|---|
//! | `data`, attribute `total` | | frames of all episodes |
//! | `data`, attribute `env_args` | | JSON: `env_name`, `env_type`, `type` (the same), `env_kwargs` (see below) |
//! | `data/demo_0`, attributes `num_samples`, `env_id` | | frames of the episode, and its environment |
//! | `actions` | (T, A) | joint position targets, or controls of MJCF parts; f64, as all numbers |
//! | `action_dict/joint_vel`, `action_dict/joint_effort` | (T, A) | joint velocity and effort targets |
//! | `states` | (T, 1 + nq + nv) | time, positions and velocities of all joints of the scene, in MuJoCo's order |
//! | `rewards` | (T,) | reward of the action, with a task only |
//! | `dones` | (T,) | 1 if the task ended the episode with the action; without a task, in the last frame; i64 |
//! | `obs/joint_pos`, `obs/joint_vel`, `obs/joint_effort` | (T, J) | joints of all robots |
//! | `obs/object` | (T, 7 K) | poses of objects in the environment, x, y, z, qw, qx, qy, qz |
//! | `obs/SENSOR_CHANNEL` | (T, W) | values of other sensors |
//! | `obs/CAMERA_image` | (T, H, W, 3) | color, u8, one chunk for each image, compressed by deflate |
//! | `next_obs/...` | | the same observations after the action |
//!
//! `env_kwargs` has `task`, `physics_dt`, `every` (physics steps between two frames) and `columns`.
//!
//! Until the end, rows and compressed images are in two unnamed files in the same folder, because the number and the
//! lengths of episodes are not known before. A killed process leaves nothing.

mod block_file;

use crate::cfg::RecorderCfg;
use crate::episodes::{self, DatasetWriter, EpisodeFrame, EpisodeSplitter, Features, Role};
use crate::error::{RecordError, Result};
use crate::file::{PartialFile, parent_dir};
use crate::format::Format;
use crate::stream::StreamSchema;
use crate::writer::{FormatWriter, WriteError, WriteResult};
use block_file::{BlockFile, BlockPosition};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rust_hdf5::{FilterPipeline, H5Dataset, H5File, H5FileOptions, H5Group, Hdf5Error};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;

/// Size at which the buffered rows of an episode are written \[bytes\].
const FLUSH_BYTES: usize = 1 << 16;

/// robomimic's environment type for Gymnasium, the most general one.
const GYM: i64 = 2;

/// Writer of a robomimic dataset.
struct RobomimicWriter {
    part: PartialFile,
    features: Arc<Features>,
    columns: Vec<DatasetColumn>,
    /// Value of the attribute `env_args`.
    env_args: Value,
    envs: Vec<usize>,
    /// Present episode of each environment.
    open_episodes: Vec<Option<OpenEpisode>>,
    episodes: Vec<Episode>,
    row_file: BlockFile,
    image_file: BlockFile,
    rgb: Vec<u8>,
}

/// A dataset of each episode.
struct DatasetColumn {
    /// Path below the episode.
    path: String,
    /// Offset in the record of a frame \[bytes\].
    offset: usize,
    kind: ColumnKind,
}

enum ColumnKind {
    /// This number of f64.
    Vector(usize),
    /// One f64 as a scalar.
    Scalar,
    /// One i64 as a scalar.
    Integer,
    /// Position of an image of this width and height.
    Image([usize; 2]),
}

/// An episode in progress, with the records of frames that are not written yet.
struct OpenEpisode {
    episode: usize,
    rows: Vec<u8>,
}

struct Episode {
    env: usize,
    frames: usize,
    /// Positions of its records.
    blocks: Vec<BlockPosition>,
}

/// Path of the dataset of a role, relative to the group of an episode. Paths of observations are relative to its groups
/// `obs` and `next_obs`.
fn name_of(role: &Role) -> String {
    let flat = |name: &str| name.replace('/', "_");
    match role {
        Role::Positions => "joint_pos".into(),
        Role::Velocities => "joint_vel".into(),
        Role::Efforts => "joint_effort".into(),
        Role::Action => "actions".into(),
        Role::TargetVelocities => "action_dict/joint_vel".into(),
        Role::TargetEfforts => "action_dict/joint_effort".into(),
        Role::Objects => "object".into(),
        Role::EngineState => "states".into(),
        Role::Sensor { stream, channel } => format!("{}_{}", flat(stream), flat(channel)),
        Role::Image(camera) => format!("{}_image", flat(camera)),
    }
}

/// Datasets of an episode, and size of the record of a frame \[bytes\].
fn columns(features: &Features) -> (Vec<DatasetColumn>, usize) {
    let (mut columns, mut offset) = (Vec::new(), 0);
    let mut add = |path: String, kind: ColumnKind| {
        let bytes = kind.bytes();
        columns.push(DatasetColumn { path, offset, kind });
        offset += bytes;
    };
    for of in ["obs", "next_obs"] {
        for feature in &features.numbers {
            let width = feature.names.len();
            match !feature.role.is_observed() {
                false => add(format!("{of}/{}", feature.name), ColumnKind::Vector(width)),
                true if of == "obs" => add(feature.name.clone(), ColumnKind::Vector(width)),
                true => {}
            }
        }
        for image in &features.images {
            add(format!("{of}/{}", image.name), ColumnKind::Image(image.size));
        }
    }
    if features.result_stream.is_some() {
        add("rewards".into(), ColumnKind::Scalar);
        add("dones".into(), ColumnKind::Integer);
    }
    (columns, offset)
}

/// Creates a dataset; `dt` is the physics time step \[s\].
pub(crate) fn create(cfg: &RecorderCfg, streams: &[StreamSchema], dt: f64) -> Result<Box<dyn FormatWriter>> {
    let RecorderCfg { path, period_steps, overwrite, task, .. } = cfg;
    let features = Arc::new(Features::of(path, Format::Hdf5, streams, name_of)?);
    if !features.numbers.iter().any(|feature| feature.role == Role::Action) {
        let topic = "a recording without actions; record joint targets, or states with controls".into();
        return Err(RecordError::UnsupportedTopic { path: path.clone(), format: Format::Hdf5, topic });
    }
    // Each image is one chunk of the file.
    let too_large = |[width, height]: [usize; 2]| 3 * width as u128 * height as u128 > u128::from(u32::MAX);
    if let Some([width, height]) = features.images.iter().map(|image| image.size).find(|size| too_large(*size)) {
        let supported = "three bytes per pixel must be less than 4 GiB".into();
        return Err(RecordError::UnsupportedSize {
            path: path.clone(),
            format: Format::Hdf5,
            width,
            height,
            supported,
        });
    }
    let envs = episodes::environments(path, streams)?;
    let (columns, _) = columns(&features);
    let names = features.numbers.iter().map(|feature| (feature.name.clone(), json!(feature.names)));
    let names: Map<String, Value> = names.collect();
    let env_args = json!({
        "env_name": "kinetoscope",
        "env_type": GYM,
        "type": GYM,
        "env_kwargs": { "task": task, "physics_dt": dt, "every": period_steps, "columns": names },
    });
    let (part, _) = PartialFile::create(path, *overwrite, false)?;
    let heap = || BlockFile::create(parent_dir(path)).map_err(|error| RecordError::file(path, error));
    let dataset = RobomimicWriter {
        part,
        features: Arc::clone(&features),
        columns,
        env_args,
        envs: envs.clone(),
        open_episodes: envs.iter().map(|_| None).collect(),
        episodes: Vec::new(),
        row_file: heap()?,
        image_file: heap()?,
        rgb: Vec::new(),
    };
    Ok(Box::new(EpisodeSplitter::new(dataset, features, *period_steps, &envs, streams)))
}

impl DatasetWriter for RobomimicWriter {
    type Image = BlockPosition;

    fn encode_image(&mut self, rgba: &[u8], _size: [usize; 2]) -> WriteResult<BlockPosition> {
        self.rgb.clear();
        for pixel in rgba.as_chunks::<4>().0 {
            self.rgb.extend_from_slice(&pixel[..3]);
        }
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(&self.rgb)?;
        Ok(self.image_file.append(&packed.finish()?)?)
    }

    fn begin(&mut self, env: usize) {
        if self.open_episodes[env].is_none() {
            let episode = self.episodes.len();
            self.episodes.push(Episode { env: self.envs[env], frames: 0, blocks: Vec::new() });
            self.open_episodes[env] = Some(OpenEpisode { episode, rows: Vec::new() });
        }
    }

    fn add(
        &mut self,
        env: usize,
        frame: &EpisodeFrame<BlockPosition>,
        next: &EpisodeFrame<BlockPosition>,
    ) -> WriteResult {
        let Some(OpenEpisode { episode, rows }) = &mut self.open_episodes[env] else { return Ok(()) };
        // The order is that of the columns.
        for (of, actions) in [(frame, true), (next, false)] {
            let features = self.features.numbers.iter().zip(&of.numbers);
            for (_, numbers) in features.filter(|(feature, _)| actions || feature.role.is_observed()) {
                numbers.iter().for_each(|number| rows.extend_from_slice(&number.to_le_bytes()));
            }
            of.images.iter().for_each(|place| rows.extend_from_slice(&place.to_bytes()));
        }
        if self.features.result_stream.is_some() {
            rows.extend_from_slice(&frame.reward.to_le_bytes());
            rows.extend_from_slice(&i64::from(frame.done).to_le_bytes());
        }
        let episode = &mut self.episodes[*episode];
        episode.frames += 1;
        if rows.len() >= FLUSH_BYTES {
            episode.blocks.push(self.row_file.append(rows)?);
            rows.clear();
        }
        Ok(())
    }

    fn end(&mut self, env: usize) -> WriteResult {
        if let Some(OpenEpisode { episode, rows }) =
            self.open_episodes[env].take().filter(|running| !running.rows.is_empty())
        {
            self.episodes[episode].blocks.push(self.row_file.append(&rows)?);
        }
        Ok(())
    }

    fn finish(&mut self) -> WriteResult<u64> {
        if self.episodes.is_empty() {
            return Err(WriteError::NoFrame(episodes::NO_FRAME));
        }
        // This process has locked the partial file already.
        let file = H5FileOptions::new().no_locking().create(self.part.partial_path()).map_err(write_error)?;
        self.write_all(&file)?;
        // `commit` flushes the file to the disk before it renames it.
        file.close_no_sync().map_err(write_error)?;
        Ok(self.part.commit()?)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        self.part.kept_path()
    }
}

impl RobomimicWriter {
    fn write_all(&mut self, file: &H5File) -> WriteResult {
        let data = file.create_group("data").map_err(write_error)?;
        let total: usize = self.episodes.iter().map(|episode| episode.frames).sum();
        data.set_attr_numeric("total", &(total as i64)).map_err(write_error)?;
        data.set_attr_string("env_args", &self.env_args.to_string()).map_err(write_error)?;
        for (number, episode) in self.episodes.iter().enumerate() {
            let demo = data.create_group(&format!("demo_{number}")).map_err(write_error)?;
            demo.set_attr_numeric("num_samples", &(episode.frames as i64)).map_err(write_error)?;
            demo.set_attr_numeric("env_id", &(episode.env as i64)).map_err(write_error)?;
            write(&demo, episode, &self.columns, &mut self.row_file, &mut self.image_file)?;
        }
        Ok(())
    }
}

/// Writes the datasets of an episode.
fn write(
    demo: &H5Group,
    episode: &Episode,
    columns: &[DatasetColumn],
    rows: &mut BlockFile,
    images: &mut BlockFile,
) -> WriteResult {
    let frames = episode.frames;
    let mut groups = BTreeMap::new();
    let mut datasets: Vec<H5Dataset> = Vec::new();
    for DatasetColumn { path, kind, .. } in columns {
        let (group, name) = path.split_once('/').unwrap_or(("", path));
        if !group.is_empty() && !groups.contains_key(group) {
            groups.insert(group, demo.create_group(group).map_err(write_error)?);
        }
        let group = groups.get(group).unwrap_or(demo);
        let dataset = match *kind {
            ColumnKind::Vector(width) => group.new_dataset::<f64>().shape([frames, width]).create(name),
            ColumnKind::Scalar => group.new_dataset::<f64>().shape([frames]).create(name),
            ColumnKind::Integer => group.new_dataset::<i64>().shape([frames]).create(name),
            ColumnKind::Image([width, height]) => group
                .new_dataset::<u8>()
                .shape([frames, height, width, 3])
                .chunk(&[1, height, width, 3])
                .filter_pipeline(FilterPipeline::deflate(Compression::fast().level()))
                .create(name),
        };
        datasets.push(dataset.map_err(write_error)?);
    }
    // Without a task, the last frame is done.
    let ends = !columns.iter().any(|column| column.path == "dones");
    let dones =
        ends.then(|| demo.new_dataset::<i64>().shape([frames]).create("dones").map_err(write_error)).transpose()?;
    let record = columns.iter().map(DatasetColumn::end).max().unwrap_or(0);
    let (mut block, mut image, mut numbers, mut first) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for place in &episode.blocks {
        rows.read(*place, &mut block)?;
        let count = block.len() / record.max(1);
        for (column, dataset) in columns.iter().zip(&datasets) {
            let cells = || block.chunks_exact(record).map(|row| &row[column.offset..column.end()]);
            match column.kind {
                ColumnKind::Vector(width) => {
                    numbers.clear();
                    numbers.extend(cells().flat_map(|cell| cell.as_chunks::<8>().0).map(|x| f64::from_le_bytes(*x)));
                    dataset.write_slice(&[first, 0], &[count, width], &numbers).map_err(write_error)?;
                }
                ColumnKind::Scalar => {
                    numbers.clear();
                    numbers.extend(cells().flat_map(|cell| cell.as_chunks::<8>().0).map(|x| f64::from_le_bytes(*x)));
                    dataset.write_slice(&[first], &[count], &numbers).map_err(write_error)?;
                }
                ColumnKind::Integer => {
                    let all: Vec<i64> =
                        cells().flat_map(|cell| cell.as_chunks::<8>().0).map(|x| i64::from_le_bytes(*x)).collect();
                    dataset.write_slice(&[first], &[count], &all).map_err(write_error)?;
                }
                ColumnKind::Image(_) => {
                    for (frame, cell) in (first..).zip(cells()) {
                        images.read(BlockPosition::from_bytes(cell), &mut image)?;
                        // The image is compressed already.
                        dataset.write_chunk_raw(frame, &image, 0).map_err(write_error)?;
                    }
                }
            }
        }
        if let Some(dones) = &dones {
            let done: Vec<i64> = (first..first + count).map(|frame| i64::from(frame + 1 == frames)).collect();
            dones.write_slice(&[first], &[count], &done).map_err(write_error)?;
        }
        first += count;
    }
    Ok(())
}

impl DatasetColumn {
    /// Offset of the first byte after this column in the record \[bytes\].
    fn end(&self) -> usize {
        self.offset + self.kind.bytes()
    }
}

impl ColumnKind {
    /// Size in the record of a frame \[bytes\].
    fn bytes(&self) -> usize {
        match self {
            Self::Vector(width) => 8 * width,
            Self::Scalar | Self::Integer => 8,
            Self::Image(_) => BlockPosition::BYTES,
        }
    }
}

fn write_error(error: Hdf5Error) -> WriteError {
    match error {
        Hdf5Error::Io(error) => WriteError::Io(error),
        other => WriteError::Io(io::Error::other(other.to_string())),
    }
}
