//! A model at one instant, which can be rendered without a simulation.

use super::{MaskId, VisualScene, overview};
use crate::env::Stage;
use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list, env_mask};
use crate::manager::SimulationManager;
use crate::pattern;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{Data, Model, ObjectKind};
use kinetoscope_render::RenderRequest;
use kinetoscope_render::View;
use kinetoscope_scene::camera_fit::{CameraFit, DEFAULT_FILL, PosedScene};
use kinetoscope_scene::vector::sub;
use kinetoscope_scene::{Light, Marker, Pose, PoseF32};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::path::Path;
use std::sync::Arc;

/// Offscreen scene: a model at one instant, with its render scene, poses, lights and cameras.
#[derive(Clone, Debug)]
pub struct OffscreenScene {
    visual_scene: Arc<VisualScene>,
    poses: Vec<PoseF32>,
    lights: Vec<Light>,
    cameras: Vec<ModelCamera>,
    free_camera: FreeCamera,
    /// Viewing direction of [`first_view`](Self::first_view), in world axes.
    view_direction: [f64; 3],
}

/// Camera that a model file defines.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCamera {
    /// Name of the camera; empty if the file gives no name.
    pub name: String,
    /// Pose in the world, with ROS's optical axes (x right, y down, z forward).
    pub world_from_camera: Pose,
    /// Vertical field of view \[rad\].
    pub fovy: f64,
}

/// Viewpoint onto a model, such as the free camera of MuJoCo's viewers; +z is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeCamera {
    /// Position of the camera in the world \[m\].
    pub eye: [f64; 3],
    /// Point in the world that the camera looks at \[m\].
    pub target: [f64; 3],
    /// Vertical field of view \[rad\].
    pub fovy: f64,
    /// Depths of the near and the far clipping plane \[m\].
    pub clip: [f64; 2],
}

/// Viewing direction of first views of simulations, in world axes, as in windows: from the front, the side and above.
const DEFAULT_VIEW_DIRECTION: [f64; 3] = [-0.664, 0.608, -0.435];

impl OffscreenScene {
    /// Creates the offscreen scene of an MJCF file, with its sites, at the positions `qpos` (`None` for the file's
    /// initial positions, MuJoCo's `qpos0`).
    ///
    /// # Errors
    /// The file cannot be read, MuJoCo rejects it, or `qpos` does not have one finite number for each position of the
    /// model.
    pub fn of_mjcf(path: impl AsRef<Path>, qpos: Option<&[f64]>) -> Result<Self> {
        let path = path.as_ref();
        if let Err(error) = std::fs::metadata(path) {
            return Err(Error::File { path: path.into(), error });
        }
        let model = mj::compile_file(path)?.into_model();
        let mut data = Data::new(&model)?;
        if let Some(qpos) = qpos {
            if qpos.len() != model.nq() {
                let (found, expected) = (vec![qpos.len()], vec![model.nq()]);
                return Err(Error::Shape { argument: "qpos", found, expected, meaning: "positions of the model" });
            }
            if let Some(column) = qpos.iter().position(|q| !q.is_finite()) {
                let (item, value) = (format!("position {column}"), qpos[column]);
                return Err(Error::NotFinite { argument: "qpos", row: 0, column, item, value });
            }
            data.qpos_mut().copy_from_slice(qpos);
        }
        data.step1()?;
        let still = Self::of_data(&Arc::new(VisualScene::with_sites(&model)), &data);
        let FreeCamera { eye, target, .. } = still.free_camera;
        // The author of the file chose the viewing direction.
        Ok(Self { view_direction: sub(target, eye), ..still })
    }

    /// Creates the offscreen scene of one environment in its current state. Poses are in the frame of the environment.
    ///
    /// # Errors
    /// The environment does not exist.
    pub fn of_env(sim: &mut SimulationManager, env: EnvId) -> Result<Self> {
        env_mask(Some(&[env]), sim.num_envs())?;
        let visible = sim.scene_mut().visual_scene().with_env_scene(sim.env_scene(env));
        Ok(sim.simulation.batch.read_at(env.0, Stage::Kinematics, |env| Self::of_data(&visible, env.data())))
    }

    /// Creates the offscreen scene of several environments side by side (`None` for all environments), at
    /// [`SimulationManagerCfg::env_origins`](crate::SimulationManagerCfg::env_origins). Each marker is shown in its
    /// environment. The ground is rendered once. Lights and cameras are those of the first of the
    /// environments, moved to its origin. Everything else is rendered in every environment, so a terrain that is
    /// larger than the space between environments overlaps.
    ///
    /// # Errors
    /// An environment does not exist, or there are more triangles than can be rendered.
    pub fn overview(sim: &mut SimulationManager, envs: Option<&[EnvId]>, markers: &[(EnvId, Marker)]) -> Result<Self> {
        let envs = env_list(envs, sim.num_envs())?;
        env_list(Some(&markers.iter().map(|(env, _)| *env).collect::<Vec<_>>()), sim.num_envs())?;
        let (visible, origins) = (sim.scene_mut().visual_scene(), sim.cfg().env_origins());
        let stills: Vec<(usize, Self)> = envs
            .iter()
            .map(|&env| {
                (
                    env,
                    sim.simulation.batch.read_at(env, Stage::Kinematics, |here| {
                        let visible = visible.with_env_scene(sim.env_scene(EnvId(env)));
                        Self::of_data(&visible, here.data())
                    }),
                )
            })
            .collect();
        let places = stills.iter().map(|(env, still)| {
            let markers = markers.iter().filter(|(of, _)| of.0 == *env).map(|(_, marker)| *marker).collect();
            let origin = [0, 1, 2].map(|k| origins[(*env, k)] as f32);
            overview::OverviewEnv { origin, scene: still.visual_scene.scene(), poses: &still.poses, markers }
        });
        let (visible, poses) = overview::side_by_side(&visible, &places.collect::<Vec<_>>())?;
        let nearest = envs.first().copied().unwrap_or(0);
        let mut first = Self::of_env(sim, EnvId(nearest))?;
        let origin: [f64; 3] = [0, 1, 2].map(|k| origins[(nearest, k)]);
        for light in &mut first.lights {
            light.position = std::array::from_fn(|k| light.position[k] + origin[k] as f32);
        }
        for camera in &mut first.cameras {
            let translation = &mut camera.world_from_camera.translation.vector;
            *translation += nalgebra::Vector3::from(origin);
        }
        Ok(Self { visual_scene: Arc::new(visible), poses, ..first })
    }

    fn of_data(visible: &Arc<VisualScene>, data: &Data) -> Self {
        let visible = &visible.with_shapes_of(data);
        let scene = visible.scene();
        let mut poses = vec![PoseF32::IDENTITY; scene.instances().len()];
        let mut lights = scene.lights.clone();
        visible.read_poses(data, &mut poses, &mut lights);
        let model = data.model();
        Self {
            visual_scene: Arc::clone(visible),
            poses,
            lights,
            cameras: (0..model.ncam()).map(|camera| model_camera(data, camera)).collect(),
            free_camera: free_camera(model),
            view_direction: DEFAULT_VIEW_DIRECTION,
        }
    }

    /// Visual scene of the model, with deforming shapes at this instant.
    pub fn visible(&self) -> &Arc<VisualScene> {
        &self.visual_scene
    }

    /// Elements of the mask channel, in ascending order of [`MaskId::id`], the value in the channel. Values may have
    /// gaps; the background, 0, has no entry.
    pub fn mask_ids(&self) -> &[MaskId] {
        self.visual_scene.mask_ids()
    }

    /// Cameras of the model: those of the MJCF file, or of all MJCF files in a simulation. Camera sensors are not
    /// included.
    pub fn cameras(&self) -> &[ModelCamera] {
        &self.cameras
    }

    /// Camera of the model called `name`, one of [`cameras`](Self::cameras).
    ///
    /// # Errors
    /// The camera does not exist; the error lists the nearest names.
    pub fn camera(&self, name: &str) -> Result<&ModelCamera> {
        self.cameras.iter().find(|c| c.name == name).ok_or_else(|| Error::UnknownName {
            what: "camera",
            name: name.into(),
            candidates: pattern::closest_names(
                name,
                self.cameras.iter().map(|c| c.name.as_str()).filter(|n| !n.is_empty()),
            )
            .into_iter()
            .map(str::to_string)
            .collect(),
        })
    }

    /// Initial viewpoint of MuJoCo's viewers for the model.
    pub fn free_camera(&self) -> FreeCamera {
        self.free_camera
    }

    /// Viewpoint from which all rendered shapes, except the ground and shapes that surround the rest, fill an image of
    /// `size` pixels (width, height). The direction is that of [`free_camera`](Self::free_camera) for an MJCF file; it
    /// is from the front, the side and above for a simulation. The clipping planes leave room for other viewpoints.
    /// Without such shapes, it is [`free_camera`](Self::free_camera).
    pub fn first_view(&self, size: [usize; 2]) -> FreeCamera {
        let FreeCamera { eye, target, fovy, clip: [near, far] } = self.free_camera;
        let [width, height] = size.map(|n| n.max(1) as f64);
        let framing = CameraFit { forward: self.view_direction, fovy, aspect: width / height, fill: DEFAULT_FILL };
        let Some(placement) = framing.fit(&[self.placed()]) else {
            return FreeCamera { eye, target, fovy, clip: [near, far] };
        };
        let distance = Vector3::from(placement.eye).metric_distance(&Vector3::from(placement.target));
        let extent = placement.extent.max(distance);
        // The rendered shapes may be larger or smaller than the geoms of MuJoCo's model.
        let clip = [near.min(0.01 * placement.extent).max(1e-6), far.max(100.0 * extent)];
        FreeCamera { eye: placement.eye, target: placement.target, fovy, clip }
    }

    /// Rendered instances with their poses.
    pub fn placed(&self) -> PosedScene<'_> {
        PosedScene { scene: self.visual_scene.scene(), poses: &self.poses, origin: [0.0; 3], reach: f32::INFINITY }
    }

    /// Render request for the scene from `view`, without a lens and without a previous frame.
    pub fn render_request<'a>(&'a self, view: &'a View) -> RenderRequest<'a> {
        RenderRequest {
            scene: self.visual_scene.scene(),
            poses: &self.poses,
            view,
            lights: Some(&self.lights),
            lens: None,
            previous: None,
        }
    }
}

fn model_camera(data: &Data, camera: usize) -> ModelCamera {
    let model = data.model();
    let position = data.cam_xpos().as_chunks::<3>().0[camera];
    let m = data.cam_xmat().as_chunks::<9>().0[camera];
    // MuJoCo's cameras have OpenGL's axes: y up, looking along -z.
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&m) * flip);
    ModelCamera {
        name: model.name(ObjectKind::Camera, camera).unwrap_or_default(),
        world_from_camera: Pose::from_parts(position.into(), UnitQuaternion::from_rotation_matrix(&rotation)),
        fovy: model.cam_fovy()[camera].to_radians(),
    }
}

/// Free camera of a model: 1.5 extents away from the middle, by azimuth and elevation. Source: `mjv_defaultFreeCamera`
/// and `mjv_cameraInModel`.
fn free_camera(model: &Model) -> FreeCamera {
    let [fovy, azimuth, elevation] = model.free_camera().map(f64::to_radians);
    let (target, distance) = (model.center(), 1.5 * model.extent());
    let forward = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
    FreeCamera { eye: [0, 1, 2].map(|i| target[i] - distance * forward[i]), target, fovy, clip: model.clip_distances() }
}
