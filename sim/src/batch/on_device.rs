//! Steps of a batch on a device.

use super::{Batch, Lease, lock};
use crate::capture::CaptureRequest;
use crate::device::{DeviceError, DeviceMirror, DevicePhysics, EnvRows};
use crate::env::Stage;
use crate::row::EnvRow;
use std::sync::{Mutex, PoisonError};

impl Batch {
    /// Makes a device step the environments, whose scene it has.
    pub(crate) fn set_device(&mut self, device: DeviceMirror) {
        self.device = Some(Mutex::new(device));
    }

    /// Takes the device that steps the environments, to give it to another batch.
    pub(crate) fn take_device(&mut self) -> Option<DeviceMirror> {
        self.device.take().map(|device| device.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// True if a device steps the environments.
    pub(crate) fn is_on_device(&self) -> bool {
        self.device.is_some()
    }

    /// Error of the device, after which all environments are frozen.
    pub(crate) fn device_failure(&self) -> Option<DeviceError> {
        self.device.as_ref().and_then(|device| lock(device).failure().cloned())
    }

    /// Calls `act` with the physics of the device; `None` without a device.
    pub(crate) fn with_device<T>(&self, act: impl FnOnce(&dyn DevicePhysics) -> T) -> Option<T> {
        self.device.as_ref().map(|device| act(lock(device).physics()))
    }

    /// Number of times buffers of the device grew.
    pub(super) fn device_growths(&self) -> u64 {
        self.device.as_ref().map_or(0, |device| lock(device).growths())
    }

    /// Does `count` MuJoCo steps on the device, if there is one, and captures the quantities of `capture` in the last one.
    /// Returns the number of steps that remain for the threads of this process.
    pub(super) fn step_on_device(&self, count: u32, capture: Option<&CaptureRequest>) -> u32 {
        // Nothing moves in a scene without degrees of freedom; a device may not support it.
        let Some(device) = self.device.as_ref().filter(|_| self.model.nv() > 0) else { return count };
        let mut device = lock(device);
        let mut left = count;
        while left > 0 {
            // Wrenches in link axes turn with the links, so they are computed again for every step.
            let block = if self.apply_wrenches() { 1 } else { left };
            left -= block;
            device.step(&self.model, block, capture.filter(|_| left == 0), self);
        }
        0
    }

    /// Writes wrenches and gravity compensation to the inputs of the rows that have some. Returns true if a wrench turns
    /// with a link.
    fn apply_wrenches(&self) -> bool {
        let mut turns = false;
        for chunk in &self.chunks.chunks {
            let mut chunk = lock(chunk);
            if chunk.rows.iter().all(|row| row.wrenches.is_none()) {
                continue;
            }
            chunk.expect_changes();
            for row in chunk.rows.iter_mut().filter(|row| row.wrenches.is_some()) {
                turns |= row.wrenches().has_link_axes();
                self.with_workspace(row.version, |workspace| {
                    let lease = Lease::new(workspace, row, true);
                    lease.workspace.reach(Stage::Kinematics);
                    lease.workspace.set_wrenches(|_| {});
                });
            }
        }
        turns
    }
}

impl Batch {
    /// Calls `visit` for the rows in order, on the calling thread: for all, or for those of changed chunks.
    fn visit_rows(&self, with_unchanged: bool, visit: &mut dyn FnMut(usize, &mut EnvRow)) {
        for (c, chunk) in self.chunks.chunks.iter().enumerate() {
            let mut chunk = lock(chunk);
            if with_unchanged || !chunk.is_on_device {
                chunk.expect_changes();
                let first = c * self.chunks.chunk_size;
                chunk.rows.iter_mut().enumerate().for_each(|(k, row)| visit(first + k, row));
            }
        }
    }
}

impl EnvRows for Batch {
    fn for_each(&self, visit: &mut dyn FnMut(usize, &mut EnvRow)) {
        self.visit_rows(true, visit);
    }

    fn for_each_changed(&self, visit: &mut dyn FnMut(usize, &mut EnvRow)) {
        self.visit_rows(false, visit);
    }

    fn set_unchanged(&self) {
        self.chunks.chunks.iter().for_each(|chunk| lock(chunk).is_on_device = true);
    }
}
