//! Render scene, visual state and contacts, for viewers and renderers.

use crate::body_pose::BodyFrame;
use crate::capture::{CaptureRequest, body_velocity};
use crate::device::{DeviceError, DevicePhysics};
use crate::env::{EnvStatus, Stage};
use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list, env_mask};
use crate::manager::SimulationManager;
use crate::sensor_list::SensorId;
use crate::viewpoint::Viewpoint;
use crate::visible::{MaskId, VisualScene};
use crate::visual_state::{BodyMotion, EnvVisualState, JointAxis};
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::Data;
use kinetoscope_scene::Contact;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{Marker, PoseF32, RenderScene};
use kinetoscope_sensors::Sensor;
use kinetoscope_sensors::camera::{Segmentation, SegmentationCfg, SegmentedEntity};
use nalgebra::Vector3;
use std::sync::Arc;

impl SimulationManager {
    /// Access for viewers and renderers: visual scene, markers, body motion.
    pub fn scene(&self) -> SceneView<'_> {
        SceneView::new(self)
    }

    /// Access for viewers and renderers that needs `&mut`: builds the visual scene, reads visual state and contacts,
    /// applies forces, switches markers.
    pub fn scene_mut(&mut self) -> SceneViewMut<'_> {
        SceneViewMut::new(self)
    }
}

/// Access for viewers and renderers; see [`SimulationManager::scene`].
#[derive(Clone, Copy, Debug)]
pub struct SceneView<'a> {
    sim: &'a SimulationManager,
}

impl<'a> SceneView<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// MJCF document that the shared model was compiled from, without properties of single environments.
    pub fn mjcf(&self) -> &'a str {
        &self.sim.simulation.xml
    }

    /// Error of the physics on a [device](crate::SimulationManagerCfg::device), after which all environments are frozen; always
    /// `None` on the CPU.
    pub fn device_failure(&self) -> Option<DeviceError> {
        self.sim.simulation.batch.device_failure()
    }

    /// Calls `act` with the physics of the [device](crate::SimulationManagerCfg::device), for code that knows its type; `None` on
    /// the CPU.
    pub fn with_device<T>(&self, act: impl FnOnce(&dyn DevicePhysics) -> T) -> Option<T> {
        self.sim.simulation.batch.with_device(act)
    }

    /// Entity and link of each value in the mask channel of cameras, in ascending order of the values, the same in all
    /// environments. Ids never change when entities are added.
    pub fn mask_ids(&self) -> &'a [MaskId] {
        self.sim.simulation.mask_ids()
    }

    /// Segmentation of mask images by instance, link and semantic class, with labels by pattern. Also computes bounding
    /// boxes. Rebuild it after entities were added.
    ///
    /// # Errors
    /// A pattern is not a regular expression or matches nothing, or two patterns match the same item.
    pub fn segmentation(&self, cfg: &SegmentationCfg) -> Result<Segmentation> {
        let things = self.mask_ids().iter().map(SegmentedEntity::from);
        Segmentation::new(things, cfg).map_err(|error| Error::SegmentationLabels(Box::new(error)))
    }

    /// Markers of the last measurements of all sensors with enabled markers, for
    /// [`OffscreenScene::overview`](crate::OffscreenScene::overview).
    /// [`SensorCfg::debug_vis`](kinetoscope_sensors::SensorCfg::debug_vis) or [`SceneViewMut::set_debug_vis`] enables
    /// them.
    pub fn markers(&self) -> Vec<(EnvId, Marker)> {
        self.sim.sensors.markers(&self.sim.simulation, None)
    }

    /// Same as [`markers`](Self::markers), without the markers of the sensor `id`: a camera with `draw_markers` renders
    /// these markers.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn markers_except<S: Sensor>(&self, id: SensorId<S>) -> Vec<(EnvId, Marker)> {
        self.sim.sensors.markers(&self.sim.simulation, Some(self.sim.sensors.index_of(id)))
    }

    /// True if the markers of a sensor are enabled.
    ///
    /// # Errors
    /// The sensor does not exist.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn debug_vis<S: Sensor>(&self, id: SensorId<S>) -> Result<bool> {
        self.sim.sensors.debug_vis(self.sim.sensors.index_of(id))
    }

    /// The point of view that [`SceneViewMut::set_camera_view`] set last; `None` before the first call.
    pub fn viewpoint(&self) -> Option<Viewpoint> {
        self.sim.viewpoint
    }

    /// Motion of a body in an environment; `body` is its index in [`body_names`](crate::Entities::body_names).
    ///
    /// # Errors
    /// The environment or the body does not exist.
    pub fn body_motion(&self, env: EnvId, body: usize) -> Result<BodyMotion> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let frame = body_frame(self.sim, body)?;
        Ok(self.sim.simulation.batch.read_at(env.0, Stage::Kinematics, |env| {
            let (data, pose) = (env.data(), frame.pose(env.data()));
            let [linear, angular] = body_velocity(data, frame.body, &pose.translation.vector);
            BodyMotion {
                pose,
                linear: linear.into(),
                angular: angular.into(),
                carried_mass: data.model().body_subtreemass()[frame.body],
                is_fixed: data.model().is_held(frame.body),
            }
        }))
    }
}

/// Access for viewers and renderers that needs `&mut`: visual scene and state, contacts, forces, MuJoCo's data; see
/// [`SimulationManager::scene_mut`].
#[derive(Debug)]
pub struct SceneViewMut<'a> {
    sim: &'a mut SimulationManager,
}

impl<'a> SceneViewMut<'a> {
    pub(crate) fn new(sim: &'a mut SimulationManager) -> Self {
        Self { sim }
    }

    /// Writes MuJoCo's data of one environment directly, for quantities outside this API. The closure may also call
    /// functions of MuJoCo, such as a step.
    ///
    /// Environments share the data, so the environment keeps the following and nothing else: time, positions,
    /// velocities, activations, warm start, inputs (controls, applied forces, mocap poses, user data, active flags of
    /// equalities), and the results of the last solve that [`SimulationManager::with_mujoco`] lists. Everything else is
    /// computed from these when it is needed, as in every write. A model set with
    /// [`set_model`](kinetoscope_mujoco::Data::set_model) holds until the closure returns.
    ///
    /// A state that is not finite or too large is rejected, and so is a state after which MuJoCo warns of a bad
    /// position, velocity or acceleration. Then the state before the write is restored, and the environment is marked
    /// as diverged. If the closure panics, the state before is restored, too.
    ///
    /// Every step overwrites `qfrc_applied`, the controls of drives, and `xfrc_applied` of bodies with external
    /// wrenches or gravity compensation.
    ///
    /// # Errors
    /// The environment does not exist, or the closure exchanged the data for that of another model. Then nothing is
    /// written.
    pub fn with_mujoco<T>(&mut self, env: EnvId, write: impl FnOnce(&mut mj::Data) -> T) -> Result<T> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let written = self.sim.simulation.batch.write_at(env.0, Stage::Raw, |env| env.lend(write));
        self.sim.sensors.refresh(&[env.0], &mut self.sim.simulation);
        written.ok_or(Error::ExchangedData { env: env.0 })
    }

    /// Returns the visual scene. The first call builds it and reads the visual meshes; unreadable meshes are left out
    /// with a diagnostic.
    pub fn visual_scene(&mut self) -> Arc<VisualScene> {
        self.sim.visual_scene()
    }

    /// Copies the visual state of an environment into `look`, whose memory is reused.
    ///
    /// # Errors
    /// The environment does not exist.
    pub fn read_visual_state(&mut self, env: EnvId, look: &mut EnvVisualState) -> Result<()> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let visible = self.sim.visual_scene();
        let own = self.sim.env_scene(env).clone();
        let plan = &self.sim.simulation.body_axis;
        let index = env.0;
        self.sim.simulation.batch.read_at(index, Stage::Kinematics, |env| {
            let data = env.data();
            look.time = data.time();
            look.diverged = match env.status() {
                EnvStatus::Running => None,
                EnvStatus::Diverged { step, reason } => Some(format!("step {step}: {reason}")),
            };
            look.instances.resize(visible.scene().instances().len(), PoseF32::IDENTITY);
            look.lights.clone_from(&visible.scene().lights);
            visible.read_poses(data, &mut look.instances, &mut look.lights);
            visible.update_shapes(data, index, &own, &mut look.env_scene);
            look.bodies.clear();
            look.bodies.extend(plan.bodies().iter().map(|frame| frame.pose(data)));
            look.mass_points.clear();
            let masses = data.xipos().as_chunks::<3>().0.iter().zip(data.model().body_mass());
            look.mass_points.extend(masses.skip(1).filter(|(_, mass)| **mass > 0.0).map(|(at, mass)| (*at, *mass)));
            look.joints.clear();
            look.joints.extend(joint_axes(data));
        });
        Ok(())
    }

    /// Render scene of an environment, in the order of [`EnvVisualState::instances`]. All environments without own
    /// sizes or colors share one scene until an entity is added. Shapes that
    /// [deform](kinetoscope_scene::Instance::is_deformable) are not updated to the current time.
    ///
    /// # Errors
    /// The environment does not exist.
    pub fn env_scene(&mut self, env: EnvId) -> Result<Arc<RenderScene>> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let visible = self.sim.visual_scene();
        Ok(self.sim.env_scene(env).0.clone().unwrap_or_else(|| Arc::clone(visible.scene())))
    }

    /// Contacts of environments at the current time, with the forces that MuJoCo solves for that time: one list for
    /// each of `env_ids` (all environments for `None`). Bodies are indexed as in
    /// [`body_names`](crate::Entities::body_names). The list is empty for a diverged environment, and if the solve
    /// fails. Measurements of sensors and later steps are not affected.
    ///
    /// # Errors
    /// An environment does not exist.
    pub fn contacts(&mut self, env_ids: Option<&[EnvId]>) -> Result<Vec<Vec<Contact>>> {
        let capture =
            CaptureRequest { body_axis: Arc::clone(&self.sim.simulation.body_axis), fields: StateFields::CONTACTS };
        let batch = &mut self.sim.simulation.batch;
        let of_env = |env: usize| {
            let mut contacts = Vec::new();
            batch.write(env, |env| env.current_contacts(&capture, &mut contacts));
            contacts
        };
        Ok(env_list(env_ids, self.sim.cfg.num_envs)?.into_iter().map(of_env).collect())
    }

    /// Applies forces to a body. Each is a point \[m\] and a force at that point \[N\], both in the frame of the
    /// environment, with the body in its current pose. `body` is its index in
    /// [`body_names`](crate::Entities::body_names).
    ///
    /// The forces act from the next step on, until other forces are set for the body, the environment is reset, or an
    /// entity is added. An empty list ends them. Their resultant at the center of mass (force and torque) stays
    /// constant in the world frame while the body moves; to model a spring, set the forces again in every step.
    /// Wrenches of [`RobotMut::set_external_wrench`](crate::RobotMut::set_external_wrench) act in addition.
    ///
    /// # Errors
    /// The environment or the body does not exist, or a number is not finite; then nothing changes.
    pub fn set_point_forces(&mut self, env: EnvId, body: usize, forces: &[([f64; 3], [f64; 3])]) -> Result<()> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let mujoco_body = body_frame(self.sim, body)?.body;
        for (of, numbers) in forces.iter().flat_map(|(point, force)| [("the point", point), ("the force", force)]) {
            if let Some(column) = numbers.iter().position(|x| !x.is_finite()) {
                let (item, value) = (of.to_string(), numbers[column]);
                return Err(Error::NotFinite { argument: "set_point_forces", row: env.0, column, item, value });
            }
        }
        self.sim.simulation.batch.write_at(env.0, Stage::Kinematics, |env| {
            let center = &env.data().xipos()[3 * mujoco_body..3 * mujoco_body + 3];
            let center = Vector3::new(center[0], center[1], center[2]);
            let of = |&(point, force): &([f64; 3], [f64; 3])| {
                let force = Vector3::from(force);
                [force, (Vector3::from(point) - center).cross(&force)]
            };
            let none = [Vector3::zeros(); 2];
            let [force, torque] = forces.iter().map(of).fold(none, |[f, t], [force, torque]| [f + force, t + torque]);
            env.set_wrenches(|wrenches| wrenches.set_user_wrench(body, mujoco_body, force, torque));
        });
        Ok(())
    }

    /// Clears the buffers that environments keep beside their state, in all of them for `env_ids = None`. Sensors
    /// restart from the current state, external wrenches end, and actuator models lose their memory (delays, motor
    /// states). Positions, velocities, targets and time stay. A diverged environment stays diverged.
    ///
    /// # Errors
    /// An environment does not exist; then no environment is cleared.
    pub fn reset_buffers(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.sim.reset_buffers(env_ids)
    }

    /// Sets the point of view of windows, browser views and screenshots, open and future ones: from `eye` to `target`
    /// in the frame of the overview \[m\], +z up. Users can move away from it; the Home key returns to it. Named as in
    /// Isaac Lab.
    ///
    /// # Errors
    /// The points are equal or not finite; then the view stays.
    pub fn set_camera_view(&mut self, eye: [f64; 3], target: [f64; 3]) -> Result<()> {
        let distance = eye.iter().zip(&target).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        if !(distance.is_finite() && distance > 1e-9) {
            return Err(Error::Config {
                field: "set_camera_view",
                value: format!("{eye:?}, {target:?}"),
                expected: "eye and target must be finite and different, in meters",
            });
        }
        let revision = self.sim.viewpoint.map_or(0, |view| view.revision) + 1;
        self.sim.viewpoint = Some(Viewpoint { eye, target, revision });
        Ok(())
    }

    /// Enables or disables the markers of a sensor, regardless of its configuration. Measurements are not affected.
    ///
    /// # Errors
    /// The sensor does not exist.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn set_debug_vis<S: Sensor>(&mut self, id: SensorId<S>, shown: bool) -> Result<()> {
        self.sim.sensors.set_debug_vis(self.sim.sensors.index_of(id), shown)
    }
}

/// Frame of a body on the body axis.
fn body_frame(sim: &SimulationManager, body: usize) -> Result<&BodyFrame> {
    let bodies = sim.simulation.body_axis.bodies();
    bodies.get(body).ok_or(Error::UnknownIndex { what: "body", index: body, count: bodies.len() })
}

/// Axes of all hinge and slide joints.
fn joint_axes(data: &Data) -> impl Iterator<Item = JointAxis> {
    let anchors = data.xanchor().as_chunks::<3>().0.iter().zip(data.xaxis().as_chunks::<3>().0);
    anchors.zip(data.model().jnt_type()).filter_map(|((anchor, axis), kind)| {
        let kind = *kind as u32;
        let is_slide = kind == mj::mjJNT_SLIDE;
        (is_slide || kind == mj::mjJNT_HINGE).then_some(JointAxis { anchor: *anchor, axis: *axis, is_slide })
    })
}
