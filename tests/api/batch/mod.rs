//! Batches of environments: determinism, growing buffers, diverged environments, errors of the engine, recompilation,
//! and freed resources.

mod determinism;
mod growth;
mod processes;
mod quarantine;
mod recompile;
mod sample_models;
mod shared_data;
mod support;
mod version;
