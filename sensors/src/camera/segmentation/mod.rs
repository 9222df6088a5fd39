//! From mask ids to instances, links and semantic classes: what the mask channel says, in the words of whoever trains on it.

mod labels;
mod palette;
mod picture;

pub use labels::{Segment, SegmentLevel, Segmentation, SegmentationCfg, Thing};
pub use palette::segment_color;
