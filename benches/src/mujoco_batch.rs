//! Batched stepping against `mujoco.batch` from Python: the same model, states and threads, in turns.

use crate::interleave::{Plan, Side, measure};
use crate::models::{Case, STEPS};
use crate::row::Row;
use crate::step::Ours;
use crate::{Outcome, Settings};
use kinetoscope::sim::mj::{TARGET, Target};
use serde_json::json;
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

/// Names a python that can import mujoco 4; `cargo xtask bench` sets it.
const PYTHON: &str = "KINETOSCOPE_PYTHON4";
const ENVS: [usize; 2] = [64, 1024];
const THREADS: [usize; 2] = [1, 2];

pub(crate) fn run(settings: &Settings) -> Outcome<Vec<Row>> {
    let python = std::env::var_os(PYTHON);
    if TARGET != Target::V4 {
        eprintln!("  without the rival: mujoco.batch came with MuJoCo 4, and this build is for 2.2.2");
    } else if python.is_none() {
        eprintln!("  without the rival: {PYTHON} does not name a python that can import mujoco 4");
    }
    let python = python.filter(|_| TARGET == Target::V4);
    let mut rows = Vec::new();
    for case in Case::humanoid()?.into_iter().chain([Case::sr5()?]) {
        for (envs, threads) in ENVS.into_iter().flat_map(|envs| THREADS.map(|threads| (envs, threads))) {
            let mut ours = Ours::new(&case, envs, threads)?;
            let mut plan = Plan { seconds: settings.seconds, restart_after: STEPS };
            let row =
                |rate| Row::new("mujoco-batch", format!("{}, {envs} envs", case.name), "env-steps/s", threads, rate);
            let Some(python) = &python else {
                plan.seconds *= 0.25;
                let times = measure(plan, &mut [&mut ours])?;
                rows.push(row(envs as f64 / times.per_step(0)).without("mujoco.batch"));
                continue;
            };
            let mut rival = Rival::start(python, &case, envs, threads)?;
            let times = measure(plan, &mut [&mut ours, &mut rival])?;
            let rate = |side: usize| envs as f64 / times.per_step(side);
            rows.push(row(rate(0)).against("mujoco.batch", rate(1), times.ratio(0, 1)));
        }
    }
    Ok(rows)
}

/// A Python process that holds a `mujoco.batch.Batch`.
struct Rival {
    process: Child,
    /// Open until the process is to end.
    commands: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    _job: tempfile::TempDir,
}

impl Rival {
    fn start(python: &OsString, case: &Case, envs: usize, threads: usize) -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let job = folder.path().join("job.json");
        std::fs::write(&job, self::job(case, envs, threads, folder.path())?.to_string())?;
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("rivals/mujoco_batch.py");
        let mut process =
            Command::new(python).arg(script).arg(job).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let commands = process.stdin.take();
        let answers = BufReader::new(process.stdout.take().ok_or("the rival has no standard output")?);
        Ok(Self { process, commands, answers, _job: folder })
    }

    fn ask(&mut self, command: &str) -> Outcome<String> {
        let commands = self.commands.as_mut().ok_or("the rival has ended")?;
        writeln!(commands, "{command}")?;
        commands.flush()?;
        let mut line = String::new();
        self.answers.read_line(&mut line)?;
        if line.is_empty() { Err("mujoco_batch.py ended early".into()) } else { Ok(line.trim().into()) }
    }
}

impl Drop for Rival {
    fn drop(&mut self) {
        // The end of its input ends the process.
        self.commands = None;
        let _ = self.process.wait();
    }
}

/// What the script is told: the model as ours is after compiling, and the starts.
fn job(case: &Case, envs: usize, threads: usize, folder: &Path) -> Outcome<serde_json::Value> {
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
        // Controls of drives hold targets and are not clamped.
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

impl Side for Rival {
    fn restart(&mut self) -> Outcome<()> {
        self.ask("restart").map(drop)
    }

    fn block(&mut self, steps: u32) -> Outcome<Duration> {
        Ok(Duration::from_secs_f64(self.ask(&format!("block {steps}"))?.parse()?))
    }

    fn process(&self) -> Option<u32> {
        Some(self.process.id())
    }

    fn qpos(&mut self) -> Outcome<Option<Vec<f64>>> {
        let hex = self.ask("qpos")?;
        let byte = |i: usize| u8::from_str_radix(hex.get(i..i + 2).unwrap_or(""), 16);
        let bytes: Vec<u8> = (0..hex.len()).step_by(2).map(byte).collect::<Result<_, _>>()?;
        let numbers = bytes.as_chunks::<8>().0.iter().map(|chunk| f64::from_le_bytes(*chunk));
        Ok(Some(numbers.collect()))
    }
}
