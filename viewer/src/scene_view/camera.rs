//! Camera sensors of every kind and their views.

use kinetoscope_render::View;
use kinetoscope_render::lens::Lens;
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::{Marker, PoseF32};
use kinetoscope_sensors::camera::{Camera, CameraConvention, StereoCamera};
use kinetoscope_sensors::ray::RayCasterCamera;
use kinetoscope_sim::{EnvId, SensorId, SimulationManager};

/// View of a camera sensor in one environment.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraView {
    /// Pose in the environment frame and pinhole intrinsics, at the time of the last measurement.
    pub view: View,
    /// Lens model that bends the rays; a pinhole by default.
    pub lens: Lens,
    /// Markers of other sensors that are rendered into the color image; empty unless the camera's configuration enables
    /// them.
    pub markers: Vec<Marker>,
}

/// Handle of a camera sensor, or of one camera of a stereo pair.
#[derive(Clone, Copy, Debug)]
pub(super) enum CameraId {
    Camera(SensorId<Camera>),
    Left(SensorId<StereoCamera>),
    Right(SensorId<StereoCamera>),
    RayCaster(SensorId<RayCasterCamera>),
}

/// Clip range of images from ray-caster cameras \[m\].
const RAY_CASTER_CLIP: [f32; 2] = [0.01, 1000.0];

/// Returns all cameras with their names. The cameras of a stereo pair are named `NAME/left` and `NAME/right`.
pub(super) fn cameras(sim: &SimulationManager) -> Vec<(String, CameraId)> {
    let cameras = sim.entities().sensor_ids::<Camera>().into_iter().map(|(name, id)| (name, CameraId::Camera(id)));
    let stereo = sim.entities().sensor_ids::<StereoCamera>().into_iter().flat_map(|(name, id)| {
        [(format!("{name}/left"), CameraId::Left(id)), (format!("{name}/right"), CameraId::Right(id))]
    });
    let rays =
        sim.entities().sensor_ids::<RayCasterCamera>().into_iter().map(|(name, id)| (name, CameraId::RayCaster(id)));
    cameras.chain(stereo).chain(rays).collect()
}

/// Returns the number of cameras.
pub(super) fn count(sim: &SimulationManager) -> usize {
    let pairs = sim.entities().sensor_ids::<StereoCamera>().len();
    sim.entities().sensor_ids::<Camera>().len() + 2 * pairs + sim.entities().sensor_ids::<RayCasterCamera>().len()
}

impl CameraId {
    /// Returns the view in each environment, or `None` where the camera does not observe the environment or has not
    /// measured yet.
    pub(super) fn views(self, sim: &SimulationManager) -> Vec<Option<CameraView>> {
        let envs = sim.num_envs();
        match self {
            Self::Camera(id) => sim.sensor(id).map_or_else(
                |_| vec![None; envs],
                |camera| camera_views(camera, envs, || sim.scene().markers_except(id)),
            ),
            Self::Left(id) => sim.sensor(id).map_or_else(
                |_| vec![None; envs],
                |pair| camera_views(pair.left(), envs, || sim.scene().markers_except(id)),
            ),
            Self::Right(id) => sim.sensor(id).map_or_else(
                |_| vec![None; envs],
                |pair| camera_views(pair.right(), envs, || sim.scene().markers_except(id)),
            ),
            Self::RayCaster(id) => {
                sim.sensor(id).map_or_else(|_| vec![None; envs], |camera| ray_caster_views(camera, envs))
            }
        }
    }
}

fn camera_views(camera: &Camera, envs: usize, markers: impl Fn() -> Vec<(EnvId, Marker)>) -> Vec<Option<CameraView>> {
    let lens = camera.lens();
    let view = |env: usize| Some(CameraView { view: camera.view(env).ok()?, lens, markers: Vec::new() });
    let mut views: Vec<Option<CameraView>> = (0..envs).map(view).collect();
    if camera.renders_markers() {
        for (EnvId(env), marker) in markers() {
            views[env].iter_mut().for_each(|view| view.markers.push(marker));
        }
    }
    views
}

fn ray_caster_views(camera: &RayCasterCamera, envs: usize) -> Vec<Option<CameraView>> {
    let (poses, lenses) = (camera.pose_w(CameraConvention::Ros), camera.intrinsic_matrices());
    let (height, width) = camera.image_shape();
    let [near, far] = RAY_CASTER_CLIP;
    let view = |env: usize| {
        let row: [f64; 7] = std::array::from_fn(|k| poses[(env, k)]);
        let world_from_camera = PoseF32::from(&row.iter().all(|x| x.is_finite()).then(|| from_row(&row))?);
        let [fx, fy, cx, cy] = [(0, 0), (1, 1), (0, 2), (1, 2)].map(|(row, column)| lenses[(env, row, column)] as f32);
        let view = View { parallel: false, width, height, fx, fy, cx, cy, near, far, world_from_camera };
        view.validate().ok()?;
        Some(CameraView { view, lens: Lens::default(), markers: Vec::new() })
    };
    (0..envs).map(view).collect()
}
