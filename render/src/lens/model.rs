//! The trait of lens models, and the domain of a lens.

use super::poles::Poles;
use crate::optics_error::OpticsError;

/// Domain of a lens: the range of visible directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Angle from the optical axis up to which every direction is visible \[rad\]. If the distortion folds back at an
    /// angle that depends on the direction, directions beyond this angle may be visible too.
    pub angle: f64,
    /// Distance of a ray at this angle from the principal point in the normalized image (times fx: in pixels); +inf for
    /// a pinhole, and at a pole where the image radius grows without bound.
    pub radius: f64,
    /// True if the domain ends at this angle because the mapping folds back or has a pole, not at a requested angle.
    pub folds: bool,
    /// Poles of the radial factor of [`OpenCv`]; empty for other lenses.
    pub(super) poles: Poles,
}

impl Domain {
    /// Creates a domain from its [`angle`](Self::angle), [`radius`](Self::radius) and [`folds`](Self::folds), without
    /// poles (for lenses other than [`OpenCv`](super::OpenCv)).
    pub const fn new(angle: f64, radius: f64, folds: bool) -> Self {
        Self { angle, radius, folds, poles: Poles::NONE }
    }
}

/// A kind of lens: one file, and one line in the list of lenses.
pub trait LensModel: Copy + Default {
    /// Canonical name.
    const NAME: &'static str;
    /// Accepted aliases.
    const ALIASES: &'static [&'static str];
    /// True if every ray goes forward, so that near and far are measured along the optical axis, as for a pinhole. For
    /// other lenses, near and far are distances along the ray.
    const FORWARD: bool = false;
    /// True if there is an aperture with an optical axis; a panorama is composed of many images.
    const HAS_AXIS: bool = true;

    /// True if the lens is a pinhole without distortion and without a `max_angle`. The default is false.
    fn is_pinhole(&self) -> bool {
        false
    }

    /// Requested largest angle from the optical axis \[rad\]; `None` if not set.
    fn max_angle(&self) -> Option<f64>;

    /// Checks that every number is valid.
    ///
    /// # Errors
    ///
    /// [`OpticsError::Lens`] for the first invalid number.
    fn validate(&self) -> Result<(), OpticsError>;

    /// Computes the domain; the numbers are valid.
    fn domain(&self) -> Domain;

    /// Projects a direction of any length, in the optical frame (x right, y down, z forward), to a point of the
    /// normalized image; `None` outside of the domain.
    fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]>;

    /// Direction, in the optical frame (x right, y down, z forward), of the ray through a point of the normalized
    /// image: with z = 1 if all rays go [forward](Self::FORWARD), else of length 1. `None` outside of the domain.
    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]>;
}

/// Checks that numbers are finite.
pub(super) fn check_finite(numbers: &[(&'static str, f64)]) -> Result<(), OpticsError> {
    match numbers.iter().find(|(_, value)| !value.is_finite()) {
        Some(&(what, value)) => Err(OpticsError::Lens { what, value, allowed: "finite" }),
        None => Ok(()),
    }
}

/// Checks that the largest angle of a lens is above 0 and at most `most` \[rad\]; `allowed` states this range in the
/// error.
pub(super) fn check_max_angle(max_angle: f64, most: f64, allowed: &'static str) -> Result<(), OpticsError> {
    if max_angle > 0.0 && max_angle <= most {
        return Ok(());
    }
    Err(OpticsError::Lens { what: "max_angle", value: max_angle, allowed })
}
