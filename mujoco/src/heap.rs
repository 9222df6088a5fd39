//! Memory of dropped environments.

/// Returns freed memory to the operating system (Linux with glibc; no effect elsewhere).
///
/// When a model is compiled again, all new environments are made before the old ones are dropped. The allocator would
/// keep the pages of the old ones, up to a third of the memory of the new ones.
pub fn trim_heap() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        unsafe extern "C" {
            fn malloc_trim(pad: usize) -> std::ffi::c_int;
        }
        // SAFETY: glibc's function, safe from any thread at any time; it touches no memory that is in use.
        unsafe { malloc_trim(0) };
    }
}
