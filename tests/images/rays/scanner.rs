//! The sensor in a simulation.

use crate::rays::judge::{EXACT, GROUPS};
use kinetoscope::ndarray::{Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, from_xyz_rpy};
use kinetoscope::sensors::ray::pattern::{Grid, Lidar};

/// A box that tumbles over a static wall and a ball, elsewhere in every environment.
pub(crate) fn tumbling(num_envs: usize, threads: usize) -> (SimulationManager, ObjectId) {
    let cfg = SimulationManagerCfg { num_envs, threads: Some(threads), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let object = |uid: &str, shape, body_type, init_pose| RigidObjectCfg {
        uid: uid.into(),
        shape,
        body_type,
        init_pose,
        ..Default::default()
    };
    let (dynamic, fixed) = (BodyType::Dynamic, BodyType::Static);
    let trunk = object("trunk", ObjectShape::cube(0.3), dynamic, Pose::translation(0.0, 0.0, 1.0));
    let trunk = sim.add_rigid_object(trunk).unwrap();
    let wall = from_xyz_rpy([0.7, 0.1, 0.2], [0.1, 0.2, 0.3]);
    sim.add_rigid_object(object("wall", ObjectShape::cube(0.4), fixed, wall)).unwrap();
    let ball = Pose::translation(-0.5, 0.2, 0.3);
    sim.add_rigid_object(object("ball", ObjectShape::Sphere { radius: 0.15 }, dynamic, ball)).unwrap();
    let poses: Vec<[f64; 7]> = (0..num_envs)
        .map(|env| {
            let k = env as f64;
            let pose = from_xyz_rpy([0.05 * k, -0.03 * k, 1.0], [0.3 + 0.1 * k, -0.2, 0.5 * k]);
            kinetoscope::scene::pose::to_row(&pose)
        })
        .collect();
    sim.rigid_object_mut(trunk).write_pose(&kinetoscope::ndarray::Array2::from(poses), None).unwrap();
    let spin = array![[0.1, 0.0, 0.0, 1.0, -2.0, 3.0]];
    sim.rigid_object_mut(trunk).write_velocity(&spin, None).unwrap();
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

/// 187 rays straight down stay level over a tumbling trunk, and hit the plane exactly.
#[test]
fn a_scan_of_the_ground_is_exact_while_its_carrier_tumbles() {
    let (mut sim, trunk) = tumbling(3, 1);
    let sampling = SamplingCfg::every(0.02);
    let cfg = RayCasterCfg { sampling, ..height_scanner(HitTargets::Named(vec!["ground".into()])) };
    let id = sim.add_sensor("scanner", cfg).unwrap();
    for _ in 0..10 {
        sim.update(2);
        let poses = sim.rigid_object(trunk).get_pose();
        let scan = sim.sensor(id).unwrap();
        assert_eq!(scan.hits().dim(), (3, 187, 3));
        for env in 0..3 {
            let pose = from_row(&std::array::from_fn(|k| poses[(env, k)]));
            let x = pose.rotation * nalgebra::Vector3::x();
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
        assert!(
            scan.hit_mask().iter().all(|hit| *hit) && scan.hit_ids().iter().all(|id| *id == scan.hit_ids()[(0, 0)])
        );
    }
    assert_eq!(sim.sensor(id).unwrap().sample_counts(), array![10, 10, 10]);
    let ground = sim.mask_ids().iter().find(|id| id.object == "ground").unwrap().id;
    assert_eq!(sim.sensor(id).unwrap().hit_ids()[(0, 0)], ground);
}

/// A lidar on the tumbling trunk measures in every environment what `mj_ray` measures there.
#[test]
fn a_lidar_measures_what_mujoco_measures() {
    let (mut sim, trunk) = tumbling(3, 1);
    let cfg = RayCasterCfg {
        offset: from_xyz_rpy([0.0, 0.0, 0.4], [0.2, 0.1, 0.0]),
        alignment: RayAlignment::Base,
        pattern: Lidar {
            channels: 8,
            vertical_fov_deg: [-60.0, 30.0],
            horizontal_resolution_deg: 5.0,
            ..Lidar::default()
        }
        .into(),
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
                let row = |a: &kinetoscope::ndarray::Array3<f64>| [0, 1, 2].map(|axis| a[(env, k, axis)]);
                let theirs =
                    sim.batch().read(env, |env| env.data().ray(row(&starts), row(&directions), GROUPS).unwrap());
                let distance = lidar.distances()[(env, k)];
                match theirs {
                    None => {
                        misses += 1;
                        assert_eq!(distance, f64::INFINITY);
                    }
                    Some(hit) => {
                        hits += 1;
                        selves += usize::from(lidar.hit_ids()[(env, k)] == own);
                        assert!((distance - hit.distance).abs() < EXACT, "{env} {k}: {distance} {}", hit.distance);
                    }
                }
            }
        }
    }
    assert!(hits > 1000 && misses > 1000 && selves > 100, "{hits} {misses} {selves}");
}

#[test]
fn environments_are_alone_and_threads_change_nothing() {
    let run = |threads, moved: bool| {
        let (mut sim, trunk) = tumbling(5, threads);
        let pattern = Lidar { channels: 16, horizontal_resolution_deg: 1.0, ..Lidar::default() }.into();
        let cfg = RayCasterCfg { pattern, ..height_scanner(HitTargets::default()) };
        let offset = Pose::translation(0.0, 0.0, 0.2);
        let id = sim.add_sensor("lidar", RayCasterCfg { offset, ..cfg }).unwrap();
        sim.update(5);
        if moved {
            let there = array![[0.0, 0.1, 2.0, 1.0, 0.0, 0.0, 0.0]];
            sim.rigid_object_mut(trunk).write_pose(&there, Some(&[EnvId(2)])).unwrap();
        }
        sim.update(20);
        let lidar = sim.sensor(id).unwrap();
        let own = sim.rigid_object(trunk).mask_id();
        assert!(lidar.hit_ids().iter().all(|id| *id != own), "the trunk does not see itself");
        let bits = |env| -> Vec<u64> {
            let all = [lidar.hits().into_dyn(), lidar.normals().into_dyn(), lidar.distances().into_dyn()];
            all.iter()
                .flat_map(|a| a.index_axis(Axis(0), env).iter().map(|x| x.to_bits()).collect::<Vec<_>>())
                .collect()
        };
        (0..5).map(bits).collect::<Vec<_>>()
    };
    let one = run(1, false);
    assert_eq!(one, run(4, false), "28800 rays are worth several threads");
    let other = run(1, true);
    for env in 0..5 {
        assert_eq!(one[env] == other[env], env != 2, "environment {env}");
    }
}

/// On a robot: a lidar on a link that is fused to another does not see what carries it, but the rest of the robot.
#[test]
fn a_robot_sees_itself_but_not_what_carries_the_sensor() {
    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { uid: "sr5".into(), urdf, ..Default::default() }).unwrap();
    let seen = |sim: &mut SimulationManager, uid: &str, exclude_parent: bool| {
        let cfg = RayCasterCfg {
            parent: Some("ee_link".into()),
            pattern: Lidar {
                channels: 31,
                vertical_fov_deg: [-90.0, 90.0],
                horizontal_resolution_deg: 4.0,
                ..Lidar::default()
            }
            .into(),
            targets: HitTargets::Everything { exclude_parent },
            ..RayCasterCfg::default()
        };
        let id = sim.add_sensor(uid, cfg).unwrap();
        let ids: std::collections::BTreeSet<i32> = sim.sensor(id).unwrap().hit_ids().iter().copied().collect();
        let link =
            |id: &i32| sim.mask_ids().iter().find(|m| m.id == *id).map(|m| m.link.clone().unwrap_or(m.object.clone()));
        ids.iter().filter_map(link).collect::<Vec<String>>()
    };
    let (all, others) = (seen(&mut sim, "all", false), seen(&mut sim, "others", true));
    println!("{all:?} {others:?}");
    assert!(others.contains(&"ground".to_string()) && others.len() >= 2, "{others:?}");
    let carrier: Vec<&String> = all.iter().filter(|name| !others.contains(name)).collect();
    assert!(!carrier.is_empty(), "the link under the sensor is seen only where it is not left out: {all:?} {others:?}");
}

/// Two ways to the same picture: the rasterizer and one ray per pixel, off silhouettes.
#[test]
fn a_camera_of_rays_sees_what_the_rasterizer_draws() {
    let (mut sim, _) = tumbling(2, 1);
    let extrinsics = Extrinsics {
        placement: Placement::LookAt { eye: [-1.5, 1.0, 1.4], target: [0.1, 0.0, 0.5], up: [0.0, 0.0, 1.0] },
        ..Extrinsics::default()
    };
    let intrinsics = Intrinsics::Fovy { radians: 0.9 };
    let (width, height) = (160, 120);
    let rays = RayCasterCameraCfg { width, height, intrinsics, extrinsics: extrinsics.clone(), ..Default::default() };
    let channels = Channels::from_names(&["depth", "mask", "normal"]).unwrap();
    let camera = CameraCfg { width, height, intrinsics, extrinsics, channels, ..Default::default() };
    let (rays, camera) = (sim.add_sensor("rays", rays).unwrap(), sim.add_sensor("camera", camera).unwrap());
    sim.update(9);
    let (rays, camera) = (sim.sensor(rays).unwrap(), sim.sensor(camera).unwrap());
    let (mask, depth, normal) = (camera.mask().unwrap(), camera.depth().unwrap(), camera.normal().unwrap());
    let (mut differing, mut compared) = (0, 0);
    for (at, id) in rays.mask().indexed_iter() {
        // Beyond the camera's far plane of 100 m there is still ground.
        if rays.depth()[at] > 99.0 {
            continue;
        }
        compared += 1;
        let close = (rays.depth()[at] / depth[at] - 1.0).abs() < 1e-4;
        let same_normal = (0..3)
            .map(|k| (rays.normal()[(at.0, at.1, at.2, k)] - normal[(at.0, at.1, at.2, k)]).abs())
            .all(|error| error < 1e-3);
        differing += usize::from(*id != mask[at] || !close || !same_normal);
    }
    println!("{differing} of {compared} pixels differ");
    // The outlines of a box, a wall and a ball: coverage of the rasterizer is snapped to 1/256 pixel or so.
    assert!(compared > 30_000 && differing < 40, "{differing} of {compared} pixels differ");
    assert!(rays.mask().iter().collect::<std::collections::BTreeSet<_>>().len() >= 4, "ground, trunk, wall, ball");
}
