//! Check that CI tests the oldest supported Rust, which is `rust-version` in `Cargo.toml`.

use crate::run::{Cmd, Failure, Repo, XtaskResult, in_ci};
use crate::setup::Prepared;

/// Succeeds if all other stages run with the oldest supported Rust. With a newer one, compiles the workspace with the
/// oldest one, if rustup has it.
///
/// # Errors
/// The Rust in use is older, or the workspace does not compile with the oldest supported one. In CI also: neither tests
/// the oldest one; elsewhere this is a note.
pub(crate) fn run(repo: &Repo, ready: &Prepared) -> XtaskResult {
    let oldest = oldest(repo)?;
    let output = Cmd::new("rustc").arg("--version").current_dir(&repo.root).output()?;
    let output = String::from_utf8_lossy(&output).into_owned();
    let used = output.split_whitespace().nth(1).unwrap_or_default();
    if is_release_of(used, &oldest) {
        println!("all stages run with Rust {used}, the oldest supported one");
        return Ok(());
    }
    let with_oldest = || ready.program("rustup").args(["run", &oldest, "cargo"]).current_dir(&repo.root);
    if with_oldest().arg("--version").quiet().succeeds() {
        let folder = repo.target.join("msrv");
        let check = with_oldest().env("CARGO_TARGET_DIR", folder);
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
    let mut versions = packages.filter_map(|package| package["rust_version"].as_str());
    let version = versions.next().ok_or_else(|| Failure::new("Cargo.toml has no `rust-version`"))?.to_string();
    for page in ["README.md", "docs/install.md"] {
        if !repo.read(page)?.contains(&format!("Rust is {version}")) {
            return Err(Failure::new(format!("{page} does not say that the oldest supported Rust is {version}")));
        }
    }
    Ok(version)
}

/// True for `1.95.0` and `1.95`.
fn is_release_of(used: &str, version: &str) -> bool {
    used == version || used.strip_prefix(version).is_some_and(|rest| rest.starts_with('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn releases() {
        for (used, expected) in [("1.95.0", true), ("1.95.1", true), ("1.96.0", false), ("1.9.0", false), ("", false)] {
            assert_eq!(is_release_of(used, "1.95"), expected, "{used}");
        }
        assert!(is_release_of("1.95.1", "1.95.1") && !is_release_of("1.95.10", "1.95.1"));
    }
}
