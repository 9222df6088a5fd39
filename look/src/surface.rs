//! Materials and textures of MuJoCo models.

use crate::{GeomType, TextureType, VisualModel};
use kinetoscope_scene::{LightingSpace, Material, Texture, TextureKind, decode_srgb};
use std::sync::Arc;

/// Materials of a model, for rendering.
#[derive(Clone, Debug)]
pub struct ModelMaterials {
    materials: Vec<Material>,
    textures: Vec<Option<Arc<Texture>>>,
    left_out: Vec<String>,
}

impl ModelMaterials {
    /// Converts the materials and the textures of a model, for scenes with this rule of lighting.
    pub fn new(model: &impl VisualModel, space: LightingSpace) -> Self {
        let mut left_out = Vec::new();
        let textures: Vec<Option<Arc<Texture>>> = (0..model.ntex())
            .map(|index| {
                texture(model, index, space).unwrap_or_else(|reason| {
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
        Self { materials, textures, left_out }
    }

    /// Render material of a geom of MuJoCo's type number `kind`: its color, and the properties of its MuJoCo material,
    /// if any. Only planes and boxes reflect.
    ///
    /// # Panics
    /// `rgba` has fewer than four numbers.
    pub fn of_geom(&self, kind: i32, rgba: &[f32], material: i32) -> Material {
        let reflectance = match self.get(material) {
            // MuJoCo reflects the scene in planes and in the upper face of boxes only.
            Some(material) if matches!(GeomType::from_id(kind), Some(GeomType::Plane | GeomType::Box)) => {
                material.reflectance
            }
            _ => 0.0,
        };
        let material = self.of_element(rgba, material);
        Material { reflectance, ..material }
    }

    /// Render material of an element other than a geom: its color, and the properties of its MuJoCo material, if any,
    /// without reflectance.
    ///
    /// # Panics
    /// `rgba` has fewer than four numbers.
    pub fn of_element(&self, rgba: &[f32], material: i32) -> Material {
        let rgba = self.color(rgba, material);
        match self.get(material) {
            None => Material::from_rgba(rgba),
            Some(material) => Material { rgba, reflectance: 0.0, ..material.clone() },
        }
    }

    /// Material of an index of the model; `None` for an index that the model lacks, such as -1.
    pub fn get(&self, material: i32) -> Option<&Material> {
        usize::try_from(material).ok().and_then(|m| self.materials.get(m))
    }

    /// Image of an index of the model; `None` for an index that the model lacks, such as -1, for a skybox, and for a
    /// texture that cannot be rendered.
    pub fn texture(&self, texture: i32) -> Option<&Arc<Texture>> {
        usize::try_from(texture).ok().and_then(|t| self.textures.get(t)?.as_ref())
    }

    /// Messages about textures that cannot be rendered.
    pub fn omitted(&self) -> &[String] {
        &self.left_out
    }

    fn color(&self, own: &[f32], material: i32) -> [f32; 4] {
        element_color(own, self.get(material).map(|material| material.rgba))
    }
}

/// Color and opacity of an element with the color `own`, and the color of its material. A color other than MuJoCo's
/// default, (0.5, 0.5, 0.5, 1), overrides that of the material, as in MuJoCo's viewer.
///
/// # Panics
/// `own` has fewer than four numbers.
pub fn element_color(own: &[f32], material: Option<[f32; 4]>) -> [f32; 4] {
    /// MuJoCo's gray of geoms without a color.
    const DEFAULT_GEOM_RGBA: [f32; 4] = [0.5, 0.5, 0.5, 1.0];
    let own = [own[0], own[1], own[2], own[3]].map(|c| c.clamp(0.0, 1.0));
    match material {
        Some(material) if own == DEFAULT_GEOM_RGBA => material.map(|c| c.clamp(0.0, 1.0)),
        _ => own,
    }
}

/// Texture of surfaces; `None` for a skybox.
fn texture(model: &impl VisualModel, index: usize, space: LightingSpace) -> Result<Option<Arc<Texture>>, String> {
    let kind = match model.texture(index).map(|arrays| arrays.kind) {
        Some(TextureType::Skybox) => return Ok(None),
        Some(TextureType::Cube) => TextureKind::Cube,
        Some(TextureType::TwoD) | None => TextureKind::TwoD,
    };
    image(model, index, kind, space).map(Some)
}

/// Index of the first texture that is a skybox, if any.
pub fn first_skybox(model: &impl VisualModel) -> Option<usize> {
    (0..model.ntex()).find(|&texture| model.texture(texture).is_some_and(|t| t.kind == TextureType::Skybox))
}

/// Image of a skybox, given by the index of its texture, for scenes with this rule of lighting.
///
/// # Errors
/// The reason why the texture cannot be rendered.
///
/// # Panics
/// There is no such texture.
pub fn skybox(model: &impl VisualModel, index: usize, space: LightingSpace) -> Result<Arc<Texture>, String> {
    image(model, index, TextureKind::Cube, space)
}

fn image(
    model: &impl VisualModel,
    index: usize,
    kind: TextureKind,
    space: LightingSpace,
) -> Result<Arc<Texture>, String> {
    let Some(arrays) = model.texture(index) else { return Err("its pixels are not in the model".into()) };
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    // Gray images have one channel, or two with opacity.
    let colors: Vec<u8> = match arrays.channels {
        1 | 2 => arrays.pixels.chunks_exact(arrays.channels).flat_map(|p| [p[0]; 3]).collect(),
        _ => Vec::new(),
    };
    let (channels, pixels) = if colors.is_empty() { (arrays.channels, arrays.pixels) } else { (3, &colors[..]) };
    // MuJoCo's renderer decodes the bytes of two-dimensional textures, and shows the result as a display color.
    let is_decoded = arrays.is_srgb && kind == TextureKind::TwoD && space == LightingSpace::Display;
    let decoded: Vec<u8> = if is_decoded {
        let table: [u8; 256] = std::array::from_fn(|k| (255.0 * decode_srgb(k as f32 / 255.0)).round() as u8);
        pixels.iter().map(|&byte| table[usize::from(byte)]).collect()
    } else {
        Vec::new()
    };
    let pixels = if decoded.is_empty() { pixels } else { &decoded[..] };
    // A square image is the same on all faces of the cube.
    let is_square = kind == TextureKind::Cube && arrays.height == arrays.width;
    let (faces, repeated) = if is_square { (6, pixels.repeat(6)) } else { (1, Vec::new()) };
    let pixels = if is_square { &repeated[..] } else { pixels };
    Texture::averaged_in(space, kind, size(arrays.width), size(faces * arrays.height), size(channels), pixels)
        .map(Arc::new)
        .map_err(|error| error.to_string())
}
