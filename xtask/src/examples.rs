//! The table of example runs in CI, and the check that every example is in the table.

use crate::progress::Progress;
use crate::run::{Failure, Repo, XtaskResult, in_ci, no_findings};
use crate::same_images;
use crate::setup::Prepared;
use crate::test;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Vendor robots next to the repository. Without them, the rows that need them are skipped; in CI that is an error.
const ROBOTS: &str = "../shared/robots";
/// Time limit of an example; a run that exceeds it hangs.
const TIME_LIMIT: Duration = Duration::from_secs(600);
/// Feedback-control examples, which users run and watch: each run ends within about a minute, including learning. The limit
/// applies to the time without the load of other programs. One program took 50 to 63 s on the same two cores of a shared host.
const QUICK: [&str; 3] = ["balance", "train_reach", "visual_servo"];
const QUICK_LIMIT: Duration = Duration::from_secs(90);

/// One run. In the arguments, `{out}` is an empty scratch folder and `{robots}` the folder of the vendor robots.
#[derive(Debug)]
struct ExampleRun {
    example: &'static str,
    args: &'static str,
    exits: &'static [i32],
    /// Check of the report's content.
    report: ReportCheck,
    /// True if the report has a check of its own.
    has_report_check: bool,
}

/// Returns the error of a report.
type ReportCheck = fn(&Value) -> Result<(), String>;

const fn row(example: &'static str, exits: &'static [i32], args: &'static str) -> ExampleRun {
    ExampleRun { has_report_check: false, ..checked_row(example, exits, args, anything) }
}

const fn checked_row(
    example: &'static str,
    exits: &'static [i32],
    args: &'static str,
    report: ReportCheck,
) -> ExampleRun {
    ExampleRun { example, args, exits, report, has_report_check: true }
}

/// The runs of all examples. A new example needs at least one row with valid input, and one with invalid input and its
/// exit code.
const TABLE: &[ExampleRun] = &[
    row("create_robot", &[0], "--headless --num-envs 4 --steps 400 --report {out}/create_robot.json"),
    row(
        "create_robot",
        &[0],
        "--headless --num-envs 2 --steps 400 --arm-urdf {robots}/rokae_description/urdf/SR5.urdf \
         --hand-urdf {robots}/inspire_hand/DFQ_left_hand.urdf --arm-joints joint[1-6] --hand-joints L_.*",
    ),
    row(
        "create_robot",
        &[0],
        "--headless --num-envs 2 --steps 400 --robot quadruped/quadruped.xml --arm-joints [LR]F_.* --hand-joints [LR]H_.*",
    ),
    row("create_robot", &[2], "--headless --steps 1 --robot quadruped/quadruped.xml --arm-urdf sr5/SR5.urdf"),
    row("create_robot", &[2], "--headless --steps 1 --robot {out}/there_is_no_such_file.xml"),
    row("create_robot", &[0], "--headless --num-envs 2 --steps 200 --record {out}/create_robot.mcap"),
    // Examples are built with the features `lerobot` and `foxglove`, as the tests are.
    row("create_robot", &[0], "--headless --num-envs 2 --steps 100 --record {out}/create_robot.lerobot"),
    row("create_robot", &[0], "--headless --num-envs 2 --steps 100 --foxglove 0"),
    row("create_robot", &[2], "--headless --steps 1 --foxglove robot:1"),
    row(
        "run_camera",
        &[0],
        "--headless --num-envs 2 --steps 60 --record {out}/rates.npz --record-every 4 --record-rate camera=20,camera/depth=30",
    ),
    row("create_robot", &[2], "--headless --steps 1 --record {out}/none.npz --record-rate nothing=2"),
    row("create_robot", &[2], "--headless --steps 1 --record {out}/none.npz --record-rate robot"),
    row("create_robot", &[2], "--headless --steps 1 --record {out}/none.npz --record-every 0"),
    row("create_robot", &[0], "--headless --num-envs 2 --steps 50 --out {out}/create_robot"),
    row("create_robot", &[2], "--headless --steps 1 --record {out}/create_robot.avi"),
    // Recordings of an example without a camera: the stage works, and a camera that does not exist is an error.
    row("create_robot", &[0], "--headless --num-envs 2 --steps 50 --record {out}/create_robot.gif"),
    row("create_robot", &[2], "--headless --steps 1 --record {out}/none.mp4 --record-view missing"),
    row("create_robot", &[2], "--headless --steps 1 --record-view stage"),
    row("run_camera", &[0], "--headless --num-envs 2 --steps 60 --record {out}/stage.mp4 --record-view stage"),
    row("run_camera", &[0], "--headless --num-envs 2 --steps 60 --record {out}/camera.gif --record-view camera"),
    row("run_camera", &[0], "--headless --num-envs 2 --steps 60 --record {out}/stage.mcap --record-view stage"),
    row("create_robot", &[2], "--headless --steps 1 --device cuda"),
    row("create_robot", &[2], "--headless --steps 1 --num-envs 0"),
    row(
        "create_sensor",
        &[0],
        "--headless --num-envs 2 --steps 1002 --out {out}/create_sensor --raw --report {out}/create_sensor.json",
    ),
    row(
        "create_sensor",
        &[0],
        "--headless --steps 1 --attach-sensor --attach-link ee_link --width 160 --height 120 --out {out}/attached",
    ),
    row("create_sensor", &[2], "--headless --steps 1 --attach-sensor --attach-link no_such_link --out {out}/none"),
    row("create_sensor", &[0], "--headless --steps 300 --record {out}/create_sensor.gif --out {out}/recorded"),
    row("create_sensor", &[0], "--headless --steps 100 --record {out}/create_sensor.mp4 --out {out}/recorded_mp4"),
    row("create_sensor", &[2], "--headless --steps 1 --width 161 --record {out}/odd.mp4 --out {out}/none"),
    row("create_sensor", &[2], "--headless --steps 1 --width 0 --out {out}/none"),
    row("create_sensor", &[0], "--headless --steps 1 --width 160 --height 120 --raw --out {out}/sensor/raster"),
    row(
        "create_sensor",
        &[0],
        "--headless --steps 1 --enable-rt --rt-samples 4 --rt-bounces 2 --width 160 --height 120 --raw --out {out}/sensor/rt",
    ),
    row(
        "create_sensor",
        &[0],
        "--headless --steps 1 --renderer hybrid --width 160 --height 120 --raw --out {out}/sensor/hybrid",
    ),
    row(
        "create_sensor",
        &[0],
        "--headless --steps 1 --renderer fast-rt --width 160 --height 120 --raw --out {out}/sensor/fast-rt",
    ),
    row(
        "create_sensor",
        &[0],
        "--headless --steps 1 --attach-sensor --renderer fast-rt --width 160 --height 120 --out {out}/seen_by_rays",
    ),
    row("create_sensor", &[2], "--headless --steps 1 --renderer rt --rt-samples 0 --out {out}/none"),
    row("create_sensor", &[2], "--headless --steps 1 --renderer raster --enable-rt --out {out}/none"),
    row("create_sensor", &[2], "--headless --steps 1 --renderer fast-rt --rt-samples 4 --out {out}/none"),
    row("add_sensors_on_robot", &[2], "--headless --steps 1 --renderer rt --out {out}/none"),
    row("run_camera", &[2], "--headless --steps 1 --renderer hybrid"),
    row("run_ray_caster", &[2], "--headless --steps 1 --renderer fast-rt"),
    row(
        "add_sensors_on_robot",
        &[0],
        "--headless --num-envs 2 --steps 600 --out {out}/add_sensors_on_robot --report {out}/add_sensors_on_robot.json",
    ),
    row(
        "add_sensors_on_robot",
        &[0],
        "--headless --num-envs 1 --steps 400 --reset-every 0 --payload 5 --out {out}/anymal_sensors \
         --robot {robots}/anymal_c_simple_description/urdf/anymal.urdf",
    ),
    row(
        "add_sensors_on_robot",
        &[0],
        "--headless --num-envs 1 --steps 400 --reset-every 0 --out {out}/mjcf_sensors --robot quadruped/quadruped.xml",
    ),
    row("add_sensors_on_robot", &[0], "--headless --num-envs 2 --steps 100 --record {out}/add_sensors.npz"),
    row("add_sensors_on_robot", &[2], "--headless --steps 1 --payload=-1"),
    row("add_sensors_on_robot", &[2], "--headless --steps 1 --spawn-height nan"),
    row("add_sensors_on_robot", &[0], "--headless --steps 50 --spawn-height 0 --no-ground --print-every 50"),
    row("run_frame_transformer", &[0], "--headless --steps 50 --spawn-height 0.2"),
    row("add_sensors_on_robot", &[2], "--headless --steps 1 --robot sr5/SR5.urdf"),
    row("run_ray_caster", &[0], "--headless --steps 300 --out {out}/ray_caster --report {out}/ray_caster.json"),
    row("run_ray_caster", &[2], "--headless --steps 1 --resolution 0"),
    row("run_ray_caster", &[2], "--headless --steps 1 --cell 0.3"),
    row(
        "run_ray_caster_camera",
        &[0],
        "--headless --num-envs 2 --steps 100 --save --camera-id 1 --out {out}/ray_caster_camera \
         --report {out}/ray_caster_camera.json",
    ),
    row("run_ray_caster_camera", &[2], "--headless --steps 1 --height 0"),
    row(
        "run_frame_transformer",
        &[0],
        "--headless --num-envs 2 --steps 200 --out {out}/frames --report {out}/frames.json",
    ),
    row("run_frame_transformer", &[2], "--headless --steps 1 --source no_such_link"),
    row("run_frame_transformer", &[2], "--headless --steps 1 --targets no_such_link.*"),
    row(
        "run_camera",
        &[0],
        "--headless --num-envs 2 --steps 100 --save --draw --camera-id 1 --out {out}/camera --report {out}/camera.json",
    ),
    row("run_camera", &[0], "--headless --num-envs 2 --steps 100 --record {out}/run_camera"),
    row("run_camera", &[2], "--headless --steps 1 --camera-id 7"),
    row("run_camera", &[2], "--headless --steps 1 --width 0"),
    checked_row(
        "stereo",
        &[0],
        "--headless --num-envs 2 --steps 100 --camera-id 1 --width 320 --height 240 --out {out}/stereo \
         --report {out}/stereo.json",
        check_disparity,
    ),
    checked_row(
        "stereo",
        &[0],
        "--headless --steps 20 --renderer fast-rt --baseline 0.3 --width 160 --height 120 --out {out}/stereo_rays \
         --report {out}/stereo_rays.json",
        check_disparity,
    ),
    row(
        "stereo",
        &[0],
        "--headless --steps 40 --width 160 --height 120 --serve 127.0.0.1:0 --record {out}/stereo.mcap --out {out}/served",
    ),
    row("stereo", &[2], "--headless --steps 1 --serve nowhere --out {out}/none"),
    row("stereo", &[2], "--headless --steps 1 --record {out}/stereo.avi --out {out}/none"),
    row("stereo", &[2], "--headless --steps 1 --baseline 0 --out {out}/none"),
    row("stereo", &[2], "--headless --steps 1 --toe-in-deg 3 --out {out}/none"),
    row("stereo", &[2], "--headless --steps 1 --camera-id 1 --out {out}/none"),
    // Control of the next run: other renderers draw glass as an opaque white ball.
    checked_row(
        "surfaces",
        &[0],
        "--headless --width 160 --height 90 --out {out}/surfaces --report {out}/surfaces.json",
        check_opaque_glass,
    ),
    checked_row(
        "surfaces",
        &[0],
        "--headless --width 160 --height 90 --renderer rt --rt-samples 16 --out {out}/surfaces_rt --report {out}/surfaces_rt.json",
        check_transparent_glass,
    ),
    row("surfaces", &[2], "--headless --lamp-radius=-1 --out {out}/none"),
    checked_row("grasp", &[0], "--headless --out {out}/grasp --report {out}/grasp.json", check_successes),
    // Two cubes are grasped on another side than the first, and end up rotated.
    checked_row("grasp", &[0], "--headless --seed 5 --report {out}/grasp_turned.json", check_successes),
    // Control of the runs above: the cubes slip.
    checked_row("grasp", &[1], "--headless --friction 0.02 --report {out}/grasp_slips.json", check_none_lifted),
    row("grasp", &[2], "--headless --friction=-1"),
    checked_row(
        "open_drawer",
        &[0],
        "--headless --out {out}/open_drawer --report {out}/open_drawer.json",
        check_successes,
    ),
    // Control of the run above: the drawers are stuck.
    checked_row(
        "open_drawer",
        &[1],
        "--headless --slide-friction 500 --report {out}/open_drawer_stuck.json",
        check_none_opened,
    ),
    row("open_drawer", &[2], "--headless --slide-friction=-1"),
    checked_row("balance", &[0], "--headless --out {out}/balance --report {out}/balance.json", balanced),
    // Control of the run above: the wheels stand still.
    checked_row("balance", &[1], "--headless --no-feedback --report {out}/balance_falls.json", check_all_fell),
    row("balance", &[2], "--headless --push=-1"),
    checked_row(
        "visual_servo",
        &[0],
        "--headless --out {out}/visual_servo --report {out}/visual_servo.json",
        check_successes,
    ),
    // Controls of the run above: miscalibrated cameras, and empty masks.
    checked_row(
        "visual_servo",
        &[1],
        "--headless --miscalibrated 0.02 --report {out}/visual_servo_beside.json",
        check_all_beside,
    ),
    checked_row("visual_servo", &[1], "--headless --blind --report {out}/visual_servo_blind.json", check_none_found),
    row("visual_servo", &[2], "--headless --miscalibrated inf"),
    checked_row(
        "train_reach",
        &[0],
        "--headless --out {out}/train_reach --report {out}/train_reach.json",
        check_learned,
    ),
    // Control of the run above: the same learning with shuffled returns.
    checked_row(
        "train_reach",
        &[1],
        "--headless --no-signal --report {out}/train_reach_no_signal.json",
        check_not_learned,
    ),
    row("train_reach", &[2], "--headless --num-envs 100"),
    row("train_reach", &[2], "--headless --noise 0"),
    row("render_model", &[0], "assets/sr5/SR5.urdf --out {out}/sr5 --raw --qpos 0,0.5,-1.5,0.3,-0.5,0"),
    row(
        "render_model",
        &[0],
        "{robots}/anymal_c_simple_description/urdf/anymal.urdf --out {out}/anymal --eye 1.3,1.1,0.6 --target 0,0,-0.1",
    ),
    row("render_model", &[0], "{robots}/rokae_description/urdf/SR5.urdf --out {out}/vendor --shadows off --msaa 1"),
    row(
        "render_model",
        &[0],
        "assets/sr5/SR5.urdf --renderer rt --rt-samples 4 --rt-bounces 2 --width 160 --height 120 --raw --out {out}/model/rt",
    ),
    row("render_model", &[0], "assets/sr5/SR5.urdf --width 160 --height 120 --raw --out {out}/model/raster"),
    row(
        "render_model",
        &[0],
        "assets/sr5/SR5.urdf --renderer fast-rt --width 160 --height 120 --raw --out {out}/model/fast-rt",
    ),
    row(
        "render_model",
        &[0],
        "assets/sr5/SR5.urdf --renderer hybrid --ao-rays 8 --width 160 --height 120 --raw --out {out}/model/hybrid",
    ),
    row(
        "render_model",
        &[0],
        "assets/sr5/SR5.urdf --renderer hybrid --compare --width 64 --height 48 --out {out}/both",
    ),
    row("render_model", &[2], "assets/sr5/SR5.urdf --compare --out {out}/none"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --time-limit 9 --out {out}/none"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --renderer raster --ao-rays 8 --out {out}/none"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --renderer rt --rt-samples 0 --out {out}/none"),
    row("render_model", &[2], "{out}/there_is_no_such_file.xml --out {out}/none"),
    row("render_model", &[2], "{out}/malformed.urdf --out {out}/none"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --out {out}/none --camera missing"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --out {out}/none --msaa 3"),
    row("render_model", &[0], "assets/sr5/SR5.urdf --headless --width 64 --height 48 --out {out}/small"),
    row("render_model", &[0], "assets/sr5/SR5.urdf --out {out}/served --serve 127.0.0.1:0 --steps 20"),
    row("render_model", &[0], "assets/quadruped/quadruped.xml --out {out}/served --record {out}/falls.mcap --steps 20"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --out {out}/none --serve nowhere"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --out {out}/none --record {out}/none.no_such_format"),
    row("render_model", &[2], "assets/sr5/SR5.urdf --out {out}/none --eye 1,1,1 --target 1,1,1"),
    checked_row("fisheye", &[0], "--headless --out {out}/fisheye --report {out}/fisheye.json", check_lenses),
    row(
        "fisheye",
        &[0],
        "--headless --lens ftheta --renderer rt --rt-samples 2 --width 80 --height 60 --out {out}/fisheye_paths",
    ),
    row("fisheye", &[0], "--headless --lens panorama --lens ftheta --width 200 --height 100 --out {out}/panorama"),
    row("fisheye", &[0], "--headless --camera-info {out}/fisheye/opencv.yaml --out {out}/twin"),
    row("fisheye", &[2], "--headless --lens no_such_lens --out {out}/none"),
    row("fisheye", &[0], "--headless --lens panorama --serve 127.0.0.1:0 --steps 20 --out {out}/served"),
    row("fisheye", &[0], "--headless --lens ftheta --steps 20 --record {out}/fisheye.mcap --out {out}/served"),
    row("fisheye", &[2], "--headless --serve nowhere --out {out}/none"),
    row("fisheye", &[2], "--headless --lens opencv --renderer raster --out {out}/none"),
    row("fisheye", &[0], "--headless --lens opencv --lens equidistant --renderer hybrid --out {out}/hybrid"),
    row("fisheye", &[2], "--headless --camera-info {out}/malformed.urdf --out {out}/none"),
    row("fisheye", &[2], "--headless --camera-info {out}/there_is_no_such_file.yaml --out {out}/none"),
    row("inspect_robot", &[0, 1], "assets/sr5/SR5.urdf"),
    row("inspect_robot", &[1], "{robots}/anymal_c_simple_description/urdf/anymal.urdf"),
    row("inspect_robot", &[0, 1], "assets/quadruped/quadruped.xml --floating-base --qpos LF_HFE=0.4"),
    row("inspect_robot", &[2], "assets/quadruped/quadruped.xml assets/sr5/SR5.urdf"),
    row("inspect_robot", &[2], "{out}/malformed.urdf"),
    row(
        "inspect_robot",
        &[0, 1],
        "assets/sr5/SR5.urdf --headless --out {out}/inspected --serve 127.0.0.1:0 --steps 20",
    ),
    row("inspect_robot", &[0, 1], "assets/sr5/SR5.urdf --record {out}/inspected.mcap --steps 20"),
    row("inspect_robot", &[2], "assets/sr5/SR5.urdf --serve nowhere"),
    row("inspect_robot", &[2], "{out}/there_is_no_such_file.urdf"),
];

/// Pairs of folders with the same scenes by two renderers. The flag is true for renderers with different lighting:
/// `fast-rt` has the rasterizer's lighting, and may render identical images.
const SAME_SCENES: [(&str, [&str; 2], bool); 6] = [
    ("create_sensor", ["sensor/raster", "sensor/rt"], true),
    ("create_sensor", ["sensor/raster", "sensor/hybrid"], true),
    ("create_sensor", ["sensor/raster", "sensor/fast-rt"], false),
    ("render_model", ["model/raster", "model/rt"], true),
    ("render_model", ["model/raster", "model/hybrid"], true),
    ("render_model", ["model/raster", "model/fast-rt"], false),
];

/// Selection of table rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowSelection {
    All,
    /// The rows that depend on the MuJoCo version: the first valid row of each example, and every row with a report
    /// check. Flags, formats and refusals do not depend on it.
    VersionDependent,
}

impl RowSelection {
    fn chosen(self) -> Vec<&'static ExampleRun> {
        let mut seen = Vec::new();
        let mut is_first = |row: &ExampleRun| {
            let first = row.exits != [2] && !seen.contains(&row.example);
            if !first {
                return false;
            }
            seen.push(row.example);
            true
        };
        let mut of_physics = |row: &&ExampleRun| is_first(row) || row.has_report_check;
        TABLE.iter().filter(|row| of_physics(row) || self == Self::All).collect()
    }
}

/// Builds the examples of these packages and runs rows of the table.
pub(crate) fn run(repo: &Repo, ready: &Prepared, packages: &[&str], rows: RowSelection) -> XtaskResult {
    no_findings("examples and their table in xtask/src/examples.rs disagree", &table_gaps(&examples(&repo.root)))?;
    // Built with the features of the tests, so that nothing is compiled twice.
    ready.cargo().args(["build", "--examples"]).args(packages).args(test::features(packages)).run()?;
    let out = repo.target.join("examples-out");
    if out.exists() {
        fs::remove_dir_all(&out).map_err(|e| Failure::new(format!("{}: {e}", out.display())))?;
    }
    fs::create_dir_all(&out)
        .and_then(|()| fs::write(out.join("malformed.urdf"), "<robot name=\"torn\">\n  <link name=\"base\">\n"))
        .map_err(|e| Failure::new(format!("{}: {e}", out.display())))?;
    let has_robots = repo.root.join(ROBOTS).is_dir();
    let rows_to_run = rows.chosen();
    let mut progress = Progress::new(rows_to_run.len());
    for row in rows_to_run {
        progress.begin(row.example);
        if row.args.contains("{robots}") && !has_robots {
            if in_ci() {
                return Err(Failure::new(format!("{ROBOTS} is missing: {} {}", row.example, row.args)));
            }
            println!("left out, {ROBOTS} is missing: {} {}", row.example, row.args);
            continue;
        }
        run_row(ready, row, &out)?;
    }
    if rows != RowSelection::All {
        return Ok(());
    }
    for (example, [ours, other], lit) in SAME_SCENES {
        same_images::check(&out.join(ours), &out.join(other), lit)
            .map_err(|reason| Failure::new(format!("{example}: {reason}")))?;
    }
    Ok(())
}

fn run_row(ready: &Prepared, row: &ExampleRun, out: &Path) -> XtaskResult {
    let args = words(row.args, &out.to_string_lossy());
    let cmd = ready.example(row.example).args(&args);
    let line = cmd.to_string();
    let failure = |message: String| Failure { repeat_command: Some(line.clone()), ..Failure::new(message) };
    let (code, took) = cmd.exit_code_within(TIME_LIMIT)?;
    if QUICK.contains(&row.example) && took > QUICK_LIMIT {
        let (took, limit) = (took.as_secs_f64(), QUICK_LIMIT.as_secs());
        return Err(failure(format!("`{}` ran for {took:.1} s, where it is to end within {limit} s", row.example)));
    }
    if !row.exits.contains(&code) {
        let expected: Vec<String> = row.exits.iter().map(i32::to_string).collect();
        let expected = expected.join(" or ");
        return Err(failure(format!("`{} {}` ended with {code}, expected {expected}", row.example, args.join(" "))));
    }
    // A run with invalid input ends before it can write a report.
    if let (0 | 1, Some(report)) = (code, flag_value(&args, "--report")) {
        check_report(Path::new(report), row.report)
            .map_err(|reason| failure(format!("the report {report}: {reason}")))?;
    }
    Ok(())
}

fn words(args: &str, out: &str) -> Vec<String> {
    args.split_whitespace().map(|word| word.replace("{out}", out).replace("{robots}", ROBOTS)).collect()
}

fn flag_value<'a>(args: &'a [String], flag: &str) -> Option<&'a str> {
    args.iter().position(|arg| arg == flag).and_then(|at| args.get(at + 1)).map(String::as_str)
}

/// Checks that a report is a non-empty JSON object that meets the requirement.
fn check_report(path: &Path, required: ReportCheck) -> Result<(), String> {
    let text = fs::read_to_string(path).map_err(|e| e.to_string())?;
    match serde_json::from_str::<Value>(&text) {
        Ok(report) if report.as_object().is_some_and(|fields| !fields.is_empty()) => required(&report),
        Ok(_) => Err("not a JSON object with fields".to_string()),
        Err(e) => Err(format!("not JSON: {e}")),
    }
}

fn anything(_: &Value) -> Result<(), String> {
    Ok(())
}

/// Checks the disparity against the right camera's own depth, on at least a tenth of all pixels. The tolerance is a
/// tenth of a pixel, for curved surfaces between two pixel centers.
fn check_disparity(report: &Value) -> Result<(), String> {
    let pixels = number(report, "width")? * number(report, "height")?;
    let (points, error) = (number(report, "points")?, number(report, "disagreement_pixels")?);
    let compared = number(report, "points_compared")?;
    let (low, high) = (number(report, "disparity_min")?, number(report, "disparity_max")?);
    if !(0.0 < low && low < high) || points < 0.25 * pixels || compared < 0.1 * pixels {
        return Err(format!(
            "{points} points of {pixels} pixels, {compared} seen by both cameras, disparities from {low} to {high}"
        ));
    }
    if error > 0.1 {
        return Err(format!("the right eye's depth is {error} pixels from the disparity"));
    }
    Ok(())
}

/// Checks that each of the nine lenses shows objects, and that points project back to their pixels. Points are in
/// single precision, which moves them by 6e-8 of their distance; a hundredth of a pixel is 3e-5 of it or more.
fn check_lenses(report: &Value) -> Result<(), String> {
    let lenses = report["lenses"].as_array().filter(|lenses| lenses.len() == 9).ok_or("there are nine lenses")?;
    for lens in lenses {
        let (hits, error) = (number(lens, "pixels_that_hit")?, number(lens, "round_trip_error_pixels")?);
        if hits == 0.0 || error > 0.01 {
            return Err(format!("{}: {hits} pixels see something, points are {error} pixels off", lens["lens"]));
        }
    }
    Ok(())
}

/// Checks that the glass ball shows the ground behind it, which is darker than the clay in the direct light.
fn check_transparent_glass(report: &Value) -> Result<(), String> {
    let [glass, clay] = glass_and_clay(report)?;
    if glass < 0.8 * clay { Ok(()) } else { Err(format!("glass has a mean red of {glass}, clay of {clay}")) }
}

/// Checks that opaque white glass is brighter than clay in the same light.
fn check_opaque_glass(report: &Value) -> Result<(), String> {
    let [glass, clay] = glass_and_clay(report)?;
    if glass > clay { Ok(()) } else { Err(format!("glass has a mean red of {glass}, clay of {clay}")) }
}

/// The mean red of both balls.
fn glass_and_clay(report: &Value) -> Result<[f64; 2], String> {
    let colors = &report["mean_colors"];
    let red = |ball: &str| colors[ball][0].as_f64().ok_or_else(|| format!("{ball} is not in {colors}"));
    Ok([red("glass")?, red("clay")?])
}

/// Default number of environments in the examples that count successes.
const TRIALS: u64 = 16;

/// Checks that enough of the 16 environments succeeded, and that these have not diverged.
fn check_successes(report: &Value) -> Result<(), String> {
    let succeeded = trials(report)?.iter().filter(|row| row["success"] == true && row["diverged"].is_null()).count();
    let (successes, needed) = (number(report, "successes")?, number(report, "needed")?);
    if succeeded as f64 != successes {
        return Err(format!("{successes} successes are claimed, {succeeded} environments have one"));
    }
    if needed < 15.0 || successes < needed {
        return Err(format!("{successes} successes where {needed} are needed, which should be 15 at least"));
    }
    Ok(())
}

/// Checks that no environment succeeded because no cube was lifted, although the hands moved there and up again. Later
/// motions are not checked, because they depend on the final positions of the cubes.
fn check_none_lifted(report: &Value) -> Result<(), String> {
    check_no_success(report, |row| Ok(row["planned_to_lift"] != true || row["lifted"] != false))
}

/// Checks that no environment succeeded because no drawer opened far enough, although every hand motion was possible.
fn check_none_opened(report: &Value) -> Result<(), String> {
    check_no_success(report, |row| Ok(row["planned"] != true || number(row, "open")? >= 0.15))
}

/// As [`check_successes`]; also checks that the pushes were strong: every robot left the floor and tilted.
///
/// The third push lifts 9.6 kg by 120 N for 0.15 s. The acceleration is (120 - 9.6 x 9.81) / 9.6 = 2.69 m/s², which
/// gives 0.40 m/s and 3 cm at its end. The robot lands after (0.40 + sqrt(0.40² + 2 x 9.81 x 0.03)) / 9.81 = 0.13 s
/// more: 0.28 s in total, of which half is required.
///
/// The weakest push is 20 N for 0.15 s, at 0.45 m from the floor, on an inertia of 1.43 kg m² (see the example's
/// `gains`). It leaves 0.94 rad/s at 0.07 rad. Wheels that accelerate by at most 6 m/s² take 0.06 s, 0.03 rad, to stop
/// that. The strongest of four pushes tilts a robot by at least these 0.1 rad.
fn balanced(report: &Value) -> Result<(), String> {
    check_successes(report)?;
    for row in trials(report)? {
        if number(row, "airborne")? < 0.14 || number(row, "largest_tilt")? < 0.1 {
            return Err(format!("this robot was hardly pushed: {row}"));
        }
    }
    Ok(())
}

/// Checks that no environment succeeded because every body touched the floor.
fn check_all_fell(report: &Value) -> Result<(), String> {
    check_no_success(report, |row| Ok(row["body_touched_floor"] != true))
}

/// Checks that no environment succeeded, although the cubes were found and the hands moved there. The distance from the
/// cube must equal the calibration error: 2 cm along both axes of the image, one of which is tilted by atan(0.12 /
/// 0.4), that is 27.7 mm.
fn check_all_beside(report: &Value) -> Result<(), String> {
    check_no_success(report, |row| {
        let beside = number(row, "beside")?;
        Ok(row["found"] != true || row["planned"] != true || !(0.025..0.031).contains(&beside))
    })
}

/// Checks that no environment succeeded because no cube was found.
fn check_none_found(report: &Value) -> Result<(), String> {
    // The hand must also not be above the cube by chance: a pixel is 2.4 mm there.
    check_no_success(report, |row| Ok(row["found"] != false || number(row, "beside")? < 0.0024))
}

/// Checks that few of many targets were reached before learning, and enough after. A policy that ends anywhere in the
/// box reaches 0.26 % of the targets.
fn check_learned(report: &Value) -> Result<(), String> {
    let (before, after) = (number(report, "reached_before")?, number(report, "reached_after")?);
    let (needed, envs) = (number(report, "needed")?, number(report, "num_envs")?);
    if envs < 128.0 || needed < 0.9 {
        return Err(format!("{envs} targets, of which {needed} are enough: there should be 128 and 0.9 at least"));
    }
    if before > 0.05 || after < needed {
        return Err(format!("{before} of all targets were reached before, {after} after"));
    }
    Ok(())
}

/// Checks a learning run without a signal: as many iterations as with one, but few targets reached before and after. A
/// policy that ends anywhere in the box reaches 0.26 % of the targets, so that 5 % of 128 or more occur by chance once
/// in 1e6 runs.
fn check_not_learned(report: &Value) -> Result<(), String> {
    let (before, after) = (number(report, "reached_before")?, number(report, "reached_after")?);
    if report["signal"] != false || number(report, "iterations")? < 32.0 || number(report, "num_envs")? < 128.0 {
        return Err("this is not the control: 32 iterations without a signal".into());
    }
    if before.max(after) <= 0.05 { Ok(()) } else { Err(format!("{before} were reached before, {after} after")) }
}

/// Checks that no environment succeeded or diverged, and that `wrong` is false for every environment.
fn check_no_success(report: &Value, wrong: impl Fn(&Value) -> Result<bool, String>) -> Result<(), String> {
    let successes = number(report, "successes")?;
    if successes != 0.0 {
        return Err(format!("{successes} successes in a run that is to fail"));
    }
    for (env, row) in trials(report)?.iter().enumerate() {
        if !row["diverged"].is_null() || wrong(row)? {
            return Err(format!("environment {env} did not fail as it should: {row}"));
        }
    }
    Ok(())
}

/// The rows of a report's 16 environments.
fn trials(report: &Value) -> Result<&[Value], String> {
    let rows = report["environments"].as_array().map(Vec::as_slice).unwrap_or_default();
    match (number(report, "num_envs")?, rows.len() as u64) {
        (claimed, TRIALS) if claimed == TRIALS as f64 => Ok(rows),
        (claimed, rows) => Err(format!("{claimed} environments, {rows} reported, expected {TRIALS}")),
    }
}

fn number(of: &Value, field: &str) -> Result<f64, String> {
    of[field].as_f64().ok_or_else(|| format!("no number {field:?} in {of}"))
}

/// Names of `examples/x.rs` and `examples/x/main.rs`.
fn examples(root: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(root.join("examples"))
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "rs") || path.join("main.rs").is_file())
        .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
        .collect();
    names.sort();
    names
}

fn table_gaps(examples: &[String]) -> Vec<String> {
    let mut findings: Vec<String> = examples
        .iter()
        .filter(|name| !TABLE.iter().any(|row| row.example == *name))
        .map(|name| format!("the example `{name}` has no row"))
        .collect();
    let mut rows: Vec<&str> = TABLE.iter().map(|row| row.example).collect();
    rows.sort_unstable();
    rows.dedup();
    rows.retain(|name| !examples.iter().any(|example| example == name));
    findings.extend(rows.iter().map(|name| format!("there are rows for `{name}`, but no such example")));
    findings
}

#[cfg(test)]
mod tests;
