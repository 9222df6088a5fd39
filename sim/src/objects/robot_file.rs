//! Which MJCF file a robot is.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// An MJCF file that is a robot: see [`RobotCfg::mjcf`](crate::RobotCfg::mjcf).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MjcfFile {
    /// The file; with `text` only what errors call it.
    pub path: PathBuf,
    /// The MJCF itself, which names no files; the file's content where `None`.
    pub text: Option<String>,
}

impl MjcfFile {
    /// A file.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), text: None }
    }

    /// MJCF text, which names no files.
    pub fn text(text: impl Into<String>) -> Self {
        Self { path: "text".into(), text: Some(text.into()) }
    }

    /// Makes its path relative to a folder; an absolute one stays, and text has none.
    pub(crate) fn place_beside(&mut self, beside: impl Fn(&Path) -> PathBuf) {
        if self.text.is_none() {
            self.path = beside(&self.path);
        }
    }
}
