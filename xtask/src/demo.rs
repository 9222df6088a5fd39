//! `cargo xtask demo`: the first example, on a machine with nothing installed.

use crate::run::{Repo, XtaskResult};
use crate::setup::{self, Requirements};

/// Default flags; the user's flags replace them.
const DEFAULTS: &[(&str, Option<&str>)] = &[("--headless", None), ("--num-envs", Some("4")), ("--steps", Some("2004"))];

/// Crates that the demo compiles unoptimized: a newcomer waits for the build, not for some seconds of simulation.
/// Their dependencies stay as the tests need them, so the tests do not compile those again.
const UNOPTIMIZED: [&str; 4] = ["kinetoscope", "kinetoscope-robot", "kinetoscope-sensors", "kinetoscope-sim"];

#[derive(Debug, clap::Args)]
pub(crate) struct DemoArgs {
    /// Install what is missing without asking
    #[arg(long, short)]
    yes: bool,
    /// Flags of the example `create_sensor`; they replace the demo's own
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    pub(crate) args: Vec<String>,
}

pub(crate) fn run(repo: &Repo, args: &DemoArgs) -> XtaskResult {
    if !args.yes {
        setup::ask_before_installing();
    }
    let ready = setup::prepare(repo, Requirements::default())?;
    let images = repo.target.join("demo").to_string_lossy().into_owned();
    let mut defaults = DEFAULTS.to_vec();
    defaults.push(("--out", Some(&images)));
    ready
        .cargo_once()
        // Paths in the arguments are relative to the user's working directory, not to the repository.
        .current_dir(".")
        .arg("run")
        .args(
            UNOPTIMIZED.iter().flat_map(|name| ["--config".into(), format!("profile.dev.package.{name}.opt-level=0")]),
        )
        .arg("--manifest-path")
        .arg(repo.root.join("Cargo.toml"))
        .args(["--package", "kinetoscope", "--example", "create_sensor"])
        .args(feature_args(&args.args))
        .arg("--")
        .args(merged(&defaults, &args.args))
        .inherit_stdin()
        .run()?;
    println!("\nThe demo is built in a short time, and runs slowly. Build your programs with `--release`.");
    Ok(())
}

/// Feature flags of cargo. The build dominates the time of the first run, so recordings and the browser view are
/// compiled only if a flag needs them.
fn feature_args(user: &[String]) -> &'static [&'static str] {
    let asked = |arg: &String| flag_name(arg).is_some_and(|name| ["record", "serve"].contains(&name.as_str()));
    if user.iter().any(asked) { &[] } else { &["--no-default-features"] }
}

fn merged(defaults: &[(&str, Option<&str>)], user: &[String]) -> Vec<String> {
    let named: Vec<String> = user.iter().filter_map(|arg| flag_name(arg)).collect();
    let mut merged = Vec::new();
    for (flag, value) in defaults {
        if !flag_name(flag).is_some_and(|name| named.contains(&name)) {
            merged.push((*flag).to_string());
            merged.extend(value.map(str::to_string));
        }
    }
    merged.extend_from_slice(user);
    merged
}

/// The normalized name of a flag: `--num_envs=8` and `--num-envs` are both `num-envs`.
fn flag_name(arg: &str) -> Option<String> {
    let name = arg.strip_prefix("--")?;
    Some(name.split('=').next().unwrap_or(name).replace('_', "-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        line.split_whitespace().map(str::to_string).collect()
    }

    #[test]
    fn defaults() {
        assert_eq!(merged(DEFAULTS, &[]), words("--headless --num-envs 4 --steps 2004"));
    }

    #[test]
    fn features() {
        assert_eq!(feature_args(&words("--seed 3 --overwrite")), ["--no-default-features"]);
        for flags in ["--serve", "--serve=127.0.0.1:0", "--seed 3 --record run.mcap"] {
            assert!(feature_args(&words(flags)).is_empty(), "{flags}");
        }
    }

    #[test]
    fn spellings() {
        assert_eq!(merged(DEFAULTS, &words("--num_envs 9")), words("--headless --steps 2004 --num_envs 9"));
        assert_eq!(merged(DEFAULTS, &words("--steps=1")), words("--headless --num-envs 4 --steps=1"));
        assert_eq!(merged(DEFAULTS, &words("--seed 3")), words("--headless --num-envs 4 --steps 2004 --seed 3"));
    }
}
