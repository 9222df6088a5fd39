//! What laws measured, as files for the page of numbers.

use crate::law::Measured;
use kinetoscope::mujoco as mj;
use serde_json::json;
use std::path::PathBuf;

/// The folder for the rows, one file per law.
const VARIABLE: &str = "KINETOSCOPE_PHYSICS_ROWS";

/// Writes `group.name.json` into the folder that the environment names, if it names one.
pub(crate) fn write(group: &str, name: &str, statement: &str, measured: &Measured) {
    let Some(folder) = std::env::var_os(VARIABLE).map(PathBuf::from) else { return };
    std::fs::create_dir_all(&folder).unwrap();
    let law = json!({
        "group": group, "name": name, "statement": statement, "mujoco": mj::version_string(), "measured": measured,
    });
    std::fs::write(folder.join(format!("{group}.{name}.json")), format!("{law:#}\n")).unwrap();
}
