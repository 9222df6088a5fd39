//! `SceneState`: what the simulation measured in all environments, as plain arrays.
//!
//! The simulation fills it after every physics step, sensors read it. The first axis is the environment; arrays are in C
//! order, f64, environment-local world frame, SI. Only what somebody asked for is present.
//!
//! Two instants meet in one step from t_k to t_(k+1): contacts, efforts and accelerations are solved for t_k, positions
//! and velocities are those of t_(k+1). Both times are given.

use crate::quantities::{PerEnv, quantities};
use crate::requires::Requires;
use crate::{Light, Marker, PoseF32, PoseF64, RenderScene};
use ndarray::{Array2, Array3};
use std::sync::Arc;

// All quantities that sensors may ask for; the simulation fills each by a file of its own.
quantities! {
    /// [`SceneState::body_poses`].
    POSES = "poses" {
        /// Poses of bodies `[x, y, z, qw, qx, qy, qz]` \[m\], shape \[num_envs, bodies, 7\].
        body_poses: Array3<f64> [bodies, 7],
    }

    /// [`SceneState::body_velocities`].
    VELOCITIES = "velocities" {
        /// Velocities of body origins, then angular velocities \[m/s, rad/s\], in world axes, shape \[num_envs, bodies, 6\].
        body_velocities: Array3<f64> [bodies, 6],
    }

    /// [`SceneState::body_accelerations`], [`SceneState::force_poses`] and [`SceneState::force_velocities`]; costs the
    /// engine a pass of its own.
    ACCELERATIONS = "accelerations" {
        /// Accelerations of body origins, then angular accelerations \[m/s², rad/s²\], in world axes, without gravity (0 at
        /// rest, -9.81 along z in free fall), shape \[num_envs, bodies, 6\]. They are what the engine solved for; where it damps
        /// joints implicitly after that (the `damping` of joints with native actuators), velocities change by a little less.
        body_accelerations: Array3<f64> [bodies, 6],
        /// Poses of bodies at [`force_time`](Self::force_time), as in [`body_poses`](Self::body_poses); there where
        /// [`body_accelerations`](Self::body_accelerations) is.
        force_poses: Array3<f64> [bodies, 7],
        /// Velocities of bodies at [`force_time`](Self::force_time), as in [`body_velocities`](Self::body_velocities); there
        /// where [`body_accelerations`](Self::body_accelerations) is.
        force_velocities: Array3<f64> [bodies, 6],
    }

    /// [`SceneState::contacts`].
    CONTACTS = "contacts" {
        /// Contacts with forces.
        contacts: Contacts,
    }

    /// [`SceneState::joint_efforts`].
    JOINT_EFFORTS = "joint_efforts" {
        /// Efforts of the joint drives in the last step \[N m or N\], 0 after a reset, shape \[num_envs, joints\]. For joints of
        /// MJCF files, MuJoCo's `qfrc_actuator`: the sum of what the file's actuators exert on the joint, with the compensation of
        /// gravity that is the actuators' (`actuatorgravcomp`), within the joint's `actuatorfrcrange` (MuJoCo 2.2.2 has neither of
        /// these two); after a reset, on the state as it is.
        joint_efforts: Array2<f64> [joints],
    }

    /// [`SceneState::joint_positions`] and [`SceneState::joint_velocities`].
    JOINT_STATE = "joint_state" {
        /// Joint positions \[rad or m\], shape \[num_envs, joints\]: one for each joint with one degree of freedom.
        joint_positions: Array2<f64> [joints],
        /// Joint velocities \[rad/s or m/s\], shape \[num_envs, joints\].
        joint_velocities: Array2<f64> [joints],
    }

    /// [`SceneState::sensordata`].
    SENSORDATA = "sensordata" {
        /// Values of the physics engine's own sensors, shape \[num_envs, values\].
        sensordata: Array2<f64> [engine_values],
    }

    /// [`SceneState::visible`], and the [`RenderScene`] that sensors are built for.
    VISIBLE = "visible" {
        /// Poses of instances that can be seen.
        visible: VisibleState,
    }

    /// [`SceneState::joint_wrenches`]; costs the engine a pass of its own.
    JOINT_WRENCHES = "joint_wrenches" {
        /// Forces, then torques that the joint of each link exerts on it \[N, N m\], about the origin of the link and in the
        /// link's own axes, shape \[num_envs, bodies, 6\]. NaN for links that are fused to others: no joint of theirs moves.
        joint_wrenches: Array3<f64> [bodies, 6],
    }

    /// [`SceneState::instance_poses`], and the [`RenderScene`] that sensors are built for.
    INSTANCES = "instances" {
        /// World from instance, in the order of [`RenderScene::instances`], in double precision
        /// (what ray casters work with), shape \[num_envs, instances\].
        instance_poses: Array2<PoseF64> [instances],
    }

    /// [`SceneState::actuator_controls`], [`SceneState::actuator_forces`] and [`SceneState::actuator_activations`].
    ACTUATORS = "actuators" {
        /// Controls of actuators, shape \[num_envs, actuators\]: the target of a drive's position \[rad or m\], what an actuator
        /// of an MJCF file is told, in the unit that the file gives it.
        actuator_controls: Array2<f64> [actuators],
        /// Forces of actuators \[N m or N\], as [`joint_efforts`](Self::joint_efforts) for drives, in the unit of the file for
        /// those of MJCF files (before the gear), shape \[num_envs, actuators\].
        actuator_forces: Array2<f64> [actuators],
        /// Activations of actuators, shape \[num_envs, actuators\]; 0 for those that have none. Of those that have several (MuJoCo
        /// 4.x: `actdim`), the last one, which is what their force is made of.
        actuator_activations: Array2<f64> [actuators],
    }

    /// [`SceneState::markers`], of all other sensors.
    MARKERS = "markers" {
        /// Markers by which sensors show their measurements, shape \[num_envs\]: for cameras that draw it.
        markers: Vec<Vec<Marker>>,
    }
}

/// Lengths of the axes of a [`SceneState`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lengths {
    /// Number of environments.
    pub num_envs: usize,
    /// Number of bodies.
    pub bodies: usize,
    /// Number of joints with one degree of freedom.
    pub joints: usize,
    /// Number of actuators.
    pub actuators: usize,
    /// Number of values of the physics engine's own sensors.
    pub engine_values: usize,
    /// Number of instances of the [`RenderScene`].
    pub instances: usize,
}

impl Lengths {
    /// The entries of an axis in messages.
    fn label(axis: &'static str) -> &'static str {
        if axis == "engine_values" { "values of the engine's sensors" } else { axis }
    }
}

/// What can be seen in one environment instead of the scene of all: the same instances in the same order and of the same
/// kinds, with sizes or colours of their own; nothing where it looks as all do. Two are equal where they are the same in
/// memory.
#[derive(Clone, Debug, Default)]
pub struct OwnScene(pub Option<Arc<RenderScene>>);

impl PartialEq for OwnScene {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// Where everything of a [`RenderScene`] is in all environments.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VisibleState {
    /// World from instance, in the order of [`RenderScene::instances`], shape
    /// \[num_envs, instances\]. Single precision: what the renderer works with.
    pub instance_poses: Array2<PoseF32>,
    /// The scene's lamps where they are now, shape \[num_envs, lamps\].
    pub lights: Array2<Light>,
    /// The scenes with the shapes of this moment, sizes and colours of the environments' own included, shape \[num_envs\];
    /// empty for a scene in which no shape [changes](crate::Instance::deforms).
    pub scenes: Vec<OwnScene>,
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

    /// What can be seen in environment `env`, where that is the environment's own.
    pub fn own_scene(&self, env: usize) -> &OwnScene {
        static AS_ALL: OwnScene = OwnScene(None);
        self.own_scenes.get(env).unwrap_or(&AS_ALL)
    }

    /// What cameras see in environment `env`, where that is not the scene of all: with the shapes of this moment.
    pub fn seen_scene(&self, env: usize) -> &OwnScene {
        let shaped = self.visible.as_ref().and_then(|visible| visible.scenes.get(env));
        shaped.unwrap_or_else(|| self.own_scene(env))
    }

    /// Takes over from `other` the environments where `chosen` is true: steps, times, and the fields that this state has.
    /// `false`, and nothing is taken over, where `other` is not of the same scene: it lacks a field of this one, or has
    /// another number of anything. Allocates only where the list of contacts has no room for those of before and those of after
    /// together: the new list is made behind the old one, and the room stays.
    #[must_use]
    pub fn take_over(&mut self, other: &Self, chosen: &[bool]) -> bool {
        if !(chosen.len() == self.num_envs() && self.fits(other)) {
            return false;
        }
        let envs = || (0..).zip(chosen).filter(|(_, chosen)| **chosen).map(|(env, _)| env);
        for env in envs() {
            self.step[env] = other.step[env];
            self.time[env] = other.time[env];
            self.force_time[env] = other.force_time[env];
        }
        self.take_over_quantities(other, chosen);
        let sees = self.visible.is_some() || self.instance_poses.is_some();
        if sees && !(self.own_scenes.is_empty() && other.own_scenes.is_empty()) {
            self.own_scenes.resize(chosen.len(), OwnScene::default());
            for env in envs() {
                self.own_scenes[env].clone_from(other.own_scene(env));
            }
        }
        true
    }

    /// True if `other` has every field of this state, with as many of everything.
    fn fits(&self, other: &Self) -> bool {
        let n = self.num_envs();
        [other.step.len(), other.time.len(), other.force_time.len()] == [n; 3] && self.has_quantities_of(other)
    }
}

impl PerEnv for VisibleState {
    /// No instance and no lamp: a [`RenderScene`] says how many there are.
    fn with_room(_num_envs: usize, _shape: &[usize]) -> Self {
        Self::default()
    }

    fn fits(&self, other: &Self, _num_envs: usize) -> bool {
        self.instance_poses.dim() == other.instance_poses.dim()
            && self.lights.dim() == other.lights.dim()
            && self.scenes.len() == other.scenes.len()
    }

    fn take_over(&mut self, other: &Self, chosen: &[bool]) {
        self.instance_poses.take_over(&other.instance_poses, chosen);
        self.lights.take_over(&other.lights, chosen);
        for ((to, from), _) in self.scenes.iter_mut().zip(&other.scenes).zip(chosen).filter(|(_, chosen)| **chosen) {
            to.clone_from(from);
        }
    }
}

impl PerEnv for Contacts {
    fn with_room(num_envs: usize, _shape: &[usize]) -> Self {
        Self { first: vec![0; num_envs + 1], list: Vec::new() }
    }

    fn fits(&self, other: &Self, num_envs: usize) -> bool {
        [self.first.len(), other.first.len()] == [num_envs + 1; 2]
    }

    fn take_over(&mut self, other: &Self, chosen: &[bool]) {
        // The new list grows behind the old one, which then goes: it allocates only while both together are more than ever.
        let old = self.list.len();
        for (env, chosen) in chosen.iter().enumerate() {
            let mine = self.first[env]..self.first[env + 1];
            self.first[env] = self.list.len() - old;
            if *chosen {
                self.list.extend_from_slice(other.of(env));
            } else {
                self.list.extend_from_within(mine);
            }
        }
        if let Some(last) = self.first.last_mut() {
            *last = self.list.len() - old;
        }
        self.list.drain(..old);
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
    use ndarray::Axis;

    fn contact(z: f64, who: f64) -> Contact {
        Contact {
            bodies: [None, Some(0)],
            point: [who, z, 0.0],
            normal: [0.0, 0.0, 1.0],
            distance: 0.0,
            force: [0.0; 3],
            normal_force: who,
        }
    }

    #[test]
    fn contacts_of_one_environment() {
        let contacts = Contacts { first: vec![0, 2, 2, 3], list: [0.0, 1.0, 2.0].map(|z| contact(z, 0.0)).to_vec() };
        assert_eq!((contacts.of(0), contacts.of(1)), (&contacts.list[..2], &[][..]));
        assert_eq!(contacts.of(2), &contacts.list[2..]);
        assert_eq!(SceneState::new(3).num_envs(), 3);
    }

    /// A state of 3 environments, every number of which says the environment and whose it is.
    fn state(who: f64, contacts: [usize; 3]) -> SceneState {
        let first = (0..=3).map(|env| contacts[..env].iter().sum()).collect();
        let list = (0..3).flat_map(|env| vec![contact(env as f64, who); contacts[env]]).collect();
        let rows = |width| Some(Array3::from_shape_fn((3, 2, width), |(env, b, k)| who + (10 * env + b + k) as f64));
        let numbers = |width| Some(Array2::from_shape_fn((3, width), |(env, k)| who + (10 * env + k) as f64));
        let light = |env: usize| Light { direction: [who as f32, env as f32, 1.0], ..Light::default() };
        let at = |env: usize| [who as f32, env as f32, 0.0];
        SceneState {
            step: (0..3).map(|env| who as u64 + env).collect(),
            time: (0..3).map(|env| who + f64::from(env)).collect(),
            force_time: (0..3).map(|env| who - f64::from(env)).collect(),
            body_poses: rows(7),
            body_velocities: rows(6),
            body_accelerations: rows(6),
            force_poses: rows(7),
            force_velocities: rows(6),
            joint_wrenches: rows(6),
            joint_positions: numbers(4),
            joint_velocities: numbers(4),
            joint_efforts: numbers(4),
            sensordata: numbers(5),
            actuator_controls: numbers(2),
            actuator_forces: numbers(2),
            actuator_activations: numbers(2),
            contacts: Some(Contacts { first, list }),
            visible: Some(VisibleState {
                instance_poses: Array2::from_shape_fn((3, 2), |(env, _)| PoseF32::from_translation(at(env))),
                lights: Array2::from_shape_fn((3, 1), |(env, _)| light(env)),
                scenes: vec![OwnScene::default(); 3],
            }),
            instance_poses: Some(Array2::from_elem((3, 2), PoseF64::IDENTITY)),
            markers: Some((0..3).map(|env| vec![Marker::sphere([who, f64::from(env), 0.0], 0.1, [1.0; 4])]).collect()),
            ..SceneState::new(3)
        }
    }

    /// Every field of an environment is taken over or none is: the judge is a state made of the numbers of both.
    #[test]
    fn take_over() {
        let mut kept = state(100.0, [1, 0, 2]);
        assert!(kept.take_over(&state(200.0, [0, 3, 5]), &[false, true, false]));
        let one = |s: &SceneState, env: usize| {
            let per_body = [&s.body_poses, &s.body_velocities, &s.body_accelerations];
            let per_body = [per_body, [&s.force_poses, &s.force_velocities, &s.joint_wrenches]].concat();
            let rows: Vec<f64> =
                per_body.into_iter().flatten().flat_map(|a| a.index_axis(Axis(0), env).to_owned()).collect();
            let per_env = [&s.joint_positions, &s.joint_velocities, &s.joint_efforts, &s.sensordata];
            let of_actuators = [&s.actuator_controls, &s.actuator_forces, &s.actuator_activations];
            let per_env = per_env.into_iter().chain(of_actuators);
            let numbers: Vec<f64> = per_env.flatten().flat_map(|a| a.row(env).to_owned()).collect();
            let seen = s.visible.as_ref().map(|v| (v.instance_poses.row(env).to_owned(), v.lights.row(env).to_owned()));
            let contacts = s.contacts.as_ref().map(|c| c.of(env).to_vec());
            let markers = s.markers.as_ref().map(|m| m[env].clone());
            (s.step[env], s.time[env], s.force_time[env], rows, numbers, (seen, markers), contacts)
        };
        let (old, new) = (state(100.0, [1, 0, 2]), state(200.0, [0, 3, 5]));
        for (env, from) in [&old, &new, &old].into_iter().enumerate() {
            assert_eq!(one(&kept, env), one(from, env), "environment {env}");
        }
        assert!(kept.take_over(&state(300.0, [2, 2, 2]), &[true; 3]));
        assert_eq!(kept, state(300.0, [2, 2, 2]));
        // The control: no environment is chosen.
        assert!(kept.take_over(&state(400.0, [1, 1, 1]), &[false; 3]));
        assert_eq!(kept, state(300.0, [2, 2, 2]));
    }

    #[test]
    fn own_scenes() {
        let own = || OwnScene(Some(Arc::new(RenderScene::empty())));
        let (red, large) = (own(), own());
        assert!(red != large && red == red.clone(), "the same in memory, or not");
        let with =
            |own: [&OwnScene; 3]| SceneState { own_scenes: own.map(Clone::clone).into(), ..state(200.0, [1; 3]) };
        let nothing = OwnScene::default();
        let mut kept = state(100.0, [1, 1, 1]);
        assert_eq!(kept.own_scene(2), &nothing);
        assert!(kept.take_over(&with([&red, &large, &nothing]), &[true, false, true]));
        assert_eq!(kept.own_scenes, [red.clone(), nothing.clone(), nothing.clone()]);
        assert!(kept.take_over(&with([&nothing, &large, &red]), &[false, true, true]));
        assert_eq!(kept.own_scenes, [red.clone(), large, red]);
        // Back to what all look like.
        assert!(kept.take_over(&state(300.0, [1, 1, 1]), &[true; 3]));
        assert!((0..3).all(|env| kept.own_scene(env) == &nothing));
        // Without a visual scene nothing is kept.
        let mut blind = SceneState::new(3);
        assert!(blind.take_over(&with([&nothing, &own(), &nothing]), &[true; 3]) && blind.own_scenes.is_empty());
    }

    #[test]
    fn another_scene() {
        let mut kept = state(100.0, [1, 0, 2]);
        let mut other = state(200.0, [1, 0, 2]);
        other.joint_efforts = Some(Array2::zeros((3, 5)));
        assert!(!kept.take_over(&other, &[true; 3]));
        other.joint_efforts = None;
        assert!(!kept.take_over(&other, &[true; 3]));
        assert!(!kept.take_over(&state(200.0, [1, 0, 2]), &[true; 2]));
        assert!(!kept.take_over(&SceneState::new(2), &[true; 3]));
        assert_eq!(kept, state(100.0, [1, 0, 2]), "nothing was changed");
        // More than what is kept may be there.
        assert!(SceneState::new(3).take_over(&state(200.0, [1, 0, 2]), &[true; 3]));
    }
}
