//! Lights, sky and haze.
//!
//! Light colors are linear intensities, except in [`LightingSpace::Display`]. Colors of surfaces, skies and haze are
//! display colors (sRGB).

use crate::polygons::Tessellation;

/// Type of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel rays along [`Light::direction`].
    Directional,
    /// A cone around [`Light::direction`].
    Spot {
        /// Half angle of the cone \[deg\], at most 90.
        cutoff_deg: f32,
        /// Exponent of the falloff from the axis: cos(angle) to this power. Renderers use the nearest whole number up
        /// to 128.
        exponent: f32,
    },
    /// Uniform in all directions. The rasterizer's shadow maps have no shadows of this type; ray-traced shadows and
    /// path-traced images have them.
    Point,
}

/// A light, with MuJoCo's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Type of the light.
    pub kind: LightKind,
    /// Position in the environment frame \[m\]. Unused for directional lights.
    pub position: [f32; 3],
    /// Direction of the emitted light in the environment frame; need not be a unit vector. Unused for point lights.
    pub direction: [f32; 3],
    /// Ambient color, RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub ambient: [f32; 3],
    /// Diffuse color, RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub diffuse: [f32; 3],
    /// Specular color, RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub specular: [f32; 3],
    /// Constant c, linear l and quadratic q attenuation: intensity is 1 / (c + l d + q d²) at a distance d \[m\].
    /// Unused for directional lights.
    pub attenuation: [f32; 3],
    /// Radius of the light's disc, for soft shadows in path-traced images \[m\]. For a directional light, the radius at
    /// a distance of 1 m (the tangent of its angular radius). With 0, shadows are sharp. All other renderers ignore the
    /// radius.
    pub radius: f32,
    /// True if instances in the light cast shadows.
    pub cast_shadow: bool,
    /// True if the light is on.
    pub active: bool,
}

impl Default for Light {
    /// A directional light straight down, at a height of 3 m. Colors, attenuation and shadows have MuJoCo's defaults.
    fn default() -> Self {
        Self {
            kind: LightKind::Directional,
            position: [0., 0., 3.],
            direction: [0., 0., -1.],
            ambient: [0.; 3],
            diffuse: [0.7; 3],
            specular: [0.3; 3],
            attenuation: [1., 0., 0.],
            radius: 0.0,
            cast_shadow: true,
            active: true,
        }
    }
}

/// Rule by which light is added up and multiplied by the color of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum LightingSpace {
    /// Physical rule: light is linear, and surface colors are converted from sRGB to linear.
    #[default]
    Linear,
    /// Rule of OpenGL and MuJoCo's renderer: sRGB values of lights and surfaces are added and multiplied directly, and
    /// the sum is clamped to 1.
    ///
    /// Light colors are sRGB values, and metals are not treated separately. The path tracer converts light colors to
    /// linear light and adds that.
    Display,
}

/// The headlight: a light at every camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Headlight {
    /// Ambient color, RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub ambient: [f32; 3],
    /// Diffuse color, RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub diffuse: [f32; 3],
    /// Specular color, RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub specular: [f32; 3],
    /// True if the headlight is on.
    pub active: bool,
}

impl Headlight {
    /// Returns the headlight as a directional light along the camera's viewing direction `forward`, as in MuJoCo's
    /// renderer.
    ///
    /// Returns `None` if the headlight is off, for [`LightingSpace::Linear`], and for omnidirectional cameras
    /// (`forward` is `None`). In the last two cases, the headlight shines from the camera's position.
    pub fn to_directional(&self, sum: LightingSpace, forward: Option<[f32; 3]>) -> Option<Light> {
        let direction = forward.filter(|_| self.active && sum == LightingSpace::Display)?;
        Some(Light {
            kind: LightKind::Directional,
            direction,
            ambient: self.ambient,
            diffuse: self.diffuse,
            specular: self.specular,
            cast_shadow: false,
            ..Light::default()
        })
    }
}

impl Default for Headlight {
    /// Dimmer than MuJoCo's headlight (0.1, 0.4, 0.5), because [`Hemisphere`] fills the shadows.
    fn default() -> Self {
        Self { ambient: [0.0; 3], diffuse: [0.2; 3], specular: [0.1; 3], active: true }
    }
}

/// Rules of MuJoCo's OpenGL renderer, for [`LightingSpace::Display`]. The path tracer ignores them.
///
/// - Only opaque surfaces receive shadows, and their reflections show none. In its shadow, a light gives no ambient
///   light either.
/// - A point is either lit or in the shadow: edges of shadows are sharp.
/// - Samples, transparent surfaces and haze are mixed as display colors; haze increases linearly with the depth.
/// - The exposure compensation multiplies display colors.
/// - With `tessellation`, light is computed at the corners of the triangles of meshes, and of polygons that approximate
///   other shapes. Visibility and depth are those of the shapes.
/// - With `culls_backs`, the rasterizer leaves out the backs of surfaces, except those of markers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenGlRules {
    /// Half the side of the square around a directional light, across its direction, in which it casts shadows \[m\].
    pub shadow_clip: f32,
    /// Fraction of a spot's cutoff angle in which it casts shadows.
    pub shadow_scale: f32,
    /// True if backs of surfaces are invisible: a camera inside of a solid looks through it.
    pub culls_backs: bool,
    /// True if the color of a transparent surface, times its opacity, is added to the color behind it.
    pub is_additive: bool,
    /// Polygons at whose corners light is computed, to be interpolated between them; `None` to compute it at every pixel.
    pub tessellation: Option<Tessellation>,
}

impl OpenGlRules {
    /// Group of instances that are lit by the other side's normal: backs of planes.
    pub const BACK_GROUP: u8 = 30;
}

/// Ambient light, interpolated between two colors by the height (z) of the surface normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hemisphere {
    /// Color on surfaces that face up (+z), RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub sky: [f32; 3],
    /// Color on surfaces that face down (-z), RGB; linear, or sRGB with [`LightingSpace::Display`].
    pub ground: [f32; 3],
}

impl Default for Hemisphere {
    fn default() -> Self {
        Self { sky: [0.27, 0.29, 0.32], ground: [0.11, 0.1, 0.09] }
    }
}

/// Background: a gradient over the elevation, in display colors (sRGB, 0..=1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Color straight up.
    pub zenith: [f32; 3],
    /// Color at the horizon.
    pub horizon: [f32; 3],
    /// Color straight down.
    pub nadir: [f32; 3],
}

impl Sky {
    /// A sky of one color.
    pub const fn uniform(color: [f32; 3]) -> Self {
        Self { zenith: color, horizon: color, nadir: color }
    }
}

impl Default for Sky {
    fn default() -> Self {
        Self { zenith: [0.36, 0.5, 0.68], horizon: [0.82, 0.87, 0.91], nadir: [0.45, 0.47, 0.5] }
    }
}

/// Haze: distant surfaces fade into a color.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Haze {
    /// Color of the haze (sRGB, 0..=1); `None` is the sky behind the surface, or its horizon color for views below the
    /// horizon.
    pub color: Option<[f32; 3]>,
    /// Distance from the camera at which the haze begins \[m\]. The haze increases smoothly up to [`end`](Self::end).
    /// With [`OpenGlRules`], the depth replaces the distance, and the haze increases linearly.
    pub start: f32,
    /// Distance from the camera beyond which only haze is visible \[m\].
    pub end: f32,
}

/// Haze at the end of an infinite ground, as in MuJoCo's renderer.
///
/// The ground fades into the haze color. The haze color fades into the background up to the height of the camera. The
/// haze applies to the first visible infinite plane, if the camera is above this plane, and changes the color channel
/// only. Path-traced frames omit it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HorizonHaze {
    /// Color (sRGB, 0..=1).
    pub color: [f32; 3],
    /// Distance along the ground, from below the camera, beyond which no ground is visible \[m\].
    pub radius: f32,
    /// Fraction of the radius over which the ground fades, 0..=1.
    pub width: f32,
}
