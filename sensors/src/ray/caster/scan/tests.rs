//! Scans on several threads: the same bits, and no allocation on any of them.

use super::*;
use scene::shape::{Plane, Sphere};
use scene::{Instance, Material, RenderScene};

const ENVS: usize = 6;
/// Not a whole number of parts.
const RAYS: usize = 3 * PART + 100;

/// A plane and twenty balls.
fn balls(radius: f32) -> RenderScene {
    let mut instances = vec![Instance::new(Plane::INFINITE, Material::default(), 1).fixed()];
    instances.extend((0..20).map(|k| Instance::new(Sphere { radius }, Material::default(), 2 + k)));
    RenderScene::new(instances).expect("a good scene")
}

/// Fans of rays into a plane and twenty balls, on `threads` threads.
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

/// Balls that move with time, and are elsewhere in every environment.
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
fn threads_change_no_bit() {
    let all: Vec<usize> = (0..ENVS).collect();
    let cast = |threads| {
        let mut scan = scan(threads);
        let mut told = Vec::new();
        for step in 0..3 {
            let poses = poses(step);
            all.iter().for_each(|&env| scan.settle(env, &poses, &OwnScene::default()));
            scan.cast(&all, &poses, view);
            told.push(bits(&scan));
        }
        told
    };
    let one = cast(1);
    assert_eq!(one[0].len(), ENVS * RAYS * 6);
    assert!(one[0] != one[1] && one[1] != one[2], "the control: they move");
    for threads in [2, 3, 8] {
        assert_eq!(cast(threads), one, "{threads} threads");
    }
}

#[test]
fn only_what_was_cast_is_shown_and_clones_are_apart() {
    let mut scan = scan(2);
    let poses = poses(0);
    (0..ENVS).for_each(|env| scan.settle(env, &poses, &OwnScene::default()));
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

/// Work that counts what it allocates, on whichever thread.
struct Counted {
    round: Arc<Round<Vec<Ray>>>,
    /// Allocations of desk 0 and of all others, and parts that the others took.
    allocations: [AtomicUsize; 2],
    helped: AtomicUsize,
}

impl Work for Counted {
    fn work(&self, desk: usize) {
        let before = self.round.next.load(Ordering::Relaxed);
        let counted = allocation_counter::measure(|| self.round.work(desk)).count_total;
        self.allocations[desk.min(1)].fetch_add(counted as usize, Ordering::Relaxed);
        if desk > 0 && before < self.round.parts.len() {
            self.helped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// 6 environments of 3172 rays are worth four threads. Neither the calling thread nor the others allocate.
#[test]
fn casting_allocates_nothing_on_any_thread() {
    let mut scan = scan(4);
    let all: Vec<usize> = (0..ENVS).collect();
    let states: Vec<_> = (0..4).map(poses).collect();
    all.iter().for_each(|&env| scan.settle(env, &states[0], &OwnScene::default()));
    // Everybody's first time: threads start, and every desk finds out how much scratch memory it needs.
    scan.cast(&all, &states[0], view);
    for desk in 0..4 {
        scan.round.next.store(0, Ordering::Relaxed);
        scan.round.work(desk);
    }
    let threads = format!("{:?}", scan.crew);
    let counted = allocation_counter::measure(|| states.iter().for_each(|poses| scan.cast(&all, poses, view)));
    assert_eq!(counted.count_total, 0, "the calling thread");
    let counted = Arc::new(Counted {
        round: Arc::clone(&scan.round),
        allocations: Default::default(),
        helped: AtomicUsize::new(0),
    });
    // On a busy machine the others may come late.
    for _ in 0..1000 {
        scan.round.next.store(0, Ordering::Relaxed);
        scan.crew.run(4, &counted);
        if counted.helped.load(Ordering::Relaxed) > 8 {
            break;
        }
    }
    assert!(counted.helped.load(Ordering::Relaxed) > 8, "others helped");
    assert_eq!(counted.allocations.each_ref().map(|n| n.load(Ordering::Relaxed)), [0, 0]);
    assert_eq!((threads.as_str(), format!("{:?}", scan.crew)), ("Crew { threads: 3 }", threads.clone()), "they stay");
    let control = allocation_counter::measure(|| drop(vec![0u8; 100])).count_total;
    assert_eq!(control, 1, "the control: the counter counts");
}

/// An environment that looks otherwise is hit as one of a scan of that scene is, and the others as ever.
#[test]
fn environments_may_have_scenes_of_their_own() {
    let all: Vec<usize> = (0..ENVS).collect();
    let poses = poses(0);
    let of_env = |scan: &Scan<Vec<Ray>>, env: usize| {
        let mut hits = Vec::new();
        scan.each_hit(env, |k, hit| hits.push((k, hit.distance.to_bits(), hit.instance)));
        hits
    };
    let cast = |scan: &mut Scan<Vec<Ray>>, own: &[OwnScene]| {
        all.iter().for_each(|&env| scan.settle(env, &poses, &own[env]));
        scan.cast(&all, &poses, view);
        all.iter().map(|&env| of_env(scan, env)).collect::<Vec<_>>()
    };
    let nothing = vec![OwnScene::default(); ENVS];
    let (small, large) = (cast(&mut scan(2), &nothing), cast(&mut scan_of(&balls(0.45), 2), &nothing));
    let mut own = nothing.clone();
    for env in [0, 3] {
        own[env] = OwnScene(Some(Arc::new(balls(0.45))));
    }
    let mut scan = scan(2);
    let found = cast(&mut scan, &own);
    for env in 0..ENVS {
        let (expected, other) = if [0, 3].contains(&env) { (&large, &small) } else { (&small, &large) };
        assert!(found[env] == expected[env] && found[env] != other[env], "environment {env}");
    }
    assert!(cast(&mut scan, &nothing) == small, "and back again");
}
