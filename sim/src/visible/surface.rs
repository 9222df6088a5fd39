//! Materials and textures of MuJoCo models.

use kinetoscope_look::TextureType;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::Model;
use kinetoscope_scene::{Material, Texture, TextureKind};
use std::sync::Arc;

/// Materials of a model, for rendering.
pub(super) struct ModelMaterials<'a> {
    model: &'a Model,
    materials: Vec<Material>,
    left_out: Vec<String>,
}

impl<'a> ModelMaterials<'a> {
    pub(super) fn of(model: &'a Model) -> Self {
        let mut left_out = Vec::new();
        let textures: Vec<Option<Arc<Texture>>> = (0..model.ntex())
            .map(|index| {
                texture(model, index).unwrap_or_else(|reason| {
                    left_out.push(format!("texture {index} is not rendered: {reason}"));
                    None
                })
            })
            .collect();
        let materials = (0..model.nmat())
            .map(|index| {
                let m = model.material(index);
                Material {
                    rgba: m.rgba.map(|c| c.clamp(0.0, 1.0)),
                    texture: m.texture.and_then(|t| textures.get(t).cloned().flatten()),
                    tex_repeat: m.tex_repeat,
                    tex_uniform: m.tex_uniform,
                    emission: m.emission,
                    specular: m.specular,
                    shininess: m.shininess,
                    reflectance: m.reflectance,
                    metallic: m.metallic.unwrap_or(0.0),
                    roughness: m.roughness,
                    ..Material::default()
                }
            })
            .collect();
        Self { model, materials, left_out }
    }

    /// Render material of a geom: its color, and the properties of its MuJoCo material, if any. Only planes and boxes
    /// reflect.
    pub(super) fn of_geom(&self, geom: usize) -> Material {
        let rgba = color_of(self.model, geom);
        match usize::try_from(self.model.geom_matid()[geom]).ok().and_then(|m| self.materials.get(m)) {
            None => Material::from_rgba(rgba),
            Some(material) => {
                // MuJoCo reflects the scene in planes and in the upper face of boxes only.
                let mirrors = matches!(self.model.geom_type()[geom] as u32, mj::mjGEOM_PLANE | mj::mjGEOM_BOX);
                let reflectance = if mirrors { material.reflectance } else { 0.0 };
                Material { rgba, reflectance, ..material.clone() }
            }
        }
    }

    /// Render material of a site: its color, and the properties of its MuJoCo material, if any.
    pub(super) fn of_site(&self, site: usize) -> Material {
        self.material(&self.model.site_rgba()[4 * site..4 * site + 4], self.model.site_matid()[site])
    }

    /// Material of an element with this color and material.
    pub(super) fn material(&self, rgba: &[f32], material: i32) -> Material {
        let rgba = color(self.model, rgba, material);
        match usize::try_from(material).ok().and_then(|m| self.materials.get(m)) {
            None => Material::from_rgba(rgba),
            Some(material) => Material { rgba, reflectance: 0.0, ..material.clone() },
        }
    }

    /// Messages about textures that cannot be rendered.
    pub(super) fn left_out(&self) -> &[String] {
        &self.left_out
    }
}

/// Color and opacity of a geom. A color of the geom's own overrides that of its material, as in MuJoCo's viewer.
pub(crate) fn color_of(model: &Model, geom: usize) -> [f32; 4] {
    color(model, &model.geom_rgba()[4 * geom..4 * geom + 4], model.geom_matid()[geom])
}

/// Color and opacity of a site, by the rule for geoms.
pub(super) fn color_of_site(model: &Model, site: usize) -> [f32; 4] {
    color(model, &model.site_rgba()[4 * site..4 * site + 4], model.site_matid()[site])
}

pub(super) fn color(model: &Model, own: &[f32], material: i32) -> [f32; 4] {
    /// MuJoCo's gray of geoms without a color.
    const DEFAULT_GEOM_RGBA: [f32; 4] = [0.5, 0.5, 0.5, 1.0];
    let own = [own[0], own[1], own[2], own[3]].map(|c| c.clamp(0.0, 1.0));
    match usize::try_from(material) {
        Ok(material) if own == DEFAULT_GEOM_RGBA && material < model.nmat() => {
            model.material(material).rgba.map(|c| c.clamp(0.0, 1.0))
        }
        _ => own,
    }
}

/// Texture of surfaces; `None` for a skybox.
fn texture(model: &Model, index: usize) -> Result<Option<Arc<Texture>>, String> {
    let kind = match model.texture(index).map(|arrays| arrays.kind) {
        Some(TextureType::Skybox) => return Ok(None),
        Some(TextureType::Cube) => TextureKind::Cube,
        Some(TextureType::TwoD) | None => TextureKind::TwoD,
    };
    image(model, index, kind).map(Some)
}

/// Image of a skybox.
pub(super) fn skybox(model: &Model, index: usize) -> Result<Arc<Texture>, String> {
    image(model, index, TextureKind::Cube)
}

fn image(model: &Model, index: usize, kind: TextureKind) -> Result<Arc<Texture>, String> {
    let Some(arrays) = model.texture(index) else { return Err("its pixels are not in the model".into()) };
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    // Gray images have one channel, or two with opacity.
    let colors: Vec<u8> = match arrays.channels {
        1 | 2 => arrays.pixels.chunks_exact(arrays.channels).flat_map(|p| [p[0]; 3]).collect(),
        _ => Vec::new(),
    };
    let (channels, pixels) = if colors.is_empty() { (arrays.channels, arrays.pixels) } else { (3, &colors[..]) };
    // A square image is the same on all faces of the cube.
    let is_square = kind == TextureKind::Cube && arrays.height == arrays.width;
    let (faces, repeated) = if is_square { (6, pixels.repeat(6)) } else { (1, Vec::new()) };
    let pixels = if is_square { &repeated[..] } else { pixels };
    Texture::new(kind, size(arrays.width), size(faces * arrays.height), size(channels), pixels)
        .map(Arc::new)
        .map_err(|error| error.to_string())
}
