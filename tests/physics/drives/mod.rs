//! Drives, limits and friction of joints.
