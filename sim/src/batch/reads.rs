//! Reads of all environments of a batch, on all of its threads.
//!
//! Every thread takes whole chunks and writes to its part of the output, so the result does not depend on the threads.
//! Unlike steps, these reads do not wait for working memory: a closure that reads one environment may call them.

use super::bodies::StoredBodies;
use super::{Batch, Chunk, Lease, LockedChunk, lock};
use crate::env::{SimEnv, Stage};
use crate::row::{RowPart, StateArray, StoredRow};
use ndarray::{Array2, Array3};
use std::sync::Mutex;

/// Largest number of chosen environments that the calling thread reads alone.
const FEW_ENVS: usize = 8;
/// Largest number of elements that the calling thread copies alone: waking threads costs more.
const FEW_ELEMENTS: usize = 1 << 14;

impl Batch {
    /// Calls `visit` for every environment, in parallel and in any order, with the quantities that `stage` contains.
    pub(crate) fn visit(&self, stage: Stage, visit: impl Fn(usize, &SimEnv) + Sync) {
        self.read_all(stage, &mut vec![(); self.num_envs], |i, env, _| visit(i, env));
    }

    /// Calls `visit` for the environments `chosen` as [`visit`](Self::visit) does.
    pub(crate) fn visit_in(&self, chosen: &[usize], stage: Stage, visit: impl Fn(usize, &SimEnv) + Sync) {
        if chosen.len() <= FEW_ENVS {
            return chosen.iter().for_each(|&index| self.read_at(index, stage, |env| visit(index, env)));
        }
        let mut mask = vec![false; self.num_envs];
        chosen.iter().for_each(|&index| mask[index] = true);
        self.in_chunks(RowPart::All, &mut vec![(); self.num_envs], |workspace, taken, _| {
            let first = taken.first;
            taken.for_each_row(|k, row| {
                if mask[first + k] {
                    let lease = Lease::new(workspace, row, false);
                    lease.workspace.reach(stage);
                    visit(first + k, lease.workspace);
                }
            });
        });
    }

    /// Calls `read` for every environment, in parallel and in any order, with the quantities that `stage` contains and
    /// with the elements of `out` that belong to the environment: an equal number for each.
    pub(crate) fn read_all<T: Send>(
        &self,
        stage: Stage,
        out: &mut [T],
        read: impl Fn(usize, &SimEnv, &mut [T]) + Sync,
    ) {
        let width = out.len() / self.num_envs;
        self.in_chunks(RowPart::All, out, |workspace, taken, out| {
            let first = taken.first;
            taken.for_each_row(|k, row| {
                let lease = Lease::new(workspace, row, false);
                lease.workspace.reach(stage);
                read(first + k, lease.workspace, &mut out[k * width..(k + 1) * width]);
            });
        });
    }

    /// Calls `read` for every environment, in parallel and in any order, with the motion of its bodies and with the
    /// elements of `out` that belong to the environment: an equal number for each. The motion is computed once for each
    /// state.
    pub(crate) fn read_bodies<T: Send>(&self, out: &mut [T], read: impl Fn(usize, &StoredBodies<'_>, &mut [T]) + Sync) {
        let (width, model) = (out.len() / self.num_envs, &self.model);
        let copy = |first: usize, chunk: &Chunk, out: &mut [T]| {
            for (k, row) in chunk.rows.iter().enumerate() {
                let bodies = StoredBodies::new(StoredRow { row, model }, chunk.bodies.values(k));
                read(first + k, &bodies, &mut out[k * width..(k + 1) * width]);
            }
        };
        self.catch_up(RowPart::All);
        let chunk_size = self.chunks.chunk_size;
        if out.len() <= FEW_ELEMENTS && self.chunks.chunks.iter().all(|chunk| lock(chunk).bodies.is_current()) {
            for (c, (chunk, out)) in self.chunks.chunks.iter().zip(self.parts(out)).enumerate() {
                copy(c * chunk_size, &lock(chunk), out);
            }
            return;
        }
        self.in_chunks(RowPart::All, out, |workspace, taken, out| {
            let Chunk { rows, bodies, .. } = &mut *taken.chunk;
            bodies.update(workspace, rows, model);
            copy(taken.first, &taken.chunk, out);
        });
    }

    /// Calls `read` for every environment, in parallel and in any order, with its row, which is up to date as far as
    /// `part`, and with the elements of `out` that belong to the environment: an equal number for each. `read` must not
    /// read the batch.
    pub(crate) fn read_stored<T: Send>(
        &self,
        part: RowPart,
        out: &mut [T],
        read: impl Fn(&StoredRow<'_>, &mut [T]) + Sync,
    ) {
        let (width, model) = (out.len() / self.num_envs, &self.model);
        let copy = |chunk: &Chunk, out: &mut [T]| {
            for (k, row) in chunk.rows.iter().enumerate() {
                read(&StoredRow { row, model }, &mut out[k * width..(k + 1) * width]);
            }
        };
        if out.len() <= FEW_ELEMENTS {
            self.catch_up(part);
            for (chunk, out) in self.chunks.chunks.iter().zip(self.parts(out)) {
                copy(&lock(chunk), out);
            }
            return;
        }
        self.in_chunks(part, out, |_, taken, out| copy(&taken.chunk, out));
    }

    /// Parts of `out` that belong to the chunks.
    fn parts<'o, T>(&self, out: &'o mut [T]) -> Vec<&'o mut [T]> {
        let (count, size) = (self.chunks.chunks.len(), self.chunks.chunk_size * (out.len() / self.num_envs));
        let mut rest = out;
        let mut parts = Vec::with_capacity(count);
        for _ in 0..count {
            // The last chunk may be smaller.
            let size = size.min(rest.len());
            let (part, others) = std::mem::take(&mut rest).split_at_mut(size);
            parts.push(part);
            rest = others;
        }
        parts
    }

    /// Runs `job` once for every chunk, in parallel, with working memory and the part of `out` that belongs to the
    /// chunk. Rows are up to date as far as `part`.
    pub(super) fn in_chunks<T: Send>(
        &self,
        part: RowPart,
        out: &mut [T],
        job: impl Fn(&mut SimEnv, &mut LockedChunk, &mut [T]) + Sync,
    ) {
        self.catch_up(part);
        let parts: Vec<Mutex<&mut [T]>> = self.parts(out).into_iter().map(Mutex::new).collect();
        let chunks = &self.chunks;
        if self.num_envs <= self.threads() {
            // Every environment has working memory of its own, which still holds it.
            for (c, part) in parts.iter().enumerate() {
                let mut taken = chunks.lock_chunk(c);
                self.with_workspace(taken.chunk.rows[0].version, |workspace| {
                    job(workspace, &mut taken, &mut lock(part));
                });
            }
            return;
        }
        let shares = chunks.fresh_shares();
        self.pool.run(shares.len(), |slot| {
            self.with_workspace(SimEnv::first_version(slot + 1), |workspace| {
                chunks.process_shares(&shares, slot, |taken| {
                    let part = &mut *lock(&parts[taken.first / chunks.chunk_size]);
                    job(workspace, taken, part);
                });
            });
        });
    }

    /// Reads K numbers of the motion of bodies in each environment, shape (N, K).
    pub(crate) fn body_rows<const K: usize>(&self, read: impl Fn(&StoredBodies<'_>) -> [f64; K] + Sync) -> Array2<f64> {
        let mut rows = vec![[0.0; K]; self.num_envs];
        self.read_bodies(&mut rows, |_, bodies, row| row[0] = read(bodies));
        rows.into()
    }

    /// Reads K numbers of the motion of bodies in each environment for each of `items`, shape (N, items, K).
    pub(crate) fn body_rows_of<I: Sync, const K: usize>(
        &self,
        items: &[I],
        read: impl Fn(&StoredBodies<'_>, &I) -> [f64; K] + Sync,
    ) -> Array3<f64> {
        let mut values = Array3::zeros((self.num_envs, items.len(), K));
        if let Some(out) = values.as_slice_mut() {
            self.read_bodies(out, |_, bodies, out| {
                for (to, item) in out.as_chunks_mut::<K>().0.iter_mut().zip(items) {
                    *to = read(bodies, item);
                }
            });
        }
        values
    }

    /// Reads a value that `stage` contains of each environment and each of `items`, shape (N, items).
    pub(crate) fn gather<I: Sync, T>(
        &self,
        stage: Stage,
        items: &[I],
        read: impl Fn(&SimEnv, &I) -> T + Sync,
    ) -> Array2<T>
    where
        T: Copy + Default + Send,
    {
        let mut values = Array2::default((self.num_envs, items.len()));
        if let Some(out) = values.as_slice_mut() {
            self.read_all(stage, out, |_, env, out| {
                for (to, item) in out.iter_mut().zip(items) {
                    *to = read(env, item);
                }
            });
        }
        values
    }

    /// Reads the rows of all environments in order, on the calling thread. They are up to date as far as `part`.
    pub(crate) fn for_each_row(&self, part: RowPart, mut read: impl FnMut(usize, StoredRow<'_>)) {
        self.catch_up(part);
        for (c, chunk) in self.chunks.chunks.iter().enumerate() {
            for (i, row) in lock(chunk).rows.iter().enumerate() {
                read(c * self.chunks.chunk_size + i, StoredRow { row, model: &self.model });
            }
        }
    }

    /// Reads a number of the state of each environment for each of `items`, shape (N, items), in parallel. `place` returns
    /// the index in `array`.
    pub(crate) fn gather_state<I: Sync>(
        &self,
        array: StateArray,
        items: &[I],
        place: impl Fn(&I) -> usize + Sync,
    ) -> Array2<f64> {
        let on_device = self.gather_on_device(array, items, &place);
        on_device.unwrap_or_else(|| self.gather_stored(RowPart::All, items, |row, item| array.of(row)[place(item)]))
    }

    /// Reads a value of the row of each environment and each of `items`, shape (N, items), in parallel. Rows are up to
    /// date as far as `part`.
    pub(crate) fn gather_stored<I: Sync, T>(
        &self,
        part: RowPart,
        items: &[I],
        read: impl Fn(&StoredRow<'_>, &I) -> T + Sync,
    ) -> Array2<T>
    where
        T: Copy + Default + Send,
    {
        let mut values = Array2::default((self.num_envs, items.len()));
        if let Some(out) = values.as_slice_mut() {
            self.read_stored(part, out, |row, out| {
                for (value, item) in out.iter_mut().zip(items) {
                    *value = read(row, item);
                }
            });
        }
        values
    }
}
