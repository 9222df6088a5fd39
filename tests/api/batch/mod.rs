//! Batches of environments: determinism, growing buffers, limits of the system, diverged environments, errors of the engine,
//! recompilation, and freed resources.

mod determinism;
mod growth;
mod limits;
mod processes;
mod quarantine;
mod recompile;
mod sample_models;
mod shared_data;
mod support;
mod version;
