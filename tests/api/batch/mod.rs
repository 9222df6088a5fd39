//! Batches of environments: the same bits however they are run, buffers that grow, environments that diverge, errors of
//! the engine, recompilation, and everything freed at the end.

mod carry_over;
mod child;
mod determinism;
mod efforts;
mod engine_errors;
mod growth;
mod leaks;
mod quarantine;
mod sample_models;
mod sparse;
mod support;
mod version;
