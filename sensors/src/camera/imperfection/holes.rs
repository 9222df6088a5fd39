//! Depth holes of structured-light cameras.

use super::{DepthEffect, ImageContext, within};
use crate::error::SensorError;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Pixels where a structured-light camera measures nothing although it sees a surface. Holes have the value of a miss.
///
/// - **Grazing surfaces** reflect too little of the pattern: the angle between the ray and the normal exceeds
///   `max_angle`. The normal is estimated from the depth and two neighbors. Of the left and right neighbor, and of the
///   upper and lower one, the one with the more similar inverse depth is used.
/// - **Shadows of the projector**, a pinhole beside the camera on its x axis, in line with its rows. A pixel has no
///   pattern if its ray from the projector meets another surface first. This gives a band beside the edge of the front
///   surface, of `fx baseline (1/z_front - 1/z_behind)` pixels. Surfaces that the camera does not see cast no shadow. A
///   lens that bends rows has no projector shadows: `baseline` must be 0.
///
/// Source: Khoshelham and Oude Elberink 2012, section 2 (geometry: a projector 75 mm beside the camera) and 3.1 (gaps
/// from occlusions and surface properties); Nguyen, Izadi and Lovell 2012 (little is measured beyond some 80 degrees).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Holes {
    /// Largest measured angle between the ray and the surface normal \[rad\], 0 to pi/2; pi/2 disables holes at grazing
    /// angles.
    pub max_angle: f64,
    /// Position of the projector on the camera's x axis \[m\], -1000 to 1000: positive is to the right; 0 disables
    /// shadows.
    pub baseline: f64,
}

impl Default for Holes {
    /// 80 degrees, and a projector 75 mm to the right.
    fn default() -> Self {
        Self { max_angle: 80f64.to_radians(), baseline: 0.075 }
    }
}

impl DepthEffect for Holes {
    fn check(&self) -> Result<(), SensorError> {
        within("max_angle of the holes", self.max_angle, [0.0, FRAC_PI_2], "it must be 0 to pi/2")?;
        within("baseline of the holes", self.baseline, [-1000.0, 1000.0], "it must be -1000 to 1000")
    }

    fn apply(&self, depths: &mut [f32], image: &ImageContext<'_>) {
        // Holes are first marked by a negative sign, so that the depths around them stay available.
        if self.max_angle < FRAC_PI_2 {
            let least = self.max_angle.cos();
            for pixel in 0..depths.len() {
                if incidence_cosine(depths, pixel, image).is_some_and(|cosine| cosine < least) {
                    depths[pixel] = -depths[pixel].abs();
                }
            }
        }
        if self.baseline != 0.0 {
            let projector_disparity = f64::from(image.view.fx) * self.baseline;
            depths.chunks_mut(image.view.width.max(1)).for_each(|row| mark_projector_shadow(row, projector_disparity));
        }
        depths.iter_mut().filter(|depth| **depth < 0.0).for_each(|depth| *depth = f32::INFINITY);
    }
}

/// Returns the inverse of the measured or marked depth \[1/m\]; `None` for a miss.
fn inverse_depth(depth: f32) -> Option<f64> {
    depth.is_finite().then(|| 1.0 / f64::from(depth.abs()))
}

/// Returns the cosine of the angle between a pixel's ray and the surface normal; `None` for a miss, and without a
/// measured neighbor in the row or in the column.
///
/// On a plane, the inverse depth is a linear function of the ray, and its coefficients n are the normal. Three rays
/// determine them, by Cramer's rule.
fn incidence_cosine(depths: &[f32], pixel: usize, image: &ImageContext<'_>) -> Option<f64> {
    let width = image.view.width;
    let here = inverse_depth(depths[pixel])?;
    // Uses the neighbor with the more similar inverse depth: the other neighbor may be across an edge.
    let nearer = |before: Option<usize>, after: Option<usize>| {
        let at = |pixel: Option<usize>| Some((pixel?, inverse_depth(*depths.get(pixel?)?)?));
        match (at(before), at(after)) {
            (Some(a), Some(b)) => Some(if (here - a.1).abs() < (b.1 - here).abs() { a } else { b }),
            (one, other) => one.or(other),
        }
    };
    let column = pixel % width;
    let beside = nearer((column > 0).then(|| pixel.wrapping_sub(1)), (column + 1 < width).then_some(pixel + 1))?;
    let below = nearer(pixel.checked_sub(width), Some(pixel + width))?;
    let ray = Vector3::from(image.ray(pixel));
    let [a, b] = [beside, below].map(|(other, inverse)| (Vector3::from(image.ray(other)) - ray, inverse - here));
    // Differences instead of rays and inverse depths describe the same plane and avoid cancellation.
    let volume = ray.dot(&a.0.cross(&b.0));
    let normal = here * a.0.cross(&b.0) + a.1 * b.0.cross(&ray) + b.1 * ray.cross(&a.0);
    let cosine = here * volume.abs() / (normal.norm() * ray.norm());
    cosine.is_finite().then_some(cosine)
}

/// Marks the pixels of a row of depths \[m\] that the projector does not reach, by a negative sign. The projector sees
/// a point at depth z `reach / z` pixels to the left of its position in the camera image (to the right for a negative
/// `reach`). Pixels are visited from the side of the projector. A point that is not farther from that side than all
/// earlier points, as the projector sees it, is in a shadow.
fn mark_projector_shadow(row: &mut [f32], reach: f64) {
    let count = row.len();
    // A projector to the left is the mirror image of a projector to the right.
    let mut first = f64::INFINITY;
    for k in 0..count {
        let pixel = if reach > 0.0 { count - 1 - k } else { k };
        let Some(inverse) = inverse_depth(row[pixel]) else { continue };
        let seen = (count - k) as f64 - reach.abs() * inverse;
        if seen < first {
            first = seen;
        } else {
            row[pixel] = -row[pixel].abs();
        }
    }
}
