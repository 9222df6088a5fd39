//! A lens in front of pixels.

use super::{Domain, Lens};
use crate::camera::error::CameraError;
use crate::camera::intrinsics::{Intrinsics, PixelIntrinsics};

/// A lens in front of pixels, checked: from directions to pixels and back.
///
/// ```
/// use sensors::camera::{Intrinsics, Lens, Optics};
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
    /// The lens in front of pixels.
    ///
    /// # Errors
    ///
    /// [`CameraError::Lens`] for a bad number, [`CameraError::LensFolds`] where the mapping folds back before
    /// the angle that the lens is to see.
    pub fn new(lens: Lens, pixels: PixelIntrinsics) -> Result<Self, CameraError> {
        let pixels = Intrinsics::from(pixels).to_pixels(1, 1)?;
        Ok(Self { lens, pixels, domain: lens.domain()? })
    }

    /// The lens.
    pub fn lens(&self) -> Lens {
        self.lens
    }

    /// The pixels.
    pub fn pixels(&self) -> PixelIntrinsics {
        self.pixels
    }

    /// How far the lens sees.
    pub fn domain(&self) -> Domain {
        self.domain
    }

    /// The pixel (u, v) where a direction of the optical frame (x right, y down, z forward), of any length, is seen; `None`
    /// where the lens does not see it. The centre of the pixel in column k is at k + 0.5.
    pub fn project(&self, direction: [f64; 3]) -> Option<[f64; 2]> {
        let PixelIntrinsics { fx, fy, cx, cy } = self.pixels;
        let [x, y] = self.lens.project(&self.domain, direction)?;
        Some([cx + fx * x, cy + fy * y])
    }

    /// The direction of length 1 in the optical frame that is seen at the pixel (u, v); `None` outside of what the lens sees.
    pub fn unproject(&self, pixel: [f64; 2]) -> Option<[f64; 3]> {
        let [x, y, z] = self.ray(pixel)?;
        let by = 1.0 / (x * x + y * y + z * z).sqrt();
        Some([x * by, y * by, z * by])
    }

    /// As [`unproject`](Self::unproject), with z = 1 where all rays go forward: near and far count lengths of it.
    pub(crate) fn ray(&self, [u, v]: [f64; 2]) -> Option<[f64; 3]> {
        let PixelIntrinsics { fx, fy, cx, cy } = self.pixels;
        self.lens.unproject(&self.domain, [(u - cx) / fx, (v - cy) / fy])
    }
}
