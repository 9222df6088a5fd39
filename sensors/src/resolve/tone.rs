//! From linear light to the screen.
//!
//! Tone curve: light up to 0.7 is kept, above it bends smoothly towards 1: y = 0.7 + 0.3 k / (k + 0.3) with k = x - 0.7,
//! so highlights on white things do not clip. Then the sRGB transfer function, as 0.66200 √x + 0.68412 ∜x - 0.32358 ⁸√x -
//! 0.02254 x, which is within one step of 255 of the standard and needs only square roots (they round the same on
//! every machine; powers do not).

use crate::lanes::{F, Simd, max, min, select, splat};

/// Where the curve begins to bend.
const KNEE: f32 = 0.7;

/// The byte for a linear intensity, as a number in 0..=255.
#[inline(always)]
pub(crate) fn encode<S: Simd>(s: S, x: F<S>) -> F<S> {
    let x = max(x, splat(s, 0.0));
    let k = x - KNEE;
    let bent = k * (1.0 - KNEE) / (k + (1.0 - KNEE)) + KNEE;
    let x = min(select(x.simd_gt(splat(s, KNEE)), bent, x), splat(s, 1.0));
    let a = x.sqrt();
    let b = a.sqrt();
    let c = b.sqrt();
    let y = a * 0.662_002_7 + b * 0.684_122_1 - c * 0.323_583_6 - x * 0.022_541_147;
    // Near black the standard is a straight line.
    let y = select(x.simd_lt(splat(s, 0.003_130_8)), x * 12.92, y);
    min(max(y * 255.0 + 0.5, splat(s, 0.0)), splat(s, 255.0))
}

/// A screen colour as linear light.
pub(crate) fn decode(c: [f32; 3]) -> [f32; 3] {
    c.map(scene::material::decode_srgb)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::levels;

    #[test]
    fn encoding_is_srgb_below_the_knee_and_monotonic() {
        for level in levels() {
            let mut last = 0.0;
            for k in 0..4000 {
                let x = k as f32 / 1000.0;
                let y = crate::lanes::at_level!(level, s => encode(s, splat(s, x)).array()[3]);
                assert!(y >= last, "{x}");
                last = y;
                if x < KNEE && y < 256.0 {
                    let standard = if x <= 0.0031308 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
                    assert!((y - 0.5 - standard * 255.0).abs() < 1.0, "{x}: {y} {standard}");
                }
            }
            assert!(last < 256.0);
        }
    }
}
