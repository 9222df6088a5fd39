//! Random scenes of every kind of geom: distances and geoms agree with `mj_ray`.

use crate::rays::mujoco_rays::{
    MESH_WITH_INNER_EDGES, TestRng, check, compare, data_of, data_with, height_field, ray_through,
};
use kinetoscope::scene::Ray;

const DOWN: [f64; 3] = [0.0, 0.0, -1.0];

/// Rays from 20 m away, from close by, and from inside of shapes. Half of the bodies are welded to the world.
#[test]
fn shapes() {
    let mut rng = TestRng(1);
    for scene in 0..6 {
        let data = rng.primitives(24, 2, [0.05, 0.25]);
        let mut rays = Vec::new();
        for _ in 0..4000 {
            let ray = rng.ray(20.0, 1.0);
            let origin = [ray.origin[0], ray.origin[1], ray.origin[2].abs()];
            rays.push(ray_through(origin, Ray { origin, ..ray }.at(19.0)));
        }
        rays.extend((0..4000).map(|_| rng.ray(1.0, 1.0)));
        check(&format!("scene {scene}"), &data, &rays, 3000);
    }
}

/// A height field, moving meshes and static meshes. The field is square: otherwise `mj_ray` (measured on 2.2.2) places
/// the upper ends of the field's walls apart from its triangles.
#[test]
fn terrain_and_meshes() {
    let mut rng = TestRng(2);
    let terrain = height_field(33, |_| rng.number(0.0, 1.0) as f32);
    let vertices: Vec<String> = (0..30).map(|_| rng.point(0.3).map(|x| format!("{x}")).join(" ")).collect();
    // Without faces MuJoCo uses the convex hull.
    let hull = format!("<mesh name='hull' vertex='{}'/>", vertices.join("  "));
    let mut world = "<geom name='terrain' type='hfield' hfield='h' euler='3 -2 40' pos='.1 .2 0'/>".to_string();
    for k in 0..14 {
        world += &rng.body([k, 3], [[-1.5, 1.5], [-1.5, 1.5], [0.6, 1.8]], |_| {
            format!("<geom name='m{k}' type='mesh' mesh='{}'/>", ["hull", "fan"][k % 2])
        });
    }
    let assets = format!("<hfield name='h' file='terrain.bin' size='2.3 1.7 .4 .1'/>{hull}{MESH_WITH_INNER_EDGES}");
    let data = data_with(&assets, &world, &[terrain]);
    let mut rays = Vec::new();
    for k in 0..8000 {
        let origin = rng.numbers([[-8.0, 8.0], [-8.0, 8.0], [0.9, 20.0]]);
        let target = rng.numbers([[-2.0, 2.0], [-1.5, 1.5], [0.0, 1.0]]);
        rays.push(match k % 4 {
            0 => Ray { origin: [target[0], target[1], 20.0], direction: DOWN },
            _ => ray_through(origin, target),
        });
    }
    check("terrain and meshes", &data, &rays, 6000);
}

/// Control: the test detects shapes that are displaced by ten micrometers.
#[test]
fn ten_micrometers() {
    let at = |z: f64| {
        data_of(&format!(
            "<geom name='floor' type='plane' size='5 5 .1'/><body pos='0 0 {z}'><geom name='a' type='box' size='.3 .2 .1'/>
            <geom name='b' type='sphere' size='.2' pos='.6 0 0'/></body>"
        ))
    };
    let (data, moved) = (at(0.5), at(0.500_01));
    let mut rng = TestRng(3);
    let mut down = Vec::new();
    for _ in 0..2000 {
        let [x, y] = rng.numbers([[-0.3, 0.8], [-0.2, 0.2]]);
        down.push(Ray { origin: [x, y, 20.0], direction: DOWN });
    }
    check("in place", &data, &down, 1900);
    let (_, differing) = compare(&data, &moved, &down);
    assert!(differing > 1000, "{differing}");
}
