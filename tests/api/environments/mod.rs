//! Operations on single environments: snapshots, rollouts, properties per environment, shards of several processes.

mod listings;
mod observers;
mod randomize;
mod refused;
mod rollout;
mod shard;
mod sizes;
mod sizes_and_colors;
mod snapshot;
mod viewer_queries;
mod whole_models;
mod worlds;
