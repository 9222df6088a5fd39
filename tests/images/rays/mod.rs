//! Ray casters in a simulation, held against MuJoCo's own rays and against closed forms.

mod cameras;
mod judge;
mod primitives;
mod scanner;
