//! Operations on single environments: snapshots, rollouts, properties per environment, shards of several processes.

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
