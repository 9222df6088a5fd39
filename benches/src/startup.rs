//! Time from process start to the end of the first step, for the example `create_robot`. It runs with the bundled
//! robot, and with the vendors' meshes: the first start computes their convex hulls, the second reads them from a
//! cache.

use crate::interleave::median;
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

const RUNS: usize = 9;
/// Targets \[s\].
const BUNDLED_LIMIT: f64 = 0.3;
const FIRST_START_LIMIT: f64 = 1.5;
const SECOND_START_LIMIT: f64 = 0.5;

pub(crate) fn run(_: &Settings) -> BenchResult<Vec<Row>> {
    let example = build_example()?;
    let mut rows = vec![row("bundled robot", BUNDLED_LIMIT, &times(&example, &[], RUNS, None)?)];
    let Some(robots) = robots() else {
        eprintln!("skipped: no vendor robots; set KINETOSCOPE_ROBOTS to their folder");
        return Ok(rows);
    };
    let args = vendor_args(&robots);
    let caches = (0..RUNS.div_ceil(2)).map(|_| tempfile::tempdir()).collect::<Result<Vec<_>, _>>()?;
    let mut first = Vec::new();
    for cache in &caches {
        first.extend(times(&example, &args, 1, Some(cache.path()))?);
    }
    rows.push(row("vendor meshes, first start", FIRST_START_LIMIT, &first));
    rows.push(row(
        "vendor meshes, second start",
        SECOND_START_LIMIT,
        &times(&example, &args, RUNS, Some(caches[0].path()))?,
    ));
    Ok(rows)
}

fn row(case: &str, limit: f64, times: &[f64]) -> Row {
    let time = median(times.to_vec());
    Row::new("startup", case, "s", 1, time)
        .against(&format!("limit {limit} s"), limit, limit / time)
        .with_target_ratio(1.0)
}

/// Durations of whole processes with one step \[s\]: an upper bound of the time to the first step.
fn times(example: &Path, args: &[OsString], runs: usize, cache: Option<&Path>) -> BenchResult<Vec<f64>> {
    let mut times = Vec::new();
    for _ in 0..runs {
        let mut command = Command::new(example);
        command.args(["--headless", "--steps", "1", "--threads", "1"]).args(args);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        if let Some(cache) = cache {
            command.env("KINETOSCOPE_CACHE", cache);
        }
        let start = Instant::now();
        let status = command.status()?;
        times.push(start.elapsed().as_secs_f64());
        if !status.success() {
            return Err(format!("create_robot ended with {status}").into());
        }
    }
    Ok(times)
}

/// The release build of the example, for the same MuJoCo version as this program.
fn build_example() -> BenchResult<PathBuf> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["build", "--release", "--quiet", "--example", "create_robot", "--message-format", "json"])
        .current_dir(root())
        .stderr(Stdio::inherit())
        .output()?;
    String::from_utf8(output.stdout)?
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["target"]["name"] == "create_robot")
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .ok_or_else(|| "cargo did not build the example create_robot".into())
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The vendors' robots: `KINETOSCOPE_ROBOTS`, or `shared/robots` in a folder above the project.
pub(crate) fn robots() -> Option<PathBuf> {
    let named = std::env::var_os("KINETOSCOPE_ROBOTS").map(PathBuf::from);
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|dir| dir.join("shared/robots"));
    named.into_iter().chain(above).find(|dir| dir.is_dir())
}

fn vendor_args(robots: &Path) -> Vec<OsString> {
    let arm = robots.join("rokae_description/urdf/SR5.urdf");
    let hand = robots.join("inspire_hand/DFQ_left_hand.urdf");
    let words: [OsString; 8] = [
        "--arm-urdf".into(),
        arm.into(),
        "--hand-urdf".into(),
        hand.into(),
        "--arm-joints".into(),
        "joint[1-6]".into(),
        "--hand-joints".into(),
        "L_.*".into(),
    ];
    words.into()
}
