//! State that determines the next step. Restoring it continues a simulation bit-identically.

use super::data::Data;
use super::model::Model;
use mujoco_sys::fields::data as arrays;

/// State that a step changes: time, positions, velocities, activations and the solver's warm start; on 4.x also the
/// history of delayed actuators and sensors, plastic deformations, and the state of plugins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IntegrationState {
    values: Vec<f64>,
}

/// Quaternions of `qpos` before the last forward pass.
///
/// The forward pass of 2.2.2 normalizes the quaternions of free and ball joints in place, and a second pass would
/// change their last bits. On 4.x positions do not change, so no quaternion is stored.
#[derive(Clone, Debug, Default)]
pub struct UnnormalizedQuats {
    /// First quaternion, `None` if there is nothing to store. It needs no heap memory: a robot has at most one in the
    /// common case.
    first: Option<UnnormalizedQuat>,
    others: Box<[UnnormalizedQuat]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct UnnormalizedQuat {
    /// Index in `qpos`.
    address: usize,
    value: [f64; 4],
}

/// Inputs that a user sets and a step only reads: controls, applied forces, mocap poses, user data, and active flags of
/// equalities (4.x).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UserInputs {
    values: Vec<f64>,
    /// Active flags of equalities. They belong to the data on 4.x, and to the model on 2.2.2.
    #[cfg(mj4)]
    active: Vec<bool>,
}

/// Results of the last solve (`mj_step2`) that readers see until the next one, although `mj_step1` ran in between:
/// accelerations, forces of actuators and constraints, and the values of MuJoCo's own sensors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolvedState {
    values: Vec<f64>,
}

/// The part of [`UserInputs`] that steps and users change often: controls and applied joint forces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointInputs {
    values: Vec<f64>,
}

/// The rest of [`UserInputs`], which environments can share: forces on bodies, mocap poses, user data, and active flags
/// of equalities (4.x).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyInputs {
    values: Vec<f64>,
    #[cfg(mj4)]
    active: Vec<bool>,
}

/// Implements `save_arrays` and `restore_arrays` for a list of `mjData` arrays, in order.
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

            #[allow(dead_code, reason = "not every state is compared")]
            fn equals_arrays(&self, data: &Data) -> bool {
                let (m, d) = (data.model().raw(), data.raw());
                let mut values = &self.values[..];
                $(
                    // SAFETY: model and data belong together and are alive; nothing writes meanwhile.
                    let array = unsafe { arrays::$array(m, d) };
                    let Some((mine, rest)) = values.split_at_checked(array.len()) else { return false };
                    if !same_bits(mine, array) {
                        return false;
                    }
                    values = rest;
                )*
                values.is_empty()
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
                assert!(values.is_empty(), "the state is of another model: {} numbers too many", values.len());
            }
        }
    };
}

#[cfg(not(mj4))]
copied_arrays!(IntegrationState: qpos / qpos_mut, qvel / qvel_mut, act / act_mut, qacc_warmstart / qacc_warmstart_mut);
#[cfg(mj4)]
copied_arrays!(
    IntegrationState: qpos / qpos_mut,
    qvel / qvel_mut,
    act / act_mut,
    qacc_warmstart / qacc_warmstart_mut,
    history / history_mut,
    plastic / plastic_mut,
    plugin_state / plugin_state_mut,
);
copied_arrays!(
    SolvedState: qacc / qacc_mut,
    qfrc_actuator / qfrc_actuator_mut,
    qfrc_constraint / qfrc_constraint_mut,
    actuator_force / actuator_force_mut,
    sensordata / sensordata_mut,
);
copied_arrays!(JointInputs: ctrl / ctrl_mut, qfrc_applied / qfrc_applied_mut);
copied_arrays!(
    BodyInputs: xfrc_applied / xfrc_applied_mut,
    mocap_pos / mocap_pos_mut,
    mocap_quat / mocap_quat_mut,
    userdata / userdata_mut,
);
copied_arrays!(
    UserInputs: ctrl / ctrl_mut,
    qfrc_applied / qfrc_applied_mut,
    xfrc_applied / xfrc_applied_mut,
    mocap_pos / mocap_pos_mut,
    mocap_quat / mocap_quat_mut,
    userdata / userdata_mut,
);

/// True if both arrays have the same bits.
fn same_bits(one: &[f64], other: &[f64]) -> bool {
    // Bytes are compared many at a time, numbers one by one.
    // SAFETY: numbers have no padding, and the slice has this many bytes for as long as it is borrowed.
    let bytes =
        |numbers: &[f64]| unsafe { std::slice::from_raw_parts(numbers.as_ptr().cast::<u8>(), size_of_val(numbers)) };
    bytes(one) == bytes(other)
}

impl IntegrationState {
    /// State without values; [`restore`](Self::restore) does nothing with it.
    pub const EMPTY: Self = Self { values: Vec::new() };

    /// Copies the state of `data`, reusing memory.
    pub fn save(&mut self, data: &Data) {
        self.values.clear();
        self.values.push(data.time());
        self.save_arrays(data);
    }

    /// Sets the quaternions of this state to the values in `raw`, those before the forward pass of the saved data.
    pub fn undo_normalization(&mut self, raw: &UnnormalizedQuats) {
        for quat in raw.iter() {
            let first = 1 + quat.address;
            self.values[first..first + 4].copy_from_slice(&quat.value);
        }
    }

    /// Saved positions, shape (nq,). `model` is the model of the saved data.
    pub fn qpos(&self, model: &Model) -> &[f64] {
        &self.values[1..1 + model.nq()]
    }

    /// Saved velocities, shape (nv,). `model` is the model of the saved data.
    pub fn qvel(&self, model: &Model) -> &[f64] {
        &self.values[1 + model.nq()..1 + model.nq() + model.nv()]
    }

    /// Saved warm start of the solver, shape (nv,). `model` is the model of the saved data.
    pub fn qacc_warmstart(&self, model: &Model) -> &[f64] {
        let first = 1 + model.nq() + model.nv() + model.na();
        &self.values[first..first + model.nv()]
    }

    /// Saved activations of actuators, shape (na,). `model` is the model of the saved data.
    pub fn act(&self, model: &Model) -> &[f64] {
        let first = 1 + model.nq() + model.nv();
        &self.values[first..first + model.na()]
    }

    /// Saved time \[s\], positions, velocities, activations and warm start, for writing. `model` is the model of the
    /// saved data.
    pub fn parts_mut(&mut self, model: &Model) -> [&mut [f64]; 5] {
        let (time, rest) = self.values.split_at_mut(1);
        let (qpos, rest) = rest.split_at_mut(model.nq());
        let (qvel, rest) = rest.split_at_mut(model.nv());
        let (act, rest) = rest.split_at_mut(model.na());
        [time, qpos, qvel, act, &mut rest[..model.nv()]]
    }

    /// All numbers, time first.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Creates a state from the numbers of [`values`](Self::values).
    pub fn from_values(values: Vec<f64>) -> Self {
        Self { values }
    }

    /// Copies the state into `data`, whose model must have the same sizes; its buffers may be larger. Does nothing with
    /// an empty state. Another number of values panics. Derived quantities are not
    /// updated.
    pub fn restore(&self, data: &mut Data) {
        if let Some((&time, values)) = self.values.split_first() {
            data.set_time(time);
            self.restore_arrays(data, values);
        }
    }
}

/// Active flags of the equalities.
#[cfg(mj4)]
fn active_flags(data: &Data) -> &[bool] {
    // SAFETY: model and data belong together and are alive; nothing writes meanwhile.
    unsafe { arrays::eq_active(data.model().raw(), data.raw()) }
}

/// Active flags of the equalities, for writing.
#[cfg(mj4)]
fn active_flags_mut(data: &mut Data) -> &mut [bool] {
    let (m, d) = (data.model().raw(), data.raw_mut());
    // SAFETY: model and data belong together and are alive; `data` is borrowed mutably.
    unsafe { arrays::eq_active_mut(m, d) }
}

impl JointInputs {
    /// Copies the inputs of `data`, reusing memory.
    pub fn save(&mut self, data: &Data) {
        self.values.clear();
        self.save_arrays(data);
    }

    /// Copies the inputs into `data`, whose model must have the same sizes. Another number of values panics.
    pub fn restore(&self, data: &mut Data) {
        self.restore_arrays(data, &self.values);
    }

    /// All numbers: controls, then applied joint forces.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Controls, shape (nu,). `model` is the model of the saved data.
    pub fn ctrl(&self, model: &Model) -> &[f64] {
        &self.values[..model.nu()]
    }

    /// Controls, shape (nu,), for writing. `model` is the model of the saved data.
    pub fn ctrl_mut(&mut self, model: &Model) -> &mut [f64] {
        &mut self.values[..model.nu()]
    }
}

impl BodyInputs {
    /// Forces and torques applied to bodies \[N, N m\], 6 numbers per body. `model` is the model of the saved data.
    pub fn xfrc_applied(&self, model: &Model) -> &[f64] {
        &self.values[..6 * model.nbody()]
    }

    /// Positions \[m\], 3 numbers per mocap body, then quaternions, 4 numbers per mocap body. `model` is the model of the
    /// saved data.
    pub fn mocap(&self, model: &Model) -> (&[f64], &[f64]) {
        let (first, count) = (6 * model.nbody(), model.nmocap());
        self.values[first..first + 7 * count].split_at(3 * count)
    }

    /// True if `data` has the same inputs, bit for bit.
    pub fn matches(&self, data: &Data) -> bool {
        #[cfg(mj4)]
        if self.active != active_flags(data) {
            return false;
        }
        self.equals_arrays(data)
    }

    /// Copies the inputs of `data`, reusing memory.
    pub fn save(&mut self, data: &Data) {
        self.values.clear();
        self.save_arrays(data);
        #[cfg(mj4)]
        {
            self.active.clear();
            self.active.extend_from_slice(active_flags(data));
        }
    }

    /// Copies the inputs into `data`, whose model must have the same sizes. Another number of values panics.
    pub fn restore(&self, data: &mut Data) {
        self.restore_arrays(data, &self.values);
        #[cfg(mj4)]
        active_flags_mut(data).copy_from_slice(&self.active);
    }
}

impl SolvedState {
    /// Accelerations, joint forces of actuators and joint forces of constraints, each of shape (nv,), then the forces of
    /// actuators, for writing. `model` is the model of the saved data.
    pub fn parts_mut(&mut self, model: &Model) -> [&mut [f64]; 4] {
        let nv = model.nv();
        let (qacc, rest) = self.values.split_at_mut(nv);
        let (actuator, rest) = rest.split_at_mut(nv);
        let (constraint, rest) = rest.split_at_mut(nv);
        let forces = rest.len() - model.nsensordata();
        [qacc, actuator, constraint, &mut rest[..forces]]
    }

    /// All numbers.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Copies the results of `data`, reusing memory.
    pub fn save(&mut self, data: &Data) {
        self.values.clear();
        self.save_arrays(data);
    }

    /// Copies the results into `data`, whose model must have the same sizes; its buffers may be larger. Does nothing if
    /// no results were saved. Another number of values panics.
    pub fn restore(&self, data: &mut Data) {
        if !self.values.is_empty() {
            self.restore_arrays(data, &self.values);
        }
    }
}

/// Sets these `mjData` arrays to zero.
macro_rules! cleared_arrays {
    ($data:expr; $($array_mut:ident),* $(,)?) => {
        let (m, d) = ($data.model().raw(), $data.raw_mut());
        $(
            // SAFETY: model and data belong together and are alive; `data` is borrowed mutably.
            unsafe { arrays::$array_mut(m, d) }.fill(0.0);
        )*
    };
}

impl Data {
    /// Sets results of the last solve that [`SolvedState`] does not contain to zero: `efc_force` (and with it the
    /// [forces of contacts](Self::contact_force)), `cacc`, `cfrc_int`, `cfrc_ext`, `act_dot`, `qfrc_smooth`,
    /// `qacc_smooth` and `qfrc_inverse`. Data that several environments use in turn may have those of another one.
    ///
    /// The next step overwrites all of them before it reads them.
    pub fn clear_unsaved_results(&mut self) {
        cleared_arrays!(
            self;
            efc_force_mut,
            cacc_mut,
            cfrc_int_mut,
            cfrc_ext_mut,
            act_dot_mut,
            qfrc_smooth_mut,
            qacc_smooth_mut,
            qfrc_inverse_mut,
        );
    }
}

impl UnnormalizedQuats {
    /// Allocates storage for the quaternions that a forward pass over `model` normalizes; nothing to store on 4.x.
    pub fn new(model: &Model) -> Self {
        if cfg!(mj4) {
            return Self::default();
        }
        let mut quats = model.jnt_type().iter().zip(model.jnt_qposadr()).filter_map(|(&kind, &address)| {
            let offset = match kind as u32 {
                mujoco_sys::mjJNT_FREE => 3,
                mujoco_sys::mjJNT_BALL => 0,
                _ => return None,
            };
            Some(UnnormalizedQuat { address: address as usize + offset, ..UnnormalizedQuat::default() })
        });
        Self { first: quats.next(), others: quats.collect() }
    }

    fn iter(&self) -> impl Iterator<Item = &UnnormalizedQuat> {
        self.first.iter().chain(&self.others)
    }

    /// True if a forward pass normalizes no quaternion, so that there is nothing to store.
    pub fn is_empty(&self) -> bool {
        self.first.is_none()
    }

    /// Copies the quaternions of `data`. Call this before its forward pass.
    pub fn save(&mut self, data: &Data) {
        let qpos = data.qpos();
        for quat in self.first.iter_mut().chain(&mut self.others) {
            quat.value.copy_from_slice(&qpos[quat.address..quat.address + 4]);
        }
    }

    /// Copies the quaternions back into `data`, so that its forward pass can be repeated.
    pub fn restore(&self, data: &mut Data) {
        let qpos = data.qpos_mut();
        for quat in self.iter() {
            qpos[quat.address..quat.address + 4].copy_from_slice(&quat.value);
        }
    }
}

impl UserInputs {
    /// Numbers (controls, applied joint forces, applied body wrenches, mocap positions, mocap quaternions and user
    /// data, in this order), and the active flags of equality constraints (empty on 2.2.2).
    pub fn values(&self) -> (&[f64], &[bool]) {
        #[cfg(mj4)]
        let active = &self.active[..];
        #[cfg(not(mj4))]
        let active = &[];
        (&self.values, active)
    }

    /// True if these are the inputs that are stored in two parts, bit for bit.
    pub fn equals_parts(&self, joints: &JointInputs, bodies: &BodyInputs) -> bool {
        #[cfg(mj4)]
        if self.active != bodies.active {
            return false;
        }
        let parts = joints.values.iter().chain(&bodies.values).map(|x| x.to_bits());
        self.values.iter().map(|x| x.to_bits()).eq(parts)
    }

    /// Copies inputs that are stored in two parts.
    pub fn copy_parts(&mut self, joints: &JointInputs, bodies: &BodyInputs) {
        self.values.clear();
        self.values.extend(joints.values.iter().chain(&bodies.values));
        #[cfg(mj4)]
        self.active.clone_from(&bodies.active);
    }

    /// Creates inputs from the result of [`values`](Self::values).
    pub fn from_values(values: Vec<f64>, active: Vec<bool>) -> Self {
        #[cfg(not(mj4))]
        let _ = active;
        Self {
            values,
            #[cfg(mj4)]
            active,
        }
    }

    /// Copies the inputs of `data`, reusing memory.
    pub fn save(&mut self, data: &Data) {
        self.values.clear();
        self.save_arrays(data);
        #[cfg(mj4)]
        {
            self.active.clear();
            self.active.extend_from_slice(active_flags(data));
        }
    }

    /// True if `data` has the same inputs, bit for bit.
    pub fn matches(&self, data: &Data) -> bool {
        #[cfg(mj4)]
        if self.active != active_flags(data) {
            return false;
        }
        self.equals_arrays(data)
    }

    /// Copies the inputs into `data`, whose model must have the same sizes; its buffers may be larger. Another number of
    /// values, such as of inputs that were never saved, panics.
    pub fn restore(&self, data: &mut Data) {
        self.restore_arrays(data, &self.values);
        #[cfg(mj4)]
        active_flags_mut(data).copy_from_slice(&self.active);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate as mj;

    /// A state of a larger model was restored shifted in builds without debug assertions.
    #[test]
    #[should_panic(expected = "the state is of another model")]
    fn states_of_other_models() {
        let of = |joints: &str| {
            let body = format!(r#"<mujoco><worldbody><body>{joints}<geom size="0.1"/></body></worldbody></mujoco>"#);
            Data::new(&mj::compile(&body, &[]).expect("compiles").into_model()).expect("small")
        };
        let mut state = IntegrationState::default();
        state.save(&of(r#"<joint axis="1 0 0"/><joint axis="0 1 0"/>"#));
        state.restore(&mut of(r#"<joint axis="1 0 0"/>"#));
    }

    /// A forward pass changes no more than [`UnnormalizedQuats`] keeps, on 2.2.2 and on 4.x.
    #[test]
    fn raw_quaternions() {
        const JOINTS: &str = r#"<mujoco><worldbody>
            <body><joint type="slide"/><joint type="ball"/><geom size="0.1"/></body>
            <body pos="1 0 0"><freejoint/><geom size="0.1"/>
                <body pos="0.3 0 0"><joint type="ball"/><geom size="0.1"/></body></body>
            </worldbody></mujoco>"#;
        let model = mj::compile(JOINTS, &[]).expect("compiles").into_model();
        let mut data = Data::new(&model).expect("small");
        for (i, q) in data.qpos_mut().iter_mut().enumerate() {
            *q += 0.1 * (i + 1) as f64;
        }
        data.qvel_mut().fill(0.3);
        data.qacc_warmstart_mut().fill(0.7);
        let (mut before, mut after, mut raw) =
            (IntegrationState::EMPTY, IntegrationState::EMPTY, UnnormalizedQuats::new(&model));
        before.save(&data);
        raw.save(&data);
        data.step1().expect("fits");
        after.save(&data);
        assert_eq!(before == after, cfg!(mj4));
        after.undo_normalization(&raw);
        assert_eq!(before, after);
        raw.restore(&mut data);
        after.save(&data);
        assert_eq!(before, after);
    }
}
