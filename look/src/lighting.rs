//! Lights, headlight and haze of MuJoCo models.

use crate::{HeadlightValues, LightType, LightValues};
use kinetoscope_scene::{Headlight, HorizonHaze, Light, LightKind, LightingSpace, decode_srgb};

/// Distance of a skybox in MuJoCo's renderer relative to that of the far clipping plane, measured in images of that
/// renderer.
const SKYBOX_RADIUS: f64 = 0.99 * std::f64::consts::FRAC_1_SQRT_2;

/// Converts a light, without its pose. An image light becomes inactive, and a spot with a half angle above 90° a point
/// light. Colors of [`LightingSpace::Linear`] are converted to linear light.
pub fn scene_light(light: &LightValues, space: LightingSpace) -> Light {
    let color = |color: [f32; 3]| if space == LightingSpace::Display { color } else { linear_light(color) };
    let spot = LightKind::Spot { cutoff_deg: light.cutoff_deg.min(90.0), exponent: light.exponent };
    let kind = match light.kind {
        LightType::Directional => LightKind::Directional,
        // In OpenGL, spot lights of 180 degrees shine in all directions.
        LightType::Spot if light.cutoff_deg > 90.0 => LightKind::Point,
        LightType::Spot => spot,
        LightType::Point | LightType::Image => LightKind::Point,
    };
    Light {
        kind,
        position: [0.0; 3],
        direction: [0.0, 0.0, -1.0],
        ambient: color(light.ambient),
        diffuse: color(light.diffuse),
        specular: color(light.specular),
        attenuation: light.attenuation,
        // The radius of a directional light is an angle there, a length here.
        radius: if kind == LightKind::Directional { 0.0 } else { light.radius.max(0.0) },
        cast_shadow: light.cast_shadow,
        // An image-based light is not a light of the scene.
        active: light.active && light.kind != LightType::Image,
    }
}

/// Converts the headlight, for [`LightingSpace::Display`].
pub fn scene_headlight(headlight: &HeadlightValues) -> Headlight {
    Headlight {
        ambient: headlight.ambient,
        diffuse: headlight.diffuse,
        specular: headlight.specular,
        active: headlight.active,
    }
}

/// Haze of this color (sRGB, 0..=1) at the end of infinite planes, in a fraction `width` of their radius. `far` is the
/// distance of the far clipping plane \[m\]. With a skybox, infinite planes of MuJoCo's renderer end at it.
pub fn horizon_haze(color: [f32; 3], width: f32, far: f64) -> HorizonHaze {
    HorizonHaze { color, radius: (SKYBOX_RADIUS * far) as f32, width }
}

/// Converts a light color to linear color space. MuJoCo multiplies colors in display space; with
/// [`LightingSpace::Linear`], colors are multiplied in linear space. For one light the results agree up to the small
/// linear part of sRGB: (c l)^2.2 = c^2.2 l^2.2.
pub fn linear_light(color: [f32; 3]) -> [f32; 3] {
    color.map(decode_srgb)
}
