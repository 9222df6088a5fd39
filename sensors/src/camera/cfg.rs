//! Camera configuration.

use super::extrinsics::Extrinsics;
use super::imperfection::Imperfections;
use crate::noise::NoiseCfg;
use kinetoscope_render::Aperture;
use kinetoscope_render::Intrinsics;
use kinetoscope_render::RasterCfg;
use kinetoscope_render::Renderer;
use kinetoscope_render::Shutter;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Value of depth and distance where nothing is hit between the near and the far plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DepthMiss {
    /// +inf.
    #[default]
    Inf,
    /// Depth of the far plane; the same number in the distance channel. Hits are always nearer, also with noise, by at
    /// least one step of single precision. This holds for depth, and for distance if rays of the lens do not all go
    /// [forward](lens::Lens::is_forward).
    Far,
    /// 0.
    Zero,
}

/// Configuration of a [`Camera`](super::Camera).
///
/// ```
/// use kinetoscope_sensors::camera::{CameraCfg, Extrinsics, Placement};
/// use kinetoscope_render::frame::Channels;
/// use kinetoscope_render::Intrinsics;
///
/// let cfg = CameraCfg {
///     width: 320,
///     height: 240,
///     intrinsics: Intrinsics::Fovy { radians: 0.9 },
///     extrinsics: Extrinsics {
///         placement: Placement::LookAt { eye: [1.5, 0.0, 1.0], target: [0.0; 3], up: [0.0, 0.0, 1.0] },
///         ..Extrinsics::default()
///     },
///     channels: Channels::from_names(&["rgb", "distance_to_image_plane"])?,
///     ..CameraCfg::default()
/// };
/// assert!(cfg.channels.color && cfg.channels.depth);
/// # Ok::<(), kinetoscope_sensors::SensorError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraCfg {
    /// Image width \[pixels\].
    pub width: usize,
    /// Image height \[pixels\].
    pub height: usize,
    /// Focal lengths and principal point.
    pub intrinsics: Intrinsics,
    /// Lens: mapping between pixels and ray directions. A lens other than the pinhole needs a renderer other than
    /// [`Renderer::Raster`].
    pub lens: lens::Lens,
    /// Aperture of the lens, for depth of field; `None` is a point. Needs [`Renderer::RayTraced`].
    pub aperture: Option<Aperture>,
    /// Exposure and readout times, for motion blur and rolling shutters; by default an image shows one instant. Needs
    /// [`Renderer::RayTraced`]. The image of a reset or of a write to the state shows one instant.
    pub shutter: Shutter,
    /// Near limit: smallest depth along the optical axis \[m\], above 0. If rays of the lens do not all go forward
    /// ([`Lens::is_forward`](lens::Lens::is_forward)), smallest distance along the ray.
    pub near: f64,
    /// Far limit: largest depth along the optical axis \[m\], above [`near`](Self::near) and finite. For lenses whose
    /// rays do not all go forward, largest distance along the ray, as for `near`.
    pub far: f64,
    /// Pose of the camera, and the body that it is attached to.
    pub extrinsics: Extrinsics,
    /// Time between images \[s\]; 0 is every physics step.
    pub update_period: f64,
    /// Rounds a period that is not a whole number of physics steps to the nearest one, instead of returning an error.
    pub round_period: bool,
    /// Measured channels.
    pub channels: Channels,
    /// Value of depth and distance where nothing is hit.
    pub depth_miss: DepthMiss,
    /// Renderer of the images.
    pub renderer: Renderer,
    /// Render settings: samples per pixel, shadows, tone curve, geom groups and others.
    pub raster: RasterCfg,
    /// Environments that the camera renders, in the order of the first axis of its arrays; `None` is all environments.
    /// No index may repeat.
    pub env_ids: Option<Vec<usize>>,
    /// If true, an image is rendered when it is read, and only then; if false, when it is due. The images are the same,
    /// because the state is captured when the image is due.
    pub lazy: bool,
    /// Number of images in the history, the newest included: see [`Camera::history`](super::Camera::history). A lazy
    /// camera renders them when the history is read.
    pub history_length: usize,
    /// Latency in physics steps, from the capture of an image until it can be read. The image keeps the stamp of its
    /// capture. All sensors see a write to the state of an environment at once: outdated values are never read.
    pub latency_steps: u32,
    /// Probability that a scheduled image is lost, 0 to 1: the previous image stays, and the lost image is neither
    /// counted nor added to the history. The images of a reset or a write to the state are never lost.
    pub dropout: f64,
    /// Noise by channel name, for `color`, `depth` and `distance`, independent at every pixel. Noise of `depth` and
    /// `distance` is in \[m\]: depth stays from `near` to `far` (from -`far` to `far` if rays of the lens do not all go
    /// forward), distance stays at least `near`, and misses stay misses. Noise of `color` is in steps of its 8 bits,
    /// independent for red, green and blue; results are rounded to bytes.
    ///
    /// The random numbers depend only on the seed of the simulation, the environment, the camera name, the image index
    /// and the pixel. They are computed from these keys, so laziness, the time of reading and the number of threads do
    /// not change them. An image that is rendered again after a setter has the same noise again. The cost of
    /// `bias_walk` grows with the image count n since the reset: it needs as many random numbers as twice the binary
    /// digits of n.
    pub noise: BTreeMap<String, NoiseCfg>,
    /// Imperfections of the camera itself; applied before [`noise`](Self::noise).
    pub imperfections: Imperfections,
    /// Shows the camera's frame and an arrow along each edge of its view frustum
    /// ([`Sensor::markers`](crate::Sensor::markers)).
    pub debug_vis: bool,
    /// Renders the markers of other sensors into the channel `color`: ray hits, contact forces, frames, view frustums.
    /// A sensor whose markers are off ([`SensorCfg::debug_vis`](crate::SensorCfg::debug_vis)) adds none. All other
    /// channels stay the same.
    ///
    /// Markers show the last measurement of each sensor at the instant of the image. Markers of cameras that render
    /// markers themselves and were added later show the instant before. Objects and markers occlude each other, and
    /// markers cast shadows; every renderer supports them.
    pub draw_markers: bool,
}

impl Default for CameraCfg {
    /// EmbodiChain's camera: 640 x 480 pixels, from 5 mm to 100 m, color only. f = 600 pixels; other sizes see the same
    /// ([`Intrinsics::EMBODICHAIN`]). Geom groups 0, 1 and 2 are rendered, as in MuJoCo's viewers.
    fn default() -> Self {
        Self {
            width: 640,
            height: 480,
            intrinsics: Intrinsics::EMBODICHAIN,
            lens: lens::Lens::default(),
            aperture: None,
            shutter: Shutter::default(),
            near: 0.005,
            far: 100.0,
            extrinsics: Extrinsics::default(),
            update_period: 0.0,
            round_period: false,
            channels: Channels { color: true, ..Channels::default() },
            depth_miss: DepthMiss::Inf,
            renderer: Renderer::default(),
            raster: RasterCfg::default(),
            env_ids: None,
            lazy: true,
            history_length: 0,
            latency_steps: 0,
            dropout: 0.0,
            noise: BTreeMap::new(),
            imperfections: Imperfections::default(),
            debug_vis: false,
            draw_markers: false,
        }
    }
}
