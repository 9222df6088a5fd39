//! Completion scripts, manual pages, and the JSON Schema of scene files.

use super::support::CommandFolder;
use std::process::{Command, Stdio};

/// Every command of the help.
const COMMANDS: [&str; 11] =
    ["check", "convert", "render", "view", "bench", "plot", "replay", "recover", "schema", "completions", "man"];

/// Runs a program with a text as its input. Returns its messages unless it succeeds without one.
fn accepts(program: &str, args: &[&str], text: &str) -> Result<(), String> {
    let mut command = Command::new(program);
    command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| format!("{program}: {error}"))?;
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), text.as_bytes()).unwrap();
    let out = child.wait_with_output().unwrap();
    let messages = String::from_utf8_lossy(&out.stderr).into_owned();
    if out.status.success() && messages.is_empty() { Ok(()) } else { Err(messages) }
}

/// Bash reads the script, and completes commands and flags with it.
#[test]
fn bash_completion() {
    let shell = CommandFolder::with(&[]);
    let script = shell.run_ok("completions bash");
    accepts("bash", &["-n"], &script).unwrap();
    assert!(accepts("bash", &["-n"], &script.replace("esac", "")).is_err(), "bash -n accepts everything");
    shell.write("kinetoscope.bash", &script);
    let complete = |words: &str| {
        let count = words.split(' ').count();
        let run = format!(
            ". ./kinetoscope.bash; COMP_WORDS=({words}); COMP_CWORD={}; _kinetoscope kinetoscope \"${{COMP_WORDS[-1]}}\" \
             \"${{COMP_WORDS[-2]}}\"; echo \"${{COMPREPLY[@]}}\"",
            count - 1
        );
        let out = Command::new("bash").args(["--norc", "-c", &run]).current_dir(shell.folder()).output().unwrap();
        String::from_utf8(out.stdout).unwrap().trim().to_owned()
    };
    assert_eq!(complete("kinetoscope sch"), "schema");
    assert_eq!(complete("kinetoscope view --flo"), "--floating-base");
    let commands = complete("kinetoscope ''");
    assert!(COMMANDS.iter().all(|command| commands.contains(command)), "{commands}");
}

#[test]
fn other_shells() {
    let shell = CommandFolder::with(&[]);
    for name in ["zsh", "fish", "elvish", "powershell"] {
        let script = shell.run_ok(&format!("completions {name}"));
        assert!(COMMANDS.iter().all(|command| script.contains(command)), "{name}");
    }
    let (_, err, code) = shell.run("completions csh");
    assert!(code == 2 && err.contains("bash"), "{err}");
}

/// groff formats all pages without a warning.
#[test]
#[ignore = "needs groff: cargo xtask test"]
fn manual_pages() {
    let shell = CommandFolder::with(&[]);
    let page = shell.run_ok("man");
    assert!(page.starts_with(".ie \\n(.g") && page.contains(".TH kinetoscope 1"), "{}", &page[..100]);
    shell.run_ok("man --out pages");
    for command in COMMANDS {
        let page = std::fs::read_to_string(shell.path(&format!("pages/kinetoscope-{command}.1"))).unwrap();
        assert!(page.contains(&format!(".TH kinetoscope-{command} 1")), "{command}");
        let options = ["-man", "-ww", "-z", "-Tutf8"];
        accepts("groff", &options, &page).unwrap();
        assert!(accepts("groff", &options, &format!("{page}\n.nosuchmacro\n")).is_err(), "groff accepts everything");
    }
}
