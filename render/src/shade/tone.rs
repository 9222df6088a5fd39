//! Conversion of linear light for the screen: a tone curve, then the sRGB transfer function. The transfer function is a
//! polynomial of √x. It differs from the standard by at most 0.2 on the scale 0..=255. Unlike powers, square roots and
//! products round the same on every machine.

use crate::simd::{F, Scalar, Simd, max, min, select, splat};
use serde::{Deserialize, Serialize};

/// Tone curve: maps linear light to the range of a screen, up to 1, before the sRGB transfer function. x is linear
/// light; 1 is a white surface in full light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToneCurve {
    /// x up to 0.7; above, it bends smoothly towards 1, so that highlights on white surfaces do not clip: 0.7 + 0.3 k /
    /// (k + 0.3) with k = x - 0.7. With [`LightingSpace::Display`](kinetoscope_scene::LightingSpace::Display), whose sums end at
    /// 1, it is [`Clip`](Self::Clip), except for path-traced frames.
    #[default]
    Soft,
    /// x up to 1, and 1 above: proportional to light where it does not saturate.
    Clip,
    /// Like film, with a toe and a shoulder: x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), at most 1. Source:
    /// Narkowicz, ACES filmic tone mapping curve, 2015.
    Filmic,
}

/// Start of the bend of the soft curve.
const KNEE: f32 = 0.7;
/// Limit of light, so that the results stay finite.
const MAX_LIGHT: f32 = 1e6;

impl ToneCurve {
    /// All curves.
    pub const ALL: [Self; 3] = [Self::Soft, Self::Clip, Self::Filmic];

    #[inline(always)]
    fn apply<S: Simd>(self, s: S, x: F<S>) -> F<S> {
        match self {
            Self::Soft => {
                let bright = x.simd_gt(splat(s, KNEE));
                if bright.any_true() {
                    let k = min(x, splat(s, MAX_LIGHT)) - KNEE;
                    let bent = k * (1.0 - KNEE) / (k + (1.0 - KNEE)) + KNEE;
                    min(select(bright, bent, x), splat(s, 1.0))
                } else {
                    x
                }
            }
            Self::Clip => min(x, splat(s, 1.0)),
            Self::Filmic => {
                let x = min(x, splat(s, MAX_LIGHT));
                min(x * (x * 2.51 + 0.03) / (x * (x * 2.43 + 0.59) + 0.14), splat(s, 1.0))
            }
        }
    }
}

impl ToneCurve {
    /// Applies this curve and the sRGB transfer function to linear light. Returns the sRGB value on the scale 0..=255,
    /// plus 0.5, at most 255: its integer part is the sRGB byte.
    pub fn encode(self, intensity: f32) -> f32 {
        encode(Scalar, self, splat(Scalar, intensity)).array()[0]
    }
}

/// The sRGB value of linear light after the tone curve plus 0.5, at most 255: its integer part is the sRGB byte.
#[inline(always)]
pub(crate) fn encode<S: Simd>(s: S, curve: ToneCurve, x: F<S>) -> F<S> {
    to_srgb(s, curve.apply(s, max(x, splat(s, 0.0))))
}

/// As [`encode`] for linear light in 0..=1, without the tone curve.
#[inline(always)]
pub(crate) fn to_srgb<S: Simd>(s: S, x: F<S>) -> F<S> {
    let r = x.sqrt();
    let y = (((r * -0.309_826 + 0.843_371_8) * r - 0.945_305_94) * r + 1.448_028_3) * r - 0.037_015_604;
    // The standard is a straight line near black.
    let y = select(x.simd_lt(splat(s, 0.003_130_8)), x * 12.92, y);
    min(max(y * 255.0 + 0.5, splat(s, 0.0)), splat(s, 255.0))
}

/// Linear light of sRGB bytes (0..=255), as a polynomial that is within 0.0005 of the standard.
#[inline(always)]
pub(crate) fn decode_bytes<S: Simd>(x: F<S>) -> F<S> {
    let x = x * (1.0 / 255.0);
    (((x * -0.156_114_5 + 0.615_823_9) * x + 0.494_052_83) * x + 0.045_749_872) * x
}

/// Linear light as sRGB, not rounded: the inverse of [`decode_bytes`] for 0 to 254.5, its largest value.
#[inline(always)]
pub(crate) fn to_bytes<S: Simd>(s: S, x: F<S>) -> F<S> {
    to_srgb(s, min(max(x, splat(s, 0.0)), splat(s, 1.0))) - 0.5
}

/// Space of the colors that are added up and blended: linear light, or display colors in 0..=1, as in MuJoCo's OpenGL
/// renderer.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BlendSpace {
    pub(crate) is_display: bool,
}

impl BlendSpace {
    /// From sRGB bytes (0..=255).
    #[inline(always)]
    pub(crate) fn color_of_bytes<S: Simd>(self, x: F<S>) -> F<S> {
        if self.is_display { x * (1.0 / 255.0) } else { decode_bytes(x) }
    }

    /// To sRGB bytes, 0..=255, not rounded.
    #[inline(always)]
    pub(crate) fn to_bytes<S: Simd>(self, s: S, x: F<S>) -> F<S> {
        if self.is_display { min(max(x, splat(s, 0.0)), splat(s, 1.0)) * 255.0 } else { to_bytes(s, x) }
    }

    /// From an sRGB color.
    pub(crate) fn color_of_srgb(self, c: [f32; 3]) -> [f32; 3] {
        if self.is_display { c } else { decode(c) }
    }

    /// As [`encode`]; display colors have no tone curve.
    #[inline(always)]
    pub(crate) fn encode<S: Simd>(self, s: S, curve: ToneCurve, x: F<S>) -> F<S> {
        if self.is_display { self.to_bytes(s, x) + 0.5 } else { encode(s, curve, x) }
    }
}

/// Converts an sRGB color to linear light.
pub(crate) fn decode(c: [f32; 3]) -> [f32; 3] {
    c.map(kinetoscope_scene::decode_srgb)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::all_levels;

    /// Compares with the documented curves and the standard's transfer function, in double precision.
    #[test]
    fn encoding() {
        let shown = |curve, x: f64| match curve {
            ToneCurve::Soft if x > 0.7 => 0.7 + 0.3 * (x - 0.7) / (x - 0.7 + 0.3),
            ToneCurve::Soft => x,
            ToneCurve::Clip => x.min(1.0),
            ToneCurve::Filmic => (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0),
        };
        for (level, curve) in all_levels().into_iter().flat_map(|level| ToneCurve::ALL.map(|curve| (level, curve))) {
            let encoded = |x: f32| crate::simd::at_level!(level, s => encode(s, curve, splat(s, x)).array()[3]);
            let mut last = 0.0;
            for k in 0..4000 {
                let x = k as f32 / 1000.0;
                let y = encoded(x);
                assert!(y >= last, "{curve:?} {x}");
                last = y;
                let light = shown(curve, f64::from(x));
                let standard = if light <= 0.0031308 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
                let expected = (standard * 255.0 + 0.5).min(255.0);
                assert!((f64::from(y) - expected).abs() < 0.25, "{curve:?} {x}: {y}, not {expected}");
            }
            assert_eq!([1e9, f32::MAX, f32::INFINITY].map(|x| encoded(x) as u8), [255; 3], "{curve:?}");
        }
        // The control: the curves differ.
        let middle =
            ToneCurve::ALL.map(|curve| encode(crate::simd::Scalar, curve, splat(crate::simd::Scalar, 0.9)).array()[0]);
        assert!((0..3).all(|k| (middle[k] - middle[(k + 1) % 3]).abs() > 1.0), "{middle:?}");
    }
}
