//! Errors of robots that MJCF cannot represent.

use kinetoscope_scene::source_location::SourceLocation;

/// Maximum number of bodies of a robot in a chain from the root to a leaf, both included. MuJoCo's XML reader rejects
/// documents that are nested deeper than 100 elements on 2.2.2 and 500 on 4.x.
pub const MAX_BODY_DEPTH: usize = match kinetoscope_mujoco::BUILD_VERSION {
    kinetoscope_mujoco::SupportedVersion::V2 => 96,
    kinetoscope_mujoco::SupportedVersion::V4 => 480,
};

/// A robot that MJCF cannot represent.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RobotMjcfError {
    /// The tree of moving bodies is too deep for MuJoCo.
    #[error(
        "{source_line}: link {link:?} is {depth} moving bodies below the root; MuJoCo reads at most {MAX_BODY_DEPTH}: \
         join rigid parts by fixed joints"
    )]
    TooDeep {
        /// Name of the link.
        link: String,
        /// Location of the link.
        source_line: SourceLocation,
        /// Number of bodies from the root to the link, both included.
        depth: usize,
    },
}
