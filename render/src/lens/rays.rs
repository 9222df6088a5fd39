//! Rays of all samples of an image through a lens: computed once, for all images of the same lens.

use super::Optics;
use crate::optics_error::OpticsError;
use crate::raster::tile::{BLOCK, SAMPLES};
use crate::simd::{F, LANES, Simd, V3, load};
use kinetoscope_scene::vector::{add, dot, norm, sub, try_normalize};
use std::fmt;
use std::sync::OnceLock;

/// Numbers of a group: x, y, z of two rows of eight pixels.
const GROUP_FLOATS: usize = 3 * LANES;
/// Widening of cones \[rad\]: more than the error of single precision.
const CONE_MARGIN: f64 = 1e-5;

/// Precomputed rays of an image through a lens, single precision; see
/// [`RenderRequest::lens`](crate::request::RenderRequest::lens).
///
/// The table takes 12 bytes per pixel, 60 with four color samples, and 4 more with vignetting. It is computed once:
/// cameras keep one for each combination of lens and intrinsics among their environments.
#[derive(Clone)]
pub struct LensRays {
    optics: Optics,
    size: [usize; 2],
    /// Sample planes: the pixel center alone, or all of [`SAMPLES`].
    planes: usize,
    /// Ray directions by plane, then pairs of rows from the top, then groups from the left; 0 for samples without a
    /// ray. Scaled to length 1, or to z = 1.
    directions: Vec<f32>,
    /// Bounding cone of the rays of each block of 8 x 8 pixels, row by row.
    cones: Vec<Cone>,
    /// Mean distance between the stored directions of neighboring pixels.
    pixel_spacing: f64,
    /// Relative illumination of each pixel, row by row, computed on first use; see [`Optics::falloff`].
    falloff: OnceLock<Vec<f32>>,
}

/// A cone of directions around an axis.
#[derive(Clone, Copy, Debug)]
struct Cone {
    axis: [f64; 3],
    /// Cosine of half the angle; 2 for a block without rays.
    cosine: f64,
    sine: f64,
}

/// Cone of directions in which the camera sees a ball.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ViewCone {
    /// All directions: the camera is inside the ball.
    All,
    /// Directions around an axis.
    Cone {
        /// Unit direction of the ball's center.
        axis: [f64; 3],
        /// Cosine of half the angle.
        cosine: f64,
        /// Sine of half the angle.
        sine: f64,
    },
}

impl ViewCone {
    /// The cone of a ball around a point of the optical frame \[m\].
    pub(crate) fn of_sphere(middle: [f64; 3], radius: f64) -> Self {
        let far = dot(middle, middle).sqrt();
        let sine = radius / far + CONE_MARGIN;
        if sine >= 1.0 || sine.is_nan() {
            return Self::All;
        }
        Self::Cone { axis: middle.map(|x| x / far), cosine: (1.0 - sine * sine).sqrt(), sine }
    }
}

impl LensRays {
    /// Computes the rays of an image of `width` by `height` pixels: one through the center of each pixel, and with
    /// `samples` 4 those of its four color samples too.
    ///
    /// # Errors
    ///
    /// [`OpticsError::LensFolds`] if pixels lie where the mapping of the lens cannot be inverted, and
    /// [`OpticsError::NoVisiblePixel`] if no pixel lies in the lens's domain.
    pub fn new(optics: &Optics, [width, height]: [usize; 2], samples: u8) -> Result<Self, OpticsError> {
        let planes = if samples == 4 { SAMPLES.len() } else { 1 };
        let blocks = [width.div_ceil(BLOCK), height.div_ceil(BLOCK)];
        let mut rays = Self {
            optics: *optics,
            size: [width, height],
            planes,
            directions: vec![0.0; planes * blocks[0] * blocks[1] * (BLOCK / 2) * GROUP_FLOATS],
            cones: Vec::with_capacity(blocks[0] * blocks[1]),
            pixel_spacing: 0.0,
            falloff: OnceLock::new(),
        };
        for (plane, offset) in SAMPLES.iter().enumerate().take(planes) {
            let [dx, dy] = offset.map(|x| f64::from(x) / 256.0 + 0.5);
            for y in 0..height {
                for x in 0..width {
                    let at = [x as f64 + dx, y as f64 + dy];
                    match optics.ray(at) {
                        Some(direction) => rays.set(plane, [x, y], direction.map(|c| c as f32)),
                        None => check_not_folded(optics, at)?,
                    }
                }
            }
        }
        for by in 0..blocks[1] {
            for bx in 0..blocks[0] {
                let cone = rays.cone([bx * BLOCK, by * BLOCK]);
                rays.cones.push(cone);
            }
        }
        rays.pixel_spacing =
            rays.spacing().ok_or_else(|| OpticsError::NoVisiblePixel { lens: optics.lens().name() })?;
        Ok(rays)
    }

    /// The lens with its pixel intrinsics.
    pub fn optics(&self) -> &Optics {
        &self.optics
    }

    /// Image size: pixels per row, and rows.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Color samples per pixel: 4, or 1 if there are only rays through the pixel centers.
    pub fn samples(&self) -> u8 {
        if self.planes > 1 { 4 } else { 1 }
    }

    /// Memory held \[bytes\].
    pub fn bytes(&self) -> usize {
        let numbers = self.directions.capacity() + self.falloff.get().map_or(0, Vec::capacity);
        size_of::<f32>() * numbers + size_of::<Cone>() * self.cones.capacity()
    }

    /// Memory of the rays of an image \[bytes\], before allocation.
    pub(crate) fn table_bytes([width, height]: [usize; 2], samples: u8) -> usize {
        let blocks = width.div_ceil(BLOCK).saturating_mul(height.div_ceil(BLOCK));
        let planes = if samples == 4 { SAMPLES.len() } else { 1 };
        let of_block = planes * BLOCK / 2 * GROUP_FLOATS + BLOCK * BLOCK;
        blocks.saturating_mul(size_of::<Cone>() + of_block * size_of::<f32>())
    }

    /// True if all rays have z = 1 instead of length 1.
    pub fn is_forward(&self) -> bool {
        self.optics.lens().is_forward()
    }

    /// Mean distance between the stored directions of neighboring pixels.
    pub(crate) fn pixel_spacing(&self) -> f64 {
        self.pixel_spacing
    }

    /// Start of the group of a pixel, and the pixel's lane.
    #[inline(always)]
    fn group_index(&self, plane: usize, [x, y]: [usize; 2]) -> (usize, usize) {
        let wide = self.size[0].div_ceil(BLOCK);
        let pairs = self.size[1].div_ceil(BLOCK) * (BLOCK / 2);
        (((plane * pairs + y / 2) * wide + x / BLOCK) * GROUP_FLOATS, y % 2 * BLOCK + x % BLOCK)
    }

    fn set(&mut self, plane: usize, at: [usize; 2], direction: [f32; 3]) {
        let (group, lane) = self.group_index(plane, at);
        for (axis, x) in direction.into_iter().enumerate() {
            self.directions[group + axis * LANES + lane] = x;
        }
    }

    /// Ray of a sample of the pixel in column `at[0]` and row `at[1]`, in the optical frame; 0 if the sample has no
    /// ray. Plane 0 is the pixel center, planes 1 to 4 are the color samples, if [`samples`](Self::samples) is 4.
    #[inline(always)]
    pub fn direction(&self, plane: usize, at: [usize; 2]) -> [f32; 3] {
        let (group, lane) = self.group_index(plane, at);
        [0, 1, 2].map(|axis| self.directions[group + axis * LANES + lane])
    }

    /// Illumination of a pixel relative to the optical axis: `Optics::falloff` of its center.
    pub fn falloff(&self, [x, y]: [usize; 2]) -> f64 {
        let all = self.falloff.get_or_init(|| {
            let [width, height] = self.size;
            let center = |k: usize| [(k % width) as f64 + 0.5, (k / width) as f64 + 0.5];
            let falloff = self.optics.falloff();
            (0..width * height).map(|k| falloff(center(k)) as f32).collect()
        });
        f64::from(all[y * self.size[0] + x])
    }

    /// Directions, in the optical frame, of the rays through the centers of 8 x 2 pixels, the first of which is at
    /// `at`.
    #[inline(always)]
    pub(crate) fn at_pixels<S: Simd>(&self, s: S, at: [usize; 2]) -> V3<S> {
        let group = &self.directions[self.group_index(0, at).0..];
        V3 { x: load(s, group), y: load(s, &group[LANES..]), z: load(s, &group[2 * LANES..]) }
    }

    /// Directions, in the optical frame, of the rays through sixteen points, each of which is a sample of a pixel.
    #[inline(always)]
    pub(crate) fn at_points<S: Simd>(&self, s: S, u: F<S>, v: F<S>) -> V3<S> {
        let (u, v): ([f32; LANES], [f32; LANES]) = (u.array(), v.array());
        let mut out = [[0.0f32; LANES]; 3];
        for lane in 0..LANES {
            let [x, y] = [u[lane].floor(), v[lane].floor()];
            // Multiples of 1/256, which single precision holds exactly.
            let offset = [u[lane] - x - 0.5, v[lane] - y - 0.5].map(|d| (d * 256.0) as i32);
            let plane = SAMPLES.iter().take(self.planes).position(|sample| *sample == offset).unwrap_or(0);
            let inside = [(x as usize).min(self.size[0] - 1), (y as usize).min(self.size[1] - 1)];
            let direction = self.direction(plane, inside);
            for (to, from) in out.iter_mut().zip(direction) {
                to[lane] = from;
            }
        }
        V3 { x: load(s, &out[0]), y: load(s, &out[1]), z: load(s, &out[2]) }
    }

    /// True if a block of 8 x 8 pixels, given in blocks, may see a ball.
    #[inline(always)]
    pub(crate) fn may_contain(&self, [bx, by]: [usize; 2], sight: &ViewCone) -> bool {
        let cone = &self.cones[by * self.size[0].div_ceil(BLOCK) + bx];
        if cone.cosine > 1.0 {
            return false;
        }
        let ViewCone::Cone { axis, cosine, sine } = sight else { return true };
        // Compares the angle between the axes with the sum of both angles, which may exceed half a turn.
        let (sum_cosine, sum_sine) = (cone.cosine * cosine - cone.sine * sine, cone.sine * cosine + cone.cosine * sine);
        sum_sine <= 0.0 || dot(cone.axis, *axis) >= sum_cosine
    }

    /// Bounding cone of the rays of a block, given by its first pixel.
    fn cone(&self, [x0, y0]: [usize; 2]) -> Cone {
        let rays = (0..self.planes).flat_map(|plane| {
            let pixels = (0..BLOCK * BLOCK).map(move |k| [x0 + k % BLOCK, y0 + k / BLOCK]);
            pixels.filter_map(move |at| unit(self.direction(plane, at).map(f64::from)))
        });
        let sum = rays.clone().fold([0.0; 3], add);
        let Some(first) = rays.clone().next() else { return Cone { axis: [0.0; 3], cosine: 2.0, sine: 0.0 } };
        let axis = unit(sum).unwrap_or(first);
        // By the chord, which keeps the digits of small angles.
        let apart = |ray: [f64; 3]| {
            let chord = norm(sub(ray, axis));
            2.0 * (0.5 * chord).min(1.0).asin()
        };
        let angle = (rays.map(apart).fold(0.0f64, f64::max) + CONE_MARGIN).min(std::f64::consts::PI);
        Cone { axis, cosine: angle.cos(), sine: angle.sin().max(0.0) }
    }

    /// Mean distance between the rays of neighboring pixels in a row or in a column, whichever is larger; `None`
    /// without rays.
    fn spacing(&self) -> Option<f64> {
        let [width, height] = self.size;
        let (mut sum, mut count, mut any) = ([0.0; 2], [0.0f64; 2], false);
        for y in 0..height {
            for x in 0..width {
                let here = self.direction(0, [x, y]).map(f64::from);
                if here == [0.0; 3] {
                    continue;
                }
                any = true;
                for (axis, beside) in [[x + 1, y], [x, y + 1]].into_iter().enumerate() {
                    if beside[0] >= width || beside[1] >= height {
                        continue;
                    }
                    let there = self.direction(0, beside).map(f64::from);
                    if there != [0.0; 3] {
                        sum[axis] += norm(sub(there, here));
                        count[axis] += 1.0;
                    }
                }
            }
        }
        let f = self.optics.pixels();
        let mean = |axis: usize| if count[axis] > 0.0 { sum[axis] / count[axis] } else { 0.0 };
        let larger = mean(0).max(mean(1));
        any.then(|| if larger > 0.0 { larger } else { 1.0 / f.fx.min(f.fy) })
    }
}

/// Returns an error for a pixel without a ray, if the mapping of the lens folds back or has a pole.
fn check_not_folded(optics: &Optics, [u, v]: [f64; 2]) -> Result<(), OpticsError> {
    let (domain, f) = (optics.domain(), optics.pixels());
    if !domain.folds {
        return Ok(());
    }
    let reach = ((u - f.cx) / f.fx).hypot((v - f.cy) / f.fy);
    let requirement = format!("pixel ({u:.1}, {v:.1}) is at radius {reach:.4}");
    Err(OpticsError::LensFolds { lens: optics.lens().name(), angle: domain.angle, radius: domain.radius, requirement })
}

/// All other fields follow from these.
impl PartialEq for LensRays {
    fn eq(&self, other: &Self) -> bool {
        let Self { optics, size, planes, directions, cones: _, pixel_spacing: _, falloff: _ } = self;
        (optics, size, planes) == (&other.optics, &other.size, &other.planes) && *directions == other.directions
    }
}

/// Short: the table is long.
impl fmt::Debug for LensRays {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LensRays").field("optics", &self.optics).field("size", &self.size).finish_non_exhaustive()
    }
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    try_normalize(a, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intrinsics::PixelIntrinsics;
    use crate::lens::Equidistant;
    use crate::raster::tile::SAMPLES;
    use crate::simd::{all_levels, at_level, load};

    /// Rays in lanes equal those of the optics, to the bit, at every SIMD level.
    #[test]
    fn points_in_lanes() {
        let pixels = PixelIntrinsics { fx: 20.0, fy: 22.0, cx: 30.25, cy: 25.5 };
        let optics = Optics::new(Equidistant { max_angle: 1.2 }.into(), pixels).unwrap();
        let rays = LensRays::new(&optics, [64, 48], 4).unwrap();
        for offset in SAMPLES {
            let at = [31.5 + offset[0] as f32 / 256.0, 17.5 + offset[1] as f32 / 256.0];
            let expected = optics.ray(at.map(f64::from)).unwrap().map(|x| x as f32);
            for level in all_levels() {
                let found = at_level!(level, s => {
                    let found = rays.at_points(s, load(s, &[at[0]; 16]), load(s, &[at[1]; 16]));
                    [found.x, found.y, found.z].map(|x| x.array()[7])
                });
                assert_eq!(found, expected);
            }
        }
    }
}
