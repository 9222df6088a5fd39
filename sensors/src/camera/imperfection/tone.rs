//! Conversion between color bytes and linear radiance: the tone curve of the renderers and its inverse.

use kinetoscope_render::ToneCurve;
use std::sync::LazyLock;

/// Lookup tables of all curves, computed on first use.
static TONE_LUTS: [LazyLock<ToneLut>; ToneCurve::ALL.len()] = [
    LazyLock::new(|| ToneLut::new(ToneCurve::ALL[0])),
    LazyLock::new(|| ToneLut::new(ToneCurve::ALL[1])),
    LazyLock::new(|| ToneLut::new(ToneCurve::ALL[2])),
];

/// A tone curve in both directions. A byte that is decoded encodes to the same byte again.
#[derive(Debug)]
pub(super) struct ToneLut {
    /// Radiance of each byte: the middle of its interval, and for 255 the smallest.
    radiance: [f64; 256],
    /// Smallest radiance of each byte from 1 on.
    min_radiance: [f32; 255],
}

impl ToneLut {
    /// Returns the lookup table of a curve.
    pub(super) fn for_curve(curve: ToneCurve) -> &'static Self {
        let place = ToneCurve::ALL.iter().position(|one| *one == curve);
        &TONE_LUTS[place.unwrap_or_default()]
    }

    fn new(curve: ToneCurve) -> Self {
        let min_radiance = std::array::from_fn(|k| min_radiance_of(curve, k as f32 + 1.0));
        // The curve adds half a byte for rounding.
        let light =
            |byte: usize| if byte == 255 { min_radiance[254] } else { min_radiance_of(curve, byte as f32 + 0.5) };
        Self { radiance: std::array::from_fn(|byte| f64::from(light(byte))), min_radiance }
    }

    pub(super) fn decode(&self, byte: u8) -> f64 {
        self.radiance[usize::from(byte)]
    }

    pub(super) fn encode(&self, light: f64) -> u8 {
        let light = light as f32;
        self.min_radiance.partition_point(|least| *least <= light) as u8
    }
}

/// Returns the smallest radiance whose byte, before truncation, is at least `value`.
fn min_radiance_of(curve: ToneCurve, value: f32) -> f32 {
    // Positive floats are ordered as their bits; the curve is monotonic.
    let (mut below, mut above) = (0, 1000f32.to_bits());
    if curve.encode(0.0) >= value {
        return 0.0;
    }
    while above - below > 1 {
        let middle = below.midpoint(above);
        let byte = curve.encode(f32::from_bits(middle));
        *(if byte >= value { &mut above } else { &mut below }) = middle;
    }
    f32::from_bits(above)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        for curve in ToneCurve::ALL {
            let tone = ToneLut::for_curve(curve);
            for byte in 0..=255 {
                assert_eq!(tone.encode(tone.decode(byte)), byte, "{curve:?}");
            }
            assert_eq!([-1.0, 0.0, 1e9, f64::INFINITY].map(|light| tone.encode(light)), [0, 0, 255, 255], "{curve:?}");
        }
        let lights = ToneCurve::ALL.map(|curve| ToneLut::for_curve(curve).decode(230));
        assert!(lights[0] != lights[1] && lights[1] != lights[2], "each has its own: {lights:?}");
    }

    /// Compares with the closed form of the curve: the inverse of sRGB, and above 0.7 that of
    /// `y = 0.7 + 0.3 k / (k + 0.3)`. The polynomial of the renderers is within 0.2 of 255 of the standard, and the
    /// middle of a byte is far more precise.
    #[test]
    fn curve() {
        let tone = ToneLut::for_curve(ToneCurve::Soft);
        let screen = |light: f64| {
            let k = light - 0.7;
            let bent = if k > 0.0 { 0.7 + 0.3 * k / (k + 0.3) } else { light };
            255.0 * if bent <= 0.0031308 { 12.92 * bent } else { 1.055 * bent.powf(1.0 / 2.4) - 0.055 }
        };
        for byte in 0..255 {
            let found = screen(tone.decode(byte));
            assert!((found - f64::from(byte)).abs() < 0.25, "{byte}: {found}");
        }
        assert!((screen(tone.decode(255)) - 254.5).abs() < 0.25);
        assert!((screen(tone.decode(100) * 1.02) - 100.0).abs() > 0.5, "the control: two percent would be seen");
    }
}
