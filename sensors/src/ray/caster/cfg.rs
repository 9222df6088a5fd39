//! Ray caster configuration.

use super::RayAlignment;
use super::sensor::RayCaster;
use crate::error::SensorError;
use crate::ray::pattern::Grid;
use crate::ray::sampler::{RaySampler, RaySamplerCfg, check_memory};
use crate::ray::{HitTargets, RayError, RayPattern};
use crate::sampling::{SampleChannel, SamplingCfg};
use crate::schedule::Schedule;
use crate::sensor::{SensorCfg, SensorContext};
use kinetoscope_scene::Ray;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{Pose, PoseF64};
use serde::{Deserialize, Serialize};

/// Memory per ray \[bytes\]: a hit of 40 bytes; twice five numbers of the sampler; point, id and mask.
const BYTES_PER_RAY: usize = 40 + 80 + 32;

/// Configuration of a [`RayCaster`].
///
/// The height scanner of Isaac's tutorials, 20 m above its robot so that it sees the ground from above:
///
/// ```
/// use kinetoscope_scene::Pose;
/// use kinetoscope_sensors::ray::pattern::Grid;
/// use kinetoscope_sensors::ray::{HitTargets, RayAlignment, RayCasterCfg};
/// use kinetoscope_sensors::SamplingCfg;
///
/// let scanner = RayCasterCfg {
///     parent: Some("anymal/base".into()),
///     offset: Pose::translation(0.0, 0.0, 20.0),
///     alignment: RayAlignment::Yaw,
///     pattern: Grid { resolution: 0.1, size: [1.6, 1.0], ..Grid::default() }.into(),
///     targets: HitTargets::Named(vec!["ground".into()]),
///     sampling: SamplingCfg::every(0.02),
///     ..RayCasterCfg::default()
/// };
/// assert_eq!(scanner.pattern.rays()?.len(), 187);
/// # Ok::<(), kinetoscope_sensors::SensorError>(())
/// ```
///
/// For rays within about 7° of an axis of a mesh, a lookup structure is built once for each mesh and axis, when such
/// rays are first cast. It allocates memory, mostly at the reset right after the sensor is built, but also in a later
/// step if rays or meshes rotate to another axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RayCasterCfg {
    /// Body that the rays move with: `uid/link`, the link alone if only one body has this name, or the uid of an
    /// object. A link that fixed joints fuse to another link is allowed. `None` is the frame of the environment.
    pub parent: Option<String>,
    /// Pose of the pattern in the frame of the body as [aligned](RayAlignment); the pose rotates both origins and
    /// directions.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub offset: Pose,
    /// Alignment of the rays with the body; without effect if `parent` is `None`.
    pub alignment: RayAlignment,
    /// Pattern of the rays, x forward, y left, z up in its own frame.
    pub pattern: RayPattern,
    /// Maximum distance of a hit from the start of its ray \[m\], above 0; may be infinite. Surfaces farther away are
    /// misses.
    pub max_distance: f64,
    /// Smallest and largest position drift \[m\]: an offset along each axis of the environment frame, sampled uniformly
    /// and independently at every reset.
    pub drift: [f64; 2],
    /// Targets of the rays.
    pub targets: HitTargets,
    /// Geom groups of the targets: bit k is group k. MuJoCo's viewers show the first three; collision shapes are
    /// usually in group 3 or above.
    pub groups: u32,
    /// Rate, history, latency, dropout and noise. The channels are `distances`, `normals`, `ids`, `pos_w` and `quat_w`,
    /// of which only `distances` can have noise. Points lie on the ray at the noisy distance, which is clamped to the
    /// range from 0 to `max_distance`; misses stay misses.
    pub sampling: SamplingCfg,
    /// Shows a red ball at every hit ([`Sensor::markers`](crate::Sensor::markers)).
    pub debug_vis: bool,
}

impl Default for RayCasterCfg {
    /// A grid of 17 by 11 rays straight down from the origin of the sensor, up to 1000 km long, at all instances of
    /// geom groups 0, 1 and 2 except the parent body.
    fn default() -> Self {
        Self {
            parent: None,
            offset: Pose::identity(),
            alignment: RayAlignment::default(),
            pattern: Grid::default().into(),
            max_distance: 1e6,
            drift: [0.0; 2],
            targets: HitTargets::default(),
            groups: 0b111,
            sampling: SamplingCfg::default(),
            debug_vis: false,
        }
    }
}

impl SensorCfg for RayCasterCfg {
    type Sensor = RayCaster;

    /// Poses of instances; body poses only if the sensor is attached to a body.
    fn requires(&self) -> StateFields {
        if self.parent.is_some() { StateFields::INSTANCES | StateFields::POSES } else { StateFields::INSTANCES }
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// Creates the ray caster.
    ///
    /// # Errors
    ///
    /// An invalid pattern, distance, offset or drift; an unknown parent or target; a period that is not a whole number
    /// of steps or another invalid sampling parameter; rays that do not fit into memory.
    fn build(&self, context: &SensorContext) -> Result<RayCaster, SensorError> {
        let parent = self.parent.as_deref().map(|name| context.body(name)).transpose()?;
        let number = |what, value, allowed| RayError::Number { what, owner: "ray caster", value, allowed };
        if self.max_distance.is_nan() || self.max_distance <= 0.0 {
            return Err(number("max_distance", self.max_distance, "positive").into());
        }
        let [low, high] = self.drift;
        if !(low <= high && low.is_finite() && high.is_finite()) {
            let wrong = if low.is_finite() { high } else { low };
            return Err(number("a bound of the drift", wrong, "finite, the smaller one first").into());
        }
        let offset = PoseF64::from(&self.offset);
        if !offset.is_finite() || (self.offset.rotation.norm() - 1.0).abs() > 1e-6 {
            let wrong = self.offset.translation.vector.iter().chain(self.offset.rotation.coords.iter());
            let wrong = wrong.copied().find(|x| !x.is_finite()).unwrap_or(self.offset.rotation.norm());
            return Err(number("a number of the offset", wrong, "finite, and its quaternion of length 1").into());
        }
        // A pattern with too many rays is rejected by `rays` below, on every machine.
        if self.pattern.count() <= RayPattern::MAX_RAYS {
            check_memory(context.num_envs, self.pattern.count(), BYTES_PER_RAY)?;
        }
        let rays: Vec<Ray> = self.pattern.rays()?.into_iter().map(|ray| ray.transformed_by(&offset)).collect();
        let cfg = RaySamplerCfg {
            kind: "ray caster",
            requires: self.requires(),
            sampling: &self.sampling,
            targets: &self.targets,
            groups: self.groups,
            parent,
            rays,
            max_distance: self.max_distance,
            frame_channels: &[
                SampleChannel::noiseless("pos_w", 3).with_unit("m"),
                SampleChannel::noiseless("quat_w", 4),
            ],
        };
        Ok(RayCaster::new(self, context, RaySampler::new(cfg, context)?, parent))
    }
}
