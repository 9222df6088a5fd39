//! `kinetoscope convert`: exports a robot as MJCF with its meshes, for both supported MuJoCo versions.

use crate::command_status::{CommandStatus, Result};
use crate::excerpt;
use crate::model::{ModelArgs, Setup};
use std::path::{Path, PathBuf};

/// Convert a model to MJCF for plain MuJoCo: one file for 2.2.2 and one for 4.x, with meshes and textures beside them
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    model: ModelArgs,
    /// Output folder; created if missing
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Write even if the folder is not empty; files of the same names are replaced
    #[arg(long)]
    force: bool,
}

const HELP: &str = "\
Examples:
  kinetoscope convert arm.urdf -o arm_mjcf
  kinetoscope convert arm.urdf -o arm_mjcf --force --package arm_description=robots/arm_description

Exit codes: 0 done; 1 done, with warnings (something was repaired, ignored or left out); 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    if !args.force && !is_empty(&args.out)? {
        return Err(
            format!("{}: the folder is not empty; choose another folder, or add --force", args.out.display()).into()
        );
    }
    let model = args.model.build(&Setup::STATIC)?;
    let left_out = model.sim.dump(&args.out)?;
    for file in list_files(&args.out)? {
        println!("{}", file.display());
    }
    let warned = [model.print_warnings(), excerpt::print_warnings(&left_out)];
    Ok(if warned.contains(&true) { CommandStatus::Warned } else { CommandStatus::Done })
}

/// True if a folder is empty or does not exist.
fn is_empty(folder: &Path) -> Result<bool> {
    match std::fs::read_dir(folder) {
        Ok(mut entries) => Ok(entries.next().is_none()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(true),
        Err(error) => Err(format!("{}: {error}", folder.display()).into()),
    }
}

/// Returns all files of a folder and its subfolders, sorted by path.
fn list_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))? {
            let path = entry?.path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    Ok(files)
}
