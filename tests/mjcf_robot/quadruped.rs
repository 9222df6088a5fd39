//! The bundled quadruped from MJCF is the one from URDF.

use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;

fn standing(of: RobotCfg) -> (SimulationManager, RobotId) {
    let mut sim =
        SimulationManager::new(SimulationManagerCfg { num_envs: 1, ..SimulationManagerCfg::legged() }).unwrap();
    let pose = [(".*HAA", 0.0), (".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)];
    let cfg = RobotCfg {
        fix_base: false,
        init_qpos: pose.map(|(joints, angle)| (joints.to_string(), angle)).to_vec(),
        drive: DriveCfg { stiffness: 80.0.into(), damping: 5.0.into(), ..Default::default() },
        ..of
    };
    let id = sim.add_robot(cfg).unwrap();
    (sim, id)
}

fn both() -> [(SimulationManager, RobotId); 2] {
    let (urdf, xml) =
        (assets::path("quadruped/quadruped.urdf").unwrap(), assets::path("quadruped/quadruped.xml").unwrap());
    let init_pose = Pose::translation(0.0, 0.0, 0.6);
    let of_urdf = RobotCfg { urdf: UrdfCfg::single(urdf), init_pose, ..Default::default() };
    [standing(of_urdf), standing(RobotCfg { mjcf: Some(MjcfFile::new(xml)), ..Default::default() })]
}

/// Degrees with six digits are right to 1e-6 rad; lengths and masses are the same numbers, principal axes are rounded.
#[test]
fn it_has_the_same_joints_masses_limits_and_frames() {
    let [(a, urdf), (b, xml)] = both();
    let (urdf, xml) = (a.robot(urdf), b.robot(xml));
    assert_eq!(urdf.joint_names(), xml.joint_names());
    assert!((urdf.total_mass() - xml.total_mass()).abs() < 1e-12 && (xml.total_mass() - 52.135).abs() < 1e-3);
    assert!((urdf.qpos_limits() - xml.qpos_limits()).iter().all(|d| d.abs() < 1e-5));
    assert_eq!(urdf.qf_limits(), xml.qf_limits());
    assert_eq!(urdf.get_default_qpos(), xml.get_default_qpos());
    let poses = xml.get_link_poses();
    for (link, name) in xml.link_names().into_iter().enumerate() {
        let (there, here) = (urdf.link_pose(name).unwrap(), poses.index_axis(Axis(1), link));
        assert!((&there - &here).iter().all(|d| d.abs() < 1e-9), "{name}: {there} {here}");
    }
    assert_eq!(urdf.link_names().len(), xml.link_names().len() + 1, "all but a frame of a frame");
    let bias = |sim: &SimulationManager| sim.batch().read(0, |env| env.data().qfrc_bias().to_vec());
    let (there, here) = (bias(&a), bias(&b));
    assert!(there.iter().zip(&here).all(|(a, b)| (a - b).abs() < 1e-8) && there[2] > 500.0, "{there:?} {here:?}");
}

/// Both stand on their feet. MuJoCo's own friction of geoms is not the scene's, so they do not to the last digit.
#[test]
fn it_stands() {
    let heights = both().map(|(mut sim, id)| {
        let feet = sim.add_sensor("feet", ContactSensorCfg::of(".*_FOOT")).unwrap();
        sim.update(400);
        assert!(sim.diverged().is_empty());
        let forces = sim.sensor(feet).unwrap().net_forces_w().to_owned();
        let weight: f64 = forces.index_axis(Axis(2), 2).sum();
        // The mass has three decimals: 5e-4 kg are 5e-3 N; as much again is an acceleration of 1e-4 m/s² that is left.
        assert!((weight - 52.135 * 9.81).abs() < 1e-2, "{weight} N");
        let pose: Array2<f64> = sim.robot(id).get_root_pose();
        pose[(0, 2)]
    });
    assert!((heights[0] - heights[1]).abs() < 5e-3 && heights[1] > 0.4, "{heights:?}");
}
