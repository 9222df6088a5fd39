//! Errors of robots that MJCF cannot hold.

use kinetoscope_scene::source::Source;

/// The most moving bodies one below the other: MuJoCo's XML reader refuses documents nested deeper than 100 elements on 2.2.2
/// and 500 on 4.x.
pub const MAX_BODY_DEPTH: usize = match kinetoscope_mujoco::TARGET {
    kinetoscope_mujoco::Target::V2 => 96,
    kinetoscope_mujoco::Target::V4 => 480,
};

/// An error of `robot::add`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EmitError {
    /// MuJoCo cannot read it.
    #[error(
        "{source_line}: link {link:?} is {depth} moving bodies below the root; MuJoCo reads at most {MAX_BODY_DEPTH}: \
         join rigid parts by fixed joints"
    )]
    TooDeep {
        /// The link.
        link: String,
        /// Its place.
        source_line: Source,
        /// Its depth.
        depth: usize,
    },
}
