//! Configurations that cannot be, for every kind of sensor: typed errors that name what there is, and a simulation that goes
//! on as if nothing had been asked.

use crate::sensors::worlds::{cfg, cube};
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::CameraError;
use kinetoscope::sensors::ray::RayError;
use kinetoscope::sensors::ray::pattern::{Bpearl, Custom, Grid, Lidar, Pinhole};
use kinetoscope::sensors::{SensorCfg, SensorError};
use nalgebra::{Quaternion, UnitQuaternion};

/// An arm, a cube, and a pendulum with a sensor of its own.
fn world() -> SimulationManager {
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap();
    sim.add_rigid_object(cube("cube", 1.0, 0.1, [1.0, 0.0, 0.05])).unwrap();
    let pendulum = "<mujoco><worldbody><body name='rod' pos='0 0 1'><joint name='hinge'/><geom size='.1'/></body></worldbody>
        <actuator><motor name='motor' joint='hinge'/></actuator><sensor><jointpos name='angle' joint='hinge'/></sensor></mujoco>";
    sim.add_mjcf(MjcfCfg::text("m", pendulum)).unwrap();
    sim
}

/// Why a simulation refuses a sensor; it must name the sensor, and have none afterwards.
#[track_caller]
fn refused<C: SensorCfg + Clone + Send + 'static>(sim: &mut SimulationManager, cfg: &C) -> SensorError {
    let error = sim.add_sensor("mine", cfg.clone()).map(|_| ()).unwrap_err();
    let text = error.to_string();
    assert!(text.starts_with("sensor \"mine\": "), "{text}");
    println!("{text}");
    let Error::Sensor { error, .. } = error else { panic!("{error:?}") };
    *error
}

/// The name is not known; what is near is named.
#[track_caller]
fn names<C: SensorCfg + Clone + Send + 'static>(sim: &mut SimulationManager, cfg: &C, wrong: &str, near: &str) {
    match refused(sim, cfg) {
        SensorError::UnknownName { name, candidates, .. } => {
            assert_eq!(name, wrong);
            assert!(candidates.iter().any(|name| name == near), "{candidates:?}");
        }
        other => panic!("{other:?}"),
    }
}

fn rays(pattern: impl Into<RayPattern>) -> RayCasterCfg {
    RayCasterCfg { pattern: pattern.into(), ..Default::default() }
}

fn eye(extrinsics: Extrinsics) -> (CameraCfg, RayCasterCameraCfg) {
    let camera = CameraCfg { width: 8, height: 8, extrinsics: extrinsics.clone(), ..Default::default() };
    (camera, RayCasterCameraCfg { width: 8, height: 8, extrinsics, ..Default::default() })
}

#[test]
fn patterns_that_match_nothing_and_unknown_frames() {
    let sim = &mut world();
    let one = |name: &str| vec![name.to_string()];
    names(sim, &ContactSensorCfg::of("arm/lnk6"), "arm/lnk6", "arm/link6");
    names(sim, &ContactSensorCfg::of(".*_FOOT"), ".*_FOOT", "cube");
    names(sim, &ContactSensorCfg { filters: one("cub"), ..ContactSensorCfg::of("link6") }, "cub", "cube");
    names(sim, &ImuCfg::on("lnk6"), "lnk6", "arm/link6");
    names(sim, &FrameTransformerCfg::from("lnk6", vec![TargetFrameCfg::of("cube")]), "lnk6", "arm/link6");
    names(sim, &FrameTransformerCfg::from("link6", vec![TargetFrameCfg::of("cub")]), "cub", "cube");
    names(sim, &JointStateCfg { joints: Some(one("JOIN1")), ..Default::default() }, "JOIN1", "JOINT1");
    names(sim, &ActuatorStateCfg { actuators: Some(one("mtor")), ..Default::default() }, "mtor", "motor");
    names(sim, &JointWrenchCfg { links: one("lnk6"), ..Default::default() }, "lnk6", "link6");
    names(sim, &JointWrenchCfg { frames: one("lnk6"), ..Default::default() }, "lnk6", "link6");
    names(sim, &MujocoSensorCfg { sensors: Some(one("angl")), ..Default::default() }, "angl", "angle");
    names(sim, &RayCasterCfg { parent: Some("lnk6".into()), ..Default::default() }, "lnk6", "arm/link6");
    names(sim, &RayCasterCfg { targets: HitTargets::Named(one("grund")), ..Default::default() }, "grund", "ground");
    let targets = HitTargets::Named(one("grund"));
    names(sim, &RayCasterCameraCfg { targets, ..Default::default() }, "grund", "ground");
    let (camera, of_rays) = eye(Extrinsics { parent: Some("lnk6".into()), ..Default::default() });
    names(sim, &camera, "lnk6", "arm/link6");
    names(sim, &of_rays, "lnk6", "arm/link6");
    // Two bodies of the name, and what is no pattern at all.
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { uid: "other".into(), urdf, ..Default::default() }).unwrap();
    let found = refused(sim, &ImuCfg::on("link6"));
    assert!(
        matches!(&found, SensorError::AmbiguousName { candidates, .. } if *candidates == ["arm/link6", "other/link6"]),
        "{found:?}"
    );
    for pattern in ["(", "(?=a)b"] {
        assert!(matches!(refused(sim, &ContactSensorCfg::of(pattern)), SensorError::Pattern(_)));
    }
    assert!(sim.add_sensor("mine", ImuCfg::on("arm/link6")).is_ok(), "the name is still free");
}

#[test]
fn a_sensor_of_nothing_is_refused() {
    let sim = &mut world();
    assert!(
        matches!(refused(sim, &ContactSensorCfg::default()), SensorError::NoBodies { candidates } if candidates.contains(&"cube".to_string()))
    );
    let nothing = |error: SensorError, name: &str| {
        let SensorError::NothingChosen { candidates, .. } = &error else { panic!("{error:?}") };
        assert!(candidates.iter().any(|candidate| candidate == name), "{error}");
    };
    nothing(refused(sim, &FrameTransformerCfg::from("cube", Vec::new())), "cube");
    nothing(refused(sim, &JointWrenchCfg::default()), "arm/link6");
    nothing(refused(sim, &JointStateCfg { joints: Some(Vec::new()), ..Default::default() }), "arm/JOINT1");
    nothing(refused(sim, &ActuatorStateCfg { actuators: Some(Vec::new()), ..Default::default() }), "m/motor");
    nothing(refused(sim, &MujocoSensorCfg { sensors: Some(Vec::new()), ..Default::default() }), "m/angle");
    // Rays that can hit nothing would read as misses for ever.
    let targets = || HitTargets::Named(Vec::new());
    nothing(refused(sim, &RayCasterCfg { targets: targets(), ..Default::default() }), "ground");
    nothing(refused(sim, &RayCasterCameraCfg { targets: targets(), ..Default::default() }), "ground");
}

/// The error of a body that is watched and its own filter.
#[test]
fn a_body_is_no_filter_of_itself() {
    let sim = &mut world();
    for filter in ["cube", "cub.", "{ENV}/cube"] {
        let watch = ContactSensorCfg { filters: vec![filter.into()], ..ContactSensorCfg::of("cube") };
        let error = refused(sim, &watch);
        assert!(matches!(&error, SensorError::OwnFilter { body, .. } if body == "cube"), "{error:?}");
    }
    let friction = ContactSensorCfg { track_friction_forces: true, ..ContactSensorCfg::of("cube") };
    assert!(matches!(refused(sim, &friction), SensorError::NoFilters { .. }));
    let threshold = ContactSensorCfg { force_threshold: -1.0, ..ContactSensorCfg::of("cube") };
    assert!(matches!(refused(sim, &threshold), SensorError::OutOfRange { .. }));
}

#[test]
fn rays_that_make_no_sense() {
    let sim = &mut world();
    for bad in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let grid = Grid { resolution: bad, ..Default::default() };
        let lidar = Lidar { horizontal_resolution_deg: bad, ..Default::default() };
        let bpearl = Bpearl { horizontal_resolution_deg: bad, ..Default::default() };
        for pattern in [grid.into(), lidar.into(), RayPattern::from(bpearl)] {
            let error = refused(sim, &rays(pattern));
            assert!(matches!(error, SensorError::Ray(RayError::Number { .. })), "{bad}: {error:?}");
        }
    }
    let grid = |resolution, size| Grid { resolution, size, ..Default::default() };
    let counts: [RayPattern; 5] = [
        grid(1e-9, [1.0; 2]).into(),
        grid(1e-4, [1.0; 2]).into(),
        Lidar { channels: 0, ..Default::default() }.into(),
        Pinhole { width: 0, ..Default::default() }.into(),
        Custom::default().into(),
    ];
    for pattern in counts {
        assert!(matches!(refused(sim, &rays(pattern)), SensorError::Ray(RayError::Count { .. })));
    }
    for size in [[-1.0, 1.0], [1.0, f64::NAN]] {
        assert!(matches!(refused(sim, &rays(grid(0.1, size))), SensorError::Ray(RayError::Number { .. })));
    }
    let uneven = Custom { starts: vec![[0.0; 3]], directions: Vec::new() };
    assert!(matches!(refused(sim, &rays(uneven)), SensorError::Ray(RayError::Lengths { starts: 1, directions: 0 })));
    for (start, direction) in [([0.0; 3], [0.0; 3]), ([f64::NAN; 3], [1.0; 3]), ([0.0; 3], [f64::INFINITY; 3])] {
        let custom = Custom { starts: vec![start], directions: vec![direction] };
        assert!(matches!(refused(sim, &rays(custom)), SensorError::Ray(RayError::Ray { ray: 0, .. })));
    }
    for max_distance in [0.0, -1.0, f64::NAN] {
        let of_rays = RayCasterCameraCfg { max_distance, ..Default::default() };
        for error in [refused(sim, &RayCasterCfg { max_distance, ..Default::default() }), refused(sim, &of_rays)] {
            assert!(matches!(error, SensorError::Ray(RayError::Number { what: "max_distance", .. })), "{error:?}");
        }
    }
    for drift in [[1.0, 0.0], [f64::NAN, 0.0], [0.0, f64::INFINITY]] {
        let error = refused(sim, &RayCasterCfg { drift, ..Default::default() });
        assert!(matches!(error, SensorError::Ray(RayError::Number { .. })), "{error:?}");
    }
}

/// Offsets with a number that is none, and those whose rotation turns nothing.
#[test]
fn offsets_that_are_no_poses() {
    let sim = &mut world();
    let rotated =
        |w, x| Pose::from_parts(Default::default(), UnitQuaternion::new_unchecked(Quaternion::new(w, x, 0.0, 0.0)));
    let bad = [
        Pose::translation(f64::NAN, 0.0, 0.0),
        Pose::translation(0.0, f64::INFINITY, 0.0),
        rotated(f64::NAN, 0.0),
        rotated(0.0, 0.0),
        rotated(1.0, 1.0),
    ];
    for (k, offset) in bad.into_iter().enumerate() {
        let of_target = TargetFrameCfg { offset, ..TargetFrameCfg::of("cube") };
        let frames = FrameTransformerCfg::from("cube", vec![TargetFrameCfg::of("cube")]);
        let errors = [
            refused(sim, &ImuCfg { offset, ..ImuCfg::on("cube") }),
            refused(sim, &FrameTransformerCfg { source_offset: offset, ..frames.clone() }),
            refused(sim, &FrameTransformerCfg { targets: vec![of_target], ..frames }),
            refused(sim, &RayCasterCfg { offset, ..Default::default() }),
        ];
        for error in errors {
            let typed = matches!(error, SensorError::OutOfRange { .. } | SensorError::Ray(RayError::Number { .. }));
            assert!(typed, "{offset:?}: {error:?}");
        }
        // Cameras normalise what has a direction.
        if k == 4 {
            continue;
        }
        let pos = offset.translation.vector.into();
        let (camera, of_rays) =
            eye(Extrinsics { placement: Placement::Pose { pos, rotation: offset.rotation }, ..Default::default() });
        for error in [refused(sim, &camera), refused(sim, &of_rays)] {
            assert!(matches!(error, SensorError::Camera(CameraError::Pose { .. })), "{offset:?}: {error:?}");
        }
    }
    let gravity_bias = Some([0.0, f64::NAN, 0.0].into());
    assert!(matches!(refused(sim, &ImuCfg { gravity_bias, ..ImuCfg::on("cube") }), SensorError::OutOfRange { .. }));
}

/// All kinds with one sampling, and the camera with its period.
fn with_sampling(sim: &mut SimulationManager, sampling: &SamplingCfg) -> Vec<SensorError> {
    let sampling = || sampling.clone();
    let frames = FrameTransformerCfg::from("cube", vec![TargetFrameCfg::of("cube")]);
    vec![
        refused(sim, &ContactSensorCfg { sampling: sampling(), ..ContactSensorCfg::of("cube") }),
        refused(sim, &ImuCfg { sampling: sampling(), ..ImuCfg::on("cube") }),
        refused(sim, &FrameTransformerCfg { sampling: sampling(), ..frames }),
        refused(sim, &JointStateCfg { sampling: sampling(), ..Default::default() }),
        refused(sim, &ActuatorStateCfg { sampling: sampling(), ..Default::default() }),
        refused(sim, &JointWrenchCfg { links: vec!["link6".into()], sampling: sampling(), ..Default::default() }),
        refused(sim, &MujocoSensorCfg { sampling: sampling(), ..Default::default() }),
        refused(sim, &RayCasterCfg { sampling: sampling(), ..Default::default() }),
        refused(sim, &RayCasterCameraCfg { sampling: sampling(), ..Default::default() }),
    ]
}

#[test]
fn samplings_that_cannot_be() {
    let sim = &mut world();
    // Steps of 5 ms.
    for (period, whole) in
        [(0.012, Some(0.01)), (0.001, Some(0.005)), (-0.01, None), (f64::NAN, None), (f64::INFINITY, None)]
    {
        let mut errors = with_sampling(sim, &SamplingCfg::every(period));
        errors.push(refused(sim, &CameraCfg { update_period: period, ..Default::default() }));
        for error in errors {
            match (&error, whole) {
                (SensorError::PeriodNotMultiple { nearest, .. }, Some(whole)) => {
                    assert!((nearest - whole).abs() < 1e-12)
                }
                (SensorError::InvalidPeriod { .. }, None) => {}
                _ => panic!("{period}: {error:?}"),
            }
        }
    }
    // A history cannot be negative here; in a file its line says so. One that no memory holds is refused before it is asked for.
    for (history_length, latency_steps) in [(usize::MAX, 0), (0, u32::MAX), (1 << 40, 7)] {
        for error in with_sampling(sim, &SamplingCfg { history_length, latency_steps, ..Default::default() }) {
            assert!(matches!(error, SensorError::TooLarge { .. }), "{error:?}");
        }
    }
    for dropout in [-0.1, 1.1, f64::NAN] {
        for error in with_sampling(sim, &SamplingCfg { dropout, ..Default::default() }) {
            assert!(matches!(error, SensorError::OutOfRange { .. }), "{error:?}");
        }
    }
    let noise = [("no_such_channel".to_string(), NoiseCfg::white(0.1))].into();
    for error in with_sampling(sim, &SamplingCfg { noise, ..Default::default() }) {
        assert!(matches!(&error, SensorError::UnknownName { candidates, .. } if !candidates.is_empty()), "{error:?}");
    }
    for std in [-1.0, f64::NAN, f64::INFINITY] {
        let noise = [("net_forces_w".to_string(), NoiseCfg::white(std))].into();
        let sampling = SamplingCfg { noise, ..Default::default() };
        let error = refused(sim, &ContactSensorCfg { sampling, ..ContactSensorCfg::of("cube") });
        assert!(matches!(error, SensorError::OutOfRange { .. }), "{error:?}");
    }
    // All that was refused left nothing behind: the same simulation as one that nobody asked.
    let mut other = world();
    for sim in [&mut *sim, &mut other] {
        sim.update(50);
    }
    let [cube, arm] = [&*sim, &other].map(|sim| {
        let arm = sim.robot_id("arm").unwrap();
        (sim.rigid_object(sim.rigid_object_id("cube").unwrap()).get_pose(), sim.robot(arm).get_qpos())
    });
    assert_eq!(cube, arm);
}

/// A history below zero, in a file.
#[test]
fn a_negative_history_is_named_with_its_line() {
    for kind in ["contact_sensor", "imu", "joint_state", "ray_caster", "ray_caster_camera"] {
        let text = format!("[entities.s]\ntype = \"{kind}\"\n\n[entities.s.sampling]\nhistory_length = -1");
        let error = SceneCfg::from_toml(&text, "scene.toml", &EntityTypes::default()).unwrap_err().to_string();
        assert!(error.starts_with("scene.toml:5: ") && error.contains("-1"), "{error}");
    }
}
