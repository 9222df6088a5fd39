//! Small images that were inspected once. `KINETOSCOPE_BLESS=1` rewrites them.

use super::harness::{Image, TestFrame, look_at_view};
use crate::frame::Channels;
use crate::renderer::Renderer;
use image::RgbaImage;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{Box, Plane};
use kinetoscope_scene::{Instance, Material, PoseF32, RenderScene, Sky};
use kinetoscope_testkit::scenes::{checker_plane, every_shape, humanoid, instances, matte, translation, unlit};
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/data/golden/{name}.png"))
}

fn color(image: &Image) -> RgbaImage {
    let (width, color) = (image.width as u32, image.color().as_flattened().to_vec());
    RgbaImage::from_raw(width, color.len() as u32 / 4 / width, color).unwrap()
}

/// Compares with a tolerance of two steps of 255 per number. A failure writes expected image, actual image and their
/// difference.
fn compare(name: &str, still: &TestFrame) {
    let (golden, actual) = (file(name), &color(&still.draw()));
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
        // In the build folder, beside the test program.
        let folder = std::env::current_exe().unwrap().parent().unwrap().join("golden");
        std::fs::create_dir_all(&folder).unwrap();
        let mut difference = expected.clone();
        difference.iter_mut().zip(actual.iter()).for_each(|(a, b)| *a = a.abs_diff(*b).saturating_mul(8));
        difference.pixels_mut().for_each(|p| p[3] = 255);
        for (kind, image) in [("expected", &expected), ("actual", actual), ("diff", &difference)] {
            image.save(folder.join(format!("{name}-{kind}.png"))).unwrap();
        }
        panic!("{name} differs by up to {worst} of 255; see {}", folder.display());
    }
}

#[test]
fn full_figure() {
    let (scene, poses) = humanoid();
    let still = TestFrame::new((scene, poses), look_at_view([96, 96], 0.7, [2.6, 1.6, 1.6], [0.2, 0., 0.8]));
    compare("figure", &still);
    let large = still.draw_view(look_at_view([640, 480], 0.8, [2.6, -1.6, 1.6], [0.2, 0., 0.8]));
    let mut ids = (1..still.scene.instances().len() as i32).chain([100, 0]);
    assert!(ids.all(|id| large.mask().contains(&id)), "everything is seen, ground and sky too");
}

#[test]
fn shapes() {
    let mut instances = vec![checker_plane()];
    let mut poses = vec![translation(0., 0., -0.4)];
    for (k, shape) in every_shape().into_iter().enumerate() {
        let [r, g, b] = [[0.9, 0.3, 0.2], [0.2, 0.6, 0.9], [0.9, 0.8, 0.2], [0.4, 0.8, 0.3]][k % 4];
        let material = Material::from_rgba([r, g, b, if k == 4 { 0.5 } else { 1.0 }]);
        instances.push(Instance::new(shape, material, k as i32 + 1));
        poses.push(translation(0.9 * (k / 4) as f32 - 0.4, 0.9 * (k % 4) as f32 - 1.3, 0.0));
    }
    let scene = (RenderScene::new(instances).unwrap(), poses);
    compare("every_shape", &TestFrame::new(scene, look_at_view([128, 72], 0.6, [3.5, 0.5, 3.0], [0.1, 0.05, 0.])));
}

/// A Cornell box: white, a red and a green wall, two blocks, and a light in the ceiling as the only light.
fn cornell_box() -> TestFrame {
    let (white, red, green) = (matte([0.87, 0.87, 0.85]), matte([0.8, 0.2, 0.15]), matte([0.3, 0.7, 0.25]));
    let light = Material { emission: 12.0, ..matte([1.0, 0.93, 0.8]) };
    let wall = |half: f32| Shape::from(Plane { half: [half; 2] });
    let block = |height| Shape::from(Box { half: [0.3, 0.3, height] });
    // The columns are the axes of a plane: its normal faces inward.
    let facing = |rotation, translation| PoseF32 { rotation, translation };
    let (up, down) = ([[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]], [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]]);
    let turned = |angle: f32, at| {
        let (sin, cos) = angle.sin_cos();
        facing([[cos, -sin, 0.], [sin, cos, 0.], [0., 0., 1.]], at)
    };
    let (scene, poses) = instances([
        (wall(1.0), white.clone(), facing(up, [0., 0., 0.])),
        (wall(1.0), white.clone(), facing(down, [0., 0., 2.])),
        (wall(1.0), white.clone(), facing([[1., 0., 0.], [0., 0., -1.], [0., 1., 0.]], [0., 1., 1.])),
        (wall(1.0), red, facing([[0., 0., 1.], [1., 0., 0.], [0., 1., 0.]], [-1., 0., 1.])),
        (wall(1.0), green, facing([[0., 0., -1.], [-1., 0., 0.], [0., 1., 0.]], [1., 0., 1.])),
        (wall(0.25), light, facing(down, [0., 0., 1.99])),
        (block(0.3), white.clone(), turned(-0.3, [0.35, -0.35, 0.3])),
        (block(0.6), white, turned(0.35, [-0.35, 0.3, 0.6])),
    ]);
    let mut scene = unlit(scene);
    scene.sky = Sky::uniform([0.0; 3]);
    let channels = Channels { color: true, ..Channels::default() };
    TestFrame { channels, ..TestFrame::new((scene, poses), look_at_view([64; 2], 0.6, [0., -4.2, 1.], [0., 0., 1.])) }
}

/// The golden image is converged. The mean of an image with few paths equals it, within a noise that two seeds show.
#[test]
fn room_of_cornell() {
    /// Pixels along a block, whose means are compared, and blocks along a side.
    const BLOCK: usize = 8;
    let still = cornell_box();
    let draw = |samples, max_bounces, seed| {
        color(&still.with_renderer(Renderer::RayTraced { samples, max_bounces, denoise: false, seed }))
    };
    let golden = file("cornell_box");
    if std::env::var_os("KINETOSCOPE_BLESS").is_some() {
        draw(2048, 12, 1).save(&golden).unwrap();
        return;
    }
    let golden = image::open(&golden).unwrap().to_rgba8();
    let means = |image: &RgbaImage| {
        let mut sums = vec![0.0f64; 3 * BLOCK * BLOCK];
        for (x, y, pixel) in image.enumerate_pixels() {
            let block = y as usize / BLOCK * BLOCK + x as usize / BLOCK;
            (0..3).for_each(|c| sums[3 * block + c] += f64::from(pixel[c]) / (BLOCK * BLOCK) as f64);
        }
        sums
    };
    let rms =
        |a: &[f64], b: &[f64]| (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
    let (expected, few, other) = (means(&golden), means(&draw(64, 12, 2)), means(&draw(64, 12, 3)));
    // The noise of one image, not of two.
    let noise = rms(&few, &other) / f64::sqrt(2.0);
    let off = rms(&few, &expected);
    // The tone curve is concave, so noise makes means slightly darker; and the golden image is rounded to whole bytes.
    assert!(off < 1.5 * noise + 0.3 && noise < 1.0, "off by {off}, noise is {noise}");
    // Controls: a missing bounce is detected, and so are the colors of the walls.
    let less = rms(&means(&draw(64, 2, 2)), &expected);
    assert!(less > 3.0 * (1.5 * noise + 0.3), "{less}");
    let (left, right) = (golden.get_pixel(14, 44).0, golden.get_pixel(50, 36).0);
    assert!(left[0] > left[1] && right[1] > right[0], "{left:?} {right:?}");
}
