//! Prefetching of an environment's memory while the previous environment is stepped.
//!
//! With many environments, the core's own caches have dropped each one when its turn comes. A step reads memory in an
//! order that the processor does not predict, so it would wait for most cache lines one after the other.

use super::data::Data;
use mujoco_sys as mj;
use std::mem::offset_of;

/// Size of a cache line \[bytes\].
const CACHE_LINE_BYTES: usize = 64;

/// Prefetched part of `mjData`'s buffer: state, kinematics, inertias \[bytes\]. More would evict data of the current
/// step.
const BUFFER_BYTES: usize = 32 << 10;

/// Prefetched part of the arena: contacts and the first constraint rows \[bytes\].
const ARENA_BYTES: usize = 8 << 10;

/// End of the solver's statistics, which fill most of `mjData` itself and are rarely accessed (2.2.2 and 4.x).
const STATISTICS_END: usize = offset_of!(mj::mjData, solver_fwdinv);

/// Cache levels that memory is prefetched into.
#[derive(Clone, Copy)]
enum CacheLevel {
    /// All levels: the memory is needed at once.
    First,
    /// The second level and beyond: the first level still serves the current step.
    Second,
}

/// Prefetches `bytes` bytes from `start` without waiting for them.
fn prefetch_bytes(start: *const u8, bytes: usize, level: CacheLevel) {
    #[cfg(target_arch = "x86_64")]
    for offset in (0..bytes).step_by(CACHE_LINE_BYTES) {
        use core::arch::x86_64::{_MM_HINT_T0, _MM_HINT_T1, _mm_prefetch};
        let line = start.wrapping_add(offset).cast();
        match level {
            // SAFETY: a prefetch reads and changes no value, and faults at no address.
            CacheLevel::First => unsafe { _mm_prefetch::<_MM_HINT_T0>(line) },
            // SAFETY: likewise.
            CacheLevel::Second => unsafe { _mm_prefetch::<_MM_HINT_T1>(line) },
        }
    }
    // Rust has no stable prefetch for other architectures.
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (start, bytes, level);
}

/// Prefetches the memory of `values`, which should be a short slice, without waiting for it. Has no effect on
/// processors other than x86-64.
pub fn prefetch<T>(values: &[T]) {
    prefetch_bytes(values.as_ptr().cast(), size_of_val(values), CacheLevel::First);
}

/// Addresses of the memory that a step reads. They are stored outside of the data, because following its pointers would
/// wait for that memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct PrefetchAddresses {
    header: *const u8,
    buffer: *const u8,
    buffer_bytes: usize,
    arena: *const u8,
    arena_bytes: usize,
}

impl PrefetchAddresses {
    /// Addresses of the data with this header.
    pub(super) fn new(header: &mj::mjData) -> Self {
        #[cfg(mj4)]
        let (arena, arena_bytes) = (header.arena, header.narena as usize);
        #[cfg(not(mj4))]
        let (arena, arena_bytes) = (header.stack, header.nstack as usize * size_of::<f64>());
        Self {
            header: std::ptr::from_ref(header).cast(),
            buffer: header.buffer.cast_const().cast(),
            buffer_bytes: (header.nbuffer as usize).min(BUFFER_BYTES),
            arena: arena.cast_const().cast(),
            arena_bytes: arena_bytes.min(ARENA_BYTES),
        }
    }
}

impl Data {
    /// Prefetches the counters and pointers that every step of this data reads first, without waiting for them. Has no
    /// effect on processors other than x86-64.
    pub fn prefetch(&self) {
        let header = self.prefetch_addresses().header;
        prefetch_bytes(header, 2 * CACHE_LINE_BYTES, CacheLevel::First);
        prefetch_bytes(
            header.wrapping_add(STATISTICS_END),
            size_of::<mj::mjData>() - STATISTICS_END,
            CacheLevel::First,
        );
    }

    /// Prefetches the same memory as [`prefetch`](Self::prefetch), the first 32 KiB of the arrays and the first 8 KiB
    /// of the arena (2.2.2: stack).
    pub fn prefetch_arrays(&self) {
        self.prefetch();
        let places = self.prefetch_addresses();
        prefetch_bytes(places.buffer, places.buffer_bytes, CacheLevel::Second);
        prefetch_bytes(places.arena, places.arena_bytes, CacheLevel::Second);
    }

    /// Size of the memory that [`prefetch_arrays`](Self::prefetch_arrays) prefetches \[bytes\].
    pub fn prefetched_bytes(&self) -> usize {
        let places = self.prefetch_addresses();
        size_of::<mj::mjData>() - STATISTICS_END + places.buffer_bytes + places.arena_bytes
    }
}
