//! Contacts and sensors.

mod ball_image;
mod ball_in_valley;

mod coulomb_directions;
mod four_legs;
mod imu_pendulum;
mod imu_turntable;
mod joint_wrench;
mod moving_ranges;
mod scale;
mod sphere_depth;
mod time_of_contact;
mod turning_camera;
