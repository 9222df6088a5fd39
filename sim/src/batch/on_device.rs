//! Steps of a batch on a device.
//!
//! After a step, rows are behind the device. Every access to rows first calls [`Batch::catch_up`] with the part of the
//! rows that it needs, on the calling thread and before it locks a chunk. So a closure that holds the lock of a chunk must
//! not read more of the batch than this part.

use super::{Batch, Chunk, Lease, LockedChunk, lock};
use crate::capture::CaptureRequest;
use crate::device::{Changes, ChunkRows, DeviceError, DeviceMirror, DevicePhysics, EnvRows};
use crate::env::Stage;
use crate::row::{RowPart, StateArray, StoredRow};
use ndarray::Array2;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError};

/// Largest number of environments that the calling thread visits alone: waking threads costs more.
const FEW_ENVS: usize = 32;

/// Device that steps the environments of a batch.
#[derive(Debug)]
pub(super) struct OnDevice {
    mirror: Mutex<DeviceMirror>,
    /// [`DeviceMirror::current`], for readers that hold the lock of a chunk. It only falls in steps.
    current: AtomicU8,
}

impl OnDevice {
    /// Calls `act` with the locked mirror, and updates `current`.
    fn with_mirror(&self, act: impl FnOnce(&mut DeviceMirror)) {
        let mirror = &mut *lock(&self.mirror);
        act(mirror);
        self.current.store(mirror.current() as u8, Ordering::Release);
    }
}

impl Batch {
    /// Makes a device step the environments, whose scene it has. All rows are sent before the next step.
    pub(crate) fn set_device(&mut self, device: DeviceMirror) {
        for chunk in &self.chunks.chunks {
            let mut chunk = lock(chunk);
            chunk.changes = Changes::All;
            chunk.sent = Default::default();
        }
        let current = AtomicU8::new(device.current() as u8);
        self.device = Some(OnDevice { mirror: Mutex::new(device), current });
    }

    /// Takes the device that steps the environments, to give it to another batch.
    pub(crate) fn take_device(&mut self) -> Option<DeviceMirror> {
        self.catch_up(RowPart::All);
        self.device.take().map(|device| device.mirror.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// True if a device steps the environments.
    pub(crate) fn is_on_device(&self) -> bool {
        self.device.is_some()
    }

    /// Error of the device, after which all environments are frozen.
    pub(crate) fn device_failure(&self) -> Option<DeviceError> {
        self.device.as_ref().and_then(|device| lock(&device.mirror).failure().cloned())
    }

    /// Calls `act` with the physics of the device; `None` without a device.
    pub(crate) fn with_device<T>(&self, act: impl FnOnce(&dyn DevicePhysics) -> T) -> Option<T> {
        self.device.as_ref().map(|device| act(lock(&device.mirror).physics()))
    }

    /// Number of times buffers of the device grew.
    pub(super) fn device_growths(&self) -> u64 {
        self.device.as_ref().map_or(0, |device| lock(&device.mirror).growths())
    }

    /// Brings all rows up to date with the device as far as `part`. The caller must not hold a chunk, unless a call before
    /// did this.
    pub(super) fn catch_up(&self, part: RowPart) {
        if let Some(device) = &self.device
            && device.current.load(Ordering::Acquire) < part as u8
        {
            device.with_mirror(|mirror| mirror.receive(&self.model, part, self));
        }
    }

    /// Reads numbers of an array of the state as [`gather_state`](Self::gather_state) does, without bringing rows up to
    /// date. `None` without a device, if it fails, or if the rows are up to date.
    pub(super) fn gather_on_device<I: Sync>(
        &self,
        array: StateArray,
        items: &[I],
        place: &(impl Fn(&I) -> usize + Sync),
    ) -> Option<Array2<f64>> {
        let is_behind = |device: &&OnDevice| device.current.load(Ordering::Acquire) < RowPart::All as u8;
        let device = self.device.as_ref().filter(is_behind)?;
        let mirror = &mut *lock(&device.mirror);
        let numbers = mirror.read_state(&self.model, array).ok()?;
        let (width, model) = (numbers.len() / self.num_envs, &self.model);
        let mut values = Array2::zeros((self.num_envs, items.len()));
        self.in_chunks(RowPart::Inputs, values.as_slice_mut()?, |_, taken, out| {
            for (k, row) in taken.chunk.rows.iter().enumerate() {
                let out = &mut out[k * items.len()..(k + 1) * items.len()];
                // The device steps on without a diverged environment.
                if taken.chunk.sent.has_state(k) {
                    let numbers = &numbers[(taken.first + k) * width..][..width];
                    out.iter_mut().zip(items).for_each(|(to, item)| *to = f64::from(numbers[place(item)]));
                } else {
                    let row = StoredRow { row, model };
                    out.iter_mut().zip(items).for_each(|(to, item)| *to = array.of(&row)[place(item)]);
                }
            }
        });
        Some(values)
    }

    /// Does `count` MuJoCo steps on the device, if there is one, and captures the quantities of `capture` in the last one.
    /// Returns the number of steps that remain for the threads of this process.
    pub(super) fn step_on_device(&self, count: u32, capture: Option<&CaptureRequest>) -> u32 {
        // Nothing moves in a scene without degrees of freedom; a device may not support it.
        let Some(device) = self.device.as_ref().filter(|_| self.model.nv() > 0) else { return count };
        let mut left = count;
        while left > 0 {
            // Wrenches in link axes turn with the links, so they are computed again for every step.
            let block = if self.apply_wrenches() { 1 } else { left };
            left -= block;
            device.with_mirror(|mirror| mirror.step(&self.model, block, capture.filter(|_| left == 0), self));
        }
        0
    }

    /// Writes wrenches and gravity compensation to the inputs of the rows that have some. Returns true if a wrench turns
    /// with a link.
    fn apply_wrenches(&self) -> bool {
        let mut any = false;
        for chunk in &self.chunks.chunks {
            let mut chunk = lock(chunk);
            if chunk.changes > Changes::None {
                chunk.has_wrenches = chunk.rows.iter().any(|row| row.wrenches.is_some());
            }
            any |= chunk.has_wrenches;
        }
        if !any {
            return false;
        }
        let turns = AtomicBool::new(false);
        self.run_chunks(|workspace, taken| {
            if !taken.chunk.has_wrenches {
                return;
            }
            taken.expect_changes(Changes::All);
            for row in taken.chunk.rows.iter_mut().filter(|row| row.wrenches.is_some()) {
                turns.fetch_or(row.wrenches().has_link_axes(), Ordering::Relaxed);
                let lease = Lease::new(workspace, row, true);
                lease.workspace.reach(Stage::Kinematics);
                lease.workspace.set_wrenches(|_| {});
            }
        });
        turns.into_inner()
    }
}

impl Chunk {
    /// The rows of the chunk, whose first environment is `first`. Motion of bodies that was read is no longer current.
    fn device_rows(&mut self, first: usize) -> ChunkRows<'_> {
        self.bodies.expect_changes();
        ChunkRows { first, rows: &mut self.rows, changes: &mut self.changes, sent: &mut self.sent }
    }
}

impl EnvRows for Batch {
    fn visit(&self, visit: &(dyn Fn(ChunkRows<'_>) + Sync)) {
        let visit = |taken: &mut LockedChunk<'_>| visit(taken.chunk.device_rows(taken.first));
        let slots = if self.num_envs <= FEW_ENVS { 1 } else { self.threads() };
        let shares = self.chunks.fresh_shares();
        self.pool.run(slots, |slot| self.chunks.process_shares(&shares, slot, visit));
    }

    fn visit_changed(&self, visit: &mut dyn FnMut(ChunkRows<'_>)) {
        for (c, chunk) in self.chunks.chunks.iter().enumerate() {
            let mut chunk = lock(chunk);
            if chunk.changes > Changes::None {
                visit(chunk.device_rows(c * self.chunks.chunk_size));
            }
        }
    }
}
