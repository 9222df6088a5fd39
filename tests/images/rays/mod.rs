//! Ray casters in a simulation, against MuJoCo's own rays and closed forms.

mod cameras;
pub(crate) mod judge;
mod primitives;
mod scanner;
