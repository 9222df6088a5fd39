//! The exported files hold the terrain.

use super::{bumps, empty};
use kinetoscope::sim::mj::{TARGET, Target, compile_file};

#[test]
fn the_exported_model_has_the_same_height_field() {
    let mut sim = empty();
    sim.add_terrain(bumps()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(sim.dump(dir.path()).unwrap(), []);
    let exported = match TARGET {
        Target::V2 => "robot.mjcf2.xml",
        Target::V4 => "robot.mjcf4.xml",
    };
    for file in [exported, "run.mjcf.xml"] {
        let model = compile_file(&dir.path().join(file)).unwrap().into_model();
        let (theirs, ours) = (model.height_field(0), sim.batch().model().height_field(0));
        assert_eq!((model.nhfield(), theirs.rows, theirs.columns), (1, 21, 31));
        assert_eq!((theirs.size, theirs.elevation), (ours.size, ours.elevation), "{file}");
    }
}
