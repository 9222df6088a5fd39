//! The ways in which `cargo xtask mutate` breaks the code, by subject, and the tests that have to notice.

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

/// All of them.
pub(crate) fn all() -> impl Iterator<Item = &'static Mutation> {
    LISTS.into_iter().flatten()
}
