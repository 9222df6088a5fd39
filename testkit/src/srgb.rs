//! The transfer function of sRGB.

/// sRGB value, 0 to 255, of linear light: the transfer function of the sRGB standard.
pub fn srgb(light: f64) -> f64 {
    255.0 * if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// Linear light of an sRGB value from 0 to 1.
pub fn linear(x: f32) -> f64 {
    let x = f64::from(x);
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}
