//! Contacts that a file has with what stands in its world: the scene's world is another.

use super::robot;
use kinetoscope::prelude::*;

/// Height of a ball of 0.1 m after two seconds over the scene's ground, and what was said.
fn settled(bits: &str, contact: &str) -> (f64, Vec<String>) {
    let text = format!(
        r#"<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="b" pos="0 0 0.3"><freejoint/>
        <geom name="foot" size="0.1" mass="1" {bits}/><body><joint name="j"/><geom size="0.01" pos="0 0 0.05" mass="0.01"
        contype="0" conaffinity="0"/></body></body></worldbody><contact>{contact}</contact></mujoco>"#
    );
    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    let id = sim.add_robot(RobotCfg { fix_base: false, ..robot("r", &text) }).unwrap();
    sim.update(200);
    (sim.robot(id).get_root_pose()[(0, 2)], sim.diagnostics().iter().map(ToString::to_string).collect())
}

const NO_BITS: &str = r#"contype="0" conaffinity="0""#;

/// It stands as deep in the ground as a ball with bits, a fraction of a millimetre; without the pair it falls 20 m.
#[test]
fn geoms_that_a_file_pairs_with_its_floor_collide_with_the_ground() {
    let (height, said) = settled(NO_BITS, r#"<pair geom1="foot" geom2="floor"/>"#);
    assert!((height - 0.1).abs() < 2e-3, "{height}");
    let is_pair =
        |d: &&String| d.contains("\"foot\"") && d.contains("\"floor\"") && d.contains("pairs with what stands");
    assert_eq!(said.iter().filter(is_pair).count(), 1, "{said:?}");
    let (height, said) = settled(NO_BITS, "");
    assert!(height < -1.0 && !said.iter().any(|d| d.contains("pairs with")), "{height}: {said:?}");
}

#[test]
fn bodies_that_a_file_excludes_from_its_world_collide_with_the_scene() {
    let (height, said) = settled("", r#"<exclude body1="world" body2="b"/>"#);
    assert!((height - 0.1).abs() < 2e-3, "{height}");
    assert_eq!(said.iter().filter(|d| d.contains("body \"b\" collides with the scene")).count(), 1, "{said:?}");
}

/// Which pairs the configuration leaves out is said too.
#[test]
fn pairs_within_a_robot_are_named_where_it_does_not_collide_with_itself() {
    let text = r#"<mujoco><worldbody><body name="a"><geom name="g" size="0.1" mass="1"/><body name="b" pos="1 0 0">
        <joint name="j" axis="0 0 1"/><geom name="h" size="0.1" mass="1"/></body></body></worldbody>
        <contact><pair geom1="g" geom2="h"/></contact></mujoco>"#;
    for self_collision in [false, true] {
        let mut sim = super::empty(1);
        sim.add_robot(RobotCfg { self_collision, ..robot("r", text) }).unwrap();
        let said: Vec<String> = sim.diagnostics().iter().map(ToString::to_string).collect();
        let named = said.iter().filter(|d| d.contains("\"g\" and \"h\"")).count();
        assert_eq!((named, sim.batch().model().npair()), (usize::from(!self_collision), usize::from(self_collision)));
    }
}
