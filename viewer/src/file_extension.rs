//! File name extensions.

use std::path::Path;

/// Returns the extension in lower case without its dot, or an empty string if the path has no extension.
pub(crate) fn lower_case(path: &Path) -> String {
    path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default()
}
