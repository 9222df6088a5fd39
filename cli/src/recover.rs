//! `kinetoscope recover`: a whole file of what a killed recording has left.

use crate::ending::{Ending, Result};
use kinetoscope::record::recover_to;
use std::path::PathBuf;

/// Makes a whole, indexed MCAP file of what a recording has left that was killed
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// The recording, by the name that it was to have (run.mcap) or by that of what was left (run.mcap.part)
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// What to call the whole file, instead of the name that it was to have
    #[arg(short, long, value_name = "OUT")]
    out: Option<PathBuf>,
}

const HELP: &str = "\
Examples:
  kinetoscope recover run.mcap                makes run.mcap of run.mcap.part, and takes that away
  kinetoscope recover run.mcap -o saved.mcap

Exit codes: 0 everything that was written whole is in the file; 1 something in between is damaged: what was left stays; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<Ending> {
    let is_left = args.file.extension().is_some_and(|end| end == "part");
    let file = if is_left { args.file.with_extension("") } else { args.file.clone() };
    let out = args.out.as_ref().unwrap_or(&file);
    let recovered = recover_to(&file, out)?;
    println!("{}: {} messages", out.display(), recovered.messages);
    match recovered.damage {
        None => Ok(Ending::Done),
        Some(damage) => {
            eprintln!("warning: behind them something is damaged ({damage}); what was left is still there");
            Ok(Ending::Warned)
        }
    }
}
