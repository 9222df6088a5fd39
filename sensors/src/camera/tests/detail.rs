//! Images with level of detail against images of the meshes themselves, in eight times as many rows and columns.

use super::super::{CameraCfg, RasterCfg};
use super::harness::{Image, Still, look};
use super::robots::{sr5, sr5_view};
use super::scenes::{EXACT, checker_plane};
use crate::visibility::View;
use nalgebra::Vector3;
use scene::mesh::TriMesh;
use scene::shape::{Cylinder, Mesh, Sphere};
use scene::{Instance, Light, LightKind, Material, PoseF32, RenderMesh, RenderScene, Shape};
use std::sync::Arc;

/// Rows and columns of fine pixels in a pixel.
const TIMES: usize = 8;
/// The farthest that levels may move a point: half a pixel, and the steps to which vertices are snapped, twice.
const PIXELS: f64 = 0.5 + 2.0 / 256.0;
/// \[m\]; a little more for rounding.
const METRES: f32 = 1e-3 + 1e-6;

const OFF: RasterCfg = EXACT;
pub(super) const ON: RasterCfg = RasterCfg { lod: true, ..OFF };

fn prepared(mesh: &TriMesh) -> Mesh {
    Mesh { mesh: Arc::new(RenderMesh::new(mesh, RenderMesh::CREASE)) }
}

/// A dense ball, a dense cylinder and a dense bumpy ball, apart from each other, before a ground.
fn dense() -> (RenderScene, Vec<PoseF32>) {
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
        instances.push(Instance::new(prepared(mesh), Material::from_rgba([0.8, 0.6, 0.3, 1.0]), k as i32 + 1));
        let pose = scene::pose::from_xyz_rpy([0.0, 0.4 * k as f64 - 0.4, 0.0], [0.3 * k as f64, 0.2, 0.1]);
        poses.push(PoseF32::from(&pose));
    }
    let mut scene = RenderScene::new(instances).unwrap();
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 4.0 };
    scene.lights.push(Light { kind: spot, position: [1., 1., 3.], direction: [-1., -1., -3.], ..Light::default() });
    (scene, poses)
}

/// The image of the meshes themselves within half a pixel of each pixel's centre.
struct Around {
    width: usize,
    masks: Vec<i32>,
    depths: Vec<f32>,
}

impl Around {
    fn new(still: &Still) -> Self {
        // An odd number of fine pixels would have one at the centre; all of them are within reach here.
        let (k, View { width, height, fx, fy, cx, cy, .. }) = (TIMES as f32, still.view);
        let (width, height) = (width * TIMES, height * TIMES);
        let view = View { width, height, fx: fx * k, fy: fy * k, cx: cx * k, cy: cy * k, ..still.view };
        let cfg = RasterCfg { shadows: false, samples: 1, ..OFF };
        let image = Still { cfg, view, ..still.clone() }.draw();
        Self { width, masks: image.mask().to_vec(), depths: image.depth().to_vec() }
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

/// Differences of an image from the mesh's own nearby.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
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

/// Compares an image with the meshes themselves.
fn compare(still: &Still, coarse: &Image) -> Found {
    let (around, plain, view) = (Around::new(still), still.draw(), &still.view);
    let mut found = Found::default();
    for k in plain.inner() {
        let (x, y, mask, depth, own) =
            (k % view.width, k / view.width, coarse.mask()[k], coarse.depth()[k], plain.depth()[k]);
        found.changed += usize::from(depth.to_bits() != own.to_bits());
        if !around.near(x, y).any(|(id, _)| id == mask) {
            found.masks += 1;
            continue;
        }
        let (low, high) = around.near(x, y).fold((f32::MAX, f32::MIN), |(l, h), (_, d)| (l.min(d), h.max(d)));
        // Silhouettes, against other things or the same: steeper than 4 over the pixel and its half neighbours. There
        // depth falls like a root of the distance from the edge, and edges are between fine pixels. The ground has
        // no levels.
        let width = 2.0 * PIXELS as f32 * low / view.fx;
        let alone = around.near(x, y).all(|(id, _)| id == mask) && mask != 0 && mask != 100;
        if !alone || high - low > 4.0 * width {
            continue;
        }
        found.compared += 1;
        found.depths += usize::from(depth < low - METRES || depth > high + METRES);
        let to = Vector3::from(plain.position()[k]) - Vector3::from(view.world_from_camera.translation);
        let cosine = -to.dot(&Vector3::from(plain.normal()[k])) / to.norm();
        if cosine > 0.9 && high - low < width {
            found.facing = found.facing.max((depth - own).abs());
        }
    }
    found
}

/// The image with levels, and images that are wrong: with the camera a pixel to the side, and 3 mm back.
fn check(name: &str, scene: (RenderScene, Vec<PoseF32>), view: View) {
    let still = Still { cfg: OFF, ..Still::new(scene, view) };
    let found = compare(&still, &still.with(|still| still.cfg = ON).draw());
    assert!(found.changed * 4 > found.compared, "{name}: levels are in use: {found:?}");
    assert_eq!((found.masks, found.depths), (0, 0), "{name}: {found:?}");
    // 1 mm off, seen at an angle of up to acos 0.9.
    assert!(found.compared > 100 && found.facing <= 1.2e-3, "{name}: {found:?}");
    let wrong = compare(&still, &still.from(View { cx: view.cx + 1.0, ..view }));
    assert!(wrong.masks > 0, "{name}: a mask that is a pixel off must be found: {wrong:?}");
    let mut back = view;
    let forward = [0, 1, 2].map(|k| back.world_from_camera.rotation[k][2]);
    (0..3).for_each(|k| back.world_from_camera.translation[k] -= 0.003 * forward[k]);
    let wrong = compare(&still, &still.from(back));
    assert!(wrong.depths > 0 && wrong.facing > 2e-3, "{name}: depths that are 3 mm off must be found: {wrong:?}");
}

#[test]
fn dense_meshes() {
    for (distance, size) in [(0.7f32, [160, 120]), (1.2, [160, 120]), (1.2, [64, 64]), (3.0, [320, 100])] {
        let view = look(size, 0.8, [distance, 0.3 * distance, 0.4 * distance], [0.; 3]);
        check(&format!("dense meshes at {distance} m, {size:?}"), dense(), view);
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_sr5_meshes() {
    for (size, fovy) in [([64, 64], 0.7), ([160, 120], 0.7), ([160, 120], 0.25)] {
        let wide = sr5_view(1, size);
        let zoom = (0.35f32).tan() / (0.5f32 * fovy).tan();
        check(&format!("SR5, {size:?}, {fovy}"), sr5(1), View { fx: wide.fx * zoom, fy: wide.fy * zoom, ..wide });
    }
}

/// Dense meshes, a veil and a glass among them.
pub(super) fn veiled() -> Still {
    let (scene, poses) = dense();
    let mut instances = scene.instances().to_vec();
    (instances[1].material.rgba[3], instances[2].material.rgba[3]) = (0.4, 0.7);
    let mut veiled = RenderScene::new(instances).unwrap();
    veiled.lights = scene.lights;
    Still { cfg: OFF, ..Still::new((veiled, poses), look([203, 150], 0.8, [1.2, 0.4, 0.5], [0.; 3])) }
}

/// Other things change no level.
#[test]
fn independent_levels() {
    let (scene, poses) = dense();
    let view = look([160, 120], 0.8, [1.2, 0.4, 0.5], [0.; 3]);
    let draw = |scene, poses| Still { cfg: ON, ..Still::new((scene, poses), view) }.draw();
    let all = draw(scene.clone(), poses.clone());
    for (k, instance) in scene.instances().iter().enumerate().skip(1) {
        let alone = draw(RenderScene::new(vec![instance.clone()]).unwrap(), vec![poses[k]]);
        let here: Vec<usize> = (0..160 * 120).filter(|&i| all.mask()[i] == k as i32).collect();
        let same = |i: &usize| alone.mask()[*i] == k as i32 && all.depth()[*i].to_bits() == alone.depth()[*i].to_bits();
        assert!(here.len() > 200 && here.iter().all(same), "instance {k}");
    }
}

/// Meshes with texture coordinates have no levels; without a texture they look the same.
#[test]
fn textured_meshes() {
    let of = |textured: bool, cfg| {
        let mut still = veiled();
        let mut instances = still.scene.instances().to_vec();
        for instance in &mut instances[1..] {
            let mut mesh = instance.shape.tessellate(0);
            mesh.uvs = textured.then(|| vec![[0.0; 2]; mesh.positions.len()]);
            instance.shape = prepared(&mesh).into();
        }
        let lights = std::mem::take(&mut still.scene.lights);
        still.scene = RenderScene::new(instances).unwrap();
        still.scene.lights = lights;
        Still { cfg, ..still }.draw().bits()
    };
    let expected = of(false, OFF);
    assert!(of(true, OFF) == expected && of(true, ON) == expected);
    assert!(of(false, ON) != expected, "levels are in use");
    assert!(CameraCfg::default().raster.lod, "levels are the default");
}
