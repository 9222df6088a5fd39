//! Rays of a camera: one through the center of every pixel.

use crate::ray::scan::Rays;
use kinetoscope_render::PixelIntrinsics;
use kinetoscope_scene::PoseF64;
use kinetoscope_scene::Ray;
use nalgebra::Vector3;

/// Pixels of an image, row by row. Rays are generated at each cast, because every environment may have its own
/// intrinsics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pixels {
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl Pixels {
    /// Returns the unit direction of pixel number `k` in the optical frame.
    #[inline]
    pub(crate) fn direction(&self, lens: &PixelIntrinsics, k: usize) -> [f64; 3] {
        let (u, v) = ((k % self.width) as f64 + 0.5, (k / self.width) as f64 + 0.5);
        Vector3::new((u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0).normalize().into()
    }
}

impl Rays for Pixels {
    /// World from the optical frame, and the intrinsics.
    type View = (PoseF64, PixelIntrinsics);

    fn count(&self) -> usize {
        self.width * self.height
    }

    fn append_rays(
        &self,
        (world_from_camera, lens): &Self::View,
        which: impl Iterator<Item = usize>,
        out: &mut Vec<Ray>,
    ) {
        let ray = |k| Ray { origin: [0.0; 3], direction: self.direction(lens, k) };
        out.extend(which.map(|k| ray(k).transformed_by(world_from_camera)));
    }
}
