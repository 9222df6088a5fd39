//! States of robots: root link, joints, the bundled quadruped.

mod quadruped;
mod root;
mod standing;
mod state;
mod wrenches;
