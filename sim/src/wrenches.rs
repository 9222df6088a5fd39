//! External forces and torques on the bodies of one environment, and gravity compensation. Forces and torques stay
//! until changed or until the environment is reset; gravity compensation stays until changed.
//!
//! MuJoCo applies `xfrc_applied` at the center of mass of a body, in world axes. A wrench in link axes turns with the
//! link, so it is rewritten in every step. Gravity compensation is the force `-m g` at the center of mass, on both
//! supported MuJoCo versions. `body_gravcomp` of 4.x is part of the model that all environments share, so it cannot
//! differ per environment.

use crate::body_pose::BodyArrays;
use crate::mjcf::scene_names::MAX_ROBOTS;
use kinetoscope_mujoco::Data;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Axes in which a wrench is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WrenchFrame {
    /// Axes of the environment: the direction stays constant when the link turns.
    #[default]
    World,
    /// Axes of the link: the direction turns with the link.
    Link,
}

/// External wrench on a body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wrench {
    /// Owner of the wrench: index of the robot among robots and articulations, and index of the link in the robot. For
    /// objects, a number above that of any robot, and the index of the object. For user forces, [`USER_FORCE_OWNER`]
    /// and the index of the body on the body axis.
    pub(crate) owner: (usize, usize),
    /// Index of the body in the model (MuJoCo's body id).
    pub(crate) body: usize,
    /// Rotation of the link axes in the body frame; `None` for a wrench in world axes.
    pub(crate) axes: Option<UnitQuaternion<f64>>,
    /// Force at the center of mass of the body \[N\], in link axes or world axes as given by `axes`.
    pub(crate) force: Vector3<f64>,
    /// Torque \[N m\], in the same axes.
    pub(crate) torque: Vector3<f64>,
}

/// Stands for the robot in [`Wrench::owner`] for forces of
/// [`SceneViewMut::set_point_forces`](crate::SceneViewMut::set_point_forces).
const USER_FORCE_OWNER: usize = MAX_ROBOTS;

/// All external wrenches and gravity-compensated bodies of one environment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Wrenches {
    pub(crate) list: Vec<Wrench>,
    /// Bodies with compensated gravity: indices in the model.
    pub(crate) gravity_compensated: Vec<usize>,
}

impl Wrench {
    /// Force and torque in world axes, for the current pose of the body.
    pub(crate) fn in_world(&self, data: &impl BodyArrays) -> [Vector3<f64>; 2] {
        let Some(axes) = self.axes else { return [self.force, self.torque] };
        let q = &data.xquat()[4 * self.body..4 * self.body + 4];
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])) * axes;
        [turn * self.force, turn * self.torque]
    }
}

impl Wrenches {
    /// Replaces the wrench of the same owner; a zero wrench removes it.
    pub(crate) fn replace(&mut self, wrench: Wrench) {
        self.list.retain(|old| old.owner != wrench.owner);
        if wrench.force != Vector3::zeros() || wrench.torque != Vector3::zeros() {
            self.list.push(wrench);
        }
    }

    /// Sets the wrench of user forces on a body, in world axes, beside other wrenches; a zero wrench removes it. `body`
    /// is the index on the body axis, `mujoco_body` the index in the model.
    pub(crate) fn set_user_wrench(
        &mut self,
        body: usize,
        mujoco_body: usize,
        force: Vector3<f64>,
        torque: Vector3<f64>,
    ) {
        self.replace(Wrench { owner: (USER_FORCE_OWNER, body), body: mujoco_body, axes: None, force, torque });
    }

    /// True if the direction of a wrench turns with a link.
    pub(crate) fn has_link_axes(&self) -> bool {
        self.list.iter().any(|wrench| wrench.axes.is_some())
    }

    /// Enables or disables gravity compensation of bodies, by their indices in the model.
    pub(crate) fn set_gravity_compensation(&mut self, bodies: &[usize], weightless: bool) {
        self.gravity_compensated.retain(|body| !bodies.contains(body));
        if weightless {
            self.gravity_compensated.extend(bodies);
        }
    }

    /// Wrenches for another model; `body` maps old to new body indices. Wrenches and gravity compensation of bodies
    /// without a new index are dropped. So are user forces ([`set_user_wrench`](Self::set_user_wrench)), because their
    /// owner index is invalid there.
    pub(crate) fn remapped(&self, body: impl Fn(usize) -> Option<usize>) -> Self {
        let moved = |wrench: &Wrench| Some(Wrench { body: body(wrench.body)?, ..wrench.clone() });
        Self {
            list: self.list.iter().filter(|wrench| wrench.owner.0 != USER_FORCE_OWNER).filter_map(moved).collect(),
            gravity_compensated: self.gravity_compensated.iter().filter_map(|&old| body(old)).collect(),
        }
    }

    /// Flat array: the number of wrenches, 14 numbers per wrench, then the gravity-compensated bodies.
    pub(crate) fn to_flat(&self) -> Vec<f64> {
        let mut numbers = vec![self.list.len() as f64];
        for Wrench { owner, body, axes, force, torque } in &self.list {
            let q = axes.map_or([0.0; 4], |axes| [axes.w, axes.i, axes.j, axes.k]);
            numbers.extend([owner.0 as f64, owner.1 as f64, *body as f64, f64::from(axes.is_some())]);
            numbers.extend(q.iter().chain(force).chain(torque));
        }
        numbers.extend(self.gravity_compensated.iter().map(|&body| body as f64));
        numbers
    }

    /// Inverse of [`to_flat`](Self::to_flat); `None` for an array that is too short.
    pub(crate) fn from_flat(numbers: &[f64]) -> Option<Self> {
        let (&count, rest) = numbers.split_first()?;
        let (list, weightless) = rest.split_at_checked((count as usize).checked_mul(14)?)?;
        let wrench = |&[robot, link, body, turned, w, i, j, k, fx, fy, fz, tx, ty, tz]: &[f64; 14]| Wrench {
            owner: (robot as usize, link as usize),
            body: body as usize,
            axes: (turned > 0.0).then(|| UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k))),
            force: Vector3::new(fx, fy, fz),
            torque: Vector3::new(tx, ty, tz),
        };
        let list = list.as_chunks::<14>().0.iter().map(wrench).collect();
        Some(Self { list, gravity_compensated: weightless.iter().map(|&body| body as usize).collect() })
    }

    /// Writes the wrenches and the gravity compensation to `data`. Bodies without either keep their `xfrc_applied`.
    pub(crate) fn apply(&self, data: &mut Data) {
        self.clear(data);
        for wrench in &self.list {
            let [force, torque] = wrench.in_world(data);
            add(data, wrench.body, &force, &torque);
        }
        let gravity = Vector3::from(data.model().gravity());
        for &body in &self.gravity_compensated {
            // 4.x compensates a part of the weight itself; only the rest is added.
            let felt = 1.0 - data.model().body_gravity_compensation(body);
            let weight = felt * data.model().body_mass()[body] * gravity;
            add(data, body, &-weight, &Vector3::zeros());
        }
    }

    /// Clears `xfrc_applied` of all bodies with a wrench or gravity compensation.
    pub(crate) fn clear(&self, data: &mut Data) {
        for &body in self.list.iter().map(|wrench| &wrench.body).chain(&self.gravity_compensated) {
            data.xfrc_applied_mut()[6 * body..6 * body + 6].fill(0.0);
        }
    }
}

fn add(data: &mut Data, body: usize, force: &Vector3<f64>, torque: &Vector3<f64>) {
    let applied = &mut data.xfrc_applied_mut()[6 * body..6 * body + 6];
    applied.iter_mut().zip(force.iter().chain(torque)).for_each(|(to, value)| *to += value);
}
