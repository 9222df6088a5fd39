//! `kinetoscope check`: what is in a robot's files, and everything odd in them.

use crate::model::{Files, ModelArgs};
use crate::{Ending, Result, excerpt};
use kinetoscope::prelude::*;
use kinetoscope::sim::inspect::{InspectCfg, inspect};
use std::io::Write;
use std::path::PathBuf;

/// Tree, joints, masses, dynamics and warnings of a robot, with the lines that they are about
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    model: ModelArgs,
    /// Joint positions [rad or m], 0 where not given
    #[arg(long, value_name = "NAME=VALUE,...", value_delimiter = ',', value_parser = position, allow_hyphen_values = true)]
    qpos: Vec<(String, f64)>,
    /// Write the report to a file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> Result<Ending> {
    let mut out = std::io::stdout().lock();
    let urdf = match args.model.files()? {
        Files::Urdf(urdf) => urdf,
        Files::Mjcf(_) => return check_mjcf(args, &mut out),
    };
    let cfg = InspectCfg { urdf, floating_base: args.model.floating_base, qpos: args.qpos.clone() };
    let report = inspect(&cfg)?;
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&report)? + "\n";
        std::fs::write(path, text).map_err(|e| format!("--json {}: {e}", path.display()))?;
    }
    // A closed pipe, as behind `| head`, is no error of ours.
    let _ = write!(out, "{}", report.without_warnings());
    let _ = out.flush();
    // MuJoCo has a say too: it compiles what the report describes.
    let (sim, _) = args.model.simulation(SimulationManagerCfg { num_envs: 1, ..Default::default() })?;
    let warned = excerpt::print_warnings(sim.diagnostics());
    Ok(if warned || !report.warnings.is_empty() { Ending::Warned } else { Ending::Done })
}

/// A robot that is an MJCF file: MuJoCo compiles it, and what it made of it is listed.
fn check_mjcf(args: &Args, out: &mut impl Write) -> Result<Ending> {
    if !args.qpos.is_empty() || args.json.is_some() {
        return Err("--qpos and --json are for URDF files: an MJCF file is checked as it stands".into());
    }
    let (sim, id) = args.model.simulation(SimulationManagerCfg { num_envs: 1, ..Default::default() })?;
    let robot = sim.robot(id);
    let limits = robot.qpos_limits();
    let _ = writeln!(out, "{} links, {} joints\n", robot.link_names().len(), robot.joint_names().len());
    let width = robot.joint_names().iter().map(String::len).max().unwrap_or(0).max("joint".len());
    let _ = writeln!(out, "{:width$}  {:>12}  {:>12}", "joint", "lower", "upper");
    for (j, name) in robot.joint_names().iter().enumerate() {
        let _ = writeln!(out, "{name:width$}  {:>12.6}  {:>12.6}", limits[(0, j, 0)], limits[(0, j, 1)]);
    }
    let _ = out.flush();
    Ok(if excerpt::print_warnings(sim.diagnostics()) { Ending::Warned } else { Ending::Done })
}

fn position(text: &str) -> std::result::Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("write NAME=VALUE,NAME=VALUE, such as joint1=0.5,joint2=-1")?;
    let value = value.trim().parse().map_err(|_| format!("{value:?} is no number of radians or metres"))?;
    Ok((name.trim().to_owned(), value))
}
