//! Folders that get their name when they are complete.

use crate::error::{RecordError, Result};
use crate::file::{lock_partial_file, parent_dir, partial_path_of, sync_dir};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Name of a replaced folder while it is set aside.
const REPLACED: &str = "replaced";

/// A folder that is called `NAME.part` until it is complete.
#[derive(Debug)]
pub(crate) struct PartialFolder {
    path: PathBuf,
    part: PathBuf,
    overwrite: bool,
    /// File that identifies the folder as that of a recorder.
    marker: &'static str,
}

impl PartialFolder {
    /// Creates the partial folder, and the file `marker` in it, which is locked while the recorder exists.
    ///
    /// # Errors
    /// The folder or its partial folder exists and is not empty, another recorder writes it, or it cannot be created.
    /// With `overwrite`, folders with the marker of a recorder are replaced.
    pub(crate) fn create(path: &Path, overwrite: bool, marker: &'static str) -> Result<(Self, File)> {
        // Removes a separator at the end.
        let path: PathBuf = path.components().collect();
        if path.file_name().is_none() {
            let error = io::Error::new(io::ErrorKind::InvalidInput, "the path has no folder name");
            return Err(RecordError::file(&path, error));
        }
        let part = partial_path_of(&path);
        let folder = Self { path, part, overwrite, marker };
        let Self { path, part, .. } = &folder;
        if !folder.is_available(path).map_err(|error| RecordError::file(path, error))? {
            return Err(RecordError::Exists { path: path.clone() });
        }
        let failed = |error| RecordError::file(part, error);
        let left = lock_partial_file(&part.join(marker)).map_err(|error| match error {
            RecordError::Busy { .. } => RecordError::Busy { partial_file: part.clone() },
            other => other,
        })?;
        if !folder.is_available(part).map_err(failed)? {
            return Err(RecordError::Unfinished { partial_file: part.clone(), recoverable: false });
        }
        // Some systems do not delete a folder with a locked file.
        drop(left);
        let begin = || {
            remove_dir_if_exists(part)?;
            let file = part.join(marker);
            fs::create_dir_all(file.parent().unwrap_or(part))?;
            let file = File::create_new(file)?;
            file.try_lock()?;
            Ok(file)
        };
        let file = begin().map_err(failed)?;
        Ok((folder, file))
    }

    /// Path of the folder until it is complete.
    pub(crate) fn partial_path(&self) -> &Path {
        &self.part
    }

    /// Renames the complete folder to its final name.
    pub(crate) fn commit(&self) -> io::Result<()> {
        if !self.is_available(&self.path)? {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "a folder of that name was created meanwhile"));
        }
        // A replaced folder is set aside until the new one has its name, so that one of them exists at any time.
        let aside = match self.path.symlink_metadata() {
            Ok(_) => {
                let aside = tempfile::tempdir_in(parent_dir(&self.path))?;
                fs::rename(&self.path, aside.path().join(REPLACED))?;
                Some(aside)
            }
            Err(_) => None,
        };
        if let Err(error) = fs::rename(&self.part, &self.path) {
            if let Some(aside) = aside {
                let aside = aside.keep();
                // If the old folder cannot be moved back, it stays set aside.
                fs::rename(aside.join(REPLACED), &self.path)?;
                fs::remove_dir(aside)?;
            }
            return Err(error);
        }
        sync_dir(&self.path);
        Ok(())
    }

    /// True if the folder may be created: nothing is there, or an empty folder, or a recorder's folder that may be
    /// replaced. A recorder that was killed before it created its marker left a partial folder of empty folders.
    fn is_available(&self, path: &Path) -> io::Result<bool> {
        match fs::read_dir(path) {
            Ok(mut entries) => {
                let has_marker = || self.overwrite && path.join(self.marker).is_file();
                Ok(entries.next().is_none() || has_marker() || (path == self.part && !has_file(path)?))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(true),
            Err(error) => Err(error),
        }
    }
}

/// True if a folder or one of the folders in it contains anything but folders.
pub(crate) fn has_file(folder: &Path) -> io::Result<bool> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if !entry.file_type()?.is_dir() || has_file(&entry.path())? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Removes a folder, if it exists.
fn remove_dir_if_exists(path: &Path) -> io::Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// Root cause: the old folder was deleted before the new one had its name.
    #[test]
    fn replacement() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let make = |what: &str| {
            let (part, marker) = PartialFolder::create(&path, true, "marker").unwrap();
            fs::write(part.partial_path().join("what"), what).unwrap();
            drop(marker);
            part
        };
        make("old").commit().unwrap();
        let broken = make("new");
        fs::remove_dir_all(broken.partial_path()).unwrap();
        assert_eq!(broken.commit().unwrap_err().kind(), io::ErrorKind::NotFound);
        assert_eq!(fs::read_to_string(path.join("what")).unwrap(), "old");
        // Control: the next complete folder replaces the old one, and nothing else remains.
        make("new").commit().unwrap();
        assert_eq!(fs::read_to_string(path.join("what")).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// Root cause: a recorder that was killed between the creation of its folders and of its marker left a partial folder
    /// that no later recorder took, even with the permission to overwrite.
    #[test]
    fn folders_of_a_killed_recorder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        fs::create_dir_all(partial_path_of(&path).join("meta")).unwrap();
        let (part, marker) = PartialFolder::create(&path, false, "meta/marker").unwrap();
        drop((part, marker));
        // Control: a file of an unknown program stays.
        fs::remove_file(partial_path_of(&path).join("meta/marker")).unwrap();
        fs::write(partial_path_of(&path).join("meta/other"), "precious").unwrap();
        for overwrite in [false, true] {
            let error = PartialFolder::create(&path, overwrite, "meta/marker").unwrap_err();
            assert!(matches!(error, RecordError::Unfinished { .. }), "{error}");
        }
        // Folders of the final name are not a recorder's.
        fs::create_dir_all(folder.path().join("other/inside")).unwrap();
        let error = PartialFolder::create(&folder.path().join("other"), true, "meta/marker").unwrap_err();
        assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    }
}
