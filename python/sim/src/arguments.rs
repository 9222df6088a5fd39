//! Arguments of calls: arrays, environments, joints, links.

use crate::errors::{Class, Failure};
use crate::shared::Shared;
use kinetoscope::ndarray::{Array, ArrayD, Axis, Dimension};
use kinetoscope::robot::description::LinkId;
use kinetoscope::sim::{EnvId, JointIndex, RobotId, SimulationManager};
use numpy::{PyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyDict, PyInt, PyList, PySequence, PyString, PyTuple};
use std::time::Duration;

/// Numbers of an argument: an array, a list, a tensor, anything that NumPy accepts. Missing leading axes are added, so
/// that one row stands for all environments.
pub(crate) fn array<D: Dimension>(obj: &Bound<'_, PyAny>, name: &str) -> PyResult<Array<f64, D>> {
    if let Ok(array) = obj.cast::<PyArray<f64, D>>()
        && is_plain(array)
    {
        return copy(array, name);
    }
    let mut converted = numpy(obj, name, "float64")?;
    let axes = converted.getattr("ndim")?.extract::<usize>()?;
    if axes >= MAX_AXES {
        return Err(Failure::argument(name, format!("the array has {axes} axes; at most 3 have a meaning")).into());
    }
    let mut array = converted.cast::<PyArrayDyn<f64>>().map_err(|error| Failure::argument(name, error))?;
    if !is_plain(array) {
        converted = array.call_method0("copy")?;
        array = converted.cast::<PyArrayDyn<f64>>().map_err(|error| Failure::argument(name, error))?;
    }
    let converted = array;
    let mut values: ArrayD<f64> = copy(converted, name)?;
    let axes = D::NDIM.unwrap_or(values.ndim());
    let shape = values.shape().to_vec();
    while values.ndim() < axes {
        values.insert_axis_inplace(Axis(0));
    }
    let wrong = |_| Failure::argument(name, format!("the shape {shape:?} has too many axes; expected {axes}"));
    Ok(values.into_dimensionality::<D>().map_err(wrong)?)
}

/// Number of axes from which on arrays are refused. The array type of Rust panics above 32.
const MAX_AXES: usize = 32;

/// True if the array has the form that the array type of Rust assumes: an aligned address, strides that are multiples
/// of the size of an element (those of a field of a packed structured array are not), and few axes.
pub(crate) fn is_plain<T: numpy::Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> bool {
    let size = size_of::<T>() as isize;
    array.ndim() < MAX_AXES && array.data().is_aligned() && array.strides().iter().all(|stride| stride % size == 0)
}

fn copy<D: Dimension>(array: &Bound<'_, PyArray<f64, D>>, name: &str) -> PyResult<Array<f64, D>> {
    let borrowed = array.try_readonly().map_err(|error| Failure::argument(name, error))?;
    Ok(borrowed.as_array().to_owned())
}

/// `numpy.asarray(obj, dtype)`.
fn numpy<'py>(obj: &Bound<'py, PyAny>, name: &str, dtype: &str) -> PyResult<Bound<'py, PyAny>> {
    static ASARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = obj.py();
    let asarray = ASARRAY.import(py, "numpy", "asarray")?;
    let options = PyDict::new(py);
    if !dtype.is_empty() {
        options.set_item("dtype", dtype)?;
    }
    asarray.call((obj,), Some(&options)).map_err(|error| Failure::argument(name, error.value(py)).into())
}

/// Integers of an argument, such as a mask image: an array of whole numbers, of any shape.
pub(crate) fn integers(obj: &Bound<'_, PyAny>, name: &str) -> PyResult<ArrayD<i32>> {
    if let Ok(array) = obj.cast::<PyArrayDyn<i32>>()
        && is_plain(array)
    {
        let borrowed = array.try_readonly().map_err(|error| Failure::argument(name, error))?;
        return Ok(borrowed.as_array().to_owned());
    }
    let converted = numpy(obj, name, "")?;
    let kind: String = converted.getattr("dtype")?.getattr("kind")?.extract()?;
    if !matches!(kind.as_str(), "i" | "u") || converted.getattr("ndim")?.extract::<usize>()? >= MAX_AXES {
        let message = "expected an array of whole numbers, such as the channel mask of a camera";
        return Err(Failure::argument(name, message).into());
    }
    // A copy has the layout that the array type of Rust assumes.
    let converted = converted.call_method1("astype", ("int64",))?;
    let array = converted.cast::<PyArrayDyn<i64>>().map_err(|error| Failure::argument(name, error))?;
    let borrowed = array.try_readonly().map_err(|error| Failure::argument(name, error))?;
    let values = borrowed.as_array();
    let wrong = |value: &&i64| i32::try_from(**value).is_err();
    if let Some(value) = values.iter().find(wrong) {
        return Err(Failure::argument(name, format!("{value} is not an int32")).into());
    }
    Ok(values.mapv(|value| value as i32))
}

/// Bytes of an argument, such as a color image: an array of uint8, of any shape.
pub(crate) fn bytes(obj: &Bound<'_, PyAny>, name: &str) -> PyResult<ArrayD<u8>> {
    let mut converted = numpy(obj, name, "")?;
    let dtype: String = converted.getattr("dtype")?.str()?.extract()?;
    if dtype != "uint8" || converted.getattr("ndim")?.extract::<usize>()? >= MAX_AXES {
        let problem = format!("expected an array of uint8, such as the channel color of a camera, not of {dtype}");
        return Err(Failure::argument(name, problem).into());
    }
    let is_readable = converted.cast::<PyArrayDyn<u8>>().is_ok_and(is_plain);
    if !is_readable {
        // A copy has the layout that the array type of Rust assumes.
        converted = converted.call_method0("copy")?;
    }
    let array = converted.cast::<PyArrayDyn<u8>>().map_err(|error| Failure::argument(name, error))?;
    let borrowed = array.try_readonly().map_err(|error| Failure::argument(name, error))?;
    Ok(borrowed.as_array().to_owned())
}

/// Indices, or a mask of the items that are selected.
#[derive(Debug)]
pub(crate) enum Indices {
    Ids(Vec<usize>),
    /// Shape and entries of an array of booleans.
    Mask(Vec<usize>, Vec<bool>),
}

impl Indices {
    /// Selected indices. A mask must have one entry for each of `count` items.
    pub(crate) fn resolve(&self, name: &str, count: usize) -> Result<Vec<usize>, Failure> {
        match self {
            Self::Ids(ids) => Ok(ids.clone()),
            Self::Mask(shape, mask) if *shape == [count] => {
                Ok(mask.iter().enumerate().filter(|(_, chosen)| **chosen).map(|(index, _)| index).collect())
            }
            Self::Mask(shape, _) => {
                Err(Failure::argument(name, format!("the mask has the shape {shape:?}; expected [{count}]")))
            }
        }
    }
}

/// Indices of an argument: a number, a list, an array, or an array of booleans that selects them.
pub(crate) fn indices(obj: &Bound<'_, PyAny>, name: &str) -> PyResult<Indices> {
    let plain = |item: &Bound<'_, PyAny>| item.is_instance_of::<PyInt>() && !item.is_instance_of::<PyBool>();
    let index = |item: Bound<'_, PyAny>| {
        item.extract::<usize>().map_err(|_| {
            PyErr::from(Failure::new(Class::OutOfRange, format!("{name}: {item} is not an index; indices start at 0")))
        })
    };
    if plain(obj) {
        return Ok(Indices::Ids(vec![index(obj.clone())?]));
    }
    if let Ok(list) = obj.cast::<PyList>()
        && list.iter().all(|item| plain(&item))
    {
        return list.iter().map(index).collect::<PyResult<_>>().map(Indices::Ids);
    }
    if let Ok(tuple) = obj.cast::<PyTuple>()
        && tuple.iter().all(|item| plain(&item))
    {
        return tuple.iter().map(index).collect::<PyResult<_>>().map(Indices::Ids);
    }
    let array = numpy(obj, name, "")?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    let array = match kind.as_str() {
        "b" => {
            let shape = array.getattr("shape")?.extract()?;
            return Ok(Indices::Mask(shape, array.call_method0("ravel")?.call_method0("tolist")?.extract()?));
        }
        "i" | "u" => array.call_method0("ravel")?,
        _ if array.getattr("size")?.extract::<usize>()? == 0 => return Ok(Indices::Ids(Vec::new())),
        _ => {
            let message = format!("expected indices (whole numbers) or booleans, not {}", obj.get_type().name()?);
            return Err(Failure::argument(name, message).into());
        }
    };
    let array = array.call_method1("astype", ("int64",))?;
    let array = array.cast::<PyArray1<i64>>().map_err(|error| Failure::argument(name, error))?;
    let out_of_range = |index: i64| {
        Failure::new(Class::OutOfRange, format!("{name}: {index} is not an index; indices start at 0")).into()
    };
    let numbers = array.try_readonly().map_err(|error| Failure::argument(name, error))?;
    let numbers = numbers.as_array();
    let ids = numbers.iter().map(|&i| usize::try_from(i).map_err(|_| out_of_range(i)));
    ids.collect::<PyResult<_>>().map(Indices::Ids)
}

/// Longest wait for a limit in seconds; no limit without one, and for infinity.
pub(crate) fn time_limit(seconds: Option<f64>, name: &str) -> PyResult<Duration> {
    match seconds {
        None | Some(f64::INFINITY) => Ok(Duration::MAX),
        Some(seconds) => Ok(Duration::try_from_secs_f64(seconds)
            .map_err(|_| Failure::argument(name, format!("{seconds} is not a time of at least 0 s")))?),
    }
}

/// Environments of an argument; `None` for all.
pub(crate) fn envs(shared: &Shared, obj: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<EnvId>>> {
    let Some(obj) = obj.filter(|obj| !obj.is_none()) else { return Ok(None) };
    let ids = indices(obj, "env_ids")?.resolve("env_ids", shared.num_envs())?;
    Ok(Some(ids.into_iter().map(EnvId).collect()))
}

/// Indices of environments, for sensors.
pub(crate) fn env_indices(shared: &Shared, obj: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<usize>>> {
    Ok(envs(shared, obj)?.map(|ids| ids.into_iter().map(|id| id.0).collect()))
}

/// Texts of a list, a tuple or another sequence; `None` for a sequence of other values, and for other types.
fn texts(obj: &Bound<'_, PyAny>, name: &str) -> PyResult<Option<Vec<String>>> {
    let Ok(items) = obj.cast::<PySequence>() else { return Ok(None) };
    let mut texts = Vec::new();
    for item in items.try_iter()? {
        let item = item?;
        match item.cast::<PyString>() {
            Ok(text) => texts.push(text.to_str()?.to_owned()),
            Err(_) if texts.is_empty() => return Ok(None),
            Err(_) => {
                return Err(Failure::argument(name, format!("{item} is not a text, as the items before it")).into());
            }
        }
    }
    Ok(Some(texts))
}

/// Patterns of names: a text, or a sequence of texts.
pub(crate) fn patterns(obj: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    if let Ok(text) = obj.cast::<PyString>() {
        return Ok(vec![text.to_str()?.to_owned()]);
    }
    let found = obj.get_type().name()?;
    let wrong = || Failure::argument("patterns", format!("expected a pattern of names or a list of them, not {found}"));
    Ok(texts(obj, "patterns")?.ok_or_else(wrong)?)
}

/// Joints or links of an argument.
#[derive(Debug)]
pub(crate) enum Selection {
    All,
    /// Indices or a mask, and the name of the argument.
    Ids(Indices, String),
    /// Name of a control part.
    Part(String),
    Patterns(Vec<String>),
}

impl Selection {
    pub(crate) fn of(obj: Option<&Bound<'_, PyAny>>, name: &str) -> PyResult<Self> {
        let Some(obj) = obj.filter(|obj| !obj.is_none()) else { return Ok(Self::All) };
        if let Ok(part) = obj.cast::<PyString>() {
            return Ok(Self::Part(part.to_str()?.into()));
        }
        match texts(obj, name)? {
            Some(patterns) if !patterns.is_empty() => Ok(Self::Patterns(patterns)),
            _ => Ok(Self::Ids(indices(obj, name)?, name.into())),
        }
    }

    /// Joints of a robot: a text is a control part, a sequence of texts are patterns of joint names.
    pub(crate) fn joints(&self, sim: &SimulationManager, robot: RobotId) -> Result<Option<Vec<JointIndex>>, Failure> {
        Ok(match self {
            Self::All => None,
            Self::Ids(ids, name) => {
                Some(ids.resolve(name, sim.robot(robot).dof())?.into_iter().map(JointIndex).collect())
            }
            Self::Part(part) => Some(sim.robot(robot).joint_ids(part.as_str())?),
            Self::Patterns(patterns) => Some(sim.robot(robot).find_joints(patterns)?),
        })
    }

    /// Links of a robot: texts are patterns of link names.
    pub(crate) fn links(&self, sim: &SimulationManager, robot: RobotId) -> Result<Option<Vec<LinkId>>, Failure> {
        Ok(match self {
            Self::All => None,
            Self::Ids(ids, name) => {
                Some(ids.resolve(name, sim.robot(robot).link_names().len())?.into_iter().map(LinkId).collect())
            }
            Self::Part(pattern) => Some(sim.robot(robot).find_links(&[pattern])?),
            Self::Patterns(patterns) => Some(sim.robot(robot).find_links(patterns)?),
        })
    }
}
