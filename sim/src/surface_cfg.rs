//! What surfaces look like besides their colour: gloss, metal, glass, light of their own.

use crate::error::{Error, Result};
use crate::named::Named;
use crate::pattern;
use kinetoscope_scene::Material;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a surface looks like besides its colour and its texture. What is `None` is as the file or the model says, MuJoCo's
/// defaults where those say nothing. Nothing of it changes how things move.
///
/// ```
/// use kinetoscope_sim::{RigidObjectCfg, SimulationManager, SimulationManagerCfg, SurfaceCfg};
///
/// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
/// let ball = RigidObjectCfg { uid: "ball".into(), surface: SurfaceCfg::glass(), ..Default::default() };
/// sim.add_rigid_object(ball)?;
/// # Ok::<(), kinetoscope_sim::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceCfg {
    /// Own light, as a multiple of the colour, at least 0.
    pub emission: Option<f64>,
    /// Strength of highlights, 0..=1.
    pub specular: Option<f64>,
    /// Sharpness of highlights, 0..=1: the exponent is 128 times this.
    pub shininess: Option<f64>,
    /// Share of the light that is mirrored perfectly, 0..=1: by opaque planes and by the +z face of boxes, in all renderers; by
    /// other shapes in path-traced frames only.
    pub reflectance: Option<f64>,
    /// How much of it is metal, 0..=1: light does not get below it, and what it mirrors has its colour.
    pub metallic: Option<f64>,
    /// How rough it is, 0..=1, instead of `shininess`: alpha of the GGX law is its square.
    pub roughness: Option<f64>,
    /// How much of the light goes through, bent as by glass, 0..=1. Of closed shapes, and in path-traced pictures only: other
    /// renderers draw the surface.
    pub transmission: Option<f64>,
    /// Refractive index of what is inside, 1..=10: 1.5 for glass, 1.33 for water.
    pub refractive_index: Option<f64>,
}

impl SurfaceCfg {
    /// Clear glass, where the colour is white.
    pub fn glass() -> Self {
        Self { transmission: Some(1.0), refractive_index: Some(1.5), roughness: Some(0.0), ..Self::default() }
    }

    /// Metal in the colour of the surface: roughness 0 is polished, 1 is matt.
    pub fn metal(roughness: f64) -> Self {
        Self { metallic: Some(1.0), roughness: Some(roughness), ..Self::default() }
    }

    /// The surfaces of those of `names` that `patterns` name, by index; `what` is what they are names of, `of` the entity.
    ///
    /// # Errors
    /// A number that is out of range, or a pattern that is bad, matches none of `names`, or one that another matches too.
    pub(crate) fn assign(
        patterns: &[(String, Self)],
        names: &[impl AsRef<str>],
        what: &'static str,
        of: Named,
    ) -> Result<Vec<(usize, Self)>> {
        patterns.iter().try_for_each(|(_, surface)| surface.validate())?;
        let surfaces = pattern::assign(patterns, &BTreeMap::new(), names, what)
            .map_err(|error| Error::Surfaces { of, error: Box::new(error) })?;
        Ok(surfaces.into_iter().enumerate().filter_map(|(index, surface)| Some((index, surface?))).collect())
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first field that is out of range.
    pub fn validate(&self) -> Result<()> {
        let least_and_most = [
            ("surface.emission", self.emission, 0.0, f64::from(f32::MAX), "it must be a finite number >= 0"),
            ("surface.specular", self.specular, 0.0, 1.0, "it must be 0 to 1"),
            ("surface.shininess", self.shininess, 0.0, 1.0, "it must be 0 to 1"),
            ("surface.reflectance", self.reflectance, 0.0, 1.0, "it must be 0 to 1"),
            ("surface.metallic", self.metallic, 0.0, 1.0, "it must be 0 to 1"),
            ("surface.roughness", self.roughness, 0.0, 1.0, "it must be 0 to 1"),
            ("surface.transmission", self.transmission, 0.0, 1.0, "it must be 0 to 1"),
            ("surface.refractive_index", self.refractive_index, 1.0, 10.0, "it must be 1 to 10, such as 1.5 for glass"),
        ];
        for (field, value, least, most, expected) in least_and_most {
            if let Some(value) = value.filter(|value| !(least..=most).contains(value)) {
                return Err(Error::Config { field, value: value.to_string(), expected });
            }
        }
        Ok(())
    }

    /// The material with what is given here.
    pub(crate) fn over(&self, mut material: Material) -> Material {
        let set = |to: &mut f32, value: Option<f64>| {
            if let Some(value) = value {
                *to = value as f32;
            }
        };
        set(&mut material.emission, self.emission);
        set(&mut material.specular, self.specular);
        set(&mut material.shininess, self.shininess);
        set(&mut material.reflectance, self.reflectance);
        set(&mut material.metallic, self.metallic);
        set(&mut material.transmission, self.transmission);
        set(&mut material.refractive_index, self.refractive_index);
        if let Some(roughness) = self.roughness {
            material.roughness = Some(roughness as f32);
        } else if self.shininess.is_some() {
            // What is said here holds, whatever the model says of its roughness.
            material.roughness = None;
        }
        material
    }
}
