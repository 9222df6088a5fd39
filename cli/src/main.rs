//! `kinetoscope`: command line tool that checks, converts, renders, simulates, benchmarks and replays robots and
//! scenes.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod bench;
mod channel_image;
mod check;
mod command_status;
mod completions;
mod convert;
mod events;
mod excerpt;
mod field_names;
mod file_kind;
mod interrupt;
mod man;
mod model;
mod plot;
mod progress;
mod recover;
mod render;
mod replay;
mod scene_report;
mod schema;
mod text_output;
mod view;

use clap::{Parser, Subcommand};
use command_status::CommandStatus;
use std::process::ExitCode;

/// Tools for robots and scenes from URDF and MJCF: check, convert, render, view, benchmark, plot and replay recordings.
/// They need no GPU and no OpenGL
#[derive(Debug, Parser)]
#[command(name = "kinetoscope", version, after_help = HELP)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

const HELP: &str = "\
Examples:
  kinetoscope check arm.urdf hand.urdf          tree, joints, masses, dynamics, and problems in the files
  kinetoscope convert arm.urdf -o arm_mjcf      MJCF for both supported MuJoCo versions, with meshes
  kinetoscope render humanoid.xml -o out.png    an image of the initial state
  kinetoscope view arm.urdf                     simulation in a window; --serve for a browser
  kinetoscope view humanoid.xml --floating-base a robot on a free base
  kinetoscope view scene.toml                   a scene of robots, objects and sensors
  kinetoscope bench arm.urdf --num-envs 64      steps and images per second on this machine
  kinetoscope plot run.mcap                     list the topics; with --topic, --field and --out: plot values
  kinetoscope replay run.mcap                   the recording in a window; --serve: in a browser; --verify: run again
  kinetoscope recover run.mcap                  complete the file of an interrupted recording
  kinetoscope schema -o scene.schema.json       completion and checks of scene files in editors
  kinetoscope completions bash                  completion of this command in a shell; man: its manual page

Exit codes: 0 done; 1 done, with warnings (something was repaired, ignored or missing); 2 refused, or aborted.
FILE: URDF files, an MJCF file, or a scene file (TOML, YAML, JSON). A relative path that does not exist is looked up in
the bundled assets (sr5/SR5.urdf, ...).";

/// Subcommands; each is implemented in the module of its name.
#[derive(Debug, Subcommand)]
enum Command {
    Check(check::Args),
    Convert(convert::Args),
    Render(render::Args),
    View(view::Args),
    Bench(bench::Args),
    Plot(plot::Args),
    Replay(replay::Args),
    Recover(recover::Args),
    Schema(schema::Args),
    Completions(completions::Args),
    Man(man::Args),
}

fn main() -> ExitCode {
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(error) => {
            // A closed pipe, as with `| head`, is not an error.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    events::print_to_stderr();
    let result = match &args.command {
        Command::Check(args) => check::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Render(args) => render::run(args),
        Command::View(args) => view::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Plot(args) => plot::run(args),
        Command::Replay(args) => replay::run(args),
        Command::Recover(args) => recover::run(args),
        Command::Schema(args) => schema::run(args),
        Command::Completions(args) => completions::run(args),
        Command::Man(args) => man::run(args),
    };
    match result {
        Ok(CommandStatus::Done) => ExitCode::SUCCESS,
        Ok(CommandStatus::Warned) => ExitCode::from(1),
        Err(error) => {
            // Settings of the library are flags here.
            excerpt::print_error(&error.to_string().replace("UrdfCfg::packages", "--package NAME=DIR"));
            ExitCode::from(2)
        }
    }
}
