//! Work with single environments: states to go back to, rollouts, properties of their own, shares of several processes.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod listings;
mod looked_at;
mod looks;
mod observers;
mod randomize;
mod rollout;
mod shard;
mod sizes;
mod snapshot;
mod worlds;
