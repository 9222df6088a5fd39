//! Small pictures that were looked at once. `KINETOSCOPE_BLESS=1` writes them anew.

use super::super::{Channels, Frame, Rasterizer, Renderer};
use super::scenes::{checker_plane, every_shape, figure};
use crate::visibility::View;
use image::RgbaImage;
use scene::shape::{Box, Plane};
use scene::{Headlight, Hemisphere, Instance, Material, PoseF32, RenderScene, Sky};
use std::path::Path;

/// Compares with a tolerance of two steps of 255 per number. A failure writes expected, actual and their difference.
fn compare(name: &str, actual: &RgbaImage) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let golden = root.join("tests/data/golden").join(format!("{name}.png"));
    if std::env::var_os("KINETOSCOPE_BLESS").is_some() {
        std::fs::create_dir_all(golden.parent().unwrap()).unwrap();
        actual.save(&golden).unwrap();
        return;
    }
    let expected = image::open(&golden).unwrap().to_rgba8();
    assert_eq!(expected.dimensions(), actual.dimensions(), "{name}");
    let far = |(a, b): (&u8, &u8)| a.abs_diff(*b);
    let worst = expected.iter().zip(actual.iter()).map(far).max().unwrap_or(0);
    if worst > 2 {
        // Beside the test program, in the build folder.
        let folder = std::env::current_exe().unwrap().parent().unwrap().join("golden");
        std::fs::create_dir_all(&folder).unwrap();
        let mut difference = expected.clone();
        difference.iter_mut().zip(actual.iter()).for_each(|(a, b)| *a = a.abs_diff(*b).saturating_mul(8));
        difference.pixels_mut().for_each(|p| p[3] = 255);
        for (kind, picture) in [("expected", &expected), ("actual", actual), ("diff", &difference)] {
            picture.save(folder.join(format!("{name}-{kind}.png"))).unwrap();
        }
        panic!("{name} differs by up to {worst} of 255; see {}", folder.display());
    }
}

fn color(scene: &RenderScene, poses: &[PoseF32], view: &View) -> RgbaImage {
    let mut frame = Frame::new(view.width, view.height, Channels { color: true, ..Channels::default() });
    Rasterizer::default().render(scene, poses, view, &mut frame).unwrap();
    RgbaImage::from_raw(view.width as u32, view.height as u32, frame.color.unwrap()).unwrap()
}

#[test]
fn golden_figure() {
    let (scene, poses) = figure();
    let view = View::look_at([96, 96], 0.7, [2.6, 1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    compare("figure", &color(&scene, &poses, &view));
}

#[test]
fn golden_every_shape() {
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::from_translation([0., 0., -0.4])];
    for (k, shape) in every_shape().into_iter().enumerate() {
        let hue = [[0.9, 0.3, 0.2], [0.2, 0.6, 0.9], [0.9, 0.8, 0.2], [0.4, 0.8, 0.3]][k % 4];
        let material = Material::from_rgba([hue[0], hue[1], hue[2], if k == 4 { 0.5 } else { 1.0 }]);
        instances.push(Instance::new(shape, material, k as i32 + 1));
        poses.push(PoseF32::from_translation([0.9 * (k / 4) as f32 - 0.4, 0.9 * (k % 4) as f32 - 1.3, 0.0]));
    }
    let scene = RenderScene::new(instances).unwrap();
    let view = View::look_at([128, 72], 0.6, [3.5, 0.5, 3.0], [0.1, 0.05, 0.], [0., 0., 1.]).unwrap();
    compare("every_shape", &color(&scene, &poses, &view));
}

/// A box after Cornell's: white, a red and a green wall, two blocks, and a lamp in the ceiling that is all the light there is.
fn cornell_box() -> (RenderScene, Vec<PoseF32>) {
    let matt = |rgb: [f32; 3]| Material { specular: 0.0, ..Material::from_rgba([rgb[0], rgb[1], rgb[2], 1.0]) };
    let (white, red, green) = (matt([0.87, 0.87, 0.85]), matt([0.8, 0.2, 0.15]), matt([0.3, 0.7, 0.25]));
    let lamp = Material { emission: 12.0, ..matt([1.0, 0.93, 0.8]) };
    let wall = |half: f32| Plane { half: [half; 2] };
    // Columns are the axes of a plane: its normal looks inward.
    let facing = |rotation, translation| PoseF32 { rotation, translation };
    let (up, down) = ([[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]], [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]]);
    let turned = |angle: f32, at| {
        let (sin, cos) = angle.sin_cos();
        facing([[cos, -sin, 0.], [sin, cos, 0.], [0., 0., 1.]], at)
    };
    let parts: [(Instance, PoseF32); 8] = [
        (Instance::new(wall(1.0), white.clone(), 1), facing(up, [0., 0., 0.])),
        (Instance::new(wall(1.0), white.clone(), 2), facing(down, [0., 0., 2.])),
        (Instance::new(wall(1.0), white.clone(), 3), facing([[1., 0., 0.], [0., 0., -1.], [0., 1., 0.]], [0., 1., 1.])),
        (Instance::new(wall(1.0), red, 4), facing([[0., 0., 1.], [1., 0., 0.], [0., 1., 0.]], [-1., 0., 1.])),
        (Instance::new(wall(1.0), green, 5), facing([[0., 0., -1.], [-1., 0., 0.], [0., 1., 0.]], [1., 0., 1.])),
        (Instance::new(wall(0.25), lamp, 6), facing(down, [0., 0., 1.99])),
        (Instance::new(Box { half: [0.3, 0.3, 0.3] }, white.clone(), 7), turned(-0.3, [0.35, -0.35, 0.3])),
        (Instance::new(Box { half: [0.3, 0.3, 0.6] }, white, 8), turned(0.35, [-0.35, 0.3, 0.6])),
    ];
    let (instances, poses) = parts.into_iter().unzip();
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights.clear();
    scene.headlight = Headlight { active: false, ..Headlight::default() };
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    scene.sky = Sky::uniform([0.0; 3]);
    (scene, poses)
}

/// A converged picture is the golden; a picture of few paths, whose noise two seeds tell, is that one on average.
#[test]
fn golden_cornell_box() {
    const SIDE: usize = 64;
    /// Pixels along a block, whose means are compared.
    const BLOCK: usize = 8;
    let (scene, poses) = cornell_box();
    let view = View::look_at([SIDE; 2], 0.6, [0., -4.2, 1.], [0., 0., 1.], [0., 0., 1.]).unwrap();
    let draw = |samples, max_bounces, seed| {
        let mut rasterizer = Rasterizer {
            renderer: Renderer::RayTraced { samples, max_bounces, denoise: false, seed },
            ..Rasterizer::default()
        };
        let mut frame = Frame::new(SIDE, SIDE, Channels { color: true, ..Channels::default() });
        rasterizer.render(&scene, &poses, &view, &mut frame).unwrap();
        RgbaImage::from_raw(SIDE as u32, SIDE as u32, frame.color.unwrap()).unwrap()
    };
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/golden/cornell_box.png");
    if std::env::var_os("KINETOSCOPE_BLESS").is_some() {
        draw(2048, 12, 1).save(&golden).unwrap();
        return;
    }
    let golden = image::open(&golden).unwrap().to_rgba8();
    let means = |picture: &RgbaImage| {
        let mut sums = vec![0.0f64; 3 * (SIDE / BLOCK) * (SIDE / BLOCK)];
        for (x, y, pixel) in picture.enumerate_pixels() {
            let block = y as usize / BLOCK * (SIDE / BLOCK) + x as usize / BLOCK;
            (0..3).for_each(|c| sums[3 * block + c] += f64::from(pixel[c]) / (BLOCK * BLOCK) as f64);
        }
        sums
    };
    let rms =
        |a: &[f64], b: &[f64]| (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
    let (expected, few, other) = (means(&golden), means(&draw(64, 12, 2)), means(&draw(64, 12, 3)));
    // Of one picture, not of two.
    let noise = rms(&few, &other) / f64::sqrt(2.0);
    let off = rms(&few, &expected);
    println!("off by {off} of 255, noise is {noise}");
    // Curves of the screen bend: noise makes means darker by a little; and the golden is rounded to whole bytes.
    assert!(off < 1.5 * noise + 0.3, "off by {off}, noise is {noise}");
    assert!(noise < 1.0, "{noise}");
    // Controls: light that went over one surface less is missed, and so is the colour of the walls.
    let less = rms(&means(&draw(64, 2, 2)), &expected);
    assert!(less > 3.0 * (1.5 * noise + 0.3), "{less}");
    let pixel = |x: u32, y: u32| golden.get_pixel(x, y).0;
    let (left, right) = (pixel(14, 44), pixel(50, 36));
    assert!(left[0] > left[1] && right[1] > right[0], "{left:?} {right:?}");
}
