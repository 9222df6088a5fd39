//! Files that are there as a whole, or not.

use std::fs;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// The end of a name in lower case, without its dot; empty where there is none.
pub(crate) fn end_of(path: &Path) -> String {
    path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Writes a file beside its place and gives it its name when it is whole; one of that name is replaced. Where anything goes
/// wrong, what was there is there.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // Two that write the same file at once have a file each.
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}-{}.part", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed)));
    let written = fs::write(&part, bytes).and_then(|()| fs::rename(&part, path));
    if written.is_err() {
        // That it cannot be taken away changes nothing of the error that led here.
        let _ = fs::remove_file(&part);
    }
    written
}
