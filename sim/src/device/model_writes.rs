//! Writes of the models of environments whose properties differ.

use super::DeviceError;
use crate::row::StoredRow;
use kinetoscope_mujoco::{ModelPatch, NumberArray};
use std::collections::BTreeMap;

/// Arrays of the model that can differ between the environments of a device.
const MODEL_ARRAYS: [NumberArray; 15] = [
    NumberArray::BODY_MASS,
    NumberArray::BODY_SUBTREEMASS,
    NumberArray::BODY_INERTIA,
    NumberArray::BODY_IPOS,
    NumberArray::BODY_IQUAT,
    NumberArray::BODY_POS,
    NumberArray::BODY_QUAT,
    NumberArray::BODY_INVWEIGHT0,
    NumberArray::DOF_ARMATURE,
    NumberArray::DOF_DAMPING,
    NumberArray::DOF_FRICTIONLOSS,
    NumberArray::DOF_INVWEIGHT0,
    NumberArray::TENDON_FRICTIONLOSS,
    NumberArray::TENDON_INVWEIGHT0,
    NumberArray::GEOM_FRICTION,
];

/// Arrays that change together with properties and that the physics of the device does not read.
const UNREAD_ARRAYS: [&str; 8] = [
    "actuator_acc0",
    "actuator_length0",
    "cam_pos0",
    "cam_poscom0",
    "dof_M0",
    "geom_rgba",
    "light_pos0",
    "light_poscom0",
];

/// Writes of arrays of the model: environments and their rows, by the name of the array.
pub(super) type ModelWrites = BTreeMap<&'static str, (Vec<i32>, Vec<f32>)>;

/// Adds the arrays in which the model of an environment changed.
pub(super) fn add_model_writes(
    env: usize,
    row: &StoredRow<'_>,
    before: Option<&ModelPatch>,
    writes: &mut ModelWrites,
) -> Result<(), DeviceError> {
    let now = row.row.patch.as_deref();
    let mut names: Vec<&str> =
        before.into_iter().chain(now).flat_map(|patch| patch.arrays().map(|(name, _)| name)).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        if let Some(array) = MODEL_ARRAYS.into_iter().find(|array| array.name() == name) {
            let (envs, values) = writes.entry(array.name()).or_default();
            envs.push(env as i32);
            values.extend(array.all(row.model, now).iter().map(|x| *x as f32));
        } else if !UNREAD_ARRAYS.contains(&name) {
            let names: Vec<&str> = MODEL_ARRAYS.iter().map(|array| array.name()).collect();
            return Err(DeviceError::Unsupported {
                what: format!("own values of `{name}` in environment {env}"),
                expected: format!("it can randomize {} and gravity", names.join(", ")),
            });
        }
    }
    let gravity = |patch: Option<&ModelPatch>| patch.map_or_else(|| row.model.gravity(), ModelPatch::gravity);
    if gravity(before) != gravity(now) {
        let (envs, values) = writes.entry("gravity").or_default();
        envs.push(env as i32);
        values.extend(gravity(now).map(|x| x as f32));
    }
    Ok(())
}
