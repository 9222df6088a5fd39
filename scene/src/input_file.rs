//! Reading of input files with a bound on their size.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Largest text file \[bytes\]: a scene, a robot, a calibration, a material library. These hold no meshes or images; a
/// larger file is a wrong file or an endless device.
pub const MAX_TEXT: u64 = 256 << 20;

/// Largest mesh, image or binary buffer \[bytes\].
pub const MAX_BINARY: u64 = 4 << 30;

/// Reads a file that the user names. Pipes are read too, so that the output of another program can be given.
///
/// # Errors
/// The file cannot be read, or is longer than `limit` \[bytes\], as a device such as `/dev/zero` is.
pub fn read_named(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let file = File::open(path)?;
    let mut bytes = Vec::new();
    // The size of a pipe or a device is 0. A byte more, so that the end is found without growing.
    let expected = usize::try_from(file.metadata()?.len().min(limit)).unwrap_or(usize::MAX);
    bytes.try_reserve_exact(expected.saturating_add(1))?;
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("longer than {limit} bytes")));
    }
    Ok(bytes)
}

/// Reads text, as [`read_named`] reads bytes.
///
/// # Errors
/// As [`read_named`], or the file is not UTF-8.
pub fn read_named_text(path: &Path) -> Result<String> {
    utf8(read_named(path, MAX_TEXT)?)
}

fn utf8(bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let line = 1 + error.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count();
        Error::new(ErrorKind::InvalidData, format!("line {line} is not UTF-8"))
    })
}

/// Reads a file that another file refers to. Such a reference must not wait for a pipe, or read a device.
///
/// # Errors
/// As [`read_named`], or the path is no regular file.
pub fn read_referenced(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() {
        let kind = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(Error::new(ErrorKind::InvalidInput, format!("{kind}; expected a regular file")));
    }
    read_named(path, limit)
}

/// Reads text, as [`read_referenced`] reads bytes.
///
/// # Errors
/// As [`read_referenced`], or the file is not UTF-8.
pub fn read_referenced_text(path: &Path) -> Result<String> {
    utf8(read_referenced(path, MAX_TEXT)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn limits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, b"four").unwrap();
        for read in [read_named, read_referenced] {
            assert_eq!(read(&path, 4).unwrap(), b"four");
            let error = read(&path, 3).unwrap_err();
            assert_eq!((error.kind(), error.to_string().as_str()), (ErrorKind::FileTooLarge, "longer than 3 bytes"));
            assert_eq!(read(&folder.path().join("none"), 4).unwrap_err().kind(), ErrorKind::NotFound);
        }
        fs::write(&path, b"first\n\xff").unwrap();
        assert_eq!(read_named_text(&path).unwrap_err().to_string(), "line 2 is not UTF-8");
    }

    #[cfg(unix)]
    #[test]
    fn special_files() {
        let endless = Path::new("/dev/zero");
        assert_eq!(read_named(endless, 1000).unwrap_err().kind(), ErrorKind::FileTooLarge);
        let error = read_referenced(endless, 1000).unwrap_err();
        assert_eq!(error.to_string(), "a device or a pipe; expected a regular file");
        let error = read_referenced(Path::new("/"), 1000).unwrap_err();
        assert_eq!(error.to_string(), "a folder; expected a regular file");
        // A pipe without a writer: opening it would wait.
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert!(read_referenced(&pipe, 1000).is_err());
    }
}
