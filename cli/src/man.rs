//! `kinetoscope man`: the manual pages.

use crate::command_status::{CommandStatus, Result};
use crate::text_output::write_text;
use clap::CommandFactory as _;
use clap_mangen::Man;
use std::path::PathBuf;

/// Print the manual page, or write the pages of all commands to a folder
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Folder for the pages of all commands; it is created if it does not exist
    #[arg(short, long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

const HELP: &str = "\
Examples:
  kinetoscope man | man -l -
  kinetoscope man -o ~/.local/share/man/man1    then: man kinetoscope-view

Exit codes: 0 done; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    if let Some(folder) = &args.out {
        let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
        std::fs::create_dir_all(folder).map_err(failed)?;
        clap_mangen::generate_to(crate::Args::command(), folder).map_err(failed)?;
        return Ok(CommandStatus::Done);
    }
    let mut page = Vec::new();
    Man::new(crate::Args::command()).render(&mut page)?;
    write_text(&String::from_utf8(page)?, None)
}
