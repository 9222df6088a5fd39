//! Search folders of the bundled files.

use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope_testkit::process;
use kinetoscope_testkit::worlds::urdf_robot;

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

/// Compatibility with EmbodiChain's tutorial, which closes a hand at its lower limits and opens it at the upper ones.
/// Regression: the bundled hand bent the other way.
#[test]
fn hand_closes_at_its_lower_limits() {
    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    let id = sim.add_robot(urdf_robot("hand", assets::path("revo1_left/revo1_left.urdf").unwrap())).unwrap();
    let robot = sim.robot(id);
    let limits = robot.qpos_limits();
    // Positions of the outer segments in the palm's frame [m]: fingers along +y, the palm faces +z.
    let place = |link: &str, end: usize| {
        let qpos: Array2<f64> = limits.index_axis(Axis(2), end).to_owned();
        let pose = robot.compute_fk(&qpos, link, None).unwrap();
        [0, 1, 2].map(|k| pose[(0, k)])
    };
    for finger in ["index", "middle", "ring", "pinky"] {
        let [closed, open] = [0, 1].map(|end| place(&format!("left_{finger}_dist"), end));
        assert!(closed[1] < open[1] - 0.02 && closed[2] > open[2] + 0.02, "{finger}: {closed:?} {open:?}");
        assert!((closed[0] - open[0]).abs() < 1e-3, "{finger}: {closed:?} {open:?}");
    }
}

/// The boxes of the bundled hand end at the height of the adjacent cylinders, on the axis of the cylinder.
///
/// Regression: the palm's box was 0.8 mm wider on each side, so that its side stood 23 um above the cylinder, visible
/// as a dotted line in images.
#[test]
fn round_edges_of_the_hand() {
    let file = std::fs::read_to_string(assets::path("revo1_left/revo1_left.urdf").unwrap()).unwrap();
    let document = roxmltree::Document::parse(&file).unwrap();
    let mut edges = 0;
    for link in document.descendants().filter(|n| n.has_tag_name("link")) {
        let visuals: Vec<_> = link.children().filter(|n| n.has_tag_name("visual")).collect();
        let numbers = |text: &str| text.split_whitespace().map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
        // Origins and sizes of the visuals of a kind.
        let of = |kind: &str, size: &str| -> Vec<(Vec<f64>, Vec<f64>)> {
            let found = visuals.iter().filter_map(|visual| {
                let shape = visual.descendants().find(|n| n.has_tag_name(kind))?;
                let origin = visual.children().find(|n| n.has_tag_name("origin"))?;
                Some((numbers(origin.attribute("xyz")?), numbers(shape.attribute(size)?)))
            });
            found.collect()
        };
        for (at, size) in of("box", "size") {
            for (axis, radius) in of("cylinder", "radius") {
                if axis[1] == at[1] && axis[0] != 0.0 && size[2] == 2.0 * radius[0] {
                    assert!(size[0] <= 2.0 * axis[0].abs(), "a box {size:?} beside the cylinder at {axis:?}");
                    edges += 1;
                }
            }
        }
    }
    assert_eq!(edges, 4);
}

/// The ready configurations: their joints, control parts and drive gains, which are those of EmbodiChain's tutorial for
/// the arm and the hand.
#[test]
fn ready_configurations() {
    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    // Joints without mimic joints: six of the arm, six of the hand, three of each leg.
    let rows = [
        (assets::sr5().unwrap(), 6, &["arm"][..], 1e4),
        (assets::revo1_left().unwrap(), 6, &["hand"], 1e3),
        (assets::sr5_with_hand().unwrap(), 12, &["arm", "hand"], 1e4),
        (assets::quadruped().unwrap(), 12, &[], 80.0),
    ];
    for (cfg, joints, parts, stiffness) in rows {
        let uid = cfg.uid.clone();
        let id = sim.add_robot(cfg).unwrap_or_else(|error| panic!("{uid}: {error}"));
        let robot = sim.robot(id);
        let driven = (0..robot.dof()).filter(|&joint| !robot.is_mimic(JointIndex(joint)).unwrap()).count();
        assert_eq!((driven, robot.control_parts()), (joints, parts.to_vec()), "{uid}");
        assert_eq!(robot.stiffness()[(0, 0)], stiffness, "{uid}");
    }
}
