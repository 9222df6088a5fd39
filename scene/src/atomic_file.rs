//! Atomic files: a file gets its name when it is complete.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// A file that is written under a temporary name in its folder and renamed when it is complete.
///
/// A process that stops early leaves the previous file in place. Call `sync_all` on [`file`](Self::file) if the content
/// must be on the disk before the renaming.
///
/// Dropping this value before [`persist`](Self::persist) or [`persist_noclobber`](Self::persist_noclobber) deletes the
/// temporary file, unless [`keep`](Self::keep) was called.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    temp_path: PathBuf,
    file: File,
    keep: bool,
}

impl AtomicFile {
    /// Creates a temporary file beside `path` with a unique name, so that concurrent writers of one path do not
    /// interfere. The folder must exist.
    ///
    /// # Errors
    /// The temporary file cannot be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        loop {
            let mut part = path.as_os_str().to_owned();
            part.push(format!(".{}-{}.part", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed)));
            match Self::create_as(path, part.into()) {
                // Left by a killed process with the same process id.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                created => return created,
            }
        }
    }

    /// Creates a temporary file at `temp_path`, which must be in the folder of `path`.
    ///
    /// # Errors
    /// The temporary file cannot be created, or exists already.
    pub fn create_as(path: &Path, temp_path: PathBuf) -> io::Result<Self> {
        let file = File::create_new(&temp_path)?;
        Ok(Self { path: path.into(), temp_path, file, keep: false })
    }

    /// Writes a complete file and replaces a previous file at `path`. The folder must exist.
    ///
    /// # Errors
    /// The file cannot be written. A previous file at `path` stays.
    pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut file = Self::create(path)?;
        file.file.write_all(bytes)?;
        file.persist()
    }

    /// The temporary file, open for writing.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Path of the complete file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the temporary file.
    pub fn temp_path(&self) -> &Path {
        &self.temp_path
    }

    /// Keeps the temporary file on the disk when this value is dropped.
    pub fn keep(&mut self) {
        self.keep = true;
    }

    /// True after [`keep`](Self::keep), and after [`persist`](Self::persist) or
    /// [`persist_noclobber`](Self::persist_noclobber) without an error.
    pub fn is_kept(&self) -> bool {
        self.keep
    }

    /// Renames the temporary file to its final path and replaces a previous file.
    ///
    /// # Errors
    /// The file cannot be renamed.
    pub fn persist(&mut self) -> io::Result<()> {
        fs::rename(&self.temp_path, &self.path)?;
        self.keep = true;
        Ok(())
    }

    /// Renames the temporary file to its final path, which must be free. On a file system without hard links, a file
    /// that appears there at the same moment may be replaced.
    ///
    /// # Errors
    /// The path is taken, or the file cannot be renamed.
    pub fn persist_noclobber(&mut self) -> io::Result<()> {
        let exists = || io::Error::new(io::ErrorKind::AlreadyExists, "a file of that name was created in the meantime");
        match fs::hard_link(&self.temp_path, &self.path) {
            Ok(()) => fs::remove_file(&self.temp_path)?,
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Err(exists()),
            // A file system without hard links: a file may still appear between this check and the renaming.
            Err(_) if self.path.symlink_metadata().is_ok() => return Err(exists()),
            Err(_) => fs::rename(&self.temp_path, &self.path)?,
        }
        self.keep = true;
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.keep {
            // The error that led here matters more than an error of this deletion.
            let _ = fs::remove_file(&self.temp_path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn replacement() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        AtomicFile::write(&path, b"old").unwrap();
        // Two concurrent writers, one of which gives up.
        let mut first = AtomicFile::create(&path).unwrap();
        let second = AtomicFile::create(&path).unwrap();
        first.file().write_all(b"new").unwrap();
        second.file().write_all(b"half").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        first.persist().unwrap();
        drop((first, second));
        assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"new".to_vec(), vec!["state".to_owned()]));
    }

    #[test]
    fn failures() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing/state");
        assert_eq!(AtomicFile::write(&missing, b"new").unwrap_err().kind(), io::ErrorKind::NotFound);
        // A folder that is not empty is not replaced by a file.
        let path = folder.path().join("folder");
        fs::create_dir_all(path.join("inside")).unwrap();
        AtomicFile::write(&path, b"new").unwrap_err();
        assert_eq!(names(folder.path()), ["folder"]);
    }

    #[test]
    fn kept_part() {
        let folder = tempfile::tempdir().unwrap();
        let (path, part) = (folder.path().join("state"), folder.path().join("state.part"));
        let mut file = AtomicFile::create_as(&path, part.clone()).unwrap();
        file.keep();
        drop(file);
        assert_eq!(names(folder.path()), ["state.part"]);
        assert_eq!(AtomicFile::create_as(&path, part).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
    }
}
