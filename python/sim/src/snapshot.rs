//! Snapshots: saved states of environments.

use crate::shared::{detached, guarded};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use std::path::PathBuf;

/// States of environments, made by ``SimulationManager.snapshot``. Snapshots can be pickled.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Snapshot {
    pub(crate) inner: kinetoscope::sim::Snapshot,
}

#[pymethods]
impl Snapshot {
    /// Reads a file that ``save`` wrote.
    #[classmethod]
    fn load(_class: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self { inner: detached(py, || Ok(kinetoscope::sim::Snapshot::load(path)?))? })
    }

    /// Writes the snapshot to a file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        detached(py, || Ok(self.inner.save(path)?))
    }

    /// Environments of the snapshot.
    #[getter]
    fn env_ids(&self) -> PyResult<Vec<usize>> {
        Ok(guarded(|| Ok(self.inner.env_ids().into_iter().map(|env| env.0).collect()))?)
    }

    /// Simulation times of the environments [s], shape (num_envs,).
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(guarded(|| Ok(self.inner.time()))?.into_pyarray(py))
    }

    /// Content of the file of the snapshot.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &detached(py, || Ok(self.inner.to_bytes()))?))
    }

    /// Reads the content of a file of a snapshot.
    #[classmethod]
    fn from_bytes(_class: &Bound<'_, PyType>, content: &[u8]) -> PyResult<Self> {
        Ok(Self { inner: guarded(|| Ok(kinetoscope::sim::Snapshot::from_bytes(content)?))? })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((slf.get_type().getattr("from_bytes")?, (slf.get().to_bytes(slf.py())?,)))
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        format!("<Snapshot of {} envs>", self.inner.len())
    }
}
