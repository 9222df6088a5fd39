//! The trait of lenses, and how far a lens sees.

use super::poles::Poles;
use crate::optics_error::OpticsError;

/// How far a lens sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// The largest angle between a ray and the optical axis \[rad\].
    pub angle: f64,
    /// How far from the principal point such a ray is, in the normalized image (times fx: in pixels).
    pub radius: f64,
    /// True if rays end there because the mapping folds back or has a pole, not at an angle that was asked for.
    pub folds: bool,
    /// Of [`OpenCv`] alone.
    pub(super) poles: Poles,
}

impl Domain {
    /// How far a lens sees that needs no more to be known of it.
    pub const fn new(angle: f64, radius: f64, folds: bool) -> Self {
        Self { angle, radius, folds, poles: Poles::NONE }
    }
}

/// One kind of lens: its file, and a line in the list below.
pub trait LensModel: Copy + Default {
    /// Its name.
    const NAME: &'static str;
    /// Accepted aliases.
    const ALIASES: &'static [&'static str];
    /// True if every ray goes forward, so that near, far and depth are measured along the optical axis, as without a lens.
    /// Of others, near and far are distances along the ray.
    const FORWARD: bool = false;
    /// True if there is an aperture with an optical axis; a panorama is put together of many images.
    const HAS_AXIS: bool = true;

    /// True if these numbers make a pinhole.
    fn is_pinhole(&self) -> bool {
        false
    }

    /// The angle that was given as the end of what it sees \[rad\], where one was.
    fn max_angle(&self) -> Option<f64>;

    /// Checks every number.
    ///
    /// # Errors
    ///
    /// [`OpticsError::Lens`].
    fn validate(&self) -> Result<(), OpticsError>;

    /// How far it sees; the numbers are good.
    fn domain(&self) -> Domain;

    /// The point of the normalized image where a direction is seen; `None` outside of the domain.
    fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]>;

    /// The direction that is seen at a point of the normalized image: with z = 1 if all rays go
    /// [forward](Self::FORWARD), else of length 1. `None` outside of the domain.
    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]>;
}

/// Checks that numbers are finite.
pub(super) fn finite(numbers: &[(&'static str, f64)]) -> Result<(), OpticsError> {
    match numbers.iter().find(|(_, value)| !value.is_finite()) {
        Some(&(what, value)) => Err(OpticsError::Lens { what, value, allowed: "finite" }),
        None => Ok(()),
    }
}

/// Checks the angle at which a lens ends.
pub(super) fn angle_up_to(max_angle: f64, most: f64, allowed: &'static str) -> Result<(), OpticsError> {
    if max_angle > 0.0 && max_angle <= most {
        return Ok(());
    }
    Err(OpticsError::Lens { what: "max_angle", value: max_angle, allowed })
}
