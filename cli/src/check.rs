//! `kinetoscope check`: what is in a robot's files, and everything odd in them.

use crate::model::{Files, ModelArgs};
use crate::{Ending, Result, excerpt};
use kinetoscope::prelude::*;
use kinetoscope::sim::inspect::{InspectCfg, inspect};
use std::io::Write;
use std::path::PathBuf;

/// Tree, joints, masses, dynamics and warnings of a robot, with the lines that they are about
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
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

const HELP: &str = "\
Examples:
  kinetoscope check arm.urdf hand.urdf            the hand hangs from the tip of the arm
  kinetoscope check arm.urdf --qpos hinge=0.5     inertia and torques at another position
  kinetoscope check humanoid.xml --floating-base --json humanoid.json

Exit codes: 0 nothing is odd; 1 with warnings; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<Ending> {
    let mut out = std::io::stdout().lock();
    let mut cfg = InspectCfg { floating_base: args.model.floating_base, qpos: args.qpos.clone(), ..Default::default() };
    match args.model.files()? {
        Files::Urdf(urdf) => cfg.urdf = urdf,
        Files::Mjcf(path) => cfg.mjcf = Some(MjcfFile::new(path)),
    }
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

fn position(text: &str) -> std::result::Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("write NAME=VALUE,NAME=VALUE, such as joint1=0.5,joint2=-1")?;
    let value = value.trim().parse().map_err(|_| format!("{value:?} is no number of radians or metres"))?;
    Ok((name.trim().to_owned(), value))
}
