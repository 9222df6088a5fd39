//! Quantities that a device captured inside a step, in the form in which MuJoCo's data has them.

use crate::body_pose::BodyArrays;
use crate::capture::{SolvedBodies, SolvedContact};
use kinetoscope_mujoco::Model;

/// Numbers of a contact: environment, two geoms, distance, point, frame row by row, and the force in its axes.
pub(super) const CONTACT_NUMBERS: usize = 4 + 3 + 9 + 3;

/// Contacts of each environment, in their order on the device.
pub(super) fn contacts_by_env(rows: &[[f32; CONTACT_NUMBERS]], num_envs: usize) -> Vec<Vec<SolvedContact>> {
    let mut contacts: Vec<Vec<SolvedContact>> = vec![Vec::new(); num_envs];
    for row in rows {
        let number = |k: usize| f64::from(row[k]);
        if let Some(of_env) = contacts.get_mut(row[0] as usize) {
            of_env.push(SolvedContact {
                geoms: [row[1] as i32, row[2] as i32],
                distance: number(3),
                point: std::array::from_fn(|k| number(4 + k)),
                frame: std::array::from_fn(|k| number(7 + k)),
                force: std::array::from_fn(|k| number(16 + k)),
            });
        }
    }
    contacts
}

/// Motion and forces of the bodies of one environment.
pub(super) struct DeviceBodies<'a> {
    /// `xpos`, `xquat`, `cvel`, `subtree_com`, `cacc`, `cfrc_int`.
    arrays: [Vec<f64>; 6],
    model: &'a Model,
}

impl<'a> DeviceBodies<'a> {
    /// The part of `arrays`, which have a row per environment, that belongs to environment `env`. The last array may be
    /// empty.
    pub(super) fn new(arrays: &[Vec<f32>], env: usize, model: &'a Model) -> Self {
        let nbody = model.nbody();
        let widths = [3, 4, 6, 3, 6, 6];
        let row = |k: usize| {
            let width = widths[k] * nbody;
            let row = arrays[k].get(env * width..(env + 1) * width).unwrap_or_default();
            row.iter().map(|x| f64::from(*x)).collect()
        };
        Self { arrays: std::array::from_fn(row), model }
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
