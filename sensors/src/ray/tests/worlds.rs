//! Many instances at once: the nearest counts, in whatever way they are looked for.

use super::Dice;
use crate::lanes::levels;
use crate::ray::{Ray, RayAssets, RayHit, RayTargets, RayWorld};
use scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Mesh, Plane, Sphere};
use scene::{Instance, Material, PoseF64, RenderMesh, RenderScene, Shape};
use std::sync::Arc;

fn scene(count: usize, fixed: impl Fn(usize) -> bool) -> RenderScene {
    let ball = Shape::from(Sphere { radius: 0.2 }).tessellate(24);
    let mesh = Arc::new(RenderMesh::new(&ball, RenderMesh::CREASE));
    let shape = |k: usize| -> Shape {
        match k % 7 {
            0 => Plane { half: [0.3, 0.4] }.into(),
            1 => Sphere { radius: 0.2 }.into(),
            2 => Capsule { radius: 0.1, half_length: 0.2 }.into(),
            3 => Ellipsoid { radii: [0.1, 0.2, 0.3] }.into(),
            4 => Cylinder { radius: 0.15, half_length: 0.2 }.into(),
            5 => Box { half: [0.1, 0.2, 0.3] }.into(),
            _ => Mesh { mesh: Arc::clone(&mesh) }.into(),
        }
    };
    let instance = |k: usize| {
        let instance = Instance::new(shape(k), Material::default(), k as i32 + 1);
        if fixed(k) { instance.fixed() } else { instance }
    };
    RenderScene::new((0..count).map(instance).collect()).unwrap()
}

fn poses(dice: &mut Dice, count: usize) -> Vec<PoseF64> {
    (0..count)
        .map(|_| {
            let (p, a) = (dice.point(2.0), dice.point(3.0));
            PoseF64::from(&scene::pose::from_xyz_rpy(p, a))
        })
        .collect()
}

fn cast(scene: &RenderScene, wanted: impl IntoIterator<Item = usize>, poses: &[PoseF64], rays: &[Ray]) -> Vec<RayHit> {
    let mut world = RayWorld::new(&Arc::new(RayTargets::new(scene, wanted, &RayAssets::default())));
    world.place(poses);
    let mut hits = vec![RayHit::MISS; rays.len()];
    world.cast(rays, 50.0, &mut hits);
    hits
}

#[test]
fn the_nearest_of_single_instances_is_the_hit_of_all() {
    let mut dice = Dice(21);
    let count = 40;
    let poses = poses(&mut dice, count);
    let rays: Vec<Ray> = (0..500).map(|_| dice.ray(5.0, 2.0)).collect();
    // All move, none does (a tree), every other one.
    let scenes = [scene(count, |_| false), scene(count, |_| true), scene(count, |k| k % 2 == 0)];
    let mut expected = vec![RayHit::MISS; rays.len()];
    for k in 0..count {
        for (best, hit) in expected.iter_mut().zip(cast(&scenes[0], [k], &poses, &rays)) {
            if hit.distance < best.distance {
                *best = hit;
            }
        }
    }
    let hits = expected.iter().filter(|h| h.is_hit()).count();
    assert!(hits > 100 && hits < 400, "{hits}");
    for scene in &scenes {
        assert_eq!(cast(scene, 0..count, &poses, &rays), expected);
    }
    for (hit, ray) in expected.iter().zip(&rays).filter(|(hit, _)| hit.is_hit()) {
        assert_eq!(hit.mask_id, hit.instance as i32 + 1);
        let towards = (0..3).map(|k| hit.normal[k] * ray.direction[k]).sum::<f64>();
        assert!(towards <= 1e-12, "normals are turned to where the ray comes from");
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let mut dice = Dice(22);
    let scene = scene(60, |k| k % 3 != 0);
    let poses = poses(&mut dice, 60);
    let rays: Vec<Ray> = (0..400).map(|_| dice.ray(5.0, 2.0)).collect();
    let targets = Arc::new(RayTargets::new(&scene, 0..60, &RayAssets::default()));
    let bits = |level| {
        let mut world = RayWorld::with_level(&targets, level);
        world.place(&poses);
        let mut hits = vec![RayHit::MISS; rays.len()];
        world.cast(&rays, 50.0, &mut hits);
        let of = |h: &RayHit| (h.distance.to_bits(), h.normal.map(f64::to_bits), h.instance);
        hits.iter().map(of).collect::<Vec<_>>()
    };
    let all: Vec<_> = levels().into_iter().map(bits).collect();
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn what_does_not_move_is_placed_anew_where_it_did() {
    let scene = scene(14, |_| true);
    let targets = Arc::new(RayTargets::new(&scene, 0..14, &RayAssets::default()));
    assert_eq!((targets.len(), targets.fixed_count()), (14, 14));
    let mut dice = Dice(23);
    let (a, b) = (poses(&mut dice, 14), poses(&mut dice, 14));
    let rays: Vec<Ray> = (0..200).map(|_| dice.ray(5.0, 2.0)).collect();
    let mut world = RayWorld::new(&targets);
    for poses in [&a, &b, &a] {
        world.place(poses);
        let mut hits = vec![RayHit::MISS; rays.len()];
        world.cast(&rays, 50.0, &mut hits);
        assert_eq!(hits, cast(&scene, 0..14, poses, &rays));
    }
    assert_ne!(cast(&scene, 0..14, &a, &rays), cast(&scene, 0..14, &b, &rays), "the control");
}

#[test]
fn numbers_that_are_none_hit_nothing() {
    let scene = scene(14, |k| k % 2 == 0);
    let mut poses = vec![PoseF64::IDENTITY; 14];
    let down = Ray { origin: [0.05, 0.0, 3.0], direction: [0.0, 0.0, -1.0] };
    assert!(cast(&scene, 0..14, &poses, &[down])[0].is_hit());
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    let rays: Vec<Ray> = bad
        .iter()
        .flat_map(|&x| [Ray { origin: [0.0, x, 3.0], ..down }, Ray { direction: [x, 0.0, -1.0], ..down }])
        .collect();
    assert!(cast(&scene, 0..14, &poses, &rays).iter().all(|h| *h == RayHit::MISS));
    for pose in &mut poses {
        pose.translation[1] = f64::NAN;
    }
    assert_eq!(cast(&scene, 0..14, &poses, &[down]), [RayHit::MISS]);
}

/// Of two surfaces at the same place the first instance counts.
#[test]
fn ties_go_to_the_first_instance() {
    for fixed in [false, true] {
        let scene = scene(21, |_| fixed);
        let down = Ray { origin: [0.0, 0.0, 3.0], direction: [0.0, 0.0, -1.0] };
        // Shapes 3 (an ellipsoid), 5 (a box) and those seven and fourteen later reach up to the same 0.3 m.
        let hit = cast(&scene, 0..21, &[PoseF64::IDENTITY; 21], &[down])[0];
        assert_eq!((hit.instance, (hit.distance * 1e6).round()), (3, 2_700_000.0), "{hit:?}");
    }
}
