//! Small pictures that were looked at once. `KINETOSCOPE_BLESS=1` writes them anew.

use super::super::{Channels, Frame, Rasterizer};
use super::scenes::{checker_plane, every_shape, figure};
use crate::visibility::View;
use image::RgbaImage;
use scene::{Instance, Material, PoseF32, RenderScene};
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
