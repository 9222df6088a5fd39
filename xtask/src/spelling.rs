//! Spelling of the whole tree, US English, checked by the program `typos`. Its configuration is `_typos.toml`.

use crate::python::TYPOS;
use crate::run::{Cmd, Failure, Repo, XtaskResult};

/// Reports misspelled words with file and line.
///
/// # Errors
/// A word is misspelled. In CI also: the program could not be installed; elsewhere that is a note.
pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let Some(typos) = TYPOS.obtain(repo, "the spelling")? else { return Ok(()) };
    let findings = Cmd::new(typos).args(["--format", "brief"]).current_dir(&repo.root).run();
    findings.map_err(|failure| Failure {
        message: format!(
            "{}\nThe words above are misspelled, or UK spellings. Correct them; names that are right are listed in \
             _typos.toml.",
            failure.message
        ),
        ..failure
    })
}
