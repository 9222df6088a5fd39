//! Contact forces on bodies: net, per pair, friction, where, and since when.

mod air_time;
mod cfg;
mod pairs;
mod sensor;

#[cfg(test)]
mod tests;

pub use cfg::ContactSensorCfg;
pub use sensor::ContactSensor;
