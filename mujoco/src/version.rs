//! Which MuJoCo this build is for, and whether the library that was loaded is that one.

use mujoco_sys as mj;
use std::sync::OnceLock;

/// The two supported lines of MuJoCo: they differ in the MJCF they accept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// 2.2.2, Debian 12.
    V2,
    /// 4.x.
    V4,
}

/// The line whose headers this build was made with.
#[cfg(not(mj4))]
pub const TARGET: Target = Target::V2;
/// The line whose headers this build was made with.
#[cfg(mj4)]
pub const TARGET: Target = Target::V4;

/// The library that was loaded is not of the version of the headers.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the MuJoCo library that was loaded is version {library}, but this program was built with the headers of {headers}; \
     install libmujoco {headers}, or rebuild with MUJOCO_DIR set to the folder of the library you want"
)]
pub struct VersionError {
    /// Version of the headers.
    pub headers: String,
    /// Version the library reports.
    pub library: String,
}

/// Compares header and library version and silences MuJoCo's console and log file. Every other entry calls it first.
///
/// # Errors
/// The library is not of the version of the headers.
pub fn check_version() -> Result<(), VersionError> {
    static CHECKED: OnceLock<Result<(), VersionError>> = OnceLock::new();
    CHECKED
        .get_or_init(|| {
            // SAFETY: mj_version takes nothing and returns a constant.
            let library = unsafe { mj::mj_version() };
            if library != mj::mjVERSION_HEADER {
                return Err(VersionError { headers: dotted(mj::mjVERSION_HEADER), library: dotted(library) });
            }
            super::guard::install_handlers();
            super::plugins::load();
            Ok(())
        })
        .clone()
}

/// The version of the headers, such as `2.2.2`.
pub fn version_string() -> String {
    dotted(mj::mjVERSION_HEADER)
}

/// 222 is 2.2.2; since 3.5 the number is major * 10^6 + minor * 10^3 + patch.
fn dotted(version: i32) -> String {
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
        assert_eq!(dotted(222), "2.2.2");
        assert_eq!(dotted(340), "3.4.0");
        assert_eq!(dotted(4_000_001), "4.0.1");
    }
}
