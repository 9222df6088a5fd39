//! Tasks: against loops over the plain API, closed forms, and themselves in other batches.

mod batches;
mod cart_pole;
mod checks;
mod closed_forms;
mod episodes;
mod mistakes;
mod observations;
mod tasks;
mod terms;
mod train_reach;
mod vector_env;
