//! Drives, limits and friction of joints.

mod variants;
mod wheel;

mod acceleration_drive;
mod armature;
mod dc_motor;
mod delayed_pd;
mod dry_friction;
mod force_limit;
mod gravity_compensation;
mod ideal_pd;
mod joint_limit;
mod mimic_ratio;
mod pinch_grip;
mod step_response;
mod velocity_drive;
mod viscous_damping;
