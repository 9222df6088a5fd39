//! Golden files: the MJCF of the bundled robots for both supported MuJoCo versions, stored in `tests/data`.
//!
//! `KINETOSCOPE_BLESS=1` rewrites the files (`cargo xtask bless`).

use super::robots::{bundled_robots, dump, simulation};
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use std::path::Path;

/// Compares a text with `tests/data/<name>`; writes the actual text next to a file that differs.
fn compare(name: &str, found: &str) -> Result<(), String> {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    std::fs::create_dir_all(golden.parent().unwrap()).unwrap();
    if std::env::var_os("KINETOSCOPE_BLESS").is_some_and(|v| !v.is_empty() && v != "0") {
        std::fs::write(&golden, found).unwrap();
        return Ok(());
    }
    let expected = std::fs::read_to_string(&golden).unwrap_or_default();
    if expected == found {
        return Ok(());
    }
    let actual = golden.with_extension("actual.xml");
    std::fs::write(&actual, found).unwrap();
    let line = expected.lines().zip(found.lines()).position(|(a, b)| a != b);
    let line = line.unwrap_or_else(|| expected.lines().count().min(found.lines().count()));
    let nth = |text: &str| text.lines().nth(line).unwrap_or("(ends)").trim().to_owned();
    let (golden, found, actual) = (nth(&expected), nth(found), actual.display());
    Err(format!(
        "tests/data/{name}, line {}:\n  golden: {golden}\n  found:  {found}\nall of it is in {actual}; if it is right, \
         run `cargo xtask bless`",
        line + 1
    ))
}

#[test]
fn mjcf() {
    let mut wrong = Vec::new();
    for cfg in bundled_robots() {
        let name = cfg.uid.clone();
        let dir = dump(&simulation(cfg).0);
        let run = match BUILD_VERSION {
            SupportedVersion::V2 => "run2",
            SupportedVersion::V4 => "run4",
        };
        // Every build writes the exports for both versions, and the running model for its own version.
        for (file, golden) in [("robot.mjcf2.xml", "mjcf2"), ("robot.mjcf4.xml", "mjcf4"), ("run.mjcf.xml", run)] {
            let text = std::fs::read_to_string(dir.path().join(file)).unwrap();
            wrong.extend(compare(&format!("{name}.{golden}.xml"), &text).err());
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
