//! Writer of the meshes, height fields, textures and materials of a part.

use super::super::write::Element;
use super::{PartError, PartWriter, format_f32s, row};
use image::{ExtendedColorType, ImageEncoder};
use kinetoscope_look::{MeshArrays, TextureType};
use kinetoscope_mujoco::{Asset, SupportedVersion, mjcf_keywords};
use std::collections::HashMap;

/// Order in which MuJoCo stacks the faces of a cube texture.
const CUBE_FACE_ORDER: &str = "RLUDFB";

impl PartWriter<'_> {
    pub(super) fn assets(&self) -> Vec<String> {
        let m = self.model;
        let textures = (0..m.ntex()).filter_map(|t| self.texture(t));
        let materials = (0..m.nmat()).map(|material| self.material(material));
        let meshes = (0..m.nmesh()).map(|mesh| self.mesh(mesh));
        let fields = (0..m.nhfield()).map(|field| {
            Element::new("hfield")
                .attr("name", self.scoped_name(&self.names.height_fields[field]))
                .attr("file", self.height_field_file(field))
                .numbers("size", row(m.hfield_size(), 4, field))
                .leaf()
        });
        textures.chain(materials).chain(meshes).chain(fields).collect()
    }

    /// True if a texture is written with the part. A skybox surrounds the whole scene, and pixels may be missing in the
    /// model.
    fn is_written(&self, texture: usize) -> bool {
        self.model.texture(texture).is_some_and(|t| t.kind != TextureType::Skybox && color(t.channels).is_some())
    }

    fn texture_file(&self, texture: usize) -> String {
        format!("{}texture{texture}.png", self.stem)
    }

    fn height_field_file(&self, field: usize) -> String {
        format!("{}hfield{field}.bin", self.stem)
    }

    fn texture(&self, texture: usize) -> Option<String> {
        let arrays = self.model.texture(texture).filter(|_| self.is_written(texture))?;
        let mut element = Element::new("texture")
            .attr("name", self.scoped_name(&self.names.textures[texture]))
            .attr("type", if arrays.kind == TextureType::Cube { "cube" } else { "2d" })
            .attr("file", self.texture_file(texture));
        if arrays.kind == TextureType::Cube && arrays.height == 6 * arrays.width {
            element = element.attr("gridsize", "6 1").attr("gridlayout", CUBE_FACE_ORDER);
        }
        if arrays.channels == 4 && self.target == SupportedVersion::V4 {
            element = element.attr("nchannel", 4);
        }
        Some(element.leaf())
    }

    fn material(&self, material: usize) -> String {
        let values = self.model.material(material);
        let texture = values.texture.filter(|t| self.is_written(*t)).map(|t| self.scoped_name(&self.names.textures[t]));
        let newer = |values: Option<f32>, what: &str| {
            values.filter(|value| self.supports_v4("material", material, &format!("{what} {value}")))
        };
        let (metallic, roughness) = (newer(values.metallic, "metallic"), newer(values.roughness, "roughness"));
        Element::new("material")
            .attr("name", self.scoped_name(&self.names.materials[material]))
            .opt("texture", texture)
            .attr("texrepeat", format_f32s(&values.tex_repeat))
            .attr("texuniform", values.tex_uniform)
            .attr("emission", values.emission)
            .attr("specular", values.specular)
            .attr("shininess", values.shininess)
            .attr("reflectance", values.reflectance)
            .opt("metallic", metallic)
            .opt("roughness", roughness)
            .attr("rgba", format_f32s(&values.rgba))
            .leaf()
    }

    fn mesh(&self, mesh: usize) -> String {
        let IndexedMesh { positions, texcoords, triangles } = single_index_mesh(&self.model.mesh(mesh));
        let mut element = Element::new("mesh").attr("name", self.scoped_name(&self.names.meshes[mesh]));
        if self.target == SupportedVersion::V4 && !self.collides(mesh) {
            // As for visuals of robots: a mesh without collisions may be flat or open.
            element = element.attr("inertia", "shell");
        }
        if let Some(texcoords) = texcoords {
            element = element.attr("texcoord", format_f32s(texcoords.as_flattened()));
        }
        let triangles: Vec<String> = triangles.as_flattened().iter().map(ToString::to_string).collect();
        element.attr("vertex", format_f32s(positions.as_flattened())).attr("face", triangles.join(" ")).leaf()
    }

    fn collides(&self, mesh: usize) -> bool {
        let m = self.model;
        let touches = |geom: usize| m.geom_contype()[geom] != 0 || m.geom_conaffinity()[geom] != 0;
        let paired = |geom: usize| m.pair_geom1().iter().chain(m.pair_geom2()).any(|g| *g as usize == geom);
        (0..m.ngeom()).any(|geom| {
            m.geom_dataid()[geom] == mesh as i32
                && mjcf_keywords::geom(m.geom_type()[geom]).is_some_and(|(word, _)| word == "mesh")
                && (touches(geom) || paired(geom))
        })
    }

    /// Returns the files that the assets refer to, as names and bytes: PNG textures, and height fields in MuJoCo's
    /// format.
    pub(super) fn files(&self) -> Result<Vec<Asset>, PartError> {
        let m = self.model;
        let mut files = Vec::new();
        for texture in (0..m.ntex()).filter(|&t| self.is_written(t)) {
            let Some(arrays) = m.texture(texture) else { continue };
            let Some(color) = color(arrays.channels) else { continue };
            let mut bytes = Vec::new();
            let (width, height) = (arrays.width as u32, arrays.height as u32);
            image::codecs::png::PngEncoder::new(&mut bytes)
                .write_image(arrays.pixels, width, height, color)
                .map_err(|error| self.unsupported("texture", texture, error.to_string()))?;
            files.push(Asset { name: self.texture_file(texture), bytes });
        }
        for field in 0..m.nhfield() {
            let arrays = m.height_field(field);
            let sizes = [arrays.rows as i32, arrays.columns as i32];
            let mut bytes: Vec<u8> = sizes.iter().flat_map(|n| n.to_le_bytes()).collect();
            bytes.extend(arrays.elevation.iter().flat_map(|height| height.to_le_bytes()));
            files.push(Asset { name: self.height_field_file(field), bytes });
        }
        Ok(files)
    }
}

/// Color type for 1, 3 or 4 channels of 8 bits; `None` for any other number.
fn color(channels: usize) -> Option<ExtendedColorType> {
    match channels {
        1 => Some(ExtendedColorType::L8),
        3 => Some(ExtendedColorType::Rgb8),
        4 => Some(ExtendedColorType::Rgba8),
        _ => None,
    }
}

/// Triangles with one index for position and texture coordinate, as in MJCF.
struct IndexedMesh {
    positions: Vec<[f32; 3]>,
    texcoords: Option<Vec<[f32; 2]>>,
    triangles: Vec<[i32; 3]>,
}

fn single_index_mesh(mesh: &MeshArrays<'_>) -> IndexedMesh {
    let Some(texcoords) = mesh.texcoords else {
        return IndexedMesh { positions: mesh.positions.to_vec(), texcoords: None, triangles: mesh.faces.to_vec() };
    };
    let mut known: HashMap<[i32; 2], i32> = HashMap::new();
    let (mut positions, mut coordinates) = (Vec::new(), Vec::new());
    let corner = |pair: [i32; 2]| {
        let next = known.len() as i32;
        *known.entry(pair).or_insert_with(|| {
            positions.push(mesh.positions.get(pair[0] as usize).copied().unwrap_or_default());
            coordinates.push(texcoords.get(pair[1] as usize).copied().unwrap_or_default());
            next
        })
    };
    let pairs = mesh.faces.iter().zip(mesh.face_texcoords);
    let corners: Vec<i32> =
        pairs.flat_map(|(face, texture)| (0..3).map(|k| [face[k], texture[k]])).map(corner).collect();
    IndexedMesh { positions, texcoords: Some(coordinates), triangles: corners.as_chunks::<3>().0.to_vec() }
}
