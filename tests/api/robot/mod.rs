//! Robots as a whole: state, forces on links, root link, joints, the bundled quadruped.

mod lowest;
mod quadruped;
mod state;
mod wrenches;

/// Number of environments.
const ENVS: usize = 3;
