//! Colors of segments.

use super::labels::Segmentation;

/// Returns the RGBA color of a segment. The ids 1 to 2²⁴ - 1 have distinct, constant colors, and those of small ids are
/// far apart. The background (0) is black and transparent; unknown segments are black and opaque, both as in Isaac.
///
/// The 24 bits of an id are the 24 bits of its color in another order: bit 3 i + c is bit 7 - i of channel c. Source:
/// the color map of the PASCAL VOC challenge.
pub fn segment_color(id: i32) -> [u8; 4] {
    match id {
        0 => [0; 4],
        Segmentation::UNKNOWN => [0, 0, 0, 255],
        _ => {
            let channel = |c: u32| (0..8).fold(0u8, |sum, i| sum | ((id >> (3 * i + c) & 1) as u8) << (7 - i));
            [channel(0), channel(1), channel(2), 255]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distinct() {
        let ids = (0..4096).chain((4096..1 << 24).filter(|id| id % 7 == 0));
        let mut all: Vec<u32> = ids.map(|id| u32::from_le_bytes(segment_color(id))).collect();
        all.sort_unstable();
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]));
        // The first seven are the corners of a cube with sides of 128.
        assert_eq!(
            [1, 2, 3, 4].map(segment_color),
            [[128, 0, 0, 255], [0, 128, 0, 255], [128, 128, 0, 255], [0, 0, 128, 255]]
        );
        let apart = |a: [u8; 4], b: [u8; 4]| a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max();
        let few: Vec<[u8; 4]> = (1..64).map(segment_color).collect();
        for (k, a) in few.iter().enumerate() {
            assert!(few[..k].iter().all(|b| apart(*a, *b) >= Some(64)), "{a:?}");
        }
        assert_eq!((segment_color(0), segment_color(-1)), ([0; 4], [0, 0, 0, 255]));
    }
}
