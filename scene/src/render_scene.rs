//! Scenes to render, without poses.

use crate::Pose;
use crate::light::{Haze, Headlight, Hemisphere, HorizonHaze, Light, LightingSpace, OpenGlRules, Sky};
use crate::material::{Material, Texture, TextureKind};
use crate::polygons::PlaneLines;
use crate::shape::Shape;
use std::sync::Arc;

/// An instance of a shape, with a material and an identity.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Geometry of the instance, in the frame of the instance.
    pub shape: Shape,
    /// Material. An instance with alpha 0 is not drawn, but ray casters hit it if `visible` is true.
    pub material: Material,
    /// Value in the mask channel; never 0, which means no instance.
    pub mask_id: i32,
    /// Geom group; views may hide groups.
    pub group: u8,
    /// False hides the instance from cameras and ray casters.
    pub visible: bool,
    /// Name of the instance's owner: `uid/link`, the uid of an object, or the name of a geom of the world (`ground`).
    /// Ray casters select their targets by name; several instances may share a name.
    pub name: Arc<str>,
    /// Index of the instance's body, on the body axis of [`SceneState`](crate::SceneState); `None` for the world.
    pub body: Option<u32>,
    /// True if the instance is welded to the world: only a write to the state moves the instance.
    pub fixed: bool,
    /// True if the shape may differ in every frame, as for tendons and skins. Cameras draw such instances, ray casters
    /// ignore them.
    pub is_deformable: bool,
    /// Pose in the frame of its owner (link, object or MJCF body); the identity for a geom of the world.
    pub frame_from_instance: Pose,
}

impl Instance {
    /// Creates a visible, movable instance in group 0, without a name.
    pub fn new(shape: impl Into<Shape>, material: Material, mask_id: i32) -> Self {
        let name = Arc::from("");
        Self {
            shape: shape.into(),
            material,
            mask_id,
            group: 0,
            visible: true,
            name,
            body: None,
            fixed: false,
            is_deformable: false,
            frame_from_instance: Pose::identity(),
        }
    }

    /// Returns the instance with the name `name` of its owner, by which ray casters select targets.
    #[must_use]
    pub fn with_name(self, name: &str) -> Self {
        Self { name: Arc::from(name), ..self }
    }

    /// Returns the instance as a part of a body, given by its index on the body axis of
    /// [`SceneState`](crate::SceneState).
    #[must_use]
    pub fn with_body(self, body: u32) -> Self {
        Self { body: Some(body), ..self }
    }

    /// Scale \[1/m\] and offset of texture coordinates along the axes of the instance, for a shape without its own
    /// coordinates.
    ///
    /// A cube texture is mapped onto a box around the shape. Other textures are projected along z, as in MuJoCo's
    /// renderer: `tex_repeat` images over the size of the shape, or over 2 m with `tex_uniform` and on infinite planes.
    /// An image begins at the corner of a finite plane, and is centered on other shapes.
    fn texture_map(&self) -> ([f32; 3], [f32; 2]) {
        let material = &self.material;
        let [lo, hi] = self.shape.aabb();
        let half = [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k]));
        if material.texture.as_deref().is_some_and(|t| t.kind() == TextureKind::Cube) {
            return (half.map(|x| if x > 0.0 && x.is_finite() { 1.0 / x } else { 1.0 }), [0.0; 2]);
        }
        let repeat = material.tex_repeat.map(|r| if r > 0.0 { r } else { 1.0 });
        let is_infinite = |k: usize| !(half[k] > 0.0 && half[k].is_finite());
        let per_length = |k: usize| material.tex_uniform || is_infinite(k);
        let along = |k: usize| 0.5 * repeat[k] / if per_length(k) { 1.0 } else { half[k] };
        let scale = [along(0), along(1), 0.0];
        let middle = [-0.5, 0.5];
        let offset = match &self.shape {
            // Source: `makePlane` and `settexture` of MuJoCo 4. Whole numbers are dropped, because images repeat.
            Shape::Plane(_) => {
                let begin = if is_infinite(0) || is_infinite(1) { middle } else { [0.0; 2] };
                let corner =
                    |k: usize, sign: f32| if is_infinite(k) { 0.0 } else { sign * (scale[k] * half[k]).fract() };
                [begin[0] + corner(0, 1.0), begin[1] + corner(1, -1.0)]
            }
            _ => middle,
        };
        (scale, offset)
    }

    /// Returns the instance, welded to the world.
    #[must_use]
    pub fn into_fixed(self) -> Self {
        Self { fixed: true, ..self }
    }
}

/// Instances, lights and background of an environment, without poses of instances.
///
/// A scene is shared by environments and threads. Each frame supplies one pose per instance, and the current lights.
#[derive(Clone, Debug)]
pub struct RenderScene {
    instances: Vec<Instance>,
    first_ids: Vec<u32>,
    linear_colors: Vec<[f32; 3]>,
    texture_scales: Vec<[f32; 3]>,
    texture_offsets: Vec<[f32; 2]>,
    plane_lines: Vec<[PlaneLines; 2]>,
    face_images: Vec<Option<[f32; 2]>>,
    /// Lights of the scene, used if the renderer is given no others. Renderers use the first 16 active lights.
    pub lights: Vec<Light>,
    /// Headlight of every camera.
    pub headlight: Headlight,
    /// Ambient light from all directions, in addition to the `ambient` of lights.
    pub ambient: Hemisphere,
    /// Rule by which light is added up.
    pub lighting_space: LightingSpace,
    /// Further rules of MuJoCo's OpenGL renderer; `None` for the rules of this renderer.
    pub opengl: Option<OpenGlRules>,
    /// Background.
    pub sky: Sky,
    /// Background image instead of `sky`, `None` for `sky`: a [cube](TextureKind::Cube) around the camera. Its six
    /// squares face +x, -x, +z, -z, -y, +y of the world, because the y axis of MuJoCo's skyboxes points up.
    pub skybox: Option<Arc<Texture>>,
    /// Haze over distant surfaces; `None` for clear air.
    pub haze: Option<Haze>,
    /// Haze at the end of an infinite ground; `None` for a ground without it.
    pub horizon: Option<HorizonHaze>,
}

/// Error of a scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderSceneError {
    /// A mask id is 0.
    #[error("instance {instance} has mask id 0, which is reserved for the background")]
    ZeroMaskId {
        /// Index of the instance in the scene.
        instance: usize,
    },
    /// A size is not positive and finite.
    #[error("instance {instance}, a {shape}, has a size of {size}; sizes must be positive and finite")]
    Size {
        /// Index of the instance in the scene.
        instance: usize,
        /// Name of the shape.
        shape: &'static str,
        /// The size \[m\].
        size: f32,
    },
    /// A number of a material is not finite, or its refractive index is outside of 1 to 10.
    #[error(
        "the material of instance {instance} has a number that is not finite, or a refractive index outside 1..=10"
    )]
    Material {
        /// Index of the instance in the scene.
        instance: usize,
    },
    /// The triangles of all meshes, with 8 ids for each shape without triangles, exceed the number of ids.
    #[error("the scene has more than {limit} triangles")]
    TooManyTriangles {
        /// Largest number of ids.
        limit: u32,
    },
}

impl RenderScene {
    /// Number of ids of a shape without triangles: enough for one for each face of a box.
    pub const IDS_OF_PRIMITIVE: u32 = 8;
    /// Largest number of ids.
    pub(crate) const MAX_IDS: u32 = u32::MAX / 2;

    /// Creates a scene with the default lights (one from above, the headlight, ambient light) and the default sky.
    ///
    /// # Errors
    ///
    /// A size is not positive and finite, a number of a material is not finite, a refractive index is outside of
    /// 1..=10, a mask id is 0, or there are too many triangles.
    pub fn new(instances: Vec<Instance>) -> Result<Self, RenderSceneError> {
        let mut first_ids = vec![0u32];
        let mut next = 0u32;
        for (index, instance) in instances.iter().enumerate() {
            instance.validate_as(index)?;
            let ids = instance.mesh().map_or(Self::IDS_OF_PRIMITIVE as usize, |mesh| mesh.triangles().len());
            next = u32::try_from(ids)
                .ok()
                .and_then(|ids| next.checked_add(ids))
                .filter(|&n| n < Self::MAX_IDS)
                .ok_or(RenderSceneError::TooManyTriangles { limit: Self::MAX_IDS })?;
            first_ids.push(next);
        }
        let linear = |i: &Instance| {
            let [r, g, b, _] = i.material.rgba;
            [r, g, b].map(crate::material::decode_srgb)
        };
        let linear_colors = instances.iter().map(linear).collect();
        let (texture_scales, texture_offsets) = instances.iter().map(Instance::texture_map).unzip();
        let plane_lines = vec![[PlaneLines::default(); 2]; instances.len()];
        let face_images = vec![None; instances.len()];
        Ok(Self {
            linear_colors,
            texture_scales,
            texture_offsets,
            plane_lines,
            face_images,
            instances,
            first_ids,
            ..Self::empty()
        })
    }

    /// Creates a scene of other instances with the lights and the background of this one.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn with_instances(&self, instances: Vec<Instance>) -> Result<Self, RenderSceneError> {
        let Self { headlight, ambient, lighting_space, opengl, sky, haze, horizon, .. } = *self;
        let (lights, skybox) = (self.lights.clone(), self.skybox.clone());
        let others = Self::new(instances)?;
        Ok(Self { lights, headlight, ambient, lighting_space, opengl, sky, skybox, haze, horizon, ..others })
    }

    /// Creates a scene without instances, with the default lights and sky.
    pub fn empty() -> Self {
        Self {
            linear_colors: Vec::new(),
            texture_scales: Vec::new(),
            texture_offsets: Vec::new(),
            plane_lines: Vec::new(),
            face_images: Vec::new(),
            instances: Vec::new(),
            first_ids: vec![0],
            lights: vec![Light::default()],
            headlight: Headlight::default(),
            ambient: Hemisphere::default(),
            lighting_space: LightingSpace::default(),
            opengl: None,
            sky: Sky::default(),
            skybox: None,
            haze: None,
            horizon: None,
        }
    }

    /// Sets the polygons of an instance that is a plane, for [`OpenGlRules::tessellation`].
    ///
    /// # Panics
    ///
    /// `index` is out of range.
    #[track_caller]
    pub fn set_plane_lines(&mut self, index: usize, lines: [PlaneLines; 2]) {
        self.plane_lines[index] = lines;
    }

    /// Polygons of each instance that is a plane, see [`set_plane_lines`](Self::set_plane_lines).
    pub fn plane_lines(&self) -> &[[PlaneLines; 2]] {
        &self.plane_lines
    }

    /// Puts the two-dimensional texture of an instance that is a box on each of its faces, as MuJoCo's OpenGL renderer does
    /// from 3.12 on, instead of projecting it along z. `images` are the repetitions of the texture across and along a face,
    /// see [`Box::face_coordinates`](crate::shape::Box::face_coordinates).
    ///
    /// # Panics
    ///
    /// `index` is out of range.
    #[track_caller]
    pub fn set_face_images(&mut self, index: usize, images: [f32; 2]) {
        self.face_images[index] = Some(images);
    }

    /// Repetitions of the texture on the faces of each instance, see [`set_face_images`](Self::set_face_images); `None` for
    /// a texture that is projected, or has texture coordinates of its own.
    pub fn face_images(&self) -> &[Option<[f32; 2]>] {
        &self.face_images
    }

    /// Replaces the shape of an instance by one of the same kind, and shows or hides the instance. Sizes are not
    /// checked.
    ///
    /// # Panics
    ///
    /// `index` is out of range, the shape is of another kind, or a mesh has another number of triangles.
    #[track_caller]
    pub fn set_shape(&mut self, index: usize, shape: Shape, visible: bool) {
        let instance = &mut self.instances[index];
        let same_kind = std::mem::discriminant(&instance.shape) == std::mem::discriminant(&shape);
        let triangles = instance.mesh().map(|mesh| mesh.triangles().len());
        (instance.shape, instance.visible) = (shape, visible);
        assert!(
            same_kind && triangles == instance.mesh().map(|mesh| mesh.triangles().len()),
            "instance {index} must keep its kind of shape and its number of triangles"
        );
        (self.texture_scales[index], self.texture_offsets[index]) = instance.texture_map();
    }

    /// Moves the vertices of an instance whose mesh is [deformable](crate::shape::RenderMesh::deformable).
    ///
    /// `deform` changes the mesh, which is copied first if it is shared. Returns false, and changes nothing, for other
    /// shapes.
    ///
    /// # Panics
    ///
    /// `index` is out of range.
    #[track_caller]
    pub fn deform(&mut self, index: usize, deform: impl FnOnce(&mut crate::shape::RenderMesh)) -> bool {
        let Shape::Mesh(shape) = &mut self.instances[index].shape else { return false };
        if !shape.mesh.is_deformable() {
            return false;
        }
        deform(Arc::make_mut(&mut shape.mesh));
        (self.texture_scales[index], self.texture_offsets[index]) = self.instances[index].texture_map();
        true
    }

    /// Sets the [scale](Self::texture_scales) of the texture of an instance without texture coordinates of its own.
    ///
    /// # Panics
    ///
    /// `index` is out of range.
    #[track_caller]
    pub fn set_texture_scale(&mut self, index: usize, scale: [f32; 3]) {
        self.texture_scales[index] = scale;
    }

    /// Instances. Every list of instance poses has one pose per instance, in this order.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// First id of each instance: instance k has the ids `first_ids()[k]..first_ids()[k + 1]`. A mesh or height field
    /// has one per triangle, other shapes have [`IDS_OF_PRIMITIVE`](Self::IDS_OF_PRIMITIVE).
    pub fn first_ids(&self) -> &[u32] {
        &self.first_ids
    }

    /// Material color of each instance, in linear light.
    pub fn linear_colors(&self) -> &[[f32; 3]] {
        &self.linear_colors
    }

    /// Texture coordinates per meter along the axes of each instance's frame, for shapes without their own coordinates:
    /// u and v, or for a cube texture the coordinates of a cube of half length 1.
    pub fn texture_scales(&self) -> &[[f32; 3]] {
        &self.texture_scales
    }

    /// Texture coordinates u and v at the origin of each instance's frame, for shapes without their own coordinates.
    pub fn texture_offsets(&self) -> &[[f32; 2]] {
        &self.texture_offsets
    }

    /// Number of triangles of all meshes and height fields.
    pub fn triangle_count(&self) -> usize {
        self.instances.iter().filter_map(Instance::mesh).map(|m| m.triangles().len()).sum()
    }
}

impl Instance {
    /// Checks the sizes, the numbers of the material and the mask id.
    ///
    /// # Errors
    ///
    /// The first invalid value. The error gives the index of the instance as 0.
    pub fn validate(&self) -> Result<(), RenderSceneError> {
        self.validate_as(0)
    }

    fn validate_as(&self, instance: usize) -> Result<(), RenderSceneError> {
        if self.mask_id == 0 {
            return Err(RenderSceneError::ZeroMaskId { instance });
        }
        if let Some(size) = self.shape.invalid_size() {
            return Err(RenderSceneError::Size { instance, shape: self.shape.name(), size });
        }
        let m = &self.material;
        let numbers = [m.emission, m.specular, m.shininess, m.reflectance, m.tex_repeat[0], m.tex_repeat[1]];
        let numbers = numbers.into_iter().chain([m.metallic, m.roughness.unwrap_or_default(), m.transmission]);
        // The largest known refractive index is 4, of germanium.
        let valid_refraction = (1.0..=10.0).contains(&m.refractive_index);
        if !valid_refraction || m.rgba.into_iter().chain(numbers).any(|x| !x.is_finite()) {
            return Err(RenderSceneError::Material { instance });
        }
        Ok(())
    }

    /// Triangles of a mesh or height field; `None` for other shapes.
    #[inline]
    pub fn mesh(&self) -> Option<&crate::shape::RenderMesh> {
        self.shape.mesh().map(Arc::as_ref)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Texture;
    use crate::shape::RenderMesh;
    use crate::shape::{Box, Mesh, Plane, Sphere};

    fn textured(kind: TextureKind, tex_uniform: bool) -> Material {
        let height = if kind == TextureKind::Cube { 6 } else { 1 };
        let texture = Texture::new(kind, 1, height, 3, &vec![200; 3 * height as usize]).unwrap();
        Material { texture: Some(Arc::new(texture)), tex_repeat: [3.0, 5.0], tex_uniform, ..Material::default() }
    }

    /// A box has one id for each face and reserves 8, like a sphere; a mesh has one for each triangle. A display color
    /// becomes linear light by the law of sRGB: c / 12.92 up to 0.04045, ((c + 0.055) / 1.055)^2.4 above. A cube
    /// texture is on a cube of half length 1 around the shape. Other textures repeat over the size of the shape, or
    /// over 2 m.
    #[test]
    fn instances() {
        let half = [0.5, 0.25, 2.0];
        let mesh = Mesh {
            mesh: Arc::new(RenderMesh::new(&Shape::from(Box { half }).tessellate(1), RenderMesh::DEFAULT_CREASE_ANGLE)),
        };
        let triangles = mesh.mesh.triangles().len() as u32;
        assert_eq!(triangles, 12);
        let scene = RenderScene::new(vec![
            Instance::new(Box { half }, Material::from_rgba([0.02, 0.5, 1.0, 0.3]), 1),
            Instance::new(mesh, textured(TextureKind::Cube, false), 2),
            Instance::new(Sphere { radius: 0.5 }, textured(TextureKind::TwoD, true), 3),
            Instance::new(Box { half }, textured(TextureKind::TwoD, false), 4),
            Instance::new(Plane { half: [0.0, 2.0] }, textured(TextureKind::TwoD, false), 5),
        ])
        .unwrap();
        assert_eq!(scene.first_ids(), [0, 8, 20, 28, 36, 44]);
        assert_eq!(scene.triangle_count(), 12);
        let linear = [0.02 / 12.92, ((0.5 + 0.055) / 1.055_f32).powf(2.4), 1.0];
        let far = scene.linear_colors()[0].iter().zip(linear).map(|(found, expected)| (found - expected).abs());
        // Single precision, without the rounding to eight bits.
        assert!(far.fold(0.0, f32::max) < 1e-6, "{:?}", scene.linear_colors()[0]);
        let expected = [[2.0, 4.0, 0.5], [1.5, 2.5, 0.0], [3.0, 10.0, 0.0], [1.5, 1.25, 0.0]];
        assert_eq!(scene.texture_scales()[1..], expected);
        assert_eq!((RenderScene::empty().first_ids(), RenderScene::empty().linear_colors().len()), (&[0][..], 0));
    }

    /// Texture coordinates of planes by the formulas of MuJoCo 4's renderer: `makePlane` gives each corner a
    /// coordinate. `settexture` scales it by the repeats, by the half size too with `texuniform`, and shifts that of an
    /// infinite plane. Image rows run downward in MuJoCo, and upward here.
    ///
    /// Regression test: with `tex_uniform`, an image repeated once per meter, where MuJoCo repeats it once in 2 m.
    #[test]
    fn planes_are_textured_as_by_mujoco() {
        for (half, uniform) in
            [[0.0f32; 2], [0.0, 2.0], [0.7, 1.3], [4.0, 4.0]].into_iter().flat_map(|half| [(half, true), (half, false)])
        {
            let material = textured(TextureKind::TwoD, uniform);
            let scene = RenderScene::new(vec![Instance::new(Plane { half }, material.clone(), 1)]).unwrap();
            let (scale, offset) = (scene.texture_scales()[0], scene.texture_offsets()[0]);
            let endless = half.contains(&0.0);
            for (x, y) in [(0.0f32, 0.0f32), (0.3, -0.4), (-0.65, 1.2)] {
                let (mut theirs, mut ours) = ([0.0f32; 2], [0.0f32; 2]);
                for (k, p) in [x, y].into_iter().enumerate() {
                    let corner = match (half[k] > 0.0, k) {
                        (true, 0) => (p + half[k]) / (2.0 * half[k]),
                        (true, _) => 1.0 - (p + half[k]) / (2.0 * half[k]),
                        (false, 0) => 0.5 * p,
                        (false, _) => -0.5 * p,
                    };
                    let scl = material.tex_repeat[k] * if uniform && half[k] > 0.0 { half[k] } else { 1.0 };
                    theirs[k] = scl * corner - if endless { 0.5 } else { 0.0 };
                    ours[k] = p * scale[k] + offset[k];
                }
                let off = [theirs[0] - ours[0], theirs[1] - (1.0 - ours[1])];
                assert!(off.iter().all(|x| (x - x.round()).abs() < 1e-5), "{half:?} {uniform}: {ours:?}, {theirs:?}");
            }
        }
    }
}
