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
    unreachable_pub,
    clippy::all,
    reason = "generated from C headers"
)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));

/// Rows and columns of the arrays of `mjModel` and `mjData`.
pub mod fields {
    /// One array: its name and the C expressions for its size.
    #[derive(Clone, Copy, Debug)]
    pub struct Field {
        /// Name in the C struct.
        pub name: &'static str,
        /// Number of rows: a size field of `mjModel` or `mjData`.
        pub rows: &'static str,
        /// Number of columns: a number, a constant or a size field.
        pub cols: &'static str,
    }

    include!(concat!(env!("OUT_DIR"), "/fields.rs"));
}
