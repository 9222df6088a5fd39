//! Archives of arrays for NumPy.
//!
//! | member | shape | what |
//! |---|---|---|
//! | `arm/joint_states/positions` | (T, N, joints) | f64, as all states and sensors of numbers |
//! | `camera/color`, `camera/depth` | (T, N, H, W, 4), (T, N, H, W) | u8, f32 |
//! | `arm/joint_states/time` | (T, N) | simulation time of capture \[s\] |
//! | `arm/joint_states/step` | (T,) | physics steps since the recording began, f64 |
//! | `events/step`, `events/env`, `events/kind`, `events/time` | (E,) | kind 0: reset, 1: written |
//! | `recording.json` | | time step, environments, names of joints and frames |
//! | `start.snapshot` | | the state of all environments when the recording began, as `Snapshot::load` reads it |
//!
//! An environment that has nothing new in a row, because its sensor measures at other times, has its last value and time again.
//!
//! Until the end, rows are in files without a name in the same folder: a killed process leaves nothing.

use crate::file::{PartFile, Storage, folder_of};
use crate::npy;
use crate::packet::{Block, EventKind, Packet};
use crate::stream::{Element, Kind, Stream};
use crate::writer::Sink;
use crate::zip::Archive;
use serde_json::{Value, json};
use sim::Snapshot;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::PathBuf;

/// The member that says what the others are.
pub(crate) const ABOUT: &str = "recording.json";
/// The member with the state at the beginning.
pub(crate) const START: &str = "start.snapshot";

/// A NumPy archive on its way.
pub(crate) struct NpzFile {
    part: PartFile,
    storage: Option<Box<dyn Storage>>,
    about: Value,
    start: Vec<u8>,
    spools: Vec<Spool>,
    events: Events,
}

/// The rows of a stream, one record each: the step, a time for each environment, then the quantities, each of all
/// environments.
struct Spool {
    file: BufWriter<File>,
    rows: usize,
    record: Vec<u8>,
}

#[derive(Default)]
struct Events {
    steps: Vec<u8>,
    envs: Vec<u8>,
    kinds: Vec<u8>,
    times: Vec<u8>,
}

impl NpzFile {
    pub(crate) fn create(
        part: PartFile,
        storage: Box<dyn Storage>,
        streams: &[Stream],
        dt: f64,
        start: Option<&Snapshot>,
    ) -> io::Result<Self> {
        let result = Self::open(&part, streams, start);
        let (spools, start) = result.inspect_err(|_| part.discard())?;
        let about = about(streams, dt);
        Ok(Self { part, storage: Some(storage), about, start, spools, events: Events::default() })
    }

    fn open(part: &PartFile, streams: &[Stream], start: Option<&Snapshot>) -> io::Result<(Vec<Spool>, Vec<u8>)> {
        let folder = folder_of(part.part());
        let mut spools = Vec::new();
        for _ in streams {
            let file = BufWriter::with_capacity(1 << 16, tempfile::tempfile_in(folder)?);
            spools.push(Spool { file, rows: 0, record: Vec::new() });
        }
        let Some(start) = start else { return Ok((spools, Vec::new())) };
        // A snapshot is written as a file; this one goes into the archive.
        let scratch = tempfile::tempdir_in(folder)?;
        let path = scratch.path().join(START);
        start.save(&path).map_err(io::Error::other)?;
        Ok((spools, std::fs::read(path)?))
    }
}

fn about(streams: &[Stream], dt: f64) -> Value {
    let stream = |stream: &Stream| {
        let names = match &stream.kind {
            Kind::Joints { names } => Some(names),
            Kind::Poses { frames } => Some(frames),
            _ => None,
        };
        let parts = stream.parts.iter().map(|part| json!({ "name": member(stream, &part.name), "shape": part.shape }));
        json!({
            "name": stream.name,
            "env_ids": stream.env_ids,
            "arrays": parts.collect::<Vec<_>>(),
            "columns": names,
        })
    };
    json!({
        "recording": 1,
        "physics_dt": dt,
        "mujoco_version": sim::mj::version_string(),
        "streams": streams.iter().map(stream).collect::<Vec<_>>(),
    })
}

/// What a quantity is called in the archive.
pub(crate) fn member(stream: &Stream, part: &str) -> String {
    if part.is_empty() { stream.name.clone() } else { format!("{}/{part}", stream.name) }
}

impl Spool {
    fn write(&mut self, stream: &Stream, block: &Block, step: u64) -> io::Result<()> {
        let (rows, width) = (stream.env_ids.len(), stream.width());
        self.record.clear();
        self.record.extend_from_slice(&(step as f64).to_le_bytes());
        block.times.iter().for_each(|time| self.record.extend_from_slice(&time.to_le_bytes()));
        let mut first = 0;
        for part in &stream.parts {
            for row in 0..rows {
                let start = row * width + first;
                block.values.put(start..start + part.width(), &mut self.record);
            }
            first += part.width();
        }
        self.file.write_all(&self.record)?;
        self.rows += 1;
        Ok(())
    }

    /// The bytes of one quantity of all records.
    fn column(&mut self, range: Range<usize>, record: usize) -> io::Result<Column<'_>> {
        self.file.flush()?;
        let file = self.file.get_mut();
        file.seek(SeekFrom::Start(0))?;
        let read = range.end;
        Ok(Column { file: BufReader::new(file), record: vec![0; record], range, left: self.rows, at: read })
    }
}

/// A part of each record of a file, one after the other.
struct Column<'f> {
    file: BufReader<&'f mut File>,
    record: Vec<u8>,
    range: Range<usize>,
    /// Records that were not read yet.
    left: usize,
    /// What of the record was given.
    at: usize,
}

impl Read for Column<'_> {
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

impl Element {
    fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

impl Sink for NpzFile {
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> io::Result<()> {
        if let Some(event) = &packet.event {
            for (env, time) in event.env_ids.iter().zip(&event.times) {
                self.events.steps.extend_from_slice(&(event.step as f64).to_le_bytes());
                self.events.envs.extend_from_slice(&i32::try_from(*env).unwrap_or(i32::MAX).to_le_bytes());
                self.events.kinds.push(u8::from(event.kind == EventKind::Written));
                self.events.times.extend_from_slice(&time.to_le_bytes());
            }
        }
        for ((stream, block), spool) in streams.iter().zip(&packet.blocks).zip(&mut self.spools) {
            if block.used {
                spool.write(stream, block, packet.step)?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        // Nobody can read it before the end.
        Ok(())
    }

    fn finish(&mut self, streams: &[Stream]) -> io::Result<u64> {
        let storage = self.storage.take().ok_or_else(|| io::Error::other("finished twice"))?;
        let mut archive = Archive::new(BufWriter::with_capacity(1 << 16, storage));
        let header = |element, shape: &[usize]| {
            npy::header(element, shape).ok_or_else(|| io::Error::other("more axes than the format has room for"))
        };
        let about = format!("{:#}\n", self.about);
        archive.add(ABOUT, b"", &mut about.as_bytes())?;
        if !self.start.is_empty() {
            archive.add(START, b"", &mut &self.start[..])?;
        }
        let count = self.events.kinds.len();
        for (name, element, data) in [
            ("step", Element::F64, &self.events.steps),
            ("env", Element::I32, &self.events.envs),
            ("kind", Element::U8, &self.events.kinds),
            ("time", Element::F64, &self.events.times),
        ] {
            archive.add(&format!("events/{name}.npy"), &header(element, &[count])?, &mut &data[..])?;
        }
        for (stream, spool) in streams.iter().zip(&mut self.spools) {
            let (rows, envs) = (spool.rows, stream.env_ids.len());
            let one = stream.element.bytes();
            let record = 8 + 8 * envs + envs * stream.width() * one;
            let mut add = |name: String, element, shape: &[usize], range: Range<usize>| {
                let head = header(element, shape)?;
                archive.add(&format!("{name}.npy"), &head, &mut spool.column(range, record)?)
            };
            add(format!("{}/step", stream.name), Element::F64, &[rows], 0..8)?;
            add(format!("{}/time", stream.name), Element::F64, &[rows, envs], 8..8 + 8 * envs)?;
            let mut first = 8 + 8 * envs;
            for part in &stream.parts {
                let shape = [&[rows, envs][..], &part.shape].concat();
                let end = first + envs * part.width() * one;
                add(member(stream, &part.name), stream.element, &shape, first..end)?;
                first = end;
            }
        }
        archive.finish()?.flush()?;
        self.part.commit()
    }

    fn give_up(&mut self) -> Option<PathBuf> {
        self.storage = None;
        self.part.discard();
        None
    }
}
