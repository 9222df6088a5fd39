//! Endless planes, and what lamps see of a scene, against closed forms.

use super::super::{Channels, Frame, RasterCfg, Rasterizer, Renderer};
use crate::visibility::View;
use scene::shape::{Plane, Sphere};
use scene::{Instance, Light, LightKind, Material, PoseF32, RenderScene, Texture, TextureKind};
use std::sync::Arc;

const SIZE: [usize; 2] = [160, 120];

fn draw(scene: &RenderScene, poses: &[PoseF32], view: &View, cfg: RasterCfg) -> Frame {
    draw_by(Renderer::Raster, scene, poses, view, cfg)
}

fn draw_by(renderer: Renderer, scene: &RenderScene, poses: &[PoseF32], view: &View, cfg: RasterCfg) -> Frame {
    let mut frame = Frame::new(view.width, view.height, Channels::ALL);
    let mut rasterizer = Rasterizer::new(cfg);
    rasterizer.renderer = renderer;
    rasterizer.render(scene, poses, view, &mut frame).unwrap();
    frame
}

/// A mat and an endless ground at the same height: the mat is drawn first, and the ground, which is as near, must not shine
/// through. Root cause once: the two were rounded in different ways.
#[test]
fn a_mat_on_the_ground_hides_it() {
    let mat = Plane { half: [1.0, 1.0] };
    let scene = RenderScene::new(vec![
        Instance::new(Plane::INFINITE, Material::default(), 1),
        Instance::new(mat, Material::default(), 2),
    ]);
    let scene = scene.unwrap();
    let by_rays = Renderer::FastRayTraced;
    let all =
        [(2.0, 1), (1.1, 4), (0.3, 1), (0.3, 4)].into_iter().flat_map(|of| [(of, Renderer::Raster), (of, by_rays)]);
    for ((height, samples), renderer) in all {
        let view = View::look_at(SIZE, 0.9, [2.5, 0.7, height], [0., 0., 0.], [0., 0.2, 1.]).unwrap();
        let cfg = RasterCfg { samples, ..RasterCfg::default() };
        let frame = draw_by(renderer, &scene, &[PoseF32::IDENTITY; 2], &view, cfg);
        let (mask, position) = (frame.mask.unwrap(), frame.position.unwrap());
        let mut counts = [0, 0];
        for (id, p) in mask.iter().zip(position.chunks_exact(3)).filter(|(id, _)| **id != 0) {
            let edge = p[0].abs().max(p[1].abs());
            // The position is rounded to 1e-6 of 4 m at most.
            if (edge - 1.0).abs() > 1e-4 {
                assert_eq!(*id, if edge < 1.0 { 2 } else { 1 }, "height {height}, at {p:?}");
                counts[usize::from(edge < 1.0)] += 1;
            }
        }
        assert!(counts.iter().all(|&n| n > 100), "{counts:?}");
    }
}

#[test]
fn depth_of_an_endless_plane_stays_between_near_and_far() {
    let scene = RenderScene::new(vec![Instance::new(Plane::INFINITE, Material::default(), 1)]).unwrap();
    let mut seen = 0;
    for far in [1e2, 1e3, 1e4, 1e6] {
        for (k, height) in [0.02, 0.0277, 0.076, 0.5, 2.0].into_iter().enumerate() {
            for pitch in [-0.418, -0.05, 0.0, 0.05] {
                let target = [1.0, 0.1 * k as f32, height + pitch];
                let view = View::look_at(SIZE, 0.9, [0., 0., height], target, [0., 0.05 * k as f32, 1.]).unwrap();
                let view = View { near: 0.01, far, ..view };
                let frame = draw(&scene, &[PoseF32::IDENTITY], &view, RasterCfg::default());
                let (depth, mask) = (frame.depth.unwrap(), frame.mask.unwrap());
                for (depth, id) in depth.into_iter().zip(mask) {
                    assert_eq!(depth.is_finite(), id != 0);
                    // Nearness, its inverse and the limit are rounded once each.
                    let allowed = 0.01 * (1.0 - 1e-6)..=far * (1.0 + 1e-6);
                    assert!(id == 0 || allowed.contains(&depth), "{depth} at {height} m, far {far}, pitch {pitch}");
                    seen += usize::from(id != 0);
                }
            }
        }
    }
    assert!(seen > 100_000, "{seen}");
}

/// How far a point is from the way of the light to another.
fn beside(point: [f32; 3], from: [f32; 3], to: [f32; 3]) -> f32 {
    let sub = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|k| a[k] - b[k]);
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (way, at) = (sub(to, from), sub(point, from));
    let t = (dot(at, way) / dot(way, way)).clamp(0.0, 1.0);
    let off = sub(at, way.map(|x| x * t));
    dot(off, off).sqrt()
}

/// Shadow maps are cut to what casts shadows. A point of the ground is dark where the way to the lamp goes through a ball, and
/// lit elsewhere: balls in the middle of the cone, half outside of it, close to the lamp, far apart.
#[test]
fn balls_throw_shadows_where_they_are_in_the_way() {
    const RADIUS: f32 = 0.3;
    let lamp = [0.0, 0.0, 3.0];
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 0.0 };
    let cases: [&[[f32; 3]]; 6] = [
        &[[0.0, 0.0, 0.5]],
        &[[1.9, 0.0, 0.5]],
        &[[-0.9, -1.6, 0.6]],
        &[[0.1, 0.0, 2.5]],
        &[[-1.5, 1.0, 0.35], [1.4, -1.1, 0.5], [0.0, 0.3, 1.4]],
        // None at all in the cone.
        &[[6.0, 0.0, 0.5]],
    ];
    for (case, balls) in cases.into_iter().enumerate() {
        for kind in [spot, LightKind::Directional] {
            let mut instances = vec![Instance::new(Plane::INFINITE, Material::default(), 1)];
            instances.extend(balls.iter().map(|_| Instance::new(Sphere { radius: RADIUS }, Material::default(), 2)));
            let mut poses = vec![PoseF32::IDENTITY];
            poses.extend(balls.iter().map(|at| PoseF32::from_translation(*at)));
            let mut scene = RenderScene::new(instances).unwrap();
            let direction = if kind == spot { [0.0, 0.0, -1.0] } else { [0.3, 0.2, -1.0] };
            scene.lights = vec![Light { kind, position: lamp, direction, ..Light::default() }];
            scene.headlight.active = false;
            let view = View::look_at([320, 240], 1.1, [3.5, -2.5, 4.0], [0., 0., 0.], [0., 0., 1.]).unwrap();
            let picture =
                |shadows| draw(&scene, &poses, &view, RasterCfg { shadows, samples: 1, ..RasterCfg::default() });
            let (with, without) = (picture(true), picture(false));
            let (position, mask) = (with.position.unwrap(), with.mask.unwrap());
            let (with, without) = (with.color.unwrap(), without.color.unwrap());
            let (mut dark, mut lit) = (0, 0);
            for (k, p) in position.chunks_exact(3).enumerate().filter(|(k, _)| mask[*k] == 1) {
                let p = [p[0], p[1], p[2]];
                // Inside of the cone and of the map, whose light the balls could take.
                if (p[0] * p[0] + p[1] * p[1]).sqrt() > 3.0 * 38f32.to_radians().tan() {
                    continue;
                }
                let from = if kind == spot { lamp } else { [0, 1, 2].map(|k| p[k] - 8.0 * direction[k]) };
                let near = balls.iter().map(|ball| beside(*ball, from, p)).fold(f32::INFINITY, f32::min);
                let (with, without) = (i32::from(with[4 * k]), i32::from(without[4 * k]));
                // The edge of a shadow is two texels of 1 to 2 cm wide on each side, and points are moved off the ground by
                // two more; close to the lamp a ball is larger on the map than on the ground.
                if near < RADIUS - 0.08 {
                    assert!(with + 20 < without, "case {case}, {kind:?}: {with} of {without} at {p:?}");
                    dark += 1;
                } else if near > RADIUS + 0.08 {
                    assert!((with - without).abs() <= 1, "case {case}, {kind:?}: {with} of {without} at {p:?}");
                    lit += 1;
                }
            }
            assert!(lit > 50 && (dark > 20 || case == 5), "case {case}, {kind:?}: {dark} dark, {lit} lit");
        }
    }
}

/// A cube texture of six colours, seen along its axes: MuJoCo's order of the faces is +x, -x, +y, -y, +z, -z.
#[test]
fn faces_of_a_cube_have_their_own_colours() {
    let colors: [[u8; 3]; 6] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [0, 255, 255], [255, 0, 255]];
    let axes: [[f32; 3]; 6] = [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    for side in [1usize, 3, 8] {
        let data: Vec<u8> = colors.iter().flat_map(|c| c.repeat(side * side)).collect();
        let texture = Texture::new(TextureKind::Cube, side as u32, 6 * side as u32, 3, &data).unwrap();
        let material = Material { texture: Some(Arc::new(texture)), specular: 0.0, ..Material::default() };
        let mut scene = RenderScene::new(vec![Instance::new(Sphere { radius: 1.0 }, material, 1)]).unwrap();
        scene.lights.clear();
        for (axis, color) in axes.into_iter().zip(colors) {
            let up = if axis[2] == 0.0 { [0., 0., 1.] } else { [1., 0., 0.] };
            let eye = axis.map(|x| 3.0 * x);
            let view = View::look_at([65, 65], 0.8, eye, [0.; 3], up).unwrap();
            let frame = draw(&scene, &[PoseF32::IDENTITY], &view, RasterCfg { samples: 1, ..RasterCfg::default() });
            let (seen, position) = (frame.color.unwrap(), frame.position.unwrap());
            let mut count = 0;
            for (seen, p) in seen.chunks_exact(4).zip(position.chunks_exact(3)) {
                let along: f32 = (0..3).map(|k| p[k] * axis[k]).sum();
                let across = (0..3).map(|k| (p[k] * (1.0 - axis[k].abs())).abs()).fold(0.0, f32::max);
                // Inside of the face: nothing is blended across its edge.
                if along <= 0.0 || across > 0.999 * along {
                    continue;
                }
                for (seen, full) in seen.iter().zip(color) {
                    let bright = *seen > 40;
                    assert_eq!(bright, full == 255, "side {side}, axis {axis:?}, at {p:?}: {seen} for {color:?}");
                }
                count += 1;
            }
            assert!(count > 200, "{count}");
        }
    }
}
