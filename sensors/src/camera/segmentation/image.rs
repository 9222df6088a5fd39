//! Segmented images, as ids and as colors.

use super::labels::{SegmentLevel, Segmentation};
use super::palette::segment_color;
use ndarray::{Array, Array4, ArrayView, ArrayView3, Dimension, Zip};

impl Segmentation {
    /// Converts images of the mask channel (or one image) to segment ids of a level, in the same shape: 0 where nothing
    /// was hit, [`UNKNOWN`](Self::UNKNOWN) for unknown mask ids.
    pub fn segment<D: Dimension>(&self, level: SegmentLevel, mask: ArrayView<'_, i32, D>) -> Array<i32, D> {
        let mut out = Array::zeros(mask.raw_dim());
        self.segment_into(level, mask, &mut out);
        out
    }

    /// Like [`segment`](Self::segment), but writes to `out`. If the shapes differ, `out` is reallocated in the shape of
    /// the mask.
    pub fn segment_into<D: Dimension>(
        &self,
        level: SegmentLevel,
        mask: ArrayView<'_, i32, D>,
        out: &mut Array<i32, D>,
    ) {
        if out.raw_dim() != mask.raw_dim() {
            *out = Array::zeros(mask.raw_dim());
        }
        let level = self.level(level);
        // Neighboring pixels mostly have the same id.
        let (mut last, mut segment) = (0, 0);
        Zip::from(out).and(mask).for_each(|out, &id| {
            if id != last {
                (last, segment) = (id, level.segment_of(id));
            }
            *out = segment;
        });
    }

    /// Converts images of the mask channel, shape (N, H, W), to segment colors of a level ([`segment_color`]): RGBA,
    /// u8, shape (N, H, W, 4).
    pub fn colorize(&self, level: SegmentLevel, mask: ArrayView3<'_, i32>) -> Array4<u8> {
        let (n, height, width) = mask.dim();
        let mut out = Array4::zeros((n, height, width, 4));
        self.colorize_into(level, mask, &mut out);
        out
    }

    /// Like [`colorize`](Self::colorize), but writes to `out`. If the shapes differ, `out` is reallocated with shape
    /// (N, H, W, 4).
    pub fn colorize_into(&self, level: SegmentLevel, mask: ArrayView3<'_, i32>, out: &mut Array4<u8>) {
        let (n, height, width) = mask.dim();
        if out.dim() != (n, height, width, 4) {
            *out = Array4::zeros((n, height, width, 4));
        }
        let level = self.level(level);
        write_colors(mask, out, |id| segment_color(level.segment_of(id)));
    }

    /// Converts segment ids, as returned by [`segment`](Self::segment), to RGBA colors, shape (N, H, W, 4).
    pub fn colorize_segments(segments: ArrayView3<'_, i32>) -> Array4<u8> {
        let (n, height, width) = segments.dim();
        let mut out = Array4::zeros((n, height, width, 4));
        write_colors(segments, &mut out, segment_color);
        out
    }
}

/// Writes the RGBA color of each id to `out`, shape (N, H, W, 4).
fn write_colors(ids: ArrayView3<'_, i32>, out: &mut Array4<u8>, color_of: impl Fn(i32) -> [u8; 4]) {
    // Neighboring pixels mostly have the same id.
    let (mut last, mut color) = (0, color_of(0));
    for (&id, out) in ids.iter().zip(out.rows_mut()) {
        if id != last {
            (last, color) = (id, color_of(id));
        }
        for (to, from) in out.into_iter().zip(color) {
            *to = from;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{SegmentationCfg, SegmentedEntity};
    use super::*;
    use ndarray::{Array3, Axis, array};

    fn segmentation() -> Segmentation {
        let thing = |id, object: &str, link: Option<&str>, class: &str| SegmentedEntity {
            id,
            object: object.into(),
            link: link.map(Into::into),
            class: class.into(),
        };
        let things = [
            thing(1, "ground", None, "ground"),
            thing(2, "arm", Some("base"), "robot"),
            thing(3, "arm", Some("tip"), "robot"),
            thing(4, "cube", None, "object"),
        ];
        Segmentation::new(things, &SegmentationCfg::default()).unwrap()
    }

    #[test]
    fn images() {
        let segmentation = segmentation();
        let mask = array![[[0, 1, 1, 3], [2, 2, 4, 9]], [[4, 4, 0, 1], [3, 0, 9, 2]]];
        let levels = [
            (SegmentLevel::Instance, array![[[0, 1, 1, 2], [2, 2, 4, -1]], [[4, 4, 0, 1], [2, 0, -1, 2]]]),
            (SegmentLevel::Link, array![[[0, 1, 1, 3], [2, 2, 4, -1]], [[4, 4, 0, 1], [3, 0, -1, 2]]]),
            (SegmentLevel::Semantic, array![[[0, 1, 1, 2], [2, 2, 3, -1]], [[3, 3, 0, 1], [2, 0, -1, 2]]]),
        ];
        let (mut raw, mut colors) = (Array3::zeros((0, 0, 0)), Array4::zeros((0, 0, 0, 0)));
        for (level, expected) in levels {
            assert_eq!(segmentation.segment(level, mask.view()), expected, "{level:?}");
            segmentation.segment_into(level, mask.view(), &mut raw);
            assert_eq!(raw, expected);
            assert_eq!(segmentation.segment(level, mask.index_axis(Axis(0), 1)), expected.index_axis(Axis(0), 1));
            let painted = segmentation.colorize(level, mask.view());
            assert_eq!(painted, Segmentation::colorize_segments(expected.view()));
            segmentation.colorize_into(level, mask.view(), &mut colors);
            assert_eq!(colors, painted);
            for ((place, id), color) in expected.indexed_iter().zip(painted.rows()) {
                assert_eq!(color.to_vec(), segment_color(*id), "{place:?}");
            }
        }
    }
}
