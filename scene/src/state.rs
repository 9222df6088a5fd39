//! `SceneState`: what the simulation measured in all environments, as plain arrays.
//!
//! The simulation fills it after every physics step, sensors read it. The first axis is the environment; arrays are in C
//! order, f64, environment-local world frame, SI. Only what somebody asked for is present.
//!
//! Two instants meet in one step from t_k to t_(k+1): contacts, efforts and accelerations are solved for t_k, positions
//! and velocities are those of t_(k+1). Both times are given.

use crate::{Light, PoseF32, PoseF64};
use ndarray::{Array2, Array3};

/// State of all environments after a physics step (or after a reset).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneState {
    /// Physics steps since the last reset of each environment, shape \[num_envs\].
    pub step: Vec<u64>,
    /// Time of positions and velocities \[s\] since the last reset, shape \[num_envs\].
    pub time: Vec<f64>,
    /// Time of efforts, accelerations and contacts \[s\] since the last reset, shape \[num_envs\]: one step of the physics
    /// engine earlier than [`time`](Self::time); the same right after a reset or after somebody wrote to the state, when
    /// accelerations and contacts are solved for the state as it is.
    pub force_time: Vec<f64>,
    /// Poses of bodies `[x, y, z, qw, qx, qy, qz]` \[m\], shape \[num_envs, bodies, 7\].
    pub body_poses: Option<Array3<f64>>,
    /// Velocities of body origins, then angular velocities \[m/s, rad/s\], in world axes, shape \[num_envs, bodies, 6\].
    pub body_velocities: Option<Array3<f64>>,
    /// Accelerations of body origins, then angular accelerations \[m/s², rad/s²\], in world axes, without gravity (0 at
    /// rest, -9.81 along z in free fall), shape \[num_envs, bodies, 6\]. They are what the engine solved for; where it damps
    /// joints implicitly after that (the `damping` of joints with native actuators), velocities change by a little less.
    pub body_accelerations: Option<Array3<f64>>,
    /// Poses of bodies at [`force_time`](Self::force_time), as in [`body_poses`](Self::body_poses); there where
    /// [`body_accelerations`](Self::body_accelerations) is.
    pub force_poses: Option<Array3<f64>>,
    /// Velocities of bodies at [`force_time`](Self::force_time), as in [`body_velocities`](Self::body_velocities); there
    /// where [`body_accelerations`](Self::body_accelerations) is.
    pub force_velocities: Option<Array3<f64>>,
    /// Forces, then torques that the joint of each link exerts on it \[N, N m\], about the origin of the link and in the
    /// link's own axes, shape \[num_envs, bodies, 6\]. NaN for links that are fused to others: no joint of theirs moves.
    pub joint_wrenches: Option<Array3<f64>>,
    /// Joint positions \[rad or m\], shape \[num_envs, joints\].
    pub joint_positions: Option<Array2<f64>>,
    /// Joint velocities \[rad/s or m/s\], shape \[num_envs, joints\].
    pub joint_velocities: Option<Array2<f64>>,
    /// Efforts of the joint drives in the last step \[N m or N\], 0 after a reset, shape \[num_envs, joints\].
    pub joint_efforts: Option<Array2<f64>>,
    /// Contacts with forces.
    pub contacts: Option<Contacts>,
    /// Values of the physics engine's own sensors, shape \[num_envs, values\].
    pub sensordata: Option<Array2<f64>>,
    /// Where things are that can be seen.
    pub visible: Option<VisibleState>,
    /// World from instance, in the order of [`RenderScene::instances`](crate::RenderScene::instances), in double precision
    /// (what ray casters work with), shape \[num_envs, instances\].
    pub instance_poses: Option<Array2<PoseF64>>,
}

/// Where everything of a [`RenderScene`](crate::RenderScene) is in all environments.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VisibleState {
    /// World from instance, in the order of [`RenderScene::instances`](crate::RenderScene::instances), shape
    /// \[num_envs, instances\]. Single precision: what the renderer works with.
    pub instance_poses: Array2<PoseF32>,
    /// The scene's lamps where they are now, shape \[num_envs, lamps\].
    pub lights: Array2<Light>,
}

/// Contacts of all environments in one list, environment after environment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts {
    /// Environment `e` owns the contacts `first[e]..first[e + 1]`, shape \[num_envs + 1\].
    pub first: Vec<usize>,
    /// The contacts.
    pub list: Vec<Contact>,
}

/// Two bodies that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The bodies that touch, as indices of the body axis of [`SceneState`]; `None` is the world. Links that were fused
    /// keep their own index.
    pub bodies: [Option<u32>; 2],
    /// Where \[m\].
    pub point: [f64; 3],
    /// Unit vector from the first body to the second.
    pub normal: [f64; 3],
    /// Gap \[m\]; negative where they overlap.
    pub distance: f64,
    /// Force on the second body \[N\], friction included; the first one gets its negative.
    pub force: [f64; 3],
    /// Its part along [`normal`](Self::normal) \[N\], not negative where bodies do not stick; the rest is friction.
    pub normal_force: f64,
}

impl SceneState {
    /// A state at step 0 with nothing in it.
    pub fn new(num_envs: usize) -> Self {
        Self { step: vec![0; num_envs], time: vec![0.0; num_envs], force_time: vec![0.0; num_envs], ..Self::default() }
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.step.len()
    }
}

impl Contacts {
    /// The contacts of environment `env`.
    ///
    /// # Panics
    ///
    /// If there is no such environment.
    #[track_caller]
    pub fn of(&self, env: usize) -> &[Contact] {
        &self.list[self.first[env]..self.first[env + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_belong_to_one_environment() {
        let contact = |z| Contact {
            bodies: [None, Some(0)],
            point: [0.0, 0.0, z],
            normal: [0.0, 0.0, 1.0],
            distance: 0.0,
            force: [0.0; 3],
            normal_force: 0.0,
        };
        let contacts = Contacts { first: vec![0, 2, 2, 3], list: [0.0, 1.0, 2.0].map(contact).to_vec() };
        assert_eq!(contacts.of(0), &contacts.list[..2]);
        assert_eq!(contacts.of(1), []);
        assert_eq!(contacts.of(2), &contacts.list[2..]);
        assert_eq!(SceneState::new(3).num_envs(), 3);
    }
}
