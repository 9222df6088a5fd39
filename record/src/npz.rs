//! NumPy archives.
//!
//! | member | shape | content |
//! |---|---|---|
//! | `arm/joint_states/positions` | (T, N, joints) | f64, as all states and numeric sensors |
//! | `camera/color`, `camera/depth` | (T, N, H, W, 4), (T, N, H, W) | u8, f32 |
//! | `arm/joint_states/time` | (T, N) | simulation time of capture \[s\] |
//! | `joints/force_time` | (T, N) | time of efforts and forces, if measured at another instant \[s\] |
//! | `arm/joint_states/step` | (T,) | physics steps since the recording began, f64 |
//! | `events/{step,env,kind,time}` | (E,) | kind 0: reset, 1: written, 2: diverged, 3: note |
//! | `notes.jsonl` | | a line of JSON for each event with a text: `event` is its row |
//! | `recording.json` | | time step, environments, names of joints, frames and bodies, units, distortion, mask ids |
//! | `scene.zip` | | the scene, as MJCF with meshes: see `scene_file.rs` |
//! | `start.snapshot` | | initial state of all environments, for `Snapshot::load` |
//!
//! An environment without a new value in a row, because its sensor measures at other times, repeats its last value and
//! time.
//!
//! A reset or a write adds a row of the states of all environments. With
//! [`RecorderCfg::period_steps`](crate::RecorderCfg::period_steps) above 1, the states of the other environments in
//! such a row lie between two of their regular rows. They have the time at which they were read.
//!
//! Until the end, rows are in unnamed files in the same folder. A killed process leaves only an empty `NAME.part`.

use crate::archive::ArchiveWriter;
use crate::file::{PartialFile, Storage, parent_dir};
use crate::packet::{Event, Packet, StreamRows};
use crate::scene_file::SCENE_ARCHIVE;
use crate::stream::{ElementType, StreamField, StreamKind, StreamSchema};
use crate::writer::{FormatWriter, WriteError, WriteResult};
use kinetoscope_scene::npy;
use kinetoscope_sim::{MaskId, Snapshot};
use serde_json::{Value, json};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Name of the member that describes the others.
pub(crate) const METADATA: &str = "recording.json";
/// Name of the member with the texts of events.
const NOTES: &str = "notes.jsonl";
/// Name of the member with the initial state.
pub(crate) const INITIAL_STATE: &str = "start.snapshot";

/// Writer of a NumPy archive.
pub(crate) struct NpzWriter {
    part: PartialFile,
    storage: Option<Box<dyn Storage>>,
    metadata: Value,
    start: Vec<u8>,
    scene: Option<Vec<u8>>,
    buffers: Vec<BufferFile>,
    /// Events, one record each: step, environment, kind, time.
    events: BufferFile,
    /// Texts of events, a line of JSON each.
    notes: BufWriter<File>,
}

/// Buffer file for the rows of a stream. A record contains the step, one or two times of each environment, then each
/// field of all environments.
struct BufferFile {
    file: BufWriter<File>,
    rows: usize,
    record: Vec<u8>,
}

/// Byte ranges of the numbers in the record of an event.
const EVENT_FIELDS: [(&str, ElementType, Range<usize>); 4] = [
    ("step", ElementType::F64, 0..8),
    ("env", ElementType::I32, 8..12),
    ("kind", ElementType::U8, 12..13),
    ("time", ElementType::F64, 13..21),
];

impl NpzWriter {
    pub(crate) fn create(
        part: PartialFile,
        storage: Box<dyn Storage>,
        streams: &[StreamSchema],
        masks: &[MaskId],
        dt: f64,
        start: &Snapshot,
        scene: Option<&[u8]>,
    ) -> io::Result<Self> {
        let folder = parent_dir(part.path());
        let buffers = streams.iter().map(|_| BufferFile::create(folder)).collect::<io::Result<_>>()?;
        let (start, events) = (snapshot_bytes(start, folder)?, BufferFile::create(folder)?);
        let scene = scene.map(<[u8]>::to_vec);
        let (metadata, notes) = (metadata(streams, masks, dt), BufWriter::new(tempfile::tempfile_in(folder)?));
        Ok(Self { part, storage: Some(storage), metadata, start, scene, buffers, events, notes })
    }
}

/// Serializes a snapshot to the bytes of its file, through a temporary file in `folder`.
pub(crate) fn snapshot_bytes(start: &Snapshot, folder: &Path) -> io::Result<Vec<u8>> {
    let scratch = tempfile::tempdir_in(folder)?;
    let path = scratch.path().join(INITIAL_STATE);
    start.save(&path).map_err(io::Error::other)?;
    std::fs::read(path)
}

/// Describes the content of a recording as JSON.
pub(crate) fn metadata(streams: &[StreamSchema], masks: &[MaskId], dt: f64) -> Value {
    let stream = |stream: &StreamSchema| {
        let names = Some(stream.kind.names()).filter(|names| !names.is_empty());
        let filters = match &stream.kind {
            StreamKind::SensorValues { filters, .. } if !filters.is_empty() => Some(filters),
            _ => None,
        };
        let distortion = match &stream.kind {
            StreamKind::CameraInfo { distortion, .. } => distortion.as_ref(),
            _ => None,
        };
        let distortion = distortion.map(|lens| json!({ "model": lens.model, "coefficients": lens.coefficients }));
        let part = |part: &StreamField| {
            let name = array_name(stream, &part.name);
            let mut about = json!({ "name": name, "shape": part.shape, "of_forces": part.at_force_time });
            if !part.unit.is_empty() {
                about["unit"] = json!(part.unit);
            }
            about
        };
        let parts = stream.fields.iter().map(part);
        json!({
            "name": stream.name,
            "env_ids": stream.env_ids,
            "arrays": parts.collect::<Vec<_>>(),
            "columns": names,
            "filters": filters,
            "distortion": distortion,
        })
    };
    let mask = |mask: &MaskId| json!({ "id": mask.id, "name": mask.name(), "class": mask.class });
    json!({
        "recording": 1,
        "physics_dt": dt,
        "mujoco_version": kinetoscope_mujoco::version_string(),
        "mask_ids": masks.iter().map(mask).collect::<Vec<_>>(),
        "streams": streams.iter().map(stream).collect::<Vec<_>>(),
    })
}

/// Names of all arrays of a stream.
pub(crate) fn array_names(stream: &StreamSchema) -> impl Iterator<Item = String> {
    let times = ["step", "time"].into_iter().chain(stream.has_two_stamps().then_some("force_time"));
    times
        .map(|name| format!("{}/{name}", stream.name))
        .chain(stream.fields.iter().map(|part| array_name(stream, &part.name)))
}

/// Name of the array of a field.
pub(crate) fn array_name(stream: &StreamSchema, part: &str) -> String {
    if part.is_empty() { stream.name.clone() } else { format!("{}/{part}", stream.name) }
}

impl BufferFile {
    fn create(folder: &Path) -> io::Result<Self> {
        let file = BufWriter::with_capacity(1 << 16, tempfile::tempfile_in(folder)?);
        Ok(Self { file, rows: 0, record: Vec::new() })
    }

    fn write_event(&mut self, event: &Event) -> io::Result<()> {
        for (env, time) in event.env_ids.iter().zip(&event.times) {
            let env = i32::try_from(*env).unwrap_or(i32::MAX);
            self.file.write_all(&(event.step as f64).to_le_bytes())?;
            self.file.write_all(&env.to_le_bytes())?;
            self.file.write_all(&[event.kind.number()])?;
            self.file.write_all(&time.to_le_bytes())?;
            self.rows += 1;
        }
        Ok(())
    }

    fn write(&mut self, stream: &StreamSchema, block: &StreamRows, step: u64) -> io::Result<()> {
        let (rows, width) = (stream.env_ids.len(), stream.width());
        self.record.clear();
        self.record.extend_from_slice(&(step as f64).to_le_bytes());
        let times = block.times.iter().chain(&block.force_times);
        times.for_each(|time| self.record.extend_from_slice(&time.to_le_bytes()));
        let mut first = 0;
        for part in &stream.fields {
            for row in 0..rows {
                let start = row * width + first;
                block.values.append_bytes(start..start + part.width(), &mut self.record);
            }
            first += part.width();
        }
        self.file.write_all(&self.record)?;
        self.rows += 1;
        Ok(())
    }

    /// Reads the byte range `range` of all records, which have `record` bytes each.
    fn column(&mut self, range: Range<usize>, record: usize) -> io::Result<ColumnReader<'_>> {
        self.file.flush()?;
        let file = self.file.get_mut();
        file.seek(SeekFrom::Start(0))?;
        let read = range.end;
        Ok(ColumnReader { file: BufReader::new(file), record: vec![0; record], range, left: self.rows, at: read })
    }
}

/// Reader of a byte range of each record, concatenated.
struct ColumnReader<'f> {
    file: BufReader<&'f mut File>,
    record: Vec<u8>,
    range: Range<usize>,
    /// Number of records that were not read yet.
    left: usize,
    /// Position in the present record.
    at: usize,
}

impl Read for ColumnReader<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.at == self.range.end {
            if self.left == 0 || self.range.is_empty() {
                return Ok(0);
            }
            self.file.read_exact(&mut self.record)?;
            (self.left, self.at) = (self.left - 1, self.range.start);
        }
        let count = out.len().min(self.range.end - self.at);
        out[..count].copy_from_slice(&self.record[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}

impl FormatWriter for NpzWriter {
    fn write(&mut self, streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        if let Some(event) = &packet.event {
            for (k, env) in event.env_ids.iter().enumerate().filter(|_| !event.text.is_empty()) {
                let line = json!({ "event": self.events.rows + k, "env": env, "step": event.step, "text": event.text });
                writeln!(self.notes, "{line}")?;
            }
            self.events.write_event(event)?;
        }
        for ((stream, block), spool) in streams.iter().zip(&packet.streams).zip(&mut self.buffers) {
            if block.has_content {
                spool.write(stream, block, packet.step)?;
            }
        }
        Ok(())
    }

    fn finish(&mut self, streams: &[StreamSchema]) -> WriteResult<u64> {
        let storage = self.storage.take().ok_or_else(|| io::Error::other("the archive was finished twice"))?;
        let mut archive = ArchiveWriter::new(BufWriter::with_capacity(1 << 16, storage));
        let header = |element, shape: &[usize]| {
            npy::header(element, shape).ok_or_else(|| WriteError::limit("an array has more axes than NumPy supports"))
        };
        let about = format!("{:#}\n", self.metadata);
        archive.add(METADATA, b"", &mut about.as_bytes())?;
        archive.add(INITIAL_STATE, b"", &mut &self.start[..])?;
        if let Some(scene) = &self.scene {
            archive.add(SCENE_ARCHIVE, b"", &mut &scene[..])?;
        }
        self.notes.flush()?;
        let notes = self.notes.get_mut();
        notes.seek(SeekFrom::Start(0))?;
        archive.add(NOTES, b"", notes)?;
        let record = EVENT_FIELDS[3].2.end;
        for (name, element, range) in EVENT_FIELDS {
            let head = header(element, &[self.events.rows])?;
            archive.add(&format!("events/{name}.npy"), &head, &mut self.events.column(range, record)?)?;
        }
        for (stream, spool) in streams.iter().zip(&mut self.buffers) {
            let (rows, envs) = (spool.rows, stream.env_ids.len());
            let one = stream.element_type.bytes();
            // One or two times for each environment.
            let times = 8 * envs * (1 + usize::from(stream.has_two_stamps()));
            let record = 8 + times + envs * stream.width() * one;
            let mut add = |name: String, element, shape: &[usize], range: Range<usize>| -> WriteResult {
                let head = header(element, shape)?;
                Ok(archive.add(&format!("{name}.npy"), &head, &mut spool.column(range, record)?)?)
            };
            add(format!("{}/step", stream.name), ElementType::F64, &[rows], 0..8)?;
            add(format!("{}/time", stream.name), ElementType::F64, &[rows, envs], 8..8 + 8 * envs)?;
            if stream.has_two_stamps() {
                add(format!("{}/force_time", stream.name), ElementType::F64, &[rows, envs], 8 + 8 * envs..8 + times)?;
            }
            let mut first = 8 + times;
            for part in &stream.fields {
                let shape = [&[rows, envs][..], &part.shape].concat();
                let end = first + envs * part.width() * one;
                add(array_name(stream, &part.name), stream.element_type, &shape, first..end)?;
                first = end;
            }
        }
        archive.finish()?.flush()?;
        Ok(self.part.commit()?)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        self.part.kept_path()
    }
}
