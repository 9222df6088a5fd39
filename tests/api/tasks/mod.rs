//! Tasks, compared with loops over the plain API, with closed forms, and with themselves in other batches.

mod autoreset;
mod batches;
mod bundled;
mod cart_pole;
mod checks;
mod closed_forms;
mod commands;
mod curricula;
mod episodes;
mod groups;
mod mistakes;
mod observations;
mod ready_made;
mod shared_state;
mod task_text;
mod terms;
mod train_reach;
mod vector_env;
mod velocity_terms;
