//! A report on a robot before MuJoCo loads it: tree, joints, masses, dynamics, and every diagnostic of its files.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::prelude::*;
use kinetoscope::robot::urdf::Strictness;
use kinetoscope::sim::DriveType;
use kinetoscope::sim::inspect::{InspectCfg, RobotReport, inspect};
use launcher::live_view::LiveViewFlags;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Prints tree, joints, masses, dynamics and warnings of a robot as its files describe it; missing mass properties come
/// from the shapes.
#[derive(Debug, Parser)]
#[command(name = "inspect_robot", after_help = HELP)]
struct Args {
    /// URDF files, each attached to the tip of the one before; or one MJCF file (.xml)
    #[arg(required = true, value_name = "FILE.urdf|FILE.xml")]
    files: Vec<PathBuf>,
    /// Let the root move freely: its six velocities are the first rows of the dynamics, before the joints
    #[arg(long, alias = "floating_base")]
    floating_base: bool,
    /// Folder of a ROS package for package:// URIs; may be repeated
    #[arg(long, value_name = "NAME=DIR", value_parser = package)]
    package: Vec<(String, PathBuf)>,
    /// Additional search folder for meshes and packages that are not found relative to the URDF, like Isaac Gym's asset
    /// root
    #[arg(long, value_name = "DIR", value_parser = folder)]
    asset_root: Option<PathBuf>,
    /// Treat deviations from the URDF format as errors instead of warnings
    #[arg(long)]
    strict: bool,
    /// Joint positions [rad or m]; other joints are at 0, or at `ref` of an MJCF file, and mimic joints follow
    #[arg(long, value_name = "NAME=VALUE,...", value_delimiter = ',', value_parser = position)]
    qpos: Vec<(String, f64)>,
    /// Write the report to a file as JSON; `-` writes JSON to the terminal instead of the tables
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folder for an image of the robot, robot.png
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    live: LiveViewFlags,
}

const HELP: &str = "\
Several files: two are the components `arm` and `hand`, more are `part1`, `part2` and so on; fixed joints such as
`arm_TO_hand_CONNECTOR` attach each component to the tip of the previous one. A relative FILE that does not exist is
looked up in the assets of this crate. MuJoCo compiles an MJCF file; the compiled model is reported.

JSON: SI units, quaternions w x y z, gravity (0, 0, -9.81). `links` and `joints` have fixed ones too; `pose` is
x y z qw qx qy qz in the world; `com` of a link is in its frame, `inertia` about the center of mass in link axes, `axis` in
the frame of the joint. `mass_matrix` and `gravity_torque` have one row per joint of `joint_names`; `columns` names all rows,
with --floating-base first base.vx .. base.wz (velocity of the root in world axes, angular velocity in its own axes),
and last those of floating and planar joints. An MJCF file's armature is in `mass_matrix`. null where there is no value.

--serve and --record let the robot move, after the report, without drives: it hangs or falls.

Exit code: 0 loaded, 1 loaded with warnings (something was repaired, ignored or missing), 2 refused.";

const LOADED: u8 = 0;
const REPAIRED: u8 = 1;
const REFUSED: u8 = 2;

fn main() -> ExitCode {
    launcher::print_events();
    ExitCode::from(run(std::env::args_os(), &mut std::io::stdout().lock(), &mut std::io::stderr().lock()))
}

/// Runs the program with its arguments and output streams; returns the exit code.
pub(crate) fn run(args: impl IntoIterator<Item = OsString>, out: &mut dyn Write, err: &mut dyn Write) -> u8 {
    // Write errors are ignored: a closed pipe, as behind `| head`, is not an error of the program.
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        Err(error) => {
            let _ = if error.use_stderr() { write!(err, "{error}") } else { write!(out, "{error}") };
            return if error.use_stderr() { REFUSED } else { LOADED };
        }
    };
    let report = cfg(&args).and_then(|cfg| {
        let report = inspect(&cfg).map_err(|e| e.to_string())?;
        print(&report, args.json.as_deref(), out)?;
        show(&args, cfg).map_err(|e| e.to_string())?;
        Ok(report)
    });
    match report {
        Ok(report) if report.warnings.is_empty() => LOADED,
        Ok(_) => REPAIRED,
        Err(message) => {
            let _ = writeln!(err, "inspect_robot: {message}");
            REFUSED
        }
    }
}

fn print(report: &RobotReport, json: Option<&Path>, out: &mut dyn Write) -> Result<(), String> {
    if let Some(path) = json {
        let text = serde_json::to_string_pretty(report).map_err(|e| e.to_string())? + "\n";
        if path == Path::new("-") {
            let _ = out.write_all(text.as_bytes());
            return Ok(());
        }
        std::fs::write(path, text).map_err(|e| format!("--json {}: {e}", path.display()))?;
    }
    let _ = write!(out, "{report}");
    Ok(())
}

/// Renders the robot, and shows it in motion, if the flags request it.
fn show(args: &Args, cfg: InspectCfg) -> launcher::Result {
    if args.out.is_none() && !args.live.wants_motion() {
        return Ok(());
    }
    let InspectCfg { urdf, mjcf, floating_base, qpos, .. } = cfg;
    let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
    let drive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let id = sim.add_robot(RobotCfg { urdf, mjcf, drive, fix_base: !floating_base, ..Default::default() })?;
    let mut positions = sim.robot(id).qpos();
    for (name, value) in &qpos {
        if let Some(joint) = sim.robot(id).joint_names().iter().position(|joint| joint == name) {
            positions[(0, joint)] = *value;
        }
    }
    sim.robot_mut(id).write_qpos(&positions, None, None)?;
    if let Some(out) = &args.out {
        launcher::make_folder(out)?;
        sim.screenshot(out.join("robot.png"))?;
    }
    if args.live.wants_motion() { args.live.show(&mut sim) } else { Ok(()) }
}

fn cfg(args: &Args) -> Result<InspectCfg, String> {
    let files: Vec<PathBuf> = args.files.iter().map(|file| user_or_asset(file)).collect();
    let (floating_base, qpos) = (args.floating_base, args.qpos.clone());
    if let Some(mjcf) = files.iter().find(|file| is_mjcf(file)) {
        if files.len() > 1 {
            return Err(format!(
                "{} is a complete robot: an MJCF file cannot be combined with other files",
                mjcf.display()
            ));
        }
        if let Some((name, _)) = args.package.first() {
            let file = mjcf.display();
            return Err(format!(
                "--package {name}: {file} is an MJCF file, which has no package:// addresses; leave it out"
            ));
        }
        if args.strict || args.asset_root.is_some() {
            let flag = if args.strict { "--strict" } else { "--asset-root" };
            return Err(format!(
                "{flag}: {} is an MJCF file, the flag is for URDF files; leave it out",
                mjcf.display()
            ));
        }
        let mjcf = Some(MjcfFile::new(mjcf));
        return Ok(InspectCfg { mjcf, floating_base, qpos, ..Default::default() });
    }
    let strictness = if args.strict { Strictness::Strict } else { Strictness::Lenient };
    let (packages, asset_root) = (args.package.iter().cloned().collect(), args.asset_root.clone());
    let urdf = UrdfCfg { packages, asset_root, strictness, ..UrdfCfg::chain(files) };
    Ok(InspectCfg { urdf, floating_base, qpos, ..Default::default() })
}

fn is_mjcf(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension == "xml")
}

/// The path of an existing file, otherwise an asset, otherwise the path unchanged: the loader reports the missing file.
fn user_or_asset(file: &Path) -> PathBuf {
    if file.exists() { file.to_path_buf() } else { assets::path(file).unwrap_or_else(|_| file.to_path_buf()) }
}

fn package(text: &str) -> Result<(String, PathBuf), String> {
    let (name, folder) = text.split_once('=').ok_or("write NAME=DIR, such as my_robot=robots/my_robot")?;
    if name.is_empty() {
        return Err("the package has no name; write NAME=DIR".to_owned());
    }
    Ok((name.to_owned(), self::folder(folder)?))
}

fn folder(text: &str) -> Result<PathBuf, String> {
    let folder = PathBuf::from(text);
    if folder.is_dir() { Ok(folder) } else { Err(format!("{text} is not a folder")) }
}

fn position(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("write NAME=VALUE,NAME=VALUE, such as joint1=0.5,joint2=-1")?;
    let value = value.trim().parse().map_err(|_| format!("{value:?} is not a number (rad or m)"))?;
    Ok((name.trim().to_owned(), value))
}
