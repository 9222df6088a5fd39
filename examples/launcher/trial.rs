//! Examples that run a task in 16 environments and count the successes.

use super::{Launcher, Result, image_file, stage};
use clap::Parser;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, to_row};
use kinetoscope::sensors::camera::Camera;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

/// Parses the flags, with 16 environments by default.
pub(crate) fn parse<A: Parser>() -> A {
    let command = A::command().mut_arg("num_envs", |flag| flag.default_value("16"));
    A::from_arg_matches(&command.get_matches()).unwrap_or_else(|error| error.exit())
}

/// Number of environments that have to succeed: all but one in 16.
pub(crate) fn needed(num_envs: usize) -> usize {
    num_envs - num_envs / 16
}

/// Runs an example that returns true for enough successes. The exit code is 0, or 1 for too few successes, or 2 for an
/// error.
pub(crate) fn run(name: &str, example: impl FnOnce() -> Result<bool>) -> ExitCode {
    let mut enough = false;
    let code = super::run(name, || {
        enough = example()?;
        Ok(())
    });
    if enough || code != ExitCode::SUCCESS { code } else { ExitCode::FAILURE }
}

/// The reason for the divergence of each environment, or `None`. A diverged environment shows its last good state,
/// which is not a result.
pub(crate) fn diverged(sim: &SimulationManager) -> Vec<Option<String>> {
    let mut reasons = vec![None; sim.num_envs()];
    for diverged in sim.diverged() {
        eprintln!("warning: environment {} diverged: {diverged}", diverged.env.0);
        reasons[diverged.env.0] = Some(diverged.to_string());
    }
    reasons
}

/// Results of an example.
#[derive(Debug)]
pub(crate) struct TrialResults<'a> {
    /// Description of a success, printed after "N of 16".
    pub(crate) what: &'a str,
    /// The deciding setting: its key in the report, and its value in the unit of the key.
    pub(crate) setting: (&'a str, f64),
    /// One row for each environment, a JSON object with the boolean key `success`.
    pub(crate) table: Vec<Value>,
    pub(crate) steps: u64,
    /// Environment steps per second.
    pub(crate) rate: f64,
    /// The overview image of all environments: file name, camera position and camera target \[m\].
    pub(crate) overview: (&'a str, [f64; 3], [f64; 3]),
}

/// Prints the results, renders all environments and writes the report. Returns true for enough successes.
///
/// # Errors
/// A file cannot be written.
pub(crate) fn write_results(launcher: &Launcher, sim: &mut SimulationManager, count: TrialResults<'_>) -> Result<bool> {
    let TrialResults { what, setting, table, steps, rate, overview } = count;
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

/// Converts rows `[x, y, z, qw, qx, qy, qz]` to poses.
pub(crate) fn poses(rows: &Array2<f64>) -> Vec<Pose> {
    rows.rows().into_iter().map(|row| from_row(&std::array::from_fn(|k| row[k]))).collect()
}

/// Converts poses to rows `[x, y, z, qw, qx, qy, qz]`.
pub(crate) fn pose_rows(poses: &[Pose]) -> Array2<f64> {
    Array2::from_shape_fn((poses.len(), 7), |(env, k)| to_row(&poses[env])[k])
}

/// Poses translated by a vector in the axes of the environment \[m\].
pub(crate) fn moved(poses: &[Pose], by: impl Fn(&Pose) -> [f64; 3]) -> Vec<Pose> {
    poses.iter().map(|pose| Pose::translation(by(pose)[0], by(pose)[1], by(pose)[2]) * pose).collect()
}

/// Images of the first environment, `NAME_1.png` and so on.
#[derive(Debug)]
pub(crate) struct ImageSeries {
    out: Option<PathBuf>,
    name: &'static str,
    camera: SensorId<Camera>,
    taken: usize,
}

impl ImageSeries {
    /// Adds a camera that looks from `eye` to `target` \[m\]. Images go to the folder `out`, if given.
    ///
    /// # Errors
    /// The folder cannot be created.
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

    /// Writes the next color image; does nothing without `--out`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn add(&mut self, sim: &SimulationManager) -> Result {
        let Some(out) = &self.out else { return Ok(()) };
        self.taken += 1;
        let camera = sim.sensor(self.camera)?;
        let (height, width) = camera.image_shape();
        let color = camera.color()?;
        let color = color.as_slice().ok_or("the image is not contiguous")?;
        let file = out.join(format!("{}_{}.png", self.name, self.taken));
        image_file::write_png(&file, &image_file::color_image([width, height], color))
    }
}
