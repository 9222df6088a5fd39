//! The public API: robots, objects, drives, tasks and sensors, each against closed forms, MuJoCo or another way to the same answer.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod articulations;
mod batch;
mod drives;
mod env;
mod environments;
mod kinematics;
mod mjcf;
mod mjcf_robot;
mod objects;
mod recording;
mod robot;
mod scene;
mod sensors;
mod terrain;
