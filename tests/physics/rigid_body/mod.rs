//! Single rigid bodies, and several bodies in contact.

mod incline;
pub(crate) mod soft_contact;

mod asymmetric_top;
mod billiards;
mod bowling_ball;
mod center_of_percussion;
mod conveyor;
mod conveyor_on_the_ground;
mod drag;
pub(crate) mod dzhanibekov;
mod elastic_bounce;
mod free_fall;
mod friction_threshold;
mod newtons_cradle;
mod projectile;
mod rest_depth;
mod rolling_cylinder;
mod rolling_shell;
mod rolling_sphere;
pub(crate) mod sliding_block;
mod spinning_top;
mod stack;
mod stick_creep;
mod tilted_inertia;
mod tipping;
mod tumbling_projectile;
mod two_body_spring;
