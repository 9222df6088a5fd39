//! Albedo, textures and planes compared with materials, texels and closed forms.

use super::harness::{TestFrame, look_at_view};
use crate::frame::Channels;
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::visibility::View;
use kinetoscope_scene::shape::{Box, Cylinder, Mesh, Plane, Sphere};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Hemisphere, Light, Material, PoseF32, RenderScene, Texture, TextureKind};
use kinetoscope_testkit::scenes::{instances, matte, translation, unlit};
use kinetoscope_testkit::srgb::{linear, srgb};
use std::sync::Arc;

const ALBEDO: Channels = Channels { albedo: true, mask: true, ..Channels::NONE };

fn albedo((scene, poses): (RenderScene, Vec<PoseF32>), view: View) -> TestFrame {
    let cfg = RasterCfg { lod: false, ..RasterCfg::default() };
    TestFrame { channels: ALBEDO, cfg, ..TestFrame::new((scene, poses), view) }
}

/// Without a texture, albedo is the material's sRGB color as given: bytes of k / 255 are k, to one byte by the
/// polynomial of the transfer function (see `tone`), in any light, and 0 on a miss.
#[test]
fn material_albedo() {
    let colors =
        [[0.8, 0.1, 0.02], [0.0, 1.0, 0.5], [0.25, 0.6, 0.95], [0.05, 0.003, 0.4], [0.4, 0.5, 0.6], [0.9, 0.9, 0.9]];
    let material = |k: usize, alpha| {
        let [r, g, b] = colors[k];
        Material { specular: 1.0, reflectance: 0.5, emission: 0.7, ..Material::from_rgba([r, g, b, alpha]) }
    };
    let ball = |k, y, z| (Shape::from(Sphere { radius: 0.3 }), material(k, 1.0), translation(0.0, y, z));
    let still = albedo(
        instances([
            ball(0, -0.5, 0.4),
            ball(1, 0.5, 0.4),
            ball(2, -0.5, -0.4),
            ball(3, 0.5, -0.4),
            // The nearest surface counts, whatever its alpha, unless that is 0. Root cause: alpha below 0.5 was left
            // out.
            (Box { half: [0.05, 0.1, 0.1] }.into(), material(4, 0.7), translation(1.0, 0.0, 0.0)),
            (Box { half: [0.05, 0.1, 0.1] }.into(), material(5, 0.3), translation(1.0, 0.3, 0.0)),
            (Box { half: [0.05, 0.1, 0.1] }.into(), material(5, 0.0), translation(1.0, -0.3, 0.0)),
        ]),
        look_at_view([83, 61], 0.8, [3.0, 0.0, 0.0], [0.0; 3]),
    );
    let mut dark = still.with(|still| still.scene = unlit(still.scene.clone()));
    dark.scene.lights = vec![Light { diffuse: [0.0; 3], ..Light::default() }];
    let paths = Renderer::RayTraced { samples: 1, max_bounces: 0, denoise: false, seed: 0 };
    for renderer in [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced, paths] {
        for still in [&still, &dark] {
            let (image, mut seen) = (still.with_renderer(renderer), [0; 7]);
            for (id, found) in image.mask().iter().zip(image.albedo()) {
                seen[*id as usize] += 1;
                let Some(own) = (*id as usize).checked_sub(1).map(|k| colors[k]) else {
                    assert_eq!(*found, [0; 4], "the albedo of a miss is 0");
                    continue;
                };
                let same = (0..3).all(|c| (f32::from(found[c]) - 255.0 * own[c]).abs() <= 1.0);
                assert!(same && found[3] == 255, "{id}: {found:?} is not {own:?}");
            }
            assert!(seen.iter().all(|&n| n > 30), "{renderer:?}: {seen:?}");
        }
    }
}

/// A square meter with a checkered texture of 2 by 2 fields, seen from so near that a texel covers many pixels. Each
/// field has its bytes, to 1, away from the seams, where texels are blended; the material's color is multiplied in
/// linear light.
#[test]
fn texture_albedo() {
    let (dark, light) = ([40, 90, 150], [220, 180, 60]);
    for tint in [[1.0f32, 1.0, 1.0], [0.5, 0.7, 0.9]] {
        let texture = Some(Arc::new(Texture::checker(64, dark, light)));
        let material = Material { texture, tex_repeat: [1.0, 1.0], ..matte(tint) };
        let view = View::look_at([200, 200], 0.6, [0.0, 0.0, 1.4], [0.0; 3], [0., 1., 0.]).unwrap();
        let mut still = albedo(instances([(Plane { half: [0.5, 0.5] }, material, PoseF32::IDENTITY)]), view);
        still.channels.position = true;
        let image = still.draw();
        let byte = |field: [u8; 3], c: usize| srgb(linear(f32::from(field[c]) / 255.0) * linear(tint[c]));
        let expected = [dark, light].map(|field| [0, 1, 2].map(|c| byte(field, c)));
        let mut fields = [0; 2];
        for (found, p) in image.albedo().iter().zip(image.position()) {
            // A texel is 1/64 m.
            if p[0].abs().min(p[1].abs()) < 0.02 || p[0].abs().max(p[1].abs()) > 0.48 {
                continue;
            }
            let close = |k: &usize| (0..3).all(|c| (f64::from(found[c]) - expected[*k][c]).abs() <= 1.5);
            let Some(which) = (0..2).find(close) else { panic!("{found:?} at {p:?} is neither of {expected:?}") };
            fields[which ^ usize::from((p[0] > 0.0) == (p[1] > 0.0))] += 1;
        }
        assert!(fields.iter().sum::<usize>() > 10_000 && fields.contains(&0), "one diagonal is dark: {fields:?}");
    }
}

/// Path tracing reads the same textures as the rasterizer: on a plane, by rotated, scaled and unbounded texture
/// coordinates of a mesh, and by the six images of a cube. In uniform light, matte and convex objects are as bright as
/// their albedo times that light, so path-traced color shows the albedo.
#[test]
fn textures_of_paths() {
    const LIGHT: f32 = 0.5;
    let image = |kind, side: u32, faces: u32| {
        let step = 256 / side;
        let texel = |k: u32| [step * (k % side), step * (k / side % side), 40 * (k / side / side)].map(|x| x as u8);
        let bytes: Vec<u8> = (0..side * side * faces).flat_map(texel).collect();
        Some(Arc::new(Texture::new(kind, side, side * faces, 3, &bytes).unwrap()))
    };
    let brick = Box { half: [0.4, 0.5, 0.3] };
    let turned = |by: f32| {
        let mut mesh = Shape::from(brick).tessellate(0);
        let uv = |p: [f32; 3]| {
            let [x, y, z] = p.map(|x| by * x);
            [0.5 + 0.5 * y + 0.2 * z, 0.5 - 0.4 * x + 0.6 * z]
        };
        mesh.uvs = Some(mesh.positions.iter().map(|p| uv(*p)).collect());
        Shape::from(Mesh { mesh: Arc::new(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE)) })
    };
    let (flat, brick) = (Shape::from(Plane { half: [0.5, 0.5] }), Shape::from(brick));
    let (square, cube) = (image(TextureKind::TwoD, 64, 1), image(TextureKind::Cube, 32, 6));
    let scene_of = |(shape, texture): (&Shape, &Option<Arc<Texture>>)| {
        let material = Material { texture: texture.clone(), tex_repeat: [1.0, 1.0], ..matte([1.0; 3]) };
        let (scene, poses) = instances([(shape.clone(), material, PoseF32::IDENTITY)]);
        let mut scene = unlit(scene);
        scene.ambient = Hemisphere { sky: [LIGHT; 3], ground: [LIGHT; 3] };
        (scene, poses)
    };
    // Number of pixels with similar neighbors, off edges and seams, and number of those that differ.
    let compare = |drawn, traced, eye: [f32; 3]| {
        let of = |what, renderer| {
            let mut still = albedo(scene_of(what), look_at_view([96, 96], 0.7, eye, [0.0; 3]));
            still.channels.color = true;
            still.with_renderer(renderer)
        };
        let raster = of(drawn, Renderer::Raster);
        let paths = of(traced, Renderer::RayTraced { samples: 16, max_bounces: 1, denoise: false, seed: 0 });
        let (albedo, color) = (raster.albedo(), paths.color());
        let alike =
            |k: usize, n: usize| albedo[n][3] == 255 && (0..3).all(|c| albedo[k][c].abs_diff(albedo[n][c]) <= 16);
        let compared: Vec<usize> = raster.inner().filter(|&k| raster.neighbors(k).all(|n| alike(k, n))).collect();
        // The mean in linear light over the part of a pixel that a path covers is off by less than a byte of 16; the
        // polynomials and two roundings add another byte each.
        let light = |byte: u8| f64::from(LIGHT) * linear(f32::from(byte) / 255.0);
        let off = |k: usize, c: usize| (f64::from(color[k][c]) - srgb(light(albedo[k][c]))).abs();
        (compared.len(), compared.iter().filter(|&&k| (0..3).any(|c| off(k, c) > 3.0)).count())
    };
    let eyes = [[1.5, 0.9, 1.1], [-1.2, 1.4, 0.8], [0.4, -1.5, 1.3], [-0.9, -1.0, -1.6]];
    let (mesh, other) = (turned(1.0), turned(-1.0));
    for what in [(&flat, &square), (&mesh, &square), (&brick, &cube), (&brick, &square)] {
        for eye in eyes.into_iter().filter(|eye| what.0.name() != "plane" || eye[2] > 0.0) {
            let (compared, different) = compare(what, what, eye);
            let enough = compared > 1000 && different * 200 <= compared;
            assert!(enough, "{} from {eye:?}: {different} of {compared}", what.0.name());
        }
    }
    // Controls: texture coordinates rotated by half a turn, and an image that is not a cube map.
    for (drawn, traced) in [((&mesh, &square), (&other, &square)), ((&brick, &cube), (&brick, &square))] {
        let (compared, different) = compare(drawn, traced, eyes[0]);
        assert!(different * 2 > compared, "{different} of {compared}");
    }
}

/// A cube texture of six colors, seen along its axes: MuJoCo's order of the faces is +x, -x, +y, -y, +z, -z.
#[test]
fn cube_faces() {
    let colors: [[u8; 3]; 6] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [0, 255, 255], [255, 0, 255]];
    let axes: [[f32; 3]; 6] = [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    for (side, (axis, color)) in
        [1usize, 3, 8].into_iter().flat_map(|side| axes.into_iter().zip(colors).map(move |of| (side, of)))
    {
        let data: Vec<u8> = colors.iter().flat_map(|c| c.repeat(side * side)).collect();
        let texture = Texture::new(TextureKind::Cube, side as u32, 6 * side as u32, 3, &data).unwrap();
        let material = Material { texture: Some(Arc::new(texture)), specular: 0.0, ..Material::default() };
        let (mut scene, poses) = instances([(Sphere { radius: 1.0 }, material, PoseF32::IDENTITY)]);
        scene.lights.clear();
        let up = if axis[2] == 0.0 { [0., 0., 1.] } else { [1., 0., 0.] };
        let view = View::look_at([65, 65], 0.8, axis.map(|x| 3.0 * x), [0.; 3], up).unwrap();
        let image =
            TestFrame { cfg: RasterCfg { samples: 1, ..RasterCfg::default() }, ..TestFrame::new((scene, poses), view) }
                .draw();
        let mut count = 0;
        for (seen, p) in image.color().iter().zip(image.position()) {
            let along: f32 = (0..3).map(|k| p[k] * axis[k]).sum();
            let across = (0..3).map(|k| (p[k] * (1.0 - axis[k].abs())).abs()).fold(0.0, f32::max);
            // Inside of the face: texels are not blended across its edge.
            if along <= 0.0 || across > 0.999 * along {
                continue;
            }
            let bright = [0, 1, 2].map(|c| seen[c] > 40);
            assert_eq!(bright, color.map(|full| full == 255), "side {side}, axis {axis:?}, at {p:?}: {seen:?}");
            count += 1;
        }
        assert!(count > 200, "{count}");
    }
}

/// Of coincident surfaces all renderers show the last one of the scene, as in MuJoCo: two boxes of the same size, an
/// infinite ground and a mat on it. Root cause: the first one that was drawn stayed.
#[test]
fn coincident_surfaces() {
    let of = |color: [f32; 3]| (Shape::from(Box { half: [0.4, 0.3, 0.2] }), matte(color), translation(0.1, 0.2, 0.3));
    let mesh = |color: [f32; 3]| {
        let mesh = RenderMesh::new(
            &Shape::from(Box { half: [0.4, 0.3, 0.2] }).tessellate(0),
            RenderMesh::DEFAULT_CREASE_ANGLE,
        );
        (Shape::from(Mesh { mesh: Arc::new(mesh) }), matte(color), translation(0.1, 0.2, 0.3))
    };
    let mat = |color: [f32; 3]| (Shape::from(Plane { half: [0.5; 2] }), matte(color), PoseF32::IDENTITY);
    let ground = |color: [f32; 3]| (Shape::from(Plane::INFINITE), matte(color), PoseF32::IDENTITY);
    let (red, blue) = ([0.8, 0.0, 0.0], [0.0, 0.0, 0.8]);
    let view = look_at_view([120, 90], 0.6, [2.0, 1.2, 1.4], [0.1, 0.2, 0.2]);
    for pair in [[of(red), of(blue)], [mesh(red), mesh(blue)], [mat(red), ground(blue)], [ground(red), mat(blue)]] {
        let still = albedo(instances(pair.clone()), view);
        // The pixels of the second instance alone.
        let alone = albedo(instances(pair[1..].to_vec()), view).draw();
        for renderer in [Renderer::Raster, Renderer::FastRayTraced] {
            let image = still.with_renderer(renderer);
            let mut seen = 0;
            for k in alone.inner().filter(|k| alone.mask()[*k] == 1 && alone.is_inside_instance(*k)) {
                assert_eq!(image.mask()[k], 2, "{renderer:?}, {:?}: {k}", pair[1].0.name());
                seen += 1;
            }
            assert!(seen > 500, "{seen}");
        }
    }
}

/// Renderers without path tracing ignore `reflectance` of surfaces other than planar mirrors. Root cause: they mixed in
/// the sky, and an object that reflects all light lost its own color.
#[test]
fn curved_mirrors_are_for_paths() {
    let still = |reflectance| {
        let material = |color| Material { reflectance, ..matte(color) };
        TestFrame::new(
            instances([
                (Shape::from(Sphere { radius: 0.4 }), material([0.8, 0.1, 0.1]), translation(0.0, -0.5, 0.4)),
                (
                    Cylinder { radius: 0.3, half_length: 0.3 }.into(),
                    material([0.1, 0.8, 0.1]),
                    translation(0.0, 0.5, 0.3),
                ),
                (Plane { half: [2.0; 2] }.into(), matte([0.1, 0.1, 0.8]), PoseF32::IDENTITY),
            ]),
            look_at_view([96, 72], 0.7, [2.5, 0.4, 1.6], [0.0, 0.0, 0.2]),
        )
    };
    for renderer in [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced] {
        assert!(still(1.0).with_renderer(renderer).same_bits(&still(0.0).with_renderer(renderer)), "{renderer:?}");
    }
    // The control: path tracing mirrors them.
    let paths = Renderer::RayTraced { samples: 1, max_bounces: 1, denoise: false, seed: 0 };
    assert!(!still(1.0).with_renderer(paths).same_bits(&still(0.0).with_renderer(paths)));
}

/// A mat and an infinite ground at the same height: the equally near ground must not shine through. Root cause: both
/// were rounded in different ways.
#[test]
fn mat_on_ground() {
    let ground = (Plane::INFINITE, Material::default(), PoseF32::IDENTITY);
    let scene = instances([ground, (Plane { half: [1.0, 1.0] }, Material::default(), PoseF32::IDENTITY)]);
    for (height, samples) in [(2.0, 1), (1.1, 4), (0.3, 1), (0.3, 4)] {
        let view = View::look_at([160, 120], 0.9, [2.5, 0.7, height], [0.; 3], [0., 0.2, 1.]).unwrap();
        let still =
            TestFrame { cfg: RasterCfg { samples, ..RasterCfg::default() }, ..TestFrame::new(scene.clone(), view) };
        for image in [Renderer::Raster, Renderer::FastRayTraced].map(|renderer| still.with_renderer(renderer)) {
            let mut counts = [0, 0];
            for (id, p) in image.mask().iter().zip(image.position()).filter(|(id, _)| **id != 0) {
                let edge = p[0].abs().max(p[1].abs());
                // The position is rounded to 1e-6 of at most 4 m.
                if (edge - 1.0).abs() > 1e-4 {
                    assert_eq!(*id, if edge < 1.0 { 2 } else { 1 }, "height {height}, at {p:?}");
                    counts[usize::from(edge < 1.0)] += 1;
                }
            }
            assert!(counts.iter().all(|&n| n > 100), "{counts:?}");
        }
    }
}

#[test]
fn endless_plane_depth() {
    let scene = instances([(Plane::INFINITE, Material::default(), PoseF32::IDENTITY)]);
    let mut seen = 0;
    for far in [1e2, 1e3, 1e4, 1e6] {
        for (k, height) in [0.02, 0.0277, 0.076, 0.5, 2.0].into_iter().enumerate() {
            for pitch in [-0.418, -0.05, 0.0, 0.05] {
                let (k, target) = (k as f32, [1.0, 0.1 * k as f32, height + pitch]);
                let view = View::look_at([160, 120], 0.9, [0., 0., height], target, [0., 0.05 * k, 1.]).unwrap();
                let image = TestFrame::new(scene.clone(), View { near: 0.01, far, ..view }).draw();
                // Nearness, its inverse and the limit are rounded once each.
                let allowed = 0.01 * (1.0 - 1e-6)..=far * (1.0 + 1e-6);
                for (depth, id) in image.depth().iter().zip(image.mask()) {
                    let good = if *id == 0 { depth.is_infinite() } else { allowed.contains(depth) };
                    assert!(good, "{id}: {depth} at {height} m, far {far}, pitch {pitch}");
                    seen += usize::from(*id != 0);
                }
            }
        }
    }
    assert!(seen > 100_000, "{seen}");
}
