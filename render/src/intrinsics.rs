//! Camera intrinsics: conversion of focal lengths, sensor sizes or angles to pixels.

use super::optics_error::OpticsError;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Pinhole intrinsics without distortion, in several user-facing forms. The center of pixel (u, v) is (u + 0.5, v +
/// 0.5).
///
/// OpenCV and ROS put the center of that pixel at (u, v): add half a pixel to their calibrated cx and cy. `CameraInfo`
/// has the numbers of ROS's calibration files, and converts between both conventions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Intrinsics {
    /// Focal lengths and principal point \[pixels\]; fx and fy may differ, the principal point may lie anywhere.
    Pixels {
        /// Focal length along x.
        fx: f64,
        /// Focal length along y.
        fy: f64,
        /// Principal point, from the left edge.
        cx: f64,
        /// Principal point, from the upper edge.
        cy: f64,
    },
    /// An image sensor (film) of a given size, as in Isaac's `PinholeCameraCfg`. All numbers share one unit of length,
    /// of any kind.
    ///
    /// fx = W f / horizontal_aperture, and fy = H f / vertical_aperture, or fx if `vertical_aperture` is `None` (square
    /// pixels). The principal point lies `horizontal_offset` to the right and `vertical_offset` below the center of the
    /// sensor: cx = W / 2 + fx horizontal_offset / f, cy = H / 2 + fy vertical_offset / f. (Isaac leaves out the
    /// division by f, which is the same only for f = 1.)
    Aperture {
        /// Focal length f, in the same unit as the apertures.
        focal_length: f64,
        /// Width of the sensor.
        horizontal_aperture: f64,
        /// Height of the sensor; `None` makes pixels square.
        vertical_aperture: Option<f64>,
        /// Offset of the principal point to the right of the center.
        #[serde(default)]
        horizontal_offset: f64,
        /// Offset of the principal point below the center.
        #[serde(default)]
        vertical_offset: f64,
    },
    /// Vertical field of view, with square pixels and the principal point at the center.
    Fovy {
        /// Angle between the lower and the upper edge \[rad\], between 0 and pi.
        radians: f64,
    },
}

/// Pinhole intrinsics \[pixels\]; the center of pixel (u, v) is (u + 0.5, v + 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelIntrinsics {
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// Principal point, from the left edge.
    pub cx: f64,
    /// Principal point, from the upper edge.
    pub cy: f64,
}

impl Intrinsics {
    /// EmbodiChain's default intrinsics: f = 600 pixels in an image 640 wide. f is 15/16 of the width in images of any
    /// size, and pixels are square.
    pub const EMBODICHAIN: Self = Self::Aperture {
        focal_length: 15.0,
        horizontal_aperture: 16.0,
        vertical_aperture: None,
        horizontal_offset: 0.0,
        vertical_offset: 0.0,
    };

    /// Isaac's default intrinsics: a focal length of 24 with a sensor 20.955 wide, square pixels.
    pub const ISAAC: Self = Self::Aperture {
        focal_length: 24.0,
        horizontal_aperture: 20.955,
        vertical_aperture: None,
        horizontal_offset: 0.0,
        vertical_offset: 0.0,
    };

    /// Intrinsics from the matrix `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` \[pixels\].
    ///
    /// # Errors
    ///
    /// [`OpticsError::IntrinsicMatrix`] for another form (skew, scale), [`OpticsError::Lens`] for an invalid number.
    pub fn from_matrix(matrix: &Matrix3<f64>) -> Result<Self, OpticsError> {
        let fixed = [((0, 1), 0.0), ((1, 0), 0.0), ((2, 0), 0.0), ((2, 1), 0.0), ((2, 2), 1.0)];
        for ((row, column), wanted) in fixed {
            let value = matrix[(row, column)];
            if value != wanted {
                return Err(OpticsError::IntrinsicMatrix { row, column, value });
            }
        }
        let (fx, fy, cx, cy) = (matrix[(0, 0)], matrix[(1, 1)], matrix[(0, 2)], matrix[(1, 2)]);
        let pixels = PixelIntrinsics { fx, fy, cx, cy };
        pixels.validate()?;
        Ok(Self::Pixels { fx, fy, cx, cy })
    }

    /// Converts the intrinsics to pixels of an image of `width` by `height` pixels. [`Pixels`](Self::Pixels) are not
    /// scaled to the image size.
    ///
    /// # Errors
    ///
    /// [`OpticsError::Lens`] if a number is not finite, a length is not positive, or an angle is not between 0 and pi.
    pub fn to_pixels(&self, width: usize, height: usize) -> Result<PixelIntrinsics, OpticsError> {
        let (w, h) = (width as f64, height as f64);
        let pixels = match *self {
            Self::Pixels { fx, fy, cx, cy } => PixelIntrinsics { fx, fy, cx, cy },
            Self::Aperture {
                focal_length,
                horizontal_aperture,
                vertical_aperture,
                horizontal_offset,
                vertical_offset,
            } => {
                check_positive("focal_length", focal_length)?;
                check_positive("horizontal_aperture", horizontal_aperture)?;
                check_finite("horizontal_offset", horizontal_offset)?;
                check_finite("vertical_offset", vertical_offset)?;
                let per_x = w / horizontal_aperture;
                let per_y = match vertical_aperture {
                    Some(aperture) => h / check_positive("vertical_aperture", aperture)?,
                    None => per_x,
                };
                PixelIntrinsics {
                    fx: per_x * focal_length,
                    fy: per_y * focal_length,
                    cx: 0.5 * w + per_x * horizontal_offset,
                    cy: 0.5 * h + per_y * vertical_offset,
                }
            }
            Self::Fovy { radians } => {
                if !(radians > 0.0 && radians < PI) {
                    let allowed = "between 0 and pi";
                    return Err(OpticsError::Lens { what: "the vertical angle", value: radians, allowed });
                }
                let f = 0.5 * h / (0.5 * radians).tan();
                PixelIntrinsics { fx: f, fy: f, cx: 0.5 * w, cy: 0.5 * h }
            }
        };
        pixels.validate()?;
        Ok(pixels)
    }

    /// The 3x3 intrinsic matrix in pixels of an image of `width` by `height`.
    ///
    /// # Errors
    ///
    /// As [`to_pixels`](Self::to_pixels).
    pub fn matrix(&self, width: usize, height: usize) -> Result<Matrix3<f64>, OpticsError> {
        self.to_pixels(width, height).map(|pixels| pixels.matrix())
    }
}

impl From<PixelIntrinsics> for Intrinsics {
    fn from(pixels: PixelIntrinsics) -> Self {
        let PixelIntrinsics { fx, fy, cx, cy } = pixels;
        Self::Pixels { fx, fy, cx, cy }
    }
}

impl PixelIntrinsics {
    /// The matrix `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    fn validate(&self) -> Result<(), OpticsError> {
        check_positive("fx", self.fx)?;
        check_positive("fy", self.fy)?;
        check_finite("cx", self.cx)?;
        check_finite("cy", self.cy).map(|_| ())
    }
}

fn check_positive(what: &'static str, value: f64) -> Result<f64, OpticsError> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(OpticsError::Lens { what, value, allowed: "positive and finite" })
}

fn check_finite(what: &'static str, value: f64) -> Result<f64, OpticsError> {
    if value.is_finite() { Ok(value) } else { Err(OpticsError::Lens { what, value, allowed: "finite" }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms() {
        let film = |vertical_aperture, vertical_offset| Intrinsics::Aperture {
            focal_length: 24.0,
            horizontal_aperture: 20.0,
            vertical_aperture,
            horizontal_offset: -1.0,
            vertical_offset,
        };
        // Square pixels: 32 per unit of sensor length on both axes.
        let square = film(None, 2.0).to_pixels(640, 480).unwrap();
        assert_eq!(square, PixelIntrinsics { fx: 768.0, fy: 768.0, cx: 288.0, cy: 304.0 });
        // The same sensor with its height given: 20 * 480 / 640.
        assert_eq!(film(Some(15.0), 2.0).to_pixels(640, 480).unwrap(), square);
        // Half as high: 64 pixels per unit of sensor length along y.
        let tall = film(Some(7.5), 0.5).to_pixels(640, 480).unwrap();
        assert_eq!(tall, PixelIntrinsics { fx: 768.0, fy: 1536.0, cx: 288.0, cy: 272.0 });

        let isaac = Intrinsics::ISAAC.to_pixels(640, 480).unwrap();
        assert!((isaac.fx - 640.0 * 24.0 / 20.955).abs() < 1e-9 && isaac.fx == isaac.fy);
        let default = |w, h| Intrinsics::EMBODICHAIN.to_pixels(w, h).unwrap();
        assert_eq!(default(640, 480), PixelIntrinsics { fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0 });
        assert_eq!(default(64, 48), PixelIntrinsics { fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0 });
        let right_angle = Intrinsics::Fovy { radians: PI / 2.0 }.to_pixels(300, 200).unwrap();
        assert!((right_angle.fx - 100.0).abs() < 1e-12 && (right_angle.cx, right_angle.cy) == (150.0, 100.0));

        let again = Intrinsics::from_matrix(&tall.matrix()).unwrap();
        assert_eq!(again, Intrinsics::from(tall));
        assert_eq!(again.matrix(1, 1).unwrap(), tall.matrix());
    }

    #[test]
    fn mistakes() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let lens = Intrinsics::Pixels { fx: bad, fy: 1.0, cx: 0.0, cy: 0.0 };
            assert!(matches!(lens.to_pixels(4, 4), Err(OpticsError::Lens { what: "fx", .. })));
            let lens = Intrinsics::Aperture {
                focal_length: 1.0,
                horizontal_aperture: 1.0,
                vertical_aperture: Some(bad),
                horizontal_offset: 0.0,
                vertical_offset: 0.0,
            };
            assert!(matches!(lens.to_pixels(4, 4), Err(OpticsError::Lens { what: "vertical_aperture", .. })));
            assert!(Intrinsics::Fovy { radians: bad }.to_pixels(4, 4).is_err());
        }
        assert!(Intrinsics::Fovy { radians: PI }.to_pixels(4, 4).is_err());
        let lens = Intrinsics::Pixels { fx: 1.0, fy: 1.0, cx: 0.0, cy: f64::NAN };
        assert_eq!(lens.to_pixels(4, 4).unwrap_err().to_string(), "cy of the lens is NaN; it must be finite");
        let skewed = Matrix3::new(1.0, 0.1, 2.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0);
        let error = Intrinsics::from_matrix(&skewed).unwrap_err();
        assert_eq!(error, OpticsError::IntrinsicMatrix { row: 0, column: 1, value: 0.1 });
    }
}
