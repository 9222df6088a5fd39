//! Prefetching of the next environment's row while the previous environment is stepped.

/// Size of a cache line \[bytes\].
const CACHE_LINE_BYTES: usize = 64;

/// Prefetches the memory of `values`, which should be a short slice, without waiting for it. Has no effect on
/// processors other than x86-64.
pub fn prefetch<T>(values: &[T]) {
    #[cfg(target_arch = "x86_64")]
    for offset in (0..size_of_val(values)).step_by(CACHE_LINE_BYTES) {
        use core::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        let line = values.as_ptr().cast::<u8>().wrapping_add(offset).cast();
        // The second cache level: the first one still serves the current step.
        // SAFETY: a prefetch reads and changes no value, and faults at no address.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(line) };
    }
    // Rust has no stable prefetch for other architectures.
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, CACHE_LINE_BYTES);
}
