//! Configurations: Python values in the form of scene files.
//!
//! A dataclass, mapping, sequence, number or NumPy array becomes a TOML value, and the text is read like a scene file.
//! So Python accepts what scene files accept, with the same error messages.

use crate::errors::{Class, Failure};
use crate::shared::guarded;
use kinetoscope::prelude::{ArticulationCfg, EntityCfg, MjcfPartCfg, RigidObjectCfg, RobotCfg, SceneCfg, TerrainCfg};
use kinetoscope::sim::{EntityTypes, RigidObjectGroupCfg, SimulationManagerCfg, WeldCfg};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString, PyTuple, PyType};
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// File name of configurations from Python; it never appears in messages.
pub(crate) const PYTHON: &str = "<python>";

/// Optional fields that are present by default, so that `None` is the `false` of scene files. A test of the package
/// compares the list with the classes.
pub(crate) const NONE_IS_FALSE: [&str; 3] = ["ground", "min_thickness", "speed"];

/// Type of the configuration of a simulation, for [`table`].
pub(crate) const SIMULATION: &str = "simulation";
/// Type of the configuration of a scene, for [`table`].
const SCENE: &str = "SceneCfg";
/// Key of the collision exclusions of a scene.
const EXCLUSIONS: &str = "exclude_collisions";
/// Type of a configuration that is part of another, or that is not known, for [`table`].
pub(crate) const ANY: &str = "";

/// Value of Python's `None` for a field of a dict or a keyword argument; `None` if the field is left out.
///
/// # Errors
/// The field needs a value: `None` would be a silent default.
fn none_value(py: Python<'_>, kind: &str, field: &str, path: &str) -> PyResult<Option<Value>> {
    if NONE_IS_FALSE.contains(&field) {
        return Ok(Some(Value::Boolean(false)));
    }
    let optional = py.import("kinetoscope._accepted")?.getattr("is_optional")?.call1((kind, field))?;
    if optional.extract::<bool>()? {
        return Ok(None);
    }
    Err(invalid(path, "None is not a value of this field; leave it out for its default"))
}

/// Largest depth of nested values; a structure that contains itself has no end.
const MAX_DEPTH: usize = 64;

/// Raises the error that a function of `kinetoscope._accepted` finds, if any.
fn refuse<'py>(py: Python<'py>, function: &str, arguments: impl pyo3::call::PyCallArgs<'py>) -> PyResult<()> {
    let message = py.import("kinetoscope._accepted")?.getattr(function)?.call1(arguments)?;
    match message.extract::<Option<String>>()? {
        None => Ok(()),
        Some(message) => Err(Failure::new(Class::Config, message).into()),
    }
}

/// Refuses configurations of entities that are not sensors.
pub(crate) fn check_sensor(py: Python<'_>, kind: &str) -> PyResult<()> {
    refuse(py, "not_a_sensor", (kind,))
}

/// Converts the fields of a configuration: of a dataclass, those that differ from their defaults; of a mapping, all.
/// `kind` is the type of the configuration: that of an entity in scene files, [`SIMULATION`], the name of a class, or
/// [`ANY`].
///
/// # Errors
/// The configuration or a part of it has another class of the package: its fields would be lost silently.
pub(crate) fn table(kind: &str, cfg: Option<&Bound<'_, PyAny>>, fields: Option<&Bound<'_, PyDict>>) -> PyResult<Table> {
    if let Some(cfg) = cfg {
        refuse(cfg.py(), "mistake", (kind, cfg))?;
    }
    let mut table = match cfg.map(|cfg| value(cfg, kind, "", 0)).transpose()? {
        None | Some(None) => Table::new(),
        Some(Some(Value::Table(table))) => table,
        Some(Some(_)) => {
            let found = cfg.map_or(Ok(String::new()), |cfg| Ok::<_, PyErr>(cfg.get_type().name()?.to_string()))?;
            let message = format!("expected a configuration or a dict of its fields, not {found}");
            return Err(Failure::new(Class::Config, message).into());
        }
    };
    for (name, field) in fields.into_iter().flatten() {
        let name: String = name.extract()?;
        refuse(field.py(), "mistake_in_field", (kind, &name, &field))?;
        let given = match value(&field, ANY, &name, 0)? {
            None => none_value(field.py(), kind, &name, &name)?,
            given => given,
        };
        match given {
            Some(given) => table.insert(name, given),
            None => table.remove(&name),
        };
    }
    Ok(table)
}

/// Converts a value; `None` for Python's `None`. `kind` is the type of a dict, `path` names the value in errors.
fn value(obj: &Bound<'_, PyAny>, kind: &str, path: &str, depth: usize) -> PyResult<Option<Value>> {
    if depth > MAX_DEPTH {
        return Err(invalid(path, "the configuration is nested too deeply, or contains itself"));
    }
    if obj.is_none() {
        return Ok(None);
    }
    if let Ok(text) = obj.cast::<PyString>() {
        return Ok(Some(Value::String(text.to_str()?.into())));
    }
    if let Ok(yes) = obj.cast::<PyBool>() {
        return Ok(Some(Value::Boolean(yes.is_true())));
    }
    if let Ok(number) = obj.cast::<PyInt>() {
        let number = number.extract().map_err(|_| invalid(path, "the number must be from -2^63 to 2^63 - 1"))?;
        return Ok(Some(Value::Integer(number)));
    }
    if let Ok(number) = obj.cast::<PyFloat>() {
        return Ok(Some(Value::Float(number.value())));
    }
    if obj.hasattr("__dataclass_fields__")? && !obj.is_instance_of::<PyType>() {
        return dataclass(obj, path, depth).map(|table| Some(Value::Table(table)));
    }
    if let Ok(items) = obj.cast::<PyList>() {
        return sequence(items.iter(), path, depth).map(Some);
    }
    if let Ok(items) = obj.cast::<PyTuple>() {
        return sequence(items.iter(), path, depth).map(Some);
    }
    if let Ok(mapping) = obj.cast::<PyMapping>() {
        let mut table = Table::new();
        for item in mapping.items()?.iter() {
            let (key, entry): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
            let key: String = key.extract().map_err(|_| invalid(path, "the keys of a dict must be strings"))?;
            let path = join(path, &key);
            let entry = match value(&entry, ANY, &path, depth + 1)? {
                None => none_value(obj.py(), kind, &key, &path)?,
                entry => entry,
            };
            entry.into_iter().for_each(|entry| drop(table.insert(key.clone(), entry)));
        }
        return Ok(Some(Value::Table(table)));
    }
    // Paths, NumPy arrays and scalars, tensors, members of enumerations.
    if obj.hasattr("__fspath__")? {
        return value(&obj.call_method0("__fspath__")?, ANY, path, depth + 1);
    }
    if obj.hasattr("tolist")? {
        return value(&obj.call_method0("tolist")?, ANY, path, depth + 1);
    }
    if obj.hasattr("__array__")? {
        return value(&obj.call_method0("__array__")?.call_method0("tolist")?, ANY, path, depth + 1);
    }
    if obj.hasattr("value")? {
        return value(&obj.getattr("value")?, ANY, path, depth + 1);
    }
    let found = obj.get_type().name()?;
    Err(invalid(path, &format!("{found} is not a number, text, list, dict or configuration")))
}

/// Fields of a dataclass that differ from their defaults. `None` where the default is another value is the `false` of
/// scene files.
fn dataclass(obj: &Bound<'_, PyAny>, path: &str, depth: usize) -> PyResult<Table> {
    let fields = obj.getattr("__dataclass_fields__")?;
    let mut table = Table::new();
    for field in fields.call_method0("values")?.try_iter()? {
        let field = field?;
        let name: String = field.getattr("name")?.extract()?;
        let own = obj.getattr(name.as_str())?;
        let default = default_of(&field)?;
        if default.as_ref().is_some_and(|default| is_same(&own, default)) {
            continue;
        }
        let converted = value(&own, ANY, &join(path, &name), depth + 1)?;
        if let Some(converted) = converted.or_else(|| default.map(|_| Value::Boolean(false))) {
            table.insert(name, converted);
        }
    }
    Ok(table)
}

/// Default of a field of a dataclass; `None` if it must be given.
fn default_of<'py>(field: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let missing = field.py().import("dataclasses")?.getattr("MISSING")?;
    let default = field.getattr("default")?;
    if !default.is(&missing) {
        return Ok(Some(default));
    }
    let factory = field.getattr("default_factory")?;
    if factory.is(&missing) { Ok(None) } else { factory.call0().map(Some) }
}

/// True if the values are equal. Values that cannot be compared, such as arrays, differ.
fn is_same(own: &Bound<'_, PyAny>, default: &Bound<'_, PyAny>) -> bool {
    own.is(default) || (own.get_type().is(default.get_type()) && own.eq(default).unwrap_or(false))
}

fn sequence<'py>(items: impl Iterator<Item = Bound<'py, PyAny>>, path: &str, depth: usize) -> PyResult<Value> {
    let convert = |(index, item): (usize, Bound<'py, PyAny>)| {
        let path = format!("{path}[{index}]");
        value(&item, ANY, &path, depth + 1)?.ok_or_else(|| invalid(&path, "a list cannot contain None"))
    };
    items.enumerate().map(convert).collect::<PyResult<Vec<Value>>>().map(Value::Array)
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.into() } else { format!("{path}.{name}") }
}

fn invalid(path: &str, problem: &str) -> PyErr {
    let message = if path.is_empty() { problem.into() } else { format!("{path}: {problem}") };
    Failure::new(Class::Config, message).into()
}

/// Reads the text of a scene file that came from Python. Relative paths are relative to the working folder.
pub(crate) fn scene(document: &Table) -> Result<SceneCfg, Failure> {
    guarded(|| {
        let text = toml::to_string(document)?;
        Ok(SceneCfg::from_toml(&text, PYTHON, &EntityTypes::default())?)
    })
}

/// Reads the configuration of a simulation.
pub(crate) fn simulation(fields: Table) -> Result<SimulationManagerCfg, Failure> {
    let document = Table::from_iter([("simulation".to_string(), Value::Table(fields))]);
    Ok(scene(&document)?.simulation)
}

/// Reads the configuration of one entity of type `kind`. The name is the argument, or else the field `uid`, or else
/// the default of the type.
pub(crate) fn entity(kind: &str, name: Option<String>, mut fields: Table) -> Result<(String, EntityCfg), Failure> {
    let uid = match fields.remove("uid") {
        None => None,
        Some(Value::String(uid)) => Some(uid),
        Some(other) => return Err(Failure::new(Class::Config, format!("uid: expected a text, not {other}"))),
    };
    let name = name.or(uid).unwrap_or_else(|| default_uid(kind));
    fields.insert("type".into(), Value::String(kind.into()));
    let entities = Table::from_iter([(name.clone(), Value::Table(fields))]);
    let document = Table::from_iter([("entities".to_string(), Value::Table(entities))]);
    let (_, cfg) = scene(&document)?.entities.pop().ok_or_else(|| Failure::new(Class::Internal, "no entity"))?;
    Ok((name, cfg))
}

/// Name of an entity without one: the default of its configuration, as in the classes of Python.
pub(crate) fn default_uid(kind: &str) -> String {
    match kind {
        "robot" => RobotCfg::default().uid,
        "articulation" => ArticulationCfg::default().uid,
        "rigid_object" => RigidObjectCfg::default().uid,
        "rigid_object_group" => RigidObjectGroupCfg::default().uid,
        "terrain" => TerrainCfg::default().uid,
        "mjcf" => MjcfPartCfg::default().uid,
        "weld" => WeldCfg::default().uid,
        other => other.into(),
    }
}

/// Reads a configuration that is not part of scene files. `what` is the name of its class, or of its content.
pub(crate) fn read<T: DeserializeOwned>(what: &str, cfg: Option<&Bound<'_, PyAny>>) -> PyResult<T> {
    of_table(what, table(what, cfg, None)?)
}

/// Reads the fields of a configuration that is not part of scene files.
pub(crate) fn of_table<T: DeserializeOwned>(what: &str, fields: Table) -> PyResult<T> {
    let invalid = |error: toml::de::Error| Failure::new(Class::Config, format!("{what}: {}", error.message()));
    Ok(guarded(|| Value::Table(fields).try_into().map_err(invalid))?)
}

/// Type name of a configuration in scene files: the class attribute `_type` of its dataclass, or its key `type`.
pub(crate) fn type_of(cfg: &Bound<'_, PyAny>) -> PyResult<Option<String>> {
    if let Ok(mapping) = cfg.cast::<PyMapping>() {
        return mapping.get_item("type").map_or(Ok(None), |kind| kind.extract().map(Some));
    }
    cfg.getattr_opt("_type")?.map(|kind| kind.extract()).transpose()
}

/// Changes the named fields of a configuration of a simulation. A field without a value in `changes` is None.
pub(crate) fn changed_simulation(
    cfg: &SimulationManagerCfg,
    names: &[String],
    changes: Table,
) -> Result<SimulationManagerCfg, Failure> {
    let mut fields = guarded(|| Ok(Table::try_from(cfg)?))?;
    names.iter().for_each(|name| drop(fields.remove(name)));
    fields.extend(changes);
    simulation(fields)
}

/// Table of a scene from a `SceneCfg` or a dict: entities may be configurations with a type, whose `uid` is replaced by the
/// name, and collision exclusions may be pairs or `ExclusionCfg`.
pub(crate) fn scene_table(scene: &Bound<'_, PyAny>) -> PyResult<Table> {
    let mut document = table(SCENE, Some(scene), None)?;
    let part = |name: &str| match scene.cast::<PyMapping>() {
        Ok(scene) => scene.get_item(name).ok(),
        Err(_) => scene.getattr(name).ok(),
    };
    if let Some(simulation) = part(SIMULATION) {
        refuse(scene.py(), "mistake", (SIMULATION, simulation))?;
    }
    if let (Some(Value::Table(converted)), Some(entities)) = (document.get_mut("entities"), part("entities")) {
        for item in entities.cast::<PyMapping>()?.items()?.iter() {
            let (name, entity): (String, Bound<'_, PyAny>) = item.extract()?;
            let Some(Value::Table(fields)) = converted.get_mut(&name) else { continue };
            if let Some(kind) = type_of(&entity)? {
                refuse(entity.py(), "mistake", (&kind, &entity))?;
                fields.insert("type".into(), Value::String(kind));
            }
            if entity.cast::<PyMapping>().is_err() {
                fields.remove("uid");
            }
        }
    }
    if let Some(Value::Array(exclusions)) = document.get_mut(EXCLUSIONS) {
        for (index, exclusion) in exclusions.iter_mut().enumerate() {
            let path = format!("{EXCLUSIONS}[{index}]");
            if let Value::Table(fields) = exclusion {
                if let Some(name) = fields.keys().find(|name| *name != "pair") {
                    return Err(invalid(&path, &format!("unknown field `{name}`, expected `pair`")));
                }
                *exclusion = fields.remove("pair").ok_or_else(|| invalid(&path, "missing field `pair`"))?;
            }
            if !matches!(exclusion, Value::Array(names) if names.len() == 2 && names.iter().all(Value::is_str)) {
                return Err(invalid(&path, &format!("expected two names, not {exclusion}")));
            }
        }
    }
    Ok(document)
}
