//! `SceneState`: what the simulation measured in all environments, as plain arrays.
//!
//! The simulation fills it after every physics step, sensors read it. The first axis is the environment; arrays are in C
//! order, f64, environment-local world frame, SI. Only what somebody asked for is present.
//!
//! Two instants meet in one step from t_k to t_(k+1): contacts, efforts and accelerations are solved for t_k, positions
//! and velocities are those of t_(k+1). Both times are given.

use crate::{Light, Marker, PoseF32, PoseF64, RenderScene};
use ndarray::{Array, Array2, Array3, Axis, RemoveAxis};
use std::sync::Arc;

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
    /// Joint positions \[rad or m\], shape \[num_envs, joints\]: one for each joint with one degree of freedom.
    pub joint_positions: Option<Array2<f64>>,
    /// Joint velocities \[rad/s or m/s\], shape \[num_envs, joints\].
    pub joint_velocities: Option<Array2<f64>>,
    /// Efforts of the joint drives in the last step \[N m or N\], 0 after a reset, shape \[num_envs, joints\]. For joints of
    /// MJCF files, MuJoCo's `qfrc_actuator`: the sum of what the file's actuators exert on the joint, with the compensation of
    /// gravity that is the actuators' (`actuatorgravcomp`), within the joint's `actuatorfrcrange` (MuJoCo 2.2.2 has neither of
    /// these two); after a reset, on the state as it is.
    pub joint_efforts: Option<Array2<f64>>,
    /// Controls of actuators, shape \[num_envs, actuators\]: the target of a drive's position \[rad or m\], what an actuator
    /// of an MJCF file is told, in the unit that the file gives it.
    pub actuator_controls: Option<Array2<f64>>,
    /// Forces of actuators \[N m or N\], as [`joint_efforts`](Self::joint_efforts) for drives, in the unit of the file for
    /// those of MJCF files (before the gear), shape \[num_envs, actuators\].
    pub actuator_forces: Option<Array2<f64>>,
    /// Activations of actuators, shape \[num_envs, actuators\]; 0 for those that have none. Of those that have several (MuJoCo
    /// 4.x: `actdim`), the last one, which is what their force is made of.
    pub actuator_activations: Option<Array2<f64>>,
    /// Contacts with forces.
    pub contacts: Option<Contacts>,
    /// Values of the physics engine's own sensors, shape \[num_envs, values\].
    pub sensordata: Option<Array2<f64>>,
    /// Where things are that can be seen.
    pub visible: Option<VisibleState>,
    /// World from instance, in the order of [`RenderScene::instances`], in double precision
    /// (what ray casters work with), shape \[num_envs, instances\].
    pub instance_poses: Option<Array2<PoseF64>>,
    /// What can be seen where sizes or colours are the environment's own, shape \[num_envs\]; empty where all environments
    /// look alike.
    pub own_scenes: Vec<OwnScene>,
    /// What sensors show people of their measurements, shape \[num_envs\]: for cameras that draw it.
    pub markers: Option<Vec<Vec<Marker>>>,
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
        for (to, from) in self.per_body_mut().into_iter().zip(other.per_body()) {
            copy_rows(to, from, envs());
        }
        for (to, from) in self.per_env_mut().into_iter().zip(other.per_env()) {
            copy_rows(to, from, envs());
        }
        copy_rows(&mut self.instance_poses, &other.instance_poses, envs());
        if let (Some(to), Some(from)) = (&mut self.visible, &other.visible) {
            for env in envs() {
                to.instance_poses.row_mut(env).assign(&from.instance_poses.row(env));
                to.lights.row_mut(env).assign(&from.lights.row(env));
                if let (Some(to), Some(from)) = (to.scenes.get_mut(env), from.scenes.get(env)) {
                    to.clone_from(from);
                }
            }
        }
        if let (Some(to), Some(from)) = (&mut self.contacts, &other.contacts) {
            to.take_over(from, chosen);
        }
        if let (Some(to), Some(from)) = (&mut self.markers, &other.markers) {
            for env in envs() {
                to[env].clone_from(&from[env]);
            }
        }
        let sees = self.visible.is_some() || self.instance_poses.is_some();
        if sees && !(self.own_scenes.is_empty() && other.own_scenes.is_empty()) {
            self.own_scenes.resize(chosen.len(), OwnScene::default());
            for env in envs() {
                self.own_scenes[env].clone_from(other.own_scene(env));
            }
        }
        true
    }

    /// Whether `other` has every field of this state, with the same numbers of everything.
    fn fits(&self, other: &Self) -> bool {
        let n = self.num_envs();
        let same_envs = [other.step.len(), other.time.len(), other.force_time.len()] == [n; 3];
        let visible = match (&self.visible, &other.visible) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(a), Some(b)) => {
                a.instance_poses.dim() == b.instance_poses.dim()
                    && a.lights.dim() == b.lights.dim()
                    && a.scenes.len() == b.scenes.len()
            }
        };
        let contacts = match (&self.contacts, &other.contacts) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(a), Some(b)) => a.first.len() == n + 1 && b.first.len() == n + 1,
        };
        let markers = match (&self.markers, &other.markers) {
            (None, _) => true,
            (Some(a), b) => a.len() == n && b.as_ref().is_some_and(|b| b.len() == n),
        };
        same_envs
            && visible
            && markers
            && contacts
            && self.per_body().into_iter().zip(other.per_body()).all(|(a, b)| same_shape(a, b))
            && self.per_env().into_iter().zip(other.per_env()).all(|(a, b)| same_shape(a, b))
            && same_shape(&self.instance_poses, &other.instance_poses)
    }

    fn per_body(&self) -> [&Option<Array3<f64>>; 6] {
        let Self { body_poses, body_velocities, body_accelerations, force_poses, force_velocities, .. } = self;
        [body_poses, body_velocities, body_accelerations, force_poses, force_velocities, &self.joint_wrenches]
    }

    fn per_body_mut(&mut self) -> [&mut Option<Array3<f64>>; 6] {
        let Self {
            body_poses, body_velocities, body_accelerations, force_poses, force_velocities, joint_wrenches, ..
        } = self;
        [body_poses, body_velocities, body_accelerations, force_poses, force_velocities, joint_wrenches]
    }

    fn per_env(&self) -> [&Option<Array2<f64>>; 7] {
        let Self { joint_positions, joint_velocities, joint_efforts, sensordata, .. } = self;
        let Self { actuator_controls, actuator_forces, actuator_activations, .. } = self;
        let [controls, forces, activations] = [actuator_controls, actuator_forces, actuator_activations];
        [joint_positions, joint_velocities, joint_efforts, sensordata, controls, forces, activations]
    }

    fn per_env_mut(&mut self) -> [&mut Option<Array2<f64>>; 7] {
        let Self {
            joint_positions,
            joint_velocities,
            joint_efforts,
            sensordata,
            actuator_controls,
            actuator_forces,
            actuator_activations,
            ..
        } = self;
        [
            joint_positions,
            joint_velocities,
            joint_efforts,
            sensordata,
            actuator_controls,
            actuator_forces,
            actuator_activations,
        ]
    }
}

/// Whether `b` has the shape of `a`, where there is an `a`.
fn same_shape<T, D: RemoveAxis>(a: &Option<Array<T, D>>, b: &Option<Array<T, D>>) -> bool {
    a.as_ref().is_none_or(|a| b.as_ref().is_some_and(|b| a.shape() == b.shape()))
}

/// Copies the rows of some environments between arrays of the same shape.
fn copy_rows<T: Clone, D: RemoveAxis>(
    to: &mut Option<Array<T, D>>,
    from: &Option<Array<T, D>>,
    envs: impl Iterator<Item = usize>,
) {
    if let (Some(to), Some(from)) = (to, from) {
        for env in envs {
            to.index_axis_mut(Axis(0), env).assign(&from.index_axis(Axis(0), env));
        }
    }
}

impl Contacts {
    /// Takes over the environments where `chosen` is true from contacts of as many environments.
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
            own_scenes: Vec::new(),
            markers: Some((0..3).map(|env| vec![Marker::sphere([who, f64::from(env), 0.0], 0.1, [1.0; 4])]).collect()),
        }
    }

    /// Every field of an environment is taken over or none is: the judge is a state made of the numbers of both.
    #[test]
    fn take_over() {
        let mut kept = state(100.0, [1, 0, 2]);
        assert!(kept.take_over(&state(200.0, [0, 3, 5]), &[false, true, false]));
        let one = |s: &SceneState, env: usize| {
            let rows: Vec<f64> =
                s.per_body().into_iter().flatten().flat_map(|a| a.index_axis(Axis(0), env).to_owned()).collect();
            let numbers: Vec<f64> = s.per_env().into_iter().flatten().flat_map(|a| a.row(env).to_owned()).collect();
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
