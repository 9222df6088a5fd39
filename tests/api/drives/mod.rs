//! Drives: what a joint does when it is commanded, law by law.

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
