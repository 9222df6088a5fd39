//! Extension module of the Python package `kinetoscope`: the Rust API as Python classes.
//!
//! A class holds a shared simulation behind a lock ([`shared`]); its methods convert arguments, release the interpreter,
//! call the Rust method of the same name, and convert the result. Configurations arrive in the form of scene files
//! ([`cfg`]). Every failure is an exception of `kinetoscope.errors` ([`errors`]), panics included.
#![forbid(unsafe_code)]

mod arguments;
mod calibration;
mod cfg;
mod cfg_methods;
mod channels;
mod device;
mod dynamics;
mod errors;
mod file_recording;
mod html;
mod kinematics;
mod objects;
mod progress;
mod recording;
mod robot;
mod segmentation;
mod sensor;
mod shared;
mod simulation;
mod snapshot;
mod task;
mod timed_lock;
mod values;
mod viewer;
mod viewer_control;

use errors::Failure;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Path of a bundled asset such as ``sr5/SR5.urdf``, searched in the folder ``KINETOSCOPE_ASSETS``, then in the package.
#[pyfunction]
fn asset_path(asset: PathBuf) -> PyResult<PathBuf> {
    Ok(shared::guarded(|| Ok(kinetoscope::assets::path(asset)?))?)
}

/// Names the folder of assets of the package. Returns false if another folder was named before, which stays.
#[pyfunction]
fn _set_assets(folder: PathBuf) -> bool {
    kinetoscope::assets::set_folder(folder)
}

/// Configuration of a bundled robot as the text of a scene file with this one entity.
#[pyfunction]
fn bundled_robot(name: &str) -> PyResult<String> {
    use kinetoscope::assets;
    let text = shared::guarded(|| {
        let robot = match name {
            "quadruped" => assets::quadruped()?,
            "sr5" => assets::sr5()?,
            "revo1_left" => assets::revo1_left()?,
            "sr5_with_hand" => assets::sr5_with_hand()?,
            other => {
                let message =
                    format!("unknown robot {other:?}; known names: quadruped, sr5, revo1_left, sr5_with_hand");
                return Err(Failure::new(errors::Class::UnknownName, message));
            }
        };
        let scene = kinetoscope::sim::SceneCfg::default().with(robot.uid.clone(), robot);
        Ok(scene.to_toml(&kinetoscope::sim::EntityTypes::default())?)
    });
    Ok(text?)
}

/// Version of the MuJoCo library that is loaded.
#[pyfunction]
fn mujoco_version() -> String {
    kinetoscope::mujoco::version_string()
}

/// Name of an entity without one, by its type in scene files.
#[pyfunction]
fn _default_uid(kind: &str) -> String {
    cfg::default_uid(kind)
}

/// Default of a configuration that is not part of scene files, as TOML.
#[pyfunction]
fn _default_fields(name: &str) -> PyResult<String> {
    use kinetoscope::{record, robot::kinematics, scene::terrain, sensors::camera, sim, tasks, viewer};
    macro_rules! defaults {
        ($($name:literal => $default:expr,)*) => {
            match name {
                $($name => Ok(toml::to_string(&$default)?),)*
                other => Err(Failure::new(errors::Class::UnknownName, format!("no default of {other:?}"))),
            }
        };
    }
    let text = shared::guarded(|| {
        defaults! {
            "IkCfg" => kinematics::IkCfg::default(),
            "NullSpacePosture" => kinematics::NullSpacePosture::at(Vec::new()),
            "TerrainGrid" => terrain::TerrainGrid::default(),
            "Randomization" => sim::Randomization::default(),
            "SegmentationCfg" => camera::SegmentationCfg::default(),
            "InspectCfg" => sim::inspect::InspectCfg::default(),
            "TaskCfg" => tasks::TaskCfg::default(),
            "OrbitCamera" => viewer::OrbitCamera::default(),
            "Overlays" => viewer::Overlays::default(),
            "ServeCfg" => viewer::ServeCfg::default(),
            "WindowCfg" => viewer::WindowCfg::default(),
            "ScreenshotCfg" => viewer::ScreenshotCfg::default(),
            "OverviewCfg" => record::OverviewCfg::default(),
            "RecorderCfg" => record::RecorderCfg::default(),
            "FoxgloveCfg" => record::FoxgloveCfg::default(),
        }
    });
    Ok(text?)
}

/// Masses, links, joints, mass matrix and gravity torques of a robot at joint positions, without a simulation: a dict of
/// plain values. ``cfg`` is an ``InspectCfg`` or a dict of its fields; keyword arguments replace fields. A number that is not
/// finite, such as an unlimited effort, is None.
#[pyfunction]
#[pyo3(signature = (cfg=None, **fields))]
fn inspect<'py>(
    py: Python<'py>,
    cfg: Option<&Bound<'py, PyAny>>,
    fields: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut fields = cfg::table("InspectCfg", cfg, fields)?;
    // A path in place of a table, as in the configuration of a robot.
    let path = |value: Option<&toml::Value>| value.and_then(toml::Value::as_str).map(PathBuf::from);
    let (urdf, mjcf) = (path(fields.get("urdf")), path(fields.get("mjcf")));
    [("urdf", &urdf), ("mjcf", &mjcf)]
        .iter()
        .filter(|(_, path)| path.is_some())
        .for_each(|(name, _)| drop(fields.remove(*name)));
    let mut cfg: kinetoscope::sim::inspect::InspectCfg = cfg::of_table("InspectCfg", fields)?;
    cfg.urdf = urdf.map_or(cfg.urdf, kinetoscope::robot::urdf::UrdfCfg::single);
    cfg.mjcf = mjcf.map(kinetoscope::sim::MjcfFile::new).or(cfg.mjcf);
    let text = shared::detached(py, || Ok(serde_json::to_string(&kinetoscope::sim::inspect::inspect(&cfg)?)?))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// JSON Schema (draft 7) of scene files, a dict, for completion and checks in editors.
#[pyfunction]
fn json_schema(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let types = kinetoscope::sim::EntityTypes::default();
    let text = shared::detached(py, || Ok(kinetoscope::sim::SceneCfg::json_schema(&types).to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Makes the next call panic, or ends such a request, to test that a panic becomes an ``InternalError``. Returns True if
/// there was a request.
#[pyfunction]
fn _panic_next(requested: bool) -> bool {
    shared::request_panic(requested)
}

#[pymodule]
fn _sim(module: &Bound<'_, PyModule>) -> PyResult<()> {
    kinetoscope::sim::set_device_opener(device::open);
    module.add_class::<simulation::Simulation>()?;
    module.add_class::<robot::Robot>()?;
    module.add_class::<robot::IkResult>()?;
    module.add_class::<kinematics::KinematicChain>()?;
    module.add_class::<objects::RigidObject>()?;
    module.add_class::<objects::RigidObjectGroup>()?;
    module.add_class::<objects::Terrain>()?;
    module.add_class::<objects::MjcfPart>()?;
    module.add_class::<objects::Weld>()?;
    module.add_class::<sensor::Sensor>()?;
    module.add_class::<progress::RenderProgress>()?;
    module.add_class::<segmentation::Segmentation>()?;
    module.add_class::<snapshot::Snapshot>()?;
    module.add_class::<task::Task>()?;
    module.add_class::<recording::Topic>()?;
    module.add_class::<recording::Recorder>()?;
    module.add_class::<recording::RecordingSummary>()?;
    module.add_class::<recording::Playback>()?;
    module.add_class::<recording::FoxgloveServer>()?;
    module.add_class::<file_recording::FileRecording>()?;
    module.add_class::<viewer::Server>()?;
    module.add_class::<viewer::Window>()?;
    module.add_class::<viewer::ImageWindow>()?;
    module.add_class::<viewer_control::Viewer>()?;
    module.add_function(wrap_pyfunction!(asset_path, module)?)?;
    module.add_function(wrap_pyfunction!(bundled_robot, module)?)?;
    module.add_function(wrap_pyfunction!(kinematics::assemble_urdf, module)?)?;
    module.add_function(wrap_pyfunction!(inspect, module)?)?;
    module.add_function(wrap_pyfunction!(json_schema, module)?)?;
    module.add_function(wrap_pyfunction!(calibration::read_calibration, module)?)?;
    module.add_function(wrap_pyfunction!(mujoco_version, module)?)?;
    module.add_function(wrap_pyfunction!(recording::recover, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::to_toml, module)?)?;
    module.add_function(wrap_pyfunction!(recording::read_series, module)?)?;
    module.add_function(wrap_pyfunction!(recording::recording_topics, module)?)?;
    cfg_methods::add(module)?;
    module.add_function(wrap_pyfunction!(_set_assets, module)?)?;
    module.add_function(wrap_pyfunction!(_default_uid, module)?)?;
    module.add_function(wrap_pyfunction!(_default_fields, module)?)?;
    module.add_function(wrap_pyfunction!(_panic_next, module)?)?;
    module.add("_NONE_IS_FALSE", cfg::NONE_IS_FALSE.to_vec())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
