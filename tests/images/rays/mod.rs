//! Ray casters in a simulation, compared with MuJoCo's rays and with closed forms.

mod cameras;
pub(crate) mod mujoco_rays;
mod primitives;
mod scanner;
