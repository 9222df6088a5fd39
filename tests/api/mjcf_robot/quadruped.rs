//! The bundled quadruped from MJCF is the one from URDF.

use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::ObjectKind;

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

/// How deep the feet are in the ground, how high the base is, and how fast it sinks.
struct Stand {
    depth: f64,
    height: f64,
    sinks: f64,
}

/// How deep a foot presses into the ground at rest. A row of a contact holds f = a_ref / R there, with
/// R = A (1 - d) / d and a_ref = d δ / (d² t²), A being the inverse weight of the foot's body, t = 0.02 s and d = 0.95 the time
/// constant and the impedance of MuJoCo's defaults beyond a depth of 1 mm (the chapter "Computation" of its manual, "Solver
/// parameters" and "Parameters"). So δ = f (1 - d) A t².
fn depth_at_rest(force: f64, inverse_weight: f64) -> f64 {
    const IMPEDANCE: f64 = 0.95;
    const TIME: f64 = 0.02;
    force * (1.0 - IMPEDANCE) * inverse_weight * TIME * TIME
}

/// Both stand on their feet, each as deep in the ground as its load presses it; A is that of the shank which a
/// foot from a URDF is fused to, and in the file that of the foot itself, a body of its own, whose middle is lower. Drives of 80 N m/rad are soft, and loaded feet creep apart at
/// a constant rate: the base has sunk by that rate times the two seconds, less the part of a second until it had landed. But
/// for both, the two stand equally high.
#[test]
fn it_stands() {
    const TIME: f64 = 2.0;
    let [urdf, xml] = both().map(|(mut sim, id)| {
        let feet = sim.add_sensor("feet", ContactSensorCfg::of(".*_FOOT")).unwrap();
        sim.update((TIME / sim.cfg().physics_dt).round() as u32);
        assert!(sim.diverged().is_empty());
        let sensor = sim.sensor(feet).unwrap();
        let forces = sensor.net_forces_w().index_axis(Axis(2), 2).row(0).to_vec();
        let weight: f64 = forces.iter().sum();
        // The mass has three decimals: 5e-4 kg are 5e-3 N; as much again is an acceleration of 1e-4 m/s² that is left.
        assert!((weight - 52.135 * 9.81).abs() < 1e-2, "{weight} N");
        let legs: Vec<String> = sensor.body_names().iter().map(|name| name.replace("_FOOT", "_")).collect();
        let depths = sim.batch().read(0, |env| {
            let (data, model) = (env.data(), env.data().model());
            let contacts = data.contact();
            assert_eq!(contacts.len(), 4);
            legs.iter()
                .zip(&forces)
                .map(|(leg, force)| {
                    let bodies = |geom: i32| model.geom_bodyid()[geom as usize] as usize;
                    let is_its = |body: &usize| model.name(ObjectKind::Body, *body).is_some_and(|n| n.starts_with(leg));
                    let found = contacts
                        .iter()
                        .find_map(|c| Some((c.dist, [c.geom1, c.geom2].map(bodies).into_iter().find(is_its)?)));
                    let (dist, body) = found.unwrap();
                    let expected = depth_at_rest(*force, model.body_invweight0()[2 * body]);
                    // Of the force in the last step, and the depth after it, at 1e-4 m/s at most: 1e-6 m in 1e-2 s.
                    assert!((-dist - expected).abs() < 1e-6, "{leg}: {dist}, not {expected}");
                    expected
                })
                .collect::<Vec<f64>>()
        });
        let robot = sim.robot(id);
        let (pose, velocity) = (robot.get_root_pose(), robot.get_root_velocity());
        Stand { depth: depths.iter().sum::<f64>() / 4.0, height: pose[(0, 2)], sinks: -velocity[(0, 2)] }
    });
    let level = |stand: &Stand| stand.height + stand.depth + stand.sinks * TIME;
    let apart = (level(&urdf) - level(&xml)).abs();
    let allowed = 0.5 * urdf.sinks.max(xml.sinks);
    println!("levels {apart:.1e} m apart, of {allowed:.1e} m; depths {:.3e} m and {:.3e} m", urdf.depth, xml.depth);
    assert!(apart < allowed && urdf.height > 0.4, "{apart} m of {allowed} m");
    // The controls: without the depths, or without what creeps, they would not.
    assert!((urdf.depth - xml.depth).abs() > 5.0 * allowed && (urdf.sinks - xml.sinks).abs() * TIME > 2.0 * allowed);
}
