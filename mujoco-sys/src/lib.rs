//! Bindings of the MuJoCo found on the machine (2.2.2 or 4.x), generated when this crate is built. No logic.
//!
//! `fields` says how many rows and columns every array of `mjModel` and `mjData` has, read from MuJoCo's `mjxmacro.h`.
#![allow(unsafe_code, reason = "generated declarations of C functions and globals")]
#![allow(
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals,
    missing_docs,
    missing_debug_implementations,
    unused_variables,
    unreachable_pub,
    clippy::all,
    reason = "generated from C headers"
)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));

/// Every array of `mjModel` and `mjData` as a slice with the size that `mjxmacro.h` declares.
///
/// # Safety
/// All functions: `m` points to a model made by MuJoCo, `d` to a data made from a model of the same sizes, both alive
/// for `'a`; nothing writes (shared) or touches (`_mut`) the array during `'a`. Constraint and contact arrays hold
/// values only after the stage that fills them.
pub mod fields {
    unsafe fn slice<'a, T>(pointer: *const T, len: usize) -> &'a [T] {
        if len == 0 || pointer.is_null() { &[] } else { unsafe { std::slice::from_raw_parts(pointer, len) } }
    }

    unsafe fn slice_mut<'a, T>(pointer: *mut T, len: usize) -> &'a mut [T] {
        if len == 0 || pointer.is_null() { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(pointer, len) } }
    }

    /// An array of `mjModel`, as `model::each` lists them.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct ModelArray {
        /// MuJoCo's name.
        pub name: &'static str,
        /// Rust's name of the type of an element.
        pub kind: &'static str,
        /// Where in `mjModel` its pointer is.
        pub pointer: usize,
        /// Its size.
        pub bytes: usize,
    }

    include!(concat!(env!("OUT_DIR"), "/fields.rs"));
}
