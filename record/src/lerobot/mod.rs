//! LeRobot datasets, version 3.0: a folder with a Parquet file for each episode, videos of the cameras, and metadata.

mod episode_buffer;
mod statistics;
mod table;
mod videos;

use crate::animation::h264;
use crate::cfg::RecorderCfg;
use crate::episodes::{self, DatasetWriter, EpisodeFrame, EpisodeSplitter, Features, Role};
use crate::error::{RecordError, Result};
use crate::file::{Storage, StorageFactory};
use crate::folder::PartialFolder;
use crate::format::Format;
use crate::png::PngWriter;
use crate::stream::StreamSchema;
use crate::writer::{FormatWriter, WriteError, WriteResult};
use episode_buffer::{BufferedFrame, EpisodeBuffer};
use serde_json::{Map, Value, json};
use statistics::{ImageStatistics, Statistics};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use table::{Column, ColumnType, TableWriter};
use videos::{EpisodeStream, FILE_LIMITS, VideoWriter};

/// The metadata file that makes a folder a dataset. It is written last.
const INFO: &str = "meta/info.json";
/// Folder of the frames of episodes in progress; it does not exist in a complete dataset.
const BUFFERS: &str = "buffers";
/// The file that marks a folder as that of a recorder, which may be replaced. It is locked while the recorder exists.
const MARKER: &str = "meta/.kinetoscope";

/// Number of files in a folder.
const FILES_PER_CHUNK: u64 = 1000;

/// A row group of a Parquet file is written at this number of rows or bytes of images.
const GROUP_ROWS: usize = 256;
const GROUP_BYTES: usize = 1 << 20;

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
    fps: u32,
    task: String,
    features: Arc<Features>,
    /// Columns of the tables of frames.
    columns: Vec<(String, ColumnType)>,
    /// Videos of the cameras, in the order of the image features; empty if their images are in the tables.
    videos: Vec<VideoWriter>,
    /// The present episode of each recorded environment; `None` without an episode.
    open_episodes: Vec<Option<OpenEpisode>>,
    /// Number of frames of each complete episode, in the order of their ends.
    episodes: Vec<u64>,
    statistics: Vec<Statistics>,
    png: PngWriter,
}

/// An episode in progress.
struct OpenEpisode {
    buffer: EpisodeBuffer,
    /// Encoders of the videos.
    streams: Vec<EpisodeStream>,
}

/// An image, with its statistics.
struct StoredImage {
    /// A PNG file; RGBA pixels for a video, in which a frame depends on the frame before it.
    bytes: Vec<u8>,
    statistics: ImageStatistics,
}

/// Frames per second, which must be a whole number.
///
/// # Errors
/// The rate of the recording is not a whole number.
fn frames_per_second(path: &Path, dt: f64, period_steps: u64) -> Result<u32> {
    let found = 1.0 / (dt * period_steps as f64);
    let whole = found.round();
    // The tolerance is a thousandth of a frame per hour.
    if whole >= 1.0 && (found - whole).abs() < 1e-8 * whole {
        // A time step of physics is at least 1e-9 s.
        return Ok(whole as u32);
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
    let RecorderCfg { path, period_steps, overwrite, task, use_videos, .. } = cfg;
    let fps = frames_per_second(path, dt, *period_steps)?;
    let features = Arc::new(Features::of(path, Format::LeRobot, streams, name_of)?);
    if *use_videos {
        check_videos(path, &features)?;
    }
    let statistics = features.numbers.iter().map(|feature| Statistics::new(feature.names.len()));
    let statistics = statistics.chain(features.images.iter().map(|_| Statistics::new(3)));
    // Statistics of rewards and ends.
    let of_outcome = features.result_stream.iter().flat_map(|_| [1, 1].map(Statistics::new));
    let statistics = statistics.chain(of_outcome).collect();
    let envs = episodes::environments(path, streams)?;
    let (folder, lock) = PartialFolder::create(path, *overwrite, MARKER)?;
    let images = features.images.iter().filter(|_| *use_videos);
    let videos: Vec<VideoWriter> =
        images.map(|image| VideoWriter::new(image, fps, folder.partial_path(), FILE_LIMITS)).collect();
    let dataset = LeRobotWriter {
        folder,
        disk: disk.clone(),
        _lock: lock,
        fps,
        task: task.clone(),
        columns: columns(&features, videos.is_empty()),
        features: Arc::clone(&features),
        videos,
        open_episodes: envs.iter().map(|_| None).collect(),
        episodes: Vec::new(),
        statistics,
        png: PngWriter::default(),
    };
    Ok(Box::new(EpisodeSplitter::new(dataset, features, *period_steps, &envs, streams)))
}

/// Checks that videos can have the images of all cameras.
///
/// # Errors
/// A width or height is odd or too large.
fn check_videos(path: &Path, features: &Features) -> Result<()> {
    for image in &features.images {
        let [width, height] = image.size;
        h264::check_size(image.size).map_err(|sizes| RecordError::UnsupportedSize {
            path: path.into(),
            format: Format::LeRobot,
            width,
            height,
            supported: format!(
                "{}: in a video, {sizes}; change the size of the camera, or set `use_videos` to false for PNG images",
                image.name
            ),
        })?;
    }
    Ok(())
}

/// Columns of a frame; `has_images` is true if they include images.
fn columns(features: &Features, has_images: bool) -> Vec<(String, ColumnType)> {
    let numbers =
        features.numbers.iter().map(|feature| (feature.name.clone(), ColumnType::Float32(feature.names.len())));
    let images = features.images.iter().filter(|_| has_images).map(|image| (image.name.clone(), ColumnType::Image));
    let outcome = [(REWARD, ColumnType::Float32(1)), (DONE, ColumnType::Bool)];
    let outcome =
        outcome.into_iter().filter(|_| features.result_stream.is_some()).map(|(name, kind)| (name.to_string(), kind));
    let common = COMMON.iter().map(|(name, kind)| {
        (name.to_string(), if *kind == "int64" { ColumnType::Int64 } else { ColumnType::Float32(1) })
    });
    numbers.chain(images).chain(outcome).chain(common).collect()
}

/// Features, as described in `meta/info.json`; `fps` is the frame rate of videos, `None` without videos.
fn feature_info(features: &Features, fps: Option<u32>) -> Map<String, Value> {
    let numbers = features.numbers.iter().map(|feature| {
        let names = &feature.names;
        (feature.name.clone(), json!({ "dtype": "float32", "shape": [names.len()], "names": names }))
    });
    let images = features.images.iter().map(|image| {
        let (names, [width, height]) = (["height", "width", "channels"], image.size);
        let mut about = json!({ "dtype": "image", "shape": [height, width, 3], "names": names });
        if let Some(fps) = fps {
            about["dtype"] = "video".into();
            about["info"] = videos::info(image.size, fps);
        }
        (image.name.clone(), about)
    });
    let outcome = [(REWARD, "float32"), (DONE, "bool")].into_iter().filter(|_| features.result_stream.is_some());
    let outcome = outcome.map(|(name, kind)| (name.to_string(), json!({ "dtype": kind, "shape": [1], "names": null })));
    numbers.chain(images).chain(outcome).collect()
}

impl DatasetWriter for LeRobotWriter {
    type Image = StoredImage;

    fn store_image(&mut self, rgba: &[u8], size: [usize; 2]) -> WriteResult<StoredImage> {
        let pixels = if self.videos.is_empty() { self.png.encode_rgb(rgba, size)? } else { rgba };
        Ok(StoredImage { bytes: pixels.to_vec(), statistics: ImageStatistics::new(rgba) })
    }

    fn begin(&mut self, env: usize) -> WriteResult {
        if self.open_episodes[env].is_none() {
            let path = self.folder.partial_path().join(format!("{BUFFERS}/env_{env}"));
            let streams = self.features.images.iter().filter(|_| !self.videos.is_empty());
            let streams = streams.map(|image| EpisodeStream::new(image.size)).collect::<WriteResult<_>>()?;
            self.open_episodes[env] = Some(OpenEpisode { buffer: EpisodeBuffer::new(path), streams });
        }
        Ok(())
    }

    fn add(&mut self, env: usize, frame: &EpisodeFrame<StoredImage>) -> WriteResult {
        let EpisodeFrame { numbers, images, reward, done } = frame;
        let numbers: Vec<Vec<f32>> = numbers.iter().map(|of| of.iter().map(|x| *x as f32).collect()).collect();
        let mut statistics = self.statistics.iter_mut();
        numbers.iter().zip(&mut statistics).for_each(|(values, statistics)| statistics.add(values));
        images.iter().zip(&mut statistics).for_each(|(image, statistics)| statistics.add_image(&image.statistics));
        let results = [*reward as f32, f32::from(u8::from(*done))];
        statistics.zip(results).for_each(|(statistics, value)| statistics.add(&[value]));
        let Some(OpenEpisode { buffer, streams }) = &mut self.open_episodes[env] else { return Ok(()) };
        let images = match streams.is_empty() {
            true => images.iter().map(|image| image.bytes.clone()).collect(),
            false => {
                let pairs = streams.iter_mut().zip(images);
                pairs.map(|(stream, image)| stream.encode(&image.bytes)).collect::<WriteResult<_>>()?
            }
        };
        let frame = BufferedFrame { numbers: numbers.concat(), images, reward: *reward as f32, done: *done };
        Ok(buffer.push(&frame, &self.disk)?)
    }

    /// Writes the Parquet file of the open episode of `env`, if any, and appends its frames to the videos; `env` counts
    /// the recorded environments.
    fn end(&mut self, env: usize) -> WriteResult {
        let Some(OpenEpisode { buffer, streams }) = self.open_episodes[env].take() else { return Ok(()) };
        let (episode, first) = (self.episodes.len() as u64, self.episodes.iter().sum());
        let frames = buffer.frames();
        let file = self.file(&data_file(episode))?;
        let mut table = TableWriter::create(file, &self.columns, &[])?;
        let values = self.features.numbers.iter().map(|feature| feature.names.len()).sum();
        let images = self.features.images.len();
        let mut group = RowGroup::new(&self.features, &self.columns, self.fps, episode, first);
        let videos = &mut self.videos;
        videos.iter_mut().zip(&streams).try_for_each(|(video, stream)| video.begin(frames, stream, &self.disk))?;
        buffer.drain(values, images, &self.disk, |frame| {
            videos.iter_mut().zip(&frame.images).try_for_each(|(video, units)| video.add(units))?;
            group.push(frame);
            if group.is_full() { table.write(&group.take_columns()) } else { Ok(()) }
        })?;
        if group.rows > 0 {
            table.write(&group.take_columns())?;
        }
        table.finish()?;
        self.episodes.push(frames);
        Ok(())
    }

    fn finish(&mut self) -> WriteResult<u64> {
        if self.episodes.is_empty() {
            return Err(WriteError::NoFrame(episodes::NO_FRAME));
        }
        // A folder of buffer files is empty now. It does not exist if all episodes were short.
        match fs::remove_dir(self.folder.partial_path().join(BUFFERS)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
        self.videos.iter_mut().try_for_each(VideoWriter::finish)?;
        self.write_tasks()?;
        self.write_episodes()?;
        let mut out = BufWriter::new(self.file("meta/stats.json")?);
        let names = self.features.names().chain([REWARD, DONE]);
        let of_all = names.zip(&self.statistics).map(|(name, one)| (name.to_string(), one.to_json()));
        out.write_all(format!("{:#}\n", Value::Object(of_all.collect())).as_bytes())?;
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?;
        // Written last, and renamed when complete, because it makes the folder a dataset.
        let unfinished = format!("{INFO}.part");
        let mut out = BufWriter::new(self.file(&unfinished)?);
        out.write_all(format!("{:#}\n", self.info()).as_bytes())?;
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?;
        fs::rename(self.folder.partial_path().join(unfinished), self.folder.partial_path().join(INFO))?;
        let bytes = folder_size(self.folder.partial_path())?;
        self.folder.commit()?;
        Ok(bytes)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        Some(self.folder.partial_path().into())
    }
}

impl LeRobotWriter {
    fn file(&self, name: &str) -> io::Result<Box<dyn Storage>> {
        let path = self.folder.partial_path().join(name);
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        Ok(self.disk.storage(File::create(path)?))
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
        let columns = [("task_index".into(), ColumnType::Int64), (index.into(), ColumnType::String)];
        let file = self.file("meta/tasks.parquet")?;
        let mut table = TableWriter::create(file, &columns, &[("pandas", about.to_string())])?;
        table.write(&[Column::Int64(vec![0]), Column::String(vec![self.task.as_str().into()])])?;
        table.finish()
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
        let mut values = vec![Vec::new(); numbers.len()];
        let mut first = 0;
        for (number, frames) in (0_u64..).zip(&self.episodes) {
            let last = first + frames;
            let [chunk, file] = chunk_and_file(number);
            let row = [number, *frames, chunk, file, first, last, 0, 0];
            values.iter_mut().zip(row).for_each(|(to, number)| to.push(number as i64));
            first = last;
        }
        let mut values: Vec<Column> = values.into_iter().map(Column::Int64).collect();
        values.push(Column::String(vec![self.task.as_str().into(); self.episodes.len()]));
        for video in &self.videos {
            let files =
                [0, 1].map(|k| video.episodes.iter().map(|range| chunk_and_file(range.file)[k] as i64).collect());
            let times = [0, 1].map(|k| video.episodes.iter().map(|range| video.time(range.frames[k])).collect());
            for (name, values_of) in ["chunk_index", "file_index"].into_iter().zip(files) {
                columns.push((format!("videos/{}/{name}", video.name), ColumnType::Int64));
                values.push(Column::Int64(values_of));
            }
            for (name, values_of) in ["from_timestamp", "to_timestamp"].into_iter().zip(times) {
                columns.push((format!("videos/{}/{name}", video.name), ColumnType::Float64));
                values.push(Column::Float64(values_of));
            }
        }
        let mut table = TableWriter::create(self.file("meta/episodes/chunk-000/file-000.parquet")?, &columns, &[])?;
        table.write(&values)?;
        table.finish()
    }

    fn info(&self) -> Value {
        let (episodes, frames) = (self.episodes.len(), self.episodes.iter().sum::<u64>());
        let has_videos = !self.videos.is_empty();
        let mut features = feature_info(&self.features, has_videos.then_some(self.fps));
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
            "video_files_size_in_mb": FILE_LIMITS.mib,
            "fps": self.fps,
            "splits": { "train": format!("0:{episodes}") },
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": has_videos.then_some("videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"),
            "features": features,
        })
    }
}

fn data_file(episode: u64) -> String {
    let [chunk, file] = chunk_and_file(episode);
    format!("data/chunk-{chunk:03}/file-{file:03}.parquet")
}

/// Number of the folder of a file, and its number in the folder.
fn chunk_and_file(file: u64) -> [u64; 2] {
    [file / FILES_PER_CHUNK, file % FILES_PER_CHUNK]
}

/// Columns of the frames of an episode that are written next.
struct RowGroup<'a> {
    features: &'a Features,
    column_types: &'a [(String, ColumnType)],
    fps: u32,
    episode: u64,
    /// Index of the next frame in the episode.
    frame: u64,
    /// Index of the next frame in the dataset.
    index: u64,
    rows: usize,
    image_bytes: usize,
    columns: Vec<Column>,
}

impl<'a> RowGroup<'a> {
    /// Begins an episode of this number, whose first frame has the index `first` in the dataset.
    fn new(
        features: &'a Features,
        column_types: &'a [(String, ColumnType)],
        fps: u32,
        episode: u64,
        first: u64,
    ) -> Self {
        let columns = empty_columns(column_types);
        Self { features, column_types, fps, episode, frame: 0, index: first, rows: 0, image_bytes: 0, columns }
    }

    fn push(&mut self, frame: BufferedFrame) {
        let mut numbers = self.features.numbers.iter().scan(0, |first, feature| {
            let range = *first..*first + feature.names.len();
            *first = range.end;
            frame.numbers.get(range)
        });
        let time = (self.frame as f64 / f64::from(self.fps)) as f32;
        // Timestamp after reward; task 0 last.
        let mut floats = self.features.result_stream.map(|_| frame.reward).into_iter().chain([time]);
        let mut integers = [self.frame, self.episode, self.index, 0].into_iter();
        let name = format!("frame-{:06}.png", self.frame);
        let mut images = frame.images.into_iter();
        for column in &mut self.columns {
            match column {
                Column::Float32(values) => match numbers.next() {
                    Some(feature) => values.extend_from_slice(feature),
                    None => values.extend(floats.next()),
                },
                Column::Image(files, names) => {
                    let file = images.next().unwrap_or_default();
                    self.image_bytes += file.len();
                    files.push(file.into());
                    names.push(name.as_str().into());
                }
                Column::Bool(values) => values.push(frame.done),
                Column::Int64(values) => values.extend(integers.next().map(|number| number as i64)),
                Column::String(_) | Column::Float64(_) => {}
            }
        }
        self.frame += 1;
        self.index += 1;
        self.rows += 1;
    }

    fn is_full(&self) -> bool {
        self.rows >= GROUP_ROWS || self.image_bytes >= GROUP_BYTES
    }

    fn take_columns(&mut self) -> Vec<Column> {
        (self.rows, self.image_bytes) = (0, 0);
        std::mem::replace(&mut self.columns, empty_columns(self.column_types))
    }
}

fn empty_columns(columns: &[(String, ColumnType)]) -> Vec<Column> {
    let empty = |(_, kind): &(String, ColumnType)| match kind {
        ColumnType::Int64 => Column::Int64(Vec::new()),
        ColumnType::Bool => Column::Bool(Vec::new()),
        ColumnType::Float64 => Column::Float64(Vec::new()),
        ColumnType::Float32(_) => Column::Float32(Vec::new()),
        ColumnType::String | ColumnType::StringList => Column::String(Vec::new()),
        ColumnType::Image => Column::Image(Vec::new(), Vec::new()),
    };
    columns.iter().map(empty).collect()
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
