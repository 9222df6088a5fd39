//! Work with single environments: states to go back to, rollouts, properties of their own, shares of several processes.

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
