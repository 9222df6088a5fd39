//! Surface properties besides color: gloss, metal, glass, emission.

use crate::entity_label::EntityLabel;
use crate::error::{Error, Result};
use crate::pattern;
use kinetoscope_scene::Material;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Surface properties besides color and texture, for rendering only. `None` keeps the value of the file or model, or
/// else MuJoCo's default.
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
    /// Emitted light as a multiple of the color, at least 0.
    pub emission: Option<f64>,
    /// Strength of specular highlights, 0..=1.
    pub specular: Option<f64>,
    /// Sharpness of specular highlights, 0..=1: the exponent is 128 times this. Replaces a roughness of the file or
    /// model, unless `roughness` is set.
    pub shininess: Option<f64>,
    /// Fraction of light in perfect mirror reflection, 0..=1. All renderers apply it to opaque planes and the +z face
    /// of boxes; for other shapes, only path-traced frames do.
    pub reflectance: Option<f64>,
    /// Metalness, 0..=1. A metal has no diffuse reflection, and its color tints the specular reflection.
    pub metallic: Option<f64>,
    /// Roughness, 0..=1; 0 is polished. If `roughness` and `shininess` are both set, `roughness` is used. The alpha of
    /// the GGX distribution is the square of the roughness.
    pub roughness: Option<f64>,
    /// Fraction of light that is refracted through the surface, as by glass, 0..=1. Only path-traced frames apply it,
    /// and only to closed shapes; other renderers draw the surface as with 0.
    pub transmission: Option<f64>,
    /// Index of refraction of the inside, 1..=10: 1.5 for glass, 1.33 for water.
    pub refractive_index: Option<f64>,
}

impl SurfaceCfg {
    /// Clear glass, if the color is white.
    pub fn glass() -> Self {
        Self { transmission: Some(1.0), refractive_index: Some(1.5), roughness: Some(0.0), ..Self::default() }
    }

    /// Metal in the color of the surface: roughness 0 is polished, 1 is matte.
    pub fn metal(roughness: f64) -> Self {
        Self { metallic: Some(1.0), roughness: Some(roughness), ..Self::default() }
    }

    /// Assigns surfaces to `names` by pattern and returns them with the index of the name. `what` is the type of the
    /// names, `entity` the entity, both for errors.
    ///
    /// # Errors
    /// A number is out of range, or a pattern is invalid, matches none of `names`, or matches a name that another
    /// pattern matches too.
    pub(crate) fn assign(
        patterns: &[(String, Self)],
        names: &[impl AsRef<str>],
        what: &'static str,
        entity: EntityLabel,
    ) -> Result<Vec<(usize, Self)>> {
        patterns.iter().try_for_each(|(_, surface)| surface.validate())?;
        let surfaces = pattern::assign(patterns, &BTreeMap::new(), names, what)
            .map_err(|error| Error::Surfaces { entity, error: Box::new(error) })?;
        Ok(surfaces.into_iter().enumerate().filter_map(|(index, surface)| Some((index, surface?))).collect())
    }

    /// Checks that every number that is set is in its range.
    ///
    /// # Errors
    /// A field is out of range; the first one is reported.
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

    /// Returns `material` with all values that are set here. A shininess without a roughness removes its roughness.
    pub(crate) fn apply_to(&self, mut material: Material) -> Material {
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
            // A configured shininess overrides the roughness of the model.
            material.roughness = None;
        }
        material
    }
}
