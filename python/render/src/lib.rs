//! Extension module of the Python package `kinetoscope-render`: renders the scenes of the user's own `mujoco` package.
//! It links no MuJoCo.
//!
//! The Python side (`python/kinetoscope_render`) finds the places of fields in MuJoCo's structures, and passes their
//! memory as arrays of bytes. This side reads these bytes (`kinetoscope_look::mjv`) and renders.
#![forbid(unsafe_code)]

mod frame_list;
mod layout;
mod model_arrays;
mod panic;

use pyo3::prelude::*;

/// Extension module of `kinetoscope_render`.
#[pymodule]
fn _render(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<frame_list::FrameList>()
}
