//! Runtime state of a compiled scene.

use crate::batch::Batch;
use crate::capture::BodyAxis;
use crate::entity_set::EntitySet;
use crate::env::Stage;
use crate::indexing::{BodyIndexing, MjcfIndexing, RobotIndexing, WeldIndexing, joint_widths};
use crate::randomization::{ModelPatcher, PropertyTables, StoredOverrides};
use crate::simulation_cfg::SimulationManagerCfg;
use crate::snapshot::StateLayout;
use crate::visible::{self, Lighting, MaskId, MaskIdMap, Replacements, VisualCache, VisualScene};
use crate::wrenches::Wrenches;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::ObjectKind;
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_scene::EnvScene;
use std::sync::{Arc, Mutex, OnceLock};

/// A compiled scene and its environments.
#[derive(Debug)]
pub(crate) struct Simulation {
    pub(crate) batch: Batch,
    pub(crate) robots: Vec<RobotIndexing>,
    pub(crate) objects: Vec<BodyIndexing>,
    pub(crate) mjcf_models: Vec<MjcfIndexing>,
    pub(crate) welds: Vec<WeldIndexing>,
    pub(crate) identities: MaskIdMap,
    /// Body frames and geom owners, for contacts and motion of sensors.
    pub(crate) body_axis: Arc<BodyAxis>,
    /// The visual scene; `None` until a sensor or viewer needs it.
    pub(crate) visual_scene: Option<Arc<VisualScene>>,
    pub(crate) xml: String,
    pub(crate) diagnostics: Vec<Diagnostic>,
    pub(crate) initial_state: Arc<InitialState>,
    /// Layout of saved states, which distinguishes snapshots of this scene from those of others.
    pub(crate) layout: Arc<StateLayout>,
    /// Model elements whose properties can differ per environment; filled on first use.
    pub(crate) property_tables: OnceLock<Arc<PropertyTables>>,
    /// Builds models with per-environment properties; `None` before the first randomization. The lock only lets threads
    /// share the other fields.
    pub(crate) model_patcher: Mutex<Option<ModelPatcher>>,
    /// Own property values of each environment.
    pub(crate) property_overrides: Vec<StoredOverrides>,
    /// Render scenes of environments with their own sizes or colors; empty without such environments, or before the
    /// visual scene exists.
    pub(crate) env_scenes: Vec<EnvScene>,
    /// True for each geom that stands in for a visual mesh and has only a pose.
    pub(crate) visual_proxies: Vec<bool>,
    /// Pairs of body names excluded from contact because the bodies overlap in the initial pose.
    pub(crate) overlap_exclusions: Vec<(String, String)>,
}

/// Initial state, as differences from the model's `qpos0`.
#[derive(Clone, Debug, Default)]
pub(crate) struct InitialState {
    /// (address in `qpos`, position \[rad or m\]).
    pub qpos: Vec<(usize, f64)>,
    /// (drive index, position target \[rad or m\]).
    pub targets: Vec<(usize, f64)>,
}

impl Simulation {
    /// Mask ids of all entities and links.
    pub(crate) fn mask_ids(&self) -> &[MaskId] {
        self.identities.table()
    }

    /// Returns the visual scene and builds it on the first call.
    pub(crate) fn build_visual_scene(
        &mut self,
        cfg: &SimulationManagerCfg,
        contents: &EntitySet,
        cache: &mut VisualCache,
    ) -> Arc<VisualScene> {
        if let Some(visible) = &self.visual_scene {
            return Arc::clone(visible);
        }
        let mut replacements = Replacements::new();
        let ground = self.batch.model().id(ObjectKind::Geom, "ground");
        if let (Some(geom), Some(cfg)) = (ground, &cfg.ground) {
            replacements.insert(geom, vec![visible::ground(cfg)]);
        }
        for (data, index) in contents.robots.iter().zip(&self.robots) {
            cache.check_robot(data);
            for geom in &index.geoms {
                let link = &data.description().links[geom.link];
                if let Some(visual) = geom.visual.and_then(|v| link.visuals.get(v)) {
                    replacements.insert(geom.geom, cache.parts(&link.name, visual));
                }
            }
        }
        for object in &contents.objects {
            let geom = self.batch.model().id(ObjectKind::Geom, &format!("{}/visual", object.uid()));
            if let Some(geom) = geom {
                replacements.insert(geom, cache.object_parts(object));
            }
        }
        let model = self.batch.model();
        let (surfaces, look) = (contents.surfaces(), Lighting::of(cfg, contents));
        let visible =
            VisualScene::extract(model, &self.identities, &replacements, self.body_axis.bodies(), &surfaces, &look)
                .with_light_cfgs(model, &cfg.lights);
        let visible = Arc::new(visible);
        self.visual_scene = Some(Arc::clone(&visible));
        for (env, error) in self.rebuild_env_scenes() {
            cache.warn_env_scene(env, &error);
        }
        visible
    }

    /// Index in MuJoCo's `ctrl` of a drive.
    pub(crate) fn drive_ctrl_index(&self, drive: usize) -> usize {
        self.batch.read_row(0, |row| row.drives.table().drives[drive].ctrl)
    }

    /// Resets the chosen environments to the initial state.
    pub(crate) fn reset(&mut self, chosen: &[bool]) {
        let start = &self.initial_state;
        let chosen: Vec<usize> = (0..chosen.len()).filter(|&i| chosen[i]).collect();
        self.batch.run_in(&chosen, |_, env| {
            env.reset_state(|data, drives| {
                for &(address, position) in &start.qpos {
                    data.qpos_mut()[address] = position;
                }
                for &(drive, target) in &start.targets {
                    let [low, high] = drives.ranges[drive];
                    drives.position[drive] = target.clamp(low, high);
                }
            });
        });
    }

    /// Copies the state of every entity that `old` has too: positions, velocities, warm start, targets, controls,
    /// wrenches, attached welds, time. Joints and bodies are matched by name, everything else by insertion order.
    /// Forces of [`set_point_forces`](crate::SceneViewMut::set_point_forces) end. Divergence is copied as well: a
    /// diverged environment stays frozen until it is reset.
    pub(crate) fn transfer_state_from(&mut self, old: &Self) {
        let (old_model, model) = (old.batch.model(), self.batch.model());
        let mut qpos = Vec::new();
        let mut dofs = Vec::new();
        for joint in 0..old_model.njnt() {
            let Some(new) = old_model.name(ObjectKind::Joint, joint).and_then(|n| model.id(ObjectKind::Joint, &n))
            else {
                continue;
            };
            let (nq, nv) = joint_widths(old_model.jnt_type()[joint]);
            let at = |m: &mj::Model, j: usize| (m.jnt_qposadr()[j] as usize, m.jnt_dofadr()[j] as usize);
            let ((from_q, from_v), (to_q, to_v)) = (at(old_model, joint), at(model, new));
            qpos.extend((0..nq).map(|k| (from_q + k, to_q + k)));
            dofs.extend((0..nv).map(|k| (from_v + k, to_v + k)));
        }
        let drives: Vec<(usize, usize)> = old
            .robots
            .iter()
            .zip(&self.robots)
            .flat_map(|(old, new)| old.joints.iter().zip(&new.joints))
            .filter_map(|(old, new)| Some((old.drive?, new.drive?)))
            .collect();
        let bodies: Vec<Option<usize>> = (0..old_model.nbody())
            .map(|body| old_model.name(ObjectKind::Body, body).and_then(|name| model.id(ObjectKind::Body, &name)))
            .collect();
        let parts = StateTransfer::new(old, self);
        // Old and new welds correspond by insertion order.
        let equality = |old_weld: usize| {
            let at = old.welds.iter().position(|weld| weld.equality == old_weld)?;
            self.welds.get(at).map(|weld| weld.equality)
        };
        let moved = |weld: &mj::Weld| Some(mj::Weld { equality: equality(weld.equality)?, ..*weld });
        self.batch.add_growths_of(&old.batch);
        for i in 0..self.batch.num_envs() {
            let part_state = old.batch.read_at(i, Stage::Raw, |env| parts.read(env.data()));
            let (state, time, targets, history) = old
                .batch
                .read_at(i, Stage::Raw, |env| (env.state_arrays(), env.data().time(), env.drives.clone(), env.stats()));
            let wrenches = old.batch.read_row(i, |row| row.wrenches().remapped(|body| bodies[body]));
            let held: Vec<mj::Weld> = old.batch.read_row(i, |row| row.welds().iter().filter_map(moved).collect());
            self.batch.write_at(i, Stage::Raw, |env| {
                for &(from, to) in &drives {
                    env.drives.copy_from(&targets, from, to);
                }
                for &(from, to) in &dofs {
                    env.drives.copy_applied_from(&targets, from, to);
                }
                env.write_state(|data| {
                    for &(from, to) in &qpos {
                        data.qpos_mut()[to] = state.qpos[from];
                    }
                    for &(from, to) in &dofs {
                        data.qvel_mut()[to] = state.qvel[from];
                        data.qacc_warmstart_mut()[to] = state.warmstart[from];
                    }
                    parts.write(&part_state, data);
                    data.set_time(time);
                });
                env.set_welds(held);
                if wrenches != Wrenches::default() {
                    env.reach(Stage::Kinematics);
                    env.set_wrenches(|mine| *mine = wrenches);
                }
                env.add_stats(&history);
            });
        }
    }
}

/// Index pairs (old, new) of the states besides joints: those of attached MJCF files and of mocap objects.
struct StateTransfer {
    controls: Vec<(usize, usize)>,
    activations: Vec<(usize, usize)>,
    mocaps: Vec<(usize, usize)>,
}

/// Values of a [`StateTransfer`] in one environment.
struct TransferredState {
    controls: Vec<f64>,
    activations: Vec<f64>,
    mocaps: Vec<([f64; 3], [f64; 4])>,
}

impl StateTransfer {
    fn new(old: &Simulation, new: &Simulation) -> Self {
        let pairs = |of: fn(&MjcfIndexing) -> &Vec<usize>| {
            let parts = old.mjcf_models.iter().zip(&new.mjcf_models);
            parts.flat_map(|(old, new)| of(old).iter().copied().zip(of(new).iter().copied())).collect::<Vec<_>>()
        };
        let number = |model: &mj::Model, body: usize| usize::try_from(model.body_mocapid()[body]).unwrap_or(0);
        let objects = old.objects.iter().zip(&new.objects).filter_map(|(old, new)| old.mocap.zip(new.mocap));
        let mocaps = pairs(|part| &part.mocap_bodies).into_iter();
        Self {
            controls: pairs(|part| &part.controls),
            activations: pairs(|part| &part.activations),
            mocaps: mocaps
                .map(|(from, to)| (number(old.batch.model(), from), number(new.batch.model(), to)))
                .chain(objects)
                .collect(),
        }
    }

    fn read(&self, data: &mj::Data) -> TransferredState {
        let mocap = |k: usize| (data.mocap_pos().as_chunks::<3>().0[k], data.mocap_quat().as_chunks::<4>().0[k]);
        TransferredState {
            controls: self.controls.iter().map(|&(from, _)| data.ctrl()[from]).collect(),
            activations: self.activations.iter().map(|&(from, _)| data.act()[from]).collect(),
            mocaps: self.mocaps.iter().map(|&(from, _)| mocap(from)).collect(),
        }
    }

    fn write(&self, state: &TransferredState, data: &mut mj::Data) {
        for (&(_, to), value) in self.controls.iter().zip(&state.controls) {
            data.ctrl_mut()[to] = *value;
        }
        for (&(_, to), value) in self.activations.iter().zip(&state.activations) {
            data.act_mut()[to] = *value;
        }
        for (&(_, to), (position, quaternion)) in self.mocaps.iter().zip(&state.mocaps) {
            data.mocap_pos_mut().as_chunks_mut::<3>().0[to] = *position;
            data.mocap_quat_mut().as_chunks_mut::<4>().0[to] = *quaternion;
        }
    }
}
