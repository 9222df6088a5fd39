//! Ray casters on moving bodies.

use crate::rays::mujoco_rays::{DISTANCE_TOLERANCE, GROUPS};
use kinetoscope::ndarray::{Array2, Array3, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_xyz_rpy, to_row};
use kinetoscope::sensors::ray::pattern::{Grid, Lidar};
use kinetoscope::sensors::ray::{HitTargets, RayAlignment};
use kinetoscope::sim::RigidObjectId;
use kinetoscope_testkit::worlds::{cfg, fixed, mask_id, object, pose_of_row, sr5};

/// A box that tumbles over a static wall and a ball, at another pose in every environment.
pub(crate) fn tumbling_box(num_envs: usize, threads: usize) -> (SimulationManager, RigidObjectId) {
    let mut sim = kinetoscope_testkit::worlds::sim(cfg(num_envs, threads));
    let trunk = sim.add_rigid_object(object("trunk", ObjectShape::cube(0.3), [0.0, 0.0, 1.0])).unwrap();
    let wall = fixed(object("wall", ObjectShape::cube(0.4), [0.0; 3]));
    let init_pose = from_xyz_rpy([0.7, 0.1, 0.2], [0.1, 0.2, 0.3]);
    sim.add_rigid_object(RigidObjectCfg { init_pose, ..wall }).unwrap();
    sim.add_rigid_object(object("ball", ObjectShape::Sphere { radius: 0.15 }, [-0.5, 0.2, 0.3])).unwrap();
    let pose = |k: f64| to_row(&from_xyz_rpy([0.05 * k, -0.03 * k, 1.0], [0.3 + 0.1 * k, -0.2, 0.5 * k]));
    let poses: Vec<[f64; 7]> = (0..num_envs).map(|env| pose(env as f64)).collect();
    sim.rigid_object_mut(trunk).write_pose(&Array2::from(poses), None).unwrap();
    sim.rigid_object_mut(trunk).write_velocity(&array![[0.1, 0.0, 0.0, 1.0, -2.0, 3.0]], None).unwrap();
    (sim, trunk)
}

fn height_scanner(targets: HitTargets) -> RayCasterCfg {
    RayCasterCfg {
        parent: Some("trunk".into()),
        offset: Pose::translation(0.0, 0.0, 20.0),
        alignment: RayAlignment::Yaw,
        pattern: Grid { resolution: 0.1, size: [1.6, 1.0], ..Grid::default() }.into(),
        targets,
        ..RayCasterCfg::default()
    }
}

/// 187 vertical rays keep their direction on a tumbling body, and hit the plane exactly.
#[test]
fn height_scan() {
    let (mut sim, trunk) = tumbling_box(3, 1);
    let sampling = SamplingCfg::every(0.02);
    let cfg = RayCasterCfg { sampling, ..height_scanner(HitTargets::Named(vec!["ground".into()])) };
    let id = sim.add_sensor("scanner", cfg).unwrap();
    for _ in 0..10 {
        sim.update(2);
        let poses = sim.rigid_object(trunk).pose();
        let scan = sim.sensor(id).unwrap();
        assert_eq!(scan.hits().dim(), (3, 187, 3));
        for env in 0..3 {
            let x = pose_of_row(&poses, env).rotation * nalgebra::Vector3::x();
            // The yaw of a body is that of its x axis.
            let (cos, sin) = (x.x / x.x.hypot(x.y), x.y / x.x.hypot(x.y));
            for k in 0..187 {
                let (u, v) = (-0.8 + 0.1 * (k % 17) as f64, -0.5 + 0.1 * (k / 17) as f64);
                let expected = [poses[(env, 0)] + u * cos - v * sin, poses[(env, 1)] + u * sin + v * cos, 0.0];
                for (axis, expected) in expected.into_iter().enumerate() {
                    assert!((scan.hits()[(env, k, axis)] - expected).abs() < 1e-12, "{env} {k} {axis}");
                }
                assert!((scan.distances()[(env, k)] - poses[(env, 2)] - 20.0).abs() < 1e-12);
            }
        }
        let ground = mask_id(&sim, "ground");
        assert!(scan.hit_mask().iter().all(|hit| *hit) && scan.hit_ids().iter().all(|id| *id == ground));
    }
    assert_eq!(sim.sensor(id).unwrap().sample_counts(), array![10, 10, 10]);
}

/// A lidar on the tumbling body agrees with `mj_ray` in every environment.
#[test]
fn lidar() {
    let (mut sim, trunk) = tumbling_box(3, 1);
    let fov =
        Lidar { channels: 8, vertical_fov_deg: [-60.0, 30.0], horizontal_resolution_deg: 5.0, ..Lidar::default() };
    let cfg = RayCasterCfg {
        offset: from_xyz_rpy([0.0, 0.0, 0.4], [0.2, 0.1, 0.0]),
        alignment: RayAlignment::Base,
        pattern: fov.into(),
        ..height_scanner(HitTargets::Everything { exclude_parent: false })
    };
    let id = sim.add_sensor("lidar", cfg).unwrap();
    let own = sim.rigid_object(trunk).mask_id();
    let (mut hits, mut misses, mut selves) = (0, 0, 0);
    for _ in 0..5 {
        sim.update(7);
        let lidar = sim.sensor(id).unwrap();
        let (starts, directions) = (lidar.ray_starts(), lidar.ray_directions());
        for env in 0..3 {
            for k in 0..lidar.num_rays() {
                let row = |a: &Array3<f64>| [0, 1, 2].map(|axis| a[(env, k, axis)]);
                let (start, direction) = (row(&starts), row(&directions));
                let distance = lidar.distances()[(env, k)];
                match sim.batch().read(env, |env| env.data().ray(start, direction, GROUPS).unwrap()) {
                    None => {
                        misses += 1;
                        assert_eq!(distance, f64::INFINITY);
                    }
                    Some(hit) => {
                        hits += 1;
                        selves += usize::from(lidar.hit_ids()[(env, k)] == own);
                        assert!(
                            (distance - hit.distance).abs() < DISTANCE_TOLERANCE,
                            "{env} {k}: {distance} {}",
                            hit.distance
                        );
                    }
                }
            }
        }
    }
    assert!(hits > 1000 && misses > 1000 && selves > 100, "{hits} {misses} {selves}");
}

/// A lidar on a fused link excludes the body that carries it, but sees the rest of the robot.
#[test]
fn carrier() {
    let mut sim = kinetoscope_testkit::worlds::sim(cfg(1, 1));
    sim.add_robot(sr5("sr5")).unwrap();
    let [all, others] = [false, true].map(|exclude_parent| {
        let vertical_fov_deg = [-90.0, 90.0];
        let fov = Lidar { channels: 31, vertical_fov_deg, horizontal_resolution_deg: 4.0, ..Lidar::default() };
        let cfg = RayCasterCfg {
            parent: Some("ee_link".into()),
            pattern: fov.into(),
            targets: HitTargets::Everything { exclude_parent },
            ..RayCasterCfg::default()
        };
        let id = sim.add_sensor(format!("lidar {exclude_parent}"), cfg).unwrap();
        let ids: std::collections::BTreeSet<i32> = sim.sensor(id).unwrap().hit_ids().iter().copied().collect();
        let seen = sim.scene().mask_ids().iter().filter(|mask| ids.contains(&mask.id));
        seen.map(|mask| mask.link.clone().unwrap_or(mask.object.clone())).collect::<Vec<String>>()
    });
    assert!(others.contains(&"ground".to_string()) && others.len() >= 2, "{others:?}");
    assert!(all.iter().any(|name| !others.contains(name)), "the carrier is seen unless excluded: {all:?} {others:?}");
}
