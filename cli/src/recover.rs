//! `kinetoscope recover`: completes the file of an interrupted recording.

use crate::command_status::{CommandStatus, Result};
use kinetoscope::record::recover_to;
use std::path::PathBuf;

/// Make a complete, indexed MCAP file from an interrupted recording
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Recording, by its final name (run.mcap) or its partial file (run.mcap.part)
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Name of the complete file [default: the final name of the recording]
    #[arg(short, long, value_name = "OUT")]
    out: Option<PathBuf>,
}

const HELP: &str = "\
Examples:
  kinetoscope recover run.mcap                completes run.mcap from run.mcap.part and removes the latter
  kinetoscope recover run.mcap -o saved.mcap

Exit codes: 0 all complete messages are in the file; 1 the partial file is damaged: its undamaged messages are
in the file, and the partial file is kept; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    let is_left = args.file.extension().is_some_and(|end| end == "part");
    let file = if is_left { args.file.with_extension("") } else { args.file.clone() };
    let out = args.out.as_ref().unwrap_or(&file);
    let recovered = recover_to(&file, out)?;
    println!("{}: {} messages", out.display(), recovered.messages);
    match recovered.damage {
        None => Ok(CommandStatus::Done),
        Some(damage) => {
            eprintln!(
                "warning: the partial file is damaged ({damage}): only its undamaged messages were recovered, and it was kept"
            );
            Ok(CommandStatus::Warned)
        }
    }
}
