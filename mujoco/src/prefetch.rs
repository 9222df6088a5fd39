//! Memory of an environment that is stepped next, asked for while another one is stepped.
//!
//! With many environments each has left the core's own cache when its turn comes, and a step reads it in an order that
//! the processor does not foresee: it would wait for most lines one after the other.

use super::data::Data;
use mujoco_sys as mj;
use std::mem::offset_of;

/// A line of the cache \[bytes\].
const LINE: usize = 64;

/// Of `mjData`'s buffer: the state, kinematics, inertias. More would push out what the present step needs \[bytes\].
const BUFFER: usize = 32 << 10;

/// Of its arena: contacts and the first constraint rows \[bytes\].
const ARENA: usize = 8 << 10;

/// The solver's statistics, most of `mjData` itself and hardly touched, end here on both lines of MuJoCo.
const AFTER_STATISTICS: usize = offset_of!(mj::mjData, solver_fwdinv);

/// Which caches the memory is to come to.
#[derive(Clone, Copy)]
enum Level {
    /// All: what is needed at once.
    First,
    /// The second and beyond: the first still serves the present step.
    Second,
}

/// Asks for the first `bytes` bytes from `start` on and waits for none of them.
fn ask(start: *const u8, bytes: usize, level: Level) {
    #[cfg(target_arch = "x86_64")]
    for offset in (0..bytes).step_by(LINE) {
        use core::arch::x86_64::{_MM_HINT_T0, _MM_HINT_T1, _mm_prefetch};
        let line = start.wrapping_add(offset).cast();
        match level {
            // SAFETY: a prefetch reads and changes no value, and faults at no address.
            Level::First => unsafe { _mm_prefetch::<_MM_HINT_T0>(line) },
            // SAFETY: likewise.
            Level::Second => unsafe { _mm_prefetch::<_MM_HINT_T1>(line) },
        }
    }
    // Elsewhere Rust has no stable prefetch.
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (start, bytes, level);
}

/// Asks for the memory of `values`, which should be few.
pub fn prefetch<T>(values: &[T]) {
    ask(values.as_ptr().cast(), size_of_val(values), Level::First);
}

/// The addresses where a step finds its data, kept apart from it: to follow its pointers would be to wait for them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Places {
    header: *const u8,
    buffer: *const u8,
    buffer_bytes: usize,
    arena: *const u8,
    arena_bytes: usize,
}

impl Places {
    /// Those of the data with this header.
    pub(super) fn of(header: &mj::mjData) -> Self {
        #[cfg(mj4)]
        let (arena, arena_bytes) = (header.arena, header.narena as usize);
        #[cfg(not(mj4))]
        let (arena, arena_bytes) = (header.stack, header.nstack as usize * size_of::<f64>());
        Self {
            header: std::ptr::from_ref(header).cast(),
            buffer: header.buffer.cast_const().cast(),
            buffer_bytes: (header.nbuffer as usize).min(BUFFER),
            arena: arena.cast_const().cast(),
            arena_bytes: arena_bytes.min(ARENA),
        }
    }
}

impl Data {
    /// Asks for what every step of this data reads first, counters and pointers, and waits for nothing.
    pub fn prefetch(&self) {
        let header = self.places().header;
        ask(header, 2 * LINE, Level::First);
        ask(header.wrapping_add(AFTER_STATISTICS), size_of::<mj::mjData>() - AFTER_STATISTICS, Level::First);
    }

    /// As [`prefetch`](Self::prefetch), and for the state and the work memory.
    pub fn prefetch_arrays(&self) {
        self.prefetch();
        let places = self.places();
        ask(places.buffer, places.buffer_bytes, Level::Second);
        ask(places.arena, places.arena_bytes, Level::Second);
    }

    /// How much [`prefetch_arrays`](Self::prefetch_arrays) asks for \[bytes\].
    pub fn prefetched_bytes(&self) -> usize {
        let places = self.places();
        size_of::<mj::mjData>() - AFTER_STATISTICS + places.buffer_bytes + places.arena_bytes
    }
}
