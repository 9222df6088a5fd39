//! MuJoCo version of this build, and the check that the loaded library has the same version.

use mujoco_sys as mj;
use std::sync::OnceLock;

/// Supported MuJoCo versions. They differ in the MJCF that they accept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SupportedVersion {
    /// 2.2.2, as in Debian 12.
    V2,
    /// 4.x.
    V4,
}

/// MuJoCo version of the headers of this build.
#[cfg(not(mj4))]
pub const BUILD_VERSION: SupportedVersion = SupportedVersion::V2;
/// MuJoCo version of the headers of this build.
#[cfg(mj4)]
pub const BUILD_VERSION: SupportedVersion = SupportedVersion::V4;

/// The loaded library has another version than the headers.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the MuJoCo library that was loaded is version {library}, but this program was built with the headers of {headers}; \
     install libmujoco {headers}, or rebuild with MUJOCO_DIR set to the folder of the library you want"
)]
pub struct VersionError {
    /// Version of the headers.
    pub headers: String,
    /// Version that the loaded library reports.
    pub library: String,
}

/// Compares the versions of the headers and the loaded library.
///
/// If they are equal, the first call also replaces MuJoCo's error and warning handlers, so that MuJoCo writes nothing
/// to the console or a log file, and loads MuJoCo's plugins (4.x).
///
/// [`compile`](crate::compile()) and [`compile_file`](crate::compile_file) call this function first.
///
/// # Errors
/// The library has another version than the headers.
pub fn check_version() -> Result<(), VersionError> {
    static CHECKED: OnceLock<Result<(), VersionError>> = OnceLock::new();
    CHECKED
        .get_or_init(|| {
            // SAFETY: mj_version takes nothing and returns a constant.
            let library = unsafe { mj::mj_version() };
            if library != mj::mjVERSION_HEADER {
                return Err(VersionError {
                    headers: dotted_version(mj::mjVERSION_HEADER),
                    library: dotted_version(library),
                });
            }
            super::guard::install_handlers();
            super::plugins::load();
            Ok(())
        })
        .clone()
}

/// Version of the headers, for example `2.2.2`.
pub fn version_string() -> String {
    dotted_version(mj::mjVERSION_HEADER)
}

/// Dotted version of a version number. 222 is 2.2.2; since 3.5 it is major * 10^6 + minor * 10^3 + patch.
fn dotted_version(version: i32) -> String {
    if version < 1000 {
        format!("{}.{}.{}", version / 100, version / 10 % 10, version % 10)
    } else {
        format!("{}.{}.{}", version / 1_000_000, version / 1000 % 1000, version % 1000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_formats() {
        assert_eq!(dotted_version(222), "2.2.2");
        assert_eq!(dotted_version(340), "3.4.0");
        assert_eq!(dotted_version(4_000_001), "4.0.1");
    }
}
