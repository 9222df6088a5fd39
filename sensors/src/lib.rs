//! Sensors that have never heard of MuJoCo.
#![forbid(unsafe_code)]
