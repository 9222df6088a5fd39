//! BSDF of a surface: Lambertian reflection below a glossy GGX layer, with perfect mirrors and smooth glass.
//!
//! Sources: Walter et al., Microfacet models for refraction through rough surfaces, 2007 (GGX); Heitz, Understanding
//! the masking-shadowing function, JCGT 3(2), 2014; Dupuy and Benyoub, Sampling visible GGX normals with spherical
//! caps, 2023; Schlick, 1994; Lagarde and de Rousiers, Moving Frostbite to physically based rendering, 2014 (F90).

use super::brightness;
use kinetoscope_scene::Material;
use kinetoscope_scene::sampling::{cos_sin_turns, sample_cosine_hemisphere};
use kinetoscope_scene::vector::{V3, add, dot, scale};
use std::f64::consts::PI;

/// BSDF of a surface point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bsdf {
    /// Base color of the surface.
    pub(super) albedo: V3,
    /// Diffuse albedo below the layer: 0 for a metal.
    pub(super) diffuse_albedo: V3,
    /// Reflectance of the layer along the normal (F0), and at grazing angles (`f90`).
    f0: V3,
    f90: f64,
    /// Squared roughness alpha of the layer.
    alpha2: f64,
    /// Fraction of light that is mirrored perfectly.
    pub(super) mirror: f64,
    /// Fraction of light that meets a smooth surface of glass.
    glass: f64,
    /// Refractive index of the side that the path comes from, divided by that of the other side.
    ratio: f64,
    /// True if the path comes from outside of the body.
    front: bool,
}

/// Least alpha², for a roughness of 0: highlights of a twentieth of a degree.
const MIN_ALPHA2: f64 = 1e-6;

/// A sampled direction of the BSDF.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfSample {
    pub(super) direction: V3,
    /// Factor of the light from there: BSDF times cosine, divided by the pdf.
    pub(super) weight: V3,
    pub(super) is_specular: bool,
    /// Pdf of the direction \[1/sr\]; 0 for mirrors and glass, whose directions are not distributed.
    pub(super) pdf: f64,
}

/// BSDF times the cosine of the incoming direction: of the diffuse part below the layer, and of the layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfValue {
    pub(super) diffuse: V3,
    pub(super) specular: V3,
}

impl Bsdf {
    /// Creates the BSDF. `reflectance` is that of the material if the point mirrors, else 0; `front` is true if the
    /// path comes from outside of the body.
    pub(super) fn new(material: &Material, reflectance: f32, albedo: V3, front: bool) -> Self {
        let part = |x: f32| f64::from(x.clamp(0.0, 1.0));
        let (layer, metal) = (0.08 * part(material.specular), part(material.metallic));
        let f0 = albedo.map(|color| layer + metal * (color - layer));
        let f90 = (50.0 * f0.iter().fold(0.0f64, |m, &x| m.max(x))).min(1.0);
        let alpha2 = match material.roughness {
            Some(roughness) => part(roughness).powi(4).max(MIN_ALPHA2),
            None => 2.0 / (f64::from(material.exponent()) + 2.0),
        };
        let mirror = part(reflectance);
        let glass = (1.0 - mirror) * part(material.transmission);
        let index = f64::from(material.refractive_index);
        let ratio = if front { 1.0 / index } else { index };
        Self { albedo, diffuse_albedo: scale(albedo, 1.0 - metal), f0, f90, alpha2, mirror, glass, ratio, front }
    }

    /// Fraction of light that is scattered: neither mirrored nor transmitted.
    pub(super) fn scattered_fraction(&self) -> f64 {
        1.0 - self.mirror - self.glass
    }

    /// True if light is refracted through the surface.
    pub(super) fn is_glass(&self) -> bool {
        self.glass > 0.0
    }

    /// True if the layer reflects no light.
    fn is_matt(&self) -> bool {
        self.f0 == [0.0; 3]
    }

    /// Fresnel reflectance of the layer at an angle of this cosine. Source: Schlick, 1994.
    fn fresnel(&self, cos: f64) -> V3 {
        let k = (1.0 - cos).clamp(0.0, 1.0);
        let square = k * k;
        let grazing = square * square * k;
        self.f0.map(|f0| f0 + (self.f90 - f0) * grazing)
    }

    /// Refraction at a smooth surface: the reflected fraction, and the direction on the other side (z down) of a path
    /// whose direction on this side is `o` (z up). Snell's law and Fresnel's equations of unpolarized light; `None` at
    /// total internal reflection. Source: Born and Wolf, Principles of Optics, section 1.5.
    fn refract(&self, o: V3) -> (f64, Option<V3>) {
        let square = 1.0 - self.ratio * self.ratio * (1.0 - o[2] * o[2]);
        if square <= 0.0 {
            return (1.0, None);
        }
        let (here, there) = (o[2], square.sqrt());
        let across = (self.ratio * here - there) / (self.ratio * here + there);
        let along = (here - self.ratio * there) / (here + self.ratio * there);
        let mirrored = 0.5 * (across * across + along * along);
        (mirrored, Some([-self.ratio * o[0], -self.ratio * o[1], -there]))
    }

    /// Approximate fraction of the outgoing light in direction `o` (local frame) that is not diffuse, under uniform
    /// illumination. Perfect mirror reflection and refraction through glass count as not diffuse. 1/21 is the
    /// cosine-weighted mean of Schlick's (1 - cos)^5 over the hemisphere.
    pub(super) fn gloss(&self, o: V3) -> f64 {
        let (rest, layer) = (self.scattered_fraction(), self.fresnel(o[2]));
        let out = self.f0.map(|f0| 1.0 - f0 - (self.f90 - f0) / 21.0);
        let below = brightness([0, 1, 2].map(|k| rest * self.diffuse_albedo[k] * (1.0 - layer[k]) * out[k]));
        let mirrored = brightness(layer.map(|layer| rest * layer + (1.0 - rest)));
        mirrored / (mirrored + below).max(1e-12)
    }

    /// GGX density of microfacets (D), by the cosine of their tilt.
    fn ndf(&self, cos: f64) -> f64 {
        let k = cos * cos * (self.alpha2 - 1.0) + 1.0;
        self.alpha2 / (PI * k * k)
    }

    /// Smith's masking term (G1) at an angle of this cosine.
    fn masking(&self, cos: f64) -> f64 {
        2.0 * cos / (cos + (self.alpha2 + (1.0 - self.alpha2) * cos * cos).sqrt())
    }

    /// Evaluates the BSDF times the cosine of `i` for light from `i` to `o`, both unit and in the local frame of the
    /// point. Perfect mirroring and glass are left out.
    pub(super) fn evaluate(&self, o: V3, i: V3) -> BsdfValue {
        if o[2] <= 0.0 || i[2] <= 0.0 {
            return BsdfValue { diffuse: [0.0; 3], specular: [0.0; 3] };
        }
        let rest = self.scattered_fraction();
        let (into, out) = (self.fresnel(o[2]), self.fresnel(i[2]));
        let diffuse = [0, 1, 2].map(|k| rest * self.diffuse_albedo[k] * (1.0 - into[k]) * (1.0 - out[k]) * i[2] / PI);
        if self.is_matt() {
            return BsdfValue { diffuse, specular: [0.0; 3] };
        }
        let half = add(o, i);
        let length = dot(half, half).sqrt();
        let (tilt, angle) = (half[2] / length, dot(half, o) / length);
        let root = |cos: f64| (self.alpha2 + (1.0 - self.alpha2) * cos * cos).sqrt();
        let seen_twice = 1.0 / (2.0 * (o[2] * root(i[2]) + i[2] * root(o[2])));
        BsdfValue { diffuse, specular: scale(self.fresnel(angle), rest * self.ndf(tilt) * seen_twice * i[2]) }
    }

    /// Probability of sampling the layer.
    fn layer_probability(&self, o: V3) -> f64 {
        if self.is_matt() {
            return 0.0;
        }
        let most = |color: V3| color.iter().fold(0.0f64, |m, &x| m.max(x));
        let layer = most(self.fresnel(o[2]));
        let below = most(self.diffuse_albedo) * (1.0 - layer);
        (layer / (layer + below).max(1e-12)).clamp(0.1, 1.0)
    }

    /// Samples the incoming direction of the light that is scattered to `o` (unit, in the local frame of the point),
    /// with three random numbers in 0..1. The mean of the weight times the light from the sampled direction is the
    /// light toward `o`. `None` stands for no light, also for directions along the surface.
    pub(super) fn sample(&self, o: V3, lobe: f64, at: [f64; 2]) -> Option<BsdfSample> {
        if o[2] <= 0.0 {
            return None;
        }
        if lobe < self.mirror {
            return Some(BsdfSample { direction: [-o[0], -o[1], o[2]], weight: [1.0; 3], is_specular: true, pdf: 0.0 });
        }
        let lobe = lobe - self.mirror;
        if lobe < self.glass {
            let (mirrored, through) = self.refract(o);
            // A path that enters the body takes the color.
            let tint = if self.front { self.albedo } else { [1.0; 3] };
            let (direction, weight) = match through {
                Some(through) if lobe >= mirrored * self.glass => (through, tint),
                _ => ([-o[0], -o[1], o[2]], [1.0; 3]),
            };
            return Some(BsdfSample { direction, weight, is_specular: true, pdf: 0.0 });
        }
        let rest = self.scattered_fraction();
        if rest <= 0.0 {
            return None;
        }
        let lobe = (lobe - self.glass) / rest;
        let share = self.layer_probability(o);
        let direction = if lobe < share { self.sample_microfacet(o, at)? } else { sample_cosine_hemisphere(at) };
        if direction[2] <= 0.0 {
            return None;
        }
        let pdf = self.pdf(o, direction);
        let BsdfValue { diffuse, specular } = self.evaluate(o, direction);
        let weight = [0, 1, 2].map(|k| (diffuse[k] + specular[k]) / pdf);
        Some(BsdfSample { direction, weight, is_specular: false, pdf })
    }

    /// Probability density \[1/sr\] with which [`sample`](Self::sample) returns the direction `i` for the outgoing
    /// direction `o`; both are above the surface.
    pub(super) fn pdf(&self, o: V3, i: V3) -> f64 {
        let share = self.layer_probability(o);
        // The sum of both strategies' pdfs.
        let mut pdf = (1.0 - share) * i[2] / PI;
        if share > 0.0 {
            let half = add(o, i);
            let tilt = half[2] / dot(half, half).sqrt();
            pdf += share * self.masking(o[2]) * self.ndf(tilt) / (4.0 * o[2]);
        }
        pdf * self.scattered_fraction()
    }

    /// Samples a visible microfacet and mirrors `o` by it; the result may point below the surface. `None` if rounding
    /// puts the facet edge-on to `o`, or a number is not finite.
    fn sample_microfacet(&self, o: V3, [a, b]: [f64; 2]) -> Option<V3> {
        let alpha = self.alpha2.sqrt();
        let unit = |v: V3| scale(v, 1.0 / dot(v, v).sqrt());
        let stretched = unit([alpha * o[0], alpha * o[1], o[2]]);
        let z = (1.0 - b) * (1.0 + stretched[2]) - stretched[2];
        let (r, [cos, sin]) = ((1.0 - z * z).max(0.0).sqrt(), cos_sin_turns(a));
        let cap = [r * cos + stretched[0], r * sin + stretched[1], z + stretched[2]];
        let facet = unit([alpha * cap[0], alpha * cap[1], cap[2]]);
        let twice = 2.0 * dot(facet, o);
        let i = [0, 1, 2].map(|k| twice * facet[k] - o[k]);
        (twice > 0.0 && i.iter().all(|x| x.is_finite())).then_some(i)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sobol::SobolSequence;
    use super::*;

    fn lobe(specular: f32, shininess: f32, albedo: f64) -> Bsdf {
        Bsdf::new(&Material { specular, shininess, ..Material::default() }, 0.0, [albedo; 3], true)
    }

    /// Mean of a function over 2^`log` sampled directions.
    fn mean(lobe: &Bsdf, o: V3, (pixel, seed): ([usize; 2], u32), log: u32, f: impl Fn(&BsdfSample) -> f64) -> f64 {
        let one = |k| {
            let sample = SobolSequence::new(pixel, seed).sample(k);
            lobe.sample(o, sample.sample_2d(0)[0], sample.sample_2d(1)).map_or(0.0, |next| f(&next))
        };
        (0..1 << log).map(one).sum::<f64>() / f64::from(1 << log)
    }

    fn toward(cos: f64) -> V3 {
        [(1.0 - cos * cos).sqrt(), 0.0, cos]
    }

    #[test]
    fn turns() {
        for k in 0..=1000 {
            let part = f64::from(k) / 1000.0;
            let angle = part * 2.0 * PI;
            let [cos, sin] = cos_sin_turns(part);
            assert!((cos - angle.cos()).abs() < 1e-14 && (sin - angle.sin()).abs() < 1e-14, "{part}");
        }
    }

    /// With light from everywhere, the sum over a grid of directions equals the mean of sampled ones, and does not
    /// exceed the incoming light. The grid's error is that of the midpoint rule, which is largest for sharp highlights:
    /// at 1000 x 1000 cells an order of magnitude below the tolerance. Samples: 2^14 points of a net.
    #[test]
    fn energy() {
        let n = 1000;
        let cell = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
        let heights: Vec<[f64; 2]> = (0..n).map(|k| [cell(k), (1.0 - cell(k).powi(2)).sqrt()]).collect();
        let turns: Vec<[f64; 2]> = (0..n).map(|k| cos_sin_turns(cell(k))).collect();
        for (specular, shininess, albedo) in
            [(1.0, 1.0, 0.0), (0.5, 0.5, 0.5), (1.0, 0.05, 1.0), (0.0, 0.5, 1.0), (1.0, 0.0, 1.0), (0.02, 1.0, 0.9)]
        {
            let lobe = lobe(specular, shininess, albedo);
            for cos in [1.0, 0.7, 0.3, 0.1] {
                let o = toward(cos);
                let mut all = 0.0;
                for [c, s] in &turns {
                    for [z, r] in &heights {
                        let BsdfValue { diffuse, specular: layer } = lobe.evaluate(o, [r * c, r * s, *z]);
                        all += (diffuse[0] + layer[0]) * 2.0 * PI / f64::from(n * n);
                    }
                }
                let chosen = mean(&lobe, o, ([1, 2], 3), 14, |next| next.weight[0]);
                let what = format!("specular {specular}, shininess {shininess}, albedo {albedo}, cosine {cos}");
                assert!((all - chosen).abs() < 0.005 * all.max(0.1), "{what}: {all}, chosen {chosen}");
                assert!(all <= 1.0 + 1e-6, "{what}: {all}");
                if specular == 0.0 {
                    assert!((all - albedo).abs() < 1e-5, "{what}: {all}");
                }
                // A control: if the layer did not take light from below it, more light would leave than arrives.
                if albedo == 1.0 && specular == 1.0 {
                    let layer = Bsdf { diffuse_albedo: [0.0; 3], ..lobe };
                    let above = mean(&layer, o, ([1, 2], 3), 14, |next| next.weight[0]);
                    assert!(1.0 + above > 1.02, "{what}: {above}");
                }
            }
        }
    }

    /// For light along the normal, a smooth metal mirrors its color, and nothing else; half a metal is the mean of
    /// both.
    #[test]
    fn metals() {
        let gold = [1.0, 0.77, 0.34];
        let returned = |metallic: f32| {
            let material = Material { metallic, specular: 0.5, roughness: Some(0.2), ..Material::default() };
            let lobe = Bsdf::new(&material, 0.0, gold, true);
            [0, 1, 2].map(|c| mean(&lobe, [0.0, 0.0, 1.0], ([4, 2], 1), 14, |next| next.weight[c]))
        };
        let metal = returned(1.0);
        for c in 0..3 {
            // Facets of alpha 0.04 are tilted by a few degrees. Schlick's term is below 1e-5 there, and their masking
            // below alpha²/2. The net is accurate to a thousandth.
            assert!((metal[c] - gold[c]).abs() < 2e-3, "{metal:?}");
        }
        // The control: without metal, the layer reflects 0.04 of all colors, and 0.96 times the light from below it
        // passes.
        let plain = returned(0.0);
        assert!((plain[2] - metal[2]).abs() < 0.1 && (plain[0] - metal[0]).abs() > 0.02, "{plain:?}");
    }

    /// Along the normal ((n - 1)/(n + 1))² is mirrored. At Brewster's angle, tan = n, it is half of the reflectance of
    /// the electric field across the plane, ((n² - 1)/(n² + 1))². From inside beyond the critical angle, sin = 1/n, it
    /// is everything. Transmitted light obeys Snell's law.
    #[test]
    fn glass() {
        let n = 1.5f64;
        let glass = Material { transmission: 1.0, refractive_index: 1.5, ..Material::default() };
        let [outside, inside] = [true, false].map(|front| Bsdf::new(&glass, 0.0, [0.8; 3], front));
        let along = ((n - 1.0) / (n + 1.0)).powi(2);
        let brewster = 0.5 * ((n * n - 1.0) / (n * n + 1.0)).powi(2);
        let tilt = n.atan();
        for (lobe, o, expected) in [
            (&outside, [0.0, 0.0, 1.0], along),
            (&inside, [0.0, 0.0, 1.0], along),
            (&outside, [tilt.sin(), 0.0, tilt.cos()], brewster),
            (&inside, [1.01 / n, 0.0, (1.0 - (1.01 / n).powi(2)).sqrt()], 1.0),
        ] {
            let count = 10_000;
            let chosen = (0..count).map(|k| lobe.sample(o, (f64::from(k) + 0.5) / f64::from(count), [0.5; 2]).unwrap());
            let chosen: Vec<_> = chosen.collect();
            let up = chosen.iter().filter(|next| next.direction[2] > 0.0).count() as f64 / f64::from(count);
            assert!((up - expected).abs() < 2e-4, "{o:?}: {up}, not {expected}");
            for next in chosen.iter().filter(|next| next.direction[2] < 0.0) {
                // The sines of the two angles have the ratio of the indices.
                let ratio = (next.direction[0] + lobe.ratio * o[0]).abs();
                let length = dot(next.direction, next.direction);
                assert!(ratio < 1e-15 && (length - 1.0).abs() < 1e-14, "{next:?}");
                let tint = if lobe.front { 0.8 } else { 1.0 };
                assert!(next.is_specular && next.weight == [tint; 3]);
            }
        }
        // The control: an index of 1 is invisible.
        let air = Bsdf::new(&Material { refractive_index: 1.0, ..glass.clone() }, 0.0, [1.0; 3], true);
        let straight = air.sample([0.6, 0.0, 0.8], 1e-9, [0.5; 2]).unwrap().direction;
        assert!((straight[0] + 0.6).abs() < 1e-15 && (straight[2] + 0.8).abs() < 1e-15, "{straight:?}");
        // Except for its color.
        let colored = Bsdf::new(&Material { refractive_index: 1.0, ..glass }, 0.0, [0.3; 3], true);
        assert_eq!(colored.sample([0.6, 0.0, 0.8], 0.5, [0.5; 2]).unwrap().weight, [0.3; 3]);
    }

    #[test]
    fn reciprocity() {
        let lobe = lobe(0.7, 0.2, 0.6);
        for (a, b) in [(0.9, 0.2), (0.5, 0.6), (1.0, 0.05)] {
            let (o, i) = (toward(a), [0.0, (1.0f64 - b * b).sqrt(), b]);
            let (there, back) = (lobe.evaluate(o, i), lobe.evaluate(i, o));
            let close = |x: f64, y: f64| (x - y).abs() < 1e-12 * x.abs().max(1e-3);
            assert!(close(there.specular[0] / i[2], back.specular[0] / o[2]));
            assert!(close(there.diffuse[0] / i[2], back.diffuse[0] / o[2]));
        }
    }

    #[test]
    fn grazing() {
        for (specular, reflectance) in [(1.0, 0.0), (0.0, 0.0), (0.5, 0.5)] {
            let lobe = Bsdf::new(&Material { specular, ..Material::default() }, reflectance, [0.5; 3], true);
            for chance in [0.0, 0.3, 0.6, 0.99] {
                assert!(lobe.sample([1.0, 0.0, 0.0], chance, [0.3, 0.7]).is_none());
                // A control: slightly above, a direction is sampled, and its weight is finite.
                let next = lobe.sample(toward(0.5), chance, [0.3, 0.7]);
                assert!(next.is_none_or(|next| next.weight.iter().all(|x| x.is_finite())));
            }
        }
    }

    /// Compares with sampled directions, with the layer alone and with both parts: to a few percent, because masking is
    /// left out.
    #[test]
    fn gloss() {
        for (specular, shininess, albedo) in [(0.0, 0.5, 0.7), (0.5, 0.5, 0.5), (1.0, 0.2, 0.0), (1.0, 0.2, 1.0)] {
            let whole = lobe(specular, shininess, albedo);
            for cos in [1.0, 0.6] {
                let o = toward(cos);
                let chosen = |lobe: &Bsdf| mean(lobe, o, ([3, 1], 5), 12, |next| next.weight[1]);
                let expected = chosen(&Bsdf { diffuse_albedo: [0.0; 3], ..whole }) / chosen(&whole);
                let found = whole.gloss(o);
                assert!((found - expected).abs() < 0.03, "specular {specular}, {cos}: {found}, not {expected}");
            }
        }
    }

    #[test]
    fn mirrors() {
        let lobe = Bsdf::new(&Material { specular: 0.0, ..Material::default() }, 0.4, [0.5; 3], true);
        let o = toward(0.6);
        assert!(
            lobe.sample(o, 0.39, [0.5; 2]).unwrap().is_specular && !lobe.sample(o, 0.41, [0.5; 2]).unwrap().is_specular
        );
        assert_eq!(lobe.sample(o, 0.0, [0.5; 2]).unwrap().direction, [-o[0], 0.0, 0.6]);
        // The rest is Lambertian: 0.6 of 0.5, and 0.6 of the samples.
        assert!((lobe.sample(o, 0.8, [0.3, 0.2]).unwrap().weight[0] - 0.5).abs() < 1e-6);
        let all = lobe.evaluate(o, [0.0, 0.0, 1.0]).diffuse[0] * PI;
        assert!((all - 0.6 * 0.5).abs() < 1e-6);
    }
}
