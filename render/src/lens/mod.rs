//! Lens models: projection of directions to image points and back. One model per file, and one list of all of them.
//!
//! A model maps directions in the camera's optical frame (x right, y down, z forward) to points of the *normalized
//! image* and back. A point (x, y) of the normalized image is the pixel (u, v) = (cx + fx x, cy + fy y), so
//! [`Intrinsics`](crate::intrinsics::Intrinsics) and lens are independent of each other. All computations are in double
//! precision.

mod model;
pub(crate) mod optics;
mod poles;
mod polynomial;
mod radial;
mod ray_tables;
pub(crate) mod rays;

use super::optics_error::OpticsError;
use kinetoscope_scene::pattern::{UnknownName, closest_names};
pub use model::{Domain, LensModel};
use model::{check_finite, check_max_angle};
pub use optics::Optics;
pub use ray_tables::LensRayTables;
pub use rays::LensRays;
pub(crate) use rays::ViewCone;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// Declares the lenses: a module and a type for each.
macro_rules! lenses {
    ($($(#[$doc:meta])* $file:ident :: $Name:ident,)*) => {
        $(mod $file; pub use $file::$Name;)*

        /// A lens model, used with an image whose focal lengths and principal point are
        /// [`Intrinsics`](crate::intrinsics::Intrinsics).
        ///
        /// In files: the name alone (`lens = "equidistant"`) for the default numbers, or a table with the name
        /// (`lens.opencv = { k1 = -0.28, k2 = 0.07 }`).
        ///
        /// Lenses other than a pinhole bend straight lines, which needs ray casting: they require a renderer other than
        /// [`Renderer::Raster`](crate::renderer::Renderer::Raster).
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum Lens {
            $($(#[$doc])* $Name($Name),)*
        }

        $(impl From<$Name> for Lens {
            fn from(lens: $Name) -> Self {
                Self::$Name(lens)
            }
        })*

        impl std::str::FromStr for Lens {
            type Err = UnknownName;

            /// Creates the lens of a name or alias; same as [`Lens::from_name`].
            fn from_str(name: &str) -> Result<Self, UnknownName> {
                Self::from_name(name)
            }
        }

        impl Lens {
            /// Names of all lenses.
            pub const NAMES: &'static [&'static str] = &[$($Name::NAME),*];

            /// Creates the lens of a name or alias, with its default numbers.
            ///
            /// # Errors
            ///
            /// [`UnknownName`] with the most similar names.
            pub fn from_name(name: &str) -> Result<Self, UnknownName> {
                $(if name == $Name::NAME || $Name::ALIASES.contains(&name) {
                    return Ok(Self::$Name($Name::default()));
                })*
                let all = [$($Name::NAME),*].into_iter().chain([$($Name::ALIASES),*].into_iter().flatten().copied());
                let candidates = closest_names(name, all).into_iter().map(String::from).collect();
                Err(UnknownName { what: "lens", name: name.into(), candidates })
            }

            /// Canonical name of the lens.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$Name(_) => $Name::NAME,)* }
            }

            /// True for [`Pinhole`] and [`OpenCv`], whose rays all go forward: near and far are depths along the
            /// optical axis. For other lenses, whatever their largest angle, near and far are distances along the ray.
            pub fn is_forward(&self) -> bool {
                match self { $(Self::$Name(_) => $Name::FORWARD,)* }
            }

            /// False for [`Panorama`] only. The illumination of all other lenses falls off with the angle to the
            /// optical axis.
            pub fn has_axis(&self) -> bool {
                match self { $(Self::$Name(_) => $Name::HAS_AXIS,)* }
            }

            /// True for [`Pinhole`], and for [`OpenCv`] with all coefficients 0 and no `max_angle`: images equal those
            /// without a lens, bit for bit, with every renderer.
            pub fn is_pinhole(&self) -> bool {
                match self { $(Self::$Name(lens) => lens.is_pinhole(),)* }
            }

            /// Validates every number and computes the domain of the lens.
            ///
            /// # Errors
            ///
            /// [`OpticsError::Lens`] for an invalid number; [`OpticsError::LensFolds`] if the mapping folds back or has
            /// a pole before the requested `max_angle`.
            pub fn domain(&self) -> Result<Domain, OpticsError> {
                let (domain, max_angle) = match self { $(Self::$Name(lens) => {
                    lens.validate()?;
                    (lens.domain(), lens.max_angle())
                })* };
                match max_angle {
                    Some(wanted) if domain.folds => Err(OpticsError::LensFolds {
                        lens: self.name(),
                        angle: domain.angle,
                        radius: domain.radius,
                        requirement: format!("max_angle is {:.2} degrees", wanted.to_degrees()),
                    }),
                    _ => Ok(domain),
                }
            }

            fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]> {
                match self { $(Self::$Name(lens) => lens.project(domain, direction),)* }
            }

            fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
                match self { $(Self::$Name(lens) => lens.unproject(domain, point),)* }
            }
        }

        impl Serialize for Lens {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                match self {
                    $(Self::$Name(lens) => serializer.serialize_newtype_variant("Lens", 0, $Name::NAME, lens),)*
                }
            }
        }

        impl<'de> Visitor<'de> for LensVisitor {
            type Value = Lens;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a lens, or a table whose only key is the name of a lens")
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Lens, E> {
                Lens::from_name(name).map_err(E::custom)
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Lens, A::Error> {
                let Some(name) = map.next_key::<String>()? else {
                    let message = "a lens table needs the name of the lens as its key: { opencv = { k1 = -0.3 } }";
                    return Err(A::Error::custom(message));
                };
                let lens = match Lens::from_name(&name).map_err(A::Error::custom)? {
                    $(Lens::$Name(_) => Lens::$Name(map.next_value()?),)*
                };
                match map.next_key::<String>()? {
                    Some(other) => {
                        Err(A::Error::custom(format!("two lenses are given: {name:?} and {other:?}; keep one")))
                    }
                    None => Ok(lens),
                }
            }
        }
    };
}

lenses! {
    /// A pinhole without distortion: straight lines stay straight.
    pinhole::Pinhole,
    /// A pinhole with OpenCV's distortion, 12 coefficients.
    open_cv::OpenCv,
    /// OpenCV's fisheye, 4 coefficients.
    open_cv_fisheye::OpenCvFisheye,
    /// The equidistant fisheye: r = f theta.
    equidistant::Equidistant,
    /// The equal-area fisheye: r = 2 f sin(theta / 2).
    equisolid::Equisolid,
    /// The orthographic fisheye: r = f sin(theta).
    orthographic::Orthographic,
    /// The stereographic (conformal) fisheye: r = 2 f tan(theta / 2).
    stereographic::Stereographic,
    /// NVIDIA's f-theta: the angle is a polynomial of the radius.
    f_theta::FTheta,
    /// The equirectangular panorama: longitudes along rows, latitudes along columns.
    panorama::Panorama,
}

/// Deserializes a lens from a name or a table.
struct LensVisitor;

impl<'de> Deserialize<'de> for Lens {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(LensVisitor)
    }
}

impl Default for Lens {
    fn default() -> Self {
        Self::Pinhole(Pinhole {})
    }
}
