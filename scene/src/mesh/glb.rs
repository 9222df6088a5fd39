//! glTF 2.0: the binary container (GLB) and the plain JSON file.
//!
//! Coordinates stay as stored (by the standard y up, in meters). Texture coordinates are flipped vertically, because
//! glTF counts from the top of the image. Color factors are linear in the file and are converted to display colors
//! (sRGB). Skins, morph targets, animations and vertex colors are ignored.

use serde_json::Value;

use super::affine::{Affine, IDENTITY, PreparedAffine, product};
use super::builder::{Builder, Corner};
use super::error::{ReadContext, percent_decoded};
use super::format::{Format, begins_with_word};
use super::glb_buffers::{Gltf, item, len};
use super::{MeshError, MeshMaterial, TextureSource, TriMesh};

const JSON: u32 = u32::from_le_bytes(*b"JSON");
const BIN: u32 = u32::from_le_bytes(*b"BIN\0");
const MAX_DEPTH: usize = 64;
const MAX_NODES: usize = 100_000;

/// Required extensions that do not affect this reader, or that it implements (quantized accessors).
const SUPPORTED_EXTENSIONS: [&str; 3] = ["KHR_mesh_quantization", "KHR_lights_punctual", "KHR_xmp_json_ld"];

/// The binary glTF format.
pub(super) const GLB: Format = Format {
    code: 3,
    extensions: &["glb"],
    is_one_file: true,
    is_certain: |bytes| bytes.starts_with(b"glTF"),
    likelihood: |_| 0,
    read: read_glb,
};

/// The plain glTF format.
pub(super) const GLTF: Format = Format {
    code: 4,
    extensions: &["gltf"],
    is_one_file: false,
    is_certain: |_| false,
    likelihood: |bytes| if begins_with_word(bytes, b"\"asset\"") { 3 } else { 0 },
    read: read_gltf,
};

fn read_glb(ctx: &ReadContext<'_>, bytes: &[u8]) -> Result<TriMesh, MeshError> {
    let word = |at: usize| {
        let b = bytes.get(at..at + 4).ok_or_else(|| ctx.truncated("GLB header", at as u64 + 4, bytes.len() as u64))?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    };
    if bytes.len() >= 4 && !bytes.starts_with(b"glTF") {
        return Err(ctx.invalid("byte 0", "not a GLB file: the file must begin with \"glTF\""));
    }
    let (version, total) = (word(4)?, word(8)? as usize);
    if version != 2 {
        return Err(ctx.unsupported(format!("glTF version {version} (expected 2)")));
    }
    if total > bytes.len() {
        return Err(ctx.truncated("GLB", total as u64, bytes.len() as u64));
    }
    let (mut json, mut bin) = (None, None);
    let mut at = 12;
    while at + 8 <= total {
        let (length, kind) = (word(at)? as usize, word(at + 4)?);
        let start = at + 8;
        let end = start.saturating_add(length);
        let chunk = bytes[..total].get(start..end);
        let chunk = chunk.ok_or_else(|| ctx.truncated(format!("GLB chunk at byte {at}"), end as u64, total as u64))?;
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BIN if bin.is_none() => bin = Some(chunk),
            _ => {}
        }
        at = end;
    }
    let json = json.ok_or_else(|| ctx.invalid("GLB", "no JSON chunk; the first chunk must be JSON"))?;
    read_json(ctx, json, bin)
}

fn read_gltf(ctx: &ReadContext<'_>, bytes: &[u8]) -> Result<TriMesh, MeshError> {
    read_json(ctx, bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None)
}

fn read_json(ctx: &ReadContext<'_>, json: &[u8], bin: Option<&[u8]>) -> Result<TriMesh, MeshError> {
    let json: Value = serde_json::from_slice(json).map_err(|e| {
        let at = format!("JSON line {}, column {}", e.line(), e.column());
        ctx.invalid_with_source(at, format!("not valid JSON: {e}"), e)
    })?;
    for extension in array(&json, "extensionsRequired").iter().filter_map(Value::as_str) {
        if !SUPPORTED_EXTENSIONS.contains(&extension) && !extension.starts_with("KHR_materials_") {
            return Err(ctx.unsupported(format!("the required glTF extension {extension:?}")));
        }
    }
    let mut reader = Reader {
        gltf: Gltf::new(ctx, &json, bin),
        builder: Builder::default(),
        materials: vec![None; len(&json, "materials")],
        nodes_seen: 0,
    };
    let nodes = len(&json, "nodes");
    let scene = reader.gltf.optional(&json, "scene", "glTF")?;
    let roots: Vec<usize> = match (scene, item(&json, "scenes", 0)) {
        (Some(index), _) => reader.children(reader.gltf.element_at("scenes", index, "glTF")?, "nodes", "scene")?,
        (None, Some(first)) => reader.children(first, "nodes", "scene")?,
        // Without scenes, every node that is not a child of another node.
        (None, None) => {
            let mut root = vec![true; nodes];
            for node in array(&json, "nodes") {
                for child in array(node, "children").iter().filter_map(Value::as_u64) {
                    if let Some(root) = usize::try_from(child).ok().and_then(|c| root.get_mut(c)) {
                        *root = false;
                    }
                }
            }
            (0..nodes).filter(|&n| root[n]).collect()
        }
    };
    for root in roots {
        reader.node(root, &IDENTITY, 0, "scene")?;
    }
    if nodes == 0 {
        for mesh in 0..len(&json, "meshes") {
            reader.mesh(mesh, &IDENTITY, "glTF")?;
        }
    }
    reader.builder.finish(ctx)
}

fn array<'j>(json: &'j Value, key: &str) -> &'j [Value] {
    json.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

struct Reader<'a> {
    gltf: Gltf<'a>,
    builder: Builder,
    /// Handles and texture coordinate sets of the materials read so far.
    materials: Vec<Option<(usize, usize)>>,
    nodes_seen: usize,
}

impl Reader<'_> {
    fn children(&self, value: &Value, key: &str, at: &str) -> Result<Vec<usize>, MeshError> {
        let index = |v: &Value| {
            let index = v.as_u64().and_then(|n| usize::try_from(n).ok());
            index.ok_or_else(|| self.gltf.ctx.invalid(at, format!("{key:?} contains a value that is not an index")))
        };
        array(value, key).iter().map(index).collect()
    }

    fn numbers<const N: usize>(&self, value: &Value, key: &str, at: &str) -> Result<Option<[f64; N]>, MeshError> {
        let Some(found) = value.get(key) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = found.as_array().and_then(|a| a.iter().map(Value::as_f64).collect());
        let numbers = numbers.and_then(|n| <[f64; N]>::try_from(n).ok());
        numbers.map(Some).ok_or_else(|| self.gltf.ctx.invalid(at, format!("{key:?} must be {N} numbers")))
    }

    fn node(&mut self, index: usize, parent: &Affine, depth: usize, at: &str) -> Result<(), MeshError> {
        let node = self.gltf.element_at("nodes", index, at)?;
        let at = format!("node {index}");
        if depth > MAX_DEPTH {
            let what = format!("nodes nest deeper than {MAX_DEPTH}, or in a cycle");
            return Err(self.gltf.ctx.invalid(at, what));
        }
        self.nodes_seen += 1;
        if self.nodes_seen > MAX_NODES {
            return Err(self.gltf.ctx.too_large("nodes", MAX_NODES));
        }
        let local = match self.numbers::<16>(node, "matrix", &at)? {
            // The file stores columns.
            Some(m) => [0, 1, 2].map(|row| [m[row], m[4 + row], m[8 + row], m[12 + row]]),
            None => {
                let t = self.numbers(node, "translation", &at)?.unwrap_or([0.0; 3]);
                let q = self.numbers(node, "rotation", &at)?.unwrap_or([0.0, 0.0, 0.0, 1.0]);
                let s = self.numbers(node, "scale", &at)?.unwrap_or([1.0; 3]);
                translation_rotation_scale(t, q, s)
            }
        };
        let here = product(parent, &local);
        if let Some(mesh) = self.gltf.optional(node, "mesh", &at)? {
            self.mesh(mesh, &here, &at)?;
        }
        for child in self.children(node, "children", &at)? {
            self.node(child, &here, depth + 1, &at)?;
        }
        Ok(())
    }

    fn mesh(&mut self, index: usize, to_world: &Affine, at: &str) -> Result<(), MeshError> {
        let mesh = self.gltf.element_at("meshes", index, at)?;
        let place = PreparedAffine::new(to_world);
        for (number, primitive) in array(mesh, "primitives").iter().enumerate() {
            self.primitive(primitive, &place, &format!("mesh {index}, primitive {number}"))?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &Value, place: &PreparedAffine, at: &str) -> Result<(), MeshError> {
        let mode = self.gltf.optional(primitive, "mode", at)?.unwrap_or(4);
        match mode {
            // Points and lines have no surface.
            0..=3 => return Ok(()),
            4..=6 => {}
            _ => return Err(self.gltf.ctx.invalid(at, format!("mode {mode}; expected 0 to 6"))),
        }
        let (material, uv_set) = match self.gltf.optional(primitive, "material", at)? {
            Some(material) => {
                let (handle, set) = self.material(material, at)?;
                (Some(handle), set)
            }
            None => (None, 0),
        };
        let ctx = self.gltf.ctx;
        let none = Value::Null;
        let attributes = primitive.get("attributes").unwrap_or(&none);
        let position = self.gltf.number(attributes, "POSITION", at)?;
        let positions: Vec<[f64; 3]> = self.gltf.vectors(position, at)?;
        let normals: Option<Vec<[f64; 3]>> = match self.gltf.optional(attributes, "NORMAL", at)? {
            Some(normal) => Some(self.gltf.vectors(normal, at)?),
            None => None,
        };
        let uvs: Option<Vec<[f64; 2]>> = match self.gltf.optional(attributes, &format!("TEXCOORD_{uv_set}"), at)? {
            Some(uv) => Some(self.gltf.vectors(uv, at)?),
            None => None,
        };
        let n = positions.len();
        for (name, length) in [("NORMAL", normals.as_ref().map(Vec::len)), ("TEXCOORD", uvs.as_ref().map(Vec::len))] {
            if length.is_some_and(|l| l != n) {
                let what = format!(
                    "POSITION has {n} elements, but {name} has {}; expected the same number",
                    length.unwrap_or(0)
                );
                return Err(ctx.invalid(at, what));
            }
        }
        let indices = match self.gltf.optional(primitive, "indices", at)? {
            Some(indices) => self.gltf.indices(indices, at)?,
            None => (0..n as u32).collect(),
        };
        if let Some(&bad) = indices.iter().find(|&&i| i as usize >= n) {
            return Err(ctx.index(format!("{at}, vertex index"), i64::from(bad), n));
        }
        if mode == 4 && !indices.len().is_multiple_of(3) {
            return Err(ctx.invalid(at, format!("{} indices of triangles; expected a multiple of 3", indices.len())));
        }
        let corner = |i: u32| {
            let i = i as usize;
            Corner {
                position: place.point(positions[i]).map(|x| x as f32),
                normal: normals.as_ref().and_then(|n| place.normal(n[i])),
                uv: uvs.as_ref().map(|uv| [uv[i][0] as f32, (1.0 - uv[i][1]) as f32]),
            }
        };
        let count = if mode == 4 { indices.len() / 3 } else { indices.len().saturating_sub(2) };
        for t in 0..count {
            let mut face = match mode {
                4 => [3 * t, 3 * t + 1, 3 * t + 2],
                5 if t % 2 == 0 => [t, t + 1, t + 2],
                5 => [t + 1, t, t + 2],
                _ => [t + 1, t + 2, 0],
            };
            if place.mirrored {
                face.swap(1, 2);
            }
            let corners = face.map(|i| corner(indices[i]));
            self.builder.triangle(ctx, corners, material, || format!("{at}, triangle {t}"))?;
        }
        Ok(())
    }

    /// Returns the handle in the mesh and the texture coordinate set of material `index`. The first call for an index
    /// adds the material to the mesh. `at` is the location in errors.
    fn material(&mut self, index: usize, at: &str) -> Result<(usize, usize), MeshError> {
        let material = self.gltf.element_at("materials", index, at)?;
        if let Some(known) = self.materials[index] {
            return Ok(known);
        }
        let at = format!("material {index}");
        let none = Value::Null;
        let pbr = material.get("pbrMetallicRoughness").unwrap_or(&none);
        let factor: [f64; 4] = self.numbers(pbr, "baseColorFactor", &at)?.unwrap_or([1.0; 4]);
        let [r, g, b, a] = factor.map(|x| x.clamp(0.0, 1.0));
        let mut rgba = [to_srgb(r), to_srgb(g), to_srgb(b), a].map(|x| x as f32);
        if material.get("alphaMode").and_then(Value::as_str).unwrap_or("OPAQUE") == "OPAQUE" {
            rgba[3] = 1.0;
        }
        let (mut texture, mut uv_set) = (None, 0);
        if let Some(base) = pbr.get("baseColorTexture") {
            uv_set = self.gltf.optional(base, "texCoord", &at)?.unwrap_or(0);
            let number = self.gltf.number(base, "index", &at)?;
            let entry = self.gltf.element_at("textures", number, &at)?;
            // A texture without a source has its image in an extension.
            if let Some(source) = self.gltf.optional(entry, "source", &format!("texture {number}"))? {
                texture = self.image(source, &at)?;
            }
        }
        let name = material.get("name").and_then(Value::as_str).map_or(at, str::to_owned);
        let known = (self.builder.material(MeshMaterial { name, rgba, texture }), uv_set);
        self.materials[index] = Some(known);
        Ok(known)
    }

    fn image(&mut self, index: usize, at: &str) -> Result<Option<TextureSource>, MeshError> {
        let image = self.gltf.element_at("images", index, at)?;
        let at = format!("image {index}");
        if let Some(uri) = image.get("uri").and_then(Value::as_str) {
            return Ok(Some(match self.gltf.embedded(uri, &at)? {
                Some(bytes) => TextureSource::Embedded(bytes),
                None => TextureSource::File(self.gltf.ctx.beside(&percent_decoded(uri))),
            }));
        }
        let view = self.gltf.number(image, "bufferView", &at)?;
        Ok(Some(TextureSource::Embedded(self.gltf.view(view, &at)?)))
    }
}

/// Transform of a translation, a rotation (x, y, z, w) and a scale.
fn translation_rotation_scale(t: [f64; 3], [x, y, z, w]: [f64; 4], s: [f64; 3]) -> Affine {
    let length = (x * x + y * y + z * z + w * w).sqrt();
    let [x, y, z, w] = if length > 0.0 { [x, y, z, w].map(|c| c / length) } else { [0.0, 0.0, 0.0, 1.0] };
    let r = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ];
    [0, 1, 2].map(|i| [r[i][0] * s[0], r[i][1] * s[1], r[i][2] * s[2], t[i]])
}

/// Converts linear light to sRGB.
fn to_srgb(x: f64) -> f64 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
#[path = "tests_glb.rs"]
pub(super) mod tests;
