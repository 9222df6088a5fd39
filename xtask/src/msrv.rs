//! Check that CI tests the oldest supported Rust, which is `rust-version` in `Cargo.toml`.

use crate::run::{Cmd, Failure, Repo, XtaskResult, in_ci};
use crate::setup::Prepared;
use std::collections::BTreeSet;

/// Succeeds if all other stages run with the oldest supported Rust. With a newer one, compiles the workspace with the
/// oldest one, if rustup has it.
///
/// # Errors
/// The Rust in use is older, or the workspace does not compile with the oldest supported one. In CI also: neither tests
/// the oldest one; elsewhere this is a note.
pub(crate) fn run(repo: &Repo, ready: &Prepared) -> XtaskResult {
    let oldest = oldest(repo)?;
    // Cargo compiles with the program that RUSTC names.
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let used = version(Cmd::new(rustc).current_dir(&repo.root))?;
    if is_release_of(&used, &oldest) {
        println!("all stages run with Rust {used}, the oldest supported one");
        return Ok(());
    }
    let with_oldest = |program: &str| {
        ready.program("rustup").args(["run", &oldest, program]).env_remove("RUSTC").current_dir(&repo.root)
    };
    // A toolchain of this name can be a linked folder with any Rust in it.
    if version(with_oldest("rustc")).is_ok_and(|installed| is_release_of(&installed, &oldest)) {
        let folder = repo.target.join("msrv");
        let check = with_oldest("cargo").env("CARGO_TARGET_DIR", folder);
        return check.args(["check", "--workspace", "--all-targets", "--locked"]).run();
    }
    let message = format!(
        "Rust {used} is in use, so that the oldest supported Rust {oldest} was not tested: `rustup toolchain install \
         {oldest}`, or set `rust-version` in Cargo.toml and the version in README.md and docs/install.md to {used}"
    );
    if in_ci() {
        return Err(Failure::new(message));
    }
    eprintln!("note: {message}");
    Ok(())
}

/// The oldest supported Rust, `1.95`.
fn oldest(repo: &Repo) -> XtaskResult<String> {
    let packages = repo.metadata["packages"].as_array().into_iter().flatten();
    let versions: BTreeSet<Option<&str>> = packages.map(|package| package["rust_version"].as_str()).collect();
    let version = match Vec::from_iter(&versions)[..] {
        [Some(version)] => version.to_string(),
        _ => return Err(Failure::new(format!("all packages need the same `rust-version`; there are {versions:?}"))),
    };
    for page in ["README.md", "docs/install.md"] {
        if !repo.read(page)?.contains(&format!("Rust is {version}")) {
            return Err(Failure::new(format!("{page} does not say that the oldest supported Rust is {version}")));
        }
    }
    Ok(version)
}

/// The version that a compiler prints: `1.95.0`, or `1.95.0-nightly`.
fn version(rustc: Cmd) -> XtaskResult<String> {
    let output = rustc.arg("--version").output()?;
    Ok(String::from_utf8_lossy(&output).split_whitespace().nth(1).unwrap_or_default().to_string())
}

/// True for the releases `1.95.0` and `1.95.1` of 1.95. A beta or nightly accepts more than the release of its number.
fn is_release_of(used: &str, version: &str) -> bool {
    let is_patch = |rest: &str| !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit());
    used == version || used.strip_prefix(version).and_then(|rest| rest.strip_prefix('.')).is_some_and(is_patch)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn releases() {
        for (used, expected) in [
            ("1.95.0", true),
            ("1.95.1", true),
            ("1.96.0", false),
            ("1.9.0", false),
            ("1.95.0-nightly", false),
            ("1.95.0-beta.3", false),
            ("1.95.0-dev", false),
            ("1.95.", false),
            ("", false),
        ] {
            assert_eq!(is_release_of(used, "1.95"), expected, "{used}");
        }
        assert!(is_release_of("1.95.1", "1.95.1") && !is_release_of("1.95.10", "1.95.1"));
    }
}
