//! What can be wrong with a snapshot.

use std::path::PathBuf;

/// A snapshot cannot be read, or does not belong where it is put.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SnapshotError {
    /// The file is something else.
    #[error("{path}: not a snapshot; snapshots are files that Snapshot::save wrote")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The file ends too early.
    #[error("{path}: the file ends after {bytes} bytes of {expected}; it was not copied as a whole")]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Its length \[bytes\].
        bytes: u64,
        /// The length it should have \[bytes\].
        expected: u64,
    },
    /// The checksum or the length is not that of the content.
    #[error("{path}: the file is damaged: its content is not what was saved")]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// The file is in a format of another version of this program.
    #[error("{path}: a snapshot in format {found}; this program reads format {supported}")]
    Format {
        /// The file.
        path: PathBuf,
        /// The format of the file.
        found: u32,
        /// The format of this program.
        supported: u32,
    },
    /// The file was saved by a program with another MuJoCo, which would go on with other bits.
    #[error("{path}: saved with MuJoCo {found}; this program runs MuJoCo {running}, which would go on differently")]
    Mujoco {
        /// The file.
        path: PathBuf,
        /// The version of the program that saved it.
        found: String,
        /// The version of this program.
        running: String,
    },
    /// The checksum is right, but what is in the file is not a snapshot: another program wrote it.
    #[error("{path}: {what}, though the checksum is right: not written by Snapshot::save")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: &'static str,
    },
    /// The snapshot is of another scene.
    #[error("the snapshot is of another scene: {difference}; build the scene as it was when the snapshot was taken")]
    OtherScene {
        /// The first thing that differs.
        difference: String,
    },
    /// The snapshot has another number of environments than are to be restored.
    #[error("the snapshot holds {held} environments, and {wanted} are to be restored; take as many, or one for all")]
    Count {
        /// Number of environments in the snapshot.
        held: usize,
        /// Number of environments to restore.
        wanted: usize,
    },
}
