//! The ray caster as a sensor: a floor with a step, a moving ball and the robot itself.

use super::{RayAlignment, RayCaster, RayCasterCfg};
use crate::ray::HitTargets;
use crate::ray::pattern::{Custom, Grid, Lidar};
use crate::sampling::{Sampled, SamplingCfg};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::{NoiseCfg, SensorError};
use kinetoscope_scene::pose::{from_xyz_rpy, to_row};
use kinetoscope_scene::shape::{Box, Plane, Sphere};
use kinetoscope_scene::{EnvScene, Instance, Material, Pose, PoseF64, RenderScene, SceneState};
use ndarray::{Array2, Array3, Axis};
use std::sync::Arc;

const DT: f64 = 0.005;
const GROUND: i32 = 1;
const STEP: i32 = 2;
const BASE: i32 = 3;
const FOOT: i32 = 4;
const BALL: i32 = 5;

/// Ground at z = 0, a block 0.25 m high for x > 1, a robot base (a box) with a foot fused to it, and a ball.
fn context(num_envs: usize, threads: usize) -> SensorContext {
    let instance = |shape: kinetoscope_scene::shape::Shape, id, name: &str| {
        Instance::new(shape, Material::default(), id).with_name(name)
    };
    let instances = vec![
        instance(Plane::INFINITE.into(), GROUND, "ground").into_fixed(),
        instance(Box { half: [5.0, 5.0, 0.125] }.into(), STEP, "step").into_fixed(),
        instance(Box { half: [0.3, 0.2, 0.1] }.into(), BASE, "dog/base").with_body(0),
        instance(Sphere { radius: 0.125 }.into(), FOOT, "dog/foot").with_body(1),
        instance(Sphere { radius: 0.25 }.into(), BALL, "ball").with_body(2),
    ];
    SensorContext {
        num_envs,
        dt: DT,
        name: "scanner".into(),
        bodies: ["dog/base", "dog/foot", "ball"].map(String::from).into(),
        moving_bodies: [0, 0, 2].into(),
        scene: Some(Arc::new(RenderScene::new(instances).unwrap())),
        threads,
        ..SensorContext::default()
    }
}

fn base(env: usize, step: u64) -> Pose {
    let (k, s) = (env as f64, step as f64);
    from_xyz_rpy([-0.2 * k, 0.1 + 0.01 * s, 0.75], [0.2, -0.1 + 0.02 * k, 0.5 + 0.1 * s])
}

fn state_with(steps: &[u64], base: impl Fn(usize, u64) -> Pose) -> SceneState {
    let n = steps.len();
    let (mut bodies, mut instances) = (Array3::zeros((n, 3, 7)), Array2::from_elem((n, 5), PoseF64::IDENTITY));
    for (env, &step) in steps.iter().enumerate() {
        let base = base(env, step);
        let foot = base * Pose::translation(0.0, 0.0, -0.25);
        let ball = Pose::translation(-0.5, 0.3 * env as f64, 0.25);
        for (body, pose) in [base, foot, ball].iter().enumerate() {
            to_row(pose).iter().enumerate().for_each(|(k, x)| bodies[(env, body, k)] = *x);
            instances[(env, 2 + body)] = PoseF64::from(pose);
        }
        instances[(env, 1)] = PoseF64::from_translation([6.0, 0.0, 0.125]);
    }
    SceneState {
        step: steps.to_vec(),
        time: steps.iter().map(|&s| s as f64 * DT).collect(),
        force_time: steps.iter().map(|&s| s.saturating_sub(1) as f64 * DT).collect(),
        body_poses: Some(bodies),
        instance_poses: Some(instances),
        ..SceneState::default()
    }
}

fn state(steps: &[u64]) -> SceneState {
    state_with(steps, base)
}

fn built_in(cfg: &RayCasterCfg, context: &SensorContext, state: &SceneState) -> RayCaster {
    let mut caster = cfg.build(context).unwrap();
    caster.reset(&(0..context.num_envs).collect::<Vec<_>>(), state).unwrap();
    caster
}

/// The height scanner of Isaac's tutorial.
fn scanner() -> RayCasterCfg {
    RayCasterCfg {
        parent: Some("base".into()),
        offset: Pose::translation(0.0, 0.0, 20.0),
        alignment: RayAlignment::Yaw,
        targets: HitTargets::Named(vec!["ground".into(), "step".into()]),
        ..RayCasterCfg::default()
    }
}

#[test]
fn height_scan() {
    let caster = built_in(&scanner(), &context(2, 1), &state(&[0, 7]));
    assert_eq!((caster.num_rays(), caster.hits().dim(), caster.distances().dim()), (187, (2, 187, 3), (2, 187)));
    let (starts, directions) = (caster.ray_starts(), caster.ray_directions());
    for (env, step) in [(0, 0), (1, 7)] {
        let pose = base(env, step);
        let (roll, _, yaw) = pose.rotation.euler_angles();
        assert!(roll.abs() > 0.1, "tilted");
        for k in 0..187 {
            // x fastest, rotated by the yaw alone, about the origin of the base.
            let (x, y) = (-0.8 + 0.1 * (k % 17) as f64, -0.5 + 0.1 * (k / 17) as f64);
            let p = pose.translation.vector;
            let at = [p.x + x * yaw.cos() - y * yaw.sin(), p.y + x * yaw.sin() + y * yaw.cos(), p.z + 20.0];
            assert!(at[0] < 1.0, "before the step");
            for axis in 0..3 {
                let hit = [at[0], at[1], 0.0][axis];
                assert!((starts[(env, k, axis)] - at[axis]).abs() < 1e-12);
                assert!((caster.hits()[(env, k, axis)] - hit).abs() < 1e-12, "{env} {k} {axis}");
                assert_eq!(directions[(env, k, axis)], [0.0, 0.0, -1.0][axis]);
                assert_eq!(caster.normals()[(env, k, axis)], [0.0, 0.0, 1.0][axis]);
            }
            assert!((caster.distances()[(env, k)] - at[2]).abs() < 1e-12);
            assert_eq!(caster.hit_ids()[(env, k)], GROUND);
        }
        assert!((0..3).all(|k| caster.pos_w()[(env, k)] == pose.translation.vector[k]), "without the 20 m");
        assert_eq!(caster.quat_w()[(env, 0)], pose.rotation.w);
    }
    assert!(caster.hit_mask().iter().all(|hit| *hit));
    // Looking straight up, the yaw is 0, not NaN.
    let up = |_, _| from_xyz_rpy([0.0, 0.0, 1.0], [0.3, -std::f64::consts::FRAC_PI_2, 0.0]);
    let caster = built_in(&scanner(), &context(1, 1), &state_with(&[0], up));
    assert!(caster.hits().iter().chain(caster.distances().iter()).all(|x| x.is_finite()));
    let caster = built_in(&scanner(), &context(2, 1), &state(&[0, 0]));
    let text = caster.to_string();
    assert!(text.starts_with("Ray-caster @ \"dog/base/scanner\":\n"), "{text}");
    assert!(text.contains("\tupdate period (s)    : 0.005\n"), "{text}");
    assert!(text.contains("number of rays/sensor: 187\n") && text.ends_with("total number of rays : 374"), "{text}");
}

/// All three alignments, with slanted rays and a rotating offset: origins and directions both rotate.
#[test]
fn alignments() {
    let pose = base(1, 3);
    let offset = from_xyz_rpy([0.1, -0.2, 0.3], [0.3, 0.2, -0.7]);
    let (start, direction) = ([0.4, 0.1, 0.2], [0.6, 0.0, -0.8]);
    let (_, _, yaw) = pose.rotation.euler_angles();
    for (alignment, rotation) in [
        (RayAlignment::Base, pose.rotation),
        (RayAlignment::Yaw, nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, yaw)),
        (RayAlignment::World, nalgebra::UnitQuaternion::identity()),
    ] {
        let pattern = Custom { starts: vec![start], directions: vec![direction] }.into();
        let cfg = RayCasterCfg { parent: Some("dog/base".into()), offset, alignment, pattern, ..scanner() };
        let caster = built_in(&cfg, &context(2, 1), &state(&[0, 3]));
        let frame = Pose::from_parts(pose.translation, rotation) * offset;
        let expected =
            [(frame * nalgebra::Point3::from(start)).coords, frame.rotation * nalgebra::Vector3::from(direction)];
        for (measured, expected) in [caster.ray_starts(), caster.ray_directions()].iter().zip(expected) {
            let errors = (0..3).map(|axis| (measured[(1, 0, axis)] - expected[axis]).abs());
            assert!(errors.fold(0.0, f64::max) < 1e-12, "{alignment:?}");
        }
    }
}

#[test]
fn targets() {
    let down = |targets, alignment| RayCasterCfg {
        parent: Some("base".into()),
        offset: Pose::translation(0.0, 0.0, 5.0),
        pattern: Custom { starts: vec![[0.0; 3]], directions: vec![[0.0, 0.0, -1.0]] }.into(),
        alignment,
        targets,
        ..RayCasterCfg::default()
    };
    let seen = |targets: HitTargets| {
        let caster = built_in(&down(targets, RayAlignment::Yaw), &context(1, 1), &state(&[0]));
        (caster.hit_ids()[(0, 0)], caster.target_instances().collect::<Vec<_>>())
    };
    assert_eq!(seen(HitTargets::Everything { exclude_parent: false }), (BASE, vec![0, 1, 2, 3, 4]));
    // The foot is fused to the base, and is excluded with it.
    assert_eq!(seen(HitTargets::Everything { exclude_parent: true }), (GROUND, vec![0, 1, 4]));
    assert_eq!(seen(HitTargets::StaticOnly), (GROUND, vec![0, 1]));
    assert_eq!(seen(HitTargets::Named(vec!["dog/.*".into()])), (BASE, vec![2, 3]));
    assert_eq!(seen(HitTargets::Named(vec!["foot".into(), "ball".into()])), (FOOT, vec![3, 4]));
    let none = RayCasterCfg { groups: 0b1000, ..down(HitTargets::default(), RayAlignment::Base) };
    let caster = built_in(&none, &context(1, 1), &state(&[0]));
    assert_eq!((caster.hit_ids()[(0, 0)], caster.hits()[(0, 0, 1)]), (0, f64::INFINITY));
}

#[test]
fn misses() {
    let cfg = RayCasterCfg {
        parent: Some("base".into()),
        pattern: Lidar { channels: 5, horizontal_resolution_deg: 30.0, ..Lidar::default() }.into(),
        max_distance: 3.0,
        ..RayCasterCfg::default()
    };
    let caster = built_in(&cfg, &context(2, 1), &state(&[0, 0]));
    let mut misses = 0;
    for ((env, k), hit) in caster.hit_mask().indexed_iter() {
        let [point, normal] = [caster.hits(), caster.normals()].map(|v| [0, 1, 2].map(|axis| v[(env, k, axis)]));
        let distance = caster.distances()[(env, k)];
        assert_eq!(*hit, caster.hit_ids()[(env, k)] != 0);
        misses += usize::from(!hit);
        if *hit {
            assert!(distance <= 3.0 && point.iter().chain(&normal).all(|x| !x.is_nan()));
        } else {
            assert_eq!((distance, point, normal), (f64::INFINITY, [f64::INFINITY; 3], [0.0; 3]));
        }
    }
    assert!(misses > 10 && misses < 110, "{misses}");
}

/// The measurement of an environment does not depend on other environments, nor on threads.
#[test]
fn environments_and_threads() {
    let cfg = RayCasterCfg {
        parent: Some("base".into()),
        pattern: Lidar { channels: 40, ..Lidar::default() }.into(),
        ..RayCasterCfg::default()
    };
    let steps = [3, 4, 5, 6];
    let bits = |caster: &RayCaster, env: usize| -> Vec<u64> {
        let all = [caster.hits().into_dyn(), caster.normals().into_dyn(), caster.distances().into_dyn()];
        all.iter().flat_map(|a| kinetoscope_testkit::bits::bits(a.index_axis(Axis(0), env).iter())).collect()
    };
    let one = built_in(&cfg, &context(4, 1), &state(&steps));
    // 36000 rays in 4 environments use four threads.
    let four = built_in(&cfg, &context(4, 4), &state(&steps));
    for (env, &step) in steps.iter().enumerate() {
        assert_eq!(bits(&one, env), bits(&four, env));
        let alone = built_in(&cfg, &context(1, 1), &state_with(&[step], |_, step| base(env, step)));
        // With only one environment, the ball is as in environment 0: rays that miss the ball are equal.
        let same = (0..one.num_rays()).filter(|&k| one.hit_ids()[(env, k)] != BALL && alone.hit_ids()[(0, k)] != BALL);
        let distances = |k| [one.distances()[(env, k)], alone.distances()[(0, k)]].map(f64::to_bits);
        let equal: Vec<bool> = same.map(distances).map(|[a, b]| a == b).collect();
        assert!(equal.len() > 30_000 && equal.iter().all(|equal| *equal));
    }
    assert_ne!(bits(&one, 0), bits(&one, 1), "the control");
}

#[test]
fn drift() {
    let cfg = RayCasterCfg { drift: [-0.1, 0.3], ..scanner() };
    let context = SensorContext { seed: 5, ..context(2, 1) };
    let mut caster = built_in(&cfg, &context, &state(&[0, 0]));
    let drift = |caster: &RayCaster, env: usize, step| -> [f64; 3] {
        std::array::from_fn(|k| caster.pos_w()[(env, k)] - base(env, step).translation.vector[k])
    };
    let first = [drift(&caster, 0, 0), drift(&caster, 1, 0)];
    assert!(first.iter().flatten().all(|d| (-0.1 - 1e-12..0.3 + 1e-12).contains(d)));
    assert!(first[0] != first[1] && first[0][0] != first[0][1]);
    let moved = caster.hits()[(0, 0, 0)] - built_in(&scanner(), &context, &state(&[0, 0])).hits()[(0, 0, 0)];
    assert!((moved - first[0][0]).abs() < 1e-12, "rays move with it");
    caster.update(&state(&[1, 1])).unwrap();
    assert!((0..3).all(|k| (drift(&caster, 0, 1)[k] - first[0][k]).abs() < 1e-12), "it stays until a reset");
    caster.reset(&[0], &state(&[0, 1])).unwrap();
    assert!((drift(&caster, 0, 0)[0] - first[0][0]).abs() > 1e-6, "drawn anew");
    assert!((drift(&caster, 1, 1)[0] - first[1][0]).abs() < 1e-12, "only there");
    let again = built_in(&cfg, &context, &state(&[0, 0]));
    assert_eq!(drift(&again, 1, 0), first[1], "the same seed");
}

#[test]
fn latency_and_history() {
    let sampling = SamplingCfg { update_period: 0.01, history_length: 2, latency_steps: 1, ..SamplingCfg::default() };
    let mut caster = built_in(&RayCasterCfg { sampling, ..scanner() }, &context(1, 1), &state(&[0]));
    let y = |step: u64| base(0, step).translation.vector.y;
    assert!((caster.pos_w()[(0, 1)] - y(0)).abs() < 1e-12, "a reset refreshes");
    for step in 1..=4 {
        caster.update(&state(&[step])).unwrap();
        // Captured at 2 and 4, readable one step later.
        let captured = if step >= 3 { 2 } else { 0 };
        assert!((caster.pos_w()[(0, 1)] - y(captured)).abs() < 1e-12, "step {step}");
        let ray = caster.ray_starts();
        let hit = caster.hits();
        assert!((ray[(0, 0, 0)] - hit[(0, 0, 0)]).abs() < 1e-12, "points belong to their rays");
    }
    assert_eq!((caster.sample_counts()[0], caster.history_filled(0)), (1, 1));
    assert_eq!(caster.stamps()[0], 0.01);
    assert_eq!(caster.distance_history().dim(), (1, 2, 187));
    assert_eq!(caster.distance_history()[(0, 0, 0)], caster.distances()[(0, 0)]);
}

fn noisy(std: f64) -> RayCasterCfg {
    let noise = [("distances".to_string(), NoiseCfg::white(std))].into();
    RayCasterCfg { sampling: SamplingCfg { noise, ..SamplingCfg::default() }, ..scanner() }
}

/// Noise moves points along their rays, between zero and the maximum distance. Root cause, as for ray-caster cameras:
/// the sum of distance and noise was not clamped.
#[test]
fn noise() {
    let caster = built_in(&noisy(0.1), &context(1, 1), &state(&[0]));
    let square = (0..187).map(|k| caster.hits()[(0, k, 2)].powi(2)).sum::<f64>();
    let spread = (square / 187.0).sqrt();
    // Five sigma of the deviation of 187 normal numbers.
    assert!((spread - 0.1).abs() < 5.0 * 0.1 / (2.0 * 187f64).sqrt(), "{spread}");
    let exact = built_in(&scanner(), &context(1, 1), &state(&[0]));
    assert!((0..187).all(|k| caster.hits()[(0, k, 0)] == exact.hits()[(0, k, 0)]));
    let caster = built_in(&RayCasterCfg { max_distance: 25.0, ..noisy(30.0) }, &context(1, 1), &state(&[0]));
    assert!(caster.distances().iter().all(|distance| (0.0..=25.0).contains(distance)));
    assert!(caster.hit_mask().iter().all(|hit| *hit));
    let ends = [0.0, 25.0].map(|end| caster.distances().iter().filter(|d| **d == end).count());
    assert!(ends.iter().all(|count| *count > 10), "the control: the noise reaches both ends: {ends:?}");
    // From below the ground nothing is hit, whatever the noise.
    let away = RayCasterCfg { offset: Pose::translation(0.0, 0.0, -20.0), ..noisy(30.0) };
    let caster = built_in(&away, &context(1, 1), &state(&[0]));
    assert!(caster.distances().iter().all(|d| *d == f64::INFINITY) && !caster.hit_mask().iter().any(|hit| *hit));
}

/// A write moves a fixed target in one environment.
#[test]
fn moved_fixed_target() {
    let mut caster = built_in(&scanner(), &context(3, 1), &state(&[0; 3]));
    let mut state = state(&[0; 3]);
    state.instance_poses.as_mut().unwrap()[(1, 0)] = PoseF64::from_translation([0.0, 0.0, -0.5]);
    caster.refresh(&[1], &state).unwrap();
    assert_eq!([0, 1, 2].map(|env| (caster.hits()[(env, 0, 2)] * 1e9).round()), [0.0, -0.5e9, 0.0]);
}

#[test]
fn mistakes() {
    let error = |cfg: RayCasterCfg| cfg.build(&context(1, 1)).unwrap_err().to_string();
    let named = |name: &str| RayCasterCfg { targets: HitTargets::Named(vec![name.into()]), ..scanner() };
    for (cfg, part) in [
        (RayCasterCfg { parent: Some("bsae".into()), ..scanner() }, "dog/base"),
        (named("gruond"), "ground"),
        // An object in a geom group that is not selected.
        (RayCasterCfg { groups: 1 << 5, ..named("ground") }, "\"ground\""),
        (RayCasterCfg { pattern: Grid { resolution: 0.0, ..Grid::default() }.into(), ..scanner() }, "resolution"),
        (RayCasterCfg { max_distance: 0.0, ..scanner() }, "max_distance"),
        (RayCasterCfg { max_distance: -1.0, ..scanner() }, "max_distance"),
        (RayCasterCfg { max_distance: f64::NAN, ..scanner() }, "max_distance"),
        (RayCasterCfg { drift: [0.1, -0.1], ..scanner() }, "drift"),
        (RayCasterCfg { drift: [f64::NAN, 0.1], ..scanner() }, "NaN"),
        (RayCasterCfg { offset: Pose::translation(f64::NAN, 0.0, 0.0), ..scanner() }, "offset"),
        (RayCasterCfg { sampling: SamplingCfg::every(0.007), ..scanner() }, "update_period"),
    ] {
        let text = error(cfg);
        assert!(text.contains(part), "{text}");
    }
    assert!(named("ground").build(&context(1, 1)).is_ok());
    // A hidden object is rejected unless an environment shows it; the candidates are objects that can be hit.
    let look = |visible: [bool; 5]| {
        let scene = context(1, 1).scene.unwrap();
        let mut instances = scene.instances().to_vec();
        instances.iter_mut().zip(visible).for_each(|(instance, visible)| instance.visible = visible);
        Arc::new(scene.with_instances(instances).unwrap())
    };
    let hidden = || SensorContext { scene: Some(look([true, true, true, true, false])), ..context(1, 1) };
    let text = named("ball").build(&hidden()).unwrap_err().to_string();
    assert!(text.contains("\"ball\"") && text.contains("step"), "{text}");
    assert!(named("ball|step").build(&hidden()).is_ok());
    let own_scenes = vec![EnvScene(None), EnvScene(Some(look([true; 5])))];
    assert!(named("ball").build(&SensorContext { own_scenes, ..hidden() }).is_ok());
    let many = Grid { resolution: 1e-3, size: [1.0, 1.0], ..Grid::default() };
    let error = RayCasterCfg { pattern: many.into(), ..scanner() }.build(&context(1_000_000, 1)).unwrap_err();
    assert!(matches!(error, SensorError::Ray(crate::ray::RayError::Memory { rays: 1_002_001, .. })), "{error}");
    let mut caster = built_in(&scanner(), &context(1, 1), &state(&[0]));
    assert!(matches!(caster.reset(&[1], &state(&[0])), Err(SensorError::IndexOutOfRange { .. })));
    assert!(matches!(caster.update(&SceneState::new(1)), Err(SensorError::MissingFields { .. })));
    assert!(matches!(caster.update(&state(&[1, 1])), Err(SensorError::WrongShape { .. })));
    assert!(scanner().build(&SensorContext { scene: None, ..context(1, 1) }).is_err());
    caster.reset(&[0, 0], &state(&[0])).unwrap();
}
