//! Drives: what a joint does when it is told to, law by law.

mod actuators;
mod damping;
mod export;
mod friction;
mod grip;
mod law;
mod limits;
mod mimic;
mod models_at_run_time;
mod modes;
mod native;
mod resistance;
mod robots;
mod run_time;
mod soft;
mod tutorial;
mod worlds;
