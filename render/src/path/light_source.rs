//! Lights, as path tracing samples them.

use kinetoscope_scene::basis::OrthonormalBasis;

use crate::shade::light::{cos_deg, whole_exponent};
use crate::visibility::Projection;
use kinetoscope_scene::sampling::sample_disk;
use kinetoscope_scene::vector::{V3, add_scaled, dot, normalize, scale, sub, to_f64};
use kinetoscope_scene::{Light, LightKind};

/// A light of a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightSource {
    kind: LightKind,
    position: V3,
    /// Unit vector along which the light shines.
    along: V3,
    cutoff_cos: f64,
    exponent: u32,
    attenuation: V3,
    radius: f64,
    pub(super) ambient: V3,
    pub(super) diffuse: V3,
    pub(super) specular: V3,
    pub(super) cast_shadow: bool,
    /// For a light at a camera: the camera's viewing direction, and its near depth \[m\]. Without a direction, near is
    /// a distance.
    camera_near: Option<(Option<V3>, f64)>,
}

/// Light that arrives at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightSample {
    /// Unit vector towards the light.
    pub(super) direction: V3,
    /// Distance within which the light may be occluded \[m\]; +inf for a directional light.
    pub(super) distance: f64,
    /// Factor of the light's color that arrives.
    pub(super) strength: f64,
}

impl LightSample {
    /// Direction and distance of the same point of the light from another origin. This light was computed for the point
    /// `asked`.
    pub(super) fn seen_from(&self, asked: V3, origin: V3) -> (V3, f64) {
        if !(self.distance.is_finite() && self.distance > 0.0) {
            return (self.direction, self.distance);
        }
        let to = sub(add_scaled(asked, self.distance, self.direction), origin);
        // If both points coincide, the distance is 0.
        normalize(to).map_or((self.direction, 0.0), |direction| (direction, dot(to, to).sqrt()))
    }
}

impl LightSource {
    pub(super) fn new(light: &Light) -> Self {
        let wide = |v: [f32; 3]| v.map(f64::from);
        let (cutoff_cos, exponent) = match light.kind {
            LightKind::Spot { cutoff_deg, exponent } => (f64::from(cos_deg(cutoff_deg)), whole_exponent(exponent)),
            LightKind::Directional | LightKind::Point => (-2.0, 0),
        };
        Self {
            kind: light.kind,
            position: wide(light.position),
            along: normalize(wide(light.direction)).unwrap_or([0.0, 0.0, -1.0]),
            cutoff_cos,
            exponent,
            attenuation: wide(light.attenuation),
            radius: f64::from(light.radius.max(0.0)),
            ambient: wide(light.ambient),
            diffuse: wide(light.diffuse),
            specular: wide(light.specular),
            cast_shadow: light.cast_shadow,
            camera_near: None,
        }
    }

    /// A headlight: a light at the camera.
    pub(super) fn headlight(headlight: &kinetoscope_scene::Headlight, view: &Projection, along_axis: bool) -> Self {
        let light = Light {
            kind: LightKind::Point,
            ambient: headlight.ambient,
            diffuse: headlight.diffuse,
            specular: headlight.specular,
            ..Light::default()
        };
        let (position, forward) = (view.world_from_camera.translation, view.world_from_camera.rotation.map(|r| r[2]));
        let camera_near = Some((along_axis.then(|| to_f64(forward)), f64::from(view.near)));
        Self { position: to_f64(position), camera_near, ..Self::new(&light) }
    }

    /// Light at `point` from a sampled point of the light's disc, by two random numbers in 0..1; `None` if no light
    /// arrives.
    pub(super) fn sample(&self, point: V3, choice: [f64; 2]) -> Option<LightSample> {
        if self.kind == LightKind::Directional {
            let toward = scale(self.along, -1.0);
            let direction = self.disc_point(toward, toward, choice)?;
            return Some(LightSample { direction: normalize(direction)?, distance: f64::INFINITY, strength: 1.0 });
        }
        let to = sub(self.position, point);
        let distance = dot(to, to).sqrt();
        let toward = normalize(to)?;
        let [constant, linear, quadratic] = self.attenuation;
        let mut strength = 1.0 / (constant + distance * (linear + distance * quadratic)).max(1e-6);
        if matches!(self.kind, LightKind::Spot { .. }) {
            let cos = -dot(toward, self.along);
            if cos < self.cutoff_cos {
                return None;
            }
            strength *= power(cos.max(0.0), self.exponent);
        }
        let to = self.disc_point(to, toward, choice)?;
        let direction = normalize(to)?;
        let mut distance = dot(to, to).sqrt();
        if let Some((forward, near)) = self.camera_near {
            // Objects nearer than the near plane, such as the camera's housing, cast no shadow.
            let cos = forward.map_or(1.0, |forward| -dot(direction, forward));
            distance -= if cos > 1e-3 { near / cos } else { 0.0 };
        }
        Some(LightSample { direction, distance, strength })
    }

    /// Vector to a sampled point of the light's disc; `to` is the vector to its center, `normal` the unit normal of the
    /// disc. Without a radius this is `to`.
    fn disc_point(&self, to: V3, normal: V3, choice: [f64; 2]) -> Option<V3> {
        if self.radius == 0.0 {
            return Some(to);
        }
        let [x, y] = sample_disk(choice);
        let on = OrthonormalBasis::from_normal(normal).to_world([self.radius * x, self.radius * y, 0.0]);
        Some(add_scaled(to, 1.0, on))
    }

    pub(super) fn has_size(&self) -> bool {
        self.radius > 0.0
    }
}

/// x to an integer power, by squaring.
pub(super) fn power(x: f64, mut exponent: u32) -> f64 {
    let (mut result, mut square) = (1.0, x);
    while exponent > 0 {
        if exponent & 1 == 1 {
            result *= square;
        }
        square *= square;
        exponent >>= 1;
    }
    result
}
