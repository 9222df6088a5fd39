//! The drives of a compiled model: which joint, which row or actuator; and their targets in one environment.

use super::drawn::DrawnGains;
use super::gains::{Gains, Setting, Target};
use super::models::{ActuatorLaw, ActuatorModel, JointMotion};
use super::{DriveType, actuator, implicit};
use kinetoscope_mujoco as mj;
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// How one drive acts in MuJoCo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Realization {
    /// The friction row of its degree of freedom: see [`DriveTable::rows`].
    Row,
    /// MuJoCo's actuator.
    Actuator,
    /// MuJoCo's actuator as a plain source of effort, whose control an explicit model computes.
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
    /// Index of the control input that holds the target.
    pub ctrl: usize,
    /// How it acts.
    pub realization: Realization,
    /// The gains and limits the model starts with.
    pub initial: Gains,
    /// Where the gains come from.
    pub setting: Setting,
    /// Positions a target may have \[rad or m\].
    pub range: [f64; 2],
}

/// All drives of a model, and the joints whose damping is integrated with them. Shared by all environments.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DriveTable {
    /// The drives, in the order in which they were added.
    pub drives: Vec<Drive>,
    /// Explicit models of those drives that have one.
    pub models: Vec<DriveActuator>,
    /// Degrees of freedom whose viscous damping moved from the model to [`implicit`], with its coefficient.
    pub damped: Vec<(usize, f64)>,
    /// Of each of them, the armature without what implicit damping adds to it \[kg m² or kg\].
    pub undamped_armature: Vec<f64>,
}

/// The explicit model of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveActuator {
    /// The drive.
    pub drive: usize,
    /// Its model.
    pub model: ActuatorModel,
    /// Where in the memory of an environment the model keeps what it needs.
    pub memory: Range<usize>,
}

impl DriveTable {
    /// Gives a drive an explicit model.
    pub(crate) fn push_model(&mut self, drive: usize, model: ActuatorModel) {
        let first = self.models.last().map_or(0, |last| last.memory.end);
        let memory = first..first + model.law().memory().len();
        self.drives[drive].realization = Realization::Explicit { model: self.models.len() };
        self.models.push(DriveActuator { drive, model, memory });
    }

    /// The friction row of each drive that is one, in environments of `model`, counted among the rows of degrees of freedom;
    /// 0 for others. MuJoCo makes a row for each degree of freedom with friction, in their order.
    pub fn rows(&self, model: &mj::Model) -> Vec<usize> {
        let before = |dof: usize| model.dof_frictionloss()[..dof].iter().filter(|friction| **friction > 0.0).count();
        let row = |drive: &Drive| if drive.realization == Realization::Row { before(drive.dof) } else { 0 };
        self.drives.iter().map(row).collect()
    }

    /// The explicit model of a drive.
    pub(crate) fn model_of(&self, drive: usize) -> Option<&DriveActuator> {
        match self.drives[drive].realization {
            Realization::Explicit { model } => Some(&self.models[model]),
            Realization::Row | Realization::Actuator => None,
        }
    }
}

/// A list that environments share until one writes to its own. Nobody sets most of what a drive can be told, and memory
/// of which there is one for all stays in the cache.
#[derive(Clone, Debug, PartialEq)]
pub struct Shared<T>(Arc<[T]>);

impl<T> Deref for Shared<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T: Clone> DerefMut for Shared<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        Arc::make_mut(&mut self.0)
    }
}

impl<T: Copy + PartialEq> Shared<T> {
    /// Writes where that changes something.
    pub(super) fn put(&mut self, index: usize, value: T) {
        if self[index] != value {
            self[index] = value;
        }
    }
}

impl Shared<f64> {
    /// Takes these values, bit by bit; shares `common` where they are those.
    fn take(&mut self, values: &[f64], common: &Self) {
        let same = |list: &[f64]| list.iter().map(|x| x.to_bits()).eq(values.iter().map(|x| x.to_bits()));
        if same(common) {
            self.clone_from(common);
        } else if !same(self) {
            self.0 = values.into();
        }
    }
}

/// What environments start with.
#[derive(Debug, PartialEq)]
struct Initial {
    table: Arc<DriveTable>,
    position: Box<[f64]>,
    /// One zero per drive.
    no_targets: Shared<f64>,
    /// One zero per degree of freedom.
    no_forces: Shared<f64>,
}

/// Targets and gains of the drives in one environment, and the effort they last gave.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveState {
    initial: Arc<Initial>,
    /// Gains, one per drive.
    pub gains: Shared<Gains>,
    /// What the gains were made of, one per drive.
    pub settings: Shared<Setting>,
    /// Which of the gains are properties of the environment, not of its state.
    pub(super) drawn: Shared<DrawnGains>,
    /// Positions a target may have \[rad or m\], one range per drive.
    pub ranges: Shared<[f64; 2]>,
    /// Position targets \[rad or m\].
    pub position: Box<[f64]>,
    /// Velocity targets \[rad/s or m/s\].
    pub velocity: Shared<f64>,
    /// Feed-forward efforts \[N m or N\]; they stay until changed.
    pub feedforward: Shared<f64>,
    /// Effort each drive gave in the last step \[N m or N\].
    pub effort: Box<[f64]>,
    /// Generalised forces that a user applies, by degree of freedom; the implicit damping adds to them.
    pub applied: Shared<f64>,
    /// What explicit models keep from step to step.
    pub memory: Box<[f64]>,
    /// The friction row of each drive that is one, which the dry friction of other joints moves; 0 for others.
    rows: Shared<usize>,
    /// Coefficients of the damping that is integrated with the drives, as [`DriveTable::damped`] lists them. The armature of
    /// the model holds the other half of it: they change together.
    damping: Shared<f64>,
}

impl DriveState {
    /// Drives at rest at the model's initial positions. Clones share what none of them has changed.
    pub fn new(table: &Arc<DriveTable>, model: &mj::Model) -> Self {
        let n = table.drives.len();
        let position: Box<[f64]> = table.drives.iter().map(|d| model.qpos0()[d.qpos]).collect();
        let no_targets = Shared(vec![0.0; n].into());
        let no_forces = Shared(vec![0.0; model.nv()].into());
        let mut state = Self {
            gains: Shared(table.drives.iter().map(|d| d.initial).collect()),
            settings: Shared(table.drives.iter().map(|d| d.setting).collect()),
            drawn: Shared(vec![DrawnGains::default(); n].into()),
            ranges: Shared(table.drives.iter().map(|d| d.range).collect()),
            position: position.clone(),
            velocity: no_targets.clone(),
            feedforward: no_targets.clone(),
            effort: vec![0.0; n].into(),
            applied: no_forces.clone(),
            memory: table.models.iter().flat_map(|drive| drive.model.law().memory()).collect(),
            rows: Shared(table.rows(model).into()),
            damping: Shared(table.damped.iter().map(|(_, damping)| *damping).collect()),
            initial: Arc::new(Initial { table: Arc::clone(table), position, no_targets, no_forces }),
        };
        state.start();
        state
    }

    /// Asks for the memory that is this environment's own, and waits for nothing.
    pub(crate) fn prefetch(&self) {
        mj::prefetch(&self.position);
        mj::prefetch(&self.effort);
        mj::prefetch(&self.memory);
    }

    /// Explicit models forget what was: the present targets are those at the start.
    pub(crate) fn start(&mut self) {
        self.each_memory(|law, target, memory| law.start(target, memory));
    }

    /// What a drive is asked for.
    fn target(&self, drive: usize) -> Target {
        let (position, velocity, feedforward) = (self.position[drive], self.velocity[drive], self.feedforward[drive]);
        Target { position, velocity, feedforward }
    }

    /// Each explicit model with what its drive is asked for and what it keeps.
    fn each_memory(&mut self, act: impl Fn(&dyn ActuatorLaw, &Target, &mut [f64])) {
        let mut memory = std::mem::take(&mut self.memory);
        for explicit in &self.initial.table.models {
            act(explicit.model.law(), &self.target(explicit.drive), &mut memory[explicit.memory.clone()]);
        }
        self.memory = memory;
    }

    /// Back to rest at the model's initial positions; gains and limits stay.
    pub(crate) fn reset(&mut self) {
        let initial = &*self.initial;
        self.position.copy_from_slice(&initial.position);
        self.velocity.clone_from(&initial.no_targets);
        self.feedforward.clone_from(&initial.no_targets);
        self.effort.fill(0.0);
        self.applied.clone_from(&initial.no_forces);
    }

    /// Changes what is asked of a drive, and with it its gains; limits stay.
    pub fn set(&mut self, drive: usize, change: impl FnOnce(&mut Setting)) {
        let (old, mut setting) = (self.settings[drive], self.settings[drive]);
        change(&mut setting);
        let mut gains = self.gains[drive];
        let (kp, kd) = setting.actuator().map_or((0.0, 0.0), |spec| (spec.kp, spec.kd));
        // A gain that was drawn is not the product of its setting to the last bit: what was not changed stays.
        let same_type = (setting.drive_type, setting.inertia) == (old.drive_type, old.inertia);
        if !same_type || setting.stiffness.to_bits() != old.stiffness.to_bits() {
            gains.kp = kp;
        }
        if !same_type || setting.damping.to_bits() != old.damping.to_bits() {
            gains.kd = kd;
        }
        self.settings.put(drive, setting);
        self.gains.put(drive, gains);
    }

    /// Changes the limits of a drive.
    pub(crate) fn set_limits(&mut self, drive: usize, change: impl FnOnce(Gains) -> Gains) {
        self.gains.put(drive, change(self.gains[drive]));
    }

    /// Changes the positions that targets of a drive may have; the present target is clamped to them.
    pub(crate) fn set_range(&mut self, drive: usize, [low, high]: [f64; 2]) {
        self.ranges.put(drive, [low, high]);
        self.position[drive] = self.position[drive].clamp(low, high);
    }

    /// Takes gains, limits, targets and effort of drive `from` of `other` for drive `to`.
    pub(crate) fn copy_from(&mut self, other: &Self, from: usize, to: usize) {
        self.gains.put(to, other.gains[from]);
        self.settings.put(to, other.settings[from]);
        self.drawn.put(to, other.drawn[from]);
        self.ranges.put(to, other.ranges[from]);
        self.position[to] = other.position[from];
        self.velocity.put(to, other.velocity[from]);
        self.feedforward.put(to, other.feedforward[from]);
        self.effort[to] = other.effort[from];
        if let (Some(mine), Some(theirs)) = (self.initial.table.model_of(to), other.initial.table.model_of(from)) {
            self.memory[mine.memory.clone()].copy_from_slice(&other.memory[theirs.memory.clone()]);
        }
    }

    /// Takes the force applied to degree of freedom `from` of `other` for degree of freedom `to`.
    pub(crate) fn copy_applied_from(&mut self, other: &Self, from: usize, to: usize) {
        self.applied.put(to, other.applied[from]);
    }

    /// Sets coefficients of the damping that is integrated with the drives.
    pub(crate) fn set_damping(&mut self, damping: &[f64]) {
        damping.iter().enumerate().for_each(|(index, value)| self.damping.put(index, *value));
    }

    /// Takes the friction rows of a model, as [`DriveTable::rows`] gives them.
    pub(crate) fn set_rows(&mut self, rows: &[usize]) {
        rows.iter().enumerate().for_each(|(index, row)| self.rows.put(index, *row));
    }

    /// What [`restoring`](Self::set_numbers) a state brings back: ten numbers of each drive (gains and limits, what they
    /// were made of, range; without what is drawn), its targets (position, velocity, feed-forward) and its effort, then the applied forces and what
    /// explicit models keep.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let settings = self.ranges.iter().enumerate().flat_map(|(drive, range)| {
            let (gains, setting) = self.without_drawn(drive);
            let drive_type = DriveType::ALL.iter().position(|known| *known == setting.drive_type).unwrap_or(0) as f64;
            let Setting { stiffness, damping, inertia, .. } = setting;
            let Gains { kp, kd, max_effort, max_velocity } = gains;
            // No inertia is 0.
            let inertia = inertia.unwrap_or(0.0);
            [kp, kd, max_effort, max_velocity, drive_type, stiffness, damping, inertia, range[0], range[1]]
        });
        let targets =
            [&self.position[..], &self.velocity, &self.feedforward, &self.effort, &self.applied, &self.memory];
        settings.chain(targets.into_iter().flatten().copied()).collect()
    }

    /// Takes what [`numbers`](Self::numbers) gave, of drives of the same number. Gains that are drawn here stay.
    pub(crate) fn set_numbers(&mut self, numbers: &[f64]) {
        let n = self.position.len();
        let (settings, rest) = numbers.split_at(10 * n);
        for (i, &numbers) in settings.as_chunks::<10>().0.iter().enumerate() {
            let [kp, kd, max_effort, max_velocity, drive_type, stiffness, damping, inertia, low, high] = numbers;
            let drive_type = DriveType::ALL.get(drive_type as usize).copied().unwrap_or_default();
            let inertia = Some(inertia).filter(|inertia| *inertia > 0.0);
            let setting = Setting { drive_type, stiffness, damping, inertia };
            self.set_below_drawn(i, Gains { kp, kd, max_effort, max_velocity }, setting);
            self.ranges.put(i, [low, high]);
        }
        let (position, rest) = rest.split_at(n);
        let (velocity, rest) = rest.split_at(n);
        let (feedforward, rest) = rest.split_at(n);
        let (effort, rest) = rest.split_at(n);
        let (applied, memory) = rest.split_at(self.applied.len());
        let initial = Arc::clone(&self.initial);
        self.position.copy_from_slice(position);
        self.velocity.take(velocity, &initial.no_targets);
        self.feedforward.take(feedforward, &initial.no_targets);
        self.effort.copy_from_slice(effort);
        self.applied.take(applied, &initial.no_forces);
        self.memory.copy_from_slice(memory);
    }

    /// The model's drives.
    pub fn table(&self) -> &Arc<DriveTable> {
        &self.initial.table
    }

    /// Between `mj_step1` and `mj_step2`: makes every drive act on this step.
    pub fn apply(&self, data: &mut mj::Data) {
        let table = &*self.initial.table;
        data.qfrc_applied_mut().copy_from_slice(&self.applied);
        implicit::apply_damping(table, &self.damping, data);
        for (i, drive) in table.drives.iter().enumerate() {
            let target = self.target(i);
            match drive.realization {
                Realization::Row => implicit::apply(drive, self.rows[i], &self.gains[i], &target, data),
                Realization::Actuator => actuator::apply(drive, &self.gains[i], &target, data),
                Realization::Explicit { model } => {
                    let DriveActuator { model, memory, .. } = &table.models[model];
                    let (position, velocity) = (data.qpos()[drive.qpos], data.qvel()[drive.dof]);
                    let now = JointMotion { position, velocity, range: self.ranges[i] };
                    let effort = model.law().effort(&now, &target, &self.gains[i], &self.memory[memory.clone()]);
                    data.ctrl_mut()[drive.ctrl] = effort;
                }
            }
        }
    }

    /// After a step that stays: the efforts the drives gave in it, and what models keep of it.
    pub(crate) fn finish_step(&mut self, efforts: &[f64]) {
        self.effort.copy_from_slice(efforts);
        if !self.memory.is_empty() {
            self.each_memory(|law, target, memory| law.remember(target, memory));
        }
    }

    /// After `mj_step2`: the effort every drive gave.
    pub fn read_efforts(&self, data: &mj::Data, efforts: &mut Vec<f64>) {
        efforts.clear();
        efforts.extend(self.table().drives.iter().enumerate().map(|(i, drive)| match drive.realization {
            Realization::Row => implicit::effort(self.rows[i], &self.gains[i], self.feedforward[i], data),
            Realization::Actuator | Realization::Explicit { .. } => data.actuator_force()[drive.ctrl],
        }));
    }
}

/// What [`DriveState::numbers`] cannot have given of so many drives.
pub(crate) fn numbers_fault(numbers: &[f64], drives: usize) -> Option<&'static str> {
    let Some((settings, rest)) = numbers.split_at_checked(10 * drives) else {
        return Some("drives have fewer numbers than they need");
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
            return Some("a range of targets is none");
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
        let setting = Setting { drive_type: DriveType::Force, stiffness: 3.0, damping: 1.0, inertia: None };
        let (realization, range) = (Realization::Actuator, [-1.0, 1.0]);
        let drive = Drive { qpos: 0, dof: 0, ctrl: 0, realization, initial, setting, range };
        let fresh = DriveState::new(&Arc::new(DriveTable { drives: vec![drive], ..Default::default() }), &model);
        let (mut told, other) = (fresh.clone(), fresh.clone());
        assert!(std::ptr::eq(&*told.velocity, &*other.velocity));
        told.position[0] = 0.1;
        told.velocity[0] = 0.2;
        told.feedforward[0] = 0.3;
        told.applied[0] = 0.4;
        told.effort[0] = 0.5;
        told.set_range(0, [0.2, 0.7]);
        assert_eq!((told.position[0], other.ranges[0]), (0.2, range), "the target is inside of its range");
        assert_eq!(other, fresh);
        let mut copy = other.clone();
        copy.copy_from(&told, 0, 0);
        copy.copy_applied_from(&told, 0, 0);
        assert_eq!(copy, told);
        let mut copy = other.clone();
        copy.set_numbers(&told.numbers());
        assert_eq!(copy, told);
        copy.set_numbers(&other.numbers());
        assert!(std::ptr::eq(&*copy.velocity, &*other.velocity) && copy == other, "shared again");
        copy.set_numbers(&other.numbers().iter().map(|x| if *x == 0.0 { -0.0 } else { *x }).collect::<Vec<_>>());
        assert!(copy.feedforward[0].is_sign_negative() && copy.applied[0].is_sign_negative(), "to the last bit");
        told.set(0, |setting| setting.stiffness = 7.0);
        told.reset();
        assert_eq!((told.gains[0].kp, other.gains[0].kp), (7.0, 3.0), "gains stay");
        assert_eq!((told.gains[0].kd, told.ranges[0]), (1.0, [0.2, 0.7]), "limits stay");
        told.set(0, |setting| setting.stiffness = 3.0);
        told.set_range(0, range);
        assert_eq!(told, fresh);
        assert!(std::ptr::eq(&*told.velocity, &*other.velocity), "shared again");
    }

    #[test]
    fn equal_values_stay_shared() {
        let mut list = Shared(Arc::from([1.0, 2.0]));
        let same = list.clone();
        list.put(1, 2.0);
        assert!(std::ptr::eq(&*list, &*same));
        list.put(1, 3.0);
        assert_eq!((&*list, &*same), (&[1.0, 3.0][..], &[1.0, 2.0][..]));
    }
}
