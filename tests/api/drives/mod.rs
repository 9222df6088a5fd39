//! Drives: the response of a joint to its targets, law by law.

mod actuators;
mod export;
mod friction;
mod grip;
mod law;
mod native;
mod resistance;
mod robots;
mod run_time;
mod worlds;
