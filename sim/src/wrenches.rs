//! Forces and torques that a user applies to the bodies of one environment, and gravity that is taken from them: they stay
//! until changed.
//!
//! MuJoCo applies `xfrc_applied` in the centre of mass of a body, in world axes. What is given in the axes of a link turns
//! with it, so it is written anew for every step. Gravity is compensated by the force `-m g` in the same place, on both
//! lines of MuJoCo: the model, which 4.x could tell to (`body_gravcomp`), is the same for all environments.

use crate::mjcf::scene_names::MAX_ROBOTS;
use kinetoscope_mujoco::Data;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// In whose axes a wrench is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WrenchFrame {
    /// Those of the environment: the direction stays when the link turns.
    #[default]
    World,
    /// Those of the link: the direction turns with it.
    Link,
}

/// A wrench on a body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wrench {
    /// Whose it is: robot and link.
    pub(crate) of: (usize, usize),
    /// MuJoCo's body.
    pub(crate) body: usize,
    /// The link's axes in the body, where the wrench is in those.
    pub(crate) axes: Option<UnitQuaternion<f64>>,
    /// Force in the centre of mass of the body \[N\].
    pub(crate) force: Vector3<f64>,
    /// Torque \[N m\].
    pub(crate) torque: Vector3<f64>,
}

/// Stands for the robot in [`Wrench::of`] where somebody pulls at a body.
const PULLED: usize = MAX_ROBOTS;

/// All that is applied in one environment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Wrenches {
    pub(crate) list: Vec<Wrench>,
    /// Bodies without weight.
    pub(crate) weightless: Vec<usize>,
}

impl Wrench {
    /// Force and torque in world axes, with the body where it is.
    pub(crate) fn in_world(&self, data: &Data) -> [Vector3<f64>; 2] {
        let Some(axes) = self.axes else { return [self.force, self.torque] };
        let q = &data.xquat()[4 * self.body..4 * self.body + 4];
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])) * axes;
        [turn * self.force, turn * self.torque]
    }
}

impl Wrenches {
    /// Replaces the wrench of the same owner; a wrench of zeros ends it.
    pub(crate) fn replace(&mut self, wrench: Wrench) {
        self.list.retain(|old| old.of != wrench.of);
        if wrench.force != Vector3::zeros() || wrench.torque != Vector3::zeros() {
            self.list.push(wrench);
        }
    }

    /// Pulls at a body, whatever else acts on it; nothing at all ends it.
    pub(crate) fn pull(&mut self, body: usize, mujoco_body: usize, force: Vector3<f64>, torque: Vector3<f64>) {
        self.replace(Wrench { of: (PULLED, body), body: mujoco_body, axes: None, force, torque });
    }

    /// Gives bodies their weight, or takes it.
    pub(crate) fn set_weightless(&mut self, bodies: &[usize], weightless: bool) {
        self.weightless.retain(|body| !bodies.contains(body));
        if weightless {
            self.weightless.extend(bodies);
        }
    }

    /// The same on another model, where `body` says which body is which. Nobody pulls any more: what is pulled at has another
    /// number there.
    pub(crate) fn moved(&self, body: impl Fn(usize) -> Option<usize>) -> Self {
        let moved = |wrench: &Wrench| Some(Wrench { body: body(wrench.body)?, ..wrench.clone() });
        Self {
            list: self.list.iter().filter(|wrench| wrench.of.0 != PULLED).filter_map(moved).collect(),
            weightless: self.weightless.iter().filter_map(|&old| body(old)).collect(),
        }
    }

    /// All of it as numbers: 14 of each wrench after their count, then the bodies without weight.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let mut numbers = vec![self.list.len() as f64];
        for Wrench { of, body, axes, force, torque } in &self.list {
            let q = axes.map_or([0.0; 4], |axes| [axes.w, axes.i, axes.j, axes.k]);
            numbers.extend([of.0 as f64, of.1 as f64, *body as f64, f64::from(axes.is_some())]);
            numbers.extend(q.iter().chain(force).chain(torque));
        }
        numbers.extend(self.weightless.iter().map(|&body| body as f64));
        numbers
    }

    /// What [`numbers`](Self::numbers) gave; `None` where they are no wrenches.
    pub(crate) fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (&count, rest) = numbers.split_first()?;
        let (list, weightless) = rest.split_at_checked((count as usize).checked_mul(14)?)?;
        let wrench = |&[robot, link, body, turned, w, i, j, k, fx, fy, fz, tx, ty, tz]: &[f64; 14]| Wrench {
            of: (robot as usize, link as usize),
            body: body as usize,
            axes: (turned > 0.0).then(|| UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k))),
            force: Vector3::new(fx, fy, fz),
            torque: Vector3::new(tx, ty, tz),
        };
        let list = list.as_chunks::<14>().0.iter().map(wrench).collect();
        Some(Self { list, weightless: weightless.iter().map(|&body| body as usize).collect() })
    }

    /// Writes what acts on the bodies that are named here; others keep what they have.
    pub(crate) fn apply(&self, data: &mut Data) {
        self.clear(data);
        for wrench in &self.list {
            let [force, torque] = wrench.in_world(data);
            add(data, wrench.body, &force, &torque);
        }
        let gravity = Vector3::from(data.model().gravity());
        for &body in &self.weightless {
            // What MuJoCo lifts by itself (4.x) is not lifted twice.
            let felt = 1.0 - data.model().body_gravity_compensation(body);
            let weight = felt * data.model().body_mass()[body] * gravity;
            add(data, body, &-weight, &Vector3::zeros());
        }
    }

    /// Nothing acts on the bodies that are named here.
    pub(crate) fn clear(&self, data: &mut Data) {
        for &body in self.list.iter().map(|wrench| &wrench.body).chain(&self.weightless) {
            data.xfrc_applied_mut()[6 * body..6 * body + 6].fill(0.0);
        }
    }
}

fn add(data: &mut Data, body: usize, force: &Vector3<f64>, torque: &Vector3<f64>) {
    let applied = &mut data.xfrc_applied_mut()[6 * body..6 * body + 6];
    applied.iter_mut().zip(force.iter().chain(torque)).for_each(|(to, value)| *to += value);
}
