//! Inertial measurement units (IMU).

use crate::body_state::{check_offset, pose, vector, write_front};
use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampled, Sampler, SamplingCfg, Stamp};
use crate::schedule::Schedule;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::pose::{from_row, to_wxyz};
use kinetoscope_scene::{Marker, Pose, SceneState};
use nalgebra::Vector3;
use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Configuration of an [`Imu`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuCfg {
    /// Body that the IMU is fixed to: `uid/link`, the link alone if only one body has this name, or the uid of an
    /// object.
    pub body: String,
    /// Pose of the IMU in the frame of the body.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub offset: Pose,
    /// Bias added to the acceleration \[m/s²\], in world axes; `None` is minus the gravity of the simulation, as a real
    /// IMU measures at rest.
    #[serde(with = "kinetoscope_scene::file_format::optional_vector")]
    pub gravity_bias: Option<Vector3<f64>>,
    /// Rate, history, latency, dropout and noise; channels that can have noise: `pos_w`, `lin_vel_b`, `ang_vel_b`,
    /// `lin_acc_b`, `ang_acc_b`.
    pub sampling: SamplingCfg,
    /// Shows the IMU frame, and an arrow of the measured acceleration with the gravity bias, 1 m for 20 m/s²
    /// ([`Sensor::markers`]).
    pub debug_vis: bool,
}

impl ImuCfg {
    /// Creates an IMU at the origin of a body.
    pub fn on(body: impl Into<String>) -> Self {
        Self { body: body.into(), ..Self::default() }
    }
}

impl Default for ImuCfg {
    /// No offset and an empty body name, which must be set.
    fn default() -> Self {
        let sampling = SamplingCfg::default();
        Self { body: String::new(), offset: Pose::identity(), gravity_bias: None, sampling, debug_vis: false }
    }
}

/// Pose, velocities and accelerations of a frame that is fixed to a body, in all environments.
///
/// All values refer to one instant, [`Sampled::force_stamps`]. A physics step computes the acceleration for the state
/// at its beginning, so after a step this instant is the beginning of that step. The acceleration is the engine's own,
/// not a difference of velocities, so neither the period nor a reset affects it.
#[derive(Clone, Debug)]
pub struct Imu {
    /// Name of the body.
    body: String,
    frame: ImuFrame,
    sampler: Sampler,
}

#[derive(Clone, Debug)]
struct ImuFrame {
    body: usize,
    body_from_imu: Pose,
    gravity_bias: Vector3<f64>,
}

impl SensorCfg for ImuCfg {
    type Sensor = Imu;

    fn requires(&self) -> StateFields {
        StateFields::ACCELERATIONS
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// Builds the IMU.
    ///
    /// # Errors
    ///
    /// An unknown body, an offset that is not a pose, a bias that is not finite, or an invalid sampling configuration.
    fn build(&self, context: &SensorContext) -> Result<Imu, SensorError> {
        let body = context.body(&self.body)?;
        let gravity_bias = self.gravity_bias.unwrap_or(-context.gravity);
        check_offset("offset", &self.offset)?;
        if let Some(&value) = gravity_bias.iter().find(|x| !x.is_finite()) {
            let field = "gravity_bias".into();
            return Err(SensorError::OutOfRange { field, value, expected: "every number must be finite" });
        }
        let channels = [
            SampleChannel::new("pos_w", 3).with_unit("m"),
            SampleChannel::noiseless("quat_w", 4),
            SampleChannel::new("lin_vel_b", 3).with_unit("m/s"),
            SampleChannel::new("ang_vel_b", 3).with_unit("rad/s"),
            SampleChannel::new("lin_acc_b", 3).with_unit("m/s²"),
            SampleChannel::new("ang_acc_b", 3).with_unit("rad/s²"),
        ]
        .map(|channel| channel.with_stamp(Stamp::Force));
        Ok(Imu {
            body: context.bodies[body].clone(),
            frame: ImuFrame { body, body_from_imu: self.offset, gravity_bias },
            sampler: Sampler::new("imu", self.requires(), context, &self.sampling, &channels)?,
        })
    }
}

impl ImuFrame {
    /// Writes the measurement of environment `env` to `row`.
    fn read(&self, state: &SceneState, env: usize, row: &mut [f64]) {
        let (Some(poses), Some(velocities), Some(accelerations)) =
            (&state.force_poses, &state.force_velocities, &state.body_accelerations)
        else {
            return;
        };
        let world_from_body = pose(poses, env, self.body);
        let world_from_imu = world_from_body * self.body_from_imu;
        let arm = world_from_body.rotation * self.body_from_imu.translation.vector;
        let angular_velocity = vector(velocities, env, self.body, 3);
        let angular_acceleration = vector(accelerations, env, self.body, 3);
        // Velocity and acceleration of another point of the same rigid body.
        let velocity = vector(velocities, env, self.body, 0) + angular_velocity.cross(&arm);
        let acceleration = vector(accelerations, env, self.body, 0)
            + angular_acceleration.cross(&arm)
            + angular_velocity.cross(&angular_velocity.cross(&arm));
        let mut row = write_front(row, world_from_imu.translation.vector.as_slice());
        row = write_front(row, &to_wxyz(&world_from_imu.rotation));
        for world in [velocity, angular_velocity, acceleration + self.gravity_bias, angular_acceleration] {
            row = write_front(row, world_from_imu.rotation.inverse_transform_vector(&world).as_slice());
        }
    }
}

impl Sensor for Imu {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| self.frame.read(state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| self.frame.read(state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| self.frame.read(state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// The IMU frame, and an arrow of the measured acceleration with the gravity bias, 1 m for 20 m/s². With the
    /// default bias, the arrow points upward at rest.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let (p, q, a) = (self.pos_w(), self.quat_w(), self.lin_acc_b());
        let place = from_row(&std::array::from_fn(|k| if k < 3 { p[(env, k)] } else { q[(env, k - 3)] }));
        let acceleration = place.rotation * Vector3::from_fn(|k, _| a[(env, k)]) / 20.0;
        let arrow = Marker::arrow(place.translation.vector.into(), acceleration.into(), [0.2, 0.8, 0.9, 1.0]);
        std::iter::once(Marker::axes(place, 0.1)).chain(arrow).collect()
    }
}

/// Writes a summary of several lines.
impl fmt::Display for Imu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        summary::write_sampled(f, "Imu", &self.sampler, &[("body", &self.body)])
    }
}

impl Sampled for Imu {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }
}

impl Imu {
    /// Position of the IMU in the environment \[m\], shape \[num_envs, 3\].
    pub fn pos_w(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("pos_w")
    }

    /// Orientation of the IMU in the environment, w x y z, shape \[num_envs, 4\].
    pub fn quat_w(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("quat_w")
    }

    /// Velocity of the IMU's origin in the environment \[m/s\], in the axes of the IMU, shape \[num_envs, 3\].
    pub fn lin_vel_b(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("lin_vel_b")
    }

    /// Angular velocity of the IMU in the environment \[rad/s\], in the axes of the IMU, shape \[num_envs, 3\].
    pub fn ang_vel_b(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("ang_vel_b")
    }

    /// Acceleration of the IMU's origin including the gravity bias \[m/s²\], in the axes of the IMU, shape
    /// \[num_envs, 3\]. With the default bias, it is 0 in free fall; at rest it is minus gravity, such as 9.81 m/s²
    /// upward.
    pub fn lin_acc_b(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("lin_acc_b")
    }

    /// Angular acceleration \[rad/s²\] in the axes of the IMU, shape \[num_envs, 3\].
    pub fn ang_acc_b(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("ang_acc_b")
    }
}
