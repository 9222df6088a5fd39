//! N environments on worker threads, bit-identical for any number of threads and environments.
//!
//! The batch holds a [row](crate::row) per environment and an `mjData` per thread. For each environment, a thread
//! restores the row, steps, gathers the requested values and saves the row. The data stays in the core's cache
//! meanwhile. An `mjData` that still belongs to the environment is not restored, so a batch with no more environments
//! than threads works like environments with an `mjData` each.
//!
//! Rows are grouped in chunks, and every thread owns a share of the chunks. A thread first takes the chunks of its own
//! share, then helps with the remaining shares. The assignment of threads cannot change results, because a row contains
//! everything that determines a step.

mod bodies;
mod on_device;
#[cfg(test)]
mod patch_tests;
mod reads;
#[cfg(test)]
mod tests;

pub(crate) use bodies::StoredBodies;

use self::bodies::BodyCache;
use self::on_device::OnDevice;
use crate::available_memory::available_memory;
use crate::batch_error::BatchError;
use crate::capture::CaptureRequest;
use crate::device::{Changes, SentRows};
use crate::drive::table::{DriveState, DriveTable};
use crate::env::{SimEnv, Stage};
use crate::row::{EnvRow, RowPart, StoredRow, prefetch_after};
use kinetoscope_exec::ThreadPool;
use kinetoscope_mujoco::{Data, Model};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Largest number of environments in a chunk, with several threads and with one. Within a chunk, the next row is
/// prefetched.
const MAX_CHUNK_SIZES: [usize; 2] = [16, 64];

/// Consecutive environments that one thread processes together.
struct Chunk {
    #[expect(clippy::vec_box, reason = "a thread takes a row by exchanging pointers")]
    rows: Vec<Box<EnvRow>>,
    /// Values read by [`Batch::step_and_read`], environment by environment.
    read_values: Vec<f64>,
    /// Motion of bodies that was read.
    bodies: BodyCache,
    /// Changes since a device got the rows.
    changes: Changes,
    /// Inputs that the device has.
    sent: SentRows,
    /// True if a row had wrenches when the device got the rows.
    has_wrenches: bool,
}

/// A chunk that a thread has locked.
struct LockedChunk<'a> {
    /// Index, in the batch, of the first environment of the chunk.
    first: usize,
    chunk: MutexGuard<'a, Chunk>,
}

/// N environments of one model, stepped in parallel.
#[derive(Debug)]
pub struct Batch {
    chunks: Chunks,
    /// Working memory of each thread.
    workspaces: Vec<Mutex<SimEnv>>,
    /// Further working memory, for reads while all others are in use.
    spare_workspaces: Mutex<SpareSeats>,
    pool: ThreadPool,
    model: Model,
    num_envs: usize,
    /// Locked while threads take chunks, because the counters of the shares serve one pass at a time.
    running: Mutex<()>,
    /// Growths of buffers in the batches that this one replaces.
    earlier_growths: u64,
    /// Device that steps the environments; `None` for the threads of this process.
    device: Option<OnDevice>,
}

/// Working memory for reads while that of all threads is in use.
#[derive(Debug)]
struct SpareSeats {
    workspaces: Vec<SimEnv>,
    created: usize,
    /// Environment that further working memory is created from.
    origin: SimEnv,
}

/// The rows in chunks, with one share of the chunks per thread.
struct Chunks {
    chunks: Vec<Mutex<Chunk>>,
    chunk_size: usize,
    /// One share of the chunks for each thread.
    shares: Vec<Share>,
}

/// A range of chunks. The alignment gives each counter its own cache lines, which avoids false sharing between threads.
#[repr(align(128))]
struct Share {
    /// Index, in the list of all chunks, of the next chunk of the share to take.
    next: AtomicUsize,
    chunks: Range<usize>,
}

impl std::fmt::Debug for Chunks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Chunks").field("chunks", &self.chunks.len()).finish_non_exhaustive()
    }
}

/// An environment in working memory. The row returns to the batch when the lease ends, also after a panic.
struct Lease<'a> {
    workspace: &'a mut SimEnv,
    row: &'a mut Box<EnvRow>,
    /// True if the environment may have changed.
    writes: bool,
}

impl<'a> Lease<'a> {
    fn new(workspace: &'a mut SimEnv, row: &'a mut Box<EnvRow>, writes: bool) -> Self {
        workspace.load(row, true);
        Self { workspace, row, writes }
    }

    /// Lease for at least one step.
    fn for_step(workspace: &'a mut SimEnv, row: &'a mut Box<EnvRow>) -> Self {
        // A diverged environment does not step and keeps its results.
        let with_results = row.diverged.is_some();
        workspace.load(row, with_results);
        Self { workspace, row, writes: true }
    }
}

impl Drop for Lease<'_> {
    fn drop(&mut self) {
        if self.writes { self.workspace.store(self.row) } else { self.workspace.put_back(self.row) }
    }
}

/// Memory of an environment of a batch whose poses are read, without randomized properties \[bytes\].
fn bytes_per_env(row: &EnvRow, model: &Model) -> usize {
    size_of::<Box<EnvRow>>() + row.bytes() + BodyCache::bytes_per_env(model)
}

/// Locks a mutex even if it is poisoned: only a panicking job poisons it, and the pool has already propagated that
/// panic.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Batch {
    /// Creates `num_envs` environments in the initial state of `model`. Up to `threads` threads step them: the calling
    /// thread and threads of `pool`.
    ///
    /// # Errors
    /// A number is zero, the model keeps state that rows do not have, or memory or threads cannot be allocated.
    pub fn new(
        model: &Model,
        drives: &Arc<DriveTable>,
        num_envs: usize,
        threads: usize,
        pool: ThreadPool,
    ) -> Result<Self, BatchError> {
        if num_envs == 0 {
            return Err(BatchError::NoEnvironments);
        }
        if threads == 0 {
            return Err(BatchError::NoThreads);
        }
        if let Some(feature) = model.persistent_feature() {
            return Err(BatchError::PersistentFeature(feature));
        }
        let failed = |error| BatchError::Environment { index: 0, error };
        let mut first = SimEnv::with_drives(model, DriveState::new(drives, model)).map_err(failed)?;
        let template = first.saved_row().clone();
        let bytes = bytes_per_env(&template, model).saturating_mul(num_envs);
        // One block of this size meets limits of the process, which Linux otherwise checks row by row.
        let is_limited = Vec::<u8>::new().try_reserve_exact(bytes).is_err();
        if is_limited || available_memory().is_some_and(|available| bytes > available) {
            return Err(BatchError::OutOfMemory { num_envs, bytes });
        }
        let chunk_size = match threads {
            1 => num_envs.min(MAX_CHUNK_SIZES[1]),
            // Many chunks per thread balance environments of unequal cost.
            _ => (num_envs / (64 * threads)).clamp(1, MAX_CHUNK_SIZES[0]),
        };
        let count = num_envs.div_ceil(chunk_size);
        let mut chunks = Vec::with_capacity(count);
        for first in (0..num_envs).step_by(chunk_size) {
            let size = chunk_size.min(num_envs - first);
            let row = |k: usize| {
                let mut row = Box::new(template.clone());
                row.cold.env = Some(first + k);
                row
            };
            let rows = (0..size).map(row).collect();
            chunks.push(Mutex::new(Chunk {
                rows,
                read_values: Vec::new(),
                bodies: BodyCache::default(),
                changes: Changes::All,
                sent: SentRows::default(),
                has_wrenches: false,
            }));
        }
        let threads = threads.min(count);
        let share = |t: usize| t * count / threads..(t + 1) * count / threads;
        pool.start(threads).map_err(|error| BatchError::Thread(error.to_string()))?;
        let shares = (0..threads).map(|t| Share { next: AtomicUsize::new(0), chunks: share(t) }).collect();
        let workspaces: Result<Vec<_>, _> = (0..threads).map(|slot| first.for_slot(slot + 1).map(Mutex::new)).collect();
        let workspaces = workspaces.map_err(failed)?;
        let chunks = Chunks { chunks, chunk_size, shares };
        let spare_workspaces = Mutex::new(SpareSeats { workspaces: Vec::new(), created: 0, origin: first });
        Ok(Self {
            chunks,
            workspaces,
            spare_workspaces,
            pool,
            model: model.clone(),
            num_envs,
            running: Mutex::new(()),
            earlier_growths: 0,
            device: None,
        })
    }

    /// The model that all environments were created from. An environment may have a model of its own, with other
    /// properties.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.num_envs
    }

    /// Number of threads that step, the calling thread included: at most one per chunk of environments.
    pub fn threads(&self) -> usize {
        self.chunks.shares.len()
    }

    /// Does `count` MuJoCo steps in every environment. Diverged environments do not step.
    pub fn step(&mut self, count: u32) {
        let count = self.step_on_device(count, None);
        if count > 0 {
            self.run_chunks(|workspace, taken| {
                taken.for_each_env(workspace, count, |_, env, _| env.advance(count, None));
            });
        }
    }

    /// Steps as [`step`](Self::step) does, and captures the quantities of `capture` in the last step. Calls `visit` for
    /// every environment, in any order, as soon as its data has what `stage` contains. Without a stage, `visit` does nothing
    /// and need not be called.
    pub(crate) fn step_and_visit(
        &self,
        count: u32,
        capture: Option<&CaptureRequest>,
        stage: Option<Stage>,
        visit: impl Fn(usize, &SimEnv) + Sync,
    ) {
        let count = self.step_on_device(count, capture);
        let stage = match (count, stage) {
            (0, None) => return,
            (0, Some(stage)) => return self.visit(stage, visit),
            (_, stage) => stage.unwrap_or(Stage::Raw),
        };
        self.run_chunks(|workspace, taken| {
            taken.for_each_env(workspace, count, |i, env, _| {
                env.advance(count, capture);
                env.reach(stage);
                visit(i, env);
            });
        });
    }

    /// Captures the solution of the current state in the environments `chosen`.
    pub(crate) fn capture_present(&mut self, chosen: &[usize], capture: CaptureRequest) {
        self.run_in(chosen, |_, env| env.capture_current(&capture));
    }

    /// Does `count` MuJoCo steps in every environment and copies the slices that `read` returns to `outs`, one row per
    /// environment: `batch.step_and_read(1, Stage::State, |env| [env.data().qpos(), env.data().qvel()], [&mut qpos,
    /// &mut qvel])`. `stage` contains the quantities that `read` returns.
    ///
    /// The thread that stepped an environment reads it immediately, while its data is in that core's cache.
    ///
    /// # Panics
    /// The sizes of `outs` and of the slices differ, or `read` panics.
    #[track_caller]
    pub fn step_and_read<const K: usize>(
        &mut self,
        count: u32,
        stage: Stage,
        read: impl for<'e> Fn(&'e SimEnv) -> [&'e [f64]; K] + Sync,
        mut outs: [&mut [f64]; K],
    ) {
        let count = self.step_on_device(count, None);
        self.catch_up(RowPart::All);
        let widths = self.read_at(0, Stage::Raw, |env| read(env).map(<[f64]>::len));
        for (out, width) in outs.iter().zip(widths) {
            assert!(out.len() == self.num_envs * width, "{} numbers for {} x {width}", out.len(), self.num_envs);
        }
        let step = |env: &mut SimEnv, take: &mut dyn FnMut(usize, &[f64])| {
            env.advance(count, None);
            env.reach(stage);
            for (k, (values, width)) in read(env).into_iter().zip(widths).enumerate() {
                assert!(values.len() == width, "{} numbers from one environment, {width} from another", values.len());
                take(k, values);
            }
        };
        if self.threads() == 1 {
            // A single thread writes directly to the outputs.
            let workspace = &mut *lock(&self.workspaces[0]);
            for c in 0..self.chunks.chunks.len() {
                self.chunks.lock_chunk(c).for_each_env(workspace, count, |index, env, _| {
                    step(env, &mut |k, values| {
                        outs[k][index * widths[k]..(index + 1) * widths[k]].copy_from_slice(values);
                    });
                });
            }
            return;
        }
        let job = |workspace: &mut SimEnv, taken: &mut LockedChunk| {
            taken.chunk.read_values.clear();
            taken.for_each_env(workspace, count, |_, env, read| {
                step(env, &mut |_, values| read.extend_from_slice(values))
            });
        };
        let mut copied = vec![false; self.chunks.chunks.len()];
        let mut copy = |first: usize, chunk: &Chunk| {
            let mut values = &chunk.read_values[..];
            for index in first..first + chunk.rows.len() {
                for (out, width) in outs.iter_mut().zip(widths) {
                    let (mine, rest) = values.split_at(width);
                    out[index * width..(index + 1) * width].copy_from_slice(mine);
                    values = rest;
                }
            }
        };
        let chunk_size = self.chunks.chunk_size;
        // The calling thread copies the values of its own chunks while the other threads still step.
        self.run_chunks_then(job, |taken| {
            copy(taken.first, &taken.chunk);
            copied[taken.first / chunk_size] = true;
        });
        for (c, chunk) in self.chunks.chunks.iter().enumerate().filter(|(c, _)| !copied[*c]) {
            copy(c * chunk_size, &lock(chunk));
        }
    }

    /// Runs `job` once for every environment, in parallel, with the index of the environment and a forward pass done.
    ///
    /// # Panics
    /// `job` panics.
    pub fn run(&mut self, job: impl Fn(usize, &mut SimEnv) + Sync) {
        self.run_chunks(|workspace, taken| {
            taken.for_each_env(workspace, 0, |i, env, _| {
                env.reach(Stage::Forward);
                job(i, env);
            });
        });
    }

    /// Runs `job` once for each of the environments `chosen`, in parallel, with the index of the environment. The data
    /// has the state alone.
    pub(crate) fn run_in(&mut self, chosen: &[usize], job: impl Fn(usize, &mut SimEnv) + Sync) {
        let mut mask = vec![false; self.num_envs];
        chosen.iter().for_each(|&env| mask[env] = true);
        self.run_chunks(|workspace, taken| {
            let first = taken.first;
            taken.expect_changes(Changes::All);
            taken.for_each_row(|k, row| {
                if mask[first + k] {
                    job(first + k, Lease::new(workspace, row, true).workspace);
                }
            });
        });
    }

    fn run_chunks(&self, job: impl Fn(&mut SimEnv, &mut LockedChunk) + Sync) {
        self.run_chunks_then(job, |_| {});
    }

    /// Runs `job` once for every chunk, in parallel. Calls `then` after each chunk that the calling thread has
    /// processed.
    fn run_chunks_then(
        &self,
        job: impl Fn(&mut SimEnv, &mut LockedChunk) + Sync,
        then: impl FnMut(&LockedChunk) + Send,
    ) {
        self.catch_up(RowPart::All);
        let _running = lock(&self.running);
        let (chunks, workspaces) = (&self.chunks, &self.workspaces);
        for share in &chunks.shares {
            share.next.store(share.chunks.start, Ordering::Relaxed);
        }
        // No contention: only slot 0, the calling thread, takes this lock, and every slot its own workspace.
        let then = Mutex::new(then);
        self.pool.run(chunks.shares.len(), |slot| {
            let workspace = &mut *lock(&workspaces[slot]);
            if slot == 0 {
                let then = &mut *lock(&then);
                chunks.process_shares(&chunks.shares, slot, |taken| {
                    job(workspace, taken);
                    then(taken);
                });
            } else {
                chunks.process_shares(&chunks.shares, slot, |taken| job(workspace, taken));
            }
        });
    }

    /// Runs `act` with working memory that no other thread uses, preferably the one that holds version `version` of a
    /// row.
    fn with_workspace<T>(&self, version: u64, act: impl FnOnce(&mut SimEnv) -> T) -> T {
        // The upper bits of a version name the workspace that made it.
        let last = SimEnv::slot_of(version).wrapping_sub(1);
        let preferred = self.workspaces.get(last).into_iter().chain(&self.workspaces);
        for workspace in preferred {
            match workspace.try_lock() {
                Ok(mut workspace) => return act(&mut workspace),
                Err(std::sync::TryLockError::Poisoned(workspace)) => return act(&mut workspace.into_inner()),
                Err(std::sync::TryLockError::WouldBlock) => {}
            }
        }
        let spare = lock(&self.spare_workspaces).workspaces.pop();
        let mut spare = spare.unwrap_or_else(|| self.new_spare_workspace());
        let result = act(&mut spare);
        lock(&self.spare_workspaces).workspaces.push(spare);
        result
    }

    /// Creates working memory for a read inside of other reads.
    fn new_spare_workspace(&self) -> SimEnv {
        let mut spare = lock(&self.spare_workspaces);
        spare.created += 1;
        let slot = self.workspaces.len() + spare.created;
        spare.origin.for_slot(slot).expect("MuJoCo allocated data of this model before")
    }

    /// Reads environment `index`, with a forward pass done. `read` must not read another environment of the batch: it may
    /// be in the same chunk, which is locked.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub fn read<T>(&self, index: usize, read: impl FnOnce(&SimEnv) -> T) -> T {
        self.read_at(index, Stage::Forward, read)
    }

    /// Reads quantities that `stage` contains of environment `index`.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub(crate) fn read_at<T>(&self, index: usize, stage: Stage, read: impl FnOnce(&SimEnv) -> T) -> T {
        self.with_row(index, RowPart::All, Changes::None, |row| {
            self.with_workspace(row.version, |workspace| {
                let lease = Lease::new(workspace, row, false);
                lease.workspace.reach(stage);
                read(lease.workspace)
            })
        })
    }

    /// Reads the `mjData` of environment `index`, with a forward pass done. Results of the last solve that rows do not
    /// have are zero.
    ///
    /// `read` may read the same environment again: its row is back in the batch then.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub(crate) fn read_data<T>(&self, index: usize, read: impl FnOnce(&Data) -> T) -> T {
        let version = self.with_row(index, RowPart::All, Changes::None, |row| row.version);
        self.with_workspace(version, |workspace| {
            self.with_row(index, RowPart::All, Changes::None, |row| {
                Lease::new(workspace, row, false).workspace.reach(Stage::Forward);
            });
            workspace.clear_unsaved_results();
            read(workspace.data())
        })
    }

    /// Chunk size: environments `k * chunk_size` up to the next chunk are read and stepped by one thread at a time.
    pub(crate) fn chunk_size(&self) -> usize {
        self.chunks.chunk_size
    }

    /// Reads all environments in order, with a forward pass done, on the calling thread.
    pub fn for_each(&self, read: impl FnMut(usize, &SimEnv)) {
        self.for_each_at(Stage::Forward, read);
    }

    /// Reads quantities that `stage` contains of all environments in order, on the calling thread.
    pub(crate) fn for_each_at(&self, stage: Stage, mut read: impl FnMut(usize, &SimEnv)) {
        (0..self.num_envs).for_each(|index| self.read_at(index, stage, |env| read(index, env)));
    }

    /// Reads the row of environment `index`.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub(crate) fn read_row<T>(&self, index: usize, read: impl FnOnce(StoredRow<'_>) -> T) -> T {
        self.with_row(index, RowPart::All, Changes::None, |row| read(StoredRow { row, model: &self.model }))
    }

    /// Writes to environment `index`, with a forward pass done before.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub fn write<T>(&mut self, index: usize, write: impl FnOnce(&mut SimEnv) -> T) -> T {
        self.write_at(index, Stage::Forward, write)
    }

    /// Writes to environment `index`; the data has what `stage` contains.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub(crate) fn write_at<T>(&mut self, index: usize, stage: Stage, write: impl FnOnce(&mut SimEnv) -> T) -> T {
        self.with_row(index, RowPart::All, Changes::All, |row| {
            self.with_workspace(row.version, |workspace| {
                let lease = Lease::new(workspace, row, true);
                lease.workspace.reach(stage);
                write(lease.workspace)
            })
        })
    }

    /// Changes the drives of environment `index`, or other fields of its row that no `mjData` contains: neither the state
    /// nor results of the last solve, which may be behind those of a device.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub(crate) fn edit_row<T>(&mut self, index: usize, edit: impl FnOnce(&mut EnvRow, &Model) -> T) -> T {
        self.with_row(index, RowPart::Clock, Changes::Inputs, |row| edit(row, &self.model))
    }

    /// Changes targets and gains of the drives of environment `index`, but not their efforts, which may be behind those of
    /// a device.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub(crate) fn edit_drives<T>(&mut self, index: usize, edit: impl FnOnce(&mut DriveState) -> T) -> T {
        self.with_row(index, RowPart::Inputs, Changes::Inputs, |row| edit(&mut row.drives))
    }

    #[track_caller]
    fn with_row<T>(&self, index: usize, part: RowPart, changes: Changes, act: impl FnOnce(&mut Box<EnvRow>) -> T) -> T {
        assert!(index < self.num_envs, "environment {index} of {}", self.num_envs);
        self.catch_up(part);
        let mut taken = self.chunks.lock_chunk(index / self.chunks.chunk_size);
        taken.expect_changes(changes);
        act(&mut taken.chunk.rows[index % self.chunks.chunk_size])
    }

    /// Number of times buffers were doubled, in the working memory of all threads. It depends on the number of threads,
    /// and on which of them took an environment.
    pub fn buffer_growths(&self) -> u64 {
        self.earlier_growths + lock(&self.spare_workspaces).origin.buffer_growths() + self.device_growths()
    }

    /// Counts the growths of `old`, which this batch replaces, as growths of this batch.
    pub(crate) fn add_growths_of(&mut self, old: &Self) {
        self.earlier_growths += old.buffer_growths();
    }
}

impl LockedChunk<'_> {
    /// Notes that rows may change, and that they may get other versions.
    fn expect_changes(&mut self, changes: Changes) {
        self.chunk.bodies.expect_changes();
        self.chunk.changes = self.chunk.changes.max(changes);
    }

    /// Calls `act` for every row of the chunk, with its index in the chunk.
    fn for_each_row(&mut self, mut act: impl FnMut(usize, &mut Box<EnvRow>)) {
        self.expect_changes(Changes::None);
        self.chunk.rows.iter_mut().enumerate().for_each(|(k, row)| act(k, row));
    }

    /// Loads every environment of the chunk into `workspace` in turn, and calls `act` with its index in the batch and
    /// the read buffer of the chunk. `act` does the steps, `steps` in number. With `steps` above 0, results of the last
    /// solve are restored only for diverged environments and for models with a history.
    fn for_each_env(
        &mut self,
        workspace: &mut SimEnv,
        steps: u32,
        mut act: impl FnMut(usize, &mut SimEnv, &mut Vec<f64>),
    ) {
        self.expect_changes(Changes::All);
        let Chunk { rows, read_values, .. } = &mut *self.chunk;
        for k in 0..rows.len() {
            // The next rows are fetched while this environment steps: first the row, then the arrays it points to.
            prefetch_after(rows, k, EnvRow::prefetch);
            let row = &mut rows[k];
            let lease = if steps > 0 { Lease::for_step(workspace, row) } else { Lease::new(workspace, row, true) };
            act(self.first + k, lease.workspace, read_values);
        }
    }
}

impl Chunks {
    /// Locks the chunk with index `c`.
    fn lock_chunk(&self, c: usize) -> LockedChunk<'_> {
        LockedChunk { first: c * self.chunk_size, chunk: lock(&self.chunks[c]) }
    }

    /// The shares, with counters of their own: reads do not wait for other reads.
    fn fresh_shares(&self) -> Vec<Share> {
        let fresh = |share: &Share| Share { next: AtomicUsize::new(share.chunks.start), chunks: share.chunks.clone() };
        self.shares.iter().map(fresh).collect()
    }

    /// Processes the share of `thread` among `shares`, then the remaining chunks of the following shares.
    fn process_shares(&self, shares: &[Share], thread: usize, mut job: impl FnMut(&mut LockedChunk)) {
        let (before, from) = shares.split_at(thread);
        for share in from.iter().chain(before) {
            loop {
                let c = share.next.fetch_add(1, Ordering::Relaxed);
                if c >= share.chunks.end {
                    break;
                }
                job(&mut self.lock_chunk(c));
            }
        }
    }
}
