//! Extensions of file names.

use std::path::Path;

/// Returns the extension in lower case, without its dot; empty without one.
pub(crate) fn lower_case(path: &Path) -> String {
    path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default()
}
