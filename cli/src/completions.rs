//! `kinetoscope completions`: completion of commands and flags in shells.

use crate::command_status::{CommandStatus, Result};
use crate::text_output::write_text;
use clap::CommandFactory as _;
use clap_complete::Shell;

/// Print a script that completes commands and flags in a shell
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

const HELP: &str = "\
Examples:
  kinetoscope completions bash > ~/.local/share/bash-completion/completions/kinetoscope
  kinetoscope completions zsh > ~/.zfunc/_kinetoscope           with fpath+=~/.zfunc before compinit in ~/.zshrc
  kinetoscope completions fish > ~/.config/fish/completions/kinetoscope.fish

Exit codes: 0 done; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut crate::Args::command(), "kinetoscope", &mut script);
    write_text(&String::from_utf8(script)?, None)
}
