//! Noise of the light itself.

use super::{OfLight, Place, within};
use kinetoscope_render::Stream;
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Noise of the light itself, which comes in quanta: how many electrons a pixel counts is Poisson distributed, so that the
/// variance of light x is `x / electrons`. Red, green and blue count by themselves. Source: EMVA standard 1288, release 3.1,
/// section 2.2; plotting variance against signal (a photon transfer curve, Janesick 2007) gives the slope `1 / electrons`.
///
/// The numbers are those of Poisson's distribution below 50 electrons, and above of the normal distribution with the same mean
/// and variance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShotNoise {
    /// Electrons that light of 1 (a white surface in full light, as exposed) frees in a pixel, 1 to 1e9.
    pub electrons: f64,
}

impl Default for ShotNoise {
    /// 5000 electrons: a small pixel of an industrial camera.
    fn default() -> Self {
        Self { electrons: 5000.0 }
    }
}

/// From so many electrons on, the normal distribution does: nothing of it is below 0 then, with normal numbers of 32 bits.
const MANY: f64 = 50.0;

impl OfLight for ShotNoise {
    fn check(&self) -> Result<(), SensorError> {
        within("electrons of the shot noise", self.electrons, [1.0, 1e9], "it must be 1 to 1e9")
    }

    fn spoil(&self, light: &mut [f64; 3], place: &Place<'_>) {
        let (ticket, block) = (place.picture.ticket, place.pixel as u32);
        let mean = light.map(|light| light * self.electrons);
        // Numbers that most pixels do not need are not looked up.
        let normals = mean.iter().any(|mean| *mean >= MANY).then(|| ticket.normals(Stream::SHOT, block));
        let uniforms = mean.iter().any(|mean| *mean < MANY).then(|| ticket.uniforms(Stream::SHOT_IN_THE_DARK, block));
        for (k, light) in light.iter_mut().enumerate() {
            let counted = match (normals, uniforms) {
                (Some(normals), _) if mean[k] >= MANY => mean[k] + mean[k].sqrt() * normals[k],
                (_, Some(uniforms)) => poisson(mean[k], uniforms[k]),
                _ => mean[k],
            };
            *light = counted / self.electrons;
        }
    }
}

/// The number at the quantile `uniform` of Poisson's distribution, whose mean is small.
fn poisson(mean: f64, uniform: f64) -> f64 {
    let (mut count, mut probability) = (0.0, (-mean).exp());
    let mut below = probability;
    // What is left of the distribution at twenty times its mean is less than numbers of 32 bits tell.
    while uniform > below && count < 20.0 * MANY {
        count += 1.0;
        probability *= mean / count;
        below += probability;
    }
    count
}
