//! Files that have their name when they are whole, not before.

use crate::error::{RecordError, Result};
use kinetoscope_scene::AtomicFile;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a file is written to.
pub(crate) trait Storage: Write + Seek + Send {
    /// Brings what was written to the disk.
    fn sync(&self) -> io::Result<()>;
}

impl Storage for File {
    fn sync(&self) -> io::Result<()> {
        self.sync_all()
    }
}

/// What files are written through.
type Through = dyn Fn(File) -> Box<dyn Storage> + Send + Sync;

/// Where the files of a recording are: tests put something between them and the disk.
#[derive(Clone, Default)]
pub(crate) struct Disk(Option<Arc<Through>>);

impl std::fmt::Debug for Disk {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Disk")
    }
}

impl Disk {
    /// What a file is written to.
    pub(crate) fn storage(&self, file: File) -> Box<dyn Storage> {
        match &self.0 {
            Some(through) => through(file),
            None => Box::new(file),
        }
    }
}

/// A file on its way: called `NAME.part` until it is whole. Dropped before, it is taken away, unless somebody can read what
/// there is of it.
#[derive(Debug)]
pub(crate) struct PartFile {
    /// Locked as long as it is written, so that no other recorder takes it for one that was left.
    file: AtomicFile,
    overwrite: bool,
}

impl PartFile {
    /// Begins a file; `recoverable`: whether [`recover`](crate::recover) makes something of it where it was left.
    ///
    /// # Errors
    /// There is a file of that name, or what an earlier recording has left, and neither may be replaced; another recorder
    /// writes it; or the folder does not let anybody write.
    pub(crate) fn create(path: &Path, overwrite: bool, recoverable: bool) -> Result<(Self, File)> {
        let part = part_of(path);
        if let Some(left) = lock_left(&part)? {
            // In what is empty nothing is lost: so archives and animations are before they are finished.
            if !overwrite && left.metadata().is_ok_and(|left| left.len() > 0) {
                return Err(RecordError::Unfinished { part, recoverable });
            }
            remove(&part)?;
        }
        Self::create_as(path, part, overwrite)
    }

    /// As [`create`](Self::create), called `part` on the way, of which there is none.
    pub(crate) fn create_as(path: &Path, part: PathBuf, overwrite: bool) -> Result<(Self, File)> {
        if !overwrite && path.symlink_metadata().is_ok() {
            return Err(RecordError::Exists { path: path.into() });
        }
        if path.is_dir() {
            let error = io::Error::new(io::ErrorKind::IsADirectory, "this is a folder, and no file replaces it");
            return Err(RecordError::file(path, error));
        }
        let begin = || {
            let mut file = AtomicFile::create_as(path, part.clone())?;
            // If another recorder was faster, the file is its own.
            file.file().try_lock().inspect_err(|_| file.keep())?;
            Ok((file.file().try_clone()?, file))
        };
        let (file, mine) = begin().map_err(|error: io::Error| RecordError::file(&part, error))?;
        Ok((Self { file: mine, overwrite }, file))
    }

    /// What was written can be read, whole or not: it stays.
    pub(crate) fn keep(&mut self) {
        self.file.keep();
    }

    /// Gives the file its name: it is whole. Gives its size \[bytes\].
    pub(crate) fn commit(&mut self) -> io::Result<u64> {
        self.file.file().sync_all()?;
        self.file.keep();
        let bytes = self.file.file().metadata()?.len();
        if self.overwrite {
            self.file.persist()?;
        } else {
            self.file.persist_noclobber()?;
        }
        sync_folder(self.file.path());
        Ok(bytes)
    }

    /// What the file is to be called.
    pub(crate) fn path(&self) -> &Path {
        self.file.path()
    }

    /// What it is called until then.
    #[cfg(feature = "hdf5")]
    pub(crate) fn part(&self) -> &Path {
        self.file.part()
    }

    /// What was written, where it stays.
    pub(crate) fn kept(&self) -> Option<PathBuf> {
        self.file.is_kept().then(|| self.file.part().into())
    }
}

/// The file that an earlier recording has left, locked; `None` where there is none.
///
/// # Errors
/// A recorder writes it now, or it cannot be opened.
pub(crate) fn lock_left(part: &Path) -> Result<Option<File>> {
    let left = match OpenOptions::new().read(true).write(true).open(part) {
        Ok(left) => left,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(RecordError::file(part, error)),
    };
    match left.try_lock() {
        Ok(()) => Ok(Some(left)),
        Err(TryLockError::WouldBlock) => Err(RecordError::Busy { part: part.into() }),
        Err(TryLockError::Error(error)) => Err(RecordError::file(part, error)),
    }
}

/// Takes a file away, which may be gone already.
pub(crate) fn remove(file: &Path) -> Result<()> {
    match fs::remove_file(file) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(RecordError::file(file, error)),
        _ => Ok(()),
    }
}

/// Brings the name of a file to the disk, where that can be asked for.
pub(crate) fn sync_folder(file: &Path) {
    // The file is whole and has its name: that a crash of the machine may still undo the name is no error of it.
    let _ = File::open(folder_of(file)).and_then(|folder| folder.sync_all());
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
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
pub(crate) mod tests {
    use super::*;
    use std::io::SeekFrom;
    use std::sync::Mutex;

    /// A file on a disk that is full after some bytes, of all its files together.
    #[derive(Debug)]
    struct OnFullDisk {
        file: File,
        left: Arc<Mutex<usize>>,
    }

    impl Disk {
        /// One that takes so many bytes, of all its files together.
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
        let (mut part, mut file) = PartFile::create(&path, false, false).unwrap();
        file.write_all(b"whole").unwrap();
        fs::write(&path, "precious").unwrap();
        assert_eq!(part.commit().unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        let kept = part.kept().unwrap();
        drop(part);
        assert_eq!((fs::read(&path).unwrap(), fs::read(&kept).unwrap()), (b"precious".to_vec(), b"whole".to_vec()));
        drop(file);
        // It is not written over, and what to do is said: there is no way to recover it.
        fs::remove_file(&path).unwrap();
        let error = PartFile::create(&path, false, false).unwrap_err().to_string();
        assert!(error.contains("run.npz.part") && !error.contains("recover"), "{error}");
        // The control: with its name free, it has it.
        fs::remove_file(kept).unwrap();
        let (mut part, mut file) = PartFile::create(&path, false, false).unwrap();
        file.write_all(b"whole").unwrap();
        assert_eq!((part.commit().unwrap(), fs::read(&path).unwrap()), (5, b"whole".to_vec()));
        assert!(!part_of(&path).exists());
    }
}
