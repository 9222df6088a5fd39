//! Reading of NumPy archives of a recorder.

use crate::archive::{ArchiveReader, ReadSeek as From};
use crate::error::{RecordError, Result};
use crate::format::Format;
use crate::npz::{INITIAL_STATE, METADATA};
use crate::read::{McapArrays, read_arrays};
use crate::source::StreamSource;
use kinetoscope_scene::npy;
use kinetoscope_sim::{EnvId, Snapshot};
use ndarray::{ArrayView2, ArrayView3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Numbers of the event kinds that change the state of an environment: resets and writes.
const STATE_CHANGE_KINDS: [f64; 2] = [0.0, 1.0];

/// A NumPy archive whose directory was read. Arrays of numbers are read on first use, images never.
#[derive(Debug)]
pub(crate) struct RecordedArrays {
    pub(crate) path: PathBuf,
    /// Content of `recording.json`.
    pub(crate) metadata: Value,
    content: Content,
    /// By name.
    arrays: BTreeMap<String, Array>,
}

/// Source of data that was not read yet.
#[derive(Debug)]
enum Content {
    Npz(Mutex<ArchiveReader<'static>>),
    /// Initial state of an MCAP file, whose arrays were read completely.
    Mcap(Vec<u8>),
}

/// An array of an archive.
#[derive(Debug)]
struct Array {
    shape: Vec<usize>,
    numbers: OnceLock<Vec<f64>>,
}

/// Upper limit of the number of values in a row of an array without rows: more than any sensor has.
const MAX_EMPTY_ROW: u64 = 1 << 24;

/// True if an array of this shape has `values` values. The values of a row are counted even if the array has no row,
/// because readers name each of them.
fn fits(shape: &[usize], values: u64) -> bool {
    let product = |smallest: usize| {
        shape.iter().filter(|axis| **axis >= smallest).try_fold(1, |all: u64, axis| all.checked_mul(*axis as u64))
    };
    let (all, without_empty_axes) = (product(0), product(1));
    all == Some(values) && without_empty_axes.is_some_and(|all| all <= values.max(MAX_EMPTY_ROW))
}

fn wrong_count(name: &str) -> String {
    format!("the number of values of {name} does not match its shape")
}

/// Upper limit of the length of an array header \[bytes\].
const MAX_HEADER_LEN: u64 = 1024;

impl RecordedArrays {
    /// Opens a NumPy archive, or the rows of an MCAP file as one, for replay.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        if !matches!(Format::of_path(path), Ok(Format::Mcap)) {
            return Self::open_npz(path);
        }
        let McapArrays { metadata, start, arrays } = read_arrays(path)?;
        let array = |(name, (shape, numbers))| (name, Array { shape, numbers: OnceLock::from(numbers) });
        let arrays = arrays.into_iter().map(array).collect();
        Ok(Self { path: path.into(), metadata, content: Content::Mcap(start), arrays })
    }

    pub(crate) fn open_npz(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|error| RecordError::file(path, error))?;
        Self::from_reader(path, file)
    }

    /// Opens an archive from any source; `path` is its name in error messages.
    pub(crate) fn from_reader(path: &Path, from: impl From + 'static) -> Result<Self> {
        let malformed = |what: &str| RecordError::Malformed { path: path.into(), what: what.into() };
        let none = "this is not a NumPy archive of a recorder, or it is damaged";
        let mut file = ArchiveReader::open(from).map_err(|error| read_error(path, none, error))?;
        let about = file.read(METADATA).map_err(|error| read_error(path, none, error))?;
        let about = about.and_then(|about| serde_json::from_slice(&about).ok());
        let metadata: Value =
            about.ok_or_else(|| malformed("it has no description of its content (recording.json)"))?;
        if !file.names().any(|name| name == INITIAL_STATE) {
            return Err(malformed("it has no initial state (start.snapshot)"));
        }
        let names: Vec<String> = file.names().filter_map(|name| name.strip_suffix(".npy")).map(String::from).collect();
        let mut arrays = BTreeMap::new();
        for name in names {
            let head = file
                .read_prefix(&format!("{name}.npy"), MAX_HEADER_LEN)
                .map_err(|error| read_error(path, none, error))?;
            let Some((head, size)) = head else { continue };
            let Some((descr, shape, data)) = npy::parse(&head) else { continue };
            let width = match descr {
                "<f8" => 8,
                "<i4" if name.starts_with("events/") => 4,
                "|u1" if name.starts_with("events/") => 1,
                // Images are not used by replay.
                _ => continue,
            };
            let values = size.saturating_sub((head.len() - data.len()) as u64) / width;
            if !fits(&shape, values) {
                return Err(malformed(&wrong_count(&name)));
            }
            arrays.insert(name, Array { shape, numbers: OnceLock::new() });
        }
        Ok(Self { path: path.into(), metadata, content: Content::Npz(Mutex::new(file)), arrays })
    }

    /// Reads a member of the archive; `None` if there is no such member. An MCAP file has only the initial state.
    pub(crate) fn member(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let file = match &self.content {
            Content::Npz(file) => file,
            Content::Mcap(start) => return Ok((name == INITIAL_STATE).then(|| start.clone())),
        };
        let read = file.lock().unwrap_or_else(PoisonError::into_inner).read(name);
        read.map_err(|error| read_error(&self.path, &error.to_string(), error))
    }

    /// Shape of an array, if it exists.
    pub(crate) fn shape(&self, name: &str) -> Option<&[usize]> {
        self.arrays.get(name).map(|array| array.shape.as_slice())
    }

    fn numbers(&self, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let data = self.member(&format!("{name}.npy"))?;
        let Some((descr, _, data)) = data.as_deref().and_then(npy::parse) else {
            return Err(self.malformed(format!("{name} is not an array")));
        };
        let numbers: Vec<f64> = match descr {
            "<f8" => data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect(),
            "<i4" => data.as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes).into()).collect(),
            _ => data.iter().map(|byte| f64::from(*byte)).collect(),
        };
        if fits(shape, numbers.len() as u64) { Ok(numbers) } else { Err(self.malformed(wrong_count(name))) }
    }

    /// Initial state of the recording.
    pub(crate) fn start(&self) -> Result<Snapshot> {
        let failed = |error| RecordError::file(&self.path, error);
        let start = self.member(INITIAL_STATE)?.unwrap_or_default();
        let mut file = tempfile::NamedTempFile::new().map_err(failed)?;
        file.write_all(&start).and_then(|()| file.flush()).map_err(failed)?;
        Ok(Snapshot::load(file.path())?)
    }

    pub(crate) fn malformed(&self, what: String) -> RecordError {
        RecordError::Malformed { path: self.path.clone(), what }
    }

    /// Shape and values of an array.
    pub(crate) fn array(&self, name: &str) -> Result<(&[usize], &[f64])> {
        let array = self.arrays.get(name).ok_or_else(|| self.malformed(format!("the array {name} is missing")))?;
        if array.numbers.get().is_none() {
            // Another thread may have set the same values meanwhile.
            let _ = array.numbers.set(self.numbers(name, &array.shape)?);
        }
        Ok((&array.shape, array.numbers.get().map_or(&[], Vec::as_slice)))
    }

    pub(crate) fn steps(&self, stream: &str) -> Result<&[f64]> {
        Ok(self.array(&format!("{stream}/step"))?.1)
    }

    /// Checks that the arrays of a stream have the shapes that they would have in this simulation.
    pub(crate) fn check(&self, source: &StreamSource, rows: usize) -> Result<()> {
        for part in &source.stream.fields {
            let name = crate::npz::array_name(&source.stream, &part.name);
            let shape = [&[rows, source.stream.env_ids.len()][..], &part.shape].concat();
            let found = self.array(&name)?.0;
            if *found != shape {
                return Err(self.malformed(format!("{name} has shape {found:?}; expected {shape:?}")));
            }
        }
        Ok(())
    }

    /// Row of an array, shape (environments, values).
    pub(crate) fn rows(&self, name: &str, row: usize) -> Result<ArrayView2<'_, f64>> {
        let (shape, numbers) = self.array(name)?;
        let [rows, envs, ..] = shape[..] else { return Err(self.malformed(format!("{name} has no environments"))) };
        let width = shape[2..].iter().product();
        let all = ArrayView3::from_shape((rows, envs, width), numbers);
        all.ok()
            .filter(|all| row < all.dim().0)
            .map(|all| all.index_axis_move(ndarray::Axis(0), row))
            .ok_or_else(|| self.malformed(format!("{name} has no row {row}")))
    }

    /// Resets and writes of an environment, in order: their physics steps since the beginning of the recording, and the
    /// simulation times afterwards \[s\].
    pub(crate) fn state_changes(&self, env: usize) -> Result<Vec<(f64, f64)>> {
        let of = |name: &str| Ok::<_, RecordError>(self.array(&format!("events/{name}"))?.1);
        let (steps, envs, times) = (of("step")?, of("env")?, of("time")?);
        let kinds = of("kind")?;
        let of_env = steps.iter().zip(envs).zip(times.iter().zip(kinds));
        // Events of other kinds do not change the state.
        let of_env = of_env.filter(|((_, of), (_, kind))| **of == env as f64 && STATE_CHANGE_KINDS.contains(*kind));
        Ok(of_env.map(|((step, _), (time, _))| (*step, *time)).collect())
    }

    /// Environments that were reset, and those that were written to, at a step.
    pub(crate) fn state_changes_at(&self, step: f64) -> Result<(Vec<EnvId>, Vec<EnvId>)> {
        let of = |name: &str| Ok::<_, RecordError>(self.array(&format!("events/{name}"))?.1);
        let (steps, envs, kinds) = (of("step")?, of("env")?, of("kind")?);
        let (mut reset, mut written) = (Vec::new(), Vec::new());
        for ((at, env), kind) in steps.iter().zip(envs).zip(kinds) {
            if *at == step && STATE_CHANGE_KINDS.contains(kind) {
                // Negative numbers, which no recorder writes, become 0.
                let to = if *kind == 0.0 { &mut reset } else { &mut written };
                to.push(EnvId(*env as usize));
            }
        }
        reset.sort_unstable();
        reset.dedup();
        Ok((reset, written))
    }
}

/// Converts a read error; `what` is the message for a damaged archive.
fn read_error(path: &Path, what: &str, error: io::Error) -> RecordError {
    match error.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof => {
            RecordError::Malformed { path: path.into(), what: what.into() }
        }
        _ => RecordError::file(path, error),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::cfg::RecorderCfg;
    use crate::tests::{falling, record, scratch};
    use kinetoscope_render::frame::Channels;
    use kinetoscope_sensors::camera::CameraCfg;
    use std::io::{Read, Seek, SeekFrom};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Counts the bytes that are read.
    struct CountingReader {
        file: File,
        bytes: Arc<AtomicU64>,
    }

    impl Read for CountingReader {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            let count = self.file.read(to)?;
            self.bytes.fetch_add(count as u64, Ordering::Relaxed);
            Ok(count)
        }
    }

    impl Seek for CountingReader {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.file.seek(to)
        }
    }

    /// Root cause: the whole file, with all images, was read to get a few numbers.
    #[test]
    fn lazy_reading() {
        let (_folder, path) = scratch("run.npz");
        let mut sim = falling(2);
        let camera = CameraCfg {
            width: 128,
            height: 96,
            channels: Channels { depth: true, ..Channels::NONE },
            ..CameraCfg::default()
        };
        sim.add_sensor("camera", camera).unwrap();
        let whole = record(&mut sim, RecorderCfg::new(&path), |sim| sim.update(40)).bytes;
        // 40 images of 128 x 96 f32 in two environments.
        assert!(whole > 40 * 2 * 4 * 128 * 96, "{whole}");
        let bytes = Arc::new(AtomicU64::new(0));
        let counted = CountingReader { file: File::open(&path).unwrap(), bytes: Arc::clone(&bytes) };
        let archive = RecordedArrays::from_reader(&path, counted).unwrap();
        let opened = bytes.load(Ordering::Relaxed);
        let Content::Npz(file) = &archive.content else { panic!("{archive:?}") };
        let members = file.lock().unwrap().names().count() as u64;
        let about = archive.member(METADATA).unwrap().unwrap().len() as u64;
        // For each file: its directory entry (46 + 28 bytes and a name of at most 64), its local header (30 bytes, name
        // and 20) and the array header. In addition the search for the end of the archive, in blocks of some KiB, and
        // `recording.json`.
        let most = members * (46 + 28 + 64 + 30 + 64 + 20 + MAX_HEADER_LEN) + (1 << 14) + about;
        assert!(opened <= most && most < whole / 10, "{opened} bytes, at most {most} of {whole}");
        // An array takes its numbers (41 rows of two environments and seven positions), its header, and its local
        // header with name and extension.
        let before = bytes.load(Ordering::Relaxed);
        let (shape, numbers) = archive.array("ball/state/positions").unwrap();
        assert_eq!((shape, numbers.len()), (&[41, 2, 7][..], 41 * 2 * 7));
        let after = bytes.load(Ordering::Relaxed);
        let numbers = 8 * 41 * 2 * 7 + 128;
        assert!((numbers..numbers + 30 + 64 + 20).contains(&(after - before)), "{}", after - before);
        // A second use does not read it again.
        archive.array("ball/state/positions").unwrap();
        assert_eq!(bytes.load(Ordering::Relaxed), after);
        // Control: reading an image would be noticed.
        assert!(archive.member("camera/depth.npy").unwrap().unwrap().len() > 1_000_000);
        assert!(bytes.load(Ordering::Relaxed) > whole / 2);
    }

    #[test]
    fn damage() {
        let (_folder, path) = scratch("run.npz");
        record(&mut falling(1), RecorderCfg::new(&path), |sim| sim.update(20));
        let mut bytes = std::fs::read(&path).unwrap();
        let name = b"ball/state/velocities.npy";
        let place = bytes.windows(name.len()).position(|part| part == name).unwrap();
        // Behind the local header with its extension of 20 bytes, and the header of the array.
        bytes[place + name.len() + 20 + 128 + 9] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        let archive = RecordedArrays::open_npz(&path).unwrap();
        assert!(archive.array("ball/state/positions").is_ok());
        let error = archive.array("ball/state/velocities").unwrap_err().to_string();
        assert!(error.contains("velocities.npy is damaged"), "{error}");
    }
}
