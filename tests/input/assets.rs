//! Bundled files: the folders that are searched.

use kinetoscope::prelude::*;
use testkit::process;

#[test]
fn missing_file() {
    assert!(assets::path("sr5/SR5.urdf").is_ok_and(|p| p.is_file()));
    let folder = tempfile::tempdir().unwrap();
    let variables = [("KINETOSCOPE_ASSETS", "elsewhere")];
    let text = process::text(&process::run(module_path!(), "scenario_elsewhere", folder.path(), &variables).stdout);
    assert!(text.contains("elsewhere/no/such.urdf") && text.contains("assets/no/such.urdf"), "{text}");
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_elsewhere() {
    if process::is_child() {
        println!("{}", assets::path("no/such.urdf").unwrap_err());
    }
}
