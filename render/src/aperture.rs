//! Depth of field of a thin lens.

use crate::visibility::RenderError;
use serde::{Deserialize, Serialize};

/// Aperture of a thin lens: surfaces away from the focus distance are blurred.
///
/// Depth of field needs [`Renderer::RayTraced`](crate::renderer::Renderer::RayTraced), whose camera rays start all over
/// the aperture. It blurs the color channel only. All other channels are those of the aperture's center.
///
/// The field of view stays that of [`Intrinsics`](crate::intrinsics::Intrinsics) for every focus distance.
///
/// ```
/// use kinetoscope_render::Aperture;
///
/// // A 50 mm lens at f/2, focused at 2 m, in a camera with a focal length of 1000 pixels.
/// let aperture = Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 };
/// assert_eq!(aperture.diameter(), 0.025);
/// assert_eq!(aperture.circle_of_confusion(2.0, 1000.0), 0.0);
/// // c = A |S2 - S1| / S2 f / (S1 - f) on the sensor, where 1000 pixels are f S1 / (S1 - f).
/// assert!((aperture.circle_of_confusion(4.0, 1000.0) - 1000.0 * 0.025 * (0.5 - 0.25)).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aperture {
    /// Focal length of the lens \[m\]. It determines the aperture diameter, together with the f-number, and is the
    /// lower limit of the focus distance. It does not change the field of view.
    pub focal_length: f64,
    /// Focal length divided by the aperture diameter. An infinite f-number is a pinhole.
    pub f_number: f64,
    /// Depth of the plane in focus along the optical axis \[m\], farther than the focal length; may be infinite.
    /// Through lenses whose rays do not all go forward, it is the distance from the camera.
    pub focus_distance: f64,
}

impl Aperture {
    /// Diameter of the aperture \[m\].
    pub fn diameter(&self) -> f64 {
        self.focal_length / self.f_number
    }

    /// Diameter \[pixels\] of the disc to which a point at `depth` \[m\] along the optical axis is blurred, for a
    /// camera of focal length `f` \[pixels\]. Source: similar triangles, see any text on optics, such as Hecht, Optics,
    /// section 5.2.
    pub fn circle_of_confusion(&self, depth: f64, f: f64) -> f64 {
        f * self.diameter() * (1.0 / self.focus_distance - 1.0 / depth).abs()
    }

    /// Checks that the numbers are in their ranges.
    ///
    /// # Errors
    ///
    /// [`RenderError::Aperture`] with the name, the value and the allowed range of the first number out of
    /// range.
    pub fn check(&self) -> Result<(), RenderError> {
        let Self { focal_length, f_number, focus_distance } = *self;
        let wrong = |what, value, allowed| Err(RenderError::Aperture { what, value, allowed });
        if !(focal_length > 0.0 && focal_length.is_finite()) {
            return wrong("focal_length", focal_length, "positive and finite");
        }
        if f_number.is_nan() || f_number <= 0.0 {
            return wrong("f_number", f_number, "positive; infinity means a pinhole");
        }
        if focus_distance.is_nan() || focus_distance <= focal_length {
            return wrong("focus_distance", focus_distance, "larger than the focal length; infinity is allowed");
        }
        // Far wider than any lens; its square is finite in single precision.
        if self.diameter() > 1e6 {
            return wrong(
                "f_number",
                f_number,
                "such that the aperture diameter, focal_length / f_number, is at most 1e6 m",
            );
        }
        Ok(())
    }
}
