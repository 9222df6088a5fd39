//! What a camera is, before it exists.

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

/// What depth and distance say where nothing is hit between the near and the far plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DepthMiss {
    /// +inf.
    #[default]
    Inf,
    /// The depth of the far plane; the same number in the distance channel. What was hit is nearer, with noise too: by the last
    /// digit of single precision, at least (depth is, and distance behind lenses whose rays do not all go
    /// [forward](lens::Lens::is_forward)).
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
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal lengths and principal point.
    pub intrinsics: Intrinsics,
    /// The lens: which way the rays of pixels go. Lenses other than a pinhole need a renderer that follows rays.
    pub lens: lens::Lens,
    /// The size of the lens, for depth of field; `None` is a point. Needs [`Renderer::RayTraced`].
    pub aperture: Option<Aperture>,
    /// When light falls on which row, for rolling shutters and motion blur; by default a picture is of one instant. Needs
    /// [`Renderer::RayTraced`]. The first picture after a reset or after somebody wrote to the state is of one instant.
    pub shutter: Shutter,
    /// Nothing nearer is seen: smallest depth along the optical axis \[m\], or along the ray where rays of the lens do not all
    /// go forward ([`Lens::is_forward`](lens::Lens::is_forward)).
    pub near: f64,
    /// Nothing farther is seen: largest depth along the optical axis \[m\], or along the ray, as [`near`](Self::near).
    pub far: f64,
    /// Where it is.
    pub extrinsics: Extrinsics,
    /// Time between pictures \[s\]; 0 is every physics step.
    pub update_period: f64,
    /// Take the nearest whole number of physics steps where the period is none, instead of an error.
    pub round_period: bool,
    /// What it measures.
    pub channels: Channels,
    /// What depth and distance say where nothing is hit.
    pub depth_miss: DepthMiss,
    /// Which renderer draws pictures.
    pub renderer: Renderer,
    /// How pictures are drawn.
    pub raster: RasterCfg,
    /// The environments that it looks into, in this order; `None` is all of them.
    pub env_ids: Option<Vec<usize>>,
    /// Draw when somebody reads (and only then), not when the picture is due. The pictures are the same: what there is
    /// to see is kept when it is due.
    pub lazy: bool,
    /// Pictures to remember, the newest included: see [`Camera::history`](super::Camera::history). Those of a lazy camera are drawn when the
    /// history is read.
    pub history_length: usize,
    /// Physics steps from the capture of a picture until it can be read. It keeps the stamp of its capture. What somebody
    /// writes to the state of an environment is seen at once there, by every sensor: nothing stale is ever read.
    pub latency_steps: u32,
    /// Probability that a picture is lost on the way, 0 to 1: the one before stays.
    pub dropout: f64,
    /// Noise of numbers by the name of the channel, at every pixel by itself: of `depth` and `distance` \[m\], which is from
    /// `near` to `far` with it too (distance from `near` on) and leaves misses what they are, and of `color` in steps of its
    /// 8 bits, red, green and blue each by itself; results are rounded to bytes.
    ///
    /// The numbers depend on the seed of the simulation, the environment, the name of the camera, which picture it is and which
    /// pixel, and on nothing else. They are looked up: whether a camera is lazy, when somebody reads, and how many threads
    /// there are change nothing. A picture that is drawn again after a setter has the same noise again. Looking up where
    /// `bias_walk` has come to takes longer, the longer it walks: as many numbers as twice the binary digits of
    /// the count of pictures since the reset.
    pub noise: BTreeMap<String, NoiseCfg>,
    /// What is not perfect about the camera itself; it comes before [`noise`](Self::noise).
    pub imperfections: Imperfections,
    /// Show where it is and what it sees: its frame, and an arrow along each edge of the picture's pyramid
    /// ([`Sensor::markers`](crate::Sensor::markers)).
    pub debug_vis: bool,
    /// Draw what the other sensors show people into the channel `color`, which is otherwise as without: ray hits, forces of
    /// contacts, frames, what cameras see ([`SensorCfg::debug_vis`](crate::SensorCfg::debug_vis) says for each whether it shows
    /// anything). All other channels stay what they are. Markers are what each sensor had measured last at
    /// the instant of the picture (of cameras that draw markers and were added later, at the instant before), things are in front of them and behind them, and they cast
    /// shadows; every renderer draws them.
    pub draw_markers: bool,
}

impl Default for CameraCfg {
    /// EmbodiChain's camera: 640 x 480 pixels, f = 600 pixels ([`Intrinsics::EMBODICHAIN`]: what other sizes see is the
    /// same), from 5 mm to 100 m, colour only. Geom groups 0, 1 and 2 are
    /// drawn, as in MuJoCo's own viewers.
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
