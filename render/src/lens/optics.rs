//! A lens with pixel intrinsics.

use super::{Domain, Lens};
use crate::intrinsics::{Intrinsics, PixelIntrinsics};
use crate::optics_error::OpticsError;
use nalgebra::Vector3;

/// A validated lens with pixel intrinsics: maps directions to pixels and back.
///
/// ```
/// use kinetoscope_render::Intrinsics;
/// use kinetoscope_render::lens::{Lens, Optics};
///
/// let intrinsics = Intrinsics::Pixels { fx: 300.0, fy: 300.0, cx: 320.0, cy: 240.0 };
/// let optics = Optics::new(Lens::from_name("equidistant")?, intrinsics.to_pixels(640, 480)?)?;
/// // A right angle from the optical axis: r = f theta.
/// let [u, v] = optics.project([1.0, 0.0, 0.0]).ok_or("not seen")?;
/// assert!((u - 320.0 - 300.0 * std::f64::consts::FRAC_PI_2).abs() < 1e-9 && (v - 240.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    lens: Lens,
    pixels: PixelIntrinsics,
    domain: Domain,
}

impl Optics {
    /// Combines a lens and intrinsics.
    ///
    /// # Errors
    ///
    /// [`OpticsError::Lens`] for an invalid number of either, [`OpticsError::LensFolds`] if the mapping folds back or
    /// has a pole before the lens's `max_angle`.
    pub fn new(lens: Lens, pixels: PixelIntrinsics) -> Result<Self, OpticsError> {
        let pixels = Intrinsics::from(pixels).to_pixels(1, 1)?;
        Ok(Self { lens, pixels, domain: lens.domain()? })
    }

    /// The same lens with other intrinsics, which are valid.
    pub(crate) fn with_pixels(&self, pixels: PixelIntrinsics) -> Self {
        Self { pixels, ..*self }
    }

    /// The lens model.
    pub fn lens(&self) -> Lens {
        self.lens
    }

    /// The pixel intrinsics.
    pub fn pixels(&self) -> PixelIntrinsics {
        self.pixels
    }

    /// Range of visible directions: largest angle to the optical axis \[rad\], and its radius in the normalized image.
    pub fn domain(&self) -> Domain {
        self.domain
    }

    /// Projects a direction of the optical frame (x right, y down, z forward), of any length, to the pixel (u, v).
    /// `None` outside of the lens's domain. The center of the pixel in column k is at k + 0.5.
    pub fn project(&self, direction: [f64; 3]) -> Option<[f64; 2]> {
        let PixelIntrinsics { fx, fy, cx, cy } = self.pixels;
        let [x, y] = self.lens.project(&self.domain, direction)?;
        Some([cx + fx * x, cy + fy * y])
    }

    /// Unit direction in the optical frame of the ray through the pixel (u, v); `None` outside of the lens's domain.
    pub fn unproject(&self, pixel: [f64; 2]) -> Option<[f64; 3]> {
        let [x, y, z] = self.ray(pixel)?;
        let by = 1.0 / (x * x + y * y + z * z).sqrt();
        Some([x * by, y * by, z * by])
    }

    /// Same as [`unproject`](Self::unproject), but with z = 1 instead of length 1 for [forward](Lens::is_forward)
    /// lenses. The points at the limits are this vector times `near` and `far`.
    pub fn ray(&self, [u, v]: [f64; 2]) -> Option<[f64; 3]> {
        let PixelIntrinsics { fx, fy, cx, cy } = self.pixels;
        self.lens.unproject(&self.domain, [(u - cx) / fx, (v - cy) / fy])
    }

    /// Illumination of a pixel relative to the principal point: its solid angle times the cosine of the ray with the
    /// optical axis, by which the aperture is foreshortened. 0 outside of the domain, and from a right angle on.
    pub(crate) fn falloff(&self) -> impl Fn([f64; 2]) -> f64 {
        let PixelIntrinsics { fx, fy, cx, cy } = self.pixels;
        let most = self.solid_angle([0.0; 2]);
        move |pixel| {
            let point = [(pixel[0] - cx) / fx, (pixel[1] - cy) / fy];
            let (Some(ray), Some(seen), Some(most)) = (self.unit(point), self.solid_angle(point), most) else {
                return 0.0;
            };
            ray.z.max(0.0) * seen / most
        }
    }

    /// Solid angle \[sr\] per unit of area of the normalized image at a point, by differences of rays that are 1e-7 rad
    /// apart near the axis. The step is coarse where rays spread without bound: at a right angle of the orthographic
    /// fisheye, and where a distortion is about to fold back. `None` outside of the domain.
    fn solid_angle(&self, point: [f64; 2]) -> Option<f64> {
        const NEAR_THE_AXIS: f64 = 1e-4;
        let [x, y] = self.lens.project(&self.domain, [NEAR_THE_AXIS, 0.0, 1.0])?;
        let step = 1e-7 * x.hypot(y) / NEAR_THE_AXIS;
        // At the edge of the domain both neighbors of a point may be outside; a point slightly farther in is used.
        self.solid_angle_with_step(point, step).or_else(|| {
            let inwards = 1.0 - step / point[0].hypot(point[1]);
            self.solid_angle_with_step(point.map(|x| inwards * x), step)
        })
    }

    fn solid_angle_with_step(&self, point: [f64; 2], apart: f64) -> Option<f64> {
        let here = self.unit(point)?;
        let slope = |axis: usize| {
            let beside = |by: f64| {
                let mut there = point;
                there[axis] += by;
                self.unit(there)
            };
            // One neighbor may be outside of the domain.
            match (beside(-apart), beside(apart)) {
                (Some(before), Some(after)) => Some((after - before) / (2.0 * apart)),
                (Some(before), None) => Some((here - before) / apart),
                (None, Some(after)) => Some((after - here) / apart),
                (None, None) => None,
            }
        };
        Some(slope(0)?.cross(&slope(1)?).norm())
    }

    /// Unit direction in the optical frame of the ray through a point of the normalized image; `None` outside of the
    /// domain.
    fn unit(&self, point: [f64; 2]) -> Option<Vector3<f64>> {
        Some(Vector3::from(self.lens.unproject(&self.domain, point)?).normalize())
    }
}
