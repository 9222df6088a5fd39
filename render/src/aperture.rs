//! Depth of field: a lens that has a size.

use crate::visibility::RenderError;
use serde::{Deserialize, Serialize};

/// The opening of a thin lens: what is not at the distance that it is focused on is blurred. Needs
/// [`Renderer::RayTraced`](crate::renderer::Renderer::RayTraced), whose paths begin all over the opening: colors are blurred, all other
/// channels are those of its middle.
///
/// Fields of view stay those of [`Intrinsics`](crate::intrinsics::Intrinsics), whatever the lens is focused on.
///
/// ```
/// use kinetoscope_render::Aperture;
///
/// // A lens of 50 mm at f/2, focused on what is 2 m away, in a camera whose focal length is 1000 pixels.
/// let aperture = Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 };
/// assert_eq!(aperture.diameter(), 0.025);
/// assert_eq!(aperture.circle_of_confusion(2.0, 1000.0), 0.0);
/// // c = A |S2 - S1| / S2 f / (S1 - f) on the sensor, and f S1 / (S1 - f) of it are 1000 pixels.
/// assert!((aperture.circle_of_confusion(4.0, 1000.0) - 1000.0 * 0.025 * (0.5 - 0.25)).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aperture {
    /// Focal length of the lens \[m\]: with the f-number it gives the opening, and nothing else.
    pub focal_length: f64,
    /// The focal length over the diameter of the opening; infinite is an opening without a size.
    pub f_number: f64,
    /// The depth along the optical axis that is sharp \[m\] (through lenses whose rays go aside, the distance), farther than the
    /// focal length; may be infinite.
    pub focus_distance: f64,
}

impl Aperture {
    /// The diameter of the opening \[m\].
    pub fn diameter(&self) -> f64 {
        self.focal_length / self.f_number
    }

    /// The diameter of the disc that a point at a depth \[m\] becomes \[pixels\], where a camera's focal length is `f` \[pixels\].
    /// Source: similar triangles, see any text on optics, such as Hecht, Optics, section 5.2.
    pub fn circle_of_confusion(&self, depth: f64, f: f64) -> f64 {
        f * self.diameter() * (1.0 / self.focus_distance - 1.0 / depth).abs()
    }

    /// Checks the numbers.
    pub fn check(&self) -> Result<(), RenderError> {
        let Self { focal_length, f_number, focus_distance } = *self;
        let wrong = |what, value, allowed| Err(RenderError::Aperture { what, value, allowed });
        if !(focal_length > 0.0 && focal_length.is_finite()) {
            return wrong("focal_length", focal_length, "positive and finite");
        }
        if f_number.is_nan() || f_number <= 0.0 {
            return wrong("f_number", f_number, "positive; infinite is an opening without a size");
        }
        if focus_distance.is_nan() || focus_distance <= focal_length {
            return wrong("focus_distance", focus_distance, "larger than the focal length; infinite is possible");
        }
        // Far wider than any lens; squares of it are finite in single precision.
        if self.diameter() > 1e6 {
            return wrong(
                "f_number",
                f_number,
                "such that the opening, focal length / f_number, is at most 1e6 m wide",
            );
        }
        Ok(())
    }
}
