//! Terrains that cannot be.

use super::{bumps, empty};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;

#[test]
fn mistakes_are_named_and_change_nothing() {
    let mut sim = empty();
    sim.add_terrain(bumps()).unwrap();
    let other = |cfg: TerrainCfg| TerrainCfg { uid: "other".into(), ..cfg };
    let mut hole = bumps();
    hole.heights[(3, 7)] = f64::NAN;
    let mut spike = bumps();
    spike.heights[(0, 0)] = 1e9;
    for (cfg, says) in [
        (bumps(), "taken"),
        (TerrainCfg { uid: "ground".into(), ..bumps() }, "taken"),
        (TerrainCfg { uid: "a/b".into(), ..bumps() }, "not usable"),
        (other(hole), "heights[3, 7] (terrain \"other\") is NaN"),
        (other(spike), "within 1e6 metres"),
        (other(TerrainCfg { heights: Array2::zeros((1, 5)), ..bumps() }), "at least 2 rows"),
        (other(TerrainCfg { heights: Array2::zeros((0, 0)), ..bumps() }), "at least 2 rows"),
        (other(TerrainCfg { heights: Array2::zeros((3000, 3000)), ..bumps() }), "at most 4194304 points"),
        (other(TerrainCfg { size: [0.0, 1.0], ..bumps() }), "size is [0.0, 1.0]"),
        (other(TerrainCfg { size: [1.0, f64::NAN], ..bumps() }), "size"),
        (other(TerrainCfg { thickness: -1.0, ..bumps() }), "thickness is -1.0"),
        (other(TerrainCfg { friction: Some([-1.0, 0.0, 0.0]), ..bumps() }), "friction"),
        (other(TerrainCfg { rgba: [2.0, 0.0, 0.0, 1.0], ..bumps() }), "rgba"),
        (other(TerrainCfg { init_pose: Pose::translation(f64::NAN, 0.0, 0.0), ..bumps() }), "init_pose"),
    ] {
        let error = sim.add_terrain(cfg).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    assert_eq!(sim.mask_ids().len(), 1);
    // A name with signs that mean something in XML, and heights that are all the same.
    let flat = TerrainCfg { uid: "<\"flat\" & wide>".into(), heights: Array2::from_elem((2, 2), 0.3), ..bumps() };
    let flat = sim.add_terrain(flat).unwrap();
    assert_eq!(sim.terrain(flat).height_at([0.0, 0.0]), Some(0.3));
    assert_eq!(sim.terrain(flat).height_at([1.6, 0.0]), None);
    assert_eq!(sim.mask_ids().len(), 2);
    let object = RigidObjectCfg { uid: "bumps".into(), ..Default::default() };
    assert!(sim.add_rigid_object(object).is_err(), "the name is a terrain's");
}
