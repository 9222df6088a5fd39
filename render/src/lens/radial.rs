//! Rotationally symmetric lenses, which map angles to radii.

/// Projects a direction in the optical frame to a point of the normalized image. `radius` maps an angle \[rad\] to the
/// image radius. `None` for angles beyond `most`, and for the direction straight back.
pub(super) fn project([x, y, z]: [f64; 3], most: f64, radius: impl Fn(f64) -> f64) -> Option<[f64; 2]> {
    let across = x.hypot(y);
    let angle = across.atan2(z);
    if !(angle <= most && across.is_finite()) {
        return None;
    }
    if across == 0.0 {
        // The direction straight back would be a whole circle.
        return (z > 0.0).then_some([0.0; 2]);
    }
    let by = radius(angle) / across;
    Some([x * by, y * by])
}

/// Unit direction (z forward) of a point of the normalized image. `angle` maps an image radius to the angle from the
/// optical axis \[rad\]. `None` for an angle beyond `most`, or if `angle` returns `None`.
pub(super) fn unproject([x, y]: [f64; 2], most: f64, angle: impl Fn(f64) -> Option<f64>) -> Option<[f64; 3]> {
    let radius = x.hypot(y);
    if radius == 0.0 {
        return Some([0.0, 0.0, 1.0]);
    }
    let angle = angle(radius).filter(|angle| *angle <= most)?;
    let (sine, cosine) = angle.sin_cos();
    let by = sine / radius;
    Some([x * by, y * by, cosine])
}

/// Declares a rotationally symmetric fisheye without coefficients: a type whose only number is its largest angle.
macro_rules! fisheye {
    (
        $(#[$doc:meta])*
        $Name:ident: $name:literal, $aliases:expr;
        angles up to $most:expr, $allowed:literal;
        radius: $radius:expr;
        angle: $angle:expr;
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $Name {
            #[doc = concat!("Largest visible angle from the optical axis \\[rad\\]: ", $allowed, ".")]
            pub max_angle: f64,
        }

        impl Default for $Name {
            /// The largest angle of the mapping.
            fn default() -> Self {
                Self { max_angle: $most }
            }
        }

        impl super::LensModel for $Name {
            const NAME: &'static str = $name;
            const ALIASES: &'static [&'static str] = $aliases;

            fn max_angle(&self) -> Option<f64> {
                Some(self.max_angle)
            }

            fn validate(&self) -> Result<(), super::OpticsError> {
                super::check_max_angle(self.max_angle, $most, $allowed)
            }

            fn domain(&self) -> super::Domain {
                let radius: fn(f64) -> f64 = $radius;
                super::Domain::new(self.max_angle, radius(self.max_angle), false)
            }

            fn project(&self, domain: &super::Domain, direction: [f64; 3]) -> Option<[f64; 2]> {
                super::radial::project(direction, domain.angle, $radius)
            }

            fn unproject(&self, domain: &super::Domain, point: [f64; 2]) -> Option<[f64; 3]> {
                super::radial::unproject(point, domain.angle, $angle)
            }
        }
    };
}

pub(super) use fisheye;
