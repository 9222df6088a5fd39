//! MuJoCo's own sample models, of the library's package.

use kinetoscope::sim::drive::table::DriveTable;
use kinetoscope::sim::env::{Env, EnvStatus};
use kinetoscope::sim::mj::compile_file;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn models_below(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            models_below(&path, found);
        } else if path.extension().is_some_and(|e| e == "xml") {
            found.push(path);
        }
    }
}

#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn compile_and_step() {
    let dir = testkit::needs::sample_model("");
    let mut files = Vec::new();
    models_below(&dir, &mut files);
    files.sort();
    assert!(files.len() > 10, "{files:?}");
    let (mut stepped, mut refused) = (0, Vec::new());
    for file in &files {
        match compile_file(file) {
            Ok(compiled) => {
                let model = compiled.into_model();
                let mut env = Env::new(&model, &Arc::new(DriveTable::default())).unwrap();
                env.step(100);
                assert_eq!(*env.status(), EnvStatus::Running, "{}", file.display());
                assert!(env.data().qpos().iter().all(|q| q.is_finite()));
                stepped += 1;
            }
            // Parts that other files include are no models.
            Err(error) => refused.push(format!("{}: {error}", file.display())),
        }
    }
    assert!(stepped >= 10, "{refused:#?}");
}
