//! Contact sensor: net forces, forces by filter, friction, contact points and air times.

mod air_time;
mod cfg;
mod pairs;
mod sensor;

#[cfg(test)]
mod tests;

pub use cfg::ContactSensorCfg;
pub use sensor::ContactSensor;
