//! From linear light to the screen.
//!
//! Tone curve: light up to 0.7 is kept, above it bends smoothly towards 1: y = 0.7 + 0.3 k / (k + 0.3) with k = x - 0.7,
//! so highlights on white things do not clip. Then the sRGB transfer function, as a polynomial of √x that is within 0.2 of
//! 255 of the standard (square roots and products round the same on every machine; powers do not).

use crate::lanes::{F, Simd, max, min, select, splat};

/// Where the curve begins to bend.
const KNEE: f32 = 0.7;

/// The byte for a linear intensity, as a number in 0..=255.
#[inline(always)]
pub(crate) fn encode<S: Simd>(s: S, x: F<S>) -> F<S> {
    let x = max(x, splat(s, 0.0));
    let bright = x.simd_gt(splat(s, KNEE));
    let x = if bright.any_true() {
        let k = x - KNEE;
        let bent = k * (1.0 - KNEE) / (k + (1.0 - KNEE)) + KNEE;
        min(select(bright, bent, x), splat(s, 1.0))
    } else {
        x
    };
    to_srgb(s, x)
}

/// The sRGB byte for a linear intensity in 0..=1, without the tone curve, as a number in 0..=255.
#[inline(always)]
pub(crate) fn to_srgb<S: Simd>(s: S, x: F<S>) -> F<S> {
    let r = x.sqrt();
    let y = (((r * -0.309_826 + 0.843_371_8) * r - 0.945_305_94) * r + 1.448_028_3) * r - 0.037_015_604;
    // Near black the standard is a straight line.
    let y = select(x.simd_lt(splat(s, 0.003_130_8)), x * 12.92, y);
    min(max(y * 255.0 + 0.5, splat(s, 0.0)), splat(s, 255.0))
}

/// Linear light of sRGB bytes (0..=255), as a polynomial that is within 0.0005 of the standard.
#[inline(always)]
pub(crate) fn decode_bytes<S: Simd>(x: F<S>) -> F<S> {
    let x = x * (1.0 / 255.0);
    (((x * -0.156_114_5 + 0.615_823_9) * x + 0.494_052_83) * x + 0.045_749_872) * x
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
                    assert!((y - 0.5 - standard * 255.0).abs() < 0.25, "{x}: {y} {standard}");
                }
            }
            assert!(last < 256.0);
        }
    }
}
