//! Light, sky and haze.
//!
//! Light colours are linear intensities, surface colours are meant for the screen (sRGB): see the colour channel.

/// What kind of lamp a light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel rays along [`Light::direction`].
    Directional,
    /// A cone around [`Light::direction`].
    Spot {
        /// Half angle of the cone \[deg\], at most 90.
        cutoff_deg: f32,
        /// How fast the light falls off from the axis: cos(angle) to this power, of which the nearest whole number up to 128 is
        /// drawn.
        exponent: f32,
    },
    /// The same in all directions; the rasterizer draws no shadow of it.
    Point,
}

/// A lamp, with MuJoCo's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// What kind of lamp it is.
    pub kind: LightKind,
    /// Where it is, world frame \[m\].
    pub position: [f32; 3],
    /// Where it shines, world frame; need not be a unit vector.
    pub direction: [f32; 3],
    /// Colour of the light that comes from everywhere.
    pub ambient: [f32; 3],
    /// Colour of the light that surfaces scatter.
    pub diffuse: [f32; 3],
    /// Colour of highlights.
    pub specular: [f32; 3],
    /// Constant, linear and quadratic attenuation: intensity is 1 / (c + l d + q d²). Not for directional lights.
    pub attenuation: [f32; 3],
    /// How large it is, for soft shadows in ray-traced pictures: the radius of its disc \[m\]; of a directional lamp, at a
    /// distance of 1 m (the tangent of its angular radius). 0 is a point, whose shadows are sharp.
    pub radius: f32,
    /// Whether things in the light cast a shadow.
    pub cast_shadow: bool,
    /// Whether it is on.
    pub active: bool,
}

impl Default for Light {
    /// Straight down from 3 m, MuJoCo's defaults.
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

/// How the light of several lamps is added up, and multiplied by the colour of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSum {
    /// As physics does it: light is linear, and colours are taken from sRGB to linear.
    #[default]
    Linear,
    /// As OpenGL and MuJoCo's renderer do it: sRGB numbers of light and surfaces are added and multiplied as they are, and the
    /// sum ends at 1. Colours of lamps are sRGB numbers, and metals are no different. Path-traced frames take colours of lamps
    /// to linear light and add that.
    Display,
}

/// The lamp on every camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Headlight {
    /// Colour of the light that comes from everywhere.
    pub ambient: [f32; 3],
    /// Colour of the light that surfaces scatter.
    pub diffuse: [f32; 3],
    /// Colour of highlights.
    pub specular: [f32; 3],
    /// Whether it is on.
    pub active: bool,
}

impl Headlight {
    /// The headlight as a directional light along the camera's viewing direction `forward`, as MuJoCo's renderer has it; `None`
    /// where it is off, or shines from the camera's position: in our own light, and of cameras that look everywhere.
    pub fn along(&self, sum: LightSum, forward: Option<[f32; 3]>) -> Option<Light> {
        let direction = forward.filter(|_| self.active && sum == LightSum::Display)?;
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
    /// Dimmer than MuJoCo's (0.1, 0.4, 0.5), because [`Hemisphere`] fills the shadows.
    fn default() -> Self {
        Self { ambient: [0.0; 3], diffuse: [0.2; 3], specular: [0.1; 3], active: true }
    }
}

/// Ambient light that depends on which way a surface looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hemisphere {
    /// On surfaces that look up (+z).
    pub sky: [f32; 3],
    /// On surfaces that look down.
    pub ground: [f32; 3],
}

impl Default for Hemisphere {
    fn default() -> Self {
        Self { sky: [0.27, 0.29, 0.32], ground: [0.11, 0.1, 0.09] }
    }
}

/// What is seen where nothing is: a gradient over the elevation, screen colours (sRGB, 0..=1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Straight up.
    pub zenith: [f32; 3],
    /// At the horizon.
    pub horizon: [f32; 3],
    /// Straight down.
    pub nadir: [f32; 3],
}

impl Sky {
    /// The same colour everywhere.
    pub const fn uniform(color: [f32; 3]) -> Self {
        Self { zenith: color, horizon: color, nadir: color }
    }
}

impl Default for Sky {
    fn default() -> Self {
        Self { zenith: [0.36, 0.5, 0.68], horizon: [0.82, 0.87, 0.91], nadir: [0.45, 0.47, 0.5] }
    }
}

/// Far things fade into a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Haze {
    /// The colour of the distance; `None` is the sky behind it.
    pub color: Option<[f32; 3]>,
    /// Distance from the camera where it begins \[m\].
    pub start: f32,
    /// Distance where only haze is left \[m\].
    pub end: f32,
}

/// Haze where an endless ground ends, as MuJoCo's renderer draws it: the ground fades into a colour, and the colour into what
/// is behind, up to the height of the camera. It acts on the first endless plane, of cameras above it, and on colours only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HorizonHaze {
    /// Colour (sRGB, 0..=1).
    pub color: [f32; 3],
    /// Distance along the ground, from below the camera, where nothing of the ground is left \[m\].
    pub radius: f32,
    /// Part of the radius over which the ground fades, 0..=1.
    pub width: f32,
}
