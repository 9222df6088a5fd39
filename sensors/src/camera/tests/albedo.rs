//! Colours of surfaces without light, held against materials and textures.

use super::super::{Channels, Frame, RasterCfg, Rasterizer, Renderer};
use super::scenes::{Random, random};
use crate::visibility::View;
use scene::shape::{Box, Mesh, Plane, Sphere};
use scene::{
    Headlight, Hemisphere, Instance, Light, Material, PoseF32, RenderMesh, RenderScene, Shape, Texture, TextureKind,
};
use std::sync::Arc;

const WANTED: Channels = Channels { albedo: true, mask: true, ..Channels::NONE };
const ALL_RENDERERS: [Renderer; 4] = [
    Renderer::Raster,
    Renderer::Hybrid,
    Renderer::FastRayTraced,
    Renderer::RayTraced { samples: 1, max_bounces: 0, denoise: false, seed: 0 },
];

fn draw(renderer: Renderer, channels: Channels, scene: &RenderScene, poses: &[PoseF32], view: &View) -> Frame {
    let mut rasterizer = Rasterizer::new(RasterCfg { lod: false, ..RasterCfg::default() });
    rasterizer.renderer = renderer;
    let mut frame = Frame::new(view.width, view.height, channels);
    rasterizer.render(scene, poses, view, &mut frame).unwrap();
    frame
}

fn pixels(frame: &Frame) -> Vec<[u8; 4]> {
    frame.albedo.as_ref().unwrap().as_chunks::<4>().0.to_vec()
}

/// Without a texture it is the material's colour in sRGB, as it was given: bytes of k / 255 are k, which the polynomial of
/// the transfer function keeps to one (see `tone`), whatever light there is, and 0 where nothing is.
#[test]
fn it_is_the_materials_own_colour_in_any_light() {
    let colors = [[0.8, 0.1, 0.02], [0.0, 1.0, 0.5], [0.25, 0.6, 0.95], [0.05, 0.003, 0.4]];
    let material = |[r, g, b]: [f32; 3], alpha| Material {
        specular: 1.0,
        reflectance: 0.5,
        emission: 0.7,
        ..Material::from_rgba([r, g, b, alpha])
    };
    let mut instances: Vec<Instance> = Vec::new();
    for (k, color) in colors.into_iter().enumerate() {
        instances.push(Instance::new(Sphere { radius: 0.3 }, material(color, 1.0), k as i32 + 1));
    }
    // What the mask shows counts: a veil does, glass does not.
    instances.push(Instance::new(Box { half: [0.05, 0.1, 0.1] }, material([0.4, 0.5, 0.6], 0.7), 5));
    instances.push(Instance::new(Box { half: [0.05, 0.3, 0.3] }, material([0.9, 0.9, 0.9], 0.3), 6));
    let at = |y: f32, z: f32| PoseF32::from_translation([0.0, y, z]);
    let mut poses = vec![at(-0.5, 0.4), at(0.5, 0.4), at(-0.5, -0.4), at(0.5, -0.4)];
    poses.push(PoseF32::from_translation([1.0, 0.0, 0.0]));
    poses.push(PoseF32::from_translation([1.0, 0.3, 0.2]));
    let view = View::look_at([80, 60], 0.8, [3.0, 0.0, 0.0], [0.0; 3], [0., 0., 1.]).unwrap();
    let mut scene = RenderScene::new(instances).unwrap();
    for dark in [false, true] {
        if dark {
            scene.lights = vec![Light { diffuse: [0.0; 3], ..Light::default() }];
            scene.headlight = Headlight { active: false, ..Headlight::default() };
            scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
        }
        for renderer in ALL_RENDERERS {
            let frame = draw(renderer, WANTED, &scene, &poses, &view);
            let mut seen = [0; 6];
            for (id, found) in frame.mask.as_ref().unwrap().iter().zip(pixels(&frame)) {
                seen[*id as usize] += 1;
                let Some(k) = usize::try_from(id - 1).ok() else {
                    assert_eq!(found, [0; 4], "nothing is there");
                    continue;
                };
                let own = if k == 4 { [0.4, 0.5, 0.6] } else { colors[k] };
                for (found, own) in found.iter().zip(own) {
                    assert!((f32::from(*found) - 255.0 * own).abs() <= 1.0, "{id}: {found} is not {own}");
                }
                assert_eq!(found[3], 255);
            }
            assert!(seen.iter().all(|&n| n > 30), "{renderer:?}: {seen:?}");
        }
    }
}

/// A square metre with a checkered texture of 2 by 2 fields, seen from so near that a texel is many pixels: each field has its
/// bytes, to 1, off the seams, where texels are blended; the material's colour is multiplied in linear light.
#[test]
fn textures_are_in_it() {
    let (dark, light) = ([40, 90, 150], [220, 180, 60]);
    let plane = |rgba| {
        let texture = Some(Arc::new(Texture::checker(64, dark, light)));
        let material = Material { texture, tex_repeat: [1.0, 1.0], ..Material::from_rgba(rgba) };
        Instance::new(Plane { half: [0.5, 0.5] }, material, 1)
    };
    let linear = |byte: u8| f64::from(scene::material::decode_srgb(f32::from(byte) / 255.0));
    let srgb = |x: f64| 255.0 * if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    for tint in [[1.0f32, 1.0, 1.0], [0.5, 0.7, 0.9]] {
        let scene = RenderScene::new(vec![plane([tint[0], tint[1], tint[2], 1.0])]).unwrap();
        let view = View::look_at([200, 200], 0.6, [0.0, 0.0, 1.4], [0.0; 3], [0., 1., 0.]).unwrap();
        let frame = draw(Renderer::Raster, Channels { position: true, ..WANTED }, &scene, &[PoseF32::IDENTITY], &view);
        let expected = [dark, light].map(|field: [u8; 3]| {
            [0, 1, 2].map(|c| srgb(linear(field[c]) * f64::from(scene::material::decode_srgb(tint[c]))))
        });
        let mut fields = [0; 2];
        for (found, p) in pixels(&frame).iter().zip(frame.position.as_ref().unwrap().as_chunks::<3>().0) {
            // A texel is 1/64 m.
            if p[0].abs().min(p[1].abs()) < 0.02 || p[0].abs().max(p[1].abs()) > 0.48 {
                continue;
            }
            // The texture's first field is in the upper left corner, u along x and v upward.
            let which =
                [0, 1].into_iter().find(|&k| (0..3).all(|c| (f64::from(found[c]) - expected[k][c]).abs() <= 1.5));
            let Some(which) = which else { panic!("{found:?} at {p:?} is neither of {expected:?}") };
            let diagonal = usize::from((p[0] > 0.0) == (p[1] > 0.0));
            fields[which ^ diagonal] += 1;
        }
        assert!(fields.iter().sum::<usize>() > 10_000 && fields.contains(&0), "one diagonal is dark: {fields:?}");
    }
}

/// What a path finds of a texture is what the rasterizer draws of it: on a plane, by texture coordinates of a mesh that are turned,
/// squeezed and end nowhere, and of the six pictures of a cube. In even light what is matt and convex is as bright as its albedo
/// times that light, so the colour that paths find tells the albedo.
#[test]
fn paths_find_the_same_textures() {
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
        Shape::from(Mesh { mesh: Arc::new(RenderMesh::new(&mesh, RenderMesh::CREASE)) })
    };
    let flat = Shape::from(Plane { half: [0.5, 0.5] });
    let (square, cube) = (image(TextureKind::TwoD, 64, 1), image(TextureKind::Cube, 32, 6));
    let scene_of = |shape: &Shape, texture: &Option<Arc<Texture>>| {
        let matt = Material { specular: 0.0, tex_repeat: [1.0, 1.0], ..Material::from_rgba([1.0; 4]) };
        let material = Material { texture: texture.clone(), ..matt };
        let mut scene = RenderScene::new(vec![Instance::new(shape.clone(), material, 1)]).unwrap();
        scene.lights.clear();
        scene.headlight.active = false;
        scene.ambient = Hemisphere { sky: [LIGHT; 3], ground: [LIGHT; 3] };
        scene
    };
    let wanted = Channels { color: true, ..WANTED };
    let paths = Renderer::RayTraced { samples: 16, max_bounces: 1, denoise: false, seed: 0 };
    let linear = |byte: u8| scene::material::decode_srgb(f32::from(byte) / 255.0);
    let srgb = |x: f32| 255.0 * if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    // How many pixels were compared, and how many differ: where neighbours are alike, that is off edges and seams.
    let compare = |drawn: &RenderScene, traced: &RenderScene, eye: [f32; 3]| {
        let view = View::look_at([96, 96], 0.7, eye, [0.0; 3], [0., 0., 1.]).unwrap();
        let raster = draw(Renderer::Raster, wanted, drawn, &[PoseF32::IDENTITY], &view);
        let seen = draw(paths, wanted, traced, &[PoseF32::IDENTITY], &view);
        let (albedo, colors) = (pixels(&raster), seen.color.as_ref().unwrap().as_chunks::<4>().0);
        let (mut compared, mut different) = (0, 0);
        for k in (1..95).flat_map(|y| (1..95).map(move |x| y * 96 + x)) {
            let alike = |n: usize| {
                let there = k + (n / 3) * 96 + n % 3 - 97;
                albedo[there][3] == 255 && (0..3).all(|c| albedo[k][c].abs_diff(albedo[there][c]) <= 16)
            };
            if (0..9).all(alike) {
                compared += 1;
                // Of the part of a pixel that a path falls on, the mean in linear light is off by less than a byte of 16; the
                // polynomials and two roundings are another one each.
                let off = |c: usize| (f32::from(colors[k][c]) - srgb(LIGHT * linear(albedo[k][c]))).abs();
                different += usize::from((0..3).any(|c| off(c) > 3.0));
            }
        }
        (compared, different)
    };
    let eyes = [[1.5, 0.9, 1.1], [-1.2, 1.4, 0.8], [0.4, -1.5, 1.3], [-0.9, -1.0, -1.6]];
    for (shape, texture) in
        [(&flat, &square), (&turned(1.0), &square), (&brick.into(), &cube), (&brick.into(), &square)]
    {
        let scene = scene_of(shape, texture);
        for eye in eyes.into_iter().filter(|eye| shape.name() != "plane" || eye[2] > 0.0) {
            let (compared, different) = compare(&scene, &scene, eye);
            assert!(compared > 1000, "{} from {eye:?}: {compared}", shape.name());
            assert!(different * 200 <= compared, "{} from {eye:?}: {different} of {compared}", shape.name());
        }
    }
    // Controls: texture coordinates that are turned by half, and a picture that is not a cube's.
    for (drawn, traced) in
        [((&turned(1.0), &square), (&turned(-1.0), &square)), ((&brick.into(), &cube), (&brick.into(), &square))]
    {
        let (compared, different) = compare(&scene_of(drawn.0, drawn.1), &scene_of(traced.0, traced.1), eyes[0]);
        assert!(different * 2 > compared, "{different} of {compared}");
    }
}

/// Off silhouettes, where all eight neighbours see the same thing, rays and triangles give the same colours: to one byte, or
/// more where a texture's edge or another triangle is near.
#[test]
fn all_renderers_agree() {
    let mut numbers = Random(5);
    let (mut compared, mut different) = (0, 0);
    for _ in 0..12 {
        let (scene, poses) = random(&mut numbers, 1.2);
        let camera = numbers.pose(3.0);
        let target = numbers.vector(-0.5, 0.5).map(|x| x as f32);
        let view = View::look_at([96, 72], 1.0, camera.translation, target, [0., 0., 1.]).unwrap();
        let one = draw(Renderer::Raster, WANTED, &scene, &poses, &view);
        for renderer in &ALL_RENDERERS[1..] {
            let other = draw(*renderer, WANTED, &scene, &poses, &view);
            let (a, b) = (pixels(&one), pixels(&other));
            let masks = [one.mask.as_ref().unwrap(), other.mask.as_ref().unwrap()];
            for k in (1..71).flat_map(|y| (1..95).map(move |x| y * 96 + x)) {
                let around = |mask: &[i32]| (0..9).all(|n| mask[k + (n / 3) * 96 + n % 3 - 97] == mask[k]);
                if masks.iter().all(|mask| around(mask)) && masks[0][k] == masks[1][k] {
                    compared += 1;
                    different += usize::from((0..4).any(|c| a[k][c].abs_diff(b[k][c]) > 1));
                }
            }
        }
    }
    assert!(compared > 100_000 && different * 1000 < compared, "{different} of {compared} pixels differ");
}

/// A channel that nobody asked for changes no bit of the others.
#[test]
fn others_are_the_same_with_it_and_without() {
    let mut numbers = Random(9);
    let (scene, poses) = random(&mut numbers, 1.0);
    let view = View::look_at([90, 70], 1.0, [2.2, 0.4, 0.9], [0.0; 3], [0., 0., 1.]).unwrap();
    let without = Channels { albedo: false, ..Channels::ALL };
    for renderer in ALL_RENDERERS {
        let with = draw(renderer, Channels::ALL, &scene, &poses, &view);
        let albedo = draw(renderer, WANTED, &scene, &poses, &view).albedo;
        assert_eq!(with.albedo, albedo);
        let alone = draw(renderer, without, &scene, &poses, &view);
        assert_eq!((with.color, with.depth, with.normal), (alone.color, alone.depth, alone.normal));
        assert_eq!((with.mask, with.distance, with.position), (alone.mask, alone.distance, alone.position));
    }
}
