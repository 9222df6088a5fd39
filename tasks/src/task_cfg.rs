//! Tasks as text: terms by the name of their type.

use crate::autoreset::AutoresetMode;
use crate::builder::EnvBuilder;
use crate::cfg::EnvCfg;
use crate::error::{EnvError, Result, TermKind};
use crate::group::POLICY_GROUP;
use crate::image::ImageTerm;
use crate::observation::{Noise, ObservationTerm};
use crate::registry::{TermArgs, TermRegistry};
use kinetoscope_sim::SimulationManager;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// A task as text: the terms by name, each a table with its `type` and the numbers of that type.
///
/// ```toml
/// decimation = 4
/// episode_steps = 500
/// autoreset = "next_step"
///
/// [actions.turn]
/// type = "relative_joint_positions"
/// step = 0.1
///
/// [observations.policy.angles]
/// type = "joint_pos_rel"
/// noise = { std = 0.01 }
/// scale = 2.0
///
/// [rewards.upright]
/// type = "flat_orientation"
/// weight = -1.0
///
/// [terminations.fallen]
/// type = "root_height_below_minimum"
/// height = 0.3
/// ```
///
/// Some keys belong to the kind of a term, not to its type; image terms have none of them:
///
/// | kind | keys |
/// |---|---|
/// | observations | `noise` (`{ std = 0.1 }` or `{ low = -0.1, high = 0.1 }`), `clip` (`[low, high]`), `scale` |
/// | rewards | `weight`, required |
/// | terminations | `truncating`, false if it is left out |
///
/// [`TermRegistry::names`] lists the types of a kind. Terms act in the order of the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TaskCfg {
    /// Physics steps in one step of the task; `None` for 1.
    pub decimation: Option<u32>,
    /// Steps of the task after which an episode is truncated; `None` for no limit.
    pub episode_steps: Option<u64>,
    /// Name of the [`AutoresetMode`]; `None` for `same_step`.
    pub autoreset: Option<String>,
    /// Action terms.
    pub actions: Table,
    /// Command terms.
    pub commands: Table,
    /// Curriculum terms.
    pub curricula: Table,
    /// Event terms.
    pub events: Table,
    /// Observation groups, each with its terms. Images are terms of a group like numbers.
    pub observations: Table,
    /// Reward terms.
    pub rewards: Table,
    /// Termination terms.
    pub terminations: Table,
}

impl TaskCfg {
    /// Reads a task from TOML.
    ///
    /// # Errors
    /// The text is not TOML, or has an unknown key or a value of a wrong type; the error has its line. Types and
    /// numbers of terms are checked when the task is built.
    pub fn from_toml(text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|error| EnvError::TaskText { place: "task".into(), error: error.to_string() })
    }

    /// Lengths of steps and episodes, and the mode of automatic resets.
    ///
    /// # Errors
    /// The name of the mode is unknown.
    pub fn env_cfg(&self) -> Result<EnvCfg> {
        let autoreset = self.autoreset.as_deref().map_or(Ok(AutoresetMode::default()), str::parse)?;
        Ok(EnvCfg {
            decimation: self.decimation.unwrap_or(EnvCfg::default().decimation),
            episode_steps: self.episode_steps,
            autoreset,
        })
    }
}

impl EnvBuilder {
    /// Starts a task with the terms of `cfg`, whose types are those of `registry`. More terms can be added.
    ///
    /// # Errors
    /// The type of a term, the name of a robot, joint or sensor, or a key is unknown, with candidates; or a number is
    /// missing or out of range. The error names the term.
    pub fn from_cfg(sim: SimulationManager, cfg: &TaskCfg, registry: &TermRegistry) -> Result<Self> {
        let mut builder = Self::new(sim, cfg.env_cfg()?);
        builder.add_terms(cfg, registry)?;
        Ok(builder)
    }

    /// Adds the terms of `cfg`, whose types are those of `registry`; the lengths and the mode of `cfg` are not used.
    ///
    /// # Errors
    /// Those of [`from_cfg`](Self::from_cfg). The builder then has the terms before the invalid one, and
    /// [`into_sim`](Self::into_sim) returns the unchanged simulation.
    pub fn add_terms(&mut self, cfg: &TaskCfg, registry: &TermRegistry) -> Result<()> {
        for (kind, terms) in [
            (TermKind::Action, &cfg.actions),
            (TermKind::Command, &cfg.commands),
            (TermKind::Curriculum, &cfg.curricula),
            (TermKind::Event, &cfg.events),
            (TermKind::Reward, &cfg.rewards),
            (TermKind::Termination, &cfg.terminations),
        ] {
            for (name, value) in terms {
                self.add(kind, &format!("{}.{name}", table_name(kind)), name, value, registry)?;
            }
        }
        for (group, terms) in &cfg.observations {
            let place = format!("observations.{group}");
            let is_term = |table: &Table| table.get("type").is_some_and(Value::is_str);
            let Some(terms) = terms.as_table().filter(|terms| !is_term(terms)) else {
                let error = format!("it must be a group of terms, such as [observations.{POLICY_GROUP}.{group}]");
                return Err(EnvError::TaskText { place, error });
            };
            for (name, value) in terms {
                self.add_observation(group, &format!("{place}.{name}"), name, value, registry)?;
            }
        }
        Ok(())
    }

    /// Adds a term of any kind but observations.
    fn add(&mut self, kind: TermKind, place: &str, name: &str, value: &Value, registry: &TermRegistry) -> Result<()> {
        let mut table = table(place, value)?;
        let of_type = take_type(kind, place, &mut table)?;
        let weight = match kind {
            TermKind::Reward => Some(take_number(place, &mut table, "weight")?.ok_or_else(|| EnvError::TaskText {
                place: place.into(),
                error: "the key `weight` is missing".into(),
            })?),
            _ => None,
        };
        let truncating = match kind {
            TermKind::Termination => take(place, &mut table, "truncating")?.unwrap_or(false),
            _ => false,
        };
        let columns = self.columns();
        let args = TermArgs::new(&self.sim, &columns, (name, place), weight.unwrap_or(1.0), table);
        let terms = &mut self.terms;
        match kind {
            TermKind::Action => terms.actions.push(registry.actions.make(kind, &of_type, args)?),
            TermKind::Command => terms.commands.push(registry.commands.make(kind, &of_type, args)?),
            TermKind::Curriculum => terms.curricula.push(registry.curricula.make(kind, &of_type, args)?),
            TermKind::Event => terms.events.push(registry.events.make(kind, &of_type, args)?),
            TermKind::Reward => terms.rewards.push(registry.rewards.make(kind, &of_type, args)?),
            _ => {
                let term = registry.terminations.make(TermKind::Termination, &of_type, args)?;
                terms.terminations.push(if truncating { term.truncating() } else { term });
            }
        }
        Ok(())
    }

    /// Adds an observation term, or images, to a group.
    fn add_observation(
        &mut self,
        group: &str,
        place: &str,
        name: &str,
        value: &Value,
        registry: &TermRegistry,
    ) -> Result<()> {
        let mut table = table(place, value)?;
        let kind = TermKind::Observation;
        let of_type = take_type(kind, place, &mut table)?;
        let columns = self.columns();
        if registry.images.has(&of_type) {
            let args = TermArgs::new(&self.sim, &columns, (name, place), 1.0, table);
            let term: ImageTerm = registry.images.make(kind, &of_type, args)?;
            self.terms.group(group).images.push(term);
            return Ok(());
        }
        let noise: Option<NoiseCfg> = take(place, &mut table, "noise")?;
        let clip: Option<[f64; 2]> = take(place, &mut table, "clip")?;
        let scale = take_number(place, &mut table, "scale")?;
        let args = TermArgs::new(&self.sim, &columns, (name, place), 1.0, table);
        let names = registry.images.names();
        let mut term: ObservationTerm = registry.observations.make_or(kind, &of_type, args, &names)?;
        if let Some(noise) = noise {
            term = term.with_noise(noise.into());
        }
        if let Some(clip) = clip {
            term = term.clipped(clip);
        }
        if let Some(scale) = scale {
            term = term.scaled(scale);
        }
        self.terms.group(group).terms.push(term);
        Ok(())
    }
}

/// Noise of an observation term in a file.
#[derive(Deserialize)]
#[serde(untagged)]
enum NoiseCfg {
    Normal(NormalCfg),
    Uniform(UniformCfg),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NormalCfg {
    std: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UniformCfg {
    low: f64,
    high: f64,
}

impl From<NoiseCfg> for Noise {
    fn from(cfg: NoiseCfg) -> Self {
        match cfg {
            NoiseCfg::Normal(NormalCfg { std }) => Self::Normal { std },
            NoiseCfg::Uniform(UniformCfg { low, high }) => Self::Uniform { low, high },
        }
    }
}

/// Name of the table of a kind of terms.
fn table_name(kind: TermKind) -> &'static str {
    match kind {
        TermKind::Action => "actions",
        TermKind::Command => "commands",
        TermKind::Curriculum => "curricula",
        TermKind::Event => "events",
        TermKind::Observation => "observations",
        TermKind::Reward => "rewards",
        TermKind::Termination => "terminations",
    }
}

fn table(place: &str, value: &Value) -> Result<Table> {
    value.as_table().cloned().ok_or_else(|| EnvError::TaskText {
        place: place.into(),
        error: format!("it is {value}; expected a table with the key `type`"),
    })
}

/// Removes the type of a term from its table.
fn take_type(kind: TermKind, place: &str, table: &mut Table) -> Result<String> {
    take(place, table, "type")?.ok_or_else(|| EnvError::TaskText {
        place: place.into(),
        error: format!("the key `type` is missing; it names the type of the {kind} term"),
    })
}

/// Removes a key from a table, and reads its value.
fn take<T: for<'de> Deserialize<'de>>(place: &str, table: &mut Table, key: &str) -> Result<Option<T>> {
    let value = table.remove(key).map(T::deserialize).transpose();
    value.map_err(|error| EnvError::TaskText { place: format!("{place}.{key}"), error: error.to_string() })
}

/// Removes a number from a table; whole numbers may be written without a point.
fn take_number(place: &str, table: &mut Table, key: &str) -> Result<Option<f64>> {
    take(place, table, key)
}
