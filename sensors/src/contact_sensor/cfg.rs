//! Contact sensor configuration.

use super::air_time::ContactTimers;
use super::pairs::{MeasurementLayout, Pairs, value_count};
use super::sensor::ContactSensor;
use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampler, SamplingCfg, Stamp};
use crate::schedule::Schedule;
use crate::select::{matching, select};
use crate::sensor::{SensorCfg, SensorContext};
use kinetoscope_scene::StateFields;
use serde::{Deserialize, Serialize};

/// Configuration of a [`ContactSensor`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactSensorCfg {
    /// Name patterns of the bodies to watch (`uid/link`, `link` alone, or the uid of an object), in the order they are
    /// reported. Links that are fused to others, such as feet behind a fixed joint, are separate bodies here.
    pub bodies: Vec<String>,
    /// Filters: groups of counterpart bodies, one name pattern each, for [`ContactSensor::force_matrix_w`]. The names
    /// `ground` and `world` stand for everything that belongs to the world: the ground plane, terrain, and the world
    /// geoms of MJCF files. Static objects have their own uid. Filters do not affect net forces, which include every
    /// contact.
    pub filters: Vec<String>,
    /// Reports the positions and orientations of the bodies.
    pub track_pose: bool,
    /// Reports air and contact times. Contact is then checked in every physics step, whatever the period, and the
    /// sensor is never lazy.
    pub track_air_time: bool,
    /// Reports the mean contact point of each body, and of each body with each filter.
    pub track_contact_points: bool,
    /// Reports friction forces by filter, for [`ContactSensor::friction_matrix_w`]; needs `filters`. The sum over all
    /// counterparts is always reported.
    pub track_friction_forces: bool,
    /// Contact threshold of air times and markers \[N\]: a body is in contact if the norm of its net normal force
    /// exceeds the threshold. Opposite forces cancel in the net force.
    pub force_threshold: f64,
    /// Rate, history, latency, dropout and noise. Channels that can have noise: `net_forces_w`, `friction_forces_w`,
    /// `total_forces_w`, `force_matrix_w`, and, where they are tracked, `friction_matrix_w`, `contact_points_w`,
    /// `contact_point_matrix_w` and `pos_w`. Air times follow from forces without noise.
    pub sampling: SamplingCfg,
    /// Shows a red ball and an arrow of the net normal force, 1 m for 500 N, at every body in contact, and a green ball
    /// at every other body ([`Sensor::markers`](crate::Sensor::markers)). The forces are those of the last measurement,
    /// at the current positions of the bodies.
    pub debug_vis: bool,
}

impl Default for ContactSensorCfg {
    /// No bodies, a contact threshold of 1 N, and no optional quantities.
    fn default() -> Self {
        Self {
            bodies: Vec::new(),
            filters: Vec::new(),
            track_pose: false,
            track_air_time: false,
            track_contact_points: false,
            track_friction_forces: false,
            force_threshold: 1.0,
            sampling: SamplingCfg::default(),
            debug_vis: false,
        }
    }
}

impl ContactSensorCfg {
    /// Watches the bodies that one pattern matches.
    pub fn for_bodies(pattern: impl Into<String>) -> Self {
        Self { bodies: vec![pattern.into()], ..Self::default() }
    }
}

impl SensorCfg for ContactSensorCfg {
    type Sensor = ContactSensor;

    fn requires(&self) -> StateFields {
        if self.track_pose { StateFields::CONTACTS | StateFields::POSES } else { StateFields::CONTACTS }
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt).filter(|_| !self.track_air_time)
    }

    /// # Errors
    ///
    /// - An empty selection of bodies.
    /// - A pattern that is not a regular expression or matches nothing, or a body that two patterns of `bodies` match.
    /// - A filter that matches only the single watched body, or friction by filter without filters.
    /// - A threshold that is negative or not finite, or an invalid sampling configuration.
    fn build(&self, context: &SensorContext) -> Result<ContactSensor, SensorError> {
        let bodies = select(&self.bodies, &context.bodies, "body")?;
        if bodies.is_empty() {
            let candidates = context.bodies.iter().take(kinetoscope_scene::pattern::MAX_CANDIDATES).cloned().collect();
            return Err(SensorError::NoBodies { candidates });
        }
        if !(self.force_threshold >= 0.0 && self.force_threshold.is_finite()) {
            let (field, value) = ("force_threshold".into(), self.force_threshold);
            return Err(SensorError::OutOfRange { field, value, expected: "it must be finite and at least 0 N" });
        }
        if self.track_friction_forces && self.filters.is_empty() {
            return Err(SensorError::NoFilters { field: "track_friction_forces", total_channel: "friction_forces_w" });
        }
        let groups =
            self.filters.iter().map(|filter| filter_group(filter, &bodies, context)).collect::<Result<Vec<_>, _>>()?;
        let (b, m) = (bodies.len(), groups.len());
        let layout = MeasurementLayout {
            bodies: b,
            groups: m,
            friction: self.track_friction_forces,
            points: self.track_contact_points,
            poses: self.track_pose,
            air: self.track_air_time,
        };
        let vectors = |name, count, unit| SampleChannel::new(name, 3 * count).with_unit(unit).with_stamp(Stamp::Force);
        let counts = |name, count| SampleChannel::noiseless(name, count).with_stamp(Stamp::Force);
        let mut channels = ["net_forces_w", "friction_forces_w", "total_forces_w"].map(|c| vectors(c, b, "N")).to_vec();
        channels.push(vectors("force_matrix_w", b * m, "N"));
        if layout.friction {
            channels.push(vectors("friction_matrix_w", b * m, "N"));
        }
        if layout.points {
            channels.extend([vectors("contact_points_w", b, "m"), counts("contact_counts", b)]);
            let by_filter = [vectors("contact_point_matrix_w", b * m, "m"), counts("contact_count_matrix", b * m)];
            channels.extend(by_filter);
        }
        if layout.poses {
            channels
                .extend([SampleChannel::new("pos_w", 3 * b).with_unit("m"), SampleChannel::noiseless("quat_w", 4 * b)]);
        }
        if layout.air {
            channels.extend(ContactTimers::CHANNELS.map(|(name, unit)| counts(name, b).with_unit(unit)));
        }
        assert_eq!(channels.iter().map(|c| c.width).sum::<usize>(), value_count(&layout));
        Ok(ContactSensor {
            names: bodies.iter().map(|&body| context.bodies[body].clone()).collect(),
            filters: self.filters.clone(),
            air: self.track_air_time.then(|| ContactTimers::new(context.num_envs, b, context.dt, self.force_threshold)),
            pairs: Pairs::new(layout, bodies, &groups, context.bodies.len()),
            sampler: Sampler::new("contact", self.requires(), context, &self.sampling, &channels)?,
            threshold: self.force_threshold,
        })
    }
}

/// Returns the bodies that a filter matches, as indices of the body axis; the length of the axis stands for the world.
/// A filter that matches nothing, or just the one sensed body, is an error.
fn filter_group(filter: &str, bodies: &[usize], context: &SensorContext) -> Result<Vec<usize>, SensorError> {
    let world = context.bodies.len();
    let mut names = context.bodies.to_vec();
    names.extend(["ground".to_string(), "world".to_string()]);
    let mut found = matching(filter, &names, "body")?;
    found.iter_mut().for_each(|index| *index = (*index).min(world));
    found.dedup();
    if found == bodies && found.len() == 1 {
        return Err(SensorError::SelfFilter { body: context.bodies[found[0]].clone(), filter: filter.into() });
    }
    Ok(found)
}
