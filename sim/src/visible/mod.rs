//! Conversion of MuJoCo's geoms to the scene that cameras render: `Model -> VisualScene -> (RenderScene, poses per
//! environment)`.
//!
//! Every geom of the model is an instance, whatever file the model came from, and so are tendons, skins and flexes.
//! Proxy geoms of URDF visuals (see `mjcf::robot`) are replaced by the real shapes. Constant data is extracted once;
//! [`VisualScene::read_poses`] copies the poses of one environment.

mod color;
mod deforming;
mod env_scene;
mod identity;
mod lighting;
mod overview;
mod posed_scene;
mod site;
pub(crate) mod surface_overrides;
mod urdf_visual;
mod visibility;

use self::surface_overrides::SurfaceOverrides;
pub(crate) use color::of_geom as color_of;
use deforming::{DeformingInstances, SceneBufferPool};
use identity::ElementIdentity;
pub use identity::MaskId;
pub(crate) use identity::{ElementOwner, MaskIdMap, of_simulation, tendon_owners};
pub(crate) use lighting::Lighting;
pub use posed_scene::{FreeCamera, ModelCamera, OffscreenScene};
pub(crate) use urdf_visual::{Replacements, VisualCache};

use crate::body_pose::BodyFrame;
use crate::light_cfg::LightCfg;
use crate::mjcf::scene_names::light_name;
use crate::simulation_cfg::GroundCfg;
use kinetoscope_look::{GeomShapes, ModelMaterials};
use kinetoscope_mujoco::{Data, Model, ObjectKind, mjcf_keywords};
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::shape::Plane;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::{
    EnvScene, Hemisphere, Instance, Light, Material, Pose, PoseF32, PoseF64, RenderScene, Texture,
};
use std::sync::Arc;

/// Render scene of a MuJoCo model. Each instance moves with one element of the model.
#[derive(Clone, Debug)]
pub struct VisualScene {
    scene: Arc<RenderScene>,
    /// Element of the model that each instance moves with.
    anchors: Vec<Anchor>,
    ids: Arc<[MaskId]>,
    left_out: Vec<String>,
    deforming: Arc<DeformingInstances>,
    buffers: Arc<SceneBufferPool>,
}

/// Element of a model that an instance moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Geom(usize),
    Site(usize),
    /// World, for elements whose shape changes.
    World,
}

/// Shape and material that are rendered for a geom.
#[derive(Clone, Debug)]
pub(crate) struct VisualPart {
    pub(crate) shape: Shape,
    pub(crate) material: Material,
}

/// Pose of a geom in the frame of its link; in the frame of its body without a link, and the identity in the world.
fn frame_from_geom(model: &Model, geom: usize, link: Option<&BodyFrame>) -> Pose {
    let body = model.geom_bodyid()[geom] as usize;
    let body_from_frame = match link {
        Some(link) if link.body == body => link.body_from_frame,
        None if body > 0 => Pose::identity(),
        _ => return Pose::identity(),
    };
    let [x, y, z] = [0, 1, 2].map(|k| model.geom_pos()[3 * geom + k]);
    let [qw, qx, qy, qz] = [0, 1, 2, 3].map(|k| model.geom_quat()[4 * geom + k]);
    body_from_frame.inverse() * from_row(&[x, y, z, qw, qx, qy, qz])
}

/// Ground of a simulation.
pub(crate) fn ground(cfg: &GroundCfg) -> VisualPart {
    let [r, g, b] = cfg.color.map(|c| c as f32);
    let material = Material { specular: 0.05, shininess: 0.1, ..Material::from_rgba([r, g, b, 1.0]) };
    let half = cfg.half_size as f32;
    let shape = Plane { half: [half, half] }.into();
    if !cfg.checker {
        return VisualPart { shape, material: cfg.surface.apply_to(material) };
    }
    let shade = |k: f32| [r, g, b].map(|c| ((c * k).clamp(0.0, 1.0) * 255.0).round() as u8);
    // Two by two squares of half a meter repeat once per meter. The texture supplies the color.
    let texture = Some(Arc::new(Texture::checker(256, shade(0.94), shade(1.08))));
    let material = Material { rgba: [1.0; 4], texture, tex_repeat: [2.0; 2], tex_uniform: true, ..material };
    VisualPart { shape, material: cfg.surface.apply_to(material) }
}

/// Positions in the environment \[m\] and rotation matrices of elements in `data`.
fn element_poses(data: &Data) -> impl Fn(Anchor) -> ([f64; 3], [f64; 9]) + '_ {
    let (positions, rotations) = (data.geom_xpos().as_chunks::<3>().0, data.geom_xmat().as_chunks::<9>().0);
    let sites = (data.site_xpos().as_chunks::<3>().0, data.site_xmat().as_chunks::<9>().0);
    move |anchor| match anchor {
        Anchor::Geom(geom) => (positions[geom], rotations[geom]),
        Anchor::Site(site) => (sites.0[site], sites.1[site]),
        Anchor::World => ([0.0; 3], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
    }
}

/// Messages about actuators with a slider-crank, whose rods only MuJoCo's viewers draw.
fn slider_cranks(model: &Model) -> impl Iterator<Item = String> + '_ {
    let cranks = |kind: &i32| mjcf_keywords::transmission(*kind) == Some("cranksite");
    model.actuator_trntype().iter().enumerate().filter(move |(_, kind)| cranks(kind)).map(|(actuator, _)| {
        let name = model.name(ObjectKind::Actuator, actuator).unwrap_or_else(|| actuator.to_string());
        format!("the rods of the slider-crank of actuator {name} are not rendered")
    })
}

impl VisualScene {
    /// Creates the scene of the geoms, tendons, skins and flexes of `model`, with the lighting of MuJoCo's renderer.
    /// All geoms of a body share one mask id. Each geom of the world, tendon, skin and flex has its own mask id.
    pub fn of_model(model: &Model) -> Self {
        Self::with_mujoco_lighting(model, &identity::by_body(model, false))
    }

    /// Creates the scene of [`of_model`](Self::of_model) with the sites of `model`, as in MuJoCo's viewers. Bodies that
    /// have only sites, and sites of the world, get additional mask ids.
    pub fn with_sites(model: &Model) -> Self {
        Self::with_mujoco_lighting(model, &identity::by_body(model, true))
    }

    fn with_mujoco_lighting(model: &Model, identities: &MaskIdMap) -> Self {
        Self::extract(
            model,
            identities,
            &Replacements::new(),
            &[],
            &SurfaceOverrides::new(),
            &Lighting::Mujoco { file: model },
        )
    }

    /// Extracts the render scene of `model`. The geoms in `replacements` are rendered as these parts. `frames` are the
    /// frames on the body axis of sensors, `painted` has additional surface properties, and `look` is the lighting.
    pub(crate) fn extract(
        model: &Model,
        identities: &MaskIdMap,
        replacements: &Replacements,
        frames: &[BodyFrame],
        painted: &SurfaceOverrides,
        look: &Lighting<'_>,
    ) -> Self {
        let surfaces = ModelMaterials::new(model, look.space());
        let mut shapes = GeomShapes::new(model);
        let mut left_out = surfaces.omitted().to_vec();
        let (geom_type, geom_data) = (model.geom_type(), model.geom_dataid());
        let (mut instances, mut anchors) = (Vec::new(), Vec::new());
        for geom in 0..model.ngeom() {
            let parts = match replacements.get(&geom) {
                Some(parts) => parts.clone(),
                None => {
                    match shapes.get(geom_type[geom], &model.geom_size()[3 * geom..3 * geom + 3], geom_data[geom]) {
                        Ok(shape) => {
                            let rgba = &model.geom_rgba()[4 * geom..4 * geom + 4];
                            let material = surfaces.of_geom(geom_type[geom], rgba, model.geom_matid()[geom]);
                            vec![VisualPart { shape, material }]
                        }
                        Err(reason) => {
                            let name = model.name(ObjectKind::Geom, geom).unwrap_or_else(|| geom.to_string());
                            left_out.push(format!("geom {name} is not rendered: {reason}"));
                            Vec::new()
                        }
                    }
                }
            };
            for VisualPart { shape, material } in parts {
                let group = u8::try_from(model.geom_group()[geom].clamp(0, 31)).unwrap_or(0);
                let visible = material.rgba[3] > 0.0;
                let ElementIdentity { mask_id, name, body } = identities.of(geom).clone();
                let material =
                    painted.get(&*name).map_or_else(|| material.clone(), |surface| surface.apply_to(material.clone()));
                let fixed = model.is_fixed(model.geom_bodyid()[geom] as usize);
                let frame_from_instance = frame_from_geom(model, geom, body.and_then(|body| frames.get(body as usize)));
                let instance = Instance {
                    shape,
                    material,
                    mask_id,
                    group,
                    visible,
                    name,
                    body,
                    fixed,
                    is_deformable: false,
                    frame_from_instance,
                };
                if let Err(reason) = instance.validate() {
                    left_out.push(format!("geom {geom} is not rendered: {reason}"));
                    continue;
                }
                instances.push(instance);
                anchors.push(Anchor::Geom(geom));
            }
        }
        let mut deforming = DeformingInstances::default();
        for (drawable, identity) in identities.drawables() {
            let ElementIdentity { mask_id, ref name, body } = *identity;
            let like = Instance { body, ..Instance::new(Plane { half: [1.0; 2] }, Material::default(), mask_id) };
            let like = Instance { name: Arc::clone(name), ..like };
            if let Err(reason) = deforming.add(model, &surfaces, drawable, &like, &mut instances) {
                left_out.push(format!("{} {name} is not rendered: {reason}", drawable.class()));
            }
            anchors.resize(instances.len(), Anchor::World);
        }
        for (site, identity) in identities.sites() {
            let rgba = &model.site_rgba()[4 * site..4 * site + 4];
            let material = surfaces.of_element(rgba, model.site_matid()[site]);
            let Some(instance) = site::instance(model, site, identity, material) else { continue };
            if let Err(reason) = instance.validate() {
                left_out.push(format!("site {site} is not rendered: {reason}"));
                continue;
            }
            instances.push(instance);
            anchors.push(Anchor::Site(site));
        }
        // Every instance was checked, but the triangles may still be too many for 31 bits.
        let mut scene = RenderScene::new(instances).unwrap_or_else(|error| {
            left_out.push(format!("the scene is not rendered: {error}"));
            anchors.clear();
            deforming = DeformingInstances::default();
            RenderScene::empty()
        });
        left_out.extend(lighting::set_lighting(model, look, &mut scene));
        left_out.extend(slider_cranks(model));
        Self {
            scene: Arc::new(scene),
            anchors,
            ids: identities.shared_table(),
            left_out,
            deforming: Arc::new(deforming),
            buffers: Arc::default(),
        }
    }

    /// Returns this scene with other instances, which do not move with geoms. The lights stay.
    fn with_instances(&self, instances: Vec<Instance>) -> Result<Self, kinetoscope_scene::RenderSceneError> {
        let scene = Arc::new(self.scene.with_instances(instances)?);
        Ok(Self {
            scene,
            anchors: Vec::new(),
            ids: Arc::clone(&self.ids),
            left_out: self.left_out.clone(),
            deforming: Arc::default(),
            buffers: Arc::default(),
        })
    }

    /// Sets the radii of lights, by their names in the model, and replaces the ambient light by the sum of the dome
    /// lights, if there are any.
    pub(crate) fn with_light_cfgs(mut self, model: &Model, lights: &[LightCfg]) -> Self {
        let scene = Arc::make_mut(&mut self.scene);
        if let Some(light) = lighting::dome_light_sum(lights) {
            scene.ambient = Hemisphere { sky: light, ground: light };
        }
        for (index, light_cfg) in lights.iter().enumerate() {
            let light = model.id(ObjectKind::Light, &light_name(index)).and_then(|light| scene.lights.get_mut(light));
            if let Some(light) = light {
                light.radius = light_cfg.radius as f32;
            }
        }
        self
    }

    /// Render scene, the same for all environments. [`scene_at`](Self::scene_at) has the current shapes of instances
    /// that [change their shape](Instance::is_deformable).
    pub fn scene(&self) -> &Arc<RenderScene> {
        &self.scene
    }

    /// Render scene with the shapes of tendons, skins and flexes in `data`; [`scene`](Self::scene) for a model without
    /// them.
    pub fn scene_at(&self, data: &Data) -> Arc<RenderScene> {
        let mut out = EnvScene(None);
        self.update_shapes(data, 0, &EnvScene(None), &mut out);
        out.0.unwrap_or_else(|| Arc::clone(&self.scene))
    }

    /// True if some shapes change from frame to frame.
    pub(crate) fn deforms(&self) -> bool {
        !self.deforming.is_empty()
    }

    /// Writes the scene of environment `env`, whose own scene is `own`, to `out` with the shapes of `data`; without
    /// deforming shapes, `out` becomes `own`. The memory of scenes without other owners is reused.
    pub(crate) fn update_shapes(&self, data: &Data, env: usize, own: &EnvScene, out: &mut EnvScene) {
        if self.deforms() {
            let scene = own.0.as_ref().unwrap_or(&self.scene);
            self.buffers.fill(&self.deforming, env, scene, data, out);
        } else {
            out.clone_from(own);
        }
    }

    /// Elements of the mask channel, in ascending order of [`MaskId::id`], the value in the channel. Values may have
    /// gaps; the background, 0, has no entry.
    pub fn mask_ids(&self) -> &Arc<[MaskId]> {
        &self.ids
    }

    /// One message for each element that is not rendered: unreadable textures, skyboxes and meshes, invalid geoms,
    /// sites, tendons, skins and flexes, signed distance fields, image-based lights, and rods of slider-cranks. If the
    /// scene has too many triangles, one message says that the scene is not rendered.
    pub fn omitted(&self) -> &[String] {
        &self.left_out
    }

    /// Copies the poses in `data` in double precision: world from instance, for each instance; the identity for
    /// instances that [change their shape](Instance::is_deformable).
    ///
    /// # Panics
    /// The slice does not have the length of the scene's instances.
    #[track_caller]
    pub fn read_poses_f64(&self, data: &Data, poses: &mut [PoseF64]) {
        assert_eq!(poses.len(), self.anchors.len(), "a slice of another scene");
        let place = element_poses(data);
        for (pose, &anchor) in poses.iter_mut().zip(&self.anchors) {
            let (translation, [r0, r1, r2, r3, r4, r5, r6, r7, r8]) = place(anchor);
            *pose = PoseF64 { rotation: [[r0, r1, r2], [r3, r4, r5], [r6, r7, r8]], translation };
        }
    }

    /// Copies the poses in `data`: world from instance, for each instance, and the lights.
    ///
    /// # Panics
    /// The slices do not have the lengths of the scene's instances and lights.
    #[track_caller]
    pub fn read_poses(&self, data: &Data, poses: &mut [PoseF32], lights: &mut [Light]) {
        assert!(
            poses.len() == self.anchors.len() && lights.len() == self.scene.lights.len(),
            "slices of another scene"
        );
        let place = element_poses(data);
        for (pose, &anchor) in poses.iter_mut().zip(&self.anchors) {
            let (translation, rotation) = place(anchor);
            let [r0, r1, r2, r3, r4, r5, r6, r7, r8] = rotation.map(|x| x as f32);
            *pose = PoseF32 {
                rotation: [[r0, r1, r2], [r3, r4, r5], [r6, r7, r8]],
                translation: translation.map(|x| x as f32),
            };
        }
        self.deforming.update_poses(data, poses);
        lighting::read(data, &self.scene.lights, lights);
    }
}
