//! Shading: from the visibility buffer to channels. All channels are computed from the same hit.
//!
//! Color is computed in linear light; `tone` converts it for the screen.

pub(crate) mod band;
pub(crate) mod corner_light;
pub(crate) mod group;
pub(crate) mod horizon;
pub(crate) mod light;
pub(crate) mod mirror;
pub(crate) mod motion_vectors;
pub(crate) mod multisample;
mod polygon_cells;
pub(crate) mod polygons;
pub(crate) mod prepared_frame;
pub(crate) mod shadow;
mod shadow_fit;
pub(crate) mod shadow_rays;
pub(crate) mod surface;
pub(crate) mod texture;
pub(crate) mod tone;

/// Approximate largest number of samples in a band of the image: it stays in a core's own cache (8 bytes each).
pub(crate) const MAX_BAND_SAMPLES: usize = 128 * 1024;
