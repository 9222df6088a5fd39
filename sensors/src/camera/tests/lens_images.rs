//! Images of cameras with lenses, against closed forms.

use super::super::{Camera, CameraCfg, CameraError, CameraPlacement, DepthMiss, PointFrame};
use super::lenses::{WARPED, all};
use super::test_scene;
use super::test_scene::{BALL, GROUND, RADIUS, built, context, point};
use crate::SensorError;
use crate::sensor::{Sensor, SensorCfg};
use kinetoscope_render::OpticsError;
use kinetoscope_render::RenderError;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens::{Equidistant, OpenCv, Panorama};
use kinetoscope_render::lens::{Lens, LensRays, Optics};
use kinetoscope_render::{Intrinsics, PixelIntrinsics, Renderer};
use kinetoscope_scene::Pose;
use nalgebra::{Point3, Vector3};
use std::f64::consts::FRAC_PI_2;

const FEW_PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 1, denoise: false, seed: 3 };
const SIZE: [usize; 2] = [64, 48];
/// Offsets of the color samples from the pixel center \[1/256 pixel\].
const SAMPLES: [[i32; 2]; 4] = [[-32, -96], [96, -32], [-96, 32], [32, 96]];

/// The camera of the test scene, with a lens.
fn cfg_of(lens: impl Into<Lens>, pixels: PixelIntrinsics) -> CameraCfg {
    CameraCfg {
        width: SIZE[0],
        height: SIZE[1],
        intrinsics: pixels.into(),
        lens: lens.into(),
        renderer: Renderer::FastRayTraced,
        near: 0.3,
        far: 4.0,
        ..test_scene::cfg()
    }
}

/// The first instance of the test scene that a ray hits within a range of multiples of its length: multiple, id and
/// normal.
fn meets(eye: Point3<f64>, ray: Vector3<f64>, range: [f64; 2]) -> Option<(f64, i32, Vector3<f64>)> {
    let inside = |t: &f64| *t >= range[0] && *t <= range[1];
    let middle = Point3::from(test_scene::ball(0, 0));
    let (a, b, c) = (ray.norm_squared(), (eye - middle).dot(&ray), (eye - middle).norm_squared() - RADIUS * RADIUS);
    let root = (b * b - a * c).max(0.0).sqrt();
    let ball = [(-b - root) / a, (-b + root) / a].into_iter().filter(|_| b * b > a * c).find(inside);
    let ground = Some(-eye.z / ray.z).filter(|t| ray.z < 0.0 && inside(t));
    let of_ball = |t: f64| (t, BALL, (eye + ray * t - middle) / RADIUS);
    match (ball, ground) {
        (Some(b), Some(g)) if g < b => Some((g, GROUND, Vector3::z())),
        (Some(b), _) => Some(of_ball(b)),
        (None, g) => g.map(|g| (g, GROUND, Vector3::z())),
    }
}

/// A ball on an infinite ground, by closed forms along the double-precision ray of each pixel: depth, distance, mask,
/// normal, position, and point cloud. Directions have single precision (6e-8), and so has the sum of some ten products
/// of numbers near 4 m: 1e-5 m at most, more where the ray grazes the surface.
#[test]
fn channels() {
    for (lens, pixels) in all() {
        let cfg = cfg_of(lens, pixels);
        let camera = built(&cfg, &context(1));
        let (optics, pose) = (camera.optics(0).unwrap(), camera.world_from_camera(0).unwrap());
        let eye = Point3::from(pose.translation.vector);
        let (depth, distance, mask) = (camera.depth().unwrap(), camera.distance().unwrap(), camera.mask().unwrap());
        let (normal, color) = (camera.normal().unwrap(), camera.color().unwrap());
        let points = camera.point_map(0, PointFrame::World).unwrap();
        let (mut hits, mut edges, mut behind) = (0, 0, 0);
        for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
            let what = format!("{} at {x}, {y}", lens.name());
            let (id, [depth, distance]) = (mask[(0, y, x)], [depth[(0, y, x)], distance[(0, y, x)]]);
            let cloud = Vector3::from([0, 1, 2].map(|axis| f64::from(points[(y, x, axis)])));
            let missed = id == 0 && [depth, distance] == [f32::INFINITY; 2] && cloud.x == f64::INFINITY;
            let Some(ray) = optics.ray([x as f64 + 0.5, y as f64 + 0.5]).map(Vector3::from) else {
                assert!(missed, "{what}");
                let mut samples = SAMPLES.iter().map(|offset| offset.map(|o| f64::from(o) / 256.0 + 0.5));
                if samples.all(|[dx, dy]| optics.ray([x as f64 + dx, y as f64 + dy]).is_none()) {
                    assert_eq!([0, 1, 2, 3].map(|c| color[(0, y, x, c)]), [0, 0, 0, 255], "{what}");
                }
                continue;
            };
            let (world, range) = (pose.rotation * ray, [cfg.near, cfg.far]);
            let found_hit = meets(eye, world, range);
            let id_of = |found_hit: Option<(f64, i32, Vector3<f64>)>| found_hit.map_or(0, |m| m.1);
            // Single precision may differ if a ray offset by 1e-4, or a range longer by the same, hits another
            // instance.
            let mut others = (0..8).map(|n| {
                let beside = Vector3::from([n & 1, n >> 1 & 1, n >> 2 & 1].map(|b| f64::from(b) - 0.5)) * 2e-4;
                let by = 1.0 + f64::from(n & 1) * 2e-4 - 1e-4;
                id_of(meets(eye, world + beside * world.norm(), range.map(|r| r * by)))
            });
            if others.any(|id| id != id_of(found_hit)) {
                edges += 1;
                continue;
            }
            let Some((t, expected, n)) = found_hit else {
                assert!(missed, "{what}");
                continue;
            };
            hits += 1;
            behind += usize::from(ray.z <= 0.0);
            assert_eq!(id, expected, "{what}");
            let (length, hit) = (world.norm(), eye + world * t);
            let slant = (n.dot(&world) / length).abs();
            let near = |a: f32, b: f64| (f64::from(a) - b).abs() <= 1e-5 / slant;
            assert!(near(depth, t * ray.z) && near(distance, t * length), "{what}: {depth} {distance}, {t} {ray}");
            let off = [point(&camera, [0, y, x]).coords, cloud].map(|point| (point - hit.coords).norm());
            assert!(off.iter().all(|off| *off <= 1e-5 / slant), "{what}: {off:?}");
            let found = Vector3::from([0, 1, 2].map(|axis| f64::from(normal[(0, y, x, axis)])));
            assert!((found - if n.dot(&world) > 0.0 { -n } else { n }).norm() <= 1e-4 / slant, "{what}: {found}");
        }
        assert!(hits > 300 && edges * 5 < SIZE[0] * SIZE[1], "{}: {hits} hits, {edges} edges", lens.name());
        let angle = lens.domain().unwrap().angle;
        assert!(if angle > 1.75 { behind > 0 } else { behind == 0 || angle > FRAC_PI_2 }, "{}: {behind}", lens.name());
        let cloud = camera.point_cloud(0, PointFrame::Camera).unwrap();
        assert_eq!(cloud.nrows(), mask.iter().filter(|&&id| id != 0).count());
    }
}

#[test]
fn lens_without_distortion() {
    let bits = |lens, renderer| {
        test_scene::bits(&built(&CameraCfg { lens, renderer, ..test_scene::cfg() }, &context(1)), 0..1)
    };
    for renderer in [Renderer::FastRayTraced, FEW_PATHS, Renderer::Raster, Renderer::Hybrid] {
        assert!(bits(Lens::default(), renderer) == bits(OpenCv::default().into(), renderer), "{renderer:?}");
    }
    // Control: a small distortion already makes a difference.
    let little = OpenCv { k1: 1e-3, ..OpenCv::default() }.into();
    assert!(bits(Lens::default(), Renderer::FastRayTraced) != bits(little, Renderer::FastRayTraced));
}

/// The rasterizer renders straight lines only; a folding lens has two rays for a point.
#[test]
fn refused_lenses() {
    let pixels = PixelIntrinsics { fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0 };
    let raster = CameraCfg { renderer: Renderer::Raster, ..cfg_of(WARPED, pixels) };
    let error = raster.build(&context(1)).unwrap_err();
    let expected = RenderError::LensRenderer { lens: "opencv", renderer: "raster" };
    assert_eq!(error, SensorError::Camera(CameraError::View(expected)));
    assert!(error.to_string().contains("renderer: FastRayTraced"), "{error}");
    let error = cfg_of(OpenCv { k1: -0.9, ..OpenCv::default() }, pixels).build(&context(1)).unwrap_err();
    assert!(matches!(error, SensorError::Camera(CameraError::Optics(OpticsError::LensFolds { .. }))), "{error}");
}

/// Intrinsics of one environment with a lens: the other environments keep theirs, and `restore` resets all.
#[test]
fn own_intrinsics() {
    let pixels = PixelIntrinsics { fx: 18.0, fy: 20.0, cx: 32.0, cy: 24.0 };
    let cfg = cfg_of(Equidistant::default(), pixels);
    let mut camera = built(&cfg, &context(3));
    let rows = |camera: &Camera| [0, 1, 2].map(|row| test_scene::bits(camera, [row]));
    let (before, bytes) = (rows(&camera), camera.lens_bytes());
    assert_eq!(
        bytes,
        LensRays::new(&Optics::new(cfg.lens, pixels).unwrap(), SIZE, 4).unwrap().bytes(),
        "all environments share one table"
    );
    let other = Intrinsics::Pixels { fx: 25.0, fy: 22.0, cx: 30.0, cy: 20.0 };
    camera.set_intrinsics(&[other], Some(&[1])).unwrap();
    assert_eq!(camera.lens_bytes(), 2 * bytes);
    let now = rows(&camera);
    assert!(now[0] == before[0] && now[1] != before[1] && now[2] == before[2]);
    // Equal to a camera built with these intrinsics.
    let alone = built(&CameraCfg { intrinsics: other, ..cfg }, &context(3));
    assert!(rows(&alone)[1] == now[1]);
    assert_eq!(camera.optics(1).unwrap().pixels(), other.to_pixels(64, 48).unwrap());
    // An invalid value changes nothing.
    let bad = Intrinsics::Pixels { fx: 25.0, fy: 22.0, cx: 3000.0, cy: 20.0 };
    let error = camera.set_intrinsics(&[bad], Some(&[0])).unwrap_err();
    assert!(matches!(error, SensorError::Camera(CameraError::Optics(OpticsError::NoVisiblePixel { .. }))), "{error}");
    assert!(camera.set_intrinsics(&[other; 2], None).is_err());
    assert!(rows(&camera) == now);
    camera.restore(None).unwrap();
    assert!(rows(&camera) == before && camera.lens_bytes() == bytes);
}

/// Point clouds use distances if depth is not defined. Misses give no point, for every value of a miss.
#[test]
fn point_clouds() {
    let cfg = cfg_of(Panorama {}, Panorama::intrinsics(64, 48).to_pixels(64, 48).unwrap());
    let count = |cfg: &CameraCfg| built(cfg, &context(1)).point_cloud(0, PointFrame::World).map(|cloud| cloud.nrows());
    let all = count(&cfg).unwrap();
    for depth_miss in [DepthMiss::Far, DepthMiss::Zero] {
        assert_eq!(count(&CameraCfg { depth_miss, ..cfg.clone() }).unwrap(), all);
    }
    let channels = Channels { depth: true, ..Channels::default() };
    let error = count(&CameraCfg { channels, ..cfg }).unwrap_err();
    assert!(matches!(error, SensorError::Camera(CameraError::ChannelOff { channel: "distance", .. })), "{error}");
}

/// Arrows along the edges follow the rays of the corners; corners without a ray have no arrow.
#[test]
fn markers() {
    // Corners are 40 pixels from the center: 2 rad.
    let pixels = PixelIntrinsics { fx: 20.0, fy: 20.0, cx: 32.0, cy: 24.0 };
    let count = |max_angle| {
        built(&cfg_of(Equidistant { max_angle }, pixels), &context(1)).markers(0, &|_| Pose::identity()).len()
    };
    assert_eq!((count(2.01), count(1.99)), (5, 1));
}
