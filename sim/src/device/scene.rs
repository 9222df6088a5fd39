//! A compiled scene as the device loads it: the MJCF document with its files, the drives, and numbers of the compiled
//! model.

use super::{DeviceError, DeviceMirror};
use crate::drive::table::{DriveTable, Realization};
use crate::entity_set::EntitySet;
use crate::mjcf::document::Integrator;
use crate::mjcf::scene::terrain_file;
use crate::simulation::Simulation;
use crate::simulation_cfg::SimulationManagerCfg;
use kinetoscope_mujoco::{Model, NumberArray, ObjectKind};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

/// Version of the JSON object.
const VERSION: u32 = 1;

/// Arrays that the device takes from our compiled model: a later MuJoCo may compile other numbers from the same document,
/// and drives change some after compilation.
const COPIED_ARRAYS: [NumberArray; 7] = [
    NumberArray::BODY_MASS,
    NumberArray::BODY_INERTIA,
    NumberArray::BODY_IPOS,
    NumberArray::BODY_IQUAT,
    NumberArray::DOF_ARMATURE,
    NumberArray::DOF_DAMPING,
    NumberArray::DOF_FRICTIONLOSS,
];

/// A scene for a device.
pub(crate) struct DeviceScene<'a> {
    xml: &'a str,
    /// Files that the document names, with their contents.
    files: Vec<(String, std::borrow::Cow<'a, [u8]>)>,
    /// JSON object with sizes, drives and numbers of the compiled model.
    json: String,
    /// True if the scene has a degree of freedom.
    moves: bool,
}

impl<'a> DeviceScene<'a> {
    /// The scene of a compiled simulation.
    ///
    /// # Errors
    /// The device cannot simulate an element of the scene.
    pub(crate) fn new(
        cfg: &SimulationManagerCfg,
        contents: &'a EntitySet,
        simulation: &'a Simulation,
    ) -> Result<Self, DeviceError> {
        let unsupported =
            |what: String, expected: &str| Err(DeviceError::Unsupported { what, expected: expected.into() });
        if !matches!(cfg.integrator, Integrator::Euler | Integrator::ImplicitFast) {
            return unsupported(format!("the integrator {}", cfg.integrator.name()), "expected Euler or implicitfast");
        }
        if let Some(weld) = contents.welds.first() {
            return unsupported(format!("the weld {:?}", weld.cfg.uid), "welds need the device cpu");
        }
        let model = simulation.batch.model();
        if let Some(feature) = model.has_history().then_some("delays of actuators or sensors") {
            return unsupported(feature.into(), "leave them out, or use the device cpu");
        }
        let table = simulation.batch.read_row(0, |row| Arc::clone(row.drives.table()));
        if let Some(explicit) = table.models.first() {
            let dof = table.drives[explicit.drive].dof;
            let what = format!("the explicit actuator model of the joint at degree of freedom {dof}");
            return unsupported(what, "expected a drive without `actuator`, or the device cpu");
        }
        let terrains = contents.terrains.iter().enumerate();
        let terrains = terrains.map(|(index, terrain)| (terrain_file(index), terrain.file().into()));
        let files = contents.files().map(|file| (file.name.clone(), file.bytes.as_slice().into()));
        let json = describe(model, &table).to_string();
        Ok(Self { xml: &simulation.xml, files: terrains.chain(files).collect(), json, moves: model.nv() > 0 })
    }

    /// Loads the scene on a device, unless nothing moves in it. All rows are sent before the next step.
    ///
    /// # Errors
    /// The device cannot simulate the scene, failed, or the files of the scene cannot be written to a temporary folder.
    pub(crate) fn load_on(
        &self,
        device: &mut DeviceMirror,
        table: &Arc<DriveTable>,
        num_envs: usize,
    ) -> Result<(), DeviceError> {
        let failed = |error: std::io::Error| DeviceError::Failed(format!("the scene cannot be written: {error}"));
        if self.moves {
            let folder = tempfile::tempdir().map_err(failed)?;
            self.write_to(folder.path()).map_err(failed)?;
            device.load(folder.path(), &self.json, num_envs)?;
        }
        device.reset_for(table, num_envs);
        Ok(())
    }

    /// Writes `scene.xml` and the files that it names to a folder.
    fn write_to(&self, folder: &Path) -> std::io::Result<()> {
        std::fs::write(folder.join("scene.xml"), self.xml)?;
        for (name, bytes) in &self.files {
            let path = folder.join(name);
            if let Some(parent) = path.parent() {
                std::fs::create_dir_all(parent)?;
            }
            std::fs::write(path, bytes)?;
        }
        Ok(())
    }
}

/// The JSON object: sizes, drives, and numbers of the compiled model.
fn describe(model: &Model, table: &DriveTable) -> Value {
    let drives = table.drives.iter().filter(|drive| drive.realization == Realization::ConstraintRow);
    let drives = drives.map(|drive| {
        let gains = &drive.initial;
        let joint = (0..model.njnt()).find(|joint| model.jnt_dofadr()[*joint] as usize == drive.dof);
        let name = joint.and_then(|joint| model.name(ObjectKind::Joint, joint)).unwrap_or_default();
        json!({
            "name": name, "dof": drive.dof, "qpos": drive.qpos, "ctrl": drive.ctrl, "stiffness": gains.kp, "damping": gains.kd,
            "max_effort": gains.max_effort.is_finite().then_some(gains.max_effort),
        })
    });
    let of = |realization| {
        let drives = table.drives.iter().filter(move |drive| drive.realization == realization);
        drives.map(|drive| drive.ctrl).collect::<Vec<_>>()
    };
    let arrays: serde_json::Map<String, Value> =
        COPIED_ARRAYS.iter().map(|array| (array.name().into(), array.all(model, None).into())).collect();
    json!({
        "version": VERSION,
        "timestep": model.timestep(),
        "sizes": {
            "nq": model.nq(), "nv": model.nv(), "nu": model.nu(), "nbody": model.nbody(), "ngeom": model.ngeom(),
            "neq": model.neq(), "ntendon": model.ntendon(), "na": model.na(), "nmocap": model.nmocap(),
        },
        "model": arrays,
        "drives": drives.collect::<Vec<_>>(),
        "silent_actuators": of(Realization::ConstraintRow),
        "unlimited_controls": of(Realization::Actuator),
        "damped": table.damped,
    })
}
