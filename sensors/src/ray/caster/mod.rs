//! The ray caster: a sensor that measures distances along rays that move with a body.

mod alignment;
mod cfg;
mod order;
pub(crate) mod scan;
mod sensor;
mod summary;
mod targets;

pub use alignment::RayAlignment;
pub use cfg::RayCasterCfg;
pub use sensor::RayCaster;
pub use targets::HitTargets;

#[cfg(test)]
mod tests;
