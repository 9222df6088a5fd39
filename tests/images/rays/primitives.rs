//! Random scenes of every kind of geom: distances and geoms are those of `mj_ray`.

use crate::rays::judge::{Dice, check, compare, data_of, ray_through};
use kinetoscope::sensors::ray::Ray;
use kinetoscope::sim::mj;

/// Bodies with random shapes; half of them are welded to the world, so that rays find them by a tree.
fn primitives(dice: &mut Dice, count: usize) -> String {
    let mut bodies = String::new();
    for k in 0..count {
        let kind = ["sphere", "capsule", "ellipsoid", "cylinder", "box"][k % 5];
        let [x, y, z] = [(-1.0, 1.0), (-1.0, 1.0), (0.2, 1.4)].map(|(a, b)| dice.number(a, b));
        let [a, b, c] = [0; 3].map(|_| dice.number(0.0, 360.0));
        let [s, t, r] = [0; 3].map(|_| dice.number(0.05, 0.25));
        let joint = if k % 2 == 0 { "<freejoint/>" } else { "" };
        bodies += &format!(
            "<body pos='{x} {y} {z}' euler='{a} {b} {c}'>{joint}<geom name='g{k}' type='{kind}' size='{s} {t} {r}'/></body>"
        );
    }
    bodies
}

/// From 20 m away, from near, and from inside of shapes.
fn rays(dice: &mut Dice) -> Vec<Ray> {
    let far = (0..4000).map(|_| {
        let ray = dice.ray(20.0, 1.0);
        Ray { origin: [ray.origin[0], ray.origin[1], ray.origin[2].abs()], ..ray }
    });
    let mut rays: Vec<Ray> = far.map(|ray| ray_through(ray.origin, ray.at(19.0))).collect();
    rays.extend((0..4000).map(|_| dice.ray(1.0, 1.0)));
    rays
}

#[test]
fn primitives_are_hit_where_mujoco_hits_them() {
    let mut dice = Dice(1);
    for scene in 0..6 {
        let bodies = primitives(&mut dice, 24);
        let data = data_of(
            &format!("<mujoco><worldbody><geom name='floor' type='plane' size='5 5 .1'/>{bodies}</worldbody></mujoco>"),
            &[],
        );
        check(&format!("scene {scene}"), &data, &rays(&mut dice), 3000);
    }
}

/// A height field, meshes that move and meshes that do not. The field has as many rows as columns: otherwise `mj_ray`
/// (measured on 2.2.2) puts the upper ends of the field's walls elsewhere than its triangles.
#[test]
fn terrain_and_meshes_are_hit_where_mujoco_hits_them() {
    let mut dice = Dice(2);
    let (rows, columns) = (33i32, 33i32);
    let mut bytes: Vec<u8> = [rows, columns].iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.extend((0..rows * columns).flat_map(|_| (dice.number(0.0, 1.0) as f32).to_le_bytes()));
    let terrain = mj::Asset { name: "terrain.bin".into(), bytes };
    let vertices: Vec<String> = (0..30).map(|_| dice.point(0.3).map(|x| format!("{x}")).join(" ")).collect();
    // Without faces MuJoCo takes the convex hull.
    let hull = format!("<mesh name='hull' vertex='{}'/>", vertices.join("  "));
    let fan = "<mesh name='fan' vertex='0 0 0  .5 0 0  0 .5 0  0 0 .5  .3 .3 .4' face='0 2 1  0 1 3  0 3 2  1 2 4  2 3 4  3 1 4'/>";
    let mut bodies = String::new();
    for k in 0..14 {
        let [x, y, z] = [(-1.5, 1.5), (-1.5, 1.5), (0.6, 1.8)].map(|(a, b)| dice.number(a, b));
        let [a, b, c] = [0; 3].map(|_| dice.number(0.0, 360.0));
        let (mesh, joint) = (["hull", "fan"][k % 2], if k % 3 == 0 { "<freejoint/>" } else { "" });
        bodies += &format!(
            "<body pos='{x} {y} {z}' euler='{a} {b} {c}'>{joint}<geom name='m{k}' type='mesh' mesh='{mesh}'/></body>"
        );
    }
    let xml = format!(
        "<mujoco><asset><hfield name='h' file='terrain.bin' size='2.3 1.7 .4 .1'/>{hull}{fan}</asset>
        <worldbody><geom name='terrain' type='hfield' hfield='h' euler='3 -2 40' pos='.1 .2 0'/>{bodies}</worldbody></mujoco>"
    );
    let data = data_of(&xml, &[terrain]);
    let mut all = Vec::new();
    for k in 0..8000 {
        let origin = [dice.number(-8.0, 8.0), dice.number(-8.0, 8.0), dice.number(0.9, 20.0)];
        let target = [dice.number(-2.0, 2.0), dice.number(-1.5, 1.5), dice.number(0.0, 1.0)];
        all.push(match k % 4 {
            0 => Ray { origin: [target[0], target[1], 20.0], direction: [0.0, 0.0, -1.0] },
            _ => ray_through(origin, target),
        });
    }
    check("terrain and meshes", &data, &all, 6000);
}

/// The control: shapes that are ten micrometres elsewhere are found out.
#[test]
fn ten_micrometres_are_found_out() {
    let xml = |z: f64| {
        format!(
            "<mujoco><worldbody><geom name='floor' type='plane' size='5 5 .1'/><body pos='0 0 {z}'>
            <geom name='a' type='box' size='.3 .2 .1'/><geom name='b' type='sphere' size='.2' pos='.6 0 0'/></body></worldbody></mujoco>"
        )
    };
    let (data, moved) = (data_of(&xml(0.5), &[]), data_of(&xml(0.500_01), &[]));
    let mut dice = Dice(3);
    let down: Vec<Ray> = (0..2000)
        .map(|_| Ray { origin: [dice.number(-0.3, 0.8), dice.number(-0.2, 0.2), 20.0], direction: [0.0, 0.0, -1.0] })
        .collect();
    check("in place", &data, &down, 1900);
    let verdict = compare(&data, &moved, &down);
    assert!(verdict.differing > 1000, "{verdict:?}");
}
