//! What decides the next step, saved and restored: continuing from it is bit-identical.

use super::data::Data;
use super::model::Model;
use mujoco_sys::fields::data as arrays;

/// What a step changes: time, positions, velocities, activations and the solver's warm start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    values: Vec<f64>,
}

/// What a user sets and a step only reads: controls, applied forces, mocap poses, user data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inputs {
    values: Vec<f64>,
    /// Active equalities: part of the data on 4.x, of the model on 2.2.2.
    #[cfg(mj4)]
    active: Vec<bool>,
}

/// Implements `save` and `restore` of a list of `mjData` arrays, in order.
macro_rules! copied_arrays {
    ($owner:ident: $($array:ident / $array_mut:ident),* $(,)?) => {
        impl $owner {
            fn save_arrays(&mut self, data: &Data) {
                let (m, d) = (data.model().raw(), data.raw());
                $(
                    // SAFETY: model and data belong together and are alive; nothing writes meanwhile.
                    self.values.extend_from_slice(unsafe { arrays::$array(m, d) });
                )*
            }

            fn restore_arrays(&self, data: &mut Data, mut values: &[f64]) {
                let (m, d) = (data.model().raw(), data.raw_mut());
                $(
                    // SAFETY: model and data belong together and are alive; `data` is borrowed mutably.
                    let array = unsafe { arrays::$array_mut(m, d) };
                    let (mine, rest) = values.split_at(array.len());
                    array.copy_from_slice(mine);
                    values = rest;
                )*
                debug_assert!(values.is_empty());
            }
        }
    };
}

copied_arrays!(Motion: qpos / qpos_mut, qvel / qvel_mut, act / act_mut, qacc_warmstart / qacc_warmstart_mut);
copied_arrays!(
    Inputs: ctrl / ctrl_mut,
    qfrc_applied / qfrc_applied_mut,
    xfrc_applied / xfrc_applied_mut,
    mocap_pos / mocap_pos_mut,
    mocap_quat / mocap_quat_mut,
    userdata / userdata_mut,
);

impl Motion {
    /// No state at all.
    pub const EMPTY: Self = Self { values: Vec::new() };

    /// Takes the values of `other`, reusing this memory.
    pub fn copy_from(&mut self, other: &Self) {
        self.values.clone_from(&other.values);
    }

    /// Takes the values from `data`, reusing this memory.
    pub fn save(&mut self, data: &Data) {
        self.values.clear();
        self.values.push(data.time());
        self.save_arrays(data);
    }

    /// The positions of what was saved from a data of `model`.
    pub(crate) fn qpos(&self, model: &Model) -> &[f64] {
        &self.values[1..1 + model.nq()]
    }

    /// Puts the values into `data`, which is of the same model (its buffers may be larger).
    pub fn restore(&self, data: &mut Data) {
        if let Some((&time, values)) = self.values.split_first() {
            data.set_time(time);
            self.restore_arrays(data, values);
        }
    }
}

impl Inputs {
    /// Takes the values from `data`, reusing this memory.
    pub fn save(&mut self, data: &Data) {
        self.values.clear();
        self.save_arrays(data);
        #[cfg(mj4)]
        {
            // SAFETY: model and data belong together and are alive; nothing writes meanwhile.
            let active = unsafe { arrays::eq_active(data.model().raw(), data.raw()) };
            self.active.clear();
            self.active.extend_from_slice(active);
        }
    }

    /// Puts the values into `data`, which is of the same model (its buffers may be larger).
    pub fn restore(&self, data: &mut Data) {
        self.restore_arrays(data, &self.values);
        #[cfg(mj4)]
        {
            // SAFETY: model and data belong together and are alive; `data` is borrowed mutably.
            let active = unsafe { arrays::eq_active_mut(data.model().raw(), data.raw_mut()) };
            active.copy_from_slice(&self.active);
        }
    }
}
