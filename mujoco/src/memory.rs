//! Memory of environments that are gone.

/// Gives freed memory back to the system. When a model is compiled again, all environments are made anew before the old
/// ones go; the allocator would keep the old ones' pages, as much as a third of the new ones'.
pub fn release_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        unsafe extern "C" {
            fn malloc_trim(pad: usize) -> std::ffi::c_int;
        }
        // SAFETY: glibc's function, safe from any thread at any time; it touches no memory that is in use.
        unsafe { malloc_trim(0) };
    }
}
