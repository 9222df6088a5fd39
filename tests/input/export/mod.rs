//! `SimulationManager::dump`: what is written loads in plain MuJoCo, is the same robot, and is the same text every time.

mod composite;
mod dump;
mod golden;
mod robots;
