//! Errors of snapshots.

use std::path::PathBuf;

/// Error of reading or restoring a snapshot.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SnapshotError {
    /// The file is not a snapshot.
    #[error("{path}: not a snapshot file written by Snapshot::save")]
    NotASnapshot {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file ends too early.
    #[error("{path}: the file is truncated: {bytes} of {expected} bytes")]
    Truncated {
        /// Path of the file.
        path: PathBuf,
        /// Length of the file \[bytes\].
        bytes: u64,
        /// Expected length \[bytes\].
        expected: u64,
    },
    /// The checksum or the length does not match the content.
    #[error("{path}: the file is damaged: its checksum does not match")]
    Damaged {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file has the format of another version of this program.
    #[error("{path}: a snapshot in format {found}; this program reads format {supported}")]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Format of the file.
        found: u32,
        /// Format of this program.
        supported: u32,
    },
    /// The file was saved with another MuJoCo version, which would continue with other bits.
    #[error(
        "{path}: saved with MuJoCo {found}, but this program runs MuJoCo {running}, which would continue differently"
    )]
    MujocoVersion {
        /// Path of the file.
        path: PathBuf,
        /// MuJoCo version of the file.
        found: String,
        /// MuJoCo version of this program.
        running: String,
    },
    /// The checksum is right, but the content is not a snapshot: another program wrote it.
    #[error("{path}: {what}, although the checksum matches: the file was not written by Snapshot::save")]
    Malformed {
        /// Path of the file.
        path: PathBuf,
        /// Description of the problem.
        what: &'static str,
    },
    /// The snapshot belongs to another scene.
    #[error("the snapshot is of another scene: {difference}; build the scene as it was when the snapshot was taken")]
    OtherScene {
        /// First difference.
        difference: String,
    },
    /// The snapshot has another number of environments than the number to restore.
    #[error(
        "the snapshot holds {saved} environments, but {requested} are to be restored; use a snapshot of {requested} \
         environments, or of a single one for all"
    )]
    EnvCount {
        /// Number of environments in the snapshot.
        saved: usize,
        /// Number of environments to restore.
        requested: usize,
    },
}
