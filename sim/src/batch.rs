//! N environments on worker threads, bit-identical for any number of threads and environments.
//!
//! Environments are grouped in chunks, and every thread owns a share of the chunks. A thread first takes the chunks of
//! its own share, so that an environment mostly stays in the cache of one core. The thread then helps with the
//! remaining shares. The assignment of threads cannot change results, because environments share only the immutable
//! model.

use crate::batch_error::BatchError;
use crate::capture::CaptureRequest;
use crate::drive::table::{DriveState, DriveTable};
use crate::env::SimEnv;
use kinetoscope_exec::ThreadPool;
use kinetoscope_mujoco::Model;
use ndarray::{Array2, Array3, Axis, aview1};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Consecutive environments that one thread processes together.
struct Chunk {
    envs: Vec<SimEnv>,
    /// Values read by [`Batch::step_and_read`], environment by environment.
    read_values: Vec<f64>,
}

/// A chunk that a thread has locked.
struct LockedChunk<'a> {
    /// Index, in the batch, of the first environment of the chunk.
    first: usize,
    chunk: MutexGuard<'a, Chunk>,
    /// The chunk that the thread will probably take next, for prefetching; `None` for the last chunk.
    next: Option<&'a Mutex<Chunk>>,
    /// True if environments leave the cache between their steps.
    exceeds_cache: bool,
}

/// Batch size above which environments are assumed to leave the cache between their steps \[bytes\]. Measured with 64
/// to 1024 humanoids and arms on 2 MiB of cache per core: prefetching all arrays of the next environment makes a step 5
/// % slower at 3 MB and 7 % faster at 11 MB.
const CACHE_BYTES: usize = 8 << 20;

/// N environments of one model, stepped in parallel.
#[derive(Debug)]
pub struct Batch {
    chunks: Chunks,
    pool: ThreadPool,
    model: Model,
    num_envs: usize,
}

/// The environments in chunks, with one share of the chunks per thread.
struct Chunks {
    chunks: Vec<Mutex<Chunk>>,
    chunk_size: usize,
    /// True if environments leave the cache between their steps.
    exceeds_cache: bool,
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
    /// A number is zero, or memory or threads cannot be allocated.
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
        // Several chunks per thread balance environments of unequal cost. More than 4 environments per chunk bring no
        // gain, and threads wait longer for the last chunk of a step.
        let chunk_size = num_envs.div_ceil(threads * 8).clamp(1, 4);
        let drives = DriveState::new(drives, model);
        let mut bytes = 0;
        let mut chunks = Vec::with_capacity(num_envs.div_ceil(chunk_size));
        for first in (0..num_envs).step_by(chunk_size) {
            let chunk: Result<Vec<SimEnv>, BatchError> = (first..(first + chunk_size).min(num_envs))
                .map(|index| {
                    SimEnv::with_drives(model, drives.clone()).map_err(|error| BatchError::Environment { index, error })
                })
                .collect();
            let envs = chunk?;
            bytes += envs.iter().map(|env| env.data().prefetched_bytes()).sum::<usize>();
            chunks.push(Mutex::new(Chunk { envs, read_values: Vec::new() }));
        }
        let count = chunks.len();
        let threads = threads.min(count);
        let share = |t: usize| t * count / threads..(t + 1) * count / threads;
        pool.start(threads).map_err(|error| BatchError::Thread(error.to_string()))?;
        let shares = (0..threads).map(|t| Share { next: AtomicUsize::new(0), chunks: share(t) }).collect();
        let chunks = Chunks { chunks, chunk_size, exceeds_cache: bytes > CACHE_BYTES, shares };
        Ok(Self { chunks, pool, model: model.clone(), num_envs })
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
        self.run_chunks(|taken| taken.for_each_env(|_, env, _| env.step(count)));
    }

    /// Steps as [`step`](Self::step) does, and captures quantities of the last step in all environments.
    pub(crate) fn step_and_capture(&mut self, count: u32, capture: CaptureRequest) {
        self.run_chunks(|taken| taken.for_each_env(|_, env, _| env.step_and_capture(count, Some(&capture))));
    }

    /// Captures the solution of the current state in the environments `chosen`.
    pub(crate) fn capture_present(&mut self, chosen: &[usize], capture: CaptureRequest) {
        let mut mask = vec![false; self.num_envs];
        chosen.iter().for_each(|&env| mask[env] = true);
        self.run(|i, env| {
            if mask[i] {
                env.capture_current(&capture);
            }
        });
    }

    /// Does `count` MuJoCo steps in every environment and copies the slices that `read` returns to `outs`, one row per
    /// environment: `batch.step_and_read(1, |env| [env.data().qpos(), env.data().qvel()], [&mut qpos, &mut qvel])`.
    ///
    /// The thread that stepped an environment reads it immediately, while its data is in that core's cache. A separate
    /// read of 1024 humanoids after the step takes 2 % of the step time.
    ///
    /// # Panics
    /// The sizes of `outs` and of the slices differ, or `read` panics.
    #[track_caller]
    pub fn step_and_read<const K: usize>(
        &mut self,
        count: u32,
        read: impl for<'e> Fn(&'e SimEnv) -> [&'e [f64]; K] + Sync,
        mut outs: [&mut [f64]; K],
    ) {
        let widths = self.read(0, |env| read(env).map(<[f64]>::len));
        for (out, width) in outs.iter().zip(widths) {
            assert!(out.len() == self.num_envs * width, "{} numbers for {} x {width}", out.len(), self.num_envs);
        }
        let step = |env: &mut SimEnv, take: &mut dyn FnMut(usize, &[f64])| {
            env.step(count);
            for (k, (values, width)) in read(env).into_iter().zip(widths).enumerate() {
                assert!(values.len() == width, "{} numbers from one environment, {width} from another", values.len());
                take(k, values);
            }
        };
        if self.threads() == 1 {
            // A single thread writes directly to the outputs.
            for c in 0..self.chunks.chunks.len() {
                self.chunks.lock_chunk(c).for_each_env(|index, env, _| {
                    step(env, &mut |k, values| {
                        outs[k][index * widths[k]..(index + 1) * widths[k]].copy_from_slice(values);
                    });
                });
            }
            return;
        }
        let job = |taken: &mut LockedChunk| {
            taken.chunk.read_values.clear();
            taken.for_each_env(|_, env, read| step(env, &mut |_, values| read.extend_from_slice(values)));
        };
        let mut copied = vec![false; self.chunks.chunks.len()];
        let mut copy = |first: usize, chunk: &Chunk| {
            let mut values = &chunk.read_values[..];
            for index in first..first + chunk.envs.len() {
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

    /// Runs `job` once for every environment, in parallel, with the index of the environment.
    ///
    /// # Panics
    /// `job` panics.
    pub fn run(&mut self, job: impl Fn(usize, &mut SimEnv) + Sync) {
        self.run_chunks(|taken| taken.for_each_env(|i, env, _| job(i, env)));
    }

    fn run_chunks(&mut self, job: impl Fn(&mut LockedChunk) + Sync) {
        self.run_chunks_then(job, |_| {});
    }

    /// Runs `job` once for every chunk, in parallel. Calls `then` after each chunk that the calling thread has
    /// processed.
    fn run_chunks_then(&mut self, job: impl Fn(&mut LockedChunk) + Sync, then: impl FnMut(&LockedChunk) + Send) {
        let chunks = &self.chunks;
        for share in &chunks.shares {
            share.next.store(share.chunks.start, Ordering::Relaxed);
        }
        // No contention: only slot 0, the calling thread, takes this lock.
        let then = Mutex::new(then);
        self.pool.run(chunks.shares.len(), |slot| {
            if slot == 0 {
                let then = &mut *lock(&then);
                chunks.process_shares(slot, |taken| {
                    job(taken);
                    then(taken);
                });
            } else {
                chunks.process_shares(slot, &job);
            }
        });
    }

    /// Reads environment `index`.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub fn read<T>(&self, index: usize, read: impl FnOnce(&SimEnv) -> T) -> T {
        self.with_env(index, |env| {
            env.forward_if_dirty();
            read(env)
        })
    }

    /// Reads all environments in order, on the calling thread.
    pub fn for_each(&self, mut read: impl FnMut(usize, &SimEnv)) {
        for (c, chunk) in self.chunks.chunks.iter().enumerate() {
            for (i, env) in lock(chunk).envs.iter_mut().enumerate() {
                env.forward_if_dirty();
                read(c * self.chunks.chunk_size + i, env);
            }
        }
    }

    /// Reads K numbers of each environment, shape (N, K).
    pub(crate) fn gather_rows<const K: usize>(&self, mut read: impl FnMut(&SimEnv) -> [f64; K]) -> Array2<f64> {
        let mut rows = Vec::with_capacity(self.num_envs);
        self.for_each(|_, env| rows.push(read(env)));
        rows.into()
    }

    /// Reads a value of each environment and each of `items`, shape (N, items).
    pub(crate) fn gather<I, T>(&self, items: &[I], read: impl Fn(&SimEnv, &I) -> T) -> Array2<T>
    where
        T: Copy + Default,
    {
        let mut values = Array2::default((self.num_envs, items.len()));
        self.for_each(|env_id, env| {
            for (value, item) in values.row_mut(env_id).iter_mut().zip(items) {
                *value = read(env, item);
            }
        });
        values
    }

    /// Reads K numbers of each environment and each of `items`, shape (N, items, K).
    pub(crate) fn gather_rows_of<I, const K: usize>(
        &self,
        items: &[I],
        read: impl Fn(&SimEnv, &I) -> [f64; K],
    ) -> Array3<f64> {
        let mut values = Array3::zeros((self.num_envs, items.len(), K));
        self.for_each(|env_id, env| {
            for (mut row, item) in values.index_axis_mut(Axis(0), env_id).rows_mut().into_iter().zip(items) {
                row.assign(&aview1(&read(env, item)));
            }
        });
        values
    }

    /// Writes to environment `index`.
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub fn write<T>(&mut self, index: usize, write: impl FnOnce(&mut SimEnv) -> T) -> T {
        self.with_env(index, |env| {
            env.forward_if_dirty();
            write(env)
        })
    }

    /// Accesses environment `index` without its deferred forward pass: the data may be out of date
    /// ([`SimEnv::forward_if_dirty`]).
    ///
    /// # Panics
    /// `index` is not smaller than `num_envs`.
    #[track_caller]
    pub(crate) fn with_env<T>(&self, index: usize, edit: impl FnOnce(&mut SimEnv) -> T) -> T {
        assert!(index < self.num_envs, "environment {index} of {}", self.num_envs);
        let mut chunk = lock(&self.chunks.chunks[index / self.chunks.chunk_size]);
        edit(&mut chunk.envs[index % self.chunks.chunk_size])
    }
}

impl LockedChunk<'_> {
    /// Calls `act` for every environment of the chunk, with its index and the read buffer of the chunk.
    fn for_each_env(&mut self, mut act: impl FnMut(usize, &mut SimEnv, &mut Vec<f64>)) {
        let Chunk { envs, read_values } = &mut *self.chunk;
        for i in 0..envs.len() {
            // Prefetch the next environment while this one steps.
            if let Some(next) = envs.get(i + 1) {
                next.prefetch(self.exceeds_cache);
            } else if let Some(next) = self.next.and_then(|next| next.try_lock().ok()) {
                next.envs.iter().take(1).for_each(|env| env.prefetch(self.exceeds_cache));
            }
            envs[i].forward_if_dirty();
            act(self.first + i, &mut envs[i], read_values);
        }
    }
}

impl Chunks {
    /// Locks the chunk with index `c`.
    fn lock_chunk(&self, c: usize) -> LockedChunk<'_> {
        LockedChunk {
            first: c * self.chunk_size,
            chunk: lock(&self.chunks[c]),
            next: self.chunks.get(c + 1),
            exceeds_cache: self.exceeds_cache,
        }
    }

    /// Processes the share of `thread`, then the remaining chunks of the following shares.
    fn process_shares(&self, thread: usize, mut job: impl FnMut(&mut LockedChunk)) {
        let (before, from) = self.shares.split_at(thread);
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

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_mujoco as mj;

    const PENDULUM: &str = r#"<mujoco><worldbody><body><joint name="j" type="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 1 0 0" size="0.1"/></body></worldbody></mujoco>"#;

    fn pendulums(envs: usize, threads: usize) -> Batch {
        let model = mj::compile(PENDULUM, &[]).expect("compiles").into_model();
        let mut batch = Batch::new(&model, &Arc::default(), envs, threads, ThreadPool::new()).expect("small");
        batch.run(|i, env| env.write(|data| data.qvel_mut()[0] = i as f64));
        batch
    }

    #[test]
    fn step_and_read() {
        // Slow down the calling thread, which would otherwise process all chunks alone.
        let caller = std::thread::current().id();
        for (envs, threads) in [(1, 1), (3, 8), (37, 3)] {
            let mut batch = pendulums(envs, threads);
            let (mut qpos, mut qvel) = (vec![f64::NAN; envs], vec![f64::NAN; envs]);
            batch.step_and_read(
                7,
                move |env| {
                    if std::thread::current().id() == caller {
                        std::thread::sleep(std::time::Duration::from_millis(1));
                    }
                    [env.data().qpos(), env.data().qvel()]
                },
                [&mut qpos, &mut qvel],
            );
            let mut other = pendulums(envs, 1);
            other.step(7);
            for b in [&batch, &other] {
                b.for_each(|i, env| assert_eq!((env.data().qpos()[0], env.data().qvel()[0]), (qpos[i], qvel[i])));
            }
        }
    }

    #[test]
    fn beyond_the_cache() {
        let (mut many, mut few) = (pendulums(1000, 3), pendulums(10, 1));
        assert!(many.chunks.exceeds_cache && !few.chunks.exceeds_cache);
        many.step(7);
        few.step(7);
        let mut expected = Vec::new();
        few.for_each(|_, env| expected.push(env.data().qpos()[0].to_bits()));
        many.for_each(|i, env| {
            if let Some(&bits) = expected.get(i) {
                assert_eq!(env.data().qpos()[0].to_bits(), bits);
            }
            assert_eq!(env.steps(), 7);
        });
    }

    #[test]
    #[should_panic(expected = "5 numbers for 3 x 1")]
    fn wrong_size() {
        pendulums(3, 1).step_and_read(1, |env| [env.data().qpos()], [&mut [0.0; 5]]);
    }
}
