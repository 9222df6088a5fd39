//! Files that get their name when they are complete.

use crate::error::{RecordError, Result};
use kinetoscope_scene::AtomicFile;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Destination of written data.
pub(crate) trait Storage: Write + Seek + Send {
    /// Flushes the data to the disk.
    fn sync(&self) -> io::Result<()>;
}

impl Storage for File {
    fn sync(&self) -> io::Result<()> {
        self.sync_all()
    }
}

/// A wrapper of files.
type WrapFile = dyn Fn(File) -> Box<dyn Storage> + Send + Sync;

/// Storage of the files of a recording. Tests insert a wrapper that simulates a full disk.
#[derive(Clone, Default)]
pub(crate) struct StorageFactory(Option<Arc<WrapFile>>);

impl std::fmt::Debug for StorageFactory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Disk")
    }
}

impl StorageFactory {
    /// Wraps a file.
    pub(crate) fn storage(&self, file: File) -> Box<dyn Storage> {
        match &self.0 {
            Some(through) => through(file),
            None => Box::new(file),
        }
    }
}

/// A file that is called `NAME.part` until it is complete. If it is dropped earlier, the partial file is deleted,
/// unless its content is readable or only the renaming failed.
#[derive(Debug)]
pub(crate) struct PartialFile {
    /// Locked while it is written, so that other recorders do not take it for a remainder.
    file: AtomicFile,
    overwrite: bool,
}

impl PartialFile {
    /// Creates the partial file. `recoverable` is true if [`recover`](crate::recover) can restore it after a kill.
    ///
    /// # Errors
    /// A file of that name or a partial file of an earlier recording exists and may not be replaced, another recorder
    /// writes it, or the folder is not writable.
    pub(crate) fn create(path: &Path, overwrite: bool, recoverable: bool) -> Result<(Self, File)> {
        let partial_file = partial_path_of(path);
        if let Some(left) = lock_partial_file(&partial_file)? {
            // An empty file has nothing to lose. Archives and animations are empty until they are finished.
            if !overwrite && left.metadata().is_ok_and(|left| left.len() > 0) {
                return Err(RecordError::Unfinished { partial_file, recoverable });
            }
            remove_file_if_exists(&partial_file)?;
        }
        Self::create_as(path, partial_file, overwrite)
    }

    /// Creates the file as [`create`](Self::create) does, with the temporary name `part`, which must not exist.
    pub(crate) fn create_as(path: &Path, part: PathBuf, overwrite: bool) -> Result<(Self, File)> {
        if !overwrite && path.symlink_metadata().is_ok() {
            return Err(RecordError::Exists { path: path.into() });
        }
        if path.is_dir() {
            let error = io::Error::new(io::ErrorKind::IsADirectory, "this is a folder; a file cannot replace it");
            return Err(RecordError::file(path, error));
        }
        let begin = || {
            let mut file = AtomicFile::create_as(path, part.clone())?;
            // If another recorder has locked the file first, it owns the file.
            file.file().try_lock().inspect_err(|_| file.keep())?;
            Ok((file.file().try_clone()?, file))
        };
        let (file, mine) = begin().map_err(|error: io::Error| RecordError::file(&part, error))?;
        Ok((Self { file: mine, overwrite }, file))
    }

    /// Keeps the partial file when this is dropped, because its content is readable.
    pub(crate) fn keep(&mut self) {
        self.file.keep();
    }

    /// Gives the complete file its final name; returns its size \[bytes\].
    pub(crate) fn commit(&mut self) -> io::Result<u64> {
        self.file.file().sync_all()?;
        self.file.keep();
        let bytes = self.file.file().metadata()?.len();
        if self.overwrite {
            self.file.persist()?;
        } else {
            self.file.persist_noclobber()?;
        }
        sync_dir(self.file.path());
        Ok(bytes)
    }

    /// Final path of the file.
    pub(crate) fn path(&self) -> &Path {
        self.file.path()
    }

    /// Path of the partial file, if it remains.
    pub(crate) fn kept_path(&self) -> Option<PathBuf> {
        self.file.is_kept().then(|| self.file.temp_path().into())
    }
}

/// Opens and locks the partial file of an earlier recording; `None` if there is no such file.
///
/// # Errors
/// Another recorder writes it, or it cannot be opened.
pub(crate) fn lock_partial_file(part: &Path) -> Result<Option<File>> {
    let left = match OpenOptions::new().read(true).write(true).open(part) {
        Ok(left) => left,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(RecordError::file(part, error)),
    };
    match left.try_lock() {
        Ok(()) => Ok(Some(left)),
        Err(TryLockError::WouldBlock) => Err(RecordError::Busy { partial_file: part.into() }),
        Err(TryLockError::Error(error)) => Err(RecordError::file(part, error)),
    }
}

/// Deletes a file, if it exists.
pub(crate) fn remove_file_if_exists(file: &Path) -> Result<()> {
    match fs::remove_file(file) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(RecordError::file(file, error)),
        _ => Ok(()),
    }
}

/// Flushes the name of a file to the disk, where the system supports it.
pub(crate) fn sync_dir(file: &Path) {
    // The file is complete and has its name. A crash of the machine may undo the name, which is no error of the file.
    let _ = File::open(parent_dir(file)).and_then(|folder| folder.sync_all());
}

/// Path of the partial file.
pub(crate) fn partial_path_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

/// Folder of a file.
pub(crate) fn parent_dir(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
pub(crate) mod tests {
    use super::*;
    use std::io::SeekFrom;
    use std::sync::Mutex;

    /// A file whose writes are counted with those of all files of the disk, and fail from one of them on.
    #[derive(Debug)]
    struct FailingFile {
        file: File,
        writes: Arc<Mutex<usize>>,
        first_failure: usize,
        kind: io::ErrorKind,
    }

    impl Storage for FailingFile {
        fn sync(&self) -> io::Result<()> {
            self.file.sync_all()
        }
    }

    impl Write for FailingFile {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut writes = self.writes.lock().unwrap();
            *writes += 1;
            if *writes > self.first_failure {
                return Err(io::Error::new(self.kind, "a failure on purpose"));
            }
            self.file.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    impl Seek for FailingFile {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.file.seek(to)
        }
    }

    /// A file on a disk that is full after a number of bytes, which all its files share.
    #[derive(Debug)]
    struct OnFullDisk {
        file: File,
        left: Arc<Mutex<usize>>,
    }

    impl StorageFactory {
        /// A disk whose writes fail after `first_failure` of them, and the number of writes so far.
        pub(crate) fn failing_after(first_failure: usize, kind: io::ErrorKind) -> (Self, Arc<Mutex<usize>>) {
            let writes = Arc::new(Mutex::new(0));
            let shared = Arc::clone(&writes);
            let wrap = move |file| {
                let writes = Arc::clone(&shared);
                Box::new(FailingFile { file, writes, first_failure, kind }) as Box<dyn Storage>
            };
            (Self(Some(Arc::new(wrap))), writes)
        }

        /// A disk with room for a number of bytes, which all its files share.
        pub(crate) fn full_after(bytes: usize) -> Self {
            let left = Arc::new(Mutex::new(bytes));
            Self(Some(Arc::new(move |file| Box::new(OnFullDisk { file, left: Arc::clone(&left) }))))
        }
    }

    impl Storage for OnFullDisk {
        fn sync(&self) -> io::Result<()> {
            self.file.sync_all()
        }
    }

    impl Write for OnFullDisk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut left = self.left.lock().unwrap();
            if *left == 0 && !bytes.is_empty() {
                return Err(io::Error::new(io::ErrorKind::StorageFull, "no space left on this disk"));
            }
            let done = self.file.write(&bytes[..bytes.len().min(*left)])?;
            *left -= done;
            Ok(done)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    impl Seek for OnFullDisk {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.file.seek(to)
        }
    }

    #[test]
    fn taken_name() {
        let (_folder, path) = crate::tests::scratch("run.npz");
        let (mut part, mut file) = PartialFile::create(&path, false, false).unwrap();
        file.write_all(b"whole").unwrap();
        fs::write(&path, "precious").unwrap();
        assert_eq!(part.commit().unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        let kept = part.kept_path().unwrap();
        drop(part);
        assert_eq!((fs::read(&path).unwrap(), fs::read(&kept).unwrap()), (b"precious".to_vec(), b"whole".to_vec()));
        drop(file);
        // The partial file is not overwritten. The message does not suggest `recover`, which cannot help here.
        fs::remove_file(&path).unwrap();
        let error = PartialFile::create(&path, false, false).unwrap_err().to_string();
        assert!(error.contains("run.npz.part") && !error.contains("recover"), "{error}");
        // Control: with the name free again, the file gets it.
        fs::remove_file(kept).unwrap();
        let (mut part, mut file) = PartialFile::create(&path, false, false).unwrap();
        file.write_all(b"whole").unwrap();
        assert_eq!((part.commit().unwrap(), fs::read(&path).unwrap()), (5, b"whole".to_vec()));
        assert!(!partial_path_of(&path).exists());
    }
}
