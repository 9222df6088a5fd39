//! The mutations of `cargo xtask mutate` by subject, and the tests that must fail.

mod mutation;
mod physics;
mod recording;
mod renderer;
mod robots;
mod sensors;
mod views;

pub(crate) use mutation::Mutation;

const LISTS: [&[Mutation]; 6] =
    [physics::PHYSICS, robots::ROBOTS, sensors::SENSORS, renderer::RENDERER, recording::RECORDING, views::VIEWS];

/// All mutations.
pub(crate) fn all() -> impl Iterator<Item = &'static Mutation> {
    LISTS.into_iter().flatten()
}
