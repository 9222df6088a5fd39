//! Rolling shutter and motion blur compared with closed forms.

use super::harness::{Image, TestFrame};
use super::lenses::rays_of;
use crate::aperture::Aperture;
use crate::frame::Channels;
use crate::intrinsics::PixelIntrinsics;
use crate::lens::Equidistant;
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::shutter::Shutter;
use crate::visibility::{RenderError, View};
use kinetoscope_scene::shape::Box;
use kinetoscope_scene::{Material, PoseF32, RenderScene, Sky};
use kinetoscope_testkit::scenes::{instances, matte, unlit};
use kinetoscope_testkit::srgb::linear;

const HEIGHT: usize = 40;

const WIDTH: usize = 64;

/// Focal length \[pixels\].
const F: f32 = 80.0;

/// Depth of the bar's front \[m\].
const DEPTH: f32 = 2.0;

/// Half of the bar's width \[m\].
const HALF: f32 = 0.1;

/// Half of the bar's thickness \[m\]: its sides are less than a hundredth of a pixel.
const THIN: f32 = 0.0005;

/// A glowing bar across all rows, in the dark; a camera at the origin looks along x, so that the image's right is -y.
pub(super) fn bar() -> (RenderScene, View) {
    let glow = Material { emission: 1.0, ..matte([0.6; 3]) };
    let mut scene = unlit(instances([(Box { half: [THIN, HALF, 5.0] }, glow, PoseF32::IDENTITY)]).0);
    scene.sky = Sky::uniform([0.0; 3]);
    let view = View::look_at([WIDTH, HEIGHT], 0.5, [0.; 3], [1., 0., 0.], [0., 0., 1.]).unwrap();
    (scene, View { fx: F, fy: F, ..view })
}

/// Pose of the bar, with its front at the depth, `right` meters to the right.
pub(super) fn bar_at(right: f64) -> Vec<PoseF32> {
    vec![PoseF32::from_translation([DEPTH + THIN, -right as f32, 0.0])]
}

/// Speed of the bar to the right \[m/s\].
const SPEED: f64 = 3.0;

/// The bar `right` meters to the right, path traced with one center sample for all other channels; the shutter opened
/// `before` seconds ago.
fn tracer(samples: u32, shutter: Shutter, right: f64, before: f64) -> TestFrame {
    let (scene, view) = bar();
    TestFrame {
        cfg: RasterCfg { samples: 1, lod: false, ..RasterCfg::default() },
        renderer: Renderer::RayTraced { samples, max_bounces: 0, denoise: false, seed: 5 },
        channels: Channels { flow: false, ..Channels::ALL },
        shutter,
        shutter_open: Some((bar_at(right - SPEED * before), view.world_from_camera, before)),
        ..TestFrame::new((scene, bar_at(right)), view)
    }
}

/// Mean position of the light in each row, and its variance \[pixels\].
fn rows(image: &Image) -> Vec<(f64, f64)> {
    let row = |row: &[[u8; 4]]| {
        let light: Vec<f64> = row.iter().map(|p| linear(f32::from(p[1]) / 255.0)).collect();
        let sum: f64 = light.iter().sum();
        let mean = light.iter().zip(0..).map(|(l, x)| l * (f64::from(x) + 0.5)).sum::<f64>() / sum;
        let var = light.iter().zip(0..).map(|(l, x)| l * (f64::from(x) + 0.5 - mean).powi(2)).sum::<f64>() / sum;
        (mean, var)
    };
    image.color().chunks(WIDTH).map(row).collect()
}

/// The bar moves right at v; row r is read (H - 1 - r) t before the last one: there the bar is v (H - 1 - r) t f / z
/// pixels farther left.
#[test]
fn shear() {
    let (row_time, before) = (0.004, 0.2);
    let moving = tracer(64, Shutter { row_time, exposure_time: 0.0 }, 0.3, before);
    // As if the bar stood still, and the camera moved left.
    let mut camera_moves = moving.clone();
    let left = [0.0, -(SPEED * before) as f32, 0.0];
    camera_moves.shutter_open =
        Some((bar_at(0.3), PoseF32 { translation: left, ..moving.view.world_from_camera }, before));
    for image in [moving.draw(), camera_moves.draw()] {
        let pixels = f64::from(F) / f64::from(DEPTH);
        let (side, all) = (2.0 * f64::from(HALF) * pixels, rows(&image));
        for (r, (mean, var)) in all.iter().enumerate() {
            let late = (HEIGHT - 1 - r) as f64 * row_time;
            let middle = 0.5 * WIDTH as f64 + (0.3 - SPEED * late) * pixels;
            // The 64 samples in each pixel are as even as a net: at each edge, the error is below an eighth of a pixel
            // times one sample of its side. Bytes are steps of 1/255 of the whole, in partly lit pixels.
            assert!((mean - middle).abs() < 0.05, "row {r}: {mean}, not {middle}");
            assert!((var - side * side / 12.0 - 1.0 / 12.0).abs() < 0.2, "row {r}: {var}");
            // The pixel centers, at the same instant.
            for x in 0..WIDTH {
                let off = (x as f64 + 0.5 - middle).abs() - 0.5 * side;
                let (mask, depth) = (image.mask()[r * WIDTH + x], image.depth()[r * WIDTH + x]);
                assert!(off.abs() < 0.01 || mask == i32::from(off < 0.0), "row {r}, column {x}: {off}");
                assert!(mask == 0 || (depth - DEPTH).abs() < 1e-4, "{depth}");
            }
        }
        let slope = (all[HEIGHT - 1].0 - all[0].0) / (HEIGHT - 1) as f64;
        assert!((slope - SPEED * row_time * pixels).abs() < 0.002, "{slope} pixels a row");
    }
}

/// With a lens too, each row shows the bar at that row's instant. The ray of the pixel (u, v) of an equidistant lens is
/// r / f from the axis, r from the principal point, and meets the plane of the bar at z tan(r / f).
#[test]
fn lens_rows() {
    let (row_time, f) = (0.004, 30.0);
    let mut still = tracer(16, Shutter { row_time, exposure_time: 0.0 }, 0.3, 0.2);
    let [cx, cy] = [WIDTH, HEIGHT].map(|side| 0.5 * side as f64);
    let pixels = PixelIntrinsics { fx: f, fy: f, cx, cy };
    still.lens = Some(rays_of(Equidistant::default().into(), pixels, [WIDTH, HEIGHT]));
    (still.view.fx, still.view.fy) = (f as f32, f as f32);
    let image = still.draw();
    // True inside of the bar at an instant, and the approximate distance from its edge \[pixels\].
    let at = |u: f64, v: f64, late: f64| {
        let r = (u - cx).hypot(v - cy);
        let right = f64::from(DEPTH) * (r / f).tan() * (u - cx) / r;
        let off = (right - (0.3 - SPEED * late)).abs() - f64::from(HALF);
        // A pixel at the edge covers at least this much of the plane.
        (off < 0.0, off.abs() * f / f64::from(DEPTH))
    };
    let (mut seen, mut of_the_stamp) = (0, 0);
    for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
        let (u, v, k) = (x as f64 + 0.5, y as f64 + 0.5, y * WIDTH + x);
        let (inside, edge) = at(u, v, (HEIGHT - 1 - y) as f64 * row_time);
        if edge < 0.01 {
            continue;
        }
        assert_eq!(image.mask()[k], i32::from(inside), "({x}, {y}): {edge}");
        assert!(!inside || (image.depth()[k] - DEPTH).abs() < 1e-4, "({x}, {y}): {}", image.depth()[k]);
        seen += usize::from(inside);
        // The control: with the bar at its pose at the stamp most rows would be wrong.
        of_the_stamp += usize::from(inside != at(u, v, 0.0).0);
        // Paths of a pixel cover its square, half a pixel to each side of its center.
        if edge > 1.0 {
            assert_eq!(image.color()[k][0] > 0, inside, "({x}, {y}): {:?}", image.color()[k]);
        }
    }
    assert!(seen > 80 && of_the_stamp > 80, "{seen} {of_the_stamp}");
}

/// With the exposure e the bar is blurred: its variance is (v e f / z)² / 12 more, and its center is half of that way
/// behind.
#[test]
fn blur() {
    let exposure_time = 0.1;
    let still = tracer(256, Shutter { row_time: 0.0, exposure_time }, 0.2, 0.1);
    let image = still.draw();
    let pixels = f64::from(F) / f64::from(DEPTH);
    let (side, way) = (2.0 * f64::from(HALF) * pixels, SPEED * exposure_time * pixels);
    let (mean, var) = rows(&image).iter().fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
    let [mean, var] = [mean, var].map(|sum| sum / HEIGHT as f64);
    // 256 samples per pixel and 40 rows of about 16 pixels: 1.6e5 points, whose x² has a standard deviation as large as
    // its mean.
    let middle = 0.5 * WIDTH as f64 + 0.2 * pixels - 0.5 * way;
    assert!((mean - middle).abs() < 0.05, "{mean}, not {middle}");
    let expected = way * way / 12.0 + side * side / 12.0 + 1.0 / 12.0;
    assert!((var - expected).abs() < 0.02 * expected, "{var}, not {expected}");
    assert!(way * way / 12.0 > 0.5 * expected, "the control: most of it is blur");
    // The centers show the middle of the exposure.
    let hits = image.mask()[..WIDTH].iter().zip(0..).filter(|(mask, _)| **mask == 1);
    let places: Vec<f64> = hits.map(|(_, x)| f64::from(x) + 0.5).collect();
    assert!((places.iter().sum::<f64>() / places.len() as f64 - middle).abs() < 0.5);
    // Static objects look as with an instant, to the bit, and so do all objects with an instant.
    let now = Some((still.poses.clone(), still.view.world_from_camera, 0.1));
    let of = |shutter, opened: &Option<_>| {
        TestFrame { shutter, shutter_open: opened.clone(), ..still.clone() }.draw().bits()
    };
    let instant = of(Shutter::default(), &None);
    assert!(of(still.shutter, &now) == instant && of(Shutter::default(), &still.shutter_open) == instant);
    assert!(of(still.shutter, &still.shutter_open) != instant);
}

#[test]
fn invalid_requests() {
    // Renderers without path tracing name the renderer to use.
    let good = Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 };
    let slow = Shutter { row_time: 1e-4, exposure_time: 0.0 };
    for (aperture, shutter, expected) in [
        (Some(good), Shutter::default(), "an aperture (depth of field)"),
        (None, slow, "an exposure time or a rolling shutter"),
    ] {
        for renderer in [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced] {
            let still = TestFrame { renderer, aperture, shutter, shutter_open: None, ..tracer(1, slow, 0.0, 0.0) };
            let error = still.try_draw().unwrap_err();
            assert!(matches!(&error, RenderError::NeedsPathTracing { what, .. } if *what == expected), "{error}");
            assert!(error.to_string().contains("use renderer: RayTraced"), "{error}");
        }
    }
    // Poses must be old enough.
    let shutter = Shutter { row_time: 0.01, exposure_time: 0.0 };
    let with = |before, poses| {
        let mut still = tracer(1, shutter, 0.0, before);
        still.shutter_open.as_mut().unwrap().0 = poses;
        still.try_draw().map(drop)
    };
    assert_eq!(with(0.4, bar_at(0.0)), Ok(()));
    let span = 0.01 * (HEIGHT - 1) as f64;
    assert_eq!(with(0.3, bar_at(0.0)), Err(RenderError::ShutterPoses { age: 0.3, span }));
    assert_eq!(with(0.4, vec![]), Err(RenderError::PoseCount { expected: 1, found: 0 }));
}
