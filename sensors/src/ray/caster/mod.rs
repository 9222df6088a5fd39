//! Ray caster: a sensor of distances along rays that move with a body.

mod alignment;
mod cfg;
mod sensor;

pub use alignment::RayAlignment;
pub use cfg::RayCasterCfg;
pub use sensor::RayCaster;

#[cfg(test)]
mod tests;
