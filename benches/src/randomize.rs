//! Randomization of properties per environment: masses of all links and friction of all shapes.
//!
//! The baseline is the usual way with bare MuJoCo: a whole model for each environment (`mj_copyModel`), to which the
//! values are written, then `mj_setConst` (in a small `mjData`, created with the copy). Our side also resolves names
//! and checks values. Neither side runs a forward pass; ours runs it at the next read or step. The time of
//! `mj_setConst` alone is the limit of both. The last row is the time of a step of randomized environments, whose
//! differences are written to the model of a thread, beside that of environments with the nominal model.

use crate::interleave::{Contender, MeasurementCfg, measure};
use crate::models::sr5;
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::mujoco::{Model, ModelEditor};
use kinetoscope::prelude::*;
use kinetoscope::scene::KeyedRng;
use kinetoscope::sim::Result;
use std::time::{Duration, Instant};

const ENVS: usize = 1024;
/// Environments of the baseline that is not created again, each with a model and an `mjData`: more of them would not fit
/// in the memory of small machines.
const KEPT: usize = 256;
/// Target: memory of the differences of an environment \[KiB\].
const LIMIT: f64 = 2.0;
/// Target: how many times faster a draw is than copies of the model.
const FASTER: f64 = 3.0;
const CASE: &str = "SR5 + hand, masses and friction";
const RIVAL: &str = "whole models";

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let (sim, _) = sr5(ENVS, 1)?;
    let model = sim.batch().model().clone();
    let mut ours = Ours(sim);
    let mut baseline = ModelPerEnv {
        editors: editors(&model, KEPT)?,
        masses: model.body_mass().to_vec(),
        model: model.clone(),
        randomizations: 0,
    };
    let plan = MeasurementCfg { seconds: settings.seconds, restart_after: u32::MAX };
    let mut constants = ConstantsAlone(editors(&model, 1)?.remove(0), model.clone());
    let times = measure(plan, &mut [&mut ours, &mut baseline, &mut constants])?;
    let micros = |side| times.per_step(side) / ENVS as f64 * 1e6;
    let again = Row::new("randomize", format!("{CASE}, again"), "µs/env", 1, micros(0));
    let limit = Row::new("randomize", format!("{CASE}, again, beside mj_setConst"), "µs/env", 1, micros(0));

    let (mut ours, mut baseline) =
        (FirstRandomization, FirstModelPerEnv { masses: model.body_mass().to_vec(), model: model.clone() });
    let firsts = measure(plan, &mut [&mut ours, &mut baseline])?;
    let micros_first = |side| firsts.per_step(side) / ENVS as f64 * 1e6;
    let first = Row::new("randomize", format!("{CASE}, first time"), "µs/env", 1, micros_first(0));

    let (mut sim, _) = sr5(ENVS, 1)?;
    randomize(&mut sim)?;
    let bytes = (0..ENVS).map(|env| sim.properties().bytes(EnvId(env))).sum::<Result<usize>>()? as f64 / ENVS as f64;
    let whole = model.shared_bytes() as f64;
    let memory = Row::new("randomize", format!("{CASE}, memory"), "KiB/env", 1, bytes / 1024.0);

    let (nominal, _) = sr5(ENVS, 1)?;
    let steps = measure(plan, &mut [&mut Steps(sim), &mut Steps(nominal)])?;
    let micros_step = |side| steps.per_step(side) / ENVS as f64 * 1e6;
    let step = Row::new("randomize", "SR5 + hand, step of randomized environments", "µs/env", 1, micros_step(0));
    Ok(vec![
        first.against(RIVAL, micros_first(1), firsts.ratio(0, 1)).with_target_ratio(FASTER),
        again.against(RIVAL, micros(1), times.ratio(0, 1)),
        limit.against("mj_setConst alone", micros(2), times.ratio(0, 2)),
        memory.against(RIVAL, whole / 1024.0, whole / bytes).with_target_ratio(whole / 1024.0 / LIMIT),
        step.against("one model", micros_step(1), steps.ratio(0, 1)),
    ])
}

fn randomize(sim: &mut SimulationManager) -> BenchResult<()> {
    let randomization = Randomization::new().with(Property::Mass, ".*", RandomizationOp::Scale([0.8, 1.2])).with(
        Property::Friction,
        ".*",
        RandomizationOp::Scale([0.5, 1.5]),
    );
    Ok(sim.properties_mut().randomize(&randomization, None)?)
}

fn editors(model: &Model, count: usize) -> BenchResult<Vec<ModelEditor>> {
    Ok((0..count).map(|_| ModelEditor::new(model)).collect::<Result<_, _>>()?)
}

/// The random writes of the baseline: as many numbers as ours.
fn write(editor: &mut ModelEditor, model: &Model, random: &mut KeyedRng) -> BenchResult<()> {
    let mut factor = |low: f64, high: f64| random.uniform_range(low, high);
    for body in 1..model.nbody() {
        let scale = factor(0.8, 1.2);
        editor.body_mass_mut()[body] = model.body_mass()[body] * scale;
        for k in 3 * body..3 * body + 3 {
            editor.body_inertia_mut()[k] = model.body_inertia()[k] * scale;
        }
    }
    for geom in 0..model.ngeom() {
        editor.geom_friction_mut()[3 * geom] = model.geom_friction()[3 * geom] * factor(0.5, 1.5);
    }
    Ok(editor.set_constants()?)
}

/// Randomizes environments that were randomized before.
struct Ours(SimulationManager);

impl Contender for Ours {
    fn restart(&mut self) -> BenchResult<()> {
        randomize(&mut self.0)
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            randomize(&mut self.0)?;
        }
        Ok(start.elapsed())
    }
}

/// Steps all environments.
struct Steps(SimulationManager);

impl Contender for Steps {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(self.0.reset(None)?)
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        self.0.update(steps);
        Ok(start.elapsed())
    }
}

/// `mj_setConst` on one model with random masses.
struct ConstantsAlone(ModelEditor, Model);

impl Contender for ConstantsAlone {
    fn restart(&mut self) -> BenchResult<()> {
        write(&mut self.0, &self.1, &mut KeyedRng::keyed(0, 0, "constants"))
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..ENVS as u32 * steps {
            self.0.set_constants()?;
        }
        Ok(start.elapsed())
    }
}

/// The baseline: a whole model for each environment.
struct ModelPerEnv {
    editors: Vec<ModelEditor>,
    masses: Vec<f64>,
    model: Model,
    randomizations: u64,
}

impl Contender for ModelPerEnv {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            for env in 0..ENVS {
                let mut random = KeyedRng::keyed(0, env as u64, &self.randomizations.to_string());
                write(&mut self.editors[env % KEPT], &self.model, &mut random)?;
            }
            self.randomizations += 1;
        }
        let time = start.elapsed();
        // Checks that the work was done.
        if self.editors.iter_mut().any(|editor| editor.body_mass_mut() == self.masses) {
            return Err("the baseline changed no mass".into());
        }
        Ok(time)
    }
}

/// Randomizes a new simulation.
struct FirstRandomization;

impl Contender for FirstRandomization {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let mut time = Duration::ZERO;
        for _ in 0..steps {
            let (mut sim, _) = sr5(ENVS, 1)?;
            let start = Instant::now();
            randomize(&mut sim)?;
            time += start.elapsed();
        }
        Ok(time)
    }
}

/// The baseline's first randomization: copies the model for each environment.
struct FirstModelPerEnv {
    masses: Vec<f64>,
    model: Model,
}

impl Contender for FirstModelPerEnv {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let mut time = Duration::ZERO;
        for _ in 0..steps {
            let start = Instant::now();
            let mut editors = editors(&self.model, ENVS)?;
            for (env, editor) in editors.iter_mut().enumerate() {
                write(editor, &self.model, &mut KeyedRng::keyed(0, env as u64, "first"))?;
            }
            time += start.elapsed();
            if editors.iter_mut().any(|editor| editor.body_mass_mut() == self.masses) {
                return Err("the baseline changed no mass".into());
            }
        }
        Ok(time)
    }
}
