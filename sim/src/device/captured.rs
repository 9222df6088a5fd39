//! Quantities that a device captured inside a step, in the form in which MuJoCo's data has them.

use crate::body_pose::BodyArrays;
use crate::capture::{SolvedBodies, SolvedContact};
use kinetoscope_mujoco::Model;

/// Numbers of a contact: environment, two geoms, distance, point, frame row by row, and the force in its axes.
const CONTACT_NUMBERS: usize = 4 + 3 + 9 + 3;

/// Contacts of all environments.
pub(super) struct DeviceContacts {
    numbers: Vec<f32>,
    /// Indices of the contacts, environment by environment, each in their order on the device.
    order: Vec<u32>,
    /// First index in `order` of each environment, then the end.
    first: Vec<usize>,
}

impl DeviceContacts {
    /// Sorts contacts of `num_envs` environments, [`CONTACT_NUMBERS`] numbers each. Those of other environments are left
    /// out.
    pub(super) fn new(numbers: Vec<f32>, num_envs: usize) -> Self {
        let rows = numbers.as_chunks::<CONTACT_NUMBERS>().0;
        let mut first = vec![0; num_envs + 1];
        let env_of =
            |row: &[f32; CONTACT_NUMBERS]| (row[0] >= 0.0 && row[0] < num_envs as f32).then_some(row[0] as usize);
        for env in rows.iter().filter_map(env_of) {
            first[env + 1] += 1;
        }
        for env in 0..num_envs {
            first[env + 1] += first[env];
        }
        let mut next = first.clone();
        let mut order = vec![0; first[num_envs]];
        for (index, row) in rows.iter().enumerate() {
            if let Some(env) = env_of(row) {
                order[next[env]] = index as u32;
                next[env] += 1;
            }
        }
        Self { numbers, order, first }
    }

    /// Contacts of an environment, in their order on the device.
    pub(super) fn of_env(&self, env: usize) -> impl Iterator<Item = SolvedContact> {
        let rows = self.numbers.as_chunks::<CONTACT_NUMBERS>().0;
        self.order[self.first[env]..self.first[env + 1]].iter().map(|&index| {
            let row = &rows[index as usize];
            let number = |k: usize| f64::from(row[k]);
            SolvedContact {
                geoms: [row[1] as i32, row[2] as i32],
                distance: number(3),
                point: std::array::from_fn(|k| number(4 + k)),
                frame: std::array::from_fn(|k| number(7 + k)),
                force: std::array::from_fn(|k| number(16 + k)),
            }
        })
    }
}

/// Motion and forces of the bodies of one environment.
pub(super) struct DeviceBodies<'a> {
    /// `xpos`, `xquat`, `cvel`, `subtree_com`, `cacc`, `cfrc_int`.
    arrays: [Vec<f64>; 6],
    model: &'a Model,
}

impl<'a> DeviceBodies<'a> {
    /// Motion of no environment.
    pub(super) fn new(model: &'a Model) -> Self {
        Self { arrays: Default::default(), model }
    }

    /// Takes over the part of `arrays`, which have a row per environment, that belongs to environment `env`. The last
    /// array may be empty.
    pub(super) fn load(&mut self, arrays: &[Vec<f32>], env: usize) {
        let nbody = self.model.nbody();
        for ((to, from), width) in self.arrays.iter_mut().zip(arrays).zip([3, 4, 6, 3, 6, 6]) {
            let width = width * nbody;
            let row = from.get(env * width..(env + 1) * width).unwrap_or_default();
            to.clear();
            to.extend(row.iter().map(|x| f64::from(*x)));
        }
    }
}

impl BodyArrays for DeviceBodies<'_> {
    fn xpos(&self) -> &[f64] {
        &self.arrays[0]
    }

    fn xquat(&self) -> &[f64] {
        &self.arrays[1]
    }

    fn xipos(&self) -> &[f64] {
        // Captures read no centers of mass of single bodies.
        &[]
    }

    fn cvel(&self) -> &[f64] {
        &self.arrays[2]
    }

    fn subtree_com(&self) -> &[f64] {
        &self.arrays[3]
    }

    fn body_rootid(&self) -> &[i32] {
        self.model.body_rootid()
    }
}

impl SolvedBodies for DeviceBodies<'_> {
    fn cacc(&self) -> &[f64] {
        &self.arrays[4]
    }

    fn cfrc_int(&self) -> &[f64] {
        &self.arrays[5]
    }
}
