//! Videos of a dataset: the frames of each camera as H.264 in MP4 files, each with the frames of many episodes.
//!
//! Each episode is a stream of its own, which begins with an IDR frame. Its coded frames wait in the buffer of the
//! episode, and are appended to the file when the episode ends. LeRobot finds a frame by its time in the file:
//! `from_timestamp` of the episode and the `timestamp` of the frame.

use crate::animation::Output;
use crate::animation::h264::{BT601, H264Encoder, ParameterSets, StreamCfg};
use crate::animation::mp4::Mp4Writer;
use crate::episodes::ImageFeature;
use crate::file::StorageFactory;
use crate::writer::{WriteError, WriteResult};
use serde_json::{Value, json};
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

/// Number of frames from one IDR frame to the next. Training reads frames in random order, and a decoder begins at an
/// IDR frame: this is `g` of LeRobot's own encoder.
const IDR_INTERVAL: u32 = 2;

/// Units of time per second are the smallest multiple of the frame rate from here on, so that each frame has the same
/// duration and its exact time.
const MIN_UNITS_PER_SECOND: u32 = 90_000;

/// An MiB, the unit of file sizes in `meta/info.json`.
const MIB: u64 = 1 << 20;

/// Largest files. A longer episode is a file of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileLimits {
    /// Size \[MiB\].
    pub(super) mib: u64,
    /// Duration \[s\].
    pub(super) seconds: u64,
}

/// LeRobot's limit of the size.
///
/// LeRobot compares times in f32, and accepts a difference of 1e-4 s. The times that it compares differ by rounding only,
/// so by one unit in the last place: below 1024 s that is at most 6.1e-5 s, above at least 1.2e-4 s. In an episode that
/// begins at 0 they are equal.
pub(super) const FILE_LIMITS: FileLimits = FileLimits { mib: 200, seconds: 1024 };

/// Properties of the stream of a camera.
///
/// The colors are those of BT.601, because PyAV 15, which LeRobot requires, converts by them what any file says. Readers
/// that follow the file find the same matrix there.
fn stream_cfg(size: [usize; 2]) -> StreamCfg {
    StreamCfg { size, colors: &BT601, idr_interval: IDR_INTERVAL }
}

/// Encoder of the images of a camera in an episode.
pub(super) struct EpisodeStream {
    encoder: H264Encoder,
    /// Size of the coded frames \[bytes\].
    bytes: u64,
}

impl EpisodeStream {
    pub(super) fn new(size: [usize; 2]) -> WriteResult<Self> {
        let encoder = H264Encoder::new(stream_cfg(size)).map_err(WriteError::limit)?;
        Ok(Self { encoder, bytes: 0 })
    }

    /// Encodes the next frame from RGBA pixels.
    pub(super) fn encode(&mut self, rgba: &[u8]) -> WriteResult<Vec<u8>> {
        let units = self.encoder.encode(rgba).map_err(WriteError::limit)?.to_vec();
        self.bytes += units.len() as u64;
        Ok(units)
    }
}

/// Frames of an episode in the files of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EpisodeRange {
    /// Number of the file.
    pub(super) file: u64,
    /// Number of the first frame in the file, and of the frame after the last.
    pub(super) frames: [u64; 2],
}

/// Writer of the files of a camera.
pub(super) struct VideoWriter {
    /// Name of the feature.
    pub(super) name: String,
    cfg: StreamCfg,
    fps: u32,
    limits: FileLimits,
    folder: PathBuf,
    open: Option<OpenFile>,
    /// Number of files.
    files: u64,
    /// Complete episodes, in the order of their ends.
    pub(super) episodes: Vec<EpisodeRange>,
}

/// A file that is not complete.
struct OpenFile {
    out: Output,
    file: Mp4Writer,
    sets: ParameterSets,
    frames: u64,
    bytes: u64,
}

impl VideoWriter {
    /// Creates a writer below the folder of a dataset.
    pub(super) fn new(image: &ImageFeature, fps: u32, folder: &Path, limits: FileLimits) -> Self {
        Self {
            name: image.name.clone(),
            cfg: stream_cfg(image.size),
            fps,
            limits,
            folder: folder.into(),
            open: None,
            files: 0,
            episodes: Vec::new(),
        }
    }

    /// Units of time per second, and of a frame.
    fn time_units(&self) -> [u32; 2] {
        let of_frame = MIN_UNITS_PER_SECOND.div_ceil(self.fps);
        [self.fps * of_frame, of_frame]
    }

    /// Begins an episode with this number of frames, which follow by [`add`](Self::add): in the present file, or in the
    /// next one if the present one would exceed the limits.
    pub(super) fn begin(&mut self, frames: u64, stream: &EpisodeStream, disk: &StorageFactory) -> WriteResult {
        let FileLimits { mib, seconds } = self.limits;
        let too_large = |open: &OpenFile| {
            open.bytes + stream.bytes >= mib * MIB || open.frames + frames > seconds * u64::from(self.fps)
        };
        if self.open.as_ref().is_some_and(too_large) {
            self.finish()?;
        }
        let first = match &mut self.open {
            Some(open) => {
                let first = open.frames;
                (open.frames, open.bytes) = (first + frames, open.bytes + stream.bytes);
                first
            }
            None => {
                let path = self.folder.join(file_name(&self.name, self.files));
                path.parent().map_or(Ok(()), fs::create_dir_all)?;
                let out = BufWriter::with_capacity(1 << 16, disk.storage(File::create(path)?));
                let file = Mp4Writer::new(&self.cfg, self.time_units()[0]);
                // Streams of the same size have the same parameter sets.
                let sets = stream.encoder.parameter_sets().clone();
                self.open = Some(OpenFile { out, file, sets, frames, bytes: stream.bytes });
                self.files += 1;
                0
            }
        };
        self.episodes.push(EpisodeRange { file: self.files - 1, frames: [first, first + frames] });
        Ok(())
    }

    /// Writes the next frame of the episode, as encoded by its stream.
    ///
    /// Two IDR frames may follow each other where an episode ends, with the same `idr_pic_id`. In an MP4 file, this
    /// number is not needed to separate frames: each is a sample.
    pub(super) fn add(&mut self, units: &[u8]) -> WriteResult {
        let [_, duration] = self.time_units();
        match &mut self.open {
            Some(OpenFile { out, file, .. }) => file.add(out, units, duration),
            None => Ok(()),
        }
    }

    /// Completes the present file, if there is one.
    pub(super) fn finish(&mut self) -> WriteResult {
        let Some(OpenFile { mut out, file, sets, .. }) = self.open.take() else { return Ok(()) };
        file.finish(&mut out, &sets)?;
        Ok(out.into_inner().map_err(io::IntoInnerError::into_error)?.sync()?)
    }

    /// Time in the file \[s\].
    pub(super) fn time(&self, frame: u64) -> f64 {
        frame as f64 / f64::from(self.fps)
    }
}

/// Path of a file in the dataset.
fn file_name(feature: &str, file: u64) -> String {
    let [chunk, file] = super::chunk_and_file(file);
    format!("videos/{feature}/chunk-{chunk:03}/file-{file:03}.mp4")
}

/// Description of the stream of a camera, in the terms of LeRobot (`get_video_info`).
pub(super) fn info([width, height]: [usize; 2], fps: u32) -> Value {
    json!({
        "video.height": height,
        "video.width": width,
        "video.codec": "h264",
        "video.pix_fmt": "yuv420p",
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": false,
        "video.g": IDR_INTERVAL,
        "is_depth_map": false,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn image(size: [usize; 2]) -> ImageFeature {
        ImageFeature { stream: 0, name: "observation.images.camera".into(), size }
    }

    /// Writes episodes of these numbers of frames, and returns their ranges.
    fn ranges(folder: &Path, fps: u32, limits: FileLimits, lengths: &[u64]) -> Vec<EpisodeRange> {
        let disk = StorageFactory::default();
        let mut writer = VideoWriter::new(&image([16, 16]), fps, folder, limits);
        for frames in lengths {
            let mut stream = EpisodeStream::new([16, 16]).unwrap();
            // Noise: some hundred bytes for each frame.
            let rgba = |seed: u32| -> Vec<u8> {
                (0..1024_u32).map(|k| ((k ^ seed).wrapping_mul(2_654_435_761) >> 24) as u8).collect()
            };
            let units: Vec<Vec<u8>> = (0..*frames).map(|k| stream.encode(&rgba(k as u32 * 977)).unwrap()).collect();
            writer.begin(*frames, &stream, &disk).unwrap();
            units.iter().for_each(|units| writer.add(units).unwrap());
        }
        writer.finish().unwrap();
        writer.episodes
    }

    /// A file ends before the episode with which it would be too long. An episode that is too long alone has a file.
    #[test]
    fn durations() {
        let folder = tempfile::tempdir().unwrap();
        let limits = FileLimits { mib: 200, seconds: 3 };
        let found = ranges(folder.path(), 10, limits, &[10, 20, 1, 29, 40, 5, 25]);
        let expected =
            [(0, [0, 10]), (0, [10, 30]), (1, [0, 1]), (1, [1, 30]), (2, [0, 40]), (3, [0, 5]), (3, [5, 30])];
        assert_eq!(found, expected.map(|(file, frames)| EpisodeRange { file, frames }));
        for file in 0..4 {
            let path = folder.path().join(file_name("observation.images.camera", file));
            assert!(path.is_file(), "{}", path.display());
        }
        assert!(!folder.path().join(file_name("observation.images.camera", 4)).exists());
    }

    /// The coded frames of a file take less than the limit.
    #[test]
    fn sizes() {
        let folder = tempfile::tempdir().unwrap();
        let found = ranges(folder.path(), 1000, FileLimits { mib: 1, seconds: 1000 }, &[1000; 9]);
        let files: Vec<u64> = found.iter().map(|range| range.file).collect();
        assert!(files[8] >= 2 && files.is_sorted(), "{files:?}");
        for file in 0..=files[8] {
            let bytes = folder.path().join(file_name("observation.images.camera", file)).metadata().unwrap().len();
            let of_file: Vec<_> = found.iter().filter(|range| range.file == file).collect();
            assert_eq!(of_file[0].frames[0], 0);
            // The table has an offset of 8 bytes and a size of 4 for each frame, and 4 more for each IDR frame.
            assert!(bytes < MIB + 14 * 1000 * of_file.len() as u64 + 2000, "{file}: {bytes}");
        }
    }

    /// LeRobot accepts the time of every frame: `decode_video_frames` compares, in f32, the sum of `from_timestamp` and
    /// of `timestamp`, which is stored in f32, with the time of the frame in the video.
    #[test]
    fn tolerance() {
        let largest = |seconds: u64, fps: u64, frames: u64| -> f32 {
            let mut largest = 0.0_f32;
            for first in (0..=seconds * fps - frames).step_by(frames as usize) {
                for k in 0..frames {
                    let queried = (first as f64 / fps as f64 + f64::from((k as f64 / fps as f64) as f32)) as f32;
                    let found = ((first + k) as f64 / fps as f64) as f32;
                    largest = largest.max((queried - found).abs());
                }
            }
            largest
        };
        for fps in [7, 24, 30, 50, 60, 100] {
            for seconds in [5, 333] {
                assert!(largest(FILE_LIMITS.seconds, fps, seconds * fps + 1) <= 1e-4, "{fps} {seconds}");
            }
        }
        // Control: in a file of twice the length some times differ too much.
        assert!(largest(2 * FILE_LIMITS.seconds, 30, 333 * 30 + 1) > 1e-4);
    }

    /// Units of time are whole for any frame rate.
    #[test]
    fn time_units() {
        for (fps, expected) in
            [(1, [90_000, 90_000]), (30, [90_000, 3_000]), (70, [90_020, 1_286]), (200_000, [200_000, 1])]
        {
            let writer = VideoWriter::new(&image([16, 16]), fps, Path::new(""), FILE_LIMITS);
            assert_eq!(writer.time_units(), expected);
        }
        let fastest = VideoWriter::new(&image([16, 16]), u32::MAX, Path::new(""), FILE_LIMITS);
        assert_eq!(fastest.time_units(), [u32::MAX, 1]);
    }
}
