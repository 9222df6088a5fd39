//! The drives of a compiled model: which joint, which row or actuator; and their targets in one environment.

use super::{actuator, implicit};
use crate::mj;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// How one drive acts in MuJoCo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Realization {
    /// A friction row: its index among the friction rows (degrees of freedom first, in order).
    Row {
        /// Index among the friction rows.
        row: usize,
    },
    /// MuJoCo's actuator.
    Actuator,
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
    /// The gains and limit the model starts with.
    pub initial: Gains,
}

/// Gains and effort limit of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Proportional gain \[N m/rad or N/m\].
    pub kp: f64,
    /// Derivative gain \[N m s/rad or N s/m\].
    pub kd: f64,
    /// Largest effort \[N m or N\]; infinite where there is no limit.
    pub max_effort: f64,
}

/// All drives of a model, and the joints whose damping is integrated with them. Shared by all environments.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DriveTable {
    /// The drives, in the order in which they were added.
    pub drives: Vec<Drive>,
    /// Degrees of freedom whose viscous damping moved from the model to [`implicit`], with its coefficient.
    pub damped: Vec<(usize, f64)>,
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
    fn put(&mut self, index: usize, value: T) {
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
        Self {
            gains: Shared(table.drives.iter().map(|d| d.initial).collect()),
            position: position.clone(),
            velocity: no_targets.clone(),
            feedforward: no_targets.clone(),
            effort: vec![0.0; n].into(),
            applied: no_forces.clone(),
            damping: Shared(table.damped.iter().map(|(_, damping)| *damping).collect()),
            initial: Arc::new(Initial { table: Arc::clone(table), position, no_targets, no_forces }),
        }
    }

    /// Back to rest at the model's initial positions; gains stay.
    pub(crate) fn reset(&mut self) {
        let initial = &*self.initial;
        self.position.copy_from_slice(&initial.position);
        self.velocity.clone_from(&initial.no_targets);
        self.feedforward.clone_from(&initial.no_targets);
        self.effort.fill(0.0);
        self.applied.clone_from(&initial.no_forces);
    }

    /// Takes gains, targets and effort of drive `from` of `other` for drive `to`.
    pub(crate) fn copy_from(&mut self, other: &Self, from: usize, to: usize) {
        self.gains.put(to, other.gains[from]);
        self.position[to] = other.position[from];
        self.velocity.put(to, other.velocity[from]);
        self.feedforward.put(to, other.feedforward[from]);
        self.effort[to] = other.effort[from];
    }

    /// Takes the force applied to degree of freedom `from` of `other` for degree of freedom `to`.
    pub(crate) fn copy_applied_from(&mut self, other: &Self, from: usize, to: usize) {
        self.applied.put(to, other.applied[from]);
    }

    /// Sets the gains of a drive.
    pub(crate) fn set_gains(&mut self, drive: usize, gains: Gains) {
        self.gains.put(drive, gains);
    }

    /// Sets coefficients of the damping that is integrated with the drives.
    pub(crate) fn set_damping(&mut self, damping: &[f64]) {
        damping.iter().enumerate().for_each(|(index, value)| self.damping.put(index, *value));
    }

    /// What [`restoring`](Self::set_numbers) a state brings back: three gains of each drive, its targets (position, velocity,
    /// feed-forward) and its effort, then the applied forces.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let gains = self.gains.iter().flat_map(|g| [g.kp, g.kd, g.max_effort]);
        let targets = [&self.position[..], &self.velocity, &self.feedforward, &self.effort, &self.applied];
        gains.chain(targets.into_iter().flatten().copied()).collect()
    }

    /// Takes what [`numbers`](Self::numbers) gave, of drives of the same number.
    pub(crate) fn set_numbers(&mut self, numbers: &[f64]) {
        let n = self.position.len();
        let (gains, rest) = numbers.split_at(3 * n);
        for (i, &[kp, kd, max_effort]) in gains.as_chunks::<3>().0.iter().enumerate() {
            self.gains.put(i, Gains { kp, kd, max_effort });
        }
        let (position, rest) = rest.split_at(n);
        let (velocity, rest) = rest.split_at(n);
        let (feedforward, rest) = rest.split_at(n);
        let (effort, applied) = rest.split_at(n);
        let initial = Arc::clone(&self.initial);
        self.position.copy_from_slice(position);
        self.velocity.take(velocity, &initial.no_targets);
        self.feedforward.take(feedforward, &initial.no_targets);
        self.effort.copy_from_slice(effort);
        self.applied.take(applied, &initial.no_forces);
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
            let target =
                Target { position: self.position[i], velocity: self.velocity[i], feedforward: self.feedforward[i] };
            match drive.realization {
                Realization::Row { row } => implicit::apply(drive, row, &self.gains[i], &target, data),
                Realization::Actuator => actuator::apply(drive, &self.gains[i], &target, data),
            }
        }
    }

    /// After `mj_step2`: the effort every drive gave.
    pub fn read_efforts(&self, data: &mj::Data, efforts: &mut Vec<f64>) {
        efforts.clear();
        efforts.extend(self.table().drives.iter().enumerate().map(|(i, drive)| match drive.realization {
            Realization::Row { row } => implicit::effort(row, &self.gains[i], self.feedforward[i], data),
            Realization::Actuator => data.actuator_force()[drive.ctrl],
        }));
    }
}

/// What one drive is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Position target \[rad or m\].
    pub position: f64,
    /// Velocity target \[rad/s or m/s\].
    pub velocity: f64,
    /// Feed-forward effort \[N m or N\].
    pub feedforward: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_environment_is_told_the_others_do_not_hear() {
        let model = mj::compile(
            r#"<mujoco><worldbody><body><joint type="hinge" ref="0.5"/><geom size="0.1"/></body></worldbody></mujoco>"#,
            &[],
        )
        .expect("compiles")
        .into_model();
        let initial = Gains { kp: 3.0, kd: 1.0, max_effort: f64::INFINITY };
        let drive = Drive { qpos: 0, dof: 0, ctrl: 0, realization: Realization::Actuator, initial };
        let fresh = DriveState::new(&Arc::new(DriveTable { drives: vec![drive], damped: Vec::new() }), &model);
        let (mut told, other) = (fresh.clone(), fresh.clone());
        assert!(std::ptr::eq(&*told.velocity, &*other.velocity));
        told.position[0] = 0.1;
        told.velocity[0] = 0.2;
        told.feedforward[0] = 0.3;
        told.applied[0] = 0.4;
        told.effort[0] = 0.5;
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
        told.gains[0].kp = 7.0;
        told.reset();
        assert_eq!((told.gains[0].kp, other.gains[0].kp), (7.0, 3.0), "gains stay");
        told.gains[0] = initial;
        assert_eq!(told, fresh);
        assert!(std::ptr::eq(&*told.velocity, &*other.velocity), "shared again");
    }

    #[test]
    fn taking_over_what_is_the_same_shares_it_still() {
        let mut list = Shared(Arc::from([1.0, 2.0]));
        let same = list.clone();
        list.put(1, 2.0);
        assert!(std::ptr::eq(&*list, &*same));
        list.put(1, 3.0);
        assert_eq!((&*list, &*same), (&[1.0, 3.0][..], &[1.0, 2.0][..]));
    }
}
