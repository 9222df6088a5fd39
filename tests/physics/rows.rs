//! Results of the laws as files for the physics page.

use crate::law::Measurements;
use kinetoscope::mujoco as mj;
use serde_json::json;
use std::path::PathBuf;

/// Environment variable with the folder for the results, one file per law.
const VARIABLE: &str = "KINETOSCOPE_PHYSICS_ROWS";

/// Writes `group.name.json` into the folder of the environment variable, if set.
pub(crate) fn write(group: &str, name: &str, statement: &str, measured: &Measurements) {
    let Some(folder) = std::env::var_os(VARIABLE).map(PathBuf::from) else { return };
    std::fs::create_dir_all(&folder).unwrap();
    let law = json!({
        "group": group, "name": name, "statement": statement, "mujoco": mj::version_string(), "measured": measured,
    });
    std::fs::write(folder.join(format!("{group}.{name}.json")), format!("{law:#}\n")).unwrap();
}
