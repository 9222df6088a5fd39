//! Wrong configurations of every type of sensor: typed errors that list the candidates, without a change of the
//! simulation.

use super::worlds::{cube, sim, sr5};
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::CameraError;
use kinetoscope::sensors::ray::pattern::{Bpearl, Custom, Grid, Lidar, Pinhole};
use kinetoscope::sensors::ray::{HitTargets, RayCasterCameraCfg, RayError};
use kinetoscope::sensors::{
    ActuatorStateCfg, FrameTransformerCfg, JointStateCfg, JointWrenchCfg, MujocoSensorCfg, NoiseCfg, SensorCfg,
    SensorError, TargetFrameCfg,
};
use kinetoscope::sim::Error;
use nalgebra::{Quaternion, UnitQuaternion};

const NAN: f64 = f64::NAN;
const INFINITY: f64 = f64::INFINITY;

/// An arm, a cube, and a pendulum with an MJCF sensor.
fn world() -> SimulationManager {
    let mut sim = sim(2);
    sim.add_robot(sr5("arm")).unwrap();
    sim.add_rigid_object(cube("cube", 0.1, 1.0, [1.0, 0.0, 0.05])).unwrap();
    let pendulum = "<mujoco><worldbody><body name='rod' pos='0 0 1'><joint name='hinge'/><geom size='.1'/></body></worldbody>
        <actuator><motor name='motor' joint='hinge'/></actuator><sensor><jointpos name='angle' joint='hinge'/></sensor></mujoco>";
    sim.add_mjcf(MjcfPartCfg::text("m", pendulum)).unwrap();
    sim
}

/// Returns the error of a rejected sensor; the error names the sensor.
#[track_caller]
fn rejected<C: SensorCfg + Clone + Send + 'static>(sim: &mut SimulationManager, cfg: &C) -> SensorError {
    let error = sim.add_sensor("mine", cfg.clone()).map(|_| ()).unwrap_err();
    let text = error.to_string();
    assert!(text.starts_with("sensor \"mine\": "), "{text}");
    let Error::Sensor { error, .. } = error else { panic!("{error:?}") };
    *error
}

/// Asserts that each configuration is rejected with an error of the pattern.
macro_rules! refuses {
    ($sim:expr, $pattern:pat if $guard:expr => $cfg:expr) => {
        let error = rejected($sim, &$cfg);
        assert!(matches!(&error, $pattern if $guard), "{}: {error:?}", stringify!($cfg));
    };
    ($sim:expr, $pattern:pat => $($cfg:expr),+ $(,)?) => {
        $(refuses!($sim, $pattern if true => $cfg);)+
    };
}

/// Asserts that each configuration is rejected for an unknown name, with a candidate.
macro_rules! unknown {
    ($sim:expr, $(($cfg:expr, $wrong:expr, $near:expr)),+ $(,)?) => {
        $(
            refuses!($sim, SensorError::UnknownName { name, candidates, .. }
                if name == $wrong && candidates.iter().any(|name| name == $near) => $cfg);
        )+
    };
}

/// Asserts that each configuration is rejected for an empty selection, with the field and a candidate.
macro_rules! nothing {
    ($sim:expr, $(($cfg:expr, $chosen:expr, $near:expr)),+ $(,)?) => {
        $(
            refuses!($sim, SensorError::EmptySelection { field, candidates, .. }
                if *field == $chosen && candidates.iter().any(|name| name == $near) => $cfg);
        )+
    };
}

fn rays(pattern: impl Into<RayPattern>) -> RayCasterCfg {
    RayCasterCfg { pattern: pattern.into(), ..Default::default() }
}

fn wrench(links: &[&str], frames: &[&str]) -> JointWrenchCfg {
    let [links, frames] = [links, frames].map(|names| names.iter().map(|name| (*name).into()).collect());
    JointWrenchCfg { links, frames, ..Default::default() }
}

fn frames(source: &str, targets: &[&str]) -> FrameTransformerCfg {
    FrameTransformerCfg::new(source, targets.iter().map(|target| TargetFrameCfg::for_bodies(*target)).collect())
}

/// A raster camera and a ray-cast camera.
fn cameras(extrinsics: Extrinsics) -> (CameraCfg, RayCasterCameraCfg) {
    let camera = CameraCfg { width: 8, height: 8, extrinsics: extrinsics.clone(), ..Default::default() };
    (camera, RayCasterCameraCfg { width: 8, height: 8, extrinsics, ..Default::default() })
}

#[test]
fn names() {
    let sim = &mut world();
    let one = |name: &str| vec![name.to_string()];
    let some = |name: &str| Some(vec![name.to_string()]);
    let targets = || HitTargets::Named(vec!["grund".into()]);
    let (camera, of_rays) = cameras(Extrinsics { parent: Some("lnk6".into()), ..Default::default() });
    unknown!(
        sim,
        (ContactSensorCfg::for_bodies("arm/lnk6"), "arm/lnk6", "arm/link6"),
        (ContactSensorCfg::for_bodies(".*_FOOT"), ".*_FOOT", "cube"),
        (ContactSensorCfg { filters: one("cub"), ..ContactSensorCfg::for_bodies("link6") }, "cub", "cube"),
        (ImuCfg::on("lnk6"), "lnk6", "arm/link6"),
        (frames("lnk6", &["cube"]), "lnk6", "arm/link6"),
        (frames("link6", &["cub"]), "cub", "cube"),
        (JointStateCfg { joints: some("JOIN1"), ..Default::default() }, "JOIN1", "JOINT1"),
        (ActuatorStateCfg { actuators: some("mtor"), ..Default::default() }, "mtor", "motor"),
        (wrench(&["lnk6"], &[]), "lnk6", "link6"),
        (wrench(&[], &["lnk6"]), "lnk6", "link6"),
        (MujocoSensorCfg { sensors: some("angl"), ..Default::default() }, "angl", "angle"),
        (RayCasterCfg { parent: Some("lnk6".into()), ..Default::default() }, "lnk6", "arm/link6"),
        (RayCasterCfg { targets: targets(), ..Default::default() }, "grund", "ground"),
        (RayCasterCameraCfg { targets: targets(), ..Default::default() }, "grund", "ground"),
        (camera, "lnk6", "arm/link6"),
        (of_rays, "lnk6", "arm/link6"),
    );
    // The message texts of two errors.
    let text = rejected(sim, &JointStateCfg { joints: some("JOINT7"), ..Default::default() }).to_string();
    assert!(text.contains("unknown joint \"JOINT7\"") && text.contains("JOINT6"), "{text}");
    let text = rejected(sim, &frames("cub", &["cube"])).to_string();
    assert!(text.contains("unknown body \"cub\"; known names: \"cube\""), "{text}");
    let same = frames("cube", &["cube", "cube"]);
    refuses!(sim, SensorError::DuplicateName { what: "target frame", name } if name == "cube" => same);
    // A fused link has no joint to measure.
    refuses!(sim, SensorError::FusedLink { link, moving_link } if link == "arm/ee_link" && moving_link == "arm/link6" =>
        wrench(&["ee_link"], &[]));
    // Two bodies of the same name, and invalid patterns.
    sim.add_robot(sr5("other")).unwrap();
    refuses!(sim, SensorError::AmbiguousName { candidates, .. } if *candidates == ["arm/link6", "other/link6"] =>
        ImuCfg::on("link6"));
    refuses!(sim, SensorError::Pattern(_) => ContactSensorCfg::for_bodies("("), ContactSensorCfg::for_bodies("(?=a)b"));
    assert!(sim.add_sensor("mine", ImuCfg::on("arm/link6")).is_ok(), "the name is still free");
    assert!(matches!(sim.add_sensor("mine", JointStateCfg::default()), Err(Error::DuplicateUid(_))));
}

#[test]
fn empty_selections() {
    let sim = &mut world();
    refuses!(sim, SensorError::NoBodies { candidates } if candidates.contains(&"cube".to_string()) =>
        ContactSensorCfg::default());
    // Rays without targets would always read as misses.
    let targets = || HitTargets::Named(Vec::new());
    nothing!(
        sim,
        (frames("cube", &[]), "targets", "cube"),
        (wrench(&[], &[]), "links and frames", "arm/link6"),
        (JointStateCfg { joints: Some(Vec::new()), ..Default::default() }, "joints", "arm/JOINT1"),
        (ActuatorStateCfg { actuators: Some(Vec::new()), ..Default::default() }, "actuators", "m/motor"),
        (MujocoSensorCfg { sensors: Some(Vec::new()), ..Default::default() }, "sensors", "m/angle"),
        (RayCasterCfg { targets: targets(), ..Default::default() }, "targets", "ground"),
        (RayCasterCameraCfg { targets: targets(), ..Default::default() }, "targets", "ground"),
    );
}

#[test]
fn contact_filters() {
    let sim = &mut world();
    let of = || ContactSensorCfg::for_bodies("cube");
    for filter in ["cube", "cub.", "{ENV}/cube"] {
        refuses!(sim, SensorError::SelfFilter { body, .. } if body == "cube" =>
            ContactSensorCfg { filters: vec![filter.into()], ..of() });
    }
    refuses!(sim, SensorError::NoFilters { .. } => ContactSensorCfg { track_friction_forces: true, ..of() });
    refuses!(sim, SensorError::OutOfRange { .. } => ContactSensorCfg { force_threshold: -1.0, ..of() });
}

#[test]
fn numbers_of_rays() {
    let sim = &mut world();
    for bad in [0.0, -0.1, NAN, INFINITY] {
        refuses!(sim, SensorError::Ray(RayError::Number { .. }) =>
            rays(Grid { resolution: bad, ..Default::default() }),
            rays(Lidar { horizontal_resolution_deg: bad, ..Default::default() }),
            rays(Bpearl { horizontal_resolution_deg: bad, ..Default::default() }),
        );
    }
    let grid = |resolution, size| rays(Grid { resolution, size, ..Default::default() });
    refuses!(sim, SensorError::Ray(RayError::Count { .. }) =>
        grid(1e-9, [1.0; 2]),
        grid(1e-4, [1.0; 2]),
        rays(Lidar { channels: 0, ..Default::default() }),
        rays(Pinhole { width: 0, ..Default::default() }),
        rays(Custom::default()),
    );
    let drift = |drift| RayCasterCfg { drift, ..Default::default() };
    refuses!(sim, SensorError::Ray(RayError::Number { .. }) =>
        grid(0.1, [-1.0, 1.0]), grid(0.1, [1.0, NAN]), drift([1.0, 0.0]), drift([NAN, 0.0]), drift([0.0, INFINITY]));
    let custom = |start, directions: &[[f64; 3]]| rays(Custom { starts: vec![start], directions: directions.to_vec() });
    refuses!(sim, SensorError::Ray(RayError::Lengths { starts: 1, directions: 0 }) => custom([0.0; 3], &[]));
    refuses!(sim, SensorError::Ray(RayError::Ray { ray: 0, .. }) =>
        custom([0.0; 3], &[[0.0; 3]]), custom([NAN; 3], &[[1.0; 3]]), custom([0.0; 3], &[[INFINITY; 3]]));
    for max_distance in [0.0, -1.0, NAN] {
        refuses!(sim, SensorError::Ray(RayError::Number { what: "max_distance", .. }) =>
            RayCasterCfg { max_distance, ..Default::default() },
            RayCasterCameraCfg { max_distance, ..Default::default() },
        );
    }
}

/// Offsets with NaN or infinity, and quaternions that are not rotations.
#[test]
fn offsets() {
    let sim = &mut world();
    let rotated =
        |w, x| Pose::from_parts(Default::default(), UnitQuaternion::new_unchecked(Quaternion::new(w, x, 0.0, 0.0)));
    let moved = |x, y| Pose::translation(x, y, 0.0);
    let long = rotated(1.0, 1.0);
    for offset in [moved(NAN, 0.0), moved(0.0, INFINITY), rotated(NAN, 0.0), rotated(0.0, 0.0), long] {
        let of_target = TargetFrameCfg { offset, ..TargetFrameCfg::for_bodies("cube") };
        refuses!(sim, SensorError::OutOfRange { .. } | SensorError::Ray(RayError::Number { .. }) =>
            ImuCfg { offset, ..ImuCfg::on("cube") },
            FrameTransformerCfg { source_offset: offset, ..frames("cube", &["cube"]) },
            FrameTransformerCfg { targets: vec![of_target.clone()], ..frames("cube", &[]) },
            RayCasterCfg { offset, ..Default::default() },
        );
        // Cameras normalize a quaternion that is only too long.
        if offset == long {
            continue;
        }
        let placement = Placement::Pose { pos: offset.translation.vector.into(), rotation: offset.rotation };
        let (camera, of_rays) = cameras(Extrinsics { placement, ..Default::default() });
        refuses!(sim, SensorError::Camera(CameraError::Pose { .. }) => camera, of_rays);
    }
    let gravity_bias = Some([0.0, NAN, 0.0].into());
    refuses!(sim, SensorError::OutOfRange { .. } => ImuCfg { gravity_bias, ..ImuCfg::on("cube") });
}

#[test]
fn numbers_of_cameras() {
    let sim = &mut world();
    refuses!(sim, _ =>
        CameraCfg { width: 0, ..Default::default() },
        CameraCfg { height: 100_000, ..Default::default() },
        CameraCfg { near: 2.0, far: 1.0, ..Default::default() },
        CameraCfg { near: NAN, ..Default::default() },
        CameraCfg { intrinsics: Intrinsics::Fovy { radians: INFINITY }, ..Default::default() },
        CameraCfg { env_ids: Some(vec![2]), ..Default::default() },
        CameraCfg { channels: Channels::NONE, ..Default::default() },
    );
}

/// Errors of all types of sensors with one sampling.
fn with_sampling(sim: &mut SimulationManager, sampling: &SamplingCfg) -> Vec<SensorError> {
    let sampling = || sampling.clone();
    vec![
        rejected(sim, &ContactSensorCfg { sampling: sampling(), ..ContactSensorCfg::for_bodies("cube") }),
        rejected(sim, &ImuCfg { sampling: sampling(), ..ImuCfg::on("cube") }),
        rejected(sim, &FrameTransformerCfg { sampling: sampling(), ..frames("cube", &["cube"]) }),
        rejected(sim, &JointStateCfg { sampling: sampling(), ..Default::default() }),
        rejected(sim, &ActuatorStateCfg { sampling: sampling(), ..Default::default() }),
        rejected(sim, &JointWrenchCfg { sampling: sampling(), ..wrench(&["link6"], &[]) }),
        rejected(sim, &MujocoSensorCfg { sampling: sampling(), ..Default::default() }),
        rejected(sim, &RayCasterCfg { sampling: sampling(), ..Default::default() }),
        rejected(sim, &RayCasterCameraCfg { sampling: sampling(), ..Default::default() }),
    ]
}

/// Rejected sensors leave no trace: the simulation continues as one without the attempts.
#[test]
fn samplings() {
    let sim = &mut world();
    // Steps of 5 ms.
    for (period, whole) in [(0.012, Some(0.01)), (0.001, Some(0.005)), (-0.01, None), (NAN, None), (INFINITY, None)] {
        let mut errors = with_sampling(sim, &SamplingCfg::every(period));
        errors.push(rejected(sim, &CameraCfg { update_period: period, ..Default::default() }));
        for error in errors {
            match (&error, whole) {
                (SensorError::PeriodNotMultiple { nearest, .. }, Some(whole)) => {
                    assert!((nearest - whole).abs() < 1e-12 && error.to_string().contains(&period.to_string()));
                }
                (SensorError::InvalidPeriod { .. }, None) => {}
                _ => panic!("{period}: {error:?}"),
            }
        }
    }
    let good = SamplingCfg::default;
    let noise = |channel: &str, std| [(channel.to_string(), NoiseCfg::white(std))].into();
    // A history larger than any memory is rejected before allocation.
    for (history_length, latency_steps) in [(usize::MAX, 0), (0, u32::MAX), (1 << 40, 7)] {
        for error in with_sampling(sim, &SamplingCfg { history_length, latency_steps, ..good() }) {
            assert!(matches!(error, SensorError::TooLarge { .. }), "{error:?}");
        }
    }
    for dropout in [-0.1, 1.1, NAN] {
        for error in with_sampling(sim, &SamplingCfg { dropout, ..good() }) {
            assert!(matches!(error, SensorError::OutOfRange { .. }), "{error:?}");
        }
    }
    for error in with_sampling(sim, &SamplingCfg { noise: noise("no_such_channel", 0.1), ..good() }) {
        assert!(matches!(&error, SensorError::UnknownName { candidates, .. } if !candidates.is_empty()), "{error:?}");
    }
    for std in [-1.0, NAN, INFINITY] {
        let sampling = SamplingCfg { noise: noise("net_forces_w", std), ..good() };
        refuses!(sim, SensorError::OutOfRange { .. } =>
            ContactSensorCfg { sampling: sampling.clone(), ..ContactSensorCfg::for_bodies("cube") });
    }
    let mut other = world();
    let [asked, other] = [sim, &mut other].map(|sim| {
        sim.update(50);
        kinetoscope_testkit::worlds::all_bits(sim)
    });
    assert_eq!(asked, other);
}
