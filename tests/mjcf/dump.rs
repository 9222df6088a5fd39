//! The exported files hold the parts.

use super::{empty, machine};
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{TARGET, Target, compile_file};

#[test]
fn the_exported_model_is_the_one_that_runs() {
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    let looks = r#"<mujoco><asset><texture name="t" type="2d" builtin="flat" rgb1="1 0 0" width="2" height="2"/>
        <material name="t" texture="t"/><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>
        <worldbody><geom type="box" size="1 1 1" material="t"/><geom type="hfield" hfield="h"/></worldbody></mujoco>"#;
    sim.add_mjcf(MjcfCfg::text("looks", looks)).unwrap();
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(sim.dump(dir.path()).unwrap(), []);
    let exported = if TARGET == Target::V2 { "robot.mjcf2.xml" } else { "robot.mjcf4.xml" };
    let ours = sim.batch().model();
    for file in [exported, "run.mjcf.xml"] {
        let model = compile_file(&dir.path().join(file)).unwrap().into_model();
        assert_eq!((model.nq(), model.nu(), model.nsensor()), (ours.nq(), ours.nu(), ours.nsensor()), "{file}");
        assert_eq!(model.body_mass(), ours.body_mass(), "{file}");
        assert_eq!((model.ntex(), model.nhfield()), (1, 1), "{file}");
    }
}
