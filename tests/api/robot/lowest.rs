//! Heights of lowest collision points, against closed forms and against the distances of MuJoCo's contacts.

use super::ENVS;
use kinetoscope::prelude::*;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::tolerance::{Tolerance, assert_number};
use kinetoscope_testkit::worlds::{cfg, count_diagnostics, empty_cfg, mjcf_robot, pose_of_row, sim};
use nalgebra::{UnitQuaternion, Vector3};

const EXACT: Tolerance = Tolerance::absolute(1e-12, "a thousand times the rounding of a few numbers of size 1");
const SINGLE: Tolerance = Tolerance::absolute(1e-7, "vertices of meshes are in single precision");

/// A tetrahedron with its centroid in the origin of its geom.
const CORNERS: [[f64; 3]; 4] = [[0.3, 0.0, -0.1], [-0.15, 0.26, -0.1], [-0.15, -0.26, -0.1], [0.0, 0.0, 0.3]];

/// A wheel without a collision shape, because a robot needs a joint.
const WHEEL: &str = "<body name=\"wheel\"><joint name=\"spin\"/><geom size=\"0.01\" contype=\"0\" conaffinity=\"0\" mass=\"0.01\"/></body>";

/// Returns a free body with a collision shape, and a larger visual shape that must be ignored.
fn body(geom: &str) -> String {
    let vertices: Vec<String> = CORNERS.iter().flatten().map(f64::to_string).collect();
    format!(
        "<mujoco><asset><mesh name=\"tetrahedron\" vertex=\"{}\"/></asset><worldbody><body name=\"body\">\
         <geom {geom} mass=\"1\"/><geom size=\"2\" contype=\"0\" conaffinity=\"0\" mass=\"0\"/>{WHEEL}</body></worldbody></mujoco>",
        vertices.join(" ")
    )
}

/// Returns the distance of the deepest contact in environment 0 \[m\].
fn deepest(sim: &SimulationManager) -> f64 {
    sim.batch().read(0, |env| env.data().contact().iter().map(|contact| contact.dist).fold(f64::INFINITY, f64::min))
}

#[test]
fn closed_forms_and_contacts() {
    // Each shape with its depth below its center, where `d` is the world's z axis in the axes of the shape.
    type Depth = fn(Vector3<f64>) -> f64;
    let shapes: [(&str, Depth, Tolerance); 6] = [
        ("type=\"sphere\" size=\"0.2\"", |_| 0.2, EXACT),
        ("type=\"capsule\" size=\"0.1 0.3\"", |d| 0.1 + 0.3 * d.z.abs(), EXACT),
        ("type=\"ellipsoid\" size=\"0.1 0.2 0.4\"", |d| d.component_mul(&Vector3::new(0.1, 0.2, 0.4)).norm(), EXACT),
        ("type=\"cylinder\" size=\"0.2 0.3\"", |d| 0.2 * (1.0 - d.z * d.z).sqrt() + 0.3 * d.z.abs(), EXACT),
        ("type=\"box\" size=\"0.1 0.2 0.3\"", |d| d.abs().dot(&Vector3::new(0.1, 0.2, 0.3)), EXACT),
        (
            "type=\"mesh\" mesh=\"tetrahedron\"",
            |d| CORNERS.iter().map(|corner| -d.dot(&Vector3::from(*corner))).fold(f64::MIN, f64::max),
            SINGLE,
        ),
    ];
    for (shape, depth, tolerance) in shapes {
        for [roll, pitch, yaw] in [[0.0, 0.0, 0.0], [0.7, -0.4, 2.0], [2.5, 1.2, -1.0]] {
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let below = depth(rotation.inverse() * Vector3::z());
            let free = || RobotCfg { fix_base: false, ..mjcf_robot("body", &body(shape)) };
            // 5 mm into the ground, so that a contact exists.
            let init_pose = Pose::from_parts([0.0, 0.0, below - 0.005].into(), rotation);
            let mut deep = sim(cfg(ENVS, 2));
            let robot = deep.add_robot(RobotCfg { init_pose, ..free() }).unwrap();
            let heights = deep.robot(robot).lowest_heights();
            assert_eq!(heights.len(), ENVS);
            for height in heights {
                assert_number(&format!("{shape}: closed form"), height, -0.005, tolerance);
            }
            let by_contact = Tolerance { absolute: tolerance.absolute.max(1e-9), ..tolerance };
            assert_number(&format!("{shape}: contact"), deepest(&deep), -0.005, by_contact);

            // The clearance holds at the start and after a reset; the rest of the pose is unchanged.
            let init_pose = Pose::from_parts([0.5, 0.0, 77.0].into(), rotation);
            let mut standing = sim(cfg(ENVS, 2));
            let robot = standing.add_robot(RobotCfg { init_pose, ground_clearance: Some(0.02), ..free() }).unwrap();
            standing.update(3);
            standing.reset(None).unwrap();
            assert_number(shape, standing.robot(robot).lowest_heights()[1], 0.02, tolerance);
            assert_number(shape, standing.robot(robot).default_root_pose()[(0, 2)], below + 0.02, tolerance);
            assert_number(shape, standing.robot(robot).root_pose()[(2, 0)], 0.5, EXACT);
            let turned = pose_of_row(&standing.robot(robot).root_pose(), 0).rotation.angle_to(&rotation);
            assert_number(shape, turned, 0.0, Tolerance::absolute(1e-7, "an angle from a cosine of 1 - 1e-16"));
        }
    }
}

/// Lowest heights of links, including links that are fixed to the world.
#[test]
fn links() {
    let arm = r#"<mujoco><worldbody><body name="base"><geom type="box" size="0.1 0.1 0.05"/>
      <body name="arm" pos="0 0 0.3"><joint name="turn" axis="0 1 0" range="-180 180" limited="true"/>
        <geom type="capsule" size="0.05" fromto="0 0 0 0.5 0 0"/><site name="tip" pos="0.5 0 0"/></body></body></worldbody>
      </mujoco>"#;
    let mut sim = sim(cfg(1, 1));
    let init_qpos = vec![("turn".into(), 90f64.to_radians())];
    let id = sim.add_robot(RobotCfg { init_qpos, ..mjcf_robot("arm", arm) }).unwrap();
    let robot = sim.robot(id);
    let heights = robot.link_lowest_heights();
    // The arm hangs down from 0.3 m.
    for (link, (height, fixed)) in
        [(-0.05, true), (0.3 - 0.5 - 0.05, false), (f64::INFINITY, false)].into_iter().enumerate()
    {
        let link_id = robot.find_links(&[robot.link_names()[link]]).unwrap()[0];
        assert_eq!(robot.is_link_fixed(link_id).unwrap(), fixed, "{link}");
        if height.is_finite() {
            assert_number(robot.link_names()[link], heights[(0, link)], height, EXACT);
        } else {
            assert_eq!(heights[(0, link)], height);
        }
    }
    assert_number("the robot", robot.lowest_heights()[0], -0.25, EXACT);
}

/// Errors of a clearance that cannot be computed.
#[test]
fn no_clearance() {
    let visual = format!(
        "<mujoco><worldbody><body name=\"ghost\"><geom size=\"0.1\" contype=\"0\" conaffinity=\"0\"/>{WHEEL}</body>\
         </worldbody></mujoco>"
    );
    let ghost = || RobotCfg { fix_base: false, ..mjcf_robot("ghost", &visual) };
    let mut sim = sim(empty_cfg(1));
    let id = sim.add_robot(RobotCfg { ground_clearance: Some(0.1), ..ghost() }).unwrap();
    assert_eq!(sim.robot(id).lowest_heights()[0], f64::INFINITY);
    assert_eq!(sim.robot(id).root_pose()[(0, 2)], 0.0);
    assert_eq!(count_diagnostics(&sim, &["\"ghost\"", "no link has a collision shape"]), 1);
    for clearance in [f64::NAN, f64::INFINITY] {
        let refused = sim.add_robot(RobotCfg { uid: "second".into(), ground_clearance: Some(clearance), ..ghost() });
        assert_error(refused, "Config", &["ground_clearance", "finite"]);
    }
}
