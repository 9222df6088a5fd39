//! How a model looks: meshes, height fields, textures, materials, lights, cameras, the same for both MuJoCo lines.

use super::arrays::is_set;
use super::model::Model;
use mujoco_sys as mj;
use mujoco_sys::fields::model as fields;

/// A compiled mesh. Corners of triangles index three arrays of their own.
#[derive(Clone, Copy, Debug)]
pub struct MeshArrays<'a> {
    /// Vertices in the geom's frame \[m\].
    pub positions: &'a [[f32; 3]],
    /// Unit normals: those of the file, or computed by MuJoCo.
    pub normals: &'a [[f32; 3]],
    /// Texture coordinates, with v downward.
    pub texcoords: Option<&'a [[f32; 2]]>,
    /// Vertices of each triangle.
    pub faces: &'a [[i32; 3]],
    /// Normals of each triangle's corners.
    pub face_normals: &'a [[i32; 3]],
    /// Texture coordinates of each triangle's corners.
    pub face_texcoords: &'a [[i32; 3]],
}

/// A height field.
#[derive(Clone, Copy, Debug)]
pub struct HeightFieldArrays<'a> {
    /// Half length along x, half length along y, height of elevation 1, depth of the floor below zero \[m\].
    pub size: [f64; 4],
    /// Rows, along y.
    pub rows: usize,
    /// Columns, along x.
    pub columns: usize,
    /// Elevation in 0..=1, row by row.
    pub elevation: &'a [f32],
}

/// What an image is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureType {
    /// By texture coordinates.
    TwoD,
    /// On a cube around the shape: six squares, one below the other.
    Cube,
    /// Around everything: as a cube.
    Skybox,
}

/// An image.
#[derive(Clone, Copy, Debug)]
pub struct TextureArrays<'a> {
    /// What it is for.
    pub kind: TextureType,
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Bytes per pixel.
    pub channels: usize,
    /// Pixels from the top left.
    pub pixels: &'a [u8],
}

/// A material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialValues {
    /// Colour and opacity, 0..=1.
    pub rgba: [f32; 4],
    /// The texture of its colour.
    pub texture: Option<usize>,
    /// How often the texture repeats.
    pub tex_repeat: [f32; 2],
    /// Whether it repeats per metre.
    pub tex_uniform: bool,
    /// Own light, times the colour.
    pub emission: f32,
    /// Strength of highlights, 0..=1.
    pub specular: f32,
    /// Sharpness of highlights, 0..=1.
    pub shininess: f32,
    /// Share that is mirrored, 0..=1.
    pub reflectance: f32,
    /// Share that is metal, 0..=1 (4.x); `None` where the model does not say.
    pub metallic: Option<f32>,
    /// How rough it is, 0..=1 (4.x); `None` where the model does not say.
    pub roughness: Option<f32>,
}

/// Kinds of lights that both lines know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightType {
    /// A cone.
    Spot,
    /// Parallel rays.
    Directional,
    /// In all directions (4.x).
    Point,
    /// From an image all around (4.x).
    Image,
}

/// A light in its body's frame; [`Data::light_xpos`](super::Data::light_xpos) has where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightValues {
    /// What kind of light it is.
    pub kind: LightType,
    /// Whether it is on.
    pub active: bool,
    /// Whether it casts shadows.
    pub cast_shadow: bool,
    /// Constant, linear and quadratic attenuation.
    pub attenuation: [f32; 3],
    /// Half angle of a spot's cone \[deg\].
    pub cutoff_deg: f32,
    /// How fast a spot falls off from its axis.
    pub exponent: f32,
    /// Colours.
    pub ambient: [f32; 3],
    /// Colour that surfaces scatter.
    pub diffuse: [f32; 3],
    /// Colour of highlights.
    pub specular: [f32; 3],
    /// Radius of the lamp \[m\] (4.x, 0.02 where the file says nothing); 0 where the model does not say.
    pub radius: f32,
}

/// The light on every camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadlightValues {
    /// Whether it is on: "auto" of 4.x is on where the model has no light of its own.
    pub active: bool,
    /// Colour that comes from everywhere.
    pub ambient: [f32; 3],
    /// Colour that surfaces scatter.
    pub diffuse: [f32; 3],
    /// Colour of highlights.
    pub specular: [f32; 3],
}

/// The model's array `name`.
macro_rules! array {
    ($model:expr, $name:ident) => {{
        // SAFETY: the model is alive as long as the borrow that the caller holds, and nothing writes to a shared model.
        unsafe { fields::$name($model.raw()) }
    }};
}

/// Chunks of `N` numbers; arrays of the model are whole multiples.
pub(super) fn chunks<T, const N: usize>(values: &[T]) -> &[[T; N]] {
    values.as_chunks().0
}

/// `count` elements from `first`, both numbers of MuJoCo's; nothing where they do not fit.
pub(super) fn span<T>(values: &[T], first: i64, count: i64) -> &[T] {
    let (Ok(first), Ok(count)) = (usize::try_from(first), usize::try_from(count)) else { return &[] };
    first.checked_add(count).and_then(|end| values.get(first..end)).unwrap_or(&[])
}

impl Model {
    /// Whether a body is a part of the world: no joint moves it, nor a hand.
    ///
    /// # Panics
    /// There is no such body.
    pub fn is_fixed(&self, body: usize) -> bool {
        // A body moved by hand counts as welded to the world, and so does what hangs on it.
        let by_hand = |body: usize| self.body_mocapid()[self.body_rootid()[body] as usize] >= 0;
        self.body_weldid()[body] == 0 && !by_hand(body)
    }

    /// Number of height fields.
    pub fn nhfield(&self) -> usize {
        self.header().nhfield as usize
    }

    /// Number of materials.
    pub fn nmat(&self) -> usize {
        self.header().nmat as usize
    }

    /// Number of lights.
    pub fn nlight(&self) -> usize {
        self.header().nlight as usize
    }

    /// Number of cameras.
    pub fn ncam(&self) -> usize {
        self.header().ncam as usize
    }

    /// Size of the model \[m\]: distances of the default camera and its clipping planes are multiples.
    pub fn extent(&self) -> f64 {
        self.header().stat.extent
    }

    /// Middle of the model \[m\].
    pub fn center(&self) -> [f64; 3] {
        self.header().stat.center
    }

    /// Nearest and farthest visible depth \[m\].
    pub fn clip(&self) -> [f64; 2] {
        let (map, extent) = (&self.header().vis.map, self.extent());
        [f64::from(map.znear) * extent, f64::from(map.zfar) * extent]
    }

    /// Vertical field of view of the default camera \[deg\], its azimuth and elevation \[deg\].
    pub fn free_camera(&self) -> [f64; 3] {
        let global = &self.header().vis.global;
        [global.fovy, global.azimuth, global.elevation].map(f64::from)
    }

    /// The light on every camera.
    pub fn headlight(&self) -> HeadlightValues {
        let light = &self.header().vis.headlight;
        // 4.x has 2 for "auto", which MuJoCo's OpenGL renderer takes for on, also in models with lights.
        HeadlightValues {
            active: light.active != 0,
            ambient: light.ambient,
            diffuse: light.diffuse,
            specular: light.specular,
        }
    }

    /// Colour of the haze at the end of endless planes, 0..=1, and the part of their radius over which they fade.
    pub fn haze(&self) -> ([f32; 3], f32) {
        let visual = &self.header().vis;
        let [r, g, b, _] = visual.rgba.haze;
        ([r, g, b], visual.map.haze)
    }

    /// A mesh.
    ///
    /// # Panics
    /// There is no such mesh.
    pub fn mesh(&self, mesh: usize) -> MeshArrays<'_> {
        let pick = |values: &[i32]| i64::from(values[mesh]);
        let (vertex, vertices) = (pick(array!(self, mesh_vertadr)), pick(array!(self, mesh_vertnum)));
        let (face, faces) = (pick(array!(self, mesh_faceadr)), pick(array!(self, mesh_facenum)));
        let texcoord = pick(array!(self, mesh_texcoordadr));
        let positions = span(chunks(array!(self, mesh_vert)), vertex, vertices);
        let triangles = span(chunks(array!(self, mesh_face)), face, faces);
        #[cfg(mj4)]
        let (normals, face_normals, texcoords, face_texcoords) = {
            let (normal, normals) = (pick(array!(self, mesh_normaladr)), pick(array!(self, mesh_normalnum)));
            let count = pick(array!(self, mesh_texcoordnum));
            (
                span(chunks(array!(self, mesh_normal)), normal, normals),
                span(chunks(array!(self, mesh_facenormal)), face, faces),
                span(chunks(array!(self, mesh_texcoord)), texcoord, count),
                span(chunks(array!(self, mesh_facetexcoord)), face, faces),
            )
        };
        // 2.2.2 splits vertices instead: one index for all.
        #[cfg(not(mj4))]
        let (normals, face_normals, texcoords, face_texcoords) = (
            span(chunks(array!(self, mesh_normal)), vertex, vertices),
            triangles,
            span(chunks(array!(self, mesh_texcoord)), texcoord, vertices),
            triangles,
        );
        let texcoords = (texcoord >= 0 && !texcoords.is_empty()).then_some(texcoords);
        MeshArrays { positions, normals, texcoords, faces: triangles, face_normals, face_texcoords }
    }

    /// A height field.
    ///
    /// # Panics
    /// There is no such height field.
    pub fn height_field(&self, field: usize) -> HeightFieldArrays<'_> {
        let [rows, columns] = [array!(self, hfield_nrow)[field], array!(self, hfield_ncol)[field]];
        let count = i64::from(rows) * i64::from(columns);
        HeightFieldArrays {
            size: chunks(array!(self, hfield_size))[field],
            rows: rows as usize,
            columns: columns as usize,
            elevation: span(array!(self, hfield_data), i64::from(array!(self, hfield_adr)[field]), count),
        }
    }

    /// A texture; `None` where its pixels are not in the model.
    ///
    /// # Panics
    /// There is no such texture.
    pub fn texture(&self, texture: usize) -> Option<TextureArrays<'_>> {
        let kind = match array!(self, tex_type)[texture] as u32 {
            mj::mjTEXTURE_2D => TextureType::TwoD,
            mj::mjTEXTURE_CUBE => TextureType::Cube,
            _ => TextureType::Skybox,
        };
        #[cfg(mj4)]
        let (channels, pixels, address) =
            (i64::from(array!(self, tex_nchannel)[texture]), array!(self, tex_data), array!(self, tex_adr)[texture]);
        #[cfg(not(mj4))]
        let (channels, pixels, address) = (3, array!(self, tex_rgb), i64::from(array!(self, tex_adr)[texture]));
        let [width, height] = [array!(self, tex_width)[texture], array!(self, tex_height)[texture]].map(i64::from);
        let pixels = span(pixels, address, width * height * channels);
        let size = |n: i64| usize::try_from(n).unwrap_or(0);
        (!pixels.is_empty()).then_some(TextureArrays {
            kind,
            width: size(width),
            height: size(height),
            channels: size(channels),
            pixels,
        })
    }

    /// A material.
    ///
    /// # Panics
    /// There is no such material.
    pub fn material(&self, material: usize) -> MaterialValues {
        #[cfg(mj4)]
        let texture = {
            let roles = mj::mjNTEXROLE as usize;
            // A material without a role for colour may have one with it in all channels.
            let textures = &array!(self, mat_texid)[material * roles..(material + 1) * roles];
            [mj::mjTEXROLE_RGB as usize, mj::mjTEXROLE_RGBA as usize].into_iter().map(|r| textures[r]).max()
        };
        #[cfg(mj4)]
        let [metallic, roughness] = [array!(self, mat_metallic)[material], array!(self, mat_roughness)[material]];
        #[cfg(not(mj4))]
        let texture = Some(array!(self, mat_texid)[material]);
        #[cfg(not(mj4))]
        let [metallic, roughness] = [-1.0, -1.0];
        // What is not said is -1.
        let unless_negative = |x: f32| (x >= 0.0).then_some(x);
        MaterialValues {
            rgba: chunks(array!(self, mat_rgba))[material],
            texture: texture.and_then(|t| usize::try_from(t).ok()),
            tex_repeat: chunks(array!(self, mat_texrepeat))[material],
            tex_uniform: is_set(array!(self, mat_texuniform)[material]),
            emission: array!(self, mat_emission)[material],
            specular: array!(self, mat_specular)[material],
            shininess: array!(self, mat_shininess)[material],
            reflectance: array!(self, mat_reflectance)[material],
            metallic: unless_negative(metallic),
            roughness: unless_negative(roughness),
        }
    }

    /// A light.
    ///
    /// # Panics
    /// There is no such light.
    pub fn light(&self, light: usize) -> LightValues {
        #[cfg(mj4)]
        let kind = match array!(self, light_type)[light] as u32 {
            mj::mjLIGHT_DIRECTIONAL => LightType::Directional,
            mj::mjLIGHT_POINT => LightType::Point,
            mj::mjLIGHT_IMAGE => LightType::Image,
            _ => LightType::Spot,
        };
        #[cfg(not(mj4))]
        let kind =
            if is_set(array!(self, light_directional)[light]) { LightType::Directional } else { LightType::Spot };
        #[cfg(mj4)]
        let radius = array!(self, light_bulbradius)[light];
        #[cfg(not(mj4))]
        let radius = 0.0;
        LightValues {
            kind,
            radius,
            active: is_set(array!(self, light_active)[light]),
            cast_shadow: is_set(array!(self, light_castshadow)[light]),
            attenuation: chunks(array!(self, light_attenuation))[light],
            cutoff_deg: array!(self, light_cutoff)[light],
            exponent: array!(self, light_exponent)[light],
            ambient: chunks(array!(self, light_ambient))[light],
            diffuse: chunks(array!(self, light_diffuse))[light],
            specular: chunks(array!(self, light_specular))[light],
        }
    }
}
