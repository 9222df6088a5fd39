//! MuJoCo's own sample models, from the package of the library.

use kinetoscope::mujoco::compile_file;
use kinetoscope::sim::drive::table::DriveTable;
use kinetoscope::sim::env::{EnvStatus, SimEnv};
use kinetoscope_testkit::test_resources::{files_below, sample_model};
use std::sync::Arc;

#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn compile_and_step() {
    let files = files_below(&sample_model(""), "xml");
    assert!(files.len() > 10, "{files:?}");
    let (mut stepped, mut refused) = (0, Vec::new());
    for file in &files {
        match compile_file(file) {
            Ok(compiled) => {
                let model = compiled.into_model();
                let mut env = SimEnv::new(&model, &Arc::new(DriveTable::default())).unwrap();
                env.step(100);
                assert_eq!(*env.status(), EnvStatus::Running, "{}", file.display());
                assert!(env.data().qpos().iter().all(|q| q.is_finite()));
                stepped += 1;
            }
            // Files that are only included by others are not models.
            Err(error) => refused.push(format!("{}: {error}", file.display())),
        }
    }
    assert!(stepped >= 10, "{refused:#?}");
}
