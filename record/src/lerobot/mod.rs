//! LeRobot datasets, version 3.0: a folder with a Parquet file for each episode, and metadata.

mod parquet;
mod statistics;

use crate::cfg::RecorderCfg;
use crate::episodes::{self, DatasetWriter, EpisodeFrame, EpisodeSplitter, Features, Role};
use crate::error::{RecordError, Result};
use crate::file::{Storage, StorageFactory};
use crate::folder::PartialFolder;
use crate::format::Format;
use crate::png::PngWriter;
use crate::stream::StreamSchema;
use crate::writer::{FormatWriter, WriteError, WriteResult};
use parquet::{ColumnType, ParquetWriter, put_bytes};
use serde_json::{Map, Value, json};
use statistics::{ImageStatistics, Statistics};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The metadata file that makes a folder a dataset. It is written last.
const INFO: &str = "meta/info.json";
/// The file that marks a folder as that of a recorder, which may be replaced. It is locked while the recorder exists.
const MARKER: &str = "meta/.kinetoscope";

/// Number of files in a folder.
const FILES_PER_CHUNK: u64 = 1000;

/// Rows are written at this number of rows or bytes.
const FLUSH_ROWS: usize = 256;
const FLUSH_BYTES: usize = 1 << 20;

/// Columns of every dataset, after its features.
const COMMON: [(&str, &str); 5] = [
    ("timestamp", "float32"),
    ("frame_index", "int64"),
    ("episode_index", "int64"),
    ("index", "int64"),
    ("task_index", "int64"),
];

/// Results of the action of a frame, with a task only.
const REWARD: &str = "next.reward";
const DONE: &str = "next.done";

/// Writer of a LeRobot dataset.
struct LeRobotWriter {
    folder: PartialFolder,
    disk: StorageFactory,
    /// The marker file, locked.
    _lock: File,
    fps: u64,
    task: String,
    features: Arc<Features>,
    /// Present episode of each environment.
    open_episodes: Vec<Option<OpenEpisode>>,
    /// Length of each episode, and the positions of its `index` column.
    episodes: Vec<Episode>,
    statistics: Vec<Statistics>,
    png: PngWriter,
}

/// An encoded image, with its statistics.
struct EncodedImage {
    file: Vec<u8>,
    statistics: ImageStatistics,
}

/// An episode in progress.
struct OpenEpisode {
    episode: usize,
    table: ParquetWriter,
    file: PathBuf,
    rows: usize,
    frames: u64,
    values: Vec<Vec<u8>>,
}

#[derive(Default)]
struct Episode {
    frames: u64,
    file: PathBuf,
    /// File offset and number of rows of each part of the `index` column.
    index: Vec<(u64, u64)>,
}

/// Frames per second, which must be a whole number.
///
/// # Errors
/// The rate of the recording is not a whole number.
fn frames_per_second(path: &Path, dt: f64, period_steps: u64) -> Result<u64> {
    let found = 1.0 / (dt * period_steps as f64);
    let whole = found.round();
    // The tolerance is a thousandth of a frame per hour.
    if whole >= 1.0 && (found - whole).abs() < 1e-8 * whole {
        return Ok(whole as u64);
    }
    let fits = |period: &u64| {
        let rate = 1.0 / (dt * *period as f64);
        rate >= 1.0 && (rate - rate.round()).abs() < 1e-8 * rate
    };
    let mut candidates: Vec<u64> = (1..=1000).filter(fits).collect();
    candidates.sort_by_key(|other| other.abs_diff(period_steps));
    candidates.truncate(3);
    Err(RecordError::UnsupportedRate { path: path.into(), period_steps, found, candidates })
}

/// Name of a role in a dataset. Feature names must not contain slashes.
fn name_of(role: &Role) -> String {
    let dotted = |name: &str| name.replace('/', ".");
    match role {
        Role::Positions => "observation.state".into(),
        Role::Velocities => "observation.velocity".into(),
        Role::Efforts => "observation.effort".into(),
        Role::Action => "action".into(),
        Role::TargetVelocities => "target.velocity".into(),
        Role::TargetEfforts => "target.effort".into(),
        Role::Objects => "observation.environment_state".into(),
        Role::EngineState => "observation.engine_state".into(),
        Role::Sensor { stream, channel } => format!("sensors.{}.{}", dotted(stream), dotted(channel)),
        Role::Image(camera) => format!("observation.images.{}", dotted(camera)),
    }
}

/// Creates a dataset; `dt` is the physics time step \[s\].
pub(crate) fn create(
    cfg: &RecorderCfg,
    streams: &[StreamSchema],
    dt: f64,
    disk: &StorageFactory,
) -> Result<Box<dyn FormatWriter>> {
    let RecorderCfg { path, period_steps, overwrite, task, .. } = cfg;
    let fps = frames_per_second(path, dt, *period_steps)?;
    let features = Arc::new(Features::of(path, Format::LeRobot, streams, name_of)?);
    let statistics = features.numbers.iter().map(|feature| Statistics::new(feature.names.len()));
    let statistics = statistics.chain(features.images.iter().map(|_| Statistics::new(3)));
    // Statistics of rewards and ends.
    let of_outcome = features.result_stream.iter().flat_map(|_| [1, 1].map(Statistics::new));
    let statistics = statistics.chain(of_outcome).collect();
    let envs = episodes::environments(path, streams)?;
    let (folder, lock) = PartialFolder::create(path, *overwrite, MARKER)?;
    let dataset = LeRobotWriter {
        folder,
        disk: disk.clone(),
        _lock: lock,
        fps,
        task: task.clone(),
        features: Arc::clone(&features),
        open_episodes: envs.iter().map(|_| None).collect(),
        episodes: Vec::new(),
        statistics,
        png: PngWriter::default(),
    };
    Ok(Box::new(EpisodeSplitter::new(dataset, features, *period_steps, &envs, streams)))
}

/// Columns of a frame.
fn columns(features: &Features) -> Vec<(String, ColumnType)> {
    let numbers =
        features.numbers.iter().map(|feature| (feature.name.clone(), ColumnType::Float32(feature.names.len())));
    let images = features.images.iter().map(|image| (image.name.clone(), ColumnType::Image));
    let outcome = [(REWARD, ColumnType::Float32(1)), (DONE, ColumnType::Bool)];
    let outcome =
        outcome.into_iter().filter(|_| features.result_stream.is_some()).map(|(name, kind)| (name.to_string(), kind));
    let common = COMMON.iter().map(|(name, kind)| {
        (name.to_string(), if *kind == "int64" { ColumnType::Int64 } else { ColumnType::Float32(1) })
    });
    numbers.chain(images).chain(outcome).chain(common).collect()
}

/// Features, as described in `meta/info.json`.
fn feature_info(features: &Features) -> Map<String, Value> {
    let numbers = features.numbers.iter().map(|feature| {
        let names = &feature.names;
        (feature.name.clone(), json!({ "dtype": "float32", "shape": [names.len()], "names": names }))
    });
    let images = features.images.iter().map(|image| {
        let (names, [width, height]) = (["height", "width", "channels"], image.size);
        (image.name.clone(), json!({ "dtype": "image", "shape": [height, width, 3], "names": names }))
    });
    let outcome = [(REWARD, "float32"), (DONE, "bool")].into_iter().filter(|_| features.result_stream.is_some());
    let outcome = outcome.map(|(name, kind)| (name.to_string(), json!({ "dtype": kind, "shape": [1], "names": null })));
    numbers.chain(images).chain(outcome).collect()
}

impl DatasetWriter for LeRobotWriter {
    type Image = EncodedImage;

    fn encode_image(&mut self, rgba: &[u8], size: [usize; 2]) -> WriteResult<EncodedImage> {
        Ok(EncodedImage { file: self.png.encode_rgb(rgba, size)?.to_vec(), statistics: ImageStatistics::new(rgba) })
    }

    fn begin(&mut self, env: usize) {
        if self.open_episodes[env].is_none() {
            let episode = self.episodes.len();
            let file = self.folder.partial_path().join(data_file(episode as u64));
            let table = ParquetWriter::new(columns(&self.features));
            let values = vec![Vec::new(); table.width()];
            self.episodes.push(Episode { file: file.clone(), ..Episode::default() });
            self.open_episodes[env] = Some(OpenEpisode { episode, table, file, rows: 0, frames: 0, values });
        }
    }

    fn add(
        &mut self,
        env: usize,
        frame: &EpisodeFrame<EncodedImage>,
        _next: &EpisodeFrame<EncodedImage>,
    ) -> WriteResult {
        let EpisodeFrame { numbers, images, reward, done } = frame;
        let judged = self.features.result_stream.is_some();
        let numbers: Vec<Vec<f32>> = numbers.iter().map(|of| of.iter().map(|x| *x as f32).collect()).collect();
        let Some(running) = &mut self.open_episodes[env] else { return Ok(()) };
        let mut leaves = running.values.iter_mut();
        for values in &numbers {
            let Some(to) = leaves.next() else { break };
            values.iter().for_each(|value| to.extend_from_slice(&value.to_le_bytes()));
        }
        for image in images {
            let (Some(bytes), Some(path)) = (leaves.next(), leaves.next()) else { break };
            put_bytes(&image.file, bytes)?;
            put_bytes(format!("frame-{:06}.png", running.frames).as_bytes(), path)?;
        }
        if judged && let (Some(rewards), Some(ends)) = (leaves.next(), leaves.next()) {
            rewards.extend_from_slice(&(*reward as f32).to_le_bytes());
            ends.push(u8::from(*done));
        }
        let time = (running.frames as f64 / self.fps as f64) as f32;
        // The index in the dataset is known at the end only.
        let whole = [running.frames, running.episode as u64, 0, 0];
        if let Some(to) = leaves.next() {
            to.extend_from_slice(&time.to_le_bytes());
        }
        for (to, number) in leaves.zip(whole) {
            to.extend_from_slice(&number.to_le_bytes());
        }
        running.rows += 1;
        running.frames += 1;
        let all = numbers.len();
        self.statistics.iter_mut().zip(&numbers).for_each(|(statistics, values)| statistics.add(values));
        let of_pictures = self.statistics.iter_mut().skip(all).zip(images);
        of_pictures.for_each(|(statistics, image)| statistics.add_image(&image.statistics));
        let of_outcome = self.statistics.iter_mut().skip(all + images.len());
        let outcome = [*reward as f32, f32::from(u8::from(*done))];
        of_outcome.zip(outcome).for_each(|(statistics, value)| statistics.add(&[value]));
        if running.rows >= FLUSH_ROWS || running.values.iter().map(Vec::len).sum::<usize>() >= FLUSH_BYTES {
            running.write(&self.disk)?;
        }
        Ok(())
    }

    /// Completes the Parquet file of the open episode of `env`, if any.
    fn end(&mut self, env: usize) -> WriteResult {
        let Some(mut running) = self.open_episodes[env].take() else { return Ok(()) };
        running.write(&self.disk)?;
        let mut out = BufWriter::new(running.open(&self.disk)?);
        running.table.finish(&mut out, &[])?;
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?;
        let index = running.table.value_offsets("index");
        let episode = &mut self.episodes[running.episode];
        (episode.frames, episode.index) = (running.frames, index);
        Ok(())
    }

    fn finish(&mut self) -> WriteResult<u64> {
        if self.episodes.is_empty() {
            return Err(WriteError::NoFrame(episodes::NO_FRAME));
        }
        self.write_frame_indices()?;
        self.write_tasks()?;
        self.write_episodes()?;
        let mut out = self.file("meta/stats.json")?;
        let names = self.features.names().chain([REWARD, DONE]);
        let of_all = names.zip(&self.statistics).map(|(name, one)| (name.to_string(), one.to_json()));
        out.write_all(format!("{:#}\n", Value::Object(of_all.collect())).as_bytes())?;
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?;
        // Written last, because it makes the folder a dataset.
        let info = format!("{:#}\n", self.info());
        let mut out = self.file(INFO)?;
        out.write_all(info.as_bytes())?;
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?;
        let bytes = folder_size(self.folder.partial_path())?;
        self.folder.commit()?;
        Ok(bytes)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        Some(self.folder.partial_path().into())
    }
}

impl LeRobotWriter {
    fn file(&self, name: &str) -> io::Result<BufWriter<Box<dyn Storage>>> {
        let path = self.folder.partial_path().join(name);
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        Ok(BufWriter::new(self.disk.storage(File::create(path)?)))
    }

    /// Writes the only task, which is the index of its table in pandas.
    fn write_tasks(&self) -> WriteResult {
        let index = "__index_level_0__";
        let column = |name: Option<&str>, field, pandas, numpy| json!({ "name": name, "field_name": field, "pandas_type": pandas, "numpy_type": numpy, "metadata": null });
        let about = json!({
            "index_columns": [index],
            "column_indexes": [],
            "columns": [
                column(Some("task_index"), "task_index", "int64", "int64"),
                column(None, index, "unicode", "object"),
            ],
            "pandas_version": "2.0.0",
        });
        let mut table =
            ParquetWriter::new(vec![("task_index".into(), ColumnType::Int64), (index.into(), ColumnType::String)]);
        let mut task = Vec::new();
        put_bytes(self.task.as_bytes(), &mut task)?;
        let mut out = self.file("meta/tasks.parquet")?;
        table.write(&mut out, 1, &[0_i64.to_le_bytes().to_vec(), task])?;
        table.finish(&mut out, &[("pandas", &about.to_string())])?;
        Ok(out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?)
    }

    fn write_episodes(&self) -> WriteResult {
        let numbers = [
            "episode_index",
            "length",
            "data/chunk_index",
            "data/file_index",
            "dataset_from_index",
            "dataset_to_index",
            "meta/episodes/chunk_index",
            "meta/episodes/file_index",
        ];
        let mut columns: Vec<(String, ColumnType)> =
            numbers.iter().map(|name| (name.to_string(), ColumnType::Int64)).collect();
        columns.push(("tasks".into(), ColumnType::StringList));
        let mut table = ParquetWriter::new(columns);
        let mut values = vec![Vec::new(); table.width()];
        let mut first = 0;
        for (number, episode) in (0_u64..).zip(&self.episodes) {
            let last = first + episode.frames;
            let row = [number, episode.frames, number / FILES_PER_CHUNK, number % FILES_PER_CHUNK, first, last, 0, 0];
            for (to, number) in values.iter_mut().zip(row) {
                to.extend_from_slice(&number.to_le_bytes());
            }
            if let Some(tasks) = values.last_mut() {
                put_bytes(self.task.as_bytes(), tasks)?;
            }
            first = last;
        }
        let mut out = self.file("meta/episodes/chunk-000/file-000.parquet")?;
        table.write(&mut out, self.episodes.len(), &values)?;
        table.finish(&mut out, &[])?;
        Ok(out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?)
    }

    fn info(&self) -> Value {
        let (episodes, frames) = (self.episodes.len(), self.episodes.iter().map(|episode| episode.frames).sum::<u64>());
        let mut features = feature_info(&self.features);
        for (name, kind) in COMMON {
            features.insert(name.into(), json!({ "dtype": kind, "shape": [1], "names": null }));
        }
        json!({
            "codebase_version": "v3.0",
            "robot_type": null,
            "total_episodes": episodes,
            "total_frames": frames,
            "total_tasks": 1,
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": { "train": format!("0:{episodes}") },
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": null,
            "features": features,
        })
    }

    /// Writes the indices of all frames in the dataset, which are known only now.
    fn write_frame_indices(&self) -> io::Result<()> {
        let mut next = 0_u64;
        for episode in &self.episodes {
            let mut file = self.disk.storage(OpenOptions::new().write(true).open(&episode.file)?);
            for (at, rows) in &episode.index {
                file.seek(SeekFrom::Start(*at))?;
                let numbers: Vec<u8> = (next..next + rows).flat_map(u64::to_le_bytes).collect();
                file.write_all(&numbers)?;
                next += rows;
            }
            file.sync()?;
        }
        Ok(())
    }
}

fn data_file(episode: u64) -> String {
    format!("data/chunk-{:03}/file-{:03}.parquet", episode / FILES_PER_CHUNK, episode % FILES_PER_CHUNK)
}

impl OpenEpisode {
    /// Opens the file for appending. Files are open only during writes, because there may be thousands.
    fn open(&self, disk: &StorageFactory) -> io::Result<Box<dyn Storage>> {
        self.file.parent().map_or(Ok(()), fs::create_dir_all)?;
        Ok(disk.storage(OpenOptions::new().create(true).append(true).open(&self.file)?))
    }

    fn write(&mut self, disk: &StorageFactory) -> WriteResult {
        if self.rows > 0 {
            let mut out = BufWriter::new(self.open(disk)?);
            self.table.write(&mut out, self.rows, &self.values)?;
            out.flush()?;
            self.values.iter_mut().for_each(Vec::clear);
            self.rows = 0;
        }
        Ok(())
    }
}

/// Size of all files of a folder \[bytes\].
fn folder_size(folder: &Path) -> io::Result<u64> {
    let mut bytes = 0;
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        bytes += if entry.file_type()?.is_dir() { folder_size(&entry.path())? } else { entry.metadata()?.len() };
    }
    Ok(bytes)
}
