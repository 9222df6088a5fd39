//! Images at a level of detail, compared with images at full detail in eight times as many rows and columns.

use super::harness::{EXACT, Image, TestFrame, look_at_view};
use super::robots::{sr5, sr5_view};
use crate::frame::Channels;
use crate::request::RasterCfg;
use crate::visibility::View;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::{Cylinder, Mesh, Sphere};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Instance, Light, LightKind, Material, PoseF32, RenderScene};
use kinetoscope_testkit::scenes::checker_plane;
use nalgebra::Vector3;
use std::sync::{Arc, LazyLock};

/// Rows and columns of fine pixels per pixel.
const FINE_PER_PIXEL: usize = 8;
/// Largest displacement by levels \[pixels\]: half a pixel, and twice the steps to which vertices are snapped.
const MAX_SHIFT_PIXELS: f64 = 0.5 + 2.0 / 256.0;
/// Largest displacement by levels \[m\], with a margin for rounding.
const MAX_SHIFT_METERS: f32 = 1e-3 + 1e-6;

const OFF: RasterCfg = EXACT;
pub(super) const ON: RasterCfg = RasterCfg { lod: true, ..OFF };

fn prepared(mesh: &TriMesh) -> Mesh {
    Mesh { mesh: Arc::new(RenderMesh::new(mesh, RenderMesh::DEFAULT_CREASE_ANGLE)) }
}

/// A dense ball, a dense cylinder and a dense bumpy ball, without levels.
static PREPARED: LazyLock<[RenderMesh; 3]> = LazyLock::new(|| {
    let mut bumpy = Shape::from(Sphere { radius: 0.15 }).tessellate(220);
    for p in &mut bumpy.positions {
        let k = 1.0 + 0.1 * (40.0 * p[0]).sin() * (37.0 * p[1]).cos() * (35.0 * p[2]).sin();
        *p = p.map(|x| x * k);
    }
    let cylinder = Shape::from(Cylinder { radius: 0.1, half_length: 0.2 }).tessellate(700);
    let ball = Shape::from(Sphere { radius: 0.15 }).tessellate(200);
    [ball, cylinder, bumpy].map(|mesh| RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE))
});

/// These meshes, apart from each other, in front of a ground. All tests share the meshes and their levels.
fn dense() -> (RenderScene, Vec<PoseF32>) {
    static MESHES: LazyLock<[Mesh; 3]> = LazyLock::new(new_meshes);
    scene_of(&MESHES)
}

/// Copies of the meshes, whose levels are not built yet.
fn new_meshes() -> [Mesh; 3] {
    PREPARED.clone().map(|mesh| Mesh { mesh: Arc::new(mesh) })
}

fn scene_of(meshes: &[Mesh; 3]) -> (RenderScene, Vec<PoseF32>) {
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::from_translation([0., 0., -0.3])];
    for (k, mesh) in meshes.iter().enumerate() {
        instances.push(Instance::new(mesh.clone(), Material::from_rgba([0.8, 0.6, 0.3, 1.0]), k as i32 + 1));
        let pose = kinetoscope_scene::pose::from_xyz_rpy([0.0, 0.4 * k as f64 - 0.4, 0.0], [0.3 * k as f64, 0.2, 0.1]);
        poses.push(PoseF32::from(&pose));
    }
    let mut scene = RenderScene::new(instances).unwrap();
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 4.0 };
    scene.lights.push(Light { kind: spot, position: [1., 1., 3.], direction: [-1., -1., -3.], ..Light::default() });
    (scene, poses)
}

/// The image at full detail, and all fine pixels within half a pixel of each pixel's center.
struct Truth<'a> {
    view: &'a View,
    plain: Image,
    fine: Image,
    /// Fine pixels near the center of a pixel, counted from the one above and left of the pixel.
    near: Vec<usize>,
}

impl<'a> Truth<'a> {
    fn new(still: &'a TestFrame) -> Self {
        // An odd number of fine pixels would have one at the center; all of them are within reach here.
        let (k, View { width, height, fx, fy, cx, cy, .. }) = (FINE_PER_PIXEL as f32, still.view);
        let (width, height) = (width * FINE_PER_PIXEL, height * FINE_PER_PIXEL);
        let view = View { width, height, fx: fx * k, fy: fy * k, cx: cx * k, cy: cy * k, ..still.view };
        let cfg = RasterCfg { shadows: false, samples: 1, ..OFF };
        let channels = Channels { mask: true, depth: true, ..Channels::NONE };
        let fine = TestFrame { cfg, view, channels, ..still.clone() }.draw();
        // The displacement by levels plus half the diagonal of a fine pixel, so that features between fine pixels
        // count.
        let reach = MAX_SHIFT_PIXELS * FINE_PER_PIXEL as f64 + std::f64::consts::FRAC_1_SQRT_2;
        let middle = (FINE_PER_PIXEL + 1) as f64 / 2.0;
        assert!(reach < middle + 1.0, "a margin of one fine pixel is enough");
        let within = |k: &usize| ((k % width) as f64 - middle).hypot((k / width) as f64 - middle) <= reach;
        let near = (0..(FINE_PER_PIXEL + 2) * width).filter(within).collect();
        Self { view: &still.view, plain: still.draw(), fine, near }
    }

    /// Masks and depths at full detail near the center of an inner pixel.
    fn near(&self, x: usize, y: usize) -> impl Iterator<Item = (i32, f32)> {
        let first = (y * FINE_PER_PIXEL - 1) * self.fine.width + x * FINE_PER_PIXEL - 1;
        self.near.iter().map(move |k| (self.fine.mask()[first + k], self.fine.depth()[first + k]))
    }
}

/// Differences between an image and full detail nearby.
#[derive(Clone, Copy, Debug, Default)]
struct Differences {
    /// Pixels whose mask does not occur nearby.
    masks: usize,
    /// Pixels of meshes away from silhouettes.
    compared: usize,
    /// Compared pixels whose depth is outside of the depths nearby, with a margin of a millimeter.
    depths: usize,
    /// Largest difference of depth where the mesh faces the camera \[m\].
    facing: f32,
    /// Pixels that differ from full detail.
    changed: usize,
}

impl Truth<'_> {
    /// Compares an image with full detail.
    fn compare(&self, coarse: &Image) -> Differences {
        let Self { view, plain, .. } = self;
        let mut found = Differences::default();
        for k in plain.inner() {
            let (mask, depth, own) = (coarse.mask()[k], coarse.depth()[k], plain.depth()[k]);
            found.changed += usize::from(depth.to_bits() != own.to_bits());
            let (mut seen, mut alone, mut low, mut high) = (false, true, f32::MAX, f32::MIN);
            for (id, depth) in self.near(k % view.width, k / view.width) {
                (seen, alone) = (seen || id == mask, alone && id == mask);
                (low, high) = (low.min(depth), high.max(depth));
            }
            if !seen {
                found.masks += 1;
                continue;
            }
            // Silhouettes, against another surface or the same: steeper than 4 over the pixel and half of its
            // neighbors. There depth falls like a root of the distance from the edge, and edges are between fine
            // pixels. The ground has no levels.
            let width = 2.0 * MAX_SHIFT_PIXELS as f32 * low / view.fx;
            if !alone || mask == 0 || mask == 100 || high - low > 4.0 * width {
                continue;
            }
            found.compared += 1;
            found.depths += usize::from(depth < low - MAX_SHIFT_METERS || depth > high + MAX_SHIFT_METERS);
            let to = Vector3::from(plain.position()[k]) - Vector3::from(view.world_from_camera.translation);
            let cosine = -to.dot(&Vector3::from(plain.normal()[k])) / to.norm();
            if cosine > 0.9 && high - low < width {
                found.facing = found.facing.max((depth - own).abs());
            }
        }
        found
    }
}

/// Checks the image with levels, and images that are wrong: with the camera a pixel to the side, and 3 mm back.
fn check(name: &str, scene: (RenderScene, Vec<PoseF32>), view: View) {
    let still = TestFrame { cfg: OFF, ..TestFrame::new(scene, view) };
    let truth = Truth::new(&still);
    let found = truth.compare(&still.with(|still| still.cfg = ON).draw());
    assert!(found.changed * 4 > found.compared, "{name}: levels are in use: {found:?}");
    assert_eq!((found.masks, found.depths), (0, 0), "{name}: {found:?}");
    // 1 mm off, at an angle of up to acos 0.9.
    assert!(found.compared > 100 && found.facing <= 1.2e-3, "{name}: {found:?}");
    let wrong = truth.compare(&still.draw_view(View { cx: view.cx + 1.0, ..view }));
    assert!(wrong.masks > 0, "{name}: a mask that is a pixel off must be found: {wrong:?}");
    let mut back = view;
    let forward = [0, 1, 2].map(|k| back.world_from_camera.rotation[k][2]);
    (0..3).for_each(|k| back.world_from_camera.translation[k] -= 0.003 * forward[k]);
    let wrong = truth.compare(&still.draw_view(back));
    assert!(wrong.depths > 0 && wrong.facing > 2e-3, "{name}: depths that are 3 mm off must be found: {wrong:?}");
}

#[test]
fn dense_meshes() {
    for (distance, size) in [(0.7f32, [160, 120]), (1.2, [160, 120]), (1.2, [64, 64]), (3.0, [320, 100])] {
        let view = look_at_view(size, 0.8, [distance, 0.3 * distance, 0.4 * distance], [0.; 3]);
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

/// Dense meshes, two of them transparent.
pub(super) fn transparent() -> TestFrame {
    transparent_scene(dense())
}

/// [`transparent`], whose levels are not built yet.
pub(super) fn new_transparent() -> TestFrame {
    transparent_scene(scene_of(&new_meshes()))
}

fn transparent_scene((scene, poses): (RenderScene, Vec<PoseF32>)) -> TestFrame {
    let mut instances = scene.instances().to_vec();
    (instances[1].material.rgba[3], instances[2].material.rgba[3]) = (0.4, 0.7);
    let mut veiled = RenderScene::new(instances).unwrap();
    veiled.lights = scene.lights;
    TestFrame { cfg: OFF, ..TestFrame::new((veiled, poses), look_at_view([203, 150], 0.8, [1.2, 0.4, 0.5], [0.; 3])) }
}

/// The level of an instance does not depend on other instances.
#[test]
fn independent_levels() {
    let (scene, poses) = dense();
    let view = look_at_view([160, 120], 0.8, [1.2, 0.4, 0.5], [0.; 3]);
    let draw = |scene, poses| TestFrame { cfg: ON, ..TestFrame::new((scene, poses), view) }.draw();
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
    let of = |textured: bool| {
        let mut still = transparent();
        let mut instances = still.scene.instances().to_vec();
        for instance in &mut instances[1..] {
            let mut mesh = instance.shape.tessellate(0);
            mesh.uvs = textured.then(|| vec![[0.0; 2]; mesh.positions.len()]);
            instance.shape = prepared(&mesh).into();
        }
        let lights = std::mem::take(&mut still.scene.lights);
        still.scene = RenderScene::new(instances).unwrap();
        still.scene.lights = lights;
        still
    };
    let (plain, textured) = (of(false), of(true));
    let draw = |still: &TestFrame, cfg| still.with(|still| still.cfg = cfg).draw().bits();
    let expected = draw(&plain, OFF);
    assert!(draw(&textured, OFF) == expected && draw(&textured, ON) == expected);
    assert!(draw(&plain, ON) != expected, "levels are in use");
    assert!(RasterCfg::default().lod, "levels are the default");
}
