//! Batches of environments: the same bits however they are run, buffers that grow, environments that diverge, errors of
//! the engine, recompilation, and everything freed at the end.

mod determinism;
mod growth;
mod processes;
mod quarantine;
mod recompile;
mod sample_models;
mod support;
mod version;
