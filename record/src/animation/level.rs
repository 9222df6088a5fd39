//! Levels of H.264: requirements on a decoder (ITU-T H.264, table A-1 and clause A.3.1).

/// Side of a macroblock \[pixels\].
pub(super) const MB_SIZE: usize = 16;

/// A row of table A-1. Level 1b is omitted because other bits signal it; level 1.1 replaces it.
pub(super) struct H264Level {
    /// Ten times the level number.
    pub(super) code: u8,
    /// Macroblocks per second (MaxMBPS).
    max_mbps: u64,
    /// Macroblocks per frame (MaxFS).
    max_fs: usize,
    /// Bit rate \[kbit/s\] (MaxBR).
    max_br: u64,
    /// Size of the coded picture buffer \[kbit\] (MaxCPB).
    max_cpb: u64,
    /// Minimum compression ratio of frames that are decoded at the maximum rate (MinCR).
    min_cr: u64,
}

const fn level(code: u8, max_mbps: u64, max_fs: usize, max_br: u64, max_cpb: u64, min_cr: u64) -> H264Level {
    H264Level { code, max_mbps, max_fs, max_br, max_cpb, min_cr }
}

const LEVELS: [H264Level; 19] = [
    level(10, 1_485, 99, 64, 175, 2),
    level(11, 3_000, 396, 192, 500, 2),
    level(12, 6_000, 396, 384, 1_000, 2),
    level(13, 11_880, 396, 768, 2_000, 2),
    level(20, 11_880, 396, 2_000, 2_000, 2),
    level(21, 19_800, 792, 4_000, 4_000, 2),
    level(22, 20_250, 1_620, 4_000, 4_000, 2),
    level(30, 40_500, 1_620, 10_000, 10_000, 2),
    level(31, 108_000, 3_600, 14_000, 14_000, 4),
    level(32, 216_000, 5_120, 20_000, 20_000, 4),
    level(40, 245_760, 8_192, 20_000, 25_000, 4),
    level(41, 245_760, 8_192, 50_000, 62_500, 2),
    level(42, 522_240, 8_704, 50_000, 62_500, 2),
    level(50, 589_824, 22_080, 135_000, 135_000, 2),
    level(51, 983_040, 36_864, 240_000, 240_000, 2),
    level(52, 2_073_600, 36_864, 240_000, 240_000, 2),
    level(60, 4_177_920, 139_264, 240_000, 240_000, 2),
    level(61, 8_355_840, 139_264, 480_000, 480_000, 2),
    level(62, 16_711_680, 139_264, 800_000, 800_000, 2),
];

/// The highest level. It is also signaled for a stream that exceeds it.
pub(super) const HIGHEST: &H264Level = &LEVELS[LEVELS.len() - 1];

impl H264Level {
    /// True if the level supports frames of this many macroblocks per row and rows. The side limit is the square root
    /// of 8 MaxFS.
    pub(super) fn supports_size(&self, [width, height]: [usize; 2]) -> bool {
        let side = (8 * self.max_fs).isqrt();
        width.max(height) <= side && width * height <= self.max_fs
    }

    /// Largest frames: side length and area \[pixels\].
    pub(super) fn max_size(&self) -> [usize; 2] {
        [(8 * self.max_fs).isqrt() * MB_SIZE, self.max_fs * MB_SIZE * MB_SIZE]
    }

    /// The lowest level for a stream, or [`HIGHEST`] if no level suffices. `squares` are macroblocks per row and rows.
    /// `frames` are duration (in units of 1 / `per_second` s) and size (in bytes) of each frame.
    pub(super) fn lowest_for(
        squares: [usize; 2],
        per_second: u32,
        frames: impl Iterator<Item = [u32; 2]> + Clone,
    ) -> &'static Self {
        let [second, all] = [u64::from(per_second), (squares[0] * squares[1]) as u64];
        let bits = |bytes: u32| 8 * u64::from(bytes);
        // Largest number of bits within a second: of the frames that begin in it.
        let (mut most, mut largest, mut inside, mut since) = (0, 0, 0_u64, 0_u64);
        let mut first = frames.clone();
        for [shown, bytes] in frames.clone() {
            largest = largest.max(bits(bytes));
            inside += bits(bytes);
            most = most.max(inside);
            since += u64::from(shown);
            while since >= second {
                let Some([shown, bytes]) = first.next() else { break };
                inside -= bits(bytes);
                since -= u64::from(shown);
            }
        }
        let fits = |level: &&Self| {
            // A frame is decoded during the display of the previous one; its bytes arrive in that time.
            let mut pairs = frames.clone().zip(frames.clone().skip(1));
            let in_time = pairs.all(|([shown, _], [_, bytes])| {
                let shown = u64::from(shown);
                all * second <= level.max_mbps * shown
                    && u64::from(bytes) * level.min_cr * second <= 384 * level.max_mbps * shown
            });
            level.supports_size(squares) && in_time && most <= 1000 * level.max_br && largest <= 1000 * level.max_cpb
        };
        LEVELS.iter().find(fits).unwrap_or(HIGHEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the code of the lowest level for three seconds of frames with these sides \[pixels\], rate \[Hz\] and
    /// size \[bytes\].
    fn of(sides: [usize; 2], rate: u32, bytes: u32) -> u8 {
        let shown = 90_000 / rate;
        H264Level::lowest_for(sides.map(|side| side.div_ceil(MB_SIZE)), 90_000, (0..3 * rate).map(|_| [shown, bytes]))
            .code
    }

    /// Reference: frame sizes and their maximum rates by level, as listed in table A-6 of the standard.
    #[test]
    fn frame_sizes() {
        for (sides, rate, code) in [
            ([128, 96], 30, 10),
            ([176, 144], 15, 10),
            ([176, 144], 30, 11),
            ([352, 288], 15, 12),
            ([352, 288], 30, 13),
            ([352, 576], 25, 21),
            ([720, 480], 15, 22),
            ([720, 480], 30, 30),
            ([720, 576], 25, 30),
            ([1280, 720], 30, 31),
            ([1280, 720], 60, 32),
            ([1920, 1088], 30, 40),
            ([1920, 1088], 60, 42),
            ([3840, 2160], 30, 51),
            ([3840, 2160], 60, 52),
            ([7680, 4320], 30, 60),
            ([7680, 4320], 60, 61),
            ([8192, 4320], 120, 62),
        ] {
            assert_eq!(of(sides, rate, 1), code, "{sides:?} {rate}");
        }
    }

    #[test]
    fn bit_rates() {
        // 64 000 bits per second are ten times 800 bytes: level 1. One byte more requires level 1.1.
        assert_eq!([800, 801].map(|bytes| of([128, 96], 10, bytes)), [10, 11]);
        // A single frame with the bits per second of levels 1 and 1.1, and one byte more.
        let alone = |bytes| H264Level::lowest_for([8, 6], 90_000, [[90_000, bytes]].into_iter()).code;
        assert_eq!([8_000, 8_001, 24_000, 24_001].map(alone), [10, 11, 11, 12]);
        // 1280 x 720 at 30 Hz with uncompressed macroblocks of 384 bytes: 332 Mbit/s.
        assert_eq!(of([1280, 720], 30, 3600 * 384), 61);
        // More than any level supports.
        assert_eq!(of([1920, 1088], 60, 8160 * 384), 62);
    }
}
