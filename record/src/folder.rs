//! Folders that have their name when they are whole, not before.

use crate::error::{RecordError, Result};
use crate::file::{folder_of, lock_left, part_of, sync_folder};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// What a folder is called that is put aside.
const REPLACED: &str = "replaced";

/// A folder on its way: called `NAME.part` until it is whole.
#[derive(Debug)]
pub(crate) struct PartFolder {
    path: PathBuf,
    part: PathBuf,
    overwrite: bool,
    /// The file that says that it is a recorder's.
    marker: &'static str,
}

impl PartFolder {
    /// Makes the folder, which must be new or empty, or may be replaced: only a folder of a recorder is, which has the file
    /// `marker`. Gives that file, which is locked as long as there is a recorder.
    pub(crate) fn create(path: &Path, overwrite: bool, marker: &'static str) -> Result<(Self, File)> {
        // Without a separator at the end.
        let path: PathBuf = path.components().collect();
        if path.file_name().is_none() {
            let error = io::Error::new(io::ErrorKind::InvalidInput, "a folder needs a name of its own");
            return Err(RecordError::file(&path, error));
        }
        let part = part_of(&path);
        let folder = Self { path, part, overwrite, marker };
        let Self { path, part, .. } = &folder;
        if !folder.is_free(path).map_err(|error| RecordError::file(path, error))? {
            return Err(RecordError::Exists { path: path.clone() });
        }
        let failed = |error| RecordError::file(part, error);
        let left = lock_left(&part.join(marker)).map_err(|error| match error {
            RecordError::Busy { .. } => RecordError::Busy { part: part.clone() },
            other => other,
        })?;
        if !folder.is_free(part).map_err(failed)? {
            return Err(RecordError::Unfinished { part: part.clone(), recoverable: false });
        }
        // Its lock would keep the folder on some systems.
        drop(left);
        let begin = || {
            take_away(part)?;
            let file = part.join(marker);
            fs::create_dir_all(file.parent().unwrap_or(part))?;
            let file = File::create_new(file)?;
            file.try_lock()?;
            Ok(file)
        };
        let file = begin().map_err(failed)?;
        Ok((folder, file))
    }

    /// Where it is until it is whole.
    pub(crate) fn part(&self) -> &Path {
        &self.part
    }

    /// Gives it its name: it is whole.
    pub(crate) fn commit(&self) -> io::Result<()> {
        if !self.is_free(&self.path)? {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "a folder of that name has appeared meanwhile"));
        }
        // What is replaced is put aside until the new one has its name: whatever happens meanwhile, one of them is there.
        let aside = match self.path.symlink_metadata() {
            Ok(_) => {
                let aside = tempfile::tempdir_in(folder_of(&self.path))?;
                fs::rename(&self.path, aside.path().join(REPLACED))?;
                Some(aside)
            }
            Err(_) => None,
        };
        if let Err(error) = fs::rename(&self.part, &self.path) {
            if let Some(aside) = aside {
                let aside = aside.keep();
                // Where it cannot go back, it stays where it is.
                fs::rename(aside.join(REPLACED), &self.path)?;
                fs::remove_dir(aside)?;
            }
            return Err(error);
        }
        sync_folder(&self.path);
        Ok(())
    }

    /// Whether a folder may be made at a place: nothing is there, or an empty folder, or one of a recorder that may be replaced.
    fn is_free(&self, path: &Path) -> io::Result<bool> {
        match fs::read_dir(path) {
            Ok(mut entries) => Ok(entries.next().is_none() || (self.overwrite && path.join(self.marker).is_file())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(true),
            Err(error) => Err(error),
        }
    }
}

/// Takes away a folder that is free.
fn take_away(path: &Path) -> io::Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// Root cause: what was to be replaced was deleted before the new one had its name.
    #[test]
    fn replacement() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let make = |what: &str| {
            let (part, marker) = PartFolder::create(&path, true, "marker").unwrap();
            fs::write(part.part().join("what"), what).unwrap();
            drop(marker);
            part
        };
        make("old").commit().unwrap();
        let broken = make("new");
        fs::remove_dir_all(broken.part()).unwrap();
        assert_eq!(broken.commit().unwrap_err().kind(), io::ErrorKind::NotFound);
        assert_eq!(fs::read_to_string(path.join("what")).unwrap(), "old");
        // The control: with a new one, it is replaced, and nothing else is left.
        make("new").commit().unwrap();
        assert_eq!(fs::read_to_string(path.join("what")).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
