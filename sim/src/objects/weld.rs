//! Welds: two bodies that are held together while somebody says so, in each environment by itself.

use super::weld_data::{WeldCfg, WeldData, WeldId};
use crate::body_pose::body_pose;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::index::WeldIndex;
use crate::manager::SimulationManager;
use crate::objects::rows::distinct_envs;
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use kinetoscope_mujoco as mj;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use ndarray::Array1;
use std::sync::Arc;

/// A weld, to read.
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

    /// The configuration it was added with.
    pub fn cfg(&self) -> &'a WeldCfg {
        self.cfg
    }

    /// Whether it holds in each environment, shape (N).
    pub fn is_attached(&self) -> Array1<bool> {
        let WeldIndex { equality, .. } = self.simulation.welds[self.index];
        let mut attached = Array1::from_elem(self.simulation.batch.num_envs(), false);
        self.simulation.batch.for_each(|i, env| {
            attached[i] = env.welds().iter().any(|weld| weld.equality == equality);
        });
        attached
    }
}

/// A weld, to make and to release.
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

    /// The weld, to read.
    pub fn read(&self) -> Weld<'_> {
        Weld::new(self.cfg, self.simulation, self.index)
    }

    /// Holds the two bodies as they now lie to each other, in `env_ids` (all where `None`), until it is released, the
    /// environment is reset, or a snapshot is restored in which it does not hold: a snapshot has which welds hold, and how. A
    /// weld that holds already holds as they lie now. A forward pass follows.
    ///
    /// It is MuJoCo's weld with its stiffest numbers: it gives way by about 1e-4 of the acceleration that its load would
    /// cause. The bodies still collide; [`exclude_collision`](crate::SimulationManager::exclude_collision) is for pairs that
    /// are in each other's way.
    ///
    /// # Errors
    /// Unknown environment, or one that is named twice; then nothing is changed.
    pub fn attach(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.change("attach", env_ids, true)
    }

    /// Lets the two bodies go, in `env_ids` (all where `None`). A forward pass follows.
    ///
    /// # Errors
    /// As [`attach`](Self::attach).
    pub fn release(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.change("release", env_ids, false)
    }

    fn change(&mut self, argument: &'static str, env_ids: Option<&[EnvId]>, attached: bool) -> Result<()> {
        let envs = distinct_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        let WeldIndex { equality, bodies } = self.simulation.welds[self.index];
        for &env in &envs {
            self.simulation.batch.write(env, |env| {
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
    /// Adds a weld between two bodies that are there, compiled as [`add_robot`](Self::add_robot) does. It holds nothing until
    /// it is [attached](WeldMut::attach).
    ///
    /// # Errors
    /// The name is taken, a body is not there, it is a whole robot, both are the same or held together by fixed joints, or
    /// none of them can move.
    pub fn add_weld(&mut self, cfg: WeldCfg) -> Result<WeldId> {
        self.check_world_uid(&cfg.uid)?;
        let model = self.simulation.batch.model();
        let body = |name: &str| match self.contents.bodies_called(name)?.as_deref() {
            None => Ok(0),
            Some(&[one]) => Ok(self.simulation.plan.bodies()[one].body),
            Some(_) => Err(Error::Config {
                field: "weld",
                value: format!("{name:?}"),
                expected: "a whole robot cannot be welded; name one of its links, such as \"arm/hand\"",
            }),
        };
        let (first, second) = (body(&cfg.first)?, body(&cfg.second)?);
        // What no joint holds apart moves as one; with 0 it is fixed or moved by hand (4.x gives that its own number).
        let [one, other] = [first, second].map(|body| {
            let carrier = model.body_weldid()[body] as usize;
            if model.body_mocapid()[carrier] >= 0 { 0 } else { carrier }
        });
        let fail = |expected| {
            Err(Error::Config { field: "weld", value: format!("{:?}", [&cfg.first, &cfg.second]), expected })
        };
        if first == second || one == other && one != 0 {
            return fail("the two must be different bodies; what a fixed joint holds is one body");
        }
        if one == other {
            return fail("one of the two must move by itself: both are fixed or moved by hand");
        }
        let second_is_fixed = other == 0;
        let mut contents = self.contents.clone();
        contents.welds.push(WeldData { cfg: Arc::new(cfg), second_is_fixed });
        self.replace_contents(contents, Vec::new())?;
        Ok(WeldId { manager: self.serial, index: self.contents.welds.len() - 1 })
    }

    /// A weld, to read.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn weld(&self, id: WeldId) -> Weld<'_> {
        let index = self.index_of(id.manager, id.index);
        Weld::new(&self.contents.welds[index].cfg, &self.simulation, index)
    }

    /// A weld, to make and to release.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn weld_mut(&mut self, id: WeldId) -> WeldMut<'_> {
        let index = self.index_of(id.manager, id.index);
        WeldMut::new(&self.contents.welds[index].cfg, &mut self.simulation, &mut self.sensors, index)
    }
}
