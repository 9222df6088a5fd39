//! Files that have their name when they are whole, not before.

use crate::error::{RecordError, Result};
use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

/// What a file is written to.
pub(crate) trait Storage: Write + Seek + Send {}

impl<S: Write + Seek + Send> Storage for S {}

/// A file on its way: called `NAME.part` until it is whole.
#[derive(Debug)]
pub(crate) struct PartFile {
    path: PathBuf,
    part: PathBuf,
    overwrite: bool,
}

impl PartFile {
    /// Begins a file.
    ///
    /// # Errors
    /// There is a file of that name, or what an earlier recording has left, and neither may be replaced; or the folder does not
    /// let anybody write.
    pub(crate) fn create(path: &Path, overwrite: bool) -> Result<(Self, File)> {
        let part = part_of(path);
        if !overwrite && part.symlink_metadata().is_ok() {
            return Err(RecordError::Unfinished { part });
        }
        Self::create_as(path, part, overwrite)
    }

    /// As [`create`](Self::create), called `part` on the way, which is replaced if it is there.
    pub(crate) fn create_as(path: &Path, part: PathBuf, overwrite: bool) -> Result<(Self, File)> {
        if !overwrite && path.symlink_metadata().is_ok() {
            return Err(RecordError::Exists { path: path.into() });
        }
        let file = File::create(&part).map_err(|error| RecordError::file(&part, error))?;
        Ok((Self { path: path.into(), part, overwrite }, file))
    }

    /// Gives the file its name: it is whole. Gives its size \[bytes\].
    pub(crate) fn commit(&self) -> io::Result<u64> {
        if !self.overwrite && self.path.symlink_metadata().is_ok() {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "a file of that name has appeared meanwhile"));
        }
        fs::rename(&self.part, &self.path)?;
        Ok(self.path.metadata()?.len())
    }

    /// What was written so far.
    pub(crate) fn part(&self) -> &Path {
        &self.part
    }

    /// Takes away what was written: nobody could read it.
    pub(crate) fn discard(&self) {
        // It may be gone already; that it cannot be taken away changes nothing of the error that led here.
        let _ = fs::remove_file(&self.part);
    }
}

/// What a file is called until it is whole.
pub(crate) fn part_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

/// The folder of a file.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::io::SeekFrom;

    /// A disk that is full after some bytes.
    #[derive(Debug)]
    pub(crate) struct FullDisk {
        pub(crate) file: File,
        pub(crate) left: usize,
    }

    impl Write for FullDisk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.left == 0 {
                return Err(io::Error::new(io::ErrorKind::StorageFull, "no space left on this disk"));
            }
            let done = self.file.write(&bytes[..bytes.len().min(self.left)])?;
            self.left -= done;
            Ok(done)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    impl Seek for FullDisk {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.file.seek(to)
        }
    }
}
