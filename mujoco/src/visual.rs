//! Visual elements of a model, in the same form for 2.2.2 and 4.x: meshes, height fields, textures, materials, lights,
//! cameras.

use super::arrays::is_set;
use super::model::Model;
use kinetoscope_look::{
    HeadlightValues, HeightFieldArrays, LightType, LightValues, MaterialValues, MeshArrays, TextureArrays, TextureType,
    VisualModel,
};
use mujoco_sys as mj;
use mujoco_sys::fields::model as fields;

/// The model's array `name`.
macro_rules! array {
    ($model:expr, $name:ident) => {{
        // SAFETY: the model is alive as long as the borrow that the caller holds, and nothing writes to a shared model.
        unsafe { fields::$name($model.raw()) }
    }};
}

/// Splits an array into chunks of `N` numbers. Lengths of model arrays are multiples of `N`.
pub(super) fn as_rows<T, const N: usize>(values: &[T]) -> &[[T; N]] {
    values.as_chunks().0
}

/// `count` elements from index `first`, both as MuJoCo gives them; empty if the range is invalid.
pub(super) fn checked_slice<T>(values: &[T], first: i64, count: i64) -> &[T] {
    let (Ok(first), Ok(count)) = (usize::try_from(first), usize::try_from(count)) else { return &[] };
    first.checked_add(count).and_then(|end| values.get(first..end)).unwrap_or(&[])
}

impl Model {
    /// True if a body is fixed to the world: neither a joint nor a mocap body moves it.
    ///
    /// # Panics
    /// There is no such body.
    pub fn is_fixed(&self, body: usize) -> bool {
        // MuJoCo 2.2.2 counts mocap bodies and their descendants as welded to the world.
        let is_mocap = |body: usize| self.body_mocapid()[self.body_rootid()[body] as usize] >= 0;
        self.body_weldid()[body] == 0 && !is_mocap(body)
    }

    /// True if no force moves a body: it is fixed to the world, or it is a mocap body or welded to one.
    ///
    /// # Panics
    /// There is no such body.
    pub fn is_held(&self, body: usize) -> bool {
        let moving = self.body_weldid()[body] as usize;
        // In MuJoCo 4, a mocap body moves by itself.
        moving == 0 || self.body_mocapid()[moving] >= 0
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

    /// Extent of the model \[m\] (`stat.extent`). Distances of the default camera and its clipping planes are multiples
    /// of it.
    pub fn extent(&self) -> f64 {
        self.header().stat.extent
    }

    /// Center of the model in the world frame \[m\] (`stat.center`).
    pub fn center(&self) -> [f64; 3] {
        self.header().stat.center
    }

    /// Distances of the near and far clipping planes \[m\].
    pub fn clip_distances(&self) -> [f64; 2] {
        let (map, extent) = (&self.header().vis.map, self.extent());
        [f64::from(map.znear) * extent, f64::from(map.zfar) * extent]
    }

    /// Vertical field of view, azimuth and elevation of the default camera \[deg\].
    pub fn free_camera(&self) -> [f64; 3] {
        let global = &self.header().vis.global;
        [global.fovy, global.azimuth, global.elevation].map(f64::from)
    }

    /// State and colors of the headlight, a light at the position of every camera.
    pub fn headlight(&self) -> HeadlightValues {
        let light = &self.header().vis.headlight;
        // 4.x has 2 for "auto". MuJoCo's OpenGL renderer treats it as on, also in models with lights.
        HeadlightValues {
            active: light.active != 0,
            ambient: light.ambient,
            diffuse: light.diffuse,
            specular: light.specular,
        }
    }

    /// Haze color (sRGB, 0..=1) at the end of infinite planes, and the fraction of their rendered radius over which
    /// they fade into it.
    pub fn haze(&self) -> ([f32; 3], f32) {
        let visual = &self.header().vis;
        let [r, g, b, _] = visual.rgba.haze;
        ([r, g, b], visual.map.haze)
    }

    /// Arrays of a mesh.
    ///
    /// # Panics
    /// There is no such mesh.
    pub fn mesh(&self, mesh: usize) -> MeshArrays<'_> {
        let pick = |values: &[i32]| i64::from(values[mesh]);
        let (vertex, vertices) = (pick(array!(self, mesh_vertadr)), pick(array!(self, mesh_vertnum)));
        let (face, faces) = (pick(array!(self, mesh_faceadr)), pick(array!(self, mesh_facenum)));
        let texcoord = pick(array!(self, mesh_texcoordadr));
        let positions = checked_slice(as_rows(array!(self, mesh_vert)), vertex, vertices);
        let triangles = checked_slice(as_rows(array!(self, mesh_face)), face, faces);
        #[cfg(mj4)]
        let (normals, face_normals, texcoords, face_texcoords) = {
            let (normal, normals) = (pick(array!(self, mesh_normaladr)), pick(array!(self, mesh_normalnum)));
            let count = pick(array!(self, mesh_texcoordnum));
            (
                checked_slice(as_rows(array!(self, mesh_normal)), normal, normals),
                checked_slice(as_rows(array!(self, mesh_facenormal)), face, faces),
                checked_slice(as_rows(array!(self, mesh_texcoord)), texcoord, count),
                checked_slice(as_rows(array!(self, mesh_facetexcoord)), face, faces),
            )
        };
        // 2.2.2 splits vertices instead: one index for all three arrays.
        #[cfg(not(mj4))]
        let (normals, face_normals, texcoords, face_texcoords) = (
            checked_slice(as_rows(array!(self, mesh_normal)), vertex, vertices),
            triangles,
            checked_slice(as_rows(array!(self, mesh_texcoord)), texcoord, vertices),
            triangles,
        );
        let texcoords = (texcoord >= 0 && !texcoords.is_empty()).then_some(texcoords);
        MeshArrays { positions, normals, texcoords, faces: triangles, face_normals, face_texcoords }
    }

    /// Arrays of a height field.
    ///
    /// # Panics
    /// There is no such height field.
    pub fn height_field(&self, field: usize) -> HeightFieldArrays<'_> {
        let [rows, columns] = [array!(self, hfield_nrow)[field], array!(self, hfield_ncol)[field]];
        let count = i64::from(rows) * i64::from(columns);
        HeightFieldArrays {
            size: as_rows(array!(self, hfield_size))[field],
            rows: rows as usize,
            columns: columns as usize,
            elevation: checked_slice(array!(self, hfield_data), i64::from(array!(self, hfield_adr)[field]), count),
        }
    }

    /// Image of a texture; `None` if the model does not hold its pixels.
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
        #[cfg(mj4)]
        let is_srgb = array!(self, tex_colorspace)[texture] as u32 == mj::mjCOLORSPACE_SRGB;
        #[cfg(not(mj4))]
        let is_srgb = false;
        let [width, height] = [array!(self, tex_width)[texture], array!(self, tex_height)[texture]].map(i64::from);
        let pixels = checked_slice(pixels, address, width * height * channels);
        let size = |n: i64| usize::try_from(n).unwrap_or(0);
        (!pixels.is_empty()).then_some(TextureArrays {
            kind,
            width: size(width),
            height: size(height),
            channels: size(channels),
            is_srgb,
            pixels,
        })
    }

    /// Properties of a material.
    ///
    /// # Panics
    /// There is no such material.
    pub fn material(&self, material: usize) -> MaterialValues {
        #[cfg(mj4)]
        let texture = {
            let roles = mj::mjNTEXROLE as usize;
            // The color texture is in the RGB role or in the RGBA role.
            let textures = &array!(self, mat_texid)[material * roles..(material + 1) * roles];
            [mj::mjTEXROLE_RGB as usize, mj::mjTEXROLE_RGBA as usize].into_iter().map(|r| textures[r]).max()
        };
        #[cfg(mj4)]
        let [metallic, roughness] = [array!(self, mat_metallic)[material], array!(self, mat_roughness)[material]];
        #[cfg(not(mj4))]
        let texture = Some(array!(self, mat_texid)[material]);
        #[cfg(not(mj4))]
        let [metallic, roughness] = [-1.0, -1.0];
        // MuJoCo marks values that are not set with -1.
        let unless_negative = |x: f32| (x >= 0.0).then_some(x);
        MaterialValues {
            rgba: as_rows(array!(self, mat_rgba))[material],
            texture: texture.and_then(|t| usize::try_from(t).ok()),
            tex_repeat: as_rows(array!(self, mat_texrepeat))[material],
            tex_uniform: is_set(array!(self, mat_texuniform)[material]),
            emission: array!(self, mat_emission)[material],
            specular: array!(self, mat_specular)[material],
            shininess: array!(self, mat_shininess)[material],
            reflectance: array!(self, mat_reflectance)[material],
            metallic: unless_negative(metallic),
            roughness: unless_negative(roughness),
        }
    }

    /// Properties of a light.
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
            attenuation: as_rows(array!(self, light_attenuation))[light],
            cutoff_deg: array!(self, light_cutoff)[light],
            exponent: array!(self, light_exponent)[light],
            ambient: as_rows(array!(self, light_ambient))[light],
            diffuse: as_rows(array!(self, light_diffuse))[light],
            specular: as_rows(array!(self, light_specular))[light],
        }
    }
}

impl VisualModel for Model {
    fn mesh(&self, mesh: usize) -> MeshArrays<'_> {
        self.mesh(mesh)
    }

    fn height_field(&self, field: usize) -> HeightFieldArrays<'_> {
        self.height_field(field)
    }

    fn ntex(&self) -> usize {
        self.ntex()
    }

    fn texture(&self, texture: usize) -> Option<TextureArrays<'_>> {
        self.texture(texture)
    }

    fn nmat(&self) -> usize {
        self.nmat()
    }

    fn material(&self, material: usize) -> MaterialValues {
        self.material(material)
    }
}
