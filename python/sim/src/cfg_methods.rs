//! Methods of configurations: the classes of `kinetoscope.cfg` call these functions. `python/cfg` lists them.

use crate::arguments::array;
use crate::cfg;
use crate::errors::Failure;
use crate::shared::{detached, guarded};
use kinetoscope::nalgebra::Matrix3;
use kinetoscope::ndarray::{Array2, Ix2};
use kinetoscope::render::Intrinsics;
use kinetoscope::scene::terrain::TerrainGrid;
use numpy::IntoPyArray;
use pyo3::prelude::*;

/// Adds the functions to the module.
pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_terrain_grid_heights, module)?)?;
    module.add_function(wrap_pyfunction!(_terrain_grid_size, module)?)?;
    module.add_function(wrap_pyfunction!(_terrain_grid_tile_center, module)?)?;
    module.add_function(wrap_pyfunction!(_terrain_grid_tile_at, module)?)?;
    module.add_function(wrap_pyfunction!(_terrain_grid_row_difficulty, module)?)?;
    module.add_function(wrap_pyfunction!(_terrain_grid_platform_heights, module)?)?;
    module.add_function(wrap_pyfunction!(_simulation_manager_cfg_env_origins, module)?)?;
    module.add_function(wrap_pyfunction!(_intrinsics_from_matrix, module)?)?;
    module.add_function(wrap_pyfunction!(_intrinsics_matrix, module)?)
}

fn grid(cfg: &Bound<'_, PyAny>) -> PyResult<TerrainGrid> {
    let grid: TerrainGrid = cfg::read("TerrainGrid", Some(cfg))?;
    guarded(|| Ok(grid.check()?))?;
    Ok(grid)
}

#[pyfunction]
fn _terrain_grid_heights<'py>(py: Python<'py>, cfg: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let grid = grid(cfg)?;
    Ok(detached(py, || Ok(grid.heights()?))?.into_pyarray(py).into_any())
}

#[pyfunction]
fn _terrain_grid_size(cfg: &Bound<'_, PyAny>) -> PyResult<(f64, f64)> {
    Ok(grid(cfg)?.size().into())
}

#[pyfunction]
fn _terrain_grid_tile_center(cfg: &Bound<'_, PyAny>, row: usize, column: usize) -> PyResult<(f64, f64)> {
    Ok(grid(cfg)?.tile_center(row, column).into())
}

#[pyfunction]
fn _terrain_grid_tile_at(cfg: &Bound<'_, PyAny>, x: f64, y: f64) -> PyResult<Option<(usize, usize)>> {
    if x.is_nan() || y.is_nan() {
        return Err(Failure::argument("tile_at", format!("({x}, {y}) is not a point")).into());
    }
    Ok(grid(cfg)?.tile_at([x, y]).map(Into::into))
}

#[pyfunction]
fn _terrain_grid_row_difficulty(cfg: &Bound<'_, PyAny>, row: usize) -> PyResult<f64> {
    Ok(grid(cfg)?.row_difficulty(row))
}

#[pyfunction]
fn _terrain_grid_platform_heights<'py>(py: Python<'py>, cfg: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let grid = grid(cfg)?;
    Ok(detached(py, || Ok(grid.platform_heights()?))?.into_pyarray(py).into_any())
}

#[pyfunction]
fn _simulation_manager_cfg_env_origins<'py>(py: Python<'py>, cfg: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let cfg = cfg::simulation(cfg::table(cfg::SIMULATION, Some(cfg), None)?)?;
    Ok(detached(py, || Ok(cfg.env_origins()))?.into_pyarray(py).into_any())
}

#[pyfunction]
fn _intrinsics_from_matrix<'py>(py: Python<'py>, matrix: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let rows = array::<Ix2>(matrix, "from_matrix, matrix")?;
    if rows.dim() != (3, 3) {
        let problem = format!("the shape is {:?}; expected (3, 3)", rows.shape());
        return Err(Failure::argument("from_matrix, matrix", problem).into());
    }
    let matrix = Matrix3::from_fn(|row, column| rows[(row, column)]);
    let text = guarded(|| Ok(serde_json::to_string(&Intrinsics::from_matrix(&matrix)?)?))?;
    py.import("json")?.call_method1("loads", (text,))
}

#[pyfunction]
fn _intrinsics_matrix<'py>(
    py: Python<'py>,
    intrinsics: &Bound<'py, PyAny>,
    width: usize,
    height: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let intrinsics: Intrinsics = cfg::read("Intrinsics", Some(intrinsics))?;
    let matrix = guarded(|| Ok(intrinsics.matrix(width, height)?))?;
    Ok(Array2::from_shape_fn((3, 3), |at| matrix[at]).into_pyarray(py).into_any())
}
