//! MJCF file of a robot, as part of its configuration.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// MJCF file of a robot or articulation: see [`RobotCfg::mjcf`](crate::RobotCfg::mjcf).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MjcfFile {
    /// Path of the file. If `text` is set, no file is read and the path only appears in error messages.
    pub path: PathBuf,
    /// MJCF source text, without references to other files. `None` reads the file at `path`.
    pub text: Option<String>,
}

impl MjcfFile {
    /// Creates a configuration that reads the MJCF file at `path`.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), text: None }
    }

    /// Creates the configuration of MJCF text, which must not refer to files.
    pub fn text(text: impl Into<String>) -> Self {
        Self { path: "text".into(), text: Some(text.into()) }
    }

    /// Replaces the path by the result of `beside`, unless `text` is set.
    pub(crate) fn resolve_path(&mut self, beside: impl Fn(&Path) -> PathBuf) {
        if self.text.is_none() {
            self.path = beside(&self.path);
        }
    }
}
