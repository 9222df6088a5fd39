//! COLLADA.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| kinetoscope_fuzz::mesh("input.dae", bytes));
