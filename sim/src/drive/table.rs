//! Drives of a compiled model (joint, row or actuator), and their gains and targets in one environment.

use super::gain_overrides::GainOverrides;
use super::gains::{DriveSetting, Gains, Target};
use super::models::{ActuatorLaw, ActuatorModel, JointMotion};
use super::{DriveType, actuator, implicit};
use kinetoscope_mujoco as mj;
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// Realization of a drive in MuJoCo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Realization {
    /// Friction row of its degree of freedom: see [`DriveTable::rows`].
    ConstraintRow,
    /// MuJoCo actuator with the drive law.
    Actuator,
    /// MuJoCo actuator as a plain effort source; an explicit model computes its control.
    Explicit {
        /// Index among the explicit models.
        model: usize,
    },
}

/// One drive of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Address of the joint's position in `qpos`.
    pub qpos: usize,
    /// Address of the joint's velocity in `qvel`.
    pub dof: usize,
    /// Index of its control in `ctrl`. The control is the position target of a constraint row, the effort of an
    /// explicit model, or the control for which MuJoCo's actuator computes the drive law.
    pub ctrl: usize,
    /// Realization in MuJoCo.
    pub realization: Realization,
    /// Nominal gains in torque units and limits, with which every environment starts.
    pub initial: Gains,
    /// Drive type, stiffness and damping, in the unit of the drive type, that the gains are computed from.
    pub setting: DriveSetting,
    /// Nominal range of position targets \[rad or m\].
    pub range: [f64; 2],
}

/// All drives of a model, and the degrees of freedom with viscous damping that [`implicit`] applies instead of MuJoCo.
/// Shared by all environments.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DriveTable {
    /// The drives, in the order in which they were added.
    pub drives: Vec<Drive>,
    /// Explicit models of the drives that have one.
    pub models: Vec<ExplicitDrive>,
    /// Degrees of freedom with viscous damping moved from the model to [`implicit`], and the coefficient \[N m s/rad or
    /// N s/m\].
    pub damped: Vec<(usize, f64)>,
    /// Armature of each degree of freedom in `damped` without the share of the implicit damping \[kg m² or kg\].
    pub undamped_armature: Vec<f64>,
}

/// Explicit actuator model of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct ExplicitDrive {
    /// Index of the drive in [`DriveTable::drives`].
    pub drive: usize,
    /// Model that computes the effort of the drive.
    pub model: ActuatorModel,
    /// Range of the model's values in the memory of an environment.
    pub memory: Range<usize>,
}

impl DriveTable {
    /// Assigns an explicit model to a drive.
    pub(crate) fn push_model(&mut self, drive: usize, model: ActuatorModel) {
        let first = self.models.last().map_or(0, |last| last.memory.end);
        let memory = first..first + model.law().initial_memory().len();
        self.drives[drive].realization = Realization::Explicit { model: self.models.len() };
        self.models.push(ExplicitDrive { drive, model, memory });
    }

    /// Friction row of each drive in environments with this `dof_frictionloss`, counted among the friction rows of degrees
    /// of freedom; 0 for drives without a row. MuJoCo creates a row for each degree of freedom with friction, in their order.
    pub fn rows(&self, frictionloss: &[f64]) -> Vec<usize> {
        let before = |dof: usize| frictionloss[..dof].iter().filter(|friction| **friction > 0.0).count();
        let row = |drive: &Drive| if drive.realization == Realization::ConstraintRow { before(drive.dof) } else { 0 };
        self.drives.iter().map(row).collect()
    }

    /// Explicit model of a drive; `None` if MuJoCo computes the drive, as a constraint row or an actuator.
    pub(crate) fn model_of(&self, drive: usize) -> Option<&ExplicitDrive> {
        match self.drives[drive].realization {
            Realization::Explicit { model } => Some(&self.models[model]),
            Realization::ConstraintRow | Realization::Actuator => None,
        }
    }
}

/// Copy-on-write array shared by all environments. Most settings are never changed, so the shared copy stays in the
/// cache.
#[derive(Clone, Debug, PartialEq)]
pub struct CowArray<T>(Arc<[T]>);

impl<T> Deref for CowArray<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T: Clone> DerefMut for CowArray<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        Arc::make_mut(&mut self.0)
    }
}

impl<T> CowArray<T> {
    /// True if both share one array.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// True if the array has another owner.
    pub(crate) fn is_shared(&self) -> bool {
        Arc::strong_count(&self.0) > 1
    }
}

impl<T: Copy + PartialEq> CowArray<T> {
    /// Writes `value` if it differs, so that equal values keep the array shared.
    pub(super) fn set_if_changed(&mut self, index: usize, value: T) {
        if self[index] != value {
            self[index] = value;
        }
    }
}

impl CowArray<f64> {
    /// Sets all values, bit for bit; shares `common` if the values are equal.
    fn copy_or_share(&mut self, values: &[f64], common: &Self) {
        let same = |list: &[f64]| list.iter().map(|x| x.to_bits()).eq(values.iter().map(|x| x.to_bits()));
        if same(common) {
            self.clone_from(common);
        } else if !same(self) {
            self.0 = values.into();
        }
    }
}

/// Initial values of all environments.
#[derive(Debug, PartialEq)]
struct InitialDrives {
    table: Arc<DriveTable>,
    position: Box<[f64]>,
    /// Zero per drive.
    zero_targets: CowArray<f64>,
    /// Zero per degree of freedom.
    zero_forces: CowArray<f64>,
}

/// Targets and gains of the drives in one environment, and their last efforts.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveState {
    initial: Arc<InitialDrives>,
    /// Gains in torque units and limits that the drive law uses, overrides included; one per drive.
    pub gains: CowArray<Gains>,
    /// Drive type, stiffness and damping, in the unit of the drive type, that the gains are computed from; one per
    /// drive. Overrides are included.
    pub settings: CowArray<DriveSetting>,
    /// Overrides of gains, which are properties of the environment and not part of its state.
    pub(super) overrides: CowArray<GainOverrides>,
    /// Range of position targets \[rad or m\], one per drive.
    pub ranges: CowArray<[f64; 2]>,
    /// Position targets \[rad or m\], one per drive.
    pub position: Box<[f64]>,
    /// Velocity targets \[rad/s or m/s\], one per drive.
    pub velocity: CowArray<f64>,
    /// Feedforward efforts \[N m or N\], one per drive; they stay until changed or reset.
    pub feedforward: CowArray<f64>,
    /// Effort of each drive in the last successful MuJoCo step, after its limit \[N m or N\]; 0 after a reset.
    pub effort: Box<[f64]>,
    /// Generalized forces applied by the user, one per degree of freedom; they stay until changed or reset. Each step
    /// adds forces of the drives and of the implicit damping in `qfrc_applied`, not here.
    pub applied: CowArray<f64>,
    /// Memory of explicit models from step to step.
    pub memory: Box<[f64]>,
    /// Friction row of each drive; 0 for drives without a row. Dry friction of other joints shifts these indices.
    rows: CowArray<usize>,
    /// Coefficients of the damping inside the drive solve, in the order of [`DriveTable::damped`]. The model's armature
    /// holds the other half of this damping, so both change together.
    damping: CowArray<f64>,
}

impl DriveState {
    /// Creates drives whose targets are the model's initial positions (`qpos0`), at rest. Clones share all arrays that
    /// none of them has changed.
    pub fn new(table: &Arc<DriveTable>, model: &mj::Model) -> Self {
        let n = table.drives.len();
        let position: Box<[f64]> = table.drives.iter().map(|d| model.qpos0()[d.qpos]).collect();
        let zero_targets = CowArray(vec![0.0; n].into());
        let zero_forces = CowArray(vec![0.0; model.nv()].into());
        let mut state = Self {
            gains: CowArray(table.drives.iter().map(|d| d.initial).collect()),
            settings: CowArray(table.drives.iter().map(|d| d.setting).collect()),
            overrides: CowArray(vec![GainOverrides::default(); n].into()),
            ranges: CowArray(table.drives.iter().map(|d| d.range).collect()),
            position: position.clone(),
            velocity: zero_targets.clone(),
            feedforward: zero_targets.clone(),
            effort: vec![0.0; n].into(),
            applied: zero_forces.clone(),
            memory: table.models.iter().flat_map(|drive| drive.model.law().initial_memory()).collect(),
            rows: CowArray(table.rows(model.dof_frictionloss()).into()),
            damping: CowArray(table.damped.iter().map(|(_, damping)| *damping).collect()),
            initial: Arc::new(InitialDrives { table: Arc::clone(table), position, zero_targets, zero_forces }),
        };
        state.reset_memory();
        state
    }

    /// Prefetches the arrays that environments never share, without waiting for them.
    pub(crate) fn prefetch(&self) {
        mj::prefetch(&self.position);
        mj::prefetch(&self.effort);
        mj::prefetch(&self.memory);
    }

    /// Number of values that every environment has for itself.
    pub(crate) fn own_numbers(&self) -> usize {
        self.position.len() + self.effort.len() + self.memory.len()
    }

    /// Resets the memory of explicit models, with the current targets as those at the start.
    pub(crate) fn reset_memory(&mut self) {
        self.for_each_model(|law, target, memory| law.reset_memory(target, memory));
    }

    /// Position target, velocity target and feedforward effort of drive `drive` in this environment.
    pub(crate) fn target(&self, drive: usize) -> Target {
        let (position, velocity, feedforward) = (self.position[drive], self.velocity[drive], self.feedforward[drive]);
        Target { position, velocity, feedforward }
    }

    /// Calls `act` for each explicit model with the targets and the memory of its drive.
    fn for_each_model(&mut self, act: impl Fn(&dyn ActuatorLaw, &Target, &mut [f64])) {
        let mut memory = std::mem::take(&mut self.memory);
        for explicit in &self.initial.table.models {
            act(explicit.model.law(), &self.target(explicit.drive), &mut memory[explicit.memory.clone()]);
        }
        self.memory = memory;
    }

    /// Resets targets, efforts and applied forces to rest at the model's initial positions; gains, limits and ranges
    /// stay.
    pub(crate) fn reset(&mut self) {
        let initial = &*self.initial;
        self.position.copy_from_slice(&initial.position);
        self.velocity.clone_from(&initial.zero_targets);
        self.feedforward.clone_from(&initial.zero_targets);
        self.effort.fill(0.0);
        self.applied.clone_from(&initial.zero_forces);
    }

    /// Changes the user values of a drive. A gain is recomputed if its user value, the drive type or the inertia
    /// changed. Other gains, such as randomized ones, and limits stay.
    pub fn update_setting(&mut self, drive: usize, change: impl FnOnce(&mut DriveSetting)) {
        let (old, mut setting) = (self.settings[drive], self.settings[drive]);
        change(&mut setting);
        let mut gains = self.gains[drive];
        let (kp, kd) = setting.torque_gains().map_or((0.0, 0.0), |spec| (spec.kp, spec.kd));
        // A randomized gain is not the exact product of its user value, so a gain with an unchanged user value must
        // stay.
        let same_type = (setting.drive_type, setting.inertia) == (old.drive_type, old.inertia);
        if !same_type || setting.stiffness.to_bits() != old.stiffness.to_bits() {
            gains.kp = kp;
        }
        if !same_type || setting.damping.to_bits() != old.damping.to_bits() {
            gains.kd = kd;
        }
        self.settings.set_if_changed(drive, setting);
        self.gains.set_if_changed(drive, gains);
    }

    /// Changes the limits of a drive.
    pub(crate) fn set_limits(&mut self, drive: usize, change: impl FnOnce(Gains) -> Gains) {
        self.gains.set_if_changed(drive, change(self.gains[drive]));
    }

    /// Changes the range of position targets of a drive; the current target is clamped to the range.
    pub(crate) fn set_range(&mut self, drive: usize, [low, high]: [f64; 2]) {
        self.ranges.set_if_changed(drive, [low, high]);
        self.position[drive] = self.position[drive].clamp(low, high);
    }

    /// Copies gains with limits, settings, overrides, the range of targets, targets, effort and the memory of the
    /// explicit model from drive `from` of `other` to drive `to`.
    pub(crate) fn copy_from(&mut self, other: &Self, from: usize, to: usize) {
        self.gains.set_if_changed(to, other.gains[from]);
        self.settings.set_if_changed(to, other.settings[from]);
        self.overrides.set_if_changed(to, other.overrides[from]);
        self.ranges.set_if_changed(to, other.ranges[from]);
        self.position[to] = other.position[from];
        self.velocity.set_if_changed(to, other.velocity[from]);
        self.feedforward.set_if_changed(to, other.feedforward[from]);
        self.effort[to] = other.effort[from];
        if let (Some(mine), Some(theirs)) = (self.initial.table.model_of(to), other.initial.table.model_of(from)) {
            self.memory[mine.memory.clone()].copy_from_slice(&other.memory[theirs.memory.clone()]);
        }
    }

    /// Copies the applied force from degree of freedom `from` of `other` to degree of freedom `to`.
    pub(crate) fn copy_applied_from(&mut self, other: &Self, from: usize, to: usize) {
        self.applied.set_if_changed(to, other.applied[from]);
    }

    /// Sets the coefficients of the damping inside the drive solve.
    pub(crate) fn set_damping(&mut self, damping: &[f64]) {
        damping.iter().enumerate().for_each(|(index, value)| self.damping.set_if_changed(index, *value));
    }

    /// Coefficients of the damping inside the drive solve, in the order of [`DriveTable::damped`].
    pub(crate) fn damping(&self) -> &CowArray<f64> {
        &self.damping
    }

    /// True if these are the coefficients of the damping inside the drive solve, bit for bit.
    pub(crate) fn has_damping(&self, damping: &[f64]) -> bool {
        self.damping.iter().map(|x| x.to_bits()).eq(damping.iter().map(|x| x.to_bits()))
    }

    /// True if these are the friction rows.
    pub(crate) fn has_rows(&self, rows: &[usize]) -> bool {
        *self.rows == *rows
    }

    /// Sets the friction rows, as [`DriveTable::rows`] returns them.
    pub(crate) fn set_rows(&mut self, rows: &[usize]) {
        rows.iter().enumerate().for_each(|(index, row)| self.rows.set_if_changed(index, *row));
    }

    /// Flat array of the state, for [`set_from_flat`](Self::set_from_flat). It has ten numbers per drive (gains and
    /// limits, their user values, target range; without overrides), then targets (position, velocity, feedforward),
    /// efforts, applied forces, and the memory of explicit models.
    pub(crate) fn to_flat(&self) -> Vec<f64> {
        let settings = self.ranges.iter().enumerate().flat_map(|(drive, range)| {
            let (gains, setting) = self.base_gains(drive);
            let drive_type = DriveType::ALL.iter().position(|known| *known == setting.drive_type).unwrap_or(0) as f64;
            let DriveSetting { stiffness, damping, inertia, .. } = setting;
            let Gains { kp, kd, max_effort, max_velocity } = gains;
            // 0 stands for no inertia.
            let inertia = inertia.unwrap_or(0.0);
            [kp, kd, max_effort, max_velocity, drive_type, stiffness, damping, inertia, range[0], range[1]]
        });
        let targets =
            [&self.position[..], &self.velocity, &self.feedforward, &self.effort, &self.applied, &self.memory];
        settings.chain(targets.into_iter().flatten().copied()).collect()
    }

    /// Restores a flat array of [`to_flat`](Self::to_flat) with the same number of drives. Overrides of gains stay in
    /// effect.
    pub(crate) fn set_from_flat(&mut self, numbers: &[f64]) {
        let n = self.position.len();
        let (settings, rest) = numbers.split_at(10 * n);
        for (i, &numbers) in settings.as_chunks::<10>().0.iter().enumerate() {
            let [kp, kd, max_effort, max_velocity, drive_type, stiffness, damping, inertia, low, high] = numbers;
            let drive_type = DriveType::ALL.get(drive_type as usize).copied().unwrap_or_default();
            let inertia = Some(inertia).filter(|inertia| *inertia > 0.0);
            let setting = DriveSetting { drive_type, stiffness, damping, inertia };
            self.set_base_gains(i, Gains { kp, kd, max_effort, max_velocity }, setting);
            self.ranges.set_if_changed(i, [low, high]);
        }
        let (position, rest) = rest.split_at(n);
        let (velocity, rest) = rest.split_at(n);
        let (feedforward, rest) = rest.split_at(n);
        let (effort, rest) = rest.split_at(n);
        let (applied, memory) = rest.split_at(self.applied.len());
        let initial = Arc::clone(&self.initial);
        self.position.copy_from_slice(position);
        self.velocity.copy_or_share(velocity, &initial.zero_targets);
        self.feedforward.copy_or_share(feedforward, &initial.zero_targets);
        self.effort.copy_from_slice(effort);
        self.applied.copy_or_share(applied, &initial.zero_forces);
        self.memory.copy_from_slice(memory);
    }

    /// Drive table of the model.
    pub fn table(&self) -> &Arc<DriveTable> {
        &self.initial.table
    }

    /// Applies every drive to the next step; must run between `mj_step1` and `mj_step2`.
    pub fn apply(&self, data: &mut mj::Data) {
        let table = &*self.initial.table;
        data.qfrc_applied_mut().copy_from_slice(&self.applied);
        implicit::apply_damping(table, &self.damping, data);
        for (i, drive) in table.drives.iter().enumerate() {
            let target = self.target(i);
            match drive.realization {
                Realization::ConstraintRow => implicit::apply(drive, self.rows[i], &self.gains[i], &target, data),
                Realization::Actuator => actuator::apply(drive, &self.gains[i], &target, data),
                Realization::Explicit { model } => {
                    let ExplicitDrive { model, memory, .. } = &table.models[model];
                    let (position, velocity) = (data.qpos()[drive.qpos], data.qvel()[drive.dof]);
                    let now = JointMotion { position, velocity, range: self.ranges[i] };
                    let effort = model.law().effort(&now, &target, &self.gains[i], &self.memory[memory.clone()]);
                    data.ctrl_mut()[drive.ctrl] = effort;
                }
            }
        }
    }

    /// Stores the efforts of a successful step and updates the memory of explicit models.
    pub(crate) fn finish_step(&mut self, efforts: &[f64]) {
        self.effort.copy_from_slice(efforts);
        if !self.memory.is_empty() {
            self.for_each_model(|law, target, memory| law.update_memory(target, memory));
        }
    }

    /// Replaces the content of `efforts` with the efforts of all drives \[N m or N\], in the order of the drives. Must
    /// run after `mj_step2` and before the next `mj_step1`.
    pub fn read_efforts(&self, data: &mj::Data, efforts: &mut Vec<f64>) {
        efforts.clear();
        efforts.extend(self.table().drives.iter().enumerate().map(|(i, drive)| match drive.realization {
            Realization::ConstraintRow => implicit::effort(self.rows[i], &self.gains[i], self.feedforward[i], data),
            Realization::Actuator | Realization::Explicit { .. } => data.actuator_force()[drive.ctrl],
        }));
    }
}

/// Error in a flat array that [`DriveState::to_flat`] cannot have produced for this number of drives; `None` for a
/// valid one.
pub(crate) fn flat_error(numbers: &[f64], drives: usize) -> Option<&'static str> {
    let Some((settings, rest)) = numbers.split_at_checked(10 * drives) else {
        return Some("the array is too short for the drives");
    };
    for &[kp, kd, max_effort, max_velocity, drive_type, stiffness, damping, inertia, low, high] in
        settings.as_chunks::<10>().0
    {
        if [kp, kd, stiffness, damping, inertia].iter().any(|x| !x.is_finite() || *x < 0.0) {
            return Some("a gain is negative or not finite");
        }
        if ![max_effort, max_velocity].iter().all(|limit| *limit >= 0.0) {
            return Some("a limit of a drive is negative or not a number");
        }
        if !(0..DriveType::ALL.len()).any(|known| known as f64 == drive_type) {
            return Some("a drive type is unknown");
        }
        if low.is_nan() || high.is_nan() || low > high {
            return Some("a target range is empty or not a number");
        }
    }
    rest.iter().any(|x| !x.is_finite()).then_some("a target, an effort or an applied force is not finite")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn environments_are_separate() {
        let model = mj::compile(
            r#"<mujoco><worldbody><body><joint type="hinge" ref="0.5"/><geom size="0.1"/></body></worldbody></mujoco>"#,
            &[],
        )
        .expect("compiles")
        .into_model();
        let initial = Gains { kp: 3.0, kd: 1.0, max_effort: f64::INFINITY, max_velocity: f64::INFINITY };
        let setting = DriveSetting { drive_type: DriveType::Force, stiffness: 3.0, damping: 1.0, inertia: None };
        let (realization, range) = (Realization::Actuator, [-1.0, 1.0]);
        let drive = Drive { qpos: 0, dof: 0, ctrl: 0, realization, initial, setting, range };
        let fresh = DriveState::new(&Arc::new(DriveTable { drives: vec![drive], ..Default::default() }), &model);
        let (mut changed, other) = (fresh.clone(), fresh.clone());
        assert!(std::ptr::eq(&*changed.velocity, &*other.velocity));
        changed.position[0] = 0.1;
        changed.velocity[0] = 0.2;
        changed.feedforward[0] = 0.3;
        changed.applied[0] = 0.4;
        changed.effort[0] = 0.5;
        changed.set_range(0, [0.2, 0.7]);
        assert_eq!((changed.position[0], other.ranges[0]), (0.2, range), "the target is inside of its range");
        assert_eq!(other, fresh);
        let mut copy = other.clone();
        copy.copy_from(&changed, 0, 0);
        copy.copy_applied_from(&changed, 0, 0);
        assert_eq!(copy, changed);
        let mut copy = other.clone();
        copy.set_from_flat(&changed.to_flat());
        assert_eq!(copy, changed);
        copy.set_from_flat(&other.to_flat());
        assert!(std::ptr::eq(&*copy.velocity, &*other.velocity) && copy == other, "shared again");
        copy.set_from_flat(&other.to_flat().iter().map(|x| if *x == 0.0 { -0.0 } else { *x }).collect::<Vec<_>>());
        assert!(copy.feedforward[0].is_sign_negative() && copy.applied[0].is_sign_negative(), "to the last bit");
        changed.update_setting(0, |setting| setting.stiffness = 7.0);
        changed.reset();
        assert_eq!((changed.gains[0].kp, other.gains[0].kp), (7.0, 3.0), "gains stay");
        assert_eq!((changed.gains[0].kd, changed.ranges[0]), (1.0, [0.2, 0.7]), "limits stay");
        changed.update_setting(0, |setting| setting.stiffness = 3.0);
        changed.set_range(0, range);
        assert_eq!(changed, fresh);
        assert!(std::ptr::eq(&*changed.velocity, &*other.velocity), "shared again");
    }

    #[test]
    fn equal_values_stay_shared() {
        let mut list = CowArray(Arc::from([1.0, 2.0]));
        let same = list.clone();
        list.set_if_changed(1, 2.0);
        assert!(std::ptr::eq(&*list, &*same));
        list.set_if_changed(1, 3.0);
        assert_eq!((&*list, &*same), (&[1.0, 3.0][..], &[1.0, 2.0][..]));
    }
}
