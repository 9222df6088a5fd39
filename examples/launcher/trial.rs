//! Examples that try something in many environments and count: 16 of them, and what counts as enough.

use super::{Launcher, Result, picture, stage};
use clap::Parser;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, to_row};
use kinetoscope::sensors::camera::Camera;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

/// The flags, with 16 environments where nobody says how many.
pub(crate) fn parse<A: Parser>() -> A {
    let command = A::command().mut_arg("num_envs", |flag| flag.default_value("16"));
    A::from_arg_matches(&command.get_matches()).unwrap_or_else(|error| error.exit())
}

/// How many of the environments have to succeed: all but one in 16.
pub(crate) fn needed(num_envs: usize) -> usize {
    num_envs - num_envs / 16
}

/// Runs an example that says whether enough succeeded: exit code 0, 1 where fewer did, 2 for an error.
pub(crate) fn run(name: &str, example: impl FnOnce() -> Result<bool>) -> ExitCode {
    let mut enough = false;
    let code = super::run(name, || {
        enough = example()?;
        Ok(())
    });
    if enough || code != ExitCode::SUCCESS { code } else { ExitCode::FAILURE }
}

/// For each environment, why it could not be stepped on; `None` where all went well. What it shows is its last good state,
/// which is no result.
pub(crate) fn diverged(sim: &SimulationManager) -> Vec<Option<String>> {
    let mut reasons = vec![None; sim.num_envs()];
    for diverged in sim.diverged() {
        eprintln!("warning: environment {} diverged: {diverged}", diverged.env.0);
        reasons[diverged.env.0] = Some(diverged.to_string());
    }
    reasons
}

/// What an example counted.
#[derive(Debug)]
pub(crate) struct Count<'a> {
    /// What a success is, behind their number and "of 16".
    pub(crate) what: &'a str,
    /// The setting that decides the run, as its report calls it, in its unit.
    pub(crate) setting: (&'a str, f64),
    /// A row for each environment, with `success`.
    pub(crate) table: Vec<Value>,
    pub(crate) steps: u64,
    /// Environment steps per second.
    pub(crate) rate: f64,
    /// The picture of all environments: its name, from where and to where it is seen.
    pub(crate) overview: (&'a str, [f64; 3], [f64; 3]),
}

/// Prints what was counted, draws all environments and writes the report; gives whether enough succeeded.
///
/// # Errors
/// A file cannot be written.
pub(crate) fn conclude(launcher: &Launcher, sim: &mut SimulationManager, count: Count<'_>) -> Result<bool> {
    let Count { what, setting, table, steps, rate, overview } = count;
    let successes = table.iter().filter(|row| row["success"] == true).count();
    let needed = needed(sim.num_envs());
    println!("\n{successes} of {} {what}; {needed} are enough", sim.num_envs());
    println!("{steps} steps x {} environments: {rate:.0} environment steps per second", sim.num_envs());
    if let Some(out) = &launcher.out {
        let (name, eye, target) = overview;
        stage::write(sim, &[], eye, target, &out.join(name))?;
    }
    launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": steps,
        (setting.0): setting.1,
        "successes": successes,
        "needed": needed,
        "success_rate": successes as f64 / sim.num_envs() as f64,
        "environments": table,
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))?;
    Ok(successes >= needed)
}

/// `yes` or `no`.
pub(crate) fn word(yes: bool) -> &'static str {
    if yes { "yes" } else { "no" }
}

/// Rows `[x, y, z, qw, qx, qy, qz]` as poses.
pub(crate) fn poses(rows: &Array2<f64>) -> Vec<Pose> {
    rows.rows().into_iter().map(|row| from_row(&std::array::from_fn(|k| row[k]))).collect()
}

/// Poses as rows `[x, y, z, qw, qx, qy, qz]`.
pub(crate) fn rows(poses: &[Pose]) -> Array2<f64> {
    Array2::from_shape_fn((poses.len(), 7), |(env, k)| to_row(&poses[env])[k])
}

/// Poses at another place, by a vector in the axes of the environment \[m\].
pub(crate) fn moved(poses: &[Pose], by: impl Fn(&Pose) -> [f64; 3]) -> Vec<Pose> {
    poses.iter().map(|pose| Pose::translation(by(pose)[0], by(pose)[1], by(pose)[2]) * pose).collect()
}

/// Pictures of the first environment, `NAME_1.png` and so on.
#[derive(Debug)]
pub(crate) struct Album {
    out: Option<PathBuf>,
    name: &'static str,
    camera: SensorId<Camera>,
    taken: usize,
}

impl Album {
    /// A camera that looks from `eye` to `target`; pictures go to the folder `out`, if there is one.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub(crate) fn new(
        sim: &mut SimulationManager,
        name: &'static str,
        out: Option<PathBuf>,
        eye: [f64; 3],
        target: [f64; 3],
    ) -> Result<Self> {
        if let Some(out) = &out {
            std::fs::create_dir_all(out).map_err(|e| format!("--out {}: {e}", out.display()))?;
        }
        let placement = Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] };
        let camera = sim.add_sensor(
            "camera",
            CameraCfg {
                intrinsics: Intrinsics::Fovy { radians: 40f64.to_radians() },
                extrinsics: Extrinsics { placement, ..Default::default() },
                env_ids: Some(vec![0]),
                ..Default::default()
            },
        )?;
        Ok(Self { out, name, camera, taken: 0 })
    }

    /// Takes the next picture.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn add(&mut self, sim: &SimulationManager) -> Result {
        let Some(out) = &self.out else { return Ok(()) };
        self.taken += 1;
        let camera = sim.sensor(self.camera)?;
        let (height, width) = camera.image_shape();
        let color = camera.color()?;
        let color = color.as_slice().ok_or("the picture is not in one piece")?;
        let file = out.join(format!("{}_{}.png", self.name, self.taken));
        picture::write_png(&file, &picture::color_picture([width, height], color))
    }
}
