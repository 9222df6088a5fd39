//! H.264 stream of an MP4 file (ITU-T H.264, constrained baseline), encoded by the crate `rusty_h264-encoder`.
//!
//! Frames are converted to Y'CbCr here. The encoder predicts each frame, except IDR frames, from the one before it, and
//! quantizes the difference with a fixed step, so that the error does not depend on the motion.

use super::level::{H264Level, HIGHEST, MB_SIZE};
use rusty_h264_common::YuvPlanes;
use rusty_h264_encoder::{Encoder, EncoderConfig, Preset};

/// Quantization parameter. The quantization step is 1 at 4 and doubles every 6 (clause 8.5): 4 of 255 here.
const QP: u8 = 16;

/// Types of NAL units (table 7-1).
const IDR_SLICE: u8 = 5;
const SEQUENCE_PARAMETERS: u8 = 7;
const PICTURE_PARAMETERS: u8 = 8;

/// Parameter set NAL units (7.3.1), as in MP4 files: without start codes. They depend only on the size of the frames,
/// except for the level, which is known only at the end of the stream.
#[derive(Clone, Default)]
pub(crate) struct ParameterSets {
    pub(super) sequence: Vec<u8>,
    pub(super) image: Vec<u8>,
}

/// Conversion of colors to Y'CbCr with 8 bits and limited range. The weights of red, green and blue are in fixed point
/// with 16 bits; those of chroma add up to 0, so that grey is exact.
#[derive(Debug)]
pub(crate) struct ColorMatrix {
    /// Matrix coefficients in files (ITU-T H.273, table 4).
    pub(super) code: u8,
    /// Luma from 16 to 235.
    luma: [i32; 3],
    /// Cb and Cr from 16 to 240.
    chroma: [[i32; 3]; 2],
}

/// ITU-R BT.709, for high definition: Y = 0.2126 R + 0.7152 G + 0.0722 B.
pub(crate) const BT709: ColorMatrix = ColorMatrix {
    code: 1,
    luma: [11_966, 40_254, 4_064],
    chroma: [[-6_596, -22_189, 28_785], [28_784, -26_145, -2_639]],
};

/// ITU-R BT.601, for standard definition: Y = 0.299 R + 0.587 G + 0.114 B.
#[cfg_attr(not(feature = "lerobot"), allow(dead_code, reason = "only LeRobot datasets need it"))]
pub(crate) const BT601: ColorMatrix = ColorMatrix {
    code: 6,
    luma: [16_829, 33_039, 6_416],
    chroma: [[-9_714, -19_071, 28_785], [28_785, -24_104, -4_681]],
};

/// Properties of a stream.
#[derive(Clone, Copy)]
pub(crate) struct StreamCfg {
    /// Width and height \[pixels\].
    pub(crate) size: [usize; 2],
    pub(crate) colors: &'static ColorMatrix,
    /// Number of frames from one IDR frame to the next. A player can begin at an IDR frame.
    pub(crate) idr_interval: u32,
}

/// Encoder of a stream.
pub(crate) struct H264Encoder {
    cfg: StreamCfg,
    encoder: Encoder,
    frame: YuvFrame,
    sets: ParameterSets,
    units: Vec<u8>,
}

/// A frame in Y'CbCr with 4:2:0 chroma, sited in the center of four pixels.
struct YuvFrame {
    /// Luma, then both chroma planes.
    planes: [Vec<u8>; 3],
}

/// Checks that frames may have a width and height; the error describes the supported sizes.
pub(crate) fn check_size(size: [usize; 2]) -> Result<(), String> {
    // Four pixels share a chroma sample.
    let even = size.iter().all(|side| *side > 0 && side % 2 == 0);
    if even && HIGHEST.supports_size(macroblocks(size)) {
        return Ok(());
    }
    let [most, all] = HIGHEST.max_size();
    Err(format!("both sides must be even numbers, up to {most} pixels, with up to {all} pixels in all"))
}

impl ParameterSets {
    /// Sets the level of the complete stream. `frames` are duration (in units of 1 / `per_second` s) and size (in
    /// bytes) of each frame.
    pub(super) fn set_level(
        &mut self,
        size: [usize; 2],
        per_second: u32,
        frames: impl Iterator<Item = [u32; 2]> + Clone,
    ) {
        let level = H264Level::lowest_for(macroblocks(size), per_second, frames);
        // After the header of the unit, the profile and its constraints (7.3.2.1.1).
        if let Some(code) = self.sequence.get_mut(3) {
            *code = level.code;
        }
    }
}

impl H264Encoder {
    /// Creates an encoder; the error describes the supported sizes.
    pub(crate) fn new(stream: StreamCfg) -> Result<Self, String> {
        let StreamCfg { size, idr_interval, .. } = stream;
        check_size(size)?;
        let mut cfg = EncoderConfig::baseline(size[0], size[1]);
        cfg.preset = Preset::Fast;
        (cfg.gop_size, cfg.min_keyint) = (idr_interval, idr_interval);
        // The same step everywhere: neither a bit rate nor a coarser step in detailed regions.
        (cfg.qp, cfg.bitrate, cfg.aq_strength) = (QP, 0, 0.0);
        let encoder = Encoder::new(cfg).map_err(|error| error.to_string())?;
        let frame = YuvFrame::new(size);
        Ok(Self { cfg: stream, encoder, frame, sets: ParameterSets::default(), units: Vec::new() })
    }

    /// Parameter sets of the stream; empty before the first frame.
    pub(crate) fn parameter_sets(&self) -> &ParameterSets {
        &self.sets
    }

    /// Encodes the next frame from RGBA pixels, without their alpha channel. Returns NAL units, each after its length
    /// in four bytes, most significant byte first.
    ///
    /// # Errors
    /// The encoder does not support the frame.
    pub(crate) fn encode(&mut self, rgba: &[u8]) -> Result<&[u8], String> {
        let [width, height] = self.cfg.size;
        self.frame.fill(rgba, &self.cfg);
        let [y, u, v] = &self.frame.planes;
        let planes = YuvPlanes { width, height, y, u, v, stride_y: width, stride_c: width / 2 };
        let stream = self.encoder.encode_planes(&planes).map_err(|error| error.to_string())?;
        self.units.clear();
        for unit in nal_units(&stream) {
            match unit[0] & 0x1f {
                SEQUENCE_PARAMETERS => self.sets.sequence = unit.to_vec(),
                PICTURE_PARAMETERS => self.sets.image = unit.to_vec(),
                _ => {
                    self.units.extend_from_slice(&(unit.len() as u32).to_be_bytes());
                    self.units.extend_from_slice(unit);
                }
            }
        }
        Ok(&self.units)
    }
}

/// True for an IDR frame, which does not refer to other frames. `units` are those of [`H264Encoder::encode`].
pub(super) fn is_idr(mut units: &[u8]) -> bool {
    while let Some((length, rest)) = units.split_first_chunk() {
        if rest.first().is_some_and(|header| header & 0x1f == IDR_SLICE) {
            return true;
        }
        units = rest.get(u32::from_be_bytes(*length) as usize..).unwrap_or_default();
    }
    false
}

/// Macroblocks per row and rows of macroblocks.
fn macroblocks(size: [usize; 2]) -> [usize; 2] {
    size.map(|side| side.div_ceil(MB_SIZE))
}

/// NAL units of a byte stream (annex B): each follows a start code, two or three zeros and a one.
fn nal_units(stream: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = start_code(stream).map(|(_, end)| &stream[end..]);
    std::iter::from_fn(move || {
        let from = rest?;
        let (unit, next) = match start_code(from) {
            Some((begin, end)) => (&from[..begin], Some(&from[end..])),
            None => (from, None),
        };
        rest = next;
        Some(unit)
    })
    .filter(|unit| !unit.is_empty())
}

/// Begin and end of the first start code; `None` without one.
fn start_code(bytes: &[u8]) -> Option<(usize, usize)> {
    let at = bytes.windows(3).position(|three| three == [0, 0, 1])?;
    let begin = if at > 0 && bytes[at - 1] == 0 { at - 1 } else { at };
    Some((begin, at + 3))
}

impl YuvFrame {
    fn new([width, height]: [usize; 2]) -> Self {
        let luma = width * height;
        Self { planes: [vec![0; luma], vec![0; luma / 4], vec![0; luma / 4]] }
    }

    /// Converts a frame: plain loops over rows, which the compiler turns into vector instructions.
    fn fill(&mut self, rgba: &[u8], cfg: &StreamCfg) {
        let StreamCfg { size: [width, _], colors, .. } = *cfg;
        let pixels = rgba.as_chunks::<4>().0;
        let [luma, cb, cr] = &mut self.planes;
        for (y, pixel) in luma.iter_mut().zip(pixels) {
            *y = colors.luma([i32::from(pixel[0]), i32::from(pixel[1]), i32::from(pixel[2])]);
        }
        let chroma = cb.chunks_exact_mut(width / 2).zip(cr.chunks_exact_mut(width / 2));
        for (rows, (cb, cr)) in pixels.chunks_exact(2 * width).zip(chroma) {
            let (upper, lower) = rows.split_at(width);
            let squares = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
            for ((cb, cr), ([a, b], [c, d])) in cb.iter_mut().zip(cr).zip(squares) {
                let sum = |k: usize| i32::from(a[k]) + i32::from(b[k]) + i32::from(c[k]) + i32::from(d[k]);
                [*cb, *cr] = colors.chroma([sum(0), sum(1), sum(2)]);
            }
        }
    }
}

impl ColorMatrix {
    /// Luma of a pixel.
    #[inline]
    fn luma(&self, rgb: [i32; 3]) -> u8 {
        ((dot(&self.luma, rgb) + (16 << 16) + (1 << 15)) >> 16) as u8
    }

    /// Cb and Cr of the sums of four pixels.
    #[inline]
    fn chroma(&self, sums: [i32; 3]) -> [u8; 2] {
        let one = |weights: &[i32; 3]| ((dot(weights, sums) + (128 << 18) + (1 << 17)) >> 18) as u8;
        [one(&self.chroma[0]), one(&self.chroma[1])]
    }
}

#[inline]
fn dot(weights: &[i32; 3], rgb: [i32; 3]) -> i32 {
    weights[0] * rgb[0] + weights[1] * rgb[1] + weights[2] * rgb[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the weights of the standards, in floating point.
    #[test]
    fn colors() {
        for (matrix, [kr, kb]) in [(BT709, [0.2126, 0.0722]), (BT601, [0.299, 0.114])] {
            for grey in 0..=255 {
                assert_eq!(matrix.chroma([4 * grey; 3]), [128, 128], "{grey}");
            }
            assert_eq!([matrix.luma([0; 3]), matrix.luma([255; 3])], [16, 235]);
            // Pure blue and pure red are the extreme values of Cb and Cr.
            assert_eq!([matrix.chroma([0, 0, 1020])[0], matrix.chroma([1020, 0, 0])[1]], [240, 240]);
            assert_eq!([matrix.chroma([1020, 1020, 0])[0], matrix.chroma([0, 1020, 1020])[1]], [16, 16]);
            for k in 0..4096 {
                let rgb = [k % 16, k / 16 % 16, k / 256].map(|x| 17 * x);
                let [r, g, b] = rgb.map(|x| f64::from(x) / 255.0);
                let y = kr * r + (1.0 - kr - kb) * g + kb * b;
                let expected =
                    [16.0 + 219.0 * y, 128.0 + 112.0 * (b - y) / (1.0 - kb), 128.0 + 112.0 * (r - y) / (1.0 - kr)];
                let [cb, cr] = matrix.chroma(rgb.map(|x| 4 * x));
                for (found, expected) in [matrix.luma(rgb), cb, cr].into_iter().zip(expected) {
                    // Rounding to integers, and of three weights of 16 bits, each by at most one, times 255.
                    assert!((f64::from(found) - expected).abs() < 0.5 + 3.0 * 255.0 / 65_536.0, "{rgb:?} {expected}");
                }
            }
        }
    }

    /// Reference: each pixel and each square of four pixels by its position.
    #[test]
    fn planes() {
        let [width, height] = [6, 4];
        let rgba: Vec<u8> = (0..4 * width * height).map(|k| (k * k * 7 + 13) as u8).collect();
        let mut frame = YuvFrame::new([width, height]);
        frame.fill(&rgba, &StreamCfg { size: [width, height], colors: &BT709, idr_interval: 2 });
        let pixel = |x: usize, y: usize| [0, 1, 2].map(|k| i32::from(rgba[4 * (y * width + x) + k]));
        let all = |side: [usize; 2]| (0..side[0] * side[1]).map(move |at| [at % side[0], at / side[0]]);
        assert!(all([width, height]).map(|[x, y]| BT709.luma(pixel(x, y))).eq(frame.planes[0].iter().copied()));
        let squares = all([width / 2, height / 2]).map(|[x, y]| {
            let four = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[dx, dy]| pixel(2 * x + dx, 2 * y + dy));
            BT709.chroma([0, 1, 2].map(|k| four.iter().map(|rgb| rgb[k]).sum()))
        });
        let found = frame.planes[1].iter().zip(&frame.planes[2]).map(|(cb, cr)| [*cb, *cr]);
        assert!(squares.eq(found));
    }

    #[test]
    fn units_of_a_byte_stream() {
        let stream = [0, 0, 0, 1, 0x67, 1, 0, 0, 1, 0x68, 2, 0, 0, 0, 1, 0x65, 0, 0, 3];
        assert!(nal_units(&stream).eq([&[0x67, 1][..], &[0x68, 2], &[0x65, 0, 0, 3]]));
        assert_eq!(nal_units(&[1, 2, 3]).count(), 0);
    }

    /// A still image costs nothing after its first frame, and noise is not smaller than its entropy allows.
    #[test]
    fn still_images() {
        let size = [64, 48];
        let idr_interval = 120;
        let mut stream =
            H264Encoder::new(StreamCfg { size, colors: &BT709, idr_interval }).unwrap_or_else(|fits| panic!("{fits}"));
        let noise = |seed: u32| -> Vec<u8> {
            (0..4 * 64 * 48_u32).map(|k| ((k ^ seed).wrapping_mul(2_654_435_761) >> 24) as u8).collect()
        };
        let mut bytes = |rgba: &[u8]| {
            let units = stream.encode(rgba).unwrap_or_else(|error| panic!("{error}"));
            (units.len(), is_idr(units))
        };
        let (first, is_idr) = bytes(&noise(0));
        assert!(is_idr && first > 64 * 48 / 2, "{first}");
        let (again, is_idr) = bytes(&noise(0));
        assert!(!is_idr && again < first / 4, "{again} of {first}");
        let all: Vec<bool> = (2..=idr_interval).map(|_| bytes(&noise(0)).1).collect();
        assert_eq!(all.iter().position(|is_idr| *is_idr), Some(idr_interval as usize - 2));
        let mut sets = stream.parameter_sets().clone();
        sets.set_level(size, 90_000, [[3_000, 1_000]; 30].into_iter());
        // Constrained baseline, level 1.2: 12 macroblocks at 30 Hz, 240 kbit/s.
        assert_eq!(sets.sequence[..2], [0x67, 66]);
        assert_eq!((sets.sequence[3], sets.image[0]), (12, 0x68));
    }

    #[test]
    fn sizes() {
        for size in [[33, 24], [0, 2], [2, 16_882], [16_880, 4_096]] {
            assert!(check_size(size).is_err_and(|fits| fits.contains("even")), "{size:?}");
        }
        for size in [[2, 2], [640, 480], [16_880, 16], [4096, 4096]] {
            assert!(H264Encoder::new(StreamCfg { size, colors: &BT601, idr_interval: 2 }).is_ok(), "{size:?}");
        }
    }
}
