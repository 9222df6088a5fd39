//! H.264 encoder (ITU-T H.264, constrained baseline), lossless except for the color conversion: changed macroblocks are
//! sent uncompressed, unchanged ones are skipped.
//!
//! A frame consists of macroblocks of 16 x 16 pixels. Each is coded in one of three ways: as in the previous frame
//! (clause 7.3.4, skipped), as the continuation of the last row above or the last column to the left (8.3.3,
//! Intra_16x16 without a residual), or sample by sample (I_PCM). Images of a simulation are mostly static, so that few
//! macroblocks are of the third kind.

use super::level::{H264Level, HIGHEST, MB_SIZE};

/// Number of frames from one IDR frame to the next. A player can begin at an IDR frame.
const IDR_INTERVAL: u32 = 120;

/// Parameter set NAL units (7.3.1), as in MP4 files: without start codes. The level is known only at the end of the
/// stream.
pub(super) struct ParameterSets {
    pub(super) sequence: Vec<u8>,
    pub(super) image: Vec<u8>,
}

/// A coded frame.
pub(super) struct CodedFrame<'c> {
    /// NAL unit.
    pub(super) unit: &'c [u8],
    /// True for an IDR frame, which does not refer to other frames.
    pub(super) is_idr: bool,
}

pub(super) struct H264Encoder {
    size: [usize; 2],
    current: YuvFrame,
    reference: YuvFrame,
    /// Number of frames since the last IDR frame.
    frames_since_idr: u32,
    /// Number of IDR frames.
    idr_count: u32,
    bits: BitWriter,
    unit: Vec<u8>,
    /// True for each macroblock of the row above that was coded as I_PCM.
    above: Vec<bool>,
}

/// A frame in Y'CbCr (BT.709, limited range) with 4:2:0 chroma, sited in the center of four pixels.
#[derive(Clone)]
struct YuvFrame {
    /// Macroblocks per row and rows of macroblocks.
    macroblocks: [usize; 2],
    /// Luma, then both chroma planes.
    planes: [Vec<u8>; 3],
}

impl H264Encoder {
    /// Creates an encoder for frames of a width and height; the error describes the supported sizes.
    pub(super) fn new(size: [usize; 2]) -> Result<Self, String> {
        let squares = size.map(|side| side.div_ceil(MB_SIZE));
        // Four pixels share a chroma sample.
        let even = size.iter().all(|side| *side > 0 && side % 2 == 0);
        if !even || !HIGHEST.supports_size(squares) {
            let [most, all] = HIGHEST.max_size();
            return Err(format!(
                "both sides must be even numbers, up to {most} pixels, with up to {all} pixels in all"
            ));
        }
        let planes = YuvFrame::new(squares);
        Ok(Self {
            size,
            reference: planes.clone(),
            current: planes,
            frames_since_idr: 0,
            idr_count: 0,
            bits: BitWriter::default(),
            unit: Vec::new(),
            above: vec![false; squares[0]],
        })
    }

    /// Parameter sets of the complete stream. `frames` are duration (in units of 1 / `per_second` s) and size (in
    /// bytes) of each frame.
    pub(super) fn headers(&self, per_second: u32, frames: impl Iterator<Item = [u32; 2]> + Clone) -> ParameterSets {
        let level = H264Level::lowest_for(self.current.macroblocks, per_second, frames);
        ParameterSets { sequence: sequence_parameter_set(self.size, level.code), image: picture_parameter_set() }
    }

    /// Encodes the next frame from RGBA pixels, without their alpha channel.
    pub(super) fn encode(&mut self, rgba: &[u8]) -> CodedFrame<'_> {
        std::mem::swap(&mut self.current, &mut self.reference);
        self.current.fill(rgba, self.size);
        let is_idr = self.frames_since_idr == 0;
        self.slice(is_idr);
        self.frames_since_idr = (self.frames_since_idr + 1) % IDR_INTERVAL;
        CodedFrame { unit: &self.unit, is_idr }
    }

    fn slice(&mut self, alone: bool) {
        let Self { current, reference, bits, above, .. } = self;
        bits.clear();
        bits.ue(0); // first_mb_in_slice
        bits.ue(if alone { 7 } else { 5 }); // slice_type: all I, all P
        bits.ue(0); // pic_parameter_set_id
        bits.put(self.frames_since_idr % 16, 4); // frame_num
        if alone {
            bits.ue(self.idr_count % 2); // idr_pic_id: differs from that of the previous IDR frame
            self.idr_count += 1;
            bits.put(0, 2); // no_output_of_prior_pics_flag, long_term_reference_flag
        } else {
            bits.put(0, 1); // num_ref_idx_active_override_flag
            bits.put(0, 1); // ref_pic_list_modification_flag_l0
            bits.put(0, 1); // adaptive_ref_pic_marking_mode_flag
        }
        bits.se(0); // slice_qp_delta
        bits.ue(1); // disable_deblocking_filter_idc: the decoder shows the sent samples
        // In P slices, intra macroblock types follow five others (table 7-13).
        let first_type = if alone { 0 } else { 5 };
        let mut skipped = 0;
        let [columns, rows] = current.macroblocks;
        above.fill(false);
        for row in 0..rows {
            let mut left = false;
            for column in 0..columns {
                let place = [column, row];
                if !alone && current.equals(reference, place) {
                    skipped += 1;
                    (above[column], left) = (false, false);
                    continue;
                }
                if !alone {
                    bits.ue(skipped); // mb_skip_run
                    skipped = 0;
                }
                let goes_on = [IntraPrediction::Vertical, IntraPrediction::Horizontal]
                    .into_iter()
                    .find(|way| current.is_predicted(*way, place));
                if let Some(way) = goes_on {
                    // Intra_16x16 without coefficients (table 7-11): luma mode, then chroma mode (table 7-16).
                    let (luma, chroma) = match way {
                        IntraPrediction::Vertical => (0, 2),
                        IntraPrediction::Horizontal => (1, 1),
                    };
                    bits.ue(first_type + 1 + luma);
                    bits.ue(chroma);
                    bits.se(0); // mb_qp_delta
                    // coeff_token of no coefficient, in the table for the neighbors' counts (9.2.1); I_PCM counts as
                    // 16.
                    let known = [(column > 0).then_some(left), (row > 0).then_some(above[column])];
                    let count = |sent: bool| if sent { 16 } else { 0 };
                    let context = match known {
                        [Some(left), Some(above)] => (count(left) + count(above) + 1) / 2,
                        [one, other] => one.or(other).map_or(0, count),
                    };
                    match context {
                        0 => bits.put(1, 1),
                        // The table for eight and more has codes of six bits.
                        _ => bits.put(0b000011, 6),
                    }
                } else {
                    bits.ue(first_type + 25); // I_PCM
                    bits.align();
                    current.put(place, bits);
                }
                (above[column], left) = (goes_on.is_none(), goes_on.is_none());
            }
        }
        if skipped > 0 {
            bits.ue(skipped);
        }
        bits.rbsp_trailing_bits();
        self.unit.clear();
        // nal_ref_idc 3; nal_unit_type 5 (IDR) or 1.
        self.unit.push(if alone { 0x65 } else { 0x61 });
        insert_emulation_prevention(&self.bits.bytes, &mut self.unit);
    }
}

/// Direction in which a macroblock is predicted.
#[derive(Clone, Copy)]
enum IntraPrediction {
    /// Down, from the row above.
    Vertical,
    /// To the right, from the column to the left.
    Horizontal,
}

impl YuvFrame {
    fn new(macroblocks: [usize; 2]) -> Self {
        let luma = macroblocks[0] * macroblocks[1] * MB_SIZE * MB_SIZE;
        Self { macroblocks, planes: [vec![0; luma], vec![0; luma / 4], vec![0; luma / 4]] }
    }

    /// Side of a macroblock in a plane, and length of the plane's rows \[samples\].
    fn shape(&self, plane: usize) -> (usize, usize) {
        let side = if plane == 0 { MB_SIZE } else { MB_SIZE / 2 };
        (side, side * self.macroblocks[0])
    }

    /// Converts a frame. Padding beyond its edges, which is cropped, repeats the last pixels.
    fn fill(&mut self, rgba: &[u8], [width, height]: [usize; 2]) {
        let pixels = rgba.as_chunks::<4>().0;
        let [columns, rows] = self.macroblocks.map(|count| count * MB_SIZE / 2);
        let (stride, half) = (2 * columns, columns);
        for row in 0..rows {
            for column in 0..columns {
                let mut sums = [0_i32; 3];
                for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let (y, x) = (2 * row + dy, 2 * column + dx);
                    let at = y.min(height - 1) * width + x.min(width - 1);
                    let rgb = pixels.get(at).map_or([0; 3], |p| [p[0], p[1], p[2]].map(i32::from));
                    self.planes[0][y * stride + x] = luma(rgb);
                    sums.iter_mut().zip(rgb).for_each(|(sum, one)| *sum += one);
                }
                let [blue, red] = chroma(sums);
                self.planes[1][row * half + column] = blue;
                self.planes[2][row * half + column] = red;
            }
        }
    }

    /// Rows of a macroblock in a plane.
    fn rows(&self, plane: usize, [column, row]: [usize; 2]) -> impl Iterator<Item = &[u8]> {
        let (side, stride) = self.shape(plane);
        (0..side).map(move |k| &self.planes[plane][(row * side + k) * stride + column * side..][..side])
    }

    fn equals(&self, other: &Self, place: [usize; 2]) -> bool {
        (0..3).all(|plane| self.rows(plane, place).eq(other.rows(plane, place)))
    }

    /// True if a macroblock equals the prediction from its neighbor's edge, in all planes.
    fn is_predicted(&self, way: IntraPrediction, [column, row]: [usize; 2]) -> bool {
        let place = [column, row];
        (0..3).all(|plane| {
            let (side, stride) = self.shape(plane);
            let (x, y) = (column * side, row * side);
            match way {
                IntraPrediction::Vertical => {
                    y > 0 && {
                        let edge = &self.planes[plane][(y - 1) * stride + x..][..side];
                        self.rows(plane, place).all(|row| row == edge)
                    }
                }
                IntraPrediction::Horizontal => {
                    x > 0 && {
                        let mut rows = self.rows(plane, place).enumerate();
                        rows.all(|(k, row)| row.iter().all(|one| *one == self.planes[plane][(y + k) * stride + x - 1]))
                    }
                }
            }
        })
    }

    fn put(&self, place: [usize; 2], bits: &mut BitWriter) {
        for plane in 0..3 {
            self.rows(plane, place).for_each(|row| bits.bytes.extend_from_slice(row));
        }
    }
}

/// Luma of BT.709 (0.2126 R + 0.7152 G + 0.0722 B) from 16 to 235, in fixed point with 16 bits.
fn luma([red, green, blue]: [i32; 3]) -> u8 {
    ((11_966 * red + 40_254 * green + 4_064 * blue + (16 << 16) + (1 << 15)) >> 16) as u8
}

/// Chroma (Cb, Cr) of BT.709 from 16 to 240, from the RGB sums of four pixels, in fixed point with 16 bits.
fn chroma([red, green, blue]: [i32; 3]) -> [u8; 2] {
    let middle = (128 << 18) + (1 << 17);
    let cb = -6_596 * red - 22_189 * green + 28_785 * blue + middle;
    let cr = 28_784 * red - 26_145 * green - 2_639 * blue + middle;
    [(cb >> 18) as u8, (cr >> 18) as u8]
}

/// Sequence parameter set (7.3.2.1.1).
fn sequence_parameter_set([width, height]: [usize; 2], level: u8) -> Vec<u8> {
    let squares = [width, height].map(|side| side.div_ceil(MB_SIZE) as u32);
    let mut bits = BitWriter::default();
    bits.put(66, 8); // profile_idc: baseline
    bits.put(0b1100_0000, 8); // constrained: also decodable as main profile
    bits.put(level.into(), 8);
    bits.ue(0); // seq_parameter_set_id
    bits.ue(0); // log2_max_frame_num_minus4
    bits.ue(2); // pic_order_cnt_type: display order is decoding order
    bits.ue(1); // max_num_ref_frames
    bits.put(0, 1); // gaps_in_frame_num_value_allowed_flag
    squares.iter().for_each(|count| bits.ue(count - 1));
    bits.put(1, 1); // frame_mbs_only_flag
    bits.put(1, 1); // direct_8x8_inference_flag
    bits.put(1, 1); // frame_cropping_flag
    // Left, right, top, bottom, in units of two pixels.
    let beyond = |count: u32, side: usize| (count * MB_SIZE as u32 - side as u32) / 2;
    for cut in [0, beyond(squares[0], width), 0, beyond(squares[1], height)] {
        bits.ue(cut);
    }
    bits.put(1, 1); // vui_parameters_present_flag (annex E)
    bits.put(0, 2); // aspect_ratio_info_present_flag, overscan_info_present_flag
    bits.put(1, 1); // video_signal_type_present_flag
    bits.put(5, 3); // video_format: unspecified
    bits.put(0, 1); // video_full_range_flag
    bits.put(1, 1); // colour_description_present_flag
    // Primaries and matrix of BT.709; transfer function of sRGB.
    [1, 13, 1].into_iter().for_each(|code| bits.put(code, 8));
    bits.put(1, 1); // chroma_loc_info_present_flag
    bits.ue(1); // chroma sample in the center of four pixels
    bits.ue(1);
    bits.put(0, 4); // no timing_info, nal_hrd, vcl_hrd, pic_struct
    bits.put(1, 1); // bitstream_restriction_flag
    bits.put(1, 1); // motion_vectors_over_pic_boundaries_flag
    // No limits of bytes and bits, zero motion vectors, no reordering, one reference frame.
    [0, 0, 0, 0, 0, 1].into_iter().for_each(|number| bits.ue(number));
    bits.rbsp_trailing_bits();
    unit(0x67, &bits)
}

/// Picture parameter set (7.3.2.2).
fn picture_parameter_set() -> Vec<u8> {
    let mut bits = BitWriter::default();
    bits.ue(0); // pic_parameter_set_id
    bits.ue(0); // seq_parameter_set_id
    bits.put(0, 2); // entropy_coding_mode_flag: CAVLC; bottom_field_pic_order_in_frame_present_flag
    [0, 0, 0].into_iter().for_each(|number| bits.ue(number)); // slice groups, reference indices
    bits.put(0, 3); // weighted_pred_flag, weighted_bipred_idc
    (0..3).for_each(|_| bits.se(0)); // quantizers
    bits.put(0b100, 3); // deblocking_filter_control_present_flag; no constrained_intra_pred, no redundant_pic_cnt
    bits.rbsp_trailing_bits();
    unit(0x68, &bits)
}

fn unit(head: u8, bits: &BitWriter) -> Vec<u8> {
    let mut unit = vec![head];
    insert_emulation_prevention(&bits.bytes, &mut unit);
    unit
}

/// Inserts emulation prevention bytes (7.4.1).
fn insert_emulation_prevention(bytes: &[u8], to: &mut Vec<u8>) {
    let mut zeros = 0;
    for &byte in bytes {
        if zeros == 2 && byte <= 3 {
            to.push(3);
            zeros = 0;
        }
        to.push(byte);
        zeros = if byte == 0 { zeros + 1 } else { 0 };
    }
}

/// Bit writer, most significant bit first.
#[derive(Default)]
struct BitWriter {
    bytes: Vec<u8>,
    /// Number of free bits in the last byte.
    free: u32,
}

impl BitWriter {
    fn clear(&mut self) {
        self.bytes.clear();
        self.free = 0;
    }

    /// Writes the lowest `count` bits of a number.
    fn put(&mut self, number: u32, count: u32) {
        for k in (0..count).rev() {
            if self.free == 0 {
                self.bytes.push(0);
                self.free = 8;
            }
            self.free -= 1;
            if let Some(last) = self.bytes.last_mut() {
                *last |= ((number >> k & 1) as u8) << self.free;
            }
        }
    }

    /// Writes an unsigned Exp-Golomb code (9.1): n zeros, then the n + 1 bits of `number + 1`.
    fn ue(&mut self, number: u32) {
        let length = 32 - (number + 1).leading_zeros();
        self.put(0, length - 1);
        self.put(number + 1, length);
    }

    /// Writes a signed Exp-Golomb code (9.1.1).
    fn se(&mut self, number: i32) {
        let twice = 2 * number.unsigned_abs();
        self.ue(if number > 0 { twice - 1 } else { twice });
    }

    /// Pads with zeros to the next byte.
    fn align(&mut self) {
        self.free = 0;
    }

    /// Writes the stop bit, then pads with zeros to the next byte.
    fn rbsp_trailing_bits(&mut self) {
        self.put(1, 1);
        self.align();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_golomb() {
        // Table 9-2: 1, 010, 011, 00100, 00101, ...
        let mut bits = BitWriter::default();
        [0, 1, 2, 3, 4].into_iter().for_each(|number| bits.ue(number));
        assert_eq!(bits.bytes, [0b1010_0110, 0b0100_0010, 0b1000_0000]);
        // Table 9-3: 0, 1, -1 are the codes of 0, 1, 2.
        let mut signed = BitWriter::default();
        [0, 1, -1].into_iter().for_each(|number| signed.se(number));
        assert_eq!(signed.bytes, [0b1010_0110]);
    }

    #[test]
    fn start_codes() {
        let mut unit = Vec::new();
        insert_emulation_prevention(&[0, 0, 1, 0, 0, 0, 0, 0, 4], &mut unit);
        assert_eq!(unit, [0, 0, 3, 1, 0, 0, 3, 0, 0, 3, 0, 4]);
    }

    #[test]
    fn colors() {
        for grey in 0..=255 {
            assert_eq!(chroma([4 * grey; 3]), [128, 128], "{grey}");
        }
        assert_eq!([luma([0; 3]), luma([255; 3])], [16, 235]);
        // Pure blue and pure red are the extreme values of Cb and Cr.
        assert_eq!([chroma([0, 0, 1020])[0], chroma([1020, 0, 0])[1]], [240, 240]);
        assert_eq!([chroma([1020, 1020, 0])[0], chroma([0, 1020, 1020])[1]], [16, 16]);
    }

    #[test]
    fn still_images() {
        let size = [64, 48];
        let mut stream = H264Encoder::new(size).unwrap_or_else(|fits| panic!("{fits}"));
        let noise = |seed: u32| -> Vec<u8> {
            (0..4 * 64 * 48_u32).map(|k| ((k ^ seed).wrapping_mul(2_654_435_761) >> 24) as u8).collect()
        };
        let first = stream.encode(&noise(0)).unit.len();
        assert!(first > 64 * 48 * 3 / 2, "everything is sent: {first}");
        let again = stream.encode(&noise(0));
        assert!(!again.is_idr && again.unit.len() < 16, "{}", again.unit.len());
        assert!(stream.encode(&noise(1)).unit.len() > 64 * 48 * 3 / 2);
        // A uniform frame needs one I_PCM macroblock.
        let mut flat = H264Encoder::new(size).unwrap_or_else(|fits| panic!("{fits}"));
        let flat = flat.encode(&[90; 4 * 64 * 48]).unit.len();
        assert!((384..500).contains(&flat), "{flat}");
    }

    #[test]
    fn sizes() {
        for size in [[33, 24], [0, 2], [2, 16_882], [16_880, 4_096]] {
            assert!(H264Encoder::new(size).is_err_and(|fits| fits.contains("even")), "{size:?}");
        }
        for size in [[2, 2], [640, 480], [16_880, 16], [4096, 4096]] {
            assert!(H264Encoder::new(size).is_ok(), "{size:?}");
        }
    }
}
