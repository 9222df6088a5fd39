//! Photon noise.

use super::{PixelContext, RadianceEffect, within};
use crate::error::SensorError;
use kinetoscope_render::RngStream;
use serde::{Deserialize, Serialize};

/// Photon noise: the number of electrons in a pixel is Poisson distributed, so the variance of radiance x is
/// `x / electrons`. Red, green and blue are independent. Source: EMVA standard 1288, release 3.1, section 2.2; plotting
/// variance against signal (a photon transfer curve, Janesick 2007) gives the slope `1 / electrons`.
///
/// Below a mean of 50 electrons the distribution is Poisson's, from 50 on a normal distribution with the same mean and
/// variance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShotNoise {
    /// Electrons in a pixel at a radiance of 1 (a fully lit white surface, as exposed), 1 to 1e9.
    pub electrons: f64,
}

impl Default for ShotNoise {
    /// 5000 electrons: a small pixel of an industrial camera.
    fn default() -> Self {
        Self { electrons: 5000.0 }
    }
}

/// Mean from which the normal distribution is used: none of its values is below 0 then, with 32-bit normal numbers.
const NORMAL_APPROXIMATION_MIN: f64 = 50.0;

impl RadianceEffect for ShotNoise {
    fn check(&self) -> Result<(), SensorError> {
        within("electrons of the shot noise", self.electrons, [1.0, 1e9], "it must be 1 to 1e9")
    }

    fn apply(&self, light: &mut [f64; 3], context: &PixelContext<'_>) {
        let (key, block) = (context.image.rng_key, context.pixel as u32);
        let mean = light.map(|light| light * self.electrons);
        // Random numbers are only computed if a channel needs them.
        let normals =
            mean.iter().any(|mean| *mean >= NORMAL_APPROXIMATION_MIN).then(|| key.normals(RngStream::SHOT, block));
        let uniforms = mean
            .iter()
            .any(|mean| *mean < NORMAL_APPROXIMATION_MIN)
            .then(|| key.uniforms(RngStream::SHOT_LOW_LIGHT, block));
        for (k, light) in light.iter_mut().enumerate() {
            let counted = match (normals, uniforms) {
                (Some(normals), _) if mean[k] >= NORMAL_APPROXIMATION_MIN => mean[k] + mean[k].sqrt() * normals[k],
                (_, Some(uniforms)) => poisson(mean[k], uniforms[k]),
                _ => mean[k],
            };
            *light = counted / self.electrons;
        }
    }
}

/// Returns the quantile `uniform` of a Poisson distribution with a small mean.
fn poisson(mean: f64, uniform: f64) -> f64 {
    let (mut count, mut probability) = (0.0, (-mean).exp());
    let mut below = probability;
    // The rest of the distribution at twenty times the largest mean is smaller than 32-bit numbers resolve.
    while uniform > below && count < 20.0 * NORMAL_APPROXIMATION_MIN {
        count += 1.0;
        probability *= mean / count;
        below += probability;
    }
    count
}
