//! `SceneState`: the state of all environments that sensors measure, as plain arrays.
//!
//! The simulation fills the state when a sensor is due, and sensors read it. The first axis is the environment. Arrays
//! are in C order, in the environment frame with world axes, and in SI units. They are f64, except for those of
//! [`VisibleState`], which are f32. Only requested quantities are present.
//!
//! A step from t_k to t_(k+1) involves two times: contacts, efforts and accelerations are solved for t_k, positions and
//! velocities are those of t_(k+1). The state has both times.

use crate::quantities::{PerEnvArray, quantities};
use crate::state_fields::StateFields;
use crate::{Light, Marker, PoseF32, PoseF64, RenderScene};
use ndarray::{Array2, Array3};
use std::sync::Arc;

// All quantities that sensors may request. The simulation fills each one in its own file.
quantities! {
    /// Flag of [`SceneState::body_poses`].
    POSES = "poses" {
        /// Poses of body frames in the environment, `[x, y, z, qw, qx, qy, qz]` \[m\], shape \[num_envs, bodies, 7\].
        body_poses: Array3<f64> [bodies, 7],
    }

    /// Flag of [`SceneState::body_velocities`].
    VELOCITIES = "velocities" {
        /// Velocities of body origins, then angular velocities \[m/s, rad/s\], world axes, shape \[num_envs, bodies,
        /// 6\].
        body_velocities: Array3<f64> [bodies, 6],
    }

    /// Flag of [`SceneState::body_accelerations`], [`SceneState::force_poses`] and [`SceneState::force_velocities`];
    /// costs the engine an extra pass.
    ACCELERATIONS = "accelerations" {
        /// Coordinate accelerations of body origins (0 at rest, -9.81 along z in free fall), then angular accelerations
        /// \[m/s², rad/s²\], in world axes at [`force_time`](Self::force_time), shape \[num_envs, bodies, 6\].
        ///
        /// They are the solution of the engine. If the engine then damps joints implicitly (the `damping` of joints
        /// with native actuators), velocities change slightly less.
        body_accelerations: Array3<f64> [bodies, 6],
        /// Poses of bodies at [`force_time`](Self::force_time), as in [`body_poses`](Self::body_poses); present with
        /// [`body_accelerations`](Self::body_accelerations).
        force_poses: Array3<f64> [bodies, 7],
        /// Velocities of bodies at [`force_time`](Self::force_time), as in [`body_velocities`](Self::body_velocities);
        /// present with [`body_accelerations`](Self::body_accelerations).
        force_velocities: Array3<f64> [bodies, 6],
    }

    /// Flag of [`SceneState::contacts`].
    CONTACTS = "contacts" {
        /// Contacts with solved forces at [`force_time`](Self::force_time). A contact without a constraint (the
        /// surfaces are within MuJoCo's `margin`, but in its `gap`) is left out.
        contacts: Contacts,
    }

    /// Flag of [`SceneState::joint_efforts`].
    JOINT_EFFORTS = "joint_efforts" {
        /// Efforts of the joint drives in the last step \[N m or N\], 0 after a reset, shape \[num_envs, joints\].
        ///
        /// For joints without a drive, of robots, articulations and MJCF files, MuJoCo's `qfrc_actuator`: the sum of
        /// the actuators' efforts on the joint, with gravity compensation by actuators (`actuatorgravcomp`), clamped to
        /// the joint's `actuatorfrcrange` (MuJoCo 2.2.2 has neither of these two). After a reset, it is computed for
        /// the current state.
        joint_efforts: Array2<f64> [joints],
    }

    /// Flag of [`SceneState::joint_positions`] and [`SceneState::joint_velocities`].
    JOINT_STATE = "joint_state" {
        /// Joint positions \[rad or m\], shape \[num_envs, joints\]: one for each joint with one degree of freedom.
        joint_positions: Array2<f64> [joints],
        /// Joint velocities \[rad/s or m/s\], shape \[num_envs, joints\].
        joint_velocities: Array2<f64> [joints],
    }

    /// Flag of [`SceneState::sensordata`].
    SENSORDATA = "sensordata" {
        /// Values of the physics engine's own sensors, shape \[num_envs, values\]. After a step, values that depend on
        /// forces or accelerations belong to [`force_time`](Self::force_time).
        sensordata: Array2<f64> [engine_values],
    }

    /// Flag of [`SceneState::visible`]. A sensor that requires it also gets the [`RenderScene`] when it is built.
    VISIBLE = "visible" {
        /// Poses of all instances and lights, for cameras.
        visible: VisibleState,
    }

    /// Flag of [`SceneState::joint_wrenches`]; costs the engine an extra pass.
    JOINT_WRENCHES = "joint_wrenches" {
        /// Forces, then torques that the joint of each link exerts on the link \[N, N m\], about the origin of the link
        /// and in its axes, at [`force_time`](Self::force_time), shape \[num_envs, bodies, 6\]. NaN for links that are
        /// fused to other links, because their joint does not move.
        joint_wrenches: Array3<f64> [bodies, 6],
    }

    /// Flag of [`SceneState::instance_poses`]. A sensor that requires it also gets the [`RenderScene`] when it is
    /// built.
    INSTANCES = "instances" {
        /// World-from-instance poses, in the order of [`RenderScene::instances`], in double precision for ray casters,
        /// shape \[num_envs, instances\].
        instance_poses: Array2<PoseF64> [instances],
    }

    /// Flag of [`SceneState::actuator_controls`], [`SceneState::actuator_forces`] and
    /// [`SceneState::actuator_activations`].
    ACTUATORS = "actuators" {
        /// Controls of actuators, shape \[num_envs, actuators\]: the position target of a drive \[rad or m\]; for an
        /// actuator of an MJCF file, its control in the unit of the file, before clamping to `ctrlrange`.
        actuator_controls: Array2<f64> [actuators],
        /// Forces of actuators, shape \[num_envs, actuators\].
        ///
        /// For drives, the values of [`joint_efforts`](Self::joint_efforts) \[N m or N\]; for actuators of MJCF files,
        /// the force in the unit of the file, before the gear.
        actuator_forces: Array2<f64> [actuators],
        /// Activations of actuators, shape \[num_envs, actuators\]; 0 for actuators without activation. For actuators
        /// with several activations (MuJoCo 4.x: `actdim`), the last one, which determines their force.
        actuator_activations: Array2<f64> [actuators],
    }

    /// Flag of [`SceneState::markers`]: the markers of all sensors except the one that requires them.
    MARKERS = "markers" {
        /// Markers that visualize sensor measurements, shape \[num_envs\], for cameras that draw them.
        markers: Vec<Vec<Marker>>,
    }
}

/// Lengths of the axes of a [`SceneState`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateDims {
    /// Number of environments.
    pub num_envs: usize,
    /// Number of bodies, in this order: links of robots and articulations, rigid objects, bodies and sites of MJCF
    /// files. The world is not included.
    pub bodies: usize,
    /// Number of joints with one degree of freedom: those of robots and articulations, then those of MJCF files.
    pub joints: usize,
    /// Number of actuators: the drives of robots and articulations, then the actuators of MJCF files.
    pub actuators: usize,
    /// Number of values of the physics engine's own sensors.
    pub engine_values: usize,
    /// Number of instances of the [`RenderScene`].
    pub instances: usize,
}

impl StateDims {
    /// Name of the entries of an axis, for messages.
    fn label(axis: &'static str) -> &'static str {
        if axis == "engine_values" { "values of MuJoCo sensors" } else { axis }
    }
}

/// Render scene of one environment; `None` if the environment uses the shared scene.
///
/// An own scene has the instances of the shared scene, in the same order and of the same kinds, with its own sizes,
/// colors or deformed shapes. Two values are equal if they are the same object in memory.
#[derive(Clone, Debug, Default)]
pub struct EnvScene(pub Option<Arc<RenderScene>>);

impl PartialEq for EnvScene {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// Poses of the instances and lights of a [`RenderScene`] in all environments, hidden instances included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VisibleState {
    /// World-from-instance poses, in the order of [`RenderScene::instances`], in single precision for the renderer,
    /// shape \[num_envs, instances\].
    pub instance_poses: Array2<PoseF32>,
    /// Lights of the scene at their current poses, shape \[num_envs, lights\].
    pub lights: Array2<Light>,
    /// Render scene of each environment with its current shapes, sizes and colors, shape \[num_envs\]. The list is
    /// empty if no instance is [deformable](crate::Instance::is_deformable); [`SceneState::own_scenes`] then has sizes
    /// and colors.
    pub scenes: Vec<EnvScene>,
}

/// Contacts of all environments in one list, ordered by environment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts {
    /// Offsets in the list, shape \[num_envs + 1\]: environment `e` owns the contacts `first[e]..first[e + 1]`.
    pub first: Vec<usize>,
    /// The contacts, ordered by environment.
    pub list: Vec<Contact>,
}

/// A contact of two bodies, with its force at [`SceneState::force_time`]. Vectors are in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The two bodies, as indices of the body axis of [`SceneState`]; `None` is the world. Fused links keep their own
    /// index.
    pub bodies: [Option<u32>; 2],
    /// Position in the environment frame, in the middle between both surfaces \[m\].
    pub point: [f64; 3],
    /// Unit vector from the first body to the second.
    pub normal: [f64; 3],
    /// Gap \[m\]; negative for penetration.
    pub distance: f64,
    /// Force on the second body \[N\], including friction. The force on the first body is its negative.
    pub force: [f64; 3],
    /// Component of the force along [`normal`](Self::normal) \[N\], not negative unless bodies adhere; the rest is
    /// friction.
    pub normal_force: f64,
}

impl SceneState {
    /// Creates a state at step 0 without quantities.
    pub fn new(num_envs: usize) -> Self {
        Self { step: vec![0; num_envs], time: vec![0.0; num_envs], force_time: vec![0.0; num_envs], ..Self::default() }
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.step.len()
    }

    /// Own render scene of environment `env`. The inner value is `None` if the environment uses the shared scene, or
    /// does not exist.
    pub fn env_scene(&self, env: usize) -> &EnvScene {
        static AS_ALL: EnvScene = EnvScene(None);
        self.own_scenes.get(env).unwrap_or(&AS_ALL)
    }

    /// Scene that cameras see in environment `env`, with its current shapes. The inner value is `None` for the shared
    /// scene.
    pub fn visible_scene(&self, env: usize) -> &EnvScene {
        let shaped = self.visible.as_ref().and_then(|visible| visible.scenes.get(env));
        shaped.unwrap_or_else(|| self.env_scene(env))
    }

    /// Copies the environments where `chosen` is true from `other`: steps, times, and the fields that this state has.
    ///
    /// Returns `false` and changes nothing if `chosen` does not have one element per environment, or if `other` is not
    /// of the same scene: it lacks a field of this state, or has other sizes. Allocates for own scenes and for longer
    /// lists of markers. Also allocates if the capacity of the contact list does not suffice for old and new contacts
    /// together: the new list is built behind the old one, and the capacity is kept.
    #[must_use]
    pub fn copy_envs_from(&mut self, other: &Self, chosen: &[bool]) -> bool {
        if !(chosen.len() == self.num_envs() && self.same_shape(other)) {
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
            self.own_scenes.resize(chosen.len(), EnvScene::default());
            for env in envs() {
                self.own_scenes[env].clone_from(other.env_scene(env));
            }
        }
        true
    }

    /// True if `other` has every field of this state, in the same sizes.
    fn same_shape(&self, other: &Self) -> bool {
        let n = self.num_envs();
        [other.step.len(), other.time.len(), other.force_time.len()] == [n; 3] && self.has_quantities_of(other)
    }
}

impl PerEnvArray for VisibleState {
    /// Empty arrays, because the numbers of instances and lights come from a [`RenderScene`].
    fn zeroed(_num_envs: usize, _shape: &[usize]) -> Self {
        Self::default()
    }

    fn same_shape(&self, other: &Self, _num_envs: usize) -> bool {
        self.instance_poses.dim() == other.instance_poses.dim()
            && self.lights.dim() == other.lights.dim()
            && self.scenes.len() == other.scenes.len()
    }

    fn copy_envs_from(&mut self, other: &Self, chosen: &[bool]) {
        self.instance_poses.copy_envs_from(&other.instance_poses, chosen);
        self.lights.copy_envs_from(&other.lights, chosen);
        for ((to, from), _) in self.scenes.iter_mut().zip(&other.scenes).zip(chosen).filter(|(_, chosen)| **chosen) {
            to.clone_from(from);
        }
    }
}

impl PerEnvArray for Contacts {
    fn zeroed(num_envs: usize, _shape: &[usize]) -> Self {
        Self { first: vec![0; num_envs + 1], list: Vec::new() }
    }

    fn same_shape(&self, other: &Self, num_envs: usize) -> bool {
        [self.first.len(), other.first.len()] == [num_envs + 1; 2]
    }

    fn copy_envs_from(&mut self, other: &Self, chosen: &[bool]) {
        // The new list is built behind the old one, which is then removed. This allocates only if both exceed the
        // capacity.
        let old = self.list.len();
        for (env, chosen) in chosen.iter().enumerate() {
            let mine = self.first[env]..self.first[env + 1];
            self.first[env] = self.list.len() - old;
            if *chosen {
                self.list.extend_from_slice(other.in_env(env));
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
    /// If `env` is out of range.
    #[track_caller]
    pub fn in_env(&self, env: usize) -> &[Contact] {
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
        assert_eq!((contacts.in_env(0), contacts.in_env(1)), (&contacts.list[..2], &[][..]));
        assert_eq!(contacts.in_env(2), &contacts.list[2..]);
        assert_eq!(SceneState::new(3).num_envs(), 3);
    }

    /// A state of 3 environments, in which every number identifies the environment and `who`.
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
                scenes: vec![EnvScene::default(); 3],
            }),
            instance_poses: Some(Array2::from_elem((3, 2), PoseF64::IDENTITY)),
            markers: Some((0..3).map(|env| vec![Marker::sphere([who, f64::from(env), 0.0], 0.1, [1.0; 4])]).collect()),
            ..SceneState::new(3)
        }
    }

    /// All fields of the chosen environments are copied, and no others. Reference: a state made of the numbers of both.
    #[test]
    fn take_over() {
        let mut kept = state(100.0, [1, 0, 2]);
        assert!(kept.copy_envs_from(&state(200.0, [0, 3, 5]), &[false, true, false]));
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
            let contacts = s.contacts.as_ref().map(|c| c.in_env(env).to_vec());
            let markers = s.markers.as_ref().map(|m| m[env].clone());
            (s.step[env], s.time[env], s.force_time[env], rows, numbers, (seen, markers), contacts)
        };
        let (old, new) = (state(100.0, [1, 0, 2]), state(200.0, [0, 3, 5]));
        for (env, from) in [&old, &new, &old].into_iter().enumerate() {
            assert_eq!(one(&kept, env), one(from, env), "environment {env}");
        }
        assert!(kept.copy_envs_from(&state(300.0, [2, 2, 2]), &[true; 3]));
        assert_eq!(kept, state(300.0, [2, 2, 2]));
        // Control: no environment is chosen.
        assert!(kept.copy_envs_from(&state(400.0, [1, 1, 1]), &[false; 3]));
        assert_eq!(kept, state(300.0, [2, 2, 2]));
    }

    #[test]
    fn own_scenes() {
        let own = || EnvScene(Some(Arc::new(RenderScene::empty())));
        let (red, large) = (own(), own());
        assert!(red != large && red == red.clone(), "equality compares the memory");
        let with =
            |own: [&EnvScene; 3]| SceneState { own_scenes: own.map(Clone::clone).into(), ..state(200.0, [1; 3]) };
        let nothing = EnvScene::default();
        let mut kept = state(100.0, [1, 1, 1]);
        assert_eq!(kept.env_scene(2), &nothing);
        assert!(kept.copy_envs_from(&with([&red, &large, &nothing]), &[true, false, true]));
        assert_eq!(kept.own_scenes, [red.clone(), nothing.clone(), nothing.clone()]);
        assert!(kept.copy_envs_from(&with([&nothing, &large, &red]), &[false, true, true]));
        assert_eq!(kept.own_scenes, [red.clone(), large, red]);
        // Back to the shared scene.
        assert!(kept.copy_envs_from(&state(300.0, [1, 1, 1]), &[true; 3]));
        assert!((0..3).all(|env| kept.env_scene(env) == &nothing));
        // Without a visual quantity, no own scene is kept.
        let mut blind = SceneState::new(3);
        assert!(blind.copy_envs_from(&with([&nothing, &own(), &nothing]), &[true; 3]) && blind.own_scenes.is_empty());
    }

    #[test]
    fn another_scene() {
        let mut kept = state(100.0, [1, 0, 2]);
        let mut other = state(200.0, [1, 0, 2]);
        other.joint_efforts = Some(Array2::zeros((3, 5)));
        assert!(!kept.copy_envs_from(&other, &[true; 3]));
        other.joint_efforts = None;
        assert!(!kept.copy_envs_from(&other, &[true; 3]));
        assert!(!kept.copy_envs_from(&state(200.0, [1, 0, 2]), &[true; 2]));
        assert!(!kept.copy_envs_from(&SceneState::new(2), &[true; 3]));
        assert_eq!(kept, state(100.0, [1, 0, 2]), "nothing was changed");
        // The other state may have more fields.
        assert!(SceneState::new(3).copy_envs_from(&state(200.0, [1, 0, 2]), &[true; 3]));
    }
}
