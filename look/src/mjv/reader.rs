//! Conversion of the memory of `mjvGeom` and `mjvLight` to scenes.

use super::frame::{Background, MjvFrame, MjvObject};
use super::layout::{GeomLayout, LayoutError, LightLayout, floats, int};
use super::soft::{MjvMemory, SkinFaces, SoftBody};
use super::texture_rule::{TextureRule, moved_texture, plane_shift, wrapped_mesh};
use crate::{GeomShapes, GeomType, LightType, ModelMaterials, VisualModel, first_skybox, scene_light, skybox};
use kinetoscope_scene::shape::{Capsule, Mesh, Plane, RenderMesh, Shape};
use kinetoscope_scene::{
    Headlight, Hemisphere, Instance, Light, LightingSpace, Material, PoseF32, RenderScene, Sky, Texture, TextureKind,
};
use std::collections::HashMap;
use std::sync::Arc;

/// Ambient light of scenes without lights in MuJoCo's renderer.
const AMBIENT_WITHOUT_LIGHTS: [f32; 3] = [0.3; 3];

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
    /// Meshes with scaled texture coordinates.
    wrapped: HashMap<WrappedKey, Arc<RenderMesh>>,
    /// Textures by address of the original, and pixels by which they are moved.
    moved: HashMap<(usize, [usize; 2]), Arc<Texture>>,
    last: Option<LastScene>,
}

/// Type, mesh, size and scale of the texture of a shape, as bits.
type WrappedKey = (i32, i32, [u32; 3], [u32; 2]);

/// Number of meshes after which those of former sizes are forgotten.
const MAX_WRAPPED: usize = 1000;

/// The scene of the last frame, and all that it was made of.
#[derive(Debug)]
struct LastScene {
    looks: Vec<GeomLook>,
    background: Background,
    lights: usize,
    /// True if a light is active.
    is_lit: bool,
    scene: Arc<RenderScene>,
    segment_scene: Option<Arc<RenderScene>>,
    /// Geom of each instance.
    rows: Vec<InstanceRow>,
    /// Instances whose vertices move.
    soft: Vec<(usize, SoftBody)>,
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
            shapes: GeomShapes::new(model),
            materials,
            sky,
            skins,
            omitted,
            geoms,
            lights,
            texture_rule: TextureRule::default(),
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

    /// True if the model has a skybox.
    pub fn has_skybox(&self) -> bool {
        self.sky.is_some()
    }

    /// One message for each element that could not be rendered so far.
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
            .map(|row| {
                let light = self.lights.read(row);
                let position = light.position;
                let direction = if light.is_headlight { memory.forward } else { light.direction };
                let light = scene_light(&light.values, LightingSpace::Display);
                // MuJoCo's renderer leaves out lights of all other types.
                Light { position, direction, active: light.active && is_drawn(row), ..light }
            })
            .collect();
        for row in memory.lights.chunks_exact(light_layout.stride).filter(|row| !is_drawn(row)) {
            let kind = light_layout.kind.map_or(0, |at| int(row, at));
            self.omit(format!("lights of type {kind} are not rendered: only directional and spot lights are"));
        }
        let last = self.last.take();
        let looks = rows().map(|row| GeomLook::read(row, &layout, &self.skins, memory));
        let looks: Vec<GeomLook> = looks.collect();
        let is_lit = lights.iter().any(|light| light.active);
        let is_same = |last: &LastScene| {
            let same_lights = last.lights == lights.len() && last.is_lit == is_lit;
            last.background == background && same_lights && last.looks == looks
        };
        let last = match last {
            Some(last) if is_same(&last) => last,
            _ => self.build(looks, background, &lights, memory),
        };
        let mut poses: Vec<PoseF32> =
            last.rows.iter().map(|row| row.pose(&geoms[row.geom as usize * layout.stride..], &layout)).collect();
        for &(instance, _) in &last.soft {
            // Vertices of skins and flexes are in the world.
            poses[instance] = PoseF32::IDENTITY;
        }
        let deformed = |scene: &Arc<RenderScene>| {
            if last.soft.is_empty() {
                return Arc::clone(scene);
            }
            let mut scene = (**scene).clone();
            for &(instance, body) in &last.soft {
                let [positions, normals] = body.vertices(&self.skins, memory);
                if positions.iter().flatten().all(|x| x.is_finite()) && !positions.is_empty() {
                    scene.deform(instance, |mesh| mesh.deform(positions, normals));
                }
            }
            Arc::new(scene)
        };
        let object = |row: &[u8]| {
            let segment = int(row, layout.segid);
            if segment < 0 {
                return MjvObject::NONE;
            }
            MjvObject { id: int(row, layout.objid), kind: int(row, layout.objtype), segment }
        };
        let frame = MjvFrame {
            scene: deformed(&last.scene),
            segment_scene: last.segment_scene.as_ref().map(deformed),
            poses,
            lights,
            objects: std::iter::once(MjvObject::NONE).chain(rows().map(object)).collect(),
        };
        self.last = Some(last);
        Ok(frame)
    }

    fn build(
        &mut self,
        looks: Vec<GeomLook>,
        background: Background,
        lights: &[Light],
        memory: &MjvMemory<'_>,
    ) -> LastScene {
        let (mut instances, mut rows, mut soft) = (Vec::new(), Vec::new(), Vec::new());
        for (index, look) in looks.iter().enumerate() {
            match self.instance(look, index as i32 + 1, memory) {
                Ok(instance) => {
                    soft.extend(look.soft.map(|(body, _)| (instances.len(), body)));
                    let geom = index as u32;
                    // Finite planes are visible from behind in MuJoCo's renderer.
                    if let Shape::Plane(Plane { half: [x, y] }) = instance.shape
                        && x > 0.0
                        && y > 0.0
                    {
                        let material = Material { reflectance: 0.0, ..instance.material.clone() };
                        instances.push(Instance { material, ..instance.clone() });
                        rows.push(InstanceRow { geom, is_back: true });
                    }
                    instances.push(instance);
                    rows.push(InstanceRow { geom, is_back: false });
                }
                Err(reason) => self.omit(format!("geoms of type {} are not rendered: {reason}", look.kind)),
            }
        }
        let hidden = |row: &InstanceRow| !looks[row.geom as usize].has_segment;
        let segment_instances = rows.iter().any(hidden).then(|| {
            let hide = |(instance, row): (&Instance, &InstanceRow)| {
                let visible = instance.visible && !hidden(row);
                Instance { visible, ..instance.clone() }
            };
            instances.iter().zip(&rows).map(hide).collect::<Vec<_>>()
        });
        let scene = self.scene(instances, background, lights).unwrap_or_else(|| {
            rows.clear();
            soft.clear();
            RenderScene::empty()
        });
        let segment_scene = segment_instances.and_then(|instances| self.scene(instances, background, lights));
        LastScene {
            looks,
            background,
            lights: lights.len(),
            is_lit: lights.iter().any(|light| light.active),
            scene: Arc::new(scene),
            segment_scene: segment_scene.map(Arc::new),
            rows,
            soft,
        }
    }

    /// Scene with the lighting of MuJoCo's renderer. The headlight is one of its lights.
    fn scene(&mut self, instances: Vec<Instance>, background: Background, lights: &[Light]) -> Option<RenderScene> {
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
        // The background is behind all fog.
        scene.sky = Sky::uniform(background.fog.and_then(|fog| fog.color).unwrap_or([0.0; 3]));
        scene.skybox = self.sky.clone().filter(|_| background.skybox && background.fog.is_none());
        scene.horizon = background.horizon.filter(|_| background.fog.is_none());
        scene.haze = background.fog;
        Some(scene)
    }

    /// Instance of a geom.
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
        let is_mirror = mirrors && reflectance > 0.0;
        let (shape, texture) = match texture {
            Some(texture) if texture.kind() == TextureKind::TwoD => {
                self.mapped(look, shape, texture, is_mirror, (tex_repeat, tex_uniform))
            }
            texture => (shape, texture),
        };
        let rgba = look.rgba.map(|x| f32::from_bits(x).clamp(0.0, 1.0));
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
        let instance = Instance { visible, is_deformable, ..Instance::new(shape, material, mask_id) };
        instance.validate().map_err(|error| error.to_string())?;
        Ok(instance)
    }

    /// Shape and texture such that the texture has the place of MuJoCo's renderer. Boxes that are mirrors stay as they
    /// are, because meshes do not mirror.
    fn mapped(
        &mut self,
        look: &GeomLook,
        shape: Shape,
        texture: Arc<Texture>,
        is_mirror: bool,
        (repeat, is_uniform): ([f32; 2], bool),
    ) -> (Shape, Option<Arc<Texture>>) {
        let repeat = repeat.map(|r| if r > 0.0 { r } else { 1.0 });
        let size = look.size.map(f32::from_bits);
        let of_size = |k: usize| repeat[k] * if is_uniform && size[k] > 0.0 { size[k] } else { 1.0 };
        let scale = [of_size(0), of_size(1)];
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
            (TextureRule::Wrapped, _) if !is_mirror && look.soft.is_none() => {
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
        let data = match GeomType::from_id(look.kind) {
            // Meshes have two ids each: 2 k for mesh k, and 2 k + 1 for its convex hull.
            Some(GeomType::Mesh) => look.dataid.div_euclid(2),
            Some(_) => look.dataid,
            None => return Err("neither shapes nor skins nor flexes".into()),
        };
        // The visualizer has the half length of capsules and cylinders at the end.
        let size = match GeomType::from_id(look.kind) {
            Some(GeomType::Capsule) if size[2] <= 0.0 => {
                return Ok(Capsule { radius: size[0], half_length: 1e-6 * size[0] }.into());
            }
            Some(GeomType::Capsule | GeomType::Cylinder) => [size[0], size[2], 0.0],
            _ => size,
        };
        self.shapes.get(look.kind, &size.map(f64::from), data).map_err(str::to_string)
    }

    fn omit(&mut self, message: String) {
        if !self.omitted.contains(&message) {
            self.omitted.push(message);
        }
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
