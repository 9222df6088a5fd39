//! Conversion of the memory of `mjvGeom` and `mjvLight` to scenes.

use super::decor::{Decor, line_mesh, strips};
use super::frame::{Background, DrawFlags, MjvFrame, MjvObject};
use super::layout::{GeomLayout, LayoutError, LightLayout, floats, int};
use super::soft::{MjvMemory, SkinFaces, SoftBody};
use super::tessellation::{Facets, PlaneGrid};
use super::texture_rule::{TextureRule, moved_texture, plane_shift, wrapped_mesh};
use super::wireframe::wire_mesh;
use crate::{
    GeomShapes, GeomType, LightType, ModelMaterials, VisualModel, first_skybox, scene_light, shape_from_size, skybox,
};
use kinetoscope_scene::shape::{Capsule, Mesh, RenderMesh, Shape};
use kinetoscope_scene::{
    Headlight, Hemisphere, Instance, Light, LightingSpace, Marker, Material, OpenGlRules, PoseF32, RenderScene, Sky,
    Texture, TextureKind,
};
use std::collections::HashMap;
use std::sync::Arc;

/// Ambient light of scenes without lights in MuJoCo's renderer.
const AMBIENT_WITHOUT_LIGHTS: [f32; 3] = [0.3; 3];

/// Number of lights of OpenGL: later ones are not drawn.
const MAX_LIGHTS: usize = 8;

/// Opacity from which a geom is opaque. Source: MuJoCo's classic renderer, as for the following numbers.
const OPAQUE: f32 = 0.995;

/// Factor of the opacity of planes from behind.
const BACK_OF_PLANE: f32 = 0.3;

/// Category of decoration (`mjCAT_DECOR`), which casts no shadow.
const DECOR: i32 = 4;

/// Largest opacity of lines, so that they are drawn after all opaque surfaces.
const LINE_OPACITY: f32 = 0.9999;

/// Reader of the scenes of one model. Meshes and textures are prepared once.
#[derive(Debug)]
pub struct MjvReader<M> {
    shapes: GeomShapes<M>,
    materials: ModelMaterials,
    sky: Option<Arc<Texture>>,
    skins: Vec<SkinFaces>,
    omitted: Vec<String>,
    geoms: GeomLayout,
    lights: LightLayout,
    texture_rule: TextureRule,
    rules: Option<OpenGlRules>,
    decor_casts_no_shadows: bool,
    /// Arrows and triangles by type and size.
    arrows: HashMap<(i32, [u32; 3]), Arc<RenderMesh>>,
    /// Images of one pixel by color.
    colors: HashMap<[u32; 3], Arc<Texture>>,
    /// Meshes with scaled texture coordinates.
    wrapped: HashMap<WrappedKey, Arc<RenderMesh>>,
    /// Textures by address of the original, and pixels by which they are moved.
    moved: HashMap<(usize, [usize; 2]), Arc<Texture>>,
    last: Option<LastScene>,
}

/// Type, mesh, size and scale of the texture of a shape, as bits.
type WrappedKey = (i32, i32, [u32; 3], [u32; 2]);

/// Number of entries above which a cache of meshes or of one-pixel images is cleared.
const MAX_WRAPPED: usize = 1000;

/// The scene of the last frame, and all that it was made of.
#[derive(Debug)]
struct LastScene {
    looks: Vec<GeomLook>,
    background: Background,
    flags: DrawFlags,
    lights: usize,
    /// True if a light is active.
    is_lit: bool,
    scene: Arc<RenderScene>,
    segment_scene: Option<Arc<RenderScene>>,
    /// Geom of each instance.
    rows: Vec<InstanceRow>,
    /// Instances whose vertices move.
    soft: Vec<(usize, SoftBody)>,
    /// Instances of lines, with their geoms.
    lines: Vec<(usize, u32, Decor)>,
}

/// Geom that an instance shows.
#[derive(Clone, Copy, Debug)]
struct InstanceRow {
    /// Index of the geom.
    geom: u32,
    /// True for the back of a plane, which is turned around x.
    is_back: bool,
}

/// All fields of a geom but its pose and its ids. Numbers are compared by their bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct GeomLook {
    kind: i32,
    dataid: i32,
    matid: i32,
    texid: i32,
    texuniform: i32,
    texrepeat: [u32; 2],
    is_decor: bool,
    decor: Option<Decor>,
    size: [u32; 3],
    rgba: [u32; 4],
    /// Emission, specular, shininess, reflectance.
    shading: [u32; 4],
    has_segment: bool,
    /// True if the pose is a rotation and a position, which the renderer needs.
    is_rigid: bool,
    /// Skin or flex, and its number of triangles.
    soft: Option<(SoftBody, usize)>,
}

impl GeomLook {
    fn read(row: &[u8], layout: &GeomLayout, skins: &[SkinFaces], memory: &MjvMemory<'_>) -> Self {
        let soft = SoftBody::of(int(row, layout.kind), int(row, layout.objid), &layout.soft);
        let number = |at: Option<usize>| at.map_or(-1, |at| int(row, at));
        let bits = |at: usize| int(row, at) as u32;
        Self {
            kind: int(row, layout.kind),
            dataid: int(row, layout.dataid),
            matid: number(layout.matid),
            texid: number(layout.texid),
            texuniform: number(layout.texuniform),
            texrepeat: layout.texrepeat.map_or([0; 2], |at| [bits(at), bits(at + 4)]),
            is_decor: int(row, layout.category) == DECOR,
            decor: Decor::of(int(row, layout.kind), &layout.decor),
            size: [0, 4, 8].map(|k| bits(layout.size + k)),
            rgba: [0, 4, 8, 12].map(|k| bits(layout.rgba + k)),
            shading: [layout.emission, layout.specular, layout.shininess, layout.reflectance].map(bits),
            has_segment: int(row, layout.segid) >= 0,
            is_rigid: soft.is_some() || InstanceRow { geom: 0, is_back: false }.pose(row, layout).is_rigid(),
            soft: soft.map(|body| (body, body.faces(skins, memory))),
        }
    }
}

impl<M: VisualModel> MjvReader<M> {
    /// Prepares the textures and materials of a model.
    ///
    /// # Errors
    /// A field of a layout is not inside its structure.
    pub fn new(model: M, skins: Vec<SkinFaces>, geoms: GeomLayout, lights: LightLayout) -> Result<Self, LayoutError> {
        geoms.validate()?;
        lights.validate()?;
        let materials = ModelMaterials::new(&model, LightingSpace::Display);
        let mut omitted = materials.omitted().to_vec();
        let sky = first_skybox(&model).and_then(|texture| {
            skybox(&model, texture, LightingSpace::Display)
                .map_err(|reason| omitted.push(format!("the skybox, texture {texture}, is not rendered: {reason}")))
                .ok()
        });
        Ok(Self {
            shapes: GeomShapes::new(model).with_model_normals(),
            materials,
            sky,
            skins,
            omitted,
            geoms,
            lights,
            texture_rule: TextureRule::default(),
            rules: None,
            decor_casts_no_shadows: true,
            arrows: HashMap::new(),
            colors: HashMap::new(),
            wrapped: HashMap::new(),
            moved: HashMap::new(),
            last: None,
        })
    }

    /// Sets the mapping of textures, which depends on the version of MuJoCo.
    #[must_use]
    pub fn with_texture_rule(self, texture_rule: TextureRule) -> Self {
        Self { texture_rule, last: None, ..self }
    }

    /// Sets rules of MuJoCo's OpenGL renderer.
    #[must_use]
    pub fn with_opengl_rules(self, rules: OpenGlRules) -> Self {
        Self { rules: Some(rules), last: None, ..self }
    }

    /// Sets if decoration casts shadows, which it does not by default; lines never do.
    #[must_use]
    pub fn with_shadows_of_decor(self, casts: bool) -> Self {
        Self { decor_casts_no_shadows: !casts, last: None, ..self }
    }

    /// True if the model has a skybox.
    pub fn has_skybox(&self) -> bool {
        self.sky.is_some()
    }

    /// Messages about the elements that could not be rendered so far, each message once.
    pub fn omitted(&self) -> &[String] {
        &self.omitted
    }

    /// Reads the geoms and lights of a scene from their memory.
    ///
    /// # Errors
    /// The memory does not consist of whole structures.
    pub fn read(&mut self, memory: &MjvMemory<'_>, background: Background) -> Result<MjvFrame, LayoutError> {
        let MjvMemory { geoms, lights, .. } = *memory;
        check_length(geoms, self.geoms.stride)?;
        check_length(lights, self.lights.stride)?;
        let layout = self.geoms;
        let rows = || geoms.chunks_exact(layout.stride);
        let light_layout = self.lights;
        let is_drawn = |row: &[u8]| {
            let kind = light_layout.read(row).values.kind;
            matches!(kind, LightType::Directional | LightType::Spot)
        };
        let lights: Vec<Light> = lights
            .chunks_exact(self.lights.stride)
            .enumerate()
            .map(|(index, row)| {
                let light = self.lights.read(row);
                let position = light.position;
                let direction = if light.is_headlight { memory.forward } else { light.direction };
                let light = scene_light(&light.values, LightingSpace::Display);
                // MuJoCo's renderer leaves out lights of all other types.
                Light { position, direction, active: light.active && is_drawn(row) && index < MAX_LIGHTS, ..light }
            })
            .collect();
        for row in memory.lights.chunks_exact(light_layout.stride).filter(|row| !is_drawn(row)) {
            let kind = light_layout.kind.map_or(0, |at| int(row, at));
            self.omit(format!("lights of type {kind} are not rendered: only directional and spot lights are"));
        }
        if lights.len() > MAX_LIGHTS {
            self.omit(format!("lights after the first {MAX_LIGHTS} are not rendered, as in OpenGL"));
        }
        let last = self.last.take();
        let looks = rows().map(|row| GeomLook::read(row, &layout, &self.skins, memory));
        let looks: Vec<GeomLook> = looks.collect();
        let is_lit = lights.iter().any(|light| light.active);
        let is_same = |last: &LastScene| {
            let same_lights = last.lights == lights.len() && last.is_lit == is_lit;
            let same_flags = last.background == background && last.flags == memory.flags;
            same_flags && same_lights && last.looks == looks
        };
        let mut last = match last {
            Some(last) if is_same(&last) => last,
            _ => self.build(looks, background, &lights, memory),
        };
        let mut poses: Vec<PoseF32> =
            last.rows.iter().map(|row| row.pose(&geoms[row.geom as usize * layout.stride..], &layout)).collect();
        // Vertices of skins, flexes and lines are in the world.
        for instance in last.soft.iter().map(|(k, _)| *k).chain(last.lines.iter().map(|(k, ..)| *k)) {
            poses[instance] = PoseF32::IDENTITY;
        }
        let strip = |&(instance, geom, decor): &(usize, u32, Decor)| {
            let row = &geoms[geom as usize * layout.stride..];
            let pose = InstanceRow { geom, is_back: false }.pose(row, &layout);
            let view = memory.lines.unwrap_or_default();
            (instance, strips(decor, floats(row, layout.size), &view, |point| pose.apply(point)))
        };
        let lines: Vec<_> = last.lines.iter().map(strip).collect();
        if !last.soft.is_empty() || !last.lines.is_empty() {
            // Copied only if an earlier frame is still in use.
            for scene in std::iter::once(&mut last.scene).chain(&mut last.segment_scene) {
                let scene = Arc::make_mut(scene);
                // Wireframes are built for each frame.
                for &(instance, body) in last.soft.iter().filter(|_| !memory.flags.is_wireframe) {
                    let [positions, normals] = body.vertices(&self.skins, memory);
                    if positions.iter().flatten().all(|x| x.is_finite()) && !positions.is_empty() {
                        scene.deform(instance, |mesh| mesh.deform(positions, normals));
                    }
                }
                for (instance, [positions, normals]) in &lines {
                    scene.deform(*instance, |mesh| mesh.deform(positions, normals));
                }
            }
        }
        let object = |row: &[u8]| {
            let segment = int(row, layout.segid);
            if segment < 0 {
                return MjvObject::NONE;
            }
            MjvObject { id: int(row, layout.objid), kind: int(row, layout.objtype), segment }
        };
        let frame = MjvFrame {
            scene: Arc::clone(&last.scene),
            segment_scene: last.segment_scene.clone(),
            poses,
            lights,
            objects: std::iter::once(MjvObject::NONE).chain(rows().map(object)).collect(),
        };
        self.last = Some(last).filter(|_| !memory.flags.is_wireframe);
        Ok(frame)
    }

    fn build(
        &mut self,
        looks: Vec<GeomLook>,
        background: Background,
        lights: &[Light],
        memory: &MjvMemory<'_>,
    ) -> LastScene {
        let (mut instances, mut rows, mut soft, mut lines) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (index, look) in looks.iter().enumerate() {
            match self.instance(look, index as i32 + 1, memory) {
                Ok(instance) => {
                    soft.extend(look.soft.map(|(body, _)| (instances.len(), body)));
                    let geom = index as u32;
                    lines.extend(
                        look.decor.filter(|decor| decor.lines() > 0).map(|decor| (instances.len(), geom, decor)),
                    );
                    let back = matches!(instance.shape, Shape::Plane(_)).then(|| instance.clone());
                    instances.push(instance);
                    rows.push(InstanceRow { geom, is_back: false });
                    // Planes are visible from behind in MuJoCo's renderer, but transparent.
                    if let Some(back) = back {
                        let [r, g, b, _] = back.material.rgba;
                        let opacity = memory.flags.opacity(BACK_OF_PLANE * f32::from_bits(look.rgba[3]));
                        let material = Material { reflectance: 0.0, rgba: [r, g, b, opacity], ..back.material };
                        instances.push(Instance { material, group: OpenGlRules::BACK_GROUP, ..back });
                        rows.push(InstanceRow { geom, is_back: true });
                    }
                }
                Err(reason) => self.omit(format!("geoms of type {} are not rendered: {reason}", look.kind)),
            }
        }
        let hidden = |row: &InstanceRow| !looks[row.geom as usize].has_segment;
        let has_segment_scene = memory.flags.is_wireframe || rows.iter().any(hidden);
        let segment_instances = has_segment_scene.then(|| {
            let hide = |(instance, row): (&Instance, &InstanceRow)| {
                let visible = instance.visible && !hidden(row);
                Instance { visible, ..instance.clone() }
            };
            instances.iter().zip(&rows).map(hide).collect::<Vec<_>>()
        });
        let scales = self.cube_scales(&instances, &rows, &looks);
        let grids: Vec<_> = (0..)
            .zip(instances.iter().zip(&rows))
            .filter_map(|(index, (instance, row))| {
                let Shape::Plane(plane) = &instance.shape else { return None };
                Some((index, self.plane_grid(&looks[row.geom as usize], memory).lines(plane)))
            })
            .collect();
        let faces = self.face_images(&instances, &rows, &looks);
        let scaled = |mut scene: RenderScene| {
            for &(instance, scale) in &scales {
                scene.set_texture_scale(instance, scale);
            }
            for &(instance, images) in &faces {
                scene.set_face_images(instance, images);
            }
            for &(instance, lines) in &grids {
                scene.set_plane_lines(instance, lines);
            }
            scene
        };
        let instances = if memory.flags.is_wireframe {
            let wired = |(instance, row)| self.wired(instance, row, &looks, memory);
            instances.into_iter().zip(&rows).map(wired).collect()
        } else {
            instances
        };
        let scene = self.scene(instances, background, lights, memory.flags).map(scaled).unwrap_or_else(|| {
            rows.clear();
            soft.clear();
            lines.clear();
            RenderScene::empty()
        });
        let segment_scene =
            segment_instances.and_then(|instances| self.scene(instances, background, lights, memory.flags)).map(scaled);
        LastScene {
            looks,
            background,
            flags: memory.flags,
            lights: lights.len(),
            is_lit: lights.iter().any(|light| light.active),
            scene: Arc::new(scene),
            segment_scene: segment_scene.map(Arc::new),
            rows,
            soft,
            lines,
        }
    }

    /// Polygons of a geom that is a plane.
    fn plane_grid(&self, look: &GeomLook, memory: &MjvMemory<'_>) -> PlaneGrid {
        PlaneGrid {
            spacing: (look.dataid >= 0).then(|| f32::from_bits(look.size[2])),
            repeat: self.materials.get(look.matid).map_or([0.0; 2], |material| material.tex_repeat),
            far: memory.lines.map_or(1.0, |view| view.far),
            quality: self.rules.and_then(|rules| rules.tessellation).unwrap_or_default(),
        }
    }

    /// An instance that shows the edges of the polygons of another one.
    fn wired(&self, instance: Instance, row: &InstanceRow, looks: &[GeomLook], memory: &MjvMemory<'_>) -> Instance {
        let look = &looks[row.geom as usize];
        let Some(view) = memory.lines.filter(|_| look.decor.is_none_or(|decor| decor.lines() == 0)) else {
            return instance;
        };
        let bytes = &memory.geoms[row.geom as usize * self.geoms.stride..];
        let is_soft = look.soft.is_some();
        let view = if is_soft { view } else { view.in_frame(&row.pose(bytes, &self.geoms)) };
        let grid = self.plane_grid(look, memory);
        // A textured shape may already be a mesh with texture coordinates.
        let size = look.size.map(f32::from_bits);
        let own = own_shape(look.kind, size);
        let mut facets = match instance.mesh() {
            Some(mesh) if own.is_none() => Facets::of_mesh(mesh),
            _ => Facets::new(own.as_ref().unwrap_or(&instance.shape), &grid),
        };
        let is_flat = instance.material.texture.as_ref().is_some_and(|texture| texture.kind() == TextureKind::TwoD);
        if is_flat && facets.uvs.is_none() {
            let Ok(scene) = RenderScene::new(vec![instance.clone()]) else { return instance };
            let ([scale], [offset]) = (scene.texture_scales(), scene.texture_offsets()) else { return instance };
            let uv = |p: &[f32; 3]| [0, 1].map(|k| p[k] * scale[k] + offset[k]);
            facets.uvs = Some(facets.positions.iter().map(uv).collect());
        }
        let group = if row.is_back { instance.group } else { Marker::GROUP };
        match wire_mesh(&facets, &view, memory.flags.culls_backs && look.decor.is_none()) {
            Some(mesh) => Instance {
                shape: Mesh { mesh: Arc::new(mesh) }.into(),
                is_deformable: true,
                material: Material { reflectance: 0.0, ..instance.material },
                group,
                ..instance
            },
            None => Instance { visible: false, ..instance },
        }
    }

    /// Repetitions of two-dimensional textures on the faces of boxes, for [`TextureRule::Wrapped`].
    fn face_images(&self, instances: &[Instance], rows: &[InstanceRow], looks: &[GeomLook]) -> Vec<(usize, [f32; 2])> {
        let is_wrapped = self.texture_rule == TextureRule::Wrapped;
        let images = |(index, (instance, row)): (usize, (&Instance, &InstanceRow))| {
            let material = &instance.material;
            let is_flat = material.texture.as_ref().is_some_and(|texture| texture.kind() == TextureKind::TwoD);
            let is_wrapped = is_wrapped && is_flat && matches!(instance.shape, Shape::Box(_));
            let look = &looks[row.geom as usize];
            is_wrapped.then(|| (index, images_along(look, material.tex_repeat, material.tex_uniform)))
        };
        instances.iter().zip(rows).enumerate().filter_map(images).collect()
    }

    /// Scales of cube textures where they are not those of [`RenderScene`]: in OpenGL, the texture of a mesh is on a cube
    /// of half length 1 m, and the sizes of a geom are factors with `texuniform`.
    fn cube_scales(&self, instances: &[Instance], rows: &[InstanceRow], looks: &[GeomLook]) -> Vec<(usize, [f32; 3])> {
        let mut scales = Vec::new();
        for (index, (instance, row)) in instances.iter().zip(rows).enumerate() {
            let is_cube = instance.material.texture.as_ref().is_some_and(|t| t.kind() == TextureKind::Cube);
            let is_mesh = instance.mesh().is_some();
            if !is_cube || !(is_mesh || instance.material.tex_uniform) {
                continue;
            }
            let [lo, hi] = instance.shape.aabb();
            let size = looks[row.geom as usize].size.map(f32::from_bits);
            let scale = [0, 1, 2].map(|k| {
                let half = 0.5 * (hi[k] - lo[k]);
                let own = if is_mesh || !(half > 0.0 && half.is_finite()) { 1.0 } else { 1.0 / half };
                if instance.material.tex_uniform { own * size[k] } else { own }
            });
            // Only the direction matters. The renderer expects the surface of a cube of half length 1.
            let reach = (0..3).map(|k| scale[k] * lo[k].abs().max(hi[k].abs())).fold(0.0, f32::max);
            if reach > 0.0 && reach.is_finite() {
                scales.push((index, scale.map(|x| x / reach)));
            }
        }
        scales
    }

    /// Scene with the lighting of MuJoCo's renderer; `None` for invalid instances. The headlight is one of its lights.
    fn scene(
        &mut self,
        instances: Vec<Instance>,
        background: Background,
        lights: &[Light],
        flags: DrawFlags,
    ) -> Option<RenderScene> {
        let mut scene = match RenderScene::new(instances) {
            Ok(scene) => scene,
            Err(error) => {
                self.omit(format!("the scene is not rendered: {error}"));
                return None;
            }
        };
        scene.lights = lights.to_vec();
        scene.headlight = Headlight { active: false, ..Headlight::default() };
        // Without any light, MuJoCo's renderer adds ambient light.
        let ambient = if lights.iter().any(|light| light.active) { [0.0; 3] } else { AMBIENT_WITHOUT_LIGHTS };
        scene.ambient = Hemisphere { sky: ambient, ground: ambient };
        scene.lighting_space = LightingSpace::Display;
        let DrawFlags { culls_backs, is_additive, .. } = flags;
        scene.opengl = self.rules.map(|rules| OpenGlRules { culls_backs, is_additive, ..rules });
        // The skybox is behind all fog; without one, the background is black.
        let has_sky = background.skybox && self.sky.is_some();
        let fog = background.fog.filter(|_| has_sky).and_then(|fog| fog.color);
        scene.sky = Sky::uniform(fog.unwrap_or([0.0; 3]));
        scene.skybox = self.sky.clone().filter(|_| background.skybox && background.fog.is_none());
        scene.horizon = background.horizon.filter(|_| background.fog.is_none());
        scene.haze = background.fog;
        Some(scene)
    }

    /// Converts a geom to an instance with the mask id `mask_id`; an error with the reason if the geom cannot be
    /// rendered.
    fn instance(&mut self, look: &GeomLook, mask_id: i32, memory: &MjvMemory<'_>) -> Result<Instance, String> {
        if !look.is_rigid {
            return Err("a pose is not a rotation and a position".into());
        }
        let shape = self.shape(look, memory)?;
        let of_material = self.materials.get(look.matid);
        // A geom without a texture of its own has that of its material.
        let own_texture = self.geoms.texid.filter(|_| look.texid >= 0);
        let texture = match own_texture {
            Some(_) => self.materials.texture(look.texid).cloned(),
            None => of_material.and_then(|material| material.texture.clone()),
        };
        let model_material = of_material.cloned().unwrap_or_default();
        let tex_repeat = match self.geoms.texrepeat.and(own_texture) {
            Some(_) => look.texrepeat.map(f32::from_bits),
            None => model_material.tex_repeat,
        };
        let tex_uniform = match self.geoms.texuniform.and(own_texture) {
            Some(_) => look.texuniform != 0,
            None => model_material.tex_uniform,
        };
        let [emission, specular, shininess, reflectance] = look.shading.map(f32::from_bits);
        // MuJoCo reflects the scene in planes and in the upper face of boxes only.
        let mirrors = matches!(GeomType::from_id(look.kind), Some(GeomType::Plane | GeomType::Box));
        let (shape, texture) = match texture {
            Some(texture) if texture.kind() == TextureKind::TwoD => {
                self.mapped(look, shape, texture, (tex_repeat, tex_uniform))
            }
            texture => (shape, texture),
        };
        let mut rgba = look.rgba.map(|x| f32::from_bits(x).clamp(0.0, 1.0));
        rgba[3] = if rgba[3] >= OPAQUE { 1.0 } else { memory.flags.opacity(rgba[3]) };
        if look.decor.is_some_and(|decor| decor.lines() > 0) {
            // Lines have their color in any light: light of at least 1, on an image of this color.
            let texture = self.one_color([rgba[0], rgba[1], rgba[2]]);
            let rgba = [1.0, 1.0, 1.0, rgba[3].min(LINE_OPACITY)];
            let material = Material { rgba, texture, emission: 1.0, specular: 0.0, ..Material::default() };
            let visible = rgba[3] > 0.0 && memory.lines.is_some();
            let instance = Instance {
                visible,
                is_deformable: true,
                group: Marker::GROUP,
                ..Instance::new(shape, material, mask_id)
            };
            return Ok(instance);
        }
        let material = Material {
            rgba,
            texture,
            tex_repeat,
            tex_uniform,
            emission,
            specular,
            shininess,
            reflectance: if mirrors { reflectance } else { 0.0 },
            ..Material::default()
        };
        let (visible, is_deformable) = (rgba[3] > 0.0, look.soft.is_some());
        let group = if look.is_decor && self.decor_casts_no_shadows { Marker::GROUP } else { 0 };
        let instance = Instance { visible, is_deformable, group, ..Instance::new(shape, material, mask_id) };
        instance.validate().map_err(|error| error.to_string())?;
        Ok(instance)
    }

    /// Shape and texture such that the texture has the place of MuJoCo's renderer. Boxes stay as they are, see
    /// [`face_images`](Self::face_images): a mesh would be a little behind or in front of a box at the same place.
    fn mapped(
        &mut self,
        look: &GeomLook,
        shape: Shape,
        texture: Arc<Texture>,
        (repeat, is_uniform): ([f32; 2], bool),
    ) -> (Shape, Option<Arc<Texture>>) {
        let scale = images_along(look, repeat, is_uniform);
        match (self.texture_rule, &shape) {
            (TextureRule::Projected, Shape::Plane(plane)) => {
                let Some(shift) = plane_shift(plane, scale.map(|images| 0.5 * images), &texture) else {
                    return (shape, Some(texture));
                };
                let key = (Arc::as_ptr(&texture).addr(), shift);
                let known = self.moved.get(&key).cloned();
                let moved = known.or_else(|| moved_texture(&texture, shift).map(Arc::new));
                if let Some(moved) = &moved {
                    self.moved.insert(key, Arc::clone(moved));
                }
                (shape, moved.or(Some(texture)))
            }
            (TextureRule::Wrapped, _) if look.soft.is_none() => {
                if self.wrapped.len() > MAX_WRAPPED {
                    self.wrapped.clear();
                }
                let key = (look.kind, look.dataid, look.size, scale.map(f32::to_bits));
                let known = self.wrapped.get(&key).cloned();
                let Some(mesh) = known.or_else(|| wrapped_mesh(&shape, scale).map(Arc::new)) else {
                    return (shape, Some(texture));
                };
                self.wrapped.insert(key, Arc::clone(&mesh));
                (Mesh { mesh }.into(), Some(texture))
            }
            _ => (shape, Some(texture)),
        }
    }

    fn shape(&mut self, look: &GeomLook, memory: &MjvMemory<'_>) -> Result<Shape, String> {
        if let Some((body, _)) = look.soft {
            return match body.mesh(&self.skins, memory) {
                Some(mesh) => Ok(Mesh { mesh: Arc::new(mesh) }.into()),
                None => Err("a skin or flex has no triangles".into()),
            };
        }
        let size = look.size.map(f32::from_bits);
        if let Some(decor) = look.decor {
            let new = || decor.mesh(size).unwrap_or_else(|| line_mesh(decor));
            if decor.lines() > 0 {
                return Ok(Mesh { mesh: Arc::new(new()) }.into());
            }
            if self.arrows.len() > MAX_WRAPPED {
                self.arrows.clear();
            }
            if !(size.iter().all(|x| x.is_finite()) && size[0] > 0.0 && size[1] > 0.0) {
                return Err("a size is not positive".into());
            }
            let mesh = self.arrows.entry((look.kind, look.size)).or_insert_with(|| Arc::new(new()));
            return Ok(Mesh { mesh: Arc::clone(mesh) }.into());
        }
        let is_sdf = self.geoms.decor.sdf == Some(look.kind);
        let kind = if is_sdf { GeomType::Mesh as i32 } else { look.kind };
        let data = match GeomType::from_id(kind) {
            // Meshes have two ids each: 2 k for mesh k, and 2 k + 1 for its convex hull.
            Some(GeomType::Mesh) => look.dataid.div_euclid(2),
            Some(_) => look.dataid,
            None => return Err("neither shapes nor skins nor flexes".into()),
        };
        // The visualizer has the half length of capsules and cylinders at the end.
        let size = match GeomType::from_id(kind) {
            Some(GeomType::Capsule) if size[2] <= 0.0 => {
                return Ok(Capsule { radius: size[0], half_length: 1e-6 * size[0] }.into());
            }
            Some(GeomType::Capsule | GeomType::Cylinder) => [size[0], size[2], 0.0],
            _ => size,
        };
        self.shapes.get(kind, &size.map(f64::from), data).map_err(str::to_string)
    }

    /// An image of one pixel, of a color in display values 0 to 1; kept for later frames.
    fn one_color(&mut self, rgb: [f32; 3]) -> Option<Arc<Texture>> {
        if self.colors.len() > MAX_WRAPPED {
            self.colors.clear();
        }
        let key = rgb.map(f32::to_bits);
        if let Some(known) = self.colors.get(&key) {
            return Some(Arc::clone(known));
        }
        let bytes = rgb.map(|c| (255.0 * c).round() as u8);
        let texture = Texture::averaged_in(LightingSpace::Display, TextureKind::TwoD, 1, 1, 3, &bytes).ok()?;
        Some(Arc::clone(self.colors.entry(key).or_insert(Arc::new(texture))))
    }

    fn omit(&mut self, message: String) {
        if !self.omitted.contains(&message) {
            self.omitted.push(message);
        }
    }
}

/// Images of a texture along both of its axes, with these repetitions of its material; with `is_uniform`, they are those
/// along half the first two sizes of the geom.
fn images_along(look: &GeomLook, repeat: [f32; 2], is_uniform: bool) -> [f32; 2] {
    let size = look.size.map(f32::from_bits);
    let repeat = repeat.map(|r| if r > 0.0 { r } else { 1.0 });
    [0, 1].map(|k| repeat[k] * if is_uniform && size[k] > 0.0 { size[k] } else { 1.0 })
}

/// Shape of a geom whose sizes define it; `None` for other types.
fn own_shape(kind: i32, [x, y, z]: [f32; 3]) -> Option<Shape> {
    // The visualizer has the half length of capsules and cylinders at the end.
    let size = match GeomType::from_id(kind)? {
        GeomType::Capsule | GeomType::Cylinder => [x, z, 0.0],
        _ => [x, y, z],
    };
    shape_from_size(kind, &size.map(f64::from))
}

impl DrawFlags {
    /// Opacity of a transparent geom: MuJoCo's renderer draws it from the front to the back and, unless it is added to
    /// the color behind it, again from the back to the front.
    fn opacity(self, opacity: f32) -> f32 {
        let passed = 1.0 - opacity.clamp(0.0, 1.0);
        1.0 - if self.is_additive { passed } else { passed * passed }
    }
}

impl InstanceRow {
    /// Pose in the structure of the geom.
    fn pose(self, row: &[u8], layout: &GeomLayout) -> PoseF32 {
        let [a, b, c, d, e, f, g, h, i] = floats(row, layout.mat);
        let side = if self.is_back { -1.0 } else { 1.0 };
        let rotation = [[a, side * b, side * c], [d, side * e, side * f], [g, side * h, side * i]];
        PoseF32 { rotation, translation: floats(row, layout.pos) }
    }
}

fn check_length(memory: &[u8], stride: usize) -> Result<(), LayoutError> {
    if stride > 0 && memory.len().is_multiple_of(stride) {
        Ok(())
    } else {
        Err(LayoutError::Length { bytes: memory.len(), stride })
    }
}
