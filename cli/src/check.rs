//! `kinetoscope check`: report on the contents of robot files, with warnings.

use crate::command_status::{CommandStatus, Result};
use crate::model::{Files, ModelArgs, Setup, has_floating_root, may_be_scene};
use crate::scene_report::{MjcfReport, SceneReport};
use kinetoscope::prelude::*;
use kinetoscope::sim::Error;
use kinetoscope::sim::inspect::{InspectCfg, InspectError, inspect};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Report tree, joints, masses, dynamics and warnings of a robot or scene, with the file lines of the warnings
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    model: ModelArgs,
    /// Joint positions [rad or m]; other joints are at 0, or at `ref` of an MJCF file, and mimic joints follow. Not for
    /// scenes
    #[arg(long, value_name = "NAME=VALUE,...", value_delimiter = ',', value_parser = parse_joint_position, allow_hyphen_values = true)]
    qpos: Vec<(String, f64)>,
    /// Also write the report to a JSON file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

const HELP: &str = "\
Examples:
  kinetoscope check arm.urdf hand.urdf            the hand is attached to the tip of the arm
  kinetoscope check arm.urdf --qpos hinge=0.5     inertia and torques at another position
  kinetoscope check humanoid.xml --floating-base --json humanoid.json
  kinetoscope check scene.toml                    each robot of a scene, and the other entities

Exit codes: 0 no warnings; 1 with warnings; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    let mut cfg = InspectCfg { floating_base: args.model.floating_base, qpos: args.qpos.clone(), ..Default::default() };
    match args.model.files()? {
        Files::Urdf(urdf) => {
            cfg.floating_base &= !has_floating_root(&urdf);
            cfg.urdf = urdf;
        }
        Files::Mjcf(path) => cfg.mjcf = Some(MjcfFile::new(path)),
        Files::Scene(path) => return scene(args, &path),
    }
    let report = match inspect(&cfg) {
        Ok(report) => report,
        Err(InspectError::Load(error)) if matches!(&*error, Error::RobotFile { error, .. } if may_be_scene(error)) => {
            return mjcf_scene(args);
        }
        Err(error) => return Err(error.into()),
    };
    args.write_json(|| serde_json::to_string_pretty(&report))?;
    print(&report.without_warnings());
    // MuJoCo compiles the model as well, and its warnings are included.
    let warned = args.model.build(&Setup::STATIC)?.print_warnings();
    Ok(if warned || !report.warnings.is_empty() { CommandStatus::Warned } else { CommandStatus::Done })
}

/// Checks an MJCF file that describes a scene.
fn mjcf_scene(args: &Args) -> Result<CommandStatus> {
    args.refuse_positions()?;
    let model = args.model.build(&Setup::STATIC)?;
    let Some(part) = model.mjcf else { return Err("the file is not a scene".into()) };
    let report = MjcfReport::of(&args.model.file_names(), &model.sim.mjcf_part(part));
    args.write_json(|| serde_json::to_string_pretty(&report.json()))?;
    print(&report);
    Ok(if model.print_warnings() { CommandStatus::Warned } else { CommandStatus::Done })
}

/// Checks a scene file: reports each robot, and lists the other entities.
fn scene(args: &Args, path: &Path) -> Result<CommandStatus> {
    args.refuse_positions()?;
    // The whole scene is built first, because its errors name the lines of the scene file.
    let model = args.model.build(&Setup::STATIC)?;
    let report = SceneReport::of(&args.model.file_names(), &SceneCfg::from_file(path)?)?;
    let json = report.json()?;
    args.write_json(|| serde_json::to_string_pretty(&json))?;
    print(&report);
    let warned = model.print_warnings();
    Ok(if warned || report.has_warnings() { CommandStatus::Warned } else { CommandStatus::Done })
}

impl Args {
    fn refuse_positions(&self) -> Result<()> {
        let Some((name, _)) = self.qpos.first() else { return Ok(()) };
        Err(format!(
            "--qpos {name}: {} is a scene, which starts as the file says; leave it out",
            self.model.file_names()
        )
        .into())
    }

    fn write_json(&self, text: impl FnOnce() -> serde_json::Result<String>) -> Result<()> {
        let Some(path) = &self.json else { return Ok(()) };
        let text = text()? + "\n";
        std::fs::write(path, text).map_err(|e| format!("--json {}: {e}", path.display()).into())
    }
}

fn print(report: &dyn std::fmt::Display) {
    let mut out = std::io::stdout().lock();
    // A closed pipe, as with `| head`, is not an error.
    let _ = write!(out, "{report}");
    let _ = out.flush();
}

fn parse_joint_position(text: &str) -> std::result::Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("write NAME=VALUE,NAME=VALUE, such as joint1=0.5,joint2=-1")?;
    let value = value.trim().parse().map_err(|_| format!("{value:?} is not a number (rad or m)"))?;
    Ok((name.trim().to_owned(), value))
}
