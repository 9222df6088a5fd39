//! Pictures with level of detail against pictures of the meshes themselves, in eight times as many rows and columns.

use super::super::{CameraCfg, Channels, Frame, ParallelRasterizer, RasterCfg, Rasterizer, Shot};
use super::determinism::bits;
use super::robots::{sr5, sr5_view};
use super::scenes::{EXACT, checker_plane};
use crate::lanes::levels;
use crate::visibility::View;
use scene::mesh::TriMesh;
use scene::shape::{Cylinder, Mesh, Sphere};
use scene::{Instance, Light, LightKind, Material, PoseF32, RenderMesh, RenderScene, Shape};
use std::sync::Arc;

/// Rows and columns of fine pixels in a pixel.
const TIMES: usize = 8;
/// What levels may move a point by: half a pixel, and the steps to which vertices are snapped, twice.
const PIXELS: f64 = 0.5 + 2.0 / 256.0;
/// \[m\]; a little more for rounding.
const METRES: f32 = 1e-3 + 1e-6;

const OFF: RasterCfg = EXACT;
const ON: RasterCfg = RasterCfg { lod: true, ..OFF };

fn draw(cfg: RasterCfg, scene: &RenderScene, poses: &[PoseF32], view: &View) -> Frame {
    let mut frame = Frame::new(view.width, view.height, Channels::ALL);
    Rasterizer::new(cfg).render(scene, poses, view, &mut frame).unwrap();
    frame
}

/// A dense ball, a dense cylinder and a dense bumpy ball, apart from each other, before a ground.
fn dense() -> (RenderScene, Vec<PoseF32>) {
    let prepare = |mesh: &TriMesh| Mesh { mesh: Arc::new(RenderMesh::new(mesh, RenderMesh::CREASE)) };
    let mut bumpy = Shape::from(Sphere { radius: 0.15 }).tessellate(220);
    for p in &mut bumpy.positions {
        let k = 1.0 + 0.1 * (40.0 * p[0]).sin() * (37.0 * p[1]).cos() * (35.0 * p[2]).sin();
        *p = p.map(|x| x * k);
    }
    let cylinder = Shape::from(Cylinder { radius: 0.1, half_length: 0.2 }).tessellate(700);
    let ball = Shape::from(Sphere { radius: 0.15 }).tessellate(200);
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::from_translation([0., 0., -0.3])];
    for (k, mesh) in [ball, cylinder, bumpy].iter().enumerate() {
        instances.push(Instance::new(prepare(mesh), Material::from_rgba([0.8, 0.6, 0.3, 1.0]), k as i32 + 1));
        let pose = scene::pose::from_xyz_rpy([0.0, 0.4 * k as f64 - 0.4, 0.0], [0.3 * k as f64, 0.2, 0.1]);
        poses.push(PoseF32::from(&pose));
    }
    let mut scene = RenderScene::new(instances).unwrap();
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 4.0 };
    scene.lights.push(Light { kind: spot, position: [1., 1., 3.], direction: [-1., -1., -3.], ..Light::default() });
    (scene, poses)
}

/// What the mesh itself shows within half a pixel of each pixel's centre.
struct Around {
    width: usize,
    masks: Vec<i32>,
    depths: Vec<f32>,
}

impl Around {
    fn new(scene: &RenderScene, poses: &[PoseF32], view: &View) -> Self {
        // An odd number of fine pixels would have one at the centre; all of them are within reach here.
        let k = TIMES as f32;
        let fine = View {
            width: view.width * TIMES,
            height: view.height * TIMES,
            fx: view.fx * k,
            fy: view.fy * k,
            cx: view.cx * k,
            cy: view.cy * k,
            ..*view
        };
        let frame = draw(RasterCfg { shadows: false, samples: 1, ..OFF }, scene, poses, &fine);
        Self { width: fine.width, masks: frame.mask.unwrap(), depths: frame.depth.unwrap() }
    }

    /// Masks and depths that the mesh has near a pixel's centre: as far as levels reach, and half the diagonal of a fine
    /// pixel farther, so that nothing between fine pixels is missed.
    fn near(&self, x: usize, y: usize) -> impl Iterator<Item = (i32, f32)> {
        let reach = PIXELS * TIMES as f64 + std::f64::consts::FRAC_1_SQRT_2;
        let height = self.masks.len() / self.width;
        let middle = [x, y].map(|i| ((i * TIMES + TIMES / 2) as f64) - 0.5);
        let span =
            move |c: f64, size: usize| (c - reach).ceil().max(0.0) as usize..((c + reach) as usize + 1).min(size);
        span(middle[1], height).flat_map(move |row| {
            let dy = row as f64 - middle[1];
            span(middle[0], self.width).filter_map(move |column| {
                let dx = column as f64 - middle[0];
                let at = row * self.width + column;
                (dx * dx + dy * dy <= reach * reach).then(|| (self.masks[at], self.depths[at]))
            })
        })
    }
}

/// How a picture differs from what is near in the mesh's own.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    pixels: usize,
    /// Pixels whose mask is nowhere near.
    masks: usize,
    /// Pixels of meshes away from silhouettes.
    compared: usize,
    /// Those of them whose depth is not between those near, and a millimetre more.
    depths: usize,
    /// Where the mesh is not seen at a slant: largest difference of their depth \[m\].
    facing: f32,
    /// Pixels that are not the same as without levels.
    changed: usize,
}

/// Compares a picture with the meshes themselves.
fn compare(scene: &RenderScene, poses: &[PoseF32], view: &View, coarse: &Frame) -> Found {
    let around = Around::new(scene, poses, view);
    let plain = draw(OFF, scene, poses, view);
    let (mask, depth) = (coarse.mask.as_ref().unwrap(), coarse.depth.as_ref().unwrap());
    let (normal, position) = (plain.normal.as_ref().unwrap(), plain.position.as_ref().unwrap());
    let own = plain.depth.as_ref().unwrap();
    let mut found = Found::default();
    for y in 1..view.height - 1 {
        for x in 1..view.width - 1 {
            let k = y * view.width + x;
            found.pixels += 1;
            found.changed += usize::from(depth[k].to_bits() != own[k].to_bits());
            if !around.near(x, y).any(|(id, _)| id == mask[k]) {
                found.masks += 1;
                continue;
            }
            let (low, high) = around.near(x, y).fold((f32::MAX, f32::MIN), |(l, h), (_, d)| (l.min(d), h.max(d)));
            // Silhouettes, against other things or the same: steeper than 4 over the pixel and its half neighbours. There
            // depth falls like a root of the distance from the edge, and edges are between fine pixels. The ground has
            // no levels.
            let width = 2.0 * PIXELS as f32 * low / view.fx;
            let alone = around.near(x, y).all(|(id, _)| id == mask[k]) && mask[k] != 0 && mask[k] != 100;
            if !alone || high - low > 4.0 * width {
                continue;
            }
            found.compared += 1;
            found.depths += usize::from(depth[k] < low - METRES || depth[k] > high + METRES);
            let to = [0, 1, 2].map(|a| position[3 * k + a] - view.world_from_camera.translation[a]);
            let length = to.iter().map(|x| x * x).sum::<f32>().sqrt();
            let cosine = -(0..3).map(|a| to[a] * normal[3 * k + a]).sum::<f32>() / length;
            if cosine > 0.9 && high - low < width {
                found.facing = found.facing.max((depth[k] - own[k]).abs());
            }
        }
    }
    found
}

/// The picture with levels, and a picture that is wrong: with the camera a pixel to the side, and 3 mm back.
fn check(name: &str, scene: &RenderScene, poses: &[PoseF32], view: &View) {
    let found = compare(scene, poses, view, &draw(ON, scene, poses, view));
    println!("{name}: {found:?}");
    assert!(found.changed * 4 > found.compared, "{name}: levels are in use: {found:?}");
    assert_eq!((found.masks, found.depths), (0, 0), "{name}: {found:?}");
    assert!(found.compared > 100, "{name}: {found:?}");
    // 1 mm off, seen at an angle of up to acos 0.9.
    assert!(found.facing <= 1.2e-3, "{name}: {found:?}");
    let shifted = View { cx: view.cx + 1.0, ..*view };
    let wrong = compare(scene, poses, view, &draw(OFF, scene, poses, &shifted));
    assert!(wrong.masks > 0, "{name}: a mask that is a pixel off must be found: {wrong:?}");
    let mut back = *view;
    let forward = [0, 1, 2].map(|k| back.world_from_camera.rotation[k][2]);
    (0..3).for_each(|k| back.world_from_camera.translation[k] -= 0.003 * forward[k]);
    let wrong = compare(scene, poses, view, &draw(OFF, scene, poses, &back));
    assert!(wrong.depths > 0 && wrong.facing > 2e-3, "{name}: depths that are 3 mm off must be found: {wrong:?}");
}

#[test]
fn levels_move_nothing_by_more_than_half_a_pixel_or_a_millimetre() {
    let (scene, poses) = dense();
    for (distance, size) in [(0.7f32, [160, 120]), (1.2, [160, 120]), (1.2, [64, 64]), (3.0, [320, 100])] {
        let eye = [distance, 0.3 * distance, 0.4 * distance];
        let view = View::look_at(size, 0.8, eye, [0., 0., 0.], [0., 0., 1.]).unwrap();
        check(&format!("dense meshes at {distance} m, {size:?}"), &scene, &poses, &view);
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn levels_of_the_vendors_robot_move_nothing_by_more_than_half_a_pixel_or_a_millimetre() {
    let (scene, poses) = sr5(1);
    for (size, fovy) in [([64, 64], 0.7), ([160, 120], 0.7), ([160, 120], 0.25)] {
        let wide = sr5_view(1, size);
        let zoom = (0.35f32).tan() / (0.5f32 * fovy).tan();
        let view = View { fx: wide.fx * zoom, fy: wide.fy * zoom, ..wide };
        check(&format!("SR5, {size:?}, {fovy}"), &scene, &poses, &view);
    }
}

/// A scene with meshes that are dense, a veil and a glass among them, and a view.
fn veiled() -> (RenderScene, Vec<PoseF32>, View) {
    let (scene, poses) = dense();
    let mut instances = scene.instances().to_vec();
    (instances[1].material.rgba[3], instances[2].material.rgba[3]) = (0.4, 0.7);
    let mut veiled = RenderScene::new(instances).unwrap();
    veiled.lights = scene.lights;
    (veiled, poses, View::look_at([203, 150], 0.8, [1.2, 0.4, 0.5], [0.; 3], [0., 0., 1.]).unwrap())
}

#[test]
fn levels_are_the_same_with_every_instruction_set_and_number_of_threads() {
    let (scene, poses, view) = veiled();
    let expected = bits(&draw(ON, &scene, &poses, &view));
    assert!(expected != bits(&draw(OFF, &scene, &poses, &view)), "levels are in use");
    for level in levels() {
        let mut frame = Frame::new(view.width, view.height, Channels::ALL);
        Rasterizer::with_level(ON, level).render(&scene, &poses, &view, &mut frame).unwrap();
        assert!(bits(&frame) == expected, "{level:?}");
    }
    for threads in [2, 3] {
        for count in [1, 9] {
            // New meshes, so that threads meet while levels are made.
            let (scene, poses, view) = veiled();
            let mut frames = vec![Frame::new(view.width, view.height, Channels::ALL); count];
            let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None };
            let mut jobs: Vec<_> = frames.iter_mut().map(|frame| (shot, frame.as_mut())).collect();
            ParallelRasterizer::new(ON, threads).render(&mut jobs).unwrap();
            assert!(frames.iter().all(|frame| bits(frame) == expected), "{threads} threads, {count} pictures");
        }
    }
}

#[test]
fn what_else_is_drawn_changes_no_level() {
    let (scene, poses) = dense();
    let view = View::look_at([160, 120], 0.8, [1.2, 0.4, 0.5], [0.; 3], [0., 0., 1.]).unwrap();
    let all = draw(ON, &scene, &poses, &view);
    for k in 1..scene.instances().len() {
        let alone = RenderScene::new(vec![scene.instances()[k].clone()]).unwrap();
        let alone = draw(ON, &alone, &poses[k..=k], &view);
        let (mask, own) = (all.mask.as_ref().unwrap(), alone.mask.as_ref().unwrap());
        let (depth, other) = (all.depth.as_ref().unwrap(), alone.depth.as_ref().unwrap());
        let here: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] == k as i32).collect();
        assert!(here.len() > 200, "instance {k} is seen");
        assert!(here.iter().all(|&i| own[i] == k as i32 && depth[i].to_bits() == other[i].to_bits()), "instance {k}");
    }
}

/// Meshes with texture coordinates have no levels; without a texture they look the same.
#[test]
fn without_levels_meshes_are_drawn_as_they_are() {
    let (scene, poses, view) = veiled();
    let prepared = |textured: bool| {
        let mut instances = scene.instances().to_vec();
        for instance in &mut instances[1..] {
            let mut mesh = instance.shape.tessellate(0);
            mesh.uvs = textured.then(|| vec![[0.0; 2]; mesh.positions.len()]);
            instance.shape = Mesh { mesh: Arc::new(RenderMesh::new(&mesh, RenderMesh::CREASE)) }.into();
        }
        let mut scene_of = RenderScene::new(instances).unwrap();
        scene_of.lights.clone_from(&scene.lights);
        scene_of
    };
    let (plain, textured) = (prepared(false), prepared(true));
    let expected = bits(&draw(OFF, &plain, &poses, &view));
    for cfg in [OFF, ON] {
        assert!(bits(&draw(cfg, &textured, &poses, &view)) == expected, "{cfg:?}");
    }
    assert!(bits(&draw(ON, &plain, &poses, &view)) != expected, "levels are in use");
    assert!(CameraCfg::default().raster.lod, "levels are the default");
}
