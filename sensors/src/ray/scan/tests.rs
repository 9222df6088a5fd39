//! Scans on several threads, of some environments, and of environments with their own scenes.

use super::*;
use kinetoscope_scene::shape::{Plane, Sphere};
use kinetoscope_scene::{Instance, Material, RenderScene};

const ENVS: usize = 6;
/// Not a whole number of jobs.
const RAYS: usize = 3 * RAYS_PER_JOB + 100;

/// A plane and twenty balls.
fn balls(radius: f32) -> RenderScene {
    let mut instances = vec![Instance::new(Plane::INFINITE, Material::default(), 1).into_fixed()];
    instances.extend((0..20).map(|k| Instance::new(Sphere { radius }, Material::default(), 2 + k)));
    RenderScene::new(instances).expect("a good scene")
}

/// Fans of rays into a plane and twenty balls.
fn scan(threads: usize) -> Scan<Vec<Ray>> {
    scan_of(&balls(0.3), threads)
}

fn scan_of(scene: &RenderScene, threads: usize) -> Scan<Vec<Ray>> {
    let context = SensorContext { num_envs: ENVS, threads, ..SensorContext::default() };
    let targets = RayTargets::new(scene, 0..21, &context.ray_assets);
    let ray = |k: usize| {
        let (angle, slope) = (0.618 * k as f64, 0.2 + 0.9 * k as f64 / RAYS as f64);
        let d = nalgebra::Vector3::new(angle.cos(), angle.sin(), -slope).normalize();
        Ray { origin: [0.0, 0.0, 1.0], direction: d.into() }
    };
    Scan::new(targets, (0..RAYS).map(ray).collect(), 50.0, &context)
}

/// Balls that move with time, at different positions in every environment.
fn poses(step: usize) -> Array2<PoseF64> {
    Array2::from_shape_fn((ENVS, 21), |(env, k)| {
        let at = k as f64 + 0.3 * env as f64 + 0.05 * step as f64;
        let ball = [1.0 + 0.2 * k as f64, at.sin(), 0.5 + 0.4 * (1.7 * at).cos()];
        PoseF64::from_translation(if k == 0 { [0.0; 3] } else { ball })
    })
}

fn view(env: usize) -> PoseF64 {
    PoseF64::from_translation([0.1 * env as f64, 0.0, 0.2])
}

fn bits(scan: &Scan<Vec<Ray>>) -> Vec<u64> {
    let mut bits = Vec::new();
    for env in 0..ENVS {
        scan.each_hit(env, |k, hit| {
            bits.extend([k as u64, hit.distance.to_bits(), u64::from(hit.instance)]);
            bits.extend(hit.normal.map(f64::to_bits));
        });
    }
    bits
}

#[test]
fn threads() {
    let all: Vec<usize> = (0..ENVS).collect();
    let cast = |threads| {
        let mut scan = scan(threads);
        [0, 1, 2].map(|step| {
            let poses = poses(step);
            all.iter().for_each(|&env| scan.update_fixed(env, &poses, &EnvScene::default()));
            scan.cast(&all, &poses, view);
            bits(&scan)
        })
    };
    let one = cast(1);
    assert_eq!(one[0].len(), ENVS * RAYS * 6);
    assert!(one[0] != one[1] && one[1] != one[2], "the control: they move");
    for threads in [2, 3, 8] {
        assert_eq!(cast(threads), one, "{threads} threads");
    }
}

#[test]
fn some_environments() {
    let mut scan = scan(2);
    let poses = poses(0);
    (0..ENVS).for_each(|env| scan.update_fixed(env, &poses, &EnvScene::default()));
    scan.cast(&[4, 1, 4], &poses, view);
    let count = |scan: &Scan<Vec<Ray>>, env| {
        let mut count = 0;
        scan.each_hit(env, |_, _| count += 1);
        count
    };
    assert_eq!([0, 1, 4].map(|env| count(&scan, env)), [0, RAYS, RAYS]);
    let (before, mut other) = (bits(&scan), scan.clone());
    other.cast(&[2], &poses, view);
    assert_eq!((bits(&scan), count(&other, 4), count(&other, 2)), (before, 0, RAYS));
}

/// An environment with its own scene is hit as in a scan of that scene; the others stay unchanged.
#[test]
fn own_scenes() {
    let all: Vec<usize> = (0..ENVS).collect();
    let poses = poses(0);
    let cast = |scan: &mut Scan<Vec<Ray>>, own: &[EnvScene]| {
        all.iter().for_each(|&env| scan.update_fixed(env, &poses, &own[env]));
        scan.cast(&all, &poses, view);
        bits(scan).chunks(6 * RAYS).map(<[u64]>::to_vec).collect::<Vec<_>>()
    };
    let nothing = vec![EnvScene::default(); ENVS];
    let (small, large) = (cast(&mut scan(2), &nothing), cast(&mut scan_of(&balls(0.45), 2), &nothing));
    let mut own = nothing.clone();
    for env in [0, 3] {
        own[env] = EnvScene(Some(Arc::new(balls(0.45))));
    }
    let mut scan = scan(2);
    let found = cast(&mut scan, &own);
    for env in 0..ENVS {
        let (expected, other) = if [0, 3].contains(&env) { (&large, &small) } else { (&small, &large) };
        assert!(found[env] == expected[env] && found[env] != other[env], "environment {env}");
    }
    assert!(cast(&mut scan, &nothing) == small, "and back again");
}
