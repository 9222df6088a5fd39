//! Six-axis force and torque in joints.

use crate::error::SensorError;
use crate::sampling::{Channel, Sampled, Sampler, SamplingCfg};
use crate::select::select;
use crate::sensor::{Requires, Sensor, SensorCfg, SensorContext};
use ndarray::ArrayView3;
use scene::SceneState;
use serde::{Deserialize, Serialize};

/// Configuration of a [`JointWrench`] sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointWrenchCfg {
    /// The links whose joints are measured, by patterns of their names (`uid/link`, or `link` alone), in the order they are
    /// reported. Links that fixed joints fuse to others have no joint that could be measured.
    pub links: Vec<String>,
    /// Rate, history, latency and noise; the channels are `forces` and `torques`.
    pub sampling: SamplingCfg,
}

/// What the joint of each link exerts on it, in all environments: the force and the torque with which its parent holds,
/// carries and drives it. N environments, B links.
///
/// Both are in the axes of the link, and about its origin: the frame of the joint on the side of the child, as URDF defines
/// it. The sign is that of what acts **on the link**: a load that hangs from its joint reads a force of its weight, upwards.
/// Gravity and contacts of the link are not part of it, what they need to be held is; the drive's effort is part of it,
/// along the axis of the joint. For the root of a fixed robot it is what the world holds the robot with; it is 0 for what
/// floats freely.
#[derive(Clone, Debug)]
pub struct JointWrench {
    links: Vec<usize>,
    names: Vec<String>,
    sampler: Sampler,
}

impl SensorCfg for JointWrenchCfg {
    type Sensor = JointWrench;

    fn requires(&self) -> Requires {
        Requires::JOINT_WRENCHES
    }

    /// # Errors
    ///
    /// A pattern that matches nothing, a link that is fused to another one (the error names it), and what is wrong with the
    /// sampling.
    fn build(&self, context: &SensorContext) -> Result<JointWrench, SensorError> {
        let links = select(&self.links, &context.bodies, "link")?;
        for &link in &links {
            if let Some(&carrier) = context.carriers.get(link).filter(|&&carrier| carrier != link) {
                let (link, carrier) = (context.bodies[link].clone(), context.bodies[carrier].clone());
                return Err(SensorError::FusedLink { link, carrier });
            }
        }
        let channels = ["forces", "torques"].map(|name| Channel::new(name, 3 * links.len()));
        Ok(JointWrench {
            names: links.iter().map(|&link| context.bodies[link].clone()).collect(),
            links,
            sampler: Sampler::new("joint wrench", self.requires(), context, &self.sampling, &channels)?,
        })
    }
}

/// Writes what the sensor measures in environment `env` to `row`.
fn read(links: &[usize], state: &SceneState, env: usize, row: &mut [f64]) {
    let Some(wrenches) = &state.joint_wrenches else { return };
    let part = |first| links.iter().flat_map(move |&link| (first..first + 3).map(move |k| wrenches[(env, link, k)]));
    row.iter_mut().zip(part(0).chain(part(3))).for_each(|(number, value)| *number = value);
}

impl Sensor for JointWrench {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| read(&self.links, state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| read(&self.links, state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| read(&self.links, state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }
}

impl Sampled for JointWrench {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }
}

impl JointWrench {
    /// Names of the links, in the order of the axis B.
    pub fn link_names(&self) -> &[String] {
        &self.names
    }

    /// Forces on the links through their joints \[N\], in the axes of each link, shape (N, B, 3).
    pub fn forces(&self) -> ArrayView3<'_, f64> {
        self.sampler.values_as("forces", (self.sampler.num_envs(), self.links.len(), 3))
    }

    /// Torques on the links through their joints \[N m\], about the origin and in the axes of each link, shape (N, B, 3).
    pub fn torques(&self) -> ArrayView3<'_, f64> {
        self.sampler.values_as("torques", (self.sampler.num_envs(), self.links.len(), 3))
    }
}
