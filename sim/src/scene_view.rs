//! The simulation as viewers and renderers see it.

use crate::body_pose::BodyFrame;
use crate::capture::{Capture, body_velocity};
use crate::env::EnvStatus;
use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list, env_mask};
use crate::look::{BodyMotion, JointAxis, Look};
use crate::manager::SimulationManager;
use crate::sensor_list::SensorId;
use crate::viewpoint::Viewpoint;
use crate::visible::{MaskId, Visible};
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::Data;
use kinetoscope_scene::Contact;
use kinetoscope_scene::Requires;
use kinetoscope_scene::{Marker, PoseF32, RenderScene};
use kinetoscope_sensors::Sensor;
use kinetoscope_sensors::camera::{Segmentation, SegmentationCfg, Thing};
use nalgebra::Vector3;
use std::sync::Arc;

impl SimulationManager {
    /// The simulation as viewers and renderers see it.
    pub fn scene(&self) -> SceneView<'_> {
        SceneView::new(self)
    }

    /// The simulation as viewers and renderers see it, to change.
    pub fn scene_mut(&mut self) -> SceneViewMut<'_> {
        SceneViewMut::new(self)
    }
}

/// The simulation as viewers and renderers see it; see [`SimulationManager::scene`].
#[derive(Clone, Copy, Debug)]
pub struct SceneView<'a> {
    sim: &'a SimulationManager,
}

impl<'a> SceneView<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// The MJCF that is being stepped.
    pub fn mjcf(&self) -> &'a str {
        &self.sim.simulation.xml
    }

    /// Meaning of each number of the mask channel of cameras, the same in every environment. Numbers stay when more
    /// is added.
    pub fn mask_ids(&self) -> &'a [MaskId] {
        self.sim.simulation.mask_ids()
    }

    /// Numbers of the mask channel by instance, link and semantic class, with labels by pattern: turns masks into
    /// segmented pictures, and finds boxes around things. Make it anew when something was added.
    ///
    /// # Errors
    /// A pattern that is no regular expression or matches nothing, and something that two patterns match.
    pub fn segmentation(&self, cfg: &SegmentationCfg) -> Result<Segmentation> {
        let things = self.mask_ids().iter().map(Thing::from);
        Segmentation::new(things, cfg).map_err(|error| Error::Labels(Box::new(error)))
    }

    /// Markers of the last measurements of all sensors, for [`Still::overview`](crate::Still::overview): those that are
    /// configured to ([`SensorCfg::debug_vis`](kinetoscope_sensors::SensorCfg::debug_vis)), or told to since.
    pub fn markers(&self) -> Vec<(EnvId, Marker)> {
        self.sim.sensors.markers(&self.sim.simulation, None)
    }

    /// The same without those of a sensor: what is drawn into the colours of a camera that draws markers.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn markers_beside<S: Sensor>(&self, id: SensorId<S>) -> Vec<(EnvId, Marker)> {
        self.sim.sensors.markers(&self.sim.simulation, Some(self.sim.sensors.index_of(id)))
    }

    /// True if the markers of a sensor are among [`markers`](Self::markers).
    ///
    /// # Errors
    /// There is no such sensor.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn debug_vis<S: Sensor>(&self, id: SensorId<S>) -> Result<bool> {
        self.sim.sensors.debug_vis(self.sim.sensors.index_of(id))
    }

    /// The point of view that was set last; `None` before the first.
    pub fn viewpoint(&self) -> Option<Viewpoint> {
        self.sim.viewpoint
    }

    /// How a body moves in an environment; `body` is its place in [`body_names`](crate::Entities::body_names).
    ///
    /// # Errors
    /// There is no such environment or body.
    pub fn body_motion(&self, env: EnvId, body: usize) -> Result<BodyMotion> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let frame = frame_of(self.sim, body)?;
        Ok(self.sim.simulation.batch.read(env.0, |env| {
            let (data, pose) = (env.data(), frame.pose(env.data()));
            let [linear, angular] = body_velocity(data, frame.body, &pose.translation.vector);
            BodyMotion {
                pose,
                linear: linear.into(),
                angular: angular.into(),
                carried_mass: data.model().body_subtreemass()[frame.body],
                is_fixed: data.model().body_weldid()[frame.body] == 0,
            }
        }))
    }
}

/// The simulation as viewers and renderers see it, to change; see [`SimulationManager::scene_mut`].
#[derive(Debug)]
pub struct SceneViewMut<'a> {
    sim: &'a mut SimulationManager,
}

impl<'a> SceneViewMut<'a> {
    pub(crate) fn new(sim: &'a mut SimulationManager) -> Self {
        Self { sim }
    }

    /// MuJoCo's model and the data of one environment, to write: for what this API does not have. A forward pass follows. A state
    /// that is not finite is not kept: the environment diverges, in the state before.
    ///
    /// `qfrc_applied` and the controls of drives are overwritten in every step.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn with_mujoco<T>(&mut self, env: EnvId, write: impl FnOnce(&mut mj::Data) -> T) -> Result<T> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let mut result = None;
        self.sim.simulation.batch.write(env.0, |env| env.write(|data| result = Some(write(data))));
        self.sim.sensors.refresh(&[env.0], &mut self.sim.simulation);
        Ok(result.expect("the closure was called"))
    }

    /// The visual scene, made at the first call, which reads the visual meshes. Meshes that cannot be read are left out, with a
    /// diagnostic.
    pub fn visible(&mut self) -> Arc<Visible> {
        self.sim.visible()
    }

    /// Copies what there is to see of an environment to `look`, whose memory is used again.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn look(&mut self, env: EnvId, look: &mut Look) -> Result<()> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let visible = self.sim.visible();
        let own = self.sim.own_scene(env).clone();
        let plan = &self.sim.simulation.plan;
        let index = env.0;
        self.sim.simulation.batch.read(index, |env| {
            let data = env.data();
            look.time = data.time();
            look.diverged = match env.status() {
                EnvStatus::Running => None,
                EnvStatus::Diverged { step, reason } => Some(format!("step {step}: {reason}")),
            };
            look.instances.resize(visible.scene().instances().len(), PoseF32::IDENTITY);
            look.lights.clone_from(&visible.scene().lights);
            visible.read(data, &mut look.instances, &mut look.lights);
            visible.shape(data, index, &own, &mut look.own_scene);
            look.bodies.clear();
            look.bodies.extend(plan.bodies().iter().map(|frame| frame.pose(data)));
            look.masses.clear();
            let masses = data.xipos().as_chunks::<3>().0.iter().zip(data.model().body_mass());
            look.masses.extend(masses.skip(1).filter(|(_, mass)| **mass > 0.0).map(|(at, mass)| (*at, *mass)));
            look.joints.clear();
            look.joints.extend(axes(data));
        });
        Ok(())
    }

    /// The scene that is drawn of an environment, in the order of [`Look::instances`]: the same value for all whose sizes and colours are not
    /// their own, until something is added. Shapes that [change](kinetoscope_scene::Instance::deforms) are not those of now.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn scene_of(&mut self, env: EnvId) -> Result<Arc<RenderScene>> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let visible = self.sim.visible();
        Ok(self.sim.own_scene(env).0.clone().unwrap_or_else(|| Arc::clone(visible.scene())))
    }

    /// The contacts of environments as they are now, with the forces that the engine solves for this instant: a list for each
    /// of `env_ids` (all where `None`). Bodies are numbered as in [`body_names`](crate::Entities::body_names). An environment that
    /// diverged has none. Nothing that a sensor measures changes, nor any later step.
    ///
    /// # Errors
    /// An environment does not exist.
    pub fn contacts(&mut self, env_ids: Option<&[EnvId]>) -> Result<Vec<Vec<Contact>>> {
        let capture = Capture { plan: Arc::clone(&self.sim.simulation.plan), fields: Requires::CONTACTS };
        let batch = &mut self.sim.simulation.batch;
        let of_env = |env: usize| {
            let mut contacts = Vec::new();
            batch.write(env, |env| env.present_contacts(&capture, &mut contacts));
            contacts
        };
        Ok(env_list(env_ids, self.sim.cfg.num_envs)?.into_iter().map(of_env).collect())
    }

    /// Pulls at a body with forces, together: each is a point of the environment \[m\], as the body is now, and the force there
    /// \[N\] in the axes of the environment. They act from the next step on, until the body is pulled otherwise, the environment is
    /// reset, or something is added to the simulation; none ends it. They stay as they are while the body moves: who means a
    /// spring pulls anew in every step. What [`RobotMut::set_external_wrench`](crate::RobotMut::set_external_wrench) applies acts
    /// besides.
    ///
    /// `body` is its place in [`body_names`](crate::Entities::body_names).
    ///
    /// # Errors
    /// There is no such environment or body, or a number is not finite; then nothing has changed.
    pub fn pull(&mut self, env: EnvId, body: usize, forces: &[([f64; 3], [f64; 3])]) -> Result<()> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let mujoco_body = frame_of(self.sim, body)?.body;
        for (of, numbers) in forces.iter().flat_map(|(point, force)| [("the point", point), ("the force", force)]) {
            if let Some(column) = numbers.iter().position(|x| !x.is_finite()) {
                let (of, value) = (of.to_string(), numbers[column]);
                return Err(Error::NotFinite { argument: "pull", row: env.0, column, of, value });
            }
        }
        self.sim.simulation.batch.write(env.0, |env| {
            let center = &env.data().xipos()[3 * mujoco_body..3 * mujoco_body + 3];
            let center = Vector3::new(center[0], center[1], center[2]);
            let of = |&(point, force): &([f64; 3], [f64; 3])| {
                let force = Vector3::from(force);
                [force, (Vector3::from(point) - center).cross(&force)]
            };
            let none = [Vector3::zeros(); 2];
            let [force, torque] = forces.iter().map(of).fold(none, |[f, t], [force, torque]| [f + force, t + torque]);
            env.set_wrenches(|wrenches| wrenches.pull(body, mujoco_body, force, torque));
        });
        Ok(())
    }

    /// Sets the point of view of windows, browser views and screenshots, those that are open and those to come: from `eye` to
    /// `target` in the frame of the overview \[m\], up is +z. Users can move on from there; Home brings it back. Isaac Lab's
    /// `set_camera_view`.
    ///
    /// # Errors
    /// The points are the same, or not finite; the view stays then.
    pub fn set_camera_view(&mut self, eye: [f64; 3], target: [f64; 3]) -> Result<()> {
        let distance = eye.iter().zip(&target).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        if !(distance.is_finite() && distance > 1e-9) {
            return Err(Error::Config {
                field: "set_camera_view",
                value: format!("{eye:?}, {target:?}"),
                expected: "eye and target must be finite and apart from each other, in metres",
            });
        }
        let changes = self.sim.viewpoint.map_or(0, |view| view.changes) + 1;
        self.sim.viewpoint = Some(Viewpoint { eye, target, changes });
        Ok(())
    }

    /// Shows the markers of a sensor from now on, or does not: whatever its configuration said, and nothing of what it measures
    /// changes.
    ///
    /// # Errors
    /// There is no such sensor.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn set_debug_vis<S: Sensor>(&mut self, id: SensorId<S>, shown: bool) -> Result<()> {
        self.sim.sensors.set_debug_vis(self.sim.sensors.index_of(id), shown)
    }
}

/// The frame of a body.
fn frame_of(sim: &SimulationManager, body: usize) -> Result<&BodyFrame> {
    let bodies = sim.simulation.plan.bodies();
    bodies.get(body).ok_or(Error::UnknownIndex { what: "body", index: body, count: bodies.len() })
}

/// Axes of joints that turn or slide.
fn axes(data: &Data) -> impl Iterator<Item = JointAxis> {
    let anchors = data.xanchor().as_chunks::<3>().0.iter().zip(data.xaxis().as_chunks::<3>().0);
    anchors.zip(data.model().jnt_type()).filter_map(|((anchor, axis), kind)| {
        let kind = *kind as u32;
        let slides = kind == mj::mjJNT_SLIDE;
        (slides || kind == mj::mjJNT_HINGE).then_some(JointAxis { anchor: *anchor, axis: *axis, slides })
    })
}
