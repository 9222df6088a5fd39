//! The whole stage at one moment.

use super::camera::{self, CameraId, CameraView};
use crate::control::{RecordingState, Speed, Wants};
use kinetoscope_robot::description::{Joint, JointKind};
use kinetoscope_scene::Contact;
use kinetoscope_scene::{Marker, RenderScene};
use kinetoscope_sim::{EnvId, JointIndex, Look, MaskId, RobotId, SimulationManager, Viewpoint};
use std::sync::Arc;

/// Which environments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shown {
    /// All of them, in their grid.
    #[default]
    All,
    /// One.
    One(usize),
}

impl Shown {
    /// Whether an environment is among them.
    pub fn has(self, env: usize) -> bool {
        self == Self::All || self == Self::One(env)
    }

    /// The one; `None` where it is all.
    pub(crate) fn env(self) -> Option<EnvId> {
        match self {
            Self::All => None,
            Self::One(env) => Some(EnvId(env)),
        }
    }
}

/// All environments at one moment. It never changes; everything in it is in the frame of its environment.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Later snapshots have higher numbers, from 1.
    pub number: u64,
    /// How the simulation runs.
    pub run: Run,
    /// What can be seen in every environment, without the poses.
    pub scene: Option<Arc<RenderScene>>,
    /// What each mask id is.
    pub ids: Arc<[MaskId]>,
    /// What things are called.
    pub names: Arc<Names>,
    /// Point of view that the program set; `None` where it set none.
    pub viewpoint: Option<Viewpoint>,
    /// The environments.
    pub envs: Vec<EnvStage>,
    /// Which of them have their contacts in it.
    pub contacts_of: Option<Shown>,
}

/// How a simulation runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// Physics steps since the simulation was made.
    pub steps: u64,
    /// Whether it is held.
    pub paused: bool,
    /// How fast it should be.
    pub speed: Speed,
    /// How many simulated seconds pass in a second, over the last half second; `None` where that is not known yet.
    pub measured_speed: Option<f64>,
    /// Why the last command was refused; `None` once another one was done.
    pub refused: Option<String>,
    /// How many commands were refused so far: who sees the same reason again sees whether it was refused again.
    pub refusals: u64,
    /// How the recording stands; `None` where there is no record button.
    pub recording: Option<RecordingState>,
    /// Where in a recording this is; `None` for a simulation that runs.
    pub timeline: Option<Timeline>,
}

/// A moment of a recording, and the ends of it \[s\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timeline {
    /// The moment.
    pub now: f64,
    /// The first one.
    pub start: f64,
    /// The last one.
    pub end: f64,
}

/// What things are called; the same until something is added to the simulation.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Links (`uid/link`), objects, bodies of MJCF files.
    pub bodies: Arc<[String]>,
    /// Joints of robots, one after the other.
    pub joints: Vec<JointName>,
    /// Camera sensors of every kind; the eyes of a pair are `NAME/left` and `NAME/right`.
    pub cameras: Vec<String>,
    /// Which mask id the ground has: it is there once for all environments.
    pub(crate) ground: Option<i32>,
    camera_ids: Vec<CameraId>,
}

/// A joint of a robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointName {
    /// The robot.
    pub robot: RobotId,
    /// The joint.
    pub joint: JointIndex,
    /// `uid/joint`.
    pub name: String,
    /// Whether it can be given a target: it has a drive, and follows no other joint.
    pub driven: bool,
    /// Whether it slides instead of turning.
    pub slides: bool,
}

/// An environment at one moment.
#[derive(Clone, Debug, Default)]
pub struct EnvStage {
    /// Where it is in the overview \[m\].
    pub origin: [f64; 3],
    /// Where everything is.
    pub look: Look,
    /// Contacts with their forces, where some viewer wants them; bodies are those of [`Names::bodies`].
    pub contacts: Vec<Contact>,
    /// What sensors show of their measurements.
    pub markers: Vec<Marker>,
    /// Position, target and the ends of the range of each joint of [`Names::joints`] \[rad or m\].
    pub joints: Vec<[f64; 4]>,
    /// Effort of the drive of each joint in the last step \[N m or N\]; 0 without a drive.
    pub efforts: Vec<f64>,
    /// What each camera of [`Names::cameras`] looks at; `None` where it does not look at this environment.
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
            joints.extend(view.joint_names().iter().enumerate().map(|(k, name)| JointName {
                robot,
                joint: JointIndex(k),
                name: format!("{uid}/{name}"),
                driven: view.is_driven(JointIndex(k)).unwrap_or(false) && view.mimic_drivers()[k].0 == JointIndex(k),
                slides: prismatic.contains(&name),
            }));
        }
        let (cameras, camera_ids) = camera::cameras(sim).into_iter().unzip();
        Self { bodies: sim.entities().body_names(), joints, cameras, ground, camera_ids }
    }

    /// Whether they are still those of `sim`: sensors are added without a word.
    pub(super) fn fit(&self, sim: &SimulationManager) -> bool {
        camera::count(sim) == self.cameras.len()
    }
}

impl Snapshot {
    /// Copies everything that `wants` asks for.
    pub(super) fn fill(&mut self, sim: &mut SimulationManager, names: &Arc<Names>, wants: &Wants, run: Run) {
        self.run = run;
        self.scene = Some(Arc::clone(sim.scene_mut().visible().scene()));
        self.ids = Arc::clone(sim.scene_mut().visible().ids());
        self.names = Arc::clone(names);
        self.viewpoint = sim.scene().viewpoint();
        self.envs.resize_with(sim.num_envs(), EnvStage::default);
        let origins = sim.cfg().env_origins();
        for (k, env) in self.envs.iter_mut().enumerate() {
            env.origin = [0, 1, 2].map(|axis| origins[(k, axis)]);
            // There is such an environment.
            let _ = sim.scene_mut().look(EnvId(k), &mut env.look);
            if let Some(timeline) = self.run.timeline {
                env.look.time = timeline.now;
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
        self.contacts_of = wants.contacts;
        if let Some(shown) = wants.contacts {
            let chosen: Vec<EnvId> = (0..self.envs.len()).filter(|env| shown.has(*env)).map(EnvId).collect();
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

    /// The same moment with one environment alone; with none where there is no such environment.
    pub(crate) fn only(&self, env: usize) -> Self {
        Self { viewpoint: None, envs: self.envs.get(env).into_iter().cloned().collect(), ..self.clone() }
    }

    /// What an environment looks like: its own scene, or that of all.
    pub(crate) fn scene_of(&self, env: &EnvStage) -> Option<Arc<RenderScene>> {
        env.look.own_scene.0.as_ref().or(self.scene.as_ref()).map(Arc::clone)
    }
}
