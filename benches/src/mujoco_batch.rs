//! Batched stepping, compared with `mujoco.batch` and with the package `mjbatch` from Python: the same model, states and
//! threads, in turns. The two processes are started in both orders, half the time each: ratios are geometric means of
//! the two, rates are means.

use crate::baseline::{self, Process};
use crate::interleave::{Contender, MeasurementCfg, compare, measure};
use crate::models::{Case, STEPS};
use crate::mujoco_batch_reads;
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use crate::step::Ours;
use serde_json::json;
use std::ffi::OsString;
use std::path::Path;
use std::time::Duration;

pub(crate) const ENVS: [usize; 3] = [64, 1024, 4096];
pub(crate) const THREADS: [usize; 2] = [1, 2];

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let python = baseline::python("mujoco.batch");
    let mjbatch = baseline::python_with_mjbatch();
    let mut rows = Vec::new();
    for case in Case::humanoid()?.into_iter().chain([Case::sr5()?]) {
        for (envs, threads) in ENVS.into_iter().flat_map(|envs| THREADS.map(|threads| (envs, threads))) {
            let ours = || Ours::new(&case, envs, threads);
            let row =
                |rate| Row::new("mujoco-batch", format!("{}, {envs} envs", case.name), "env-steps/s", threads, rate);
            let Some(python) = &python else {
                let plan = MeasurementCfg { seconds: 0.25 * settings.seconds, restart_after: STEPS };
                let times = measure(plan, &mut [&mut ours()?])?;
                rows.push(row(envs as f64 / times.per_step(0)).without("mujoco.batch"));
                continue;
            };
            for (reads, python, name) in [
                (Reads::State, Some(python), "mujoco.batch"),
                (Reads::OtherPackage, mjbatch.as_ref(), "mjbatch on MuJoCo 3.14.0"),
            ] {
                let Some(python) = python else { continue };
                let start = || Baseline::start(python, &case, (envs, threads), reads);
                let times = compare(settings.seconds, STEPS, ours, start)?;
                let rate = |side: usize| times.rate(side, envs);
                rows.push(row(rate(0)).against(name, rate(1), times.ratio(0, 1)).with_target_ratio(1.0));
            }
        }
    }
    rows.extend(mujoco_batch_reads::run(settings)?);
    Ok(rows)
}

/// Program and quantities of a baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reads {
    /// `mujoco.batch` with positions and velocities bound.
    State,
    /// `mujoco.batch` with poses of bodies and contact forces bound, too.
    PosesAndForces,
    /// The package `mjbatch` with positions and velocities bound. It has another version of MuJoCo, so its positions
    /// are not compared.
    OtherPackage,
}

/// A Python process with a batch.
pub(crate) struct Baseline {
    process: Process,
    reads: Reads,
}

impl Baseline {
    pub(crate) fn start(
        python: &OsString,
        case: &Case,
        (envs, threads): (usize, usize),
        reads: Reads,
    ) -> BenchResult<Self> {
        let folder = tempfile::tempdir()?;
        let mut job = job(case, envs, threads, folder.path())?;
        job["reads_poses_and_forces"] = json!(reads == Reads::PosesAndForces);
        job["package"] = json!(if reads == Reads::OtherPackage { "mjbatch" } else { "mujoco.batch" });
        if reads == Reads::PosesAndForces {
            // Our side has no controls.
            job["starts"].as_object_mut().map(|starts| starts.remove("ctrl"));
        }
        let mut baseline = Self { process: Process::start(python, "mujoco_batch.py", &job, folder)?, reads };
        // The baseline answers once its memory is allocated.
        baseline.restart()?;
        Ok(baseline)
    }
}

/// The job of the script: our compiled model, and the start states.
fn job(case: &Case, envs: usize, threads: usize, folder: &Path) -> BenchResult<serde_json::Value> {
    let m = &case.model;
    let file = match &case.mjcf {
        Some(text) => {
            let file = folder.join("model.xml");
            std::fs::write(&file, text)?;
            file
        }
        None => crate::models::HUMANOID.into(),
    };
    let starts = |pick: &dyn Fn(usize) -> Vec<f64>| (0..envs).map(pick).collect::<Vec<_>>();
    let mut arrays = json!({
        "dof_frictionloss": m.dof_frictionloss(),
        "dof_armature": m.dof_armature(),
        "actuator_gainprm": m.actuator_gainprm(),
        "actuator_biasprm": m.actuator_biasprm(),
    });
    if case.mjcf.is_some() {
        // Drive controls hold targets and are not clamped.
        arrays["actuator_ctrllimited"] = json!(vec![0; m.nu()]);
        arrays["dof_damping"] = json!(m.dof_damping());
    }
    Ok(json!({
        "model": file,
        "islands": case.mjcf.is_none(),
        "arrays": arrays,
        "envs": envs,
        "threads": threads,
        "starts": {
            "qpos": starts(&|i| case.state(i).qpos.clone()),
            "qvel": starts(&|i| case.state(i).qvel.clone()),
            "qacc_warmstart": starts(&|i| case.state(i).warmstart.clone()),
            "ctrl": starts(&|i| case.controls(i)),
        },
    }))
}

impl Contender for Baseline {
    fn restart(&mut self) -> BenchResult<()> {
        self.process.request("restart").map(drop)
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        self.process.block(steps)
    }

    fn process(&self) -> Option<u32> {
        Some(self.process.id())
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        if self.reads == Reads::OtherPackage {
            return Ok(None);
        }
        let bytes = self.process.bytes("qpos")?;
        Ok(Some(bytes.as_chunks::<8>().0.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect()))
    }
}
