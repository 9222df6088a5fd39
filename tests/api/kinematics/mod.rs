//! Kinematics of robots: poses, Jacobians and inverse kinematics, judged by MuJoCo and by closed forms.

mod arms;
mod batches;
mod chain;
mod forward;
mod jacobian;
mod limits;
mod mistakes;
mod mujocos_reader;
mod planar;
mod posture;
mod robots;
mod singular;
