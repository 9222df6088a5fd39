//! Numerical guarantees of integrators and batches.

mod convergence;
pub(crate) mod double_pendulum;
mod free_rotation;
mod scenes;

mod batch_size;
mod bounded_energy;
mod frame_invariance;
mod galilean_invariance;
mod order_of_euler;
mod order_of_free_rotation;
mod order_of_implicit;
mod order_of_runge_kutta;
mod parts_of_an_update;
mod similarity;
mod substeps;
mod threads;
mod time_reversal;
