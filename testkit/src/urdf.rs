//! URDF snippets. Lengths are in meters, masses in kilograms, moments of inertia in kg m².

use std::path::{Path, PathBuf};

/// A robot with these elements; the first element is in line 2.
pub fn robot(name: &str, elements: &str) -> String {
    format!("<robot name=\"{name}\">\n{elements}\n</robot>")
}

/// A link with a mass at a point and equal moments of inertia about all axes there; `more` is further content (visuals,
/// collisions).
pub fn link(name: &str, mass: f64, moment: f64, [x, y, z]: [f64; 3], more: &str) -> String {
    format!(
        "<link name=\"{name}\"><inertial><origin xyz=\"{x} {y} {z}\"/><mass value=\"{mass}\"/><inertia ixx=\"{moment}\" \
         ixy=\"0\" ixz=\"0\" iyy=\"{moment}\" iyz=\"0\" izz=\"{moment}\"/></inertial>{more}</link>\n"
    )
}

/// A joint at a point in the frame of its parent; `more` is further content (limit, dynamics, mimic).
pub fn joint(
    name: &str,
    kind: &str,
    [parent, child]: [&str; 2],
    [x, y, z]: [f64; 3],
    axis: &str,
    more: &str,
) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
         <origin xyz=\"{x} {y} {z}\"/><axis xyz=\"{axis}\"/>{more}</joint>\n"
    )
}

/// A limit element \[rad or m, N m or N, rad/s or m/s\].
pub fn limit([lower, upper]: [f64; 2], effort: f64, velocity: f64) -> String {
    format!("<limit lower=\"{lower}\" upper=\"{upper}\" effort=\"{effort}\" velocity=\"{velocity}\"/>")
}

/// A collision element with this geometry, for example `<sphere radius="0.1"/>`, at a point.
pub fn collision(geometry: &str, [x, y, z]: [f64; 3]) -> String {
    format!("<collision><origin xyz=\"{x} {y} {z}\"/><geometry>{geometry}</geometry></collision>")
}

/// Temporary files that are removed when the value is dropped.
#[derive(Debug)]
pub struct TempFiles(tempfile::TempDir);

impl Default for TempFiles {
    fn default() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
}

impl TempFiles {
    /// The temporary folder.
    pub fn folder(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file and its parent folders, and returns its path.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, content).unwrap();
        path
    }
}
