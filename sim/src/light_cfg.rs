//! Lights of a simulation.

use crate::error::{Error, Result};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// Type of a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum LightKindCfg {
    /// Parallel rays along the direction, such as sunlight.
    #[default]
    Directional,
    /// Light in all directions from the position. The rasterizer's shadow maps have no shadows of it; ray-traced
    /// shadows and path-traced images have them.
    Point,
    /// Light in a cone around the direction.
    Spot {
        /// Half angle of the cone \[deg\], above 0 and at most 90.
        cutoff_deg: f64,
        /// Falloff from the axis: the intensity is cos(angle) to this power, a whole number from 0 to 128.
        exponent: f64,
    },
    /// Uniform light from all directions, such as an overcast sky. It uses only the color of the other fields and casts
    /// no sharp shadow. Dome lights replace the ambient light that simulations have by default.
    Dome {
        /// Brightness, 0 to 1000. A white surface lit only by a white dome of intensity 1 has the largest brightness of
        /// an image.
        intensity: f64,
    },
}

/// Configuration of a light. `Default` is a gray (0.8) directional light from above, slightly tilted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightCfg {
    /// Type of the light.
    pub kind: LightKindCfg,
    /// Position in the environment \[m\]; unused by directional lights and domes.
    #[serde(with = "kinetoscope_scene::file_format::vector")]
    pub position: Vector3<f64>,
    /// Direction of the emitted light in world axes, from the light to the scene; its length does not matter. Unused by
    /// point lights and domes, but never zero.
    #[serde(with = "kinetoscope_scene::file_format::vector")]
    pub direction: Vector3<f64>,
    /// RGB color (sRGB), 0..=1.
    pub color: [f64; 3],
    /// Constant, linear \[1/m\] and quadratic \[1/m²\] attenuation: the intensity at distance d is divided by c + l d +
    /// q d². Unused by directional lights and domes.
    pub attenuation: [f64; 3],
    /// Size for soft shadows in path-traced images: the radius of the light's disc \[m\]. All other renderers ignore
    /// it. For a directional light, the radius at a distance of 1 m (the tangent of its angular radius, 0.00465 for the
    /// sun). 0 is a point, which casts sharp shadows.
    pub radius: f64,
    /// True if objects cast shadows in this light.
    pub cast_shadow: bool,
}

impl Default for LightCfg {
    fn default() -> Self {
        Self {
            kind: LightKindCfg::Directional,
            position: Vector3::new(0.0, 0.0, 4.0),
            direction: Vector3::new(-0.3, 0.4, -1.0),
            color: [0.8, 0.8, 0.8],
            attenuation: [1.0, 0.0, 0.0],
            radius: 0.0,
            cast_shadow: true,
        }
    }
}

impl LightCfg {
    /// Creates a dome light: uniform light from all directions ([`LightKindCfg::Dome`]).
    pub fn dome(intensity: f64, color: [f64; 3]) -> Self {
        Self { kind: LightKindCfg::Dome { intensity }, color, ..Self::default() }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// A field is out of range; the first one is reported.
    pub fn validate(&self) -> Result<()> {
        let fail =
            |field, value: &dyn Debug, expected| Err(Error::Config { field, value: format!("{value:?}"), expected });
        if let LightKindCfg::Spot { cutoff_deg, exponent } = self.kind {
            if !(cutoff_deg > 0.0 && cutoff_deg <= 90.0) {
                return fail("lights.kind.spot.cutoff_deg", &cutoff_deg, "it must be above 0 and at most 90 degrees");
            }
            if !(0.0..=128.0).contains(&exponent) || exponent.fract() != 0.0 {
                return fail("lights.kind.spot.exponent", &exponent, "it must be a whole number, 0 to 128, such as 10");
            }
        }
        if let LightKindCfg::Dome { intensity } = self.kind
            && !(0.0..=1000.0).contains(&intensity)
        {
            let expected =
                "it must be 0 to 1000, where 1 shows a white surface as white (Isaac Lab's 3000 is about 1 here)";
            return fail("lights.kind.dome.intensity", &intensity, expected);
        }
        if !self.position.iter().all(|x| x.abs() <= 1e6) {
            let expected = "each coordinate must be within 1e6 meters";
            return fail("lights.position", &self.position.as_slice(), expected);
        }
        if !(self.direction.iter().all(|x| x.is_finite()) && self.direction.norm() > 0.0) {
            let expected = "it must be a finite vector other than zero";
            return fail("lights.direction", &self.direction.as_slice(), expected);
        }
        if !self.color.iter().all(|c| (0.0..=1.0).contains(c)) {
            return fail("lights.color", &self.color, "each component must be 0 to 1");
        }
        let in_range = self.attenuation.iter().all(|x| (0.0..=1e6).contains(x));
        if !(in_range && self.attenuation.iter().sum::<f64>() >= 1e-6) {
            return fail("lights.attenuation", &self.attenuation, "each must be 0 to 1e6, and one of them above 0");
        }
        if !(0.0..=1e6).contains(&self.radius) {
            return fail("lights.radius", &self.radius, "it must be 0 to 1e6");
        }
        Ok(())
    }
}
