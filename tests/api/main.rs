//! Tests of the public API: robots, objects, drives, tasks and sensors, each compared with closed forms, with MuJoCo or
//! with another method.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "output of tests")]
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod articulations;
mod batch;
mod configurations;
mod drives;
mod environments;
mod kinematics;
mod mjcf;
mod mjcf_robot;
mod objects;
mod recording;
mod robot;
mod scene;
mod sensors;
mod tasks;
mod terrain;
