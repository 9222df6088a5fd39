//! NumPy archives of a recorder, read again.

use crate::error::{RecordError, Result};
use crate::npy;
use crate::npz::{ABOUT, START};
use crate::source::Source;
use crate::zip;
use ndarray::{ArrayView2, ArrayView3};
use serde_json::Value;
use sim::{EnvId, Snapshot};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Kinds of events after which an environment has another state: resets, and what somebody wrote.
const CHANGES: [f64; 2] = [0.0, 1.0];

/// An archive that was read, without its pictures.
#[derive(Debug)]
pub(crate) struct Archive {
    pub(crate) path: PathBuf,
    /// What `recording.json` says.
    pub(crate) about: Value,
    start: Vec<u8>,
    /// Shapes and numbers, by name.
    pub(crate) arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
}

impl Archive {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|error| RecordError::file(path, error))?;
        let malformed = |what: &str| RecordError::Malformed { path: path.into(), what: what.into() };
        let members =
            zip::parse(&bytes).ok_or_else(|| malformed("this is no NumPy archive of a recorder, or is damaged"))?;
        let member = |name: &str| members.iter().find(|(known, _)| *known == name).map(|(_, data)| *data);
        let about = member(ABOUT).and_then(|about| serde_json::from_slice(about).ok());
        let about: Value = about.ok_or_else(|| malformed("it does not say what is in it (recording.json)"))?;
        let start = member(START).ok_or_else(|| malformed("it has no state to begin with (start.snapshot)"))?;
        let start = start.to_vec();
        let mut arrays = BTreeMap::new();
        for (name, data) in &members {
            let Some(name) = name.strip_suffix(".npy") else { continue };
            // Pictures are not compared.
            let Some(("<f8" | "<i4" | "|u1", ..)) = npy::parse(data) else { continue };
            let wanted = name.starts_with("events/") || npy::parse(data).is_some_and(|(descr, ..)| descr == "<f8");
            let Some((descr, shape, data)) = npy::parse(data).filter(|_| wanted) else { continue };
            let numbers: Vec<f64> = match descr {
                "<f8" => data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect(),
                "<i4" => data.as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes).into()).collect(),
                _ => data.iter().map(|byte| f64::from(*byte)).collect(),
            };
            let product = |shape: &[usize]| shape.iter().try_fold(1_usize, |all, axis| all.checked_mul(*axis));
            // Also where an axis is empty, the others have a product.
            let filled: Vec<usize> = shape.iter().copied().filter(|length| *length > 0).collect();
            if product(&shape) != Some(numbers.len()) || product(&filled).is_none() {
                return Err(malformed(&format!("{name} has not as many numbers as its shape says")));
            }
            arrays.insert(name.to_string(), (shape, numbers));
        }
        Ok(Self { path: path.into(), about, start, arrays })
    }

    /// The state in which the recording begins.
    pub(crate) fn start(&self) -> Result<Snapshot> {
        let failed = |error| RecordError::file(&self.path, error);
        let mut file = tempfile::NamedTempFile::new().map_err(failed)?;
        file.write_all(&self.start).and_then(|()| file.flush()).map_err(failed)?;
        Ok(Snapshot::load(file.path())?)
    }

    pub(crate) fn malformed(&self, what: String) -> RecordError {
        RecordError::Malformed { path: self.path.clone(), what }
    }

    pub(crate) fn array(&self, name: &str) -> Result<&(Vec<usize>, Vec<f64>)> {
        self.arrays.get(name).ok_or_else(|| self.malformed(format!("there is no array {name}")))
    }

    pub(crate) fn steps(&self, stream: &str) -> Result<&[f64]> {
        Ok(&self.array(&format!("{stream}/step"))?.1)
    }

    /// Checks that the arrays of a stream have the shapes that they have in this simulation.
    pub(crate) fn check(&self, source: &Source, rows: usize) -> Result<()> {
        for part in &source.stream.parts {
            let name = crate::npz::member(&source.stream, &part.name);
            let shape = [&[rows, source.stream.env_ids.len()][..], &part.shape].concat();
            let found = &self.array(&name)?.0;
            if *found != shape {
                return Err(self.malformed(format!("{name} has shape {found:?}; here it would be {shape:?}")));
            }
        }
        Ok(())
    }

    /// A row of an array, one line for each environment.
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

    /// What happened to an environment: steps, and the simulation time afterwards \[s\], in order.
    pub(crate) fn happened(&self, env: usize) -> Result<Vec<(f64, f64)>> {
        let of = |name: &str| Ok::<_, RecordError>(&self.array(&format!("events/{name}"))?.1);
        let (steps, envs, times) = (of("step")?, of("env")?, of("time")?);
        let kinds = of("kind")?;
        let of_env = steps.iter().zip(envs).zip(times.iter().zip(kinds));
        // Other events leave the state as it is.
        let of_env = of_env.filter(|((_, of), (_, kind))| **of == env as f64 && CHANGES.contains(*kind));
        Ok(of_env.map(|((step, _), (time, _))| (*step, *time)).collect())
    }

    /// The environments that were reset, and those that were written to, at a step.
    pub(crate) fn events(&self, step: f64) -> Result<(Vec<EnvId>, Vec<EnvId>)> {
        let of = |name: &str| Ok::<_, RecordError>(&self.array(&format!("events/{name}"))?.1);
        let (steps, envs, kinds) = (of("step")?, of("env")?, of("kind")?);
        let (mut reset, mut written) = (Vec::new(), Vec::new());
        for ((at, env), kind) in steps.iter().zip(envs).zip(kinds) {
            if *at == step && CHANGES.contains(kind) {
                // Negative numbers become 0: no recorder writes them.
                let to = if *kind == 0.0 { &mut reset } else { &mut written };
                to.push(EnvId(*env as usize));
            }
        }
        reset.sort_unstable();
        reset.dedup();
        Ok((reset, written))
    }
}
