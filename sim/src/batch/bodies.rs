//! Motion of bodies that was read: computed once for each state of an environment, and copied by further reads.

use super::Lease;
use crate::body_pose::BodyArrays;
use crate::env::{SimEnv, Stage};
use crate::row::{EnvRow, StoredRow};
use kinetoscope_mujoco::Model;

/// Numbers per body: position, quaternion, center of mass, spatial velocity, and center of mass of the subtree.
const BODY_NUMBERS: usize = 3 + 4 + 3 + 6 + 3;

/// Motion of all bodies in the environments of a chunk. It has no memory until it is first read.
#[derive(Debug, Default)]
pub(super) struct BodyCache {
    /// The arrays of [`BodyArrays`] one after the other, environment by environment.
    values: Vec<f64>,
    /// Version of the row that each environment's values belong to; 0 for none.
    versions: Vec<u64>,
    /// Numbers of each environment.
    width: usize,
    /// True if no row was in use since the last [`update`](Self::update).
    is_current: bool,
}

impl BodyCache {
    /// True if the values belong to all rows.
    pub(super) fn is_current(&self) -> bool {
        self.is_current
    }

    /// Memory of the motion of one environment, once it is read \[bytes\].
    pub(super) fn bytes_per_env(model: &Model) -> usize {
        BODY_NUMBERS * model.nbody() * size_of::<f64>() + size_of::<u64>()
    }

    /// Compares the versions again in the next [`update`](Self::update), because a row may change.
    pub(super) fn expect_changes(&mut self) {
        self.is_current = false;
    }

    /// Computes the motion in `workspace` for all rows whose version changed.
    pub(super) fn update(&mut self, workspace: &mut SimEnv, rows: &mut [Box<EnvRow>], model: &Model) {
        if self.is_current {
            return;
        }
        if self.versions.is_empty() {
            self.width = BODY_NUMBERS * model.nbody();
            self.versions.resize(rows.len(), 0);
            self.values.resize(rows.len() * self.width, 0.0);
        }
        for ((row, version), values) in
            rows.iter_mut().zip(&mut self.versions).zip(self.values.chunks_exact_mut(self.width))
        {
            if *version == 0 || *version != row.version {
                let lease = Lease::new(workspace, row, false);
                lease.workspace.reach(Stage::Bodies);
                copy_arrays(lease.workspace.data(), values);
                drop(lease);
                // The lease may give the row a new version.
                *version = row.version;
            }
        }
        self.is_current = true;
    }

    /// Values of the environment at index `k` of the chunk.
    pub(super) fn values(&self, k: usize) -> &[f64] {
        &self.values[k * self.width..(k + 1) * self.width]
    }
}

fn copy_arrays(data: &impl BodyArrays, mut out: &mut [f64]) {
    for array in [data.xpos(), data.xquat(), data.xipos(), data.cvel(), data.subtree_com()] {
        let (to, rest) = out.split_at_mut(array.len());
        to.copy_from_slice(array);
        out = rest;
    }
}

/// Row of an environment with the motion of its bodies in the current state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoredBodies<'a> {
    row: StoredRow<'a>,
    values: &'a [f64],
}

impl<'a> StoredBodies<'a> {
    pub(super) fn new(row: StoredRow<'a>, values: &'a [f64]) -> Self {
        Self { row, values }
    }

    /// Array with `width` numbers per body, after arrays with `before` numbers per body.
    fn array(&self, before: usize, width: usize) -> &'a [f64] {
        let bodies = self.values.len() / BODY_NUMBERS;
        &self.values[before * bodies..(before + width) * bodies]
    }
}

impl<'a> std::ops::Deref for StoredBodies<'a> {
    type Target = StoredRow<'a>;

    fn deref(&self) -> &StoredRow<'a> {
        &self.row
    }
}

impl BodyArrays for StoredBodies<'_> {
    fn xpos(&self) -> &[f64] {
        self.array(0, 3)
    }

    fn xquat(&self) -> &[f64] {
        self.array(3, 4)
    }

    fn xipos(&self) -> &[f64] {
        self.array(7, 3)
    }

    fn cvel(&self) -> &[f64] {
        self.array(10, 6)
    }

    fn subtree_com(&self) -> &[f64] {
        self.array(16, 3)
    }

    fn body_rootid(&self) -> &[i32] {
        self.row.model.body_rootid()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Batch;
    use kinetoscope_exec::ThreadPool;
    use std::sync::Arc;

    /// The memory that a batch asks for has that of the motion of all environments.
    #[test]
    fn memory_of_motion() {
        let text = r#"<mujoco><worldbody><body><freejoint/><geom size="0.1"/>
            <body pos="0 0 1"><joint/><geom size="0.1"/></body></body></worldbody></mujoco>"#;
        let model = kinetoscope_mujoco::compile(text, &[]).expect("compiles").into_model();
        let batch = Batch::new(&model, &Arc::default(), 70, 2, ThreadPool::new()).expect("small");
        let bytes = || -> usize {
            let of = |cache: &BodyCache| size_of_val(&*cache.values) + size_of_val(&*cache.versions);
            batch.chunks.chunks.iter().map(|chunk| of(&crate::batch::lock(chunk).bodies)).sum()
        };
        assert_eq!(bytes(), 0);
        batch.body_rows(|bodies| [bodies.xpos()[3]]);
        assert_eq!(bytes(), 70 * BodyCache::bytes_per_env(&model));
        let row = batch.read_row(0, |row| row.bytes());
        let asked = batch.read_row(0, |stored| crate::batch::bytes_per_env(stored.row, &model));
        assert_eq!(asked, row + BodyCache::bytes_per_env(&model) + size_of::<usize>());
    }
}
