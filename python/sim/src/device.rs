//! The physics of a device in this process: an object of the class `WarpPhysics` of `kinetoscope.warp`.

use kinetoscope::sim::{Device, DeviceError, DevicePhysics};
use numpy::{IntoPyArray, PyReadonlyArrayDyn};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::path::Path;

/// An object of the class `WarpPhysics`.
#[derive(Debug)]
pub(crate) struct PythonPhysics {
    object: Py<PyAny>,
    /// True after the first step of a scene, which compiles kernels and can take minutes.
    is_compiled: bool,
}

/// Opens the physics of a device.
pub(crate) fn open(device: Device) -> Result<Box<dyn DevicePhysics>, DeviceError> {
    let object = Python::attach(|py| {
        let class = py.import("kinetoscope.warp")?.getattr("WarpPhysics")?;
        PyResult::Ok(class.call1((device.to_string(),))?.unbind())
    });
    let unavailable = |error: PyErr| DeviceError::Unavailable { device, message: message(&error) };
    Ok(Box::new(PythonPhysics { object: object.map_err(unavailable)?, is_compiled: false }))
}

/// Message of an exception, with its class if the exception is not of this package.
fn message(error: &PyErr) -> String {
    Python::attach(|py| {
        let of_package = py
            .import("kinetoscope.errors")
            .and_then(|errors| errors.getattr("KinetoscopeError"))
            .is_ok_and(|class| error.is_instance(py, &class));
        if of_package { error.value(py).to_string() } else { error.to_string() }
    })
}

/// Failure of a call. An exception with the attribute `kind` \"unsupported\" is about the scene.
fn failure(error: &PyErr) -> DeviceError {
    let text = message(error);
    let kind = Python::attach(|py| {
        error.value(py).getattr("kind").and_then(|kind| kind.extract::<String>()).unwrap_or_default()
    });
    if kind == "unsupported" {
        DeviceError::Unsupported { what: "this scene".into(), expected: text }
    } else {
        DeviceError::Failed(text)
    }
}

/// Calls `act`, and raises a Ctrl+C during the call after it.
fn without_interrupt<T>(object: &Bound<'_, PyAny>, act: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> PyResult<T> {
    let py = object.py();
    let is_interrupt = |error: &PyErr| error.is_instance_of::<PyKeyboardInterrupt>(py);
    let hold = || py.import("kinetoscope.warp.interrupts")?.call_method0("HeldInterrupts");
    let mut interrupted = false;
    // An earlier call of the same update may have been interrupted, too.
    let held = hold().or_else(|error| {
        interrupted = is_interrupt(&error);
        if interrupted { hold() } else { Err(error) }
    })?;
    let result = act(object);
    match held.call_method0("release").and_then(|noted| noted.extract::<bool>()) {
        Ok(noted) => interrupted |= noted,
        Err(error) if is_interrupt(&error) => interrupted = true,
        Err(error) => return Err(error),
    }
    if interrupted {
        interrupt(py);
    }
    result
}

/// Makes the interpreter raise KeyboardInterrupt as soon as it runs code of the program.
fn interrupt(py: Python<'_>) {
    // It fails only if the module is missing, which belongs to the interpreter.
    let _ = py.import("_thread").and_then(|thread| thread.call_method0("interrupt_main"));
}

impl PythonPhysics {
    /// Another reference to the object.
    pub(crate) fn handle(&self) -> Self {
        Python::attach(|py| Self { object: self.object.clone_ref(py), is_compiled: self.is_compiled })
    }

    /// The array of the device with this name.
    pub(crate) fn array(&self, py: Python<'_>, name: &str) -> PyResult<Py<PyAny>> {
        self.object.call_method1(py, "tensor", (name,))
    }

    /// Calls `act` with the object. Ctrl+C is raised after the call, so that it does not end in the middle; only a call
    /// that compiles kernels is interrupted, and fails.
    fn call<T>(&self, act: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> Result<T, DeviceError> {
        Python::attach(|py| {
            let object = self.object.bind(py);
            if self.is_compiled { without_interrupt(object, act) } else { act(object) }.map_err(|error| {
                let failure = failure(&error);
                if error.is_instance_of::<PyKeyboardInterrupt>(py) {
                    interrupt(py);
                }
                failure
            })
        })
    }
}

impl DevicePhysics for PythonPhysics {
    fn load(&mut self, folder: &Path, scene: &str, num_envs: usize) -> Result<(), DeviceError> {
        self.is_compiled = false;
        self.call(|object| object.call_method1("load", (folder.display().to_string(), scene, num_envs)).map(|_| ()))
    }

    fn write(&mut self, array: &str, envs: &[i32], values: &[f32]) -> Result<(), DeviceError> {
        self.call(|object| {
            let py = object.py();
            let values = values.to_vec().into_pyarray(py).call_method1("reshape", (envs.len(), -1_i32))?;
            object.call_method1("write", (array, envs.to_vec().into_pyarray(py), values)).map(|_| ())
        })
    }

    fn step(&mut self, steps: u32, capture: &[&str]) -> Result<String, DeviceError> {
        let report = self.call(|object| object.call_method1("step", (steps, capture.to_vec()))?.extract())?;
        self.is_compiled = true;
        Ok(report)
    }

    fn read(&mut self, array: &str) -> Result<Vec<f32>, DeviceError> {
        self.call(|object| {
            let values = object.call_method1("read", (array,))?;
            let values: PyReadonlyArrayDyn<'_, f32> = values.extract()?;
            Ok(values.as_array().iter().copied().collect())
        })
    }

    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}
