//! Welds: rigid connections of two bodies that can be switched in each environment.

use super::weld_data::{WeldCfg, WeldData, WeldId};
use crate::body_pose::body_pose;
use crate::env::Stage;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::indexing::WeldIndexing;
use crate::manager::SimulationManager;
use crate::objects::rows::unique_envs;
use crate::row::RowPart;
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use kinetoscope_mujoco as mj;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use ndarray::Array1;
use std::sync::Arc;

/// Read access to a weld.
#[derive(Clone, Copy, Debug)]
pub struct Weld<'a> {
    cfg: &'a Arc<WeldCfg>,
    simulation: &'a Simulation,
    index: usize,
}

impl<'a> Weld<'a> {
    pub(crate) fn new(cfg: &'a Arc<WeldCfg>, simulation: &'a Simulation, index: usize) -> Self {
        Self { cfg, simulation, index }
    }

    /// Configuration that the weld was added with.
    pub fn cfg(&self) -> &'a WeldCfg {
        self.cfg
    }

    /// True where the weld holds, shape (N).
    pub fn is_attached(&self) -> Array1<bool> {
        let WeldIndexing { equality, .. } = self.simulation.welds[self.index];
        let mut attached = Array1::from_elem(self.simulation.batch.num_envs(), false);
        self.simulation.batch.for_each_row(RowPart::Inputs, |i, env| {
            attached[i] = env.welds().iter().any(|weld| weld.equality == equality);
        });
        attached
    }
}

/// Write access to a weld: attaches and releases it in each environment.
#[derive(Debug)]
pub struct WeldMut<'a> {
    cfg: &'a Arc<WeldCfg>,
    simulation: &'a mut Simulation,
    sensors: &'a mut SensorList,
    index: usize,
}

impl<'a> WeldMut<'a> {
    pub(crate) fn new(
        cfg: &'a Arc<WeldCfg>,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
        index: usize,
    ) -> Self {
        Self { cfg, simulation, sensors, index }
    }

    /// Read access to the weld.
    pub fn read(&self) -> Weld<'_> {
        Weld::new(self.cfg, self.simulation, self.index)
    }

    /// Attaches the two bodies at their current relative pose, in `env_ids` (`None` for all environments). Each
    /// environment has its own pose. If the weld already holds, its relative pose is replaced by the current one. A
    /// forward pass follows.
    ///
    /// The weld holds until it is released, the environment is reset, or a snapshot is restored in which it does not
    /// hold: a snapshot records the welds that hold and their relative poses.
    ///
    /// The weld is a MuJoCo weld constraint with the largest impedance, 0.9999: about 1e-4 of the relative acceleration
    /// that the load would cause without the weld remains. The bodies still collide; use
    /// [`exclude_collision`](crate::SimulationManager::exclude_collision) if they overlap.
    ///
    /// # Errors
    /// An unknown or repeated environment; then nothing is changed.
    pub fn attach(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.set_attached("attach", env_ids, true)
    }

    /// Releases the two bodies, in `env_ids` (`None` for all environments). A forward pass follows.
    ///
    /// # Errors
    /// Same errors as [`attach`](Self::attach).
    pub fn release(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.set_attached("release", env_ids, false)
    }

    fn set_attached(&mut self, argument: &'static str, env_ids: Option<&[EnvId]>, attached: bool) -> Result<()> {
        let envs = unique_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        let WeldIndexing { equality, bodies } = self.simulation.welds[self.index];
        for &env in &envs {
            self.simulation.batch.write_at(env, Stage::Kinematics, |env| {
                let [first, second]: [Pose; 2] = bodies.map(|body| body_pose(env.data(), body));
                let mut welds: Vec<mj::Weld> =
                    env.welds().iter().filter(|weld| weld.equality != equality).copied().collect();
                if attached {
                    welds.push(mj::Weld { equality, pose: to_row(&(first.inverse() * second)) });
                }
                env.set_welds(welds);
            });
        }
        self.sensors.refresh(&envs, self.simulation);
        Ok(())
    }
}

impl SimulationManager {
    /// Adds a weld between two existing bodies. The model is compiled in this call, as in
    /// [`add_robot`](Self::add_robot). The weld does not hold until it is [attached](WeldMut::attach).
    ///
    /// # Errors
    /// The name is taken, a body does not exist or names a robot with several links, both bodies are the same or
    /// connected by fixed joints, or neither of them can move.
    pub fn add_weld(&mut self, cfg: WeldCfg) -> Result<WeldId> {
        self.check_world_uid(&cfg.uid)?;
        let model = self.simulation.batch.model();
        let body = |name: &str| match self.entities.find_bodies(name)?.as_deref() {
            None => Ok(0),
            Some(&[one]) => Ok(self.simulation.body_axis.bodies()[one].body),
            Some(_) => Err(Error::Config {
                field: "weld",
                value: format!("{name:?}"),
                expected: "a whole robot cannot be welded; name one of its links, such as \"arm/hand\"",
            }),
        };
        let (first, second) = (body(&cfg.first)?, body(&cfg.second)?);
        // Bodies without a joint between them move as one. 0 means fixed or kinematic; 4.x gives mocap bodies an index
        // of their own.
        let [one, other] = [first, second].map(|body| {
            let carrier = model.body_weldid()[body] as usize;
            if model.body_mocapid()[carrier] >= 0 { 0 } else { carrier }
        });
        let fail = |expected| {
            Err(Error::Config { field: "weld", value: format!("{:?}", [&cfg.first, &cfg.second]), expected })
        };
        if first == second || one == other && one != 0 {
            return fail("the two must be different bodies; links connected by fixed joints are one body");
        }
        if one == other {
            return fail("at least one of the two bodies must be dynamic; both are fixed or kinematic");
        }
        let second_is_fixed = other == 0;
        let mut contents = self.entities.clone();
        contents.welds.push(WeldData { cfg: Arc::new(cfg), second_is_fixed });
        self.recompile_with(contents, Vec::new())?;
        Ok(WeldId { manager: self.serial, index: self.entities.welds.len() - 1 })
    }

    /// Read access to a weld.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn weld(&self, id: WeldId) -> Weld<'_> {
        let index = self.index_of(id.manager, id.index);
        Weld::new(&self.entities.welds[index].cfg, &self.simulation, index)
    }

    /// Write access to a weld: attaches and releases it in each environment.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn weld_mut(&mut self, id: WeldId) -> WeldMut<'_> {
        let index = self.index_of(id.manager, id.index);
        WeldMut::new(&self.entities.welds[index].cfg, &mut self.simulation, &mut self.sensors, index)
    }
}
