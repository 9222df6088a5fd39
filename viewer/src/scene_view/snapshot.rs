//! Snapshots of all environments.

use super::camera::{self, CameraId, CameraView};
use crate::control::{RecordingState, SnapshotRequest, Speed};
use kinetoscope_robot::description::{Joint, JointKind};
use kinetoscope_scene::Contact;
use kinetoscope_scene::{Marker, RenderScene};
use kinetoscope_sim::{EnvId, EnvVisualState, JointIndex, MaskId, RobotId, SimulationManager, Viewpoint};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Selection of environments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum EnvSelection {
    /// All environments, side by side in their grid.
    #[default]
    All,
    /// One environment, by index.
    One(usize),
}

impl EnvSelection {
    /// True if environment `env` is selected.
    pub fn contains(self, env: usize) -> bool {
        self == Self::All || self == Self::One(env)
    }

    /// Returns the single environment, or `None` for all.
    pub(crate) fn env(self) -> Option<EnvId> {
        match self {
            Self::All => None,
            Self::One(env) => Some(EnvId(env)),
        }
    }
}

/// The state of all environments at one time. Quantities of an environment are in its frame;
/// [`viewpoint`](Self::viewpoint) is in the frame of the overview, in which environments are placed at their
/// [`origin`](SnapshotEnv::origin).
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Sequence number, increasing from 1, possibly with gaps.
    pub number: u64,
    /// Run state of the simulation.
    pub run: RunState,
    /// Render scene of all environments that have no own [`env_scene`](EnvVisualState::env_scene), without poses.
    pub scene: Option<Arc<RenderScene>>,
    /// Entity and link of each value in the mask channel, in ascending order of the values.
    pub mask_ids: Arc<[MaskId]>,
    /// Names of bodies, joints and cameras.
    pub names: Arc<Names>,
    /// Point of view of the last [`set_camera_view`](kinetoscope_sim::SceneViewMut::set_camera_view), in the frame of
    /// the overview; `None` before the first call.
    pub viewpoint: Option<Viewpoint>,
    /// Visible state of each environment, in the order of the simulation.
    pub envs: Vec<SnapshotEnv>,
    /// Environments whose contacts are included; `None` if no viewer requested contacts.
    pub contacts_included: Option<EnvSelection>,
}

/// Run state of a simulation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunState {
    /// Physics steps since the simulation was created; resets do not change it. During playback: index of the frame.
    pub steps: u64,
    /// True while paused; false while the steps of [`Command::Step`](crate::Command::Step) run.
    pub paused: bool,
    /// Requested speed.
    pub speed: Speed,
    /// Simulated seconds per wall-clock second, measured over at least half a second. `None` before the first
    /// measurement, again after each speed change, resume or single-step command, and during playback.
    pub measured_speed: Option<f64>,
    /// Reason of the last refused command, failed recording or failed mouse spring. A later successful command clears
    /// it; a successful `Drag` or `Release` clears only reasons of the mouse spring.
    pub last_refusal: Option<String>,
    /// Number of these refusals and failures so far. It distinguishes a repeated one with the same reason.
    pub refusal_count: u64,
    /// State of the recording; `None` without a record button and during playback.
    pub recording: Option<RecordingState>,
    /// Playback position; `None` for a running simulation.
    pub timeline: Option<Timeline>,
}

/// Playback time in a recording, with the first and last time \[s\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timeline {
    /// Time of the shown frame.
    pub time: f64,
    /// Time of the first frame.
    pub start: f64,
    /// Time of the last frame.
    pub end: f64,
}

/// Names of bodies, joints and cameras. They stay the same until an entity is added to the simulation.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Links (`uid/link`), objects (`uid`), and bodies and named sites of MJCF files (`uid/body`, `uid/site`), in the
    /// order of [`Entities::body_names`](kinetoscope_sim::Entities::body_names).
    pub bodies: Arc<[String]>,
    /// Joints of all robots and articulations, one after the other.
    pub joints: Vec<JointEntry>,
    /// Camera sensors of every kind. The cameras of a stereo pair are named `NAME/left` and `NAME/right`.
    pub cameras: Vec<String>,
    /// Mask id of the ground, which is rendered once for all environments; `None` without a ground.
    pub(crate) ground: Option<i32>,
    camera_ids: Vec<CameraId>,
}

/// Name and properties of a joint of a robot or articulation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointEntry {
    /// The robot or articulation.
    pub robot: RobotId,
    /// Index of the joint in the robot.
    pub joint: JointIndex,
    /// `uid/joint`.
    pub name: String,
    /// True if the joint accepts targets: it has a drive and mimics no other joint.
    pub accepts_target: bool,
    /// True for a prismatic joint, whose positions are in meters.
    pub is_prismatic: bool,
}

/// Poses, contacts, joints, markers and camera views of one environment, for viewers.
#[derive(Clone, Debug, Default)]
pub struct SnapshotEnv {
    /// Position of the environment's origin in the overview \[m\].
    pub origin: [f64; 3],
    /// Poses, time, lights and other visible state.
    pub snapshot: EnvVisualState,
    /// Contacts with their forces; empty unless requested for this environment. Bodies are indices into
    /// [`Names::bodies`].
    pub contacts: Vec<Contact>,
    /// Debug markers of sensors. Empty unless requested.
    pub markers: Vec<Marker>,
    /// Position, position target, lower and upper limit of each joint of [`Names::joints`] \[rad or m\], shape
    /// (num_joints, 4); unlimited joints have infinite limits. Empty unless requested.
    pub joints: Vec<[f64; 4]>,
    /// Drive effort of each joint in the last step \[N m or N\]; 0 without a drive. Empty unless requested.
    pub efforts: Vec<f64>,
    /// View of each camera of [`Names::cameras`]; `None` if a camera does not observe this environment or has not
    /// measured yet. Empty unless requested.
    pub views: Vec<Option<CameraView>>,
}

impl Names {
    pub(super) fn of(sim: &mut SimulationManager) -> Self {
        let ids = sim.scene().mask_ids();
        let ground = ids.iter().find(|id| id.class == "ground").map(|id| id.id);
        let mut joints = Vec::new();
        for (uid, robot) in sim.entities().robot_ids() {
            let view = sim.robot(robot);
            let slides = |joint: &&Joint| joint.kind == JointKind::Prismatic;
            let prismatic: Vec<&String> = view.description().joints.iter().filter(slides).map(|j| &j.name).collect();
            joints.extend(view.joint_names().iter().enumerate().map(|(k, name)| JointEntry {
                robot,
                joint: JointIndex(k),
                name: format!("{uid}/{name}"),
                accepts_target: view.is_driven(JointIndex(k)).unwrap_or(false)
                    && view.mimic_drivers()[k].0 == JointIndex(k),
                is_prismatic: prismatic.contains(&name),
            }));
        }
        let (cameras, camera_ids) = camera::cameras(sim).into_iter().unzip();
        Self { bodies: sim.entities().body_names(), joints, cameras, ground, camera_ids }
    }

    /// True if `sim` still has as many cameras. Other added entities are reported by
    /// [`invalidate_names`](super::SnapshotPool::invalidate_names).
    pub(super) fn apply_to(&self, sim: &SimulationManager) -> bool {
        camera::count(sim) == self.cameras.len()
    }
}

impl Snapshot {
    /// Copies the current state, with the contents that `wants` requests.
    pub(super) fn capture(
        &mut self,
        sim: &mut SimulationManager,
        names: &Arc<Names>,
        wants: &SnapshotRequest,
        run: RunState,
    ) {
        self.run = run;
        self.scene = Some(Arc::clone(sim.scene_mut().visual_scene().scene()));
        self.mask_ids = Arc::clone(sim.scene_mut().visual_scene().mask_ids());
        self.names = Arc::clone(names);
        self.viewpoint = sim.scene().viewpoint();
        self.envs.resize_with(sim.num_envs(), SnapshotEnv::default);
        let origins = sim.cfg().env_origins();
        for (k, env) in self.envs.iter_mut().enumerate() {
            env.origin = [0, 1, 2].map(|axis| origins[(k, axis)]);
            // The environment index is valid, so the result is never an error.
            let _ = sim.scene_mut().read_visual_state(EnvId(k), &mut env.snapshot);
            if let Some(timeline) = self.run.timeline {
                env.snapshot.time = timeline.time;
            }
            env.contacts.clear();
            env.markers.clear();
            env.joints.clear();
            env.efforts.clear();
            env.views.clear();
        }
        if wants.markers {
            for (EnvId(env), marker) in sim.scene().markers() {
                self.envs[env].markers.push(marker);
            }
        }
        self.contacts_included = wants.contacts;
        if let Some(shown) = wants.contacts {
            let chosen: Vec<EnvId> = (0..self.envs.len()).filter(|env| shown.contains(*env)).map(EnvId).collect();
            let contacts = sim.scene_mut().contacts(Some(&chosen)).unwrap_or_default();
            for (EnvId(env), contacts) in chosen.iter().zip(contacts) {
                self.envs[*env].contacts = contacts;
            }
        }
        if wants.joints {
            for (_, robot) in sim.entities().robot_ids() {
                let robot = sim.robot(robot);
                let (now, target, limits) = (robot.qpos(), robot.qpos_target(), robot.qpos_limits());
                let efforts = robot.qf();
                for (k, env) in self.envs.iter_mut().enumerate() {
                    let of = |j: usize| [now[(k, j)], target[(k, j)], limits[(k, j, 0)], limits[(k, j, 1)]];
                    env.joints.extend((0..robot.dof()).map(of));
                    env.efforts.extend(efforts.row(k));
                }
            }
        }
        if wants.cameras {
            for id in &names.camera_ids {
                for (env, view) in self.envs.iter_mut().zip(id.views(sim)) {
                    env.views.push(view);
                }
            }
        }
    }

    /// Returns a copy with a single environment and without a viewpoint, or with no environment if the index is
    /// invalid.
    pub(crate) fn with_single_env(&self, env: usize) -> Self {
        Self { viewpoint: None, envs: self.envs.get(env).into_iter().cloned().collect(), ..self.clone() }
    }

    /// Returns the render scene of an environment: its own scene, or the shared one.
    pub(crate) fn env_scene(&self, env: &SnapshotEnv) -> Option<Arc<RenderScene>> {
        env.snapshot.env_scene.0.as_ref().or(self.scene.as_ref()).map(Arc::clone)
    }
}
