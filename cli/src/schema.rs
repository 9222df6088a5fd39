//! `kinetoscope schema`: the JSON Schema of scene files.

use crate::command_status::{CommandStatus, Result};
use crate::text_output::write_text;
use kinetoscope::sim::{EntityTypes, SceneCfg};
use std::path::PathBuf;

/// Print the JSON Schema of scene files, with which editors complete and check them
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Output file [default: the standard output]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

const HELP: &str = "\
Examples:
  kinetoscope schema -o scene.schema.json
  kinetoscope schema | less

The first line of a TOML file selects the schema (Even Better TOML, Taplo):  #:schema ./scene.schema.json
The first line of a YAML file (yaml-language-server):  # yaml-language-server: $schema=./scene.schema.json

Exit codes: 0 done; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    let schema = SceneCfg::json_schema(&EntityTypes::default());
    write_text(&format!("{schema:#}\n"), args.out.as_deref())
}
