#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use crate::control::{Viewing, Wants};
use crate::sample::{HALF, MASS, Sample, sample};
use nalgebra::{Point3, Vector3};
use sensors::camera::colormap::{depth_color, mask_color, normal_color};
use sensors::camera::lens::Equidistant;
use sensors::camera::{CameraCfg, Channels, Extrinsics, Intrinsics, Placement, Renderer, StereoCameraCfg};
use sensors::ray::RayCasterCameraCfg;
use sim::EnvId;
use std::collections::BTreeSet;
use std::sync::Arc;

/// A snapshot with everything, after the cube has come to rest.
fn stage(num_envs: usize) -> (Sample, Arc<Snapshot>) {
    let mut sample = sample(num_envs);
    sample.sim.update(100);
    let viewer = sample.sim.viewer(Wants { contacts: Some(Shown::All), ..Wants::default() });
    let snapshot = viewer.newest().unwrap();
    (sample, snapshot)
}

fn unlike(one: &Canvas, other: &Canvas) -> usize {
    one.bytes().chunks(4).zip(other.bytes().chunks(4)).filter(|(a, b)| a != b).count()
}

#[test]
fn a_click_finds_the_link_the_environment_and_the_point() {
    let (sample, snapshot) = stage(4);
    let mut painter = Painter::new(1);
    let origins = sample.sim.env_origins();
    for env in 0..4 {
        let origin = [0, 1, 2].map(|k| origins[(env, k)]);
        let above = |at: [f64; 3]| {
            Eye::looking(
                [0, 1, 2].map(|k| origin[k] + at[k] + [0.3, 0.2, 1.5][k]),
                [0, 1, 2].map(|k| origin[k] + at[k]),
            )
            .unwrap()
        };
        // The middle of the cube's upper face, and of the plate's, in the middle of the picture.
        for (name, at) in [("cube", [0.0, 0.0, 2.0 * HALF]), ("arm/plate", [1.0, 0.0, 0.525])] {
            let view = above(at).view(201, 101);
            let picked = painter.pick(&snapshot, &view, &Look::default(), [100.5, 50.5]).unwrap();
            assert!(picked.name == name && picked.env == env, "{picked:?}");
            let body = picked.body.unwrap();
            assert_eq!(snapshot.names.bodies[body], name);
            // Half a pixel at 1.5 m is 6 mm; the face is flat, so its height is exact to single precision.
            let away = (Vector3::from(picked.point) - Vector3::from(at)).norm();
            assert!(away < 0.01 && (picked.point[2] - at[2]).abs() < 1e-3, "{picked:?}");
            let back = picked.pose(&snapshot).unwrap() * Point3::from(picked.hold);
            assert!((back.coords - Vector3::from(picked.point)).norm() < 1e-9);
        }
        // Beside both there is the ground, and above the horizon nothing.
        let view = above([0.0, -0.5, 0.0]).view(201, 101);
        let picked = painter.pick(&snapshot, &view, &Look::default(), [100.5, 50.5]).unwrap();
        assert!(picked.name == "ground" && picked.body.is_none(), "{picked:?}");
        let up = Eye::looking([0.0, 0.0, 1.0], [1.0, 0.0, 3.0]).unwrap().view(201, 101);
        assert_eq!(painter.pick(&snapshot, &up, &Look::default(), [100.5, 50.5]), None);
    }
}

/// What holds the cube against its weight is the sum of its contact forces, m g, upward: a law.
#[test]
fn what_is_said_of_a_resting_cube_is_its_weight() {
    let (_, snapshot) = stage(1);
    let mut painter = Painter::new(1);
    let view = Eye::looking([0.3, 0.2, 1.5], [0.0, 0.0, 2.0 * HALF]).unwrap().view(64, 64);
    let picked = painter.pick(&snapshot, &view, &Look::default(), [32.0, 32.0]).unwrap();
    let cube = picked.body.unwrap() as u32;
    let mut sum = Vector3::zeros();
    for contact in &snapshot.envs[0].contacts {
        assert!(contact.bodies.contains(&Some(cube)), "only the cube touches anything: {contact:?}");
        let sign = if contact.bodies[1] == Some(cube) { 1.0 } else { -1.0 };
        sum += sign * Vector3::from(contact.force);
    }
    // At rest to 1e-3 m/s² after a second.
    assert!((sum - Vector3::new(0.0, 0.0, MASS * 9.81)).norm() < 0.01, "{sum}");
    let text = describe(&picked, &snapshot).join("\n");
    assert!(text.starts_with("cube  (environment 0") && text.contains("+19.6"), "{text}");
}

#[test]
fn all_environments_stand_in_their_grid_or_one_is_shown() {
    let (_, snapshot) = stage(4);
    let mut painter = Painter::new(2);
    let view = Eye::overview(&snapshot).view(160, 120);
    let (mut all, mut one) = (Canvas::default(), Canvas::default());
    let red =
        |canvas: &Canvas| canvas.bytes().chunks(4).filter(|p| p[0] > 100 && p[1] < p[0] / 2 && p[2] < p[0] / 2).count();
    painter.draw(&snapshot, &view, &Look::default(), &mut all).unwrap();
    let look = Look { shown: Shown::One(2), ..Look::default() };
    painter.draw(&snapshot, &view, &look, &mut one).unwrap();
    assert_eq!(all.dimensions(), [160, 120]);
    // Four red cubes, or one of them.
    let (all_red, one_red) = (red(&all), red(&one));
    assert!(one_red > 0 && all_red > 2 * one_red && all_red < 8 * one_red, "{all_red} {one_red}");
    // Drawn again, and by another painter on one thread, the bits are the same.
    let (mut again, mut other) = (Canvas::default(), Canvas::default());
    painter.draw(&snapshot, &view, &Look::default(), &mut again).unwrap();
    Painter::new(1).draw(&snapshot, &view, &Look::default(), &mut other).unwrap();
    assert!(again == all && other == all);
}

#[test]
fn every_overlay_changes_the_picture_and_goes_again() {
    let (mut sample, snapshot) = stage(2);
    let mut painter = Painter::new(1);
    let [x, y, _] = snapshot.envs[0].origin;
    let view = Eye { target: [x + 0.5, y, 0.3], distance: 1.5, ..Eye::default() }.view(200, 150);
    let mut draw = |snapshot: &Snapshot, overlays: Overlays, trails: Option<&Trails>| {
        let mut canvas = Canvas::default();
        painter.draw(snapshot, &view, &Look { overlays, trails, ..Look::default() }, &mut canvas).unwrap();
        canvas
    };
    let none = Overlays { sensors: false, ..Overlays::default() };
    let plain = draw(&snapshot, none, None);
    let each = [
        Overlays { contacts: true, ..none },
        Overlays { frames: true, ..none },
        Overlays { joints: true, ..none },
        Overlays { masses: true, visuals: false, ..none },
        Overlays { names: true, ..none },
        Overlays { visuals: false, ..none },
        Overlays { visuals: false, collisions: true, ..none },
    ];
    for overlays in each {
        let with = draw(&snapshot, overlays, None);
        assert!(unlike(&plain, &with) > 5, "{overlays:?}");
    }
    assert!(unlike(&draw(&snapshot, each[3], None), &draw(&snapshot, each[5], None)) > 5);
    assert_eq!(draw(&snapshot, none, None), plain, "and without them it is as before");
    // What sensors show, once they are told to.
    sample.sim.set_debug_vis(sample.camera, true).unwrap();
    let viewer = sample.sim.viewer(Wants::default());
    let shown = viewer.newest().unwrap();
    assert!(unlike(&draw(&shown, none, None), &draw(&shown, Overlays::default(), None)) > 5);
    // A trail of something that moves.
    let mut trails = Trails::default();
    trails.add(&shown, Shown::All);
    sample.sim.robot_mut(sample.robot).set_qpos(&ndarray::arr2(&[[1.5]]), None, None).unwrap();
    let trail = Overlays { trails: true, ..none };
    assert_eq!(draw(&shown, trail, Some(&trails)), draw(&shown, none, None), "nothing has moved yet");
    let pose = ndarray::arr2(&[[0.0, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0]]);
    let cube = sample.sim.rigid_object_id("cube").unwrap();
    sample.sim.rigid_object_mut(cube).write_pose(&pose, None).unwrap();
    for _ in 0..20 {
        sample.sim.update(1);
        let viewer = sample.sim.viewer(Wants::default());
        trails.add(&viewer.newest().unwrap(), Shown::All);
    }
    let viewer = sample.sim.viewer(Wants::default());
    let moved = viewer.newest().unwrap();
    assert!(unlike(&draw(&moved, trail, Some(&trails)), &draw(&moved, none, None)) > 5);
}

/// Where there are more bodies than trails, the picture says so.
#[test]
fn trails_that_are_left_out_are_said() {
    let (_, snapshot) = stage(2);
    let bodies = snapshot.names.bodies.len();
    let view = Eye::default().view(400, 100);
    let written = |envs: usize| {
        let envs = snapshot.envs.iter().cycle().take(envs).cloned().collect();
        let snapshot = Snapshot { envs, ..Snapshot::clone(&snapshot) };
        let (mut trails, mut canvas) = (Trails::default(), Canvas::new(400, 100));
        trails.add(&snapshot, Shown::All);
        trails.draw(&snapshot, Shown::All, &view, &mut canvas);
        let below = (86..96).flat_map(|y| (0..400).map(move |x| (x, y)));
        below.filter(|&(x, y)| canvas.pixel(x, y) == Some(color::TRAIL)).count()
    };
    assert_eq!(written(1024 / bodies), 0, "each has its own");
    assert!(written(1024 / bodies + 1) > 100, "some forty letters");
}

/// Who looks at one environment alone sees its trails, also far behind the first 1024 bodies; and keeps them where all have some.
#[test]
fn an_environment_that_is_shown_alone_has_trails() {
    let (mut sample, first) = stage(2);
    let cube = sample.sim.rigid_object_id("cube").unwrap();
    let view = Eye { target: [0.0, 0.0, 0.5], distance: 3.0, ..Eye::default() }.view(200, 150);
    let mut moments = vec![first];
    for k in 0..10 {
        let pose = ndarray::arr2(&[[0.0, -0.5 + 0.1 * f64::from(k), 0.9, 1.0, 0.0, 0.0, 0.0]]);
        sample.sim.rigid_object_mut(cube).write_pose(&pose, None).unwrap();
        moments.push(sample.sim.viewer(Wants::default()).newest().unwrap());
    }
    let drawn = |envs: usize, kept: Shown, shown: Shown| {
        let mut trails = Trails::default();
        let of_many = |moment: &Snapshot| {
            let envs = moment.envs.iter().cycle().take(envs).map(|env| EnvStage { origin: [0.0; 3], ..env.clone() });
            Snapshot { envs: envs.collect(), ..moment.clone() }
        };
        moments.iter().for_each(|moment| trails.add(&of_many(moment), kept));
        let last = of_many(moments.last().unwrap());
        trails.add(&last, shown);
        let mut canvas = Canvas::new(200, 150);
        trails.draw(&last, shown, &view, &mut canvas);
        let all = (0..150).flat_map(|y| (0..200).map(move |x| (x, y)));
        all.filter(|&(x, y)| canvas.pixel(x, y).is_some_and(|p| p[..3] != [0; 3])).count()
    };
    let far = 5000;
    let of_two = drawn(2, Shown::All, Shown::One(1));
    assert!(of_two > 20, "{of_two}: kept from when both were shown");
    assert_eq!(drawn(far + 1, Shown::One(far), Shown::One(far)), drawn(2, Shown::One(0), Shown::One(0)));
    assert!(drawn(far + 1, Shown::One(far), Shown::One(far)) > 20);
    assert_eq!(drawn(far + 1, Shown::All, Shown::One(far)), 0, "it had none: they begin now");
}

/// The panel draws what the sensor itself measures, pixel by pixel, where nothing moved since.
#[test]
fn the_panel_shows_what_the_camera_measures() {
    let (sample, snapshot) = stage(2);
    assert_eq!(snapshot.names.cameras, ["eye"]);
    let camera = sample.sim.sensor(sample.camera).unwrap();
    let (mut panel, mut canvas) = (Panel::new(1), Canvas::default());
    assert!(panel.draw(&snapshot, 0, 1, 64, &mut canvas));
    assert_eq!(canvas.dimensions(), [128, 96]);
    let (depth, mask, normal) = (camera.depth().unwrap(), camera.mask().unwrap(), camera.normal().unwrap());
    let finite = depth.index_axis(ndarray::Axis(0), 1).iter().copied().filter(|d| d.is_finite()).collect::<Vec<f32>>();
    let range = finite.iter().fold([f32::MAX, f32::MIN], |[low, high], d| [low.min(*d), high.max(*d)]);
    let color = camera.color().unwrap();
    let (mut seen, mut colors) = (BTreeSet::new(), BTreeSet::new());
    // Below the titles.
    for (v, u) in (15..48usize).flat_map(|v| (0..64usize).map(move |u| (v, u))) {
        // Where several things, or lit and shaded parts, are in a pixel, its colour is a mixture of four samples.
        let rgb = |v: usize, u: usize| [0, 1, 2].map(|k| color[(1, v, u, k)]);
        let around = [(v - 1, u), (v + 1, u), (v, u.saturating_sub(1)), (v, (u + 1).min(63)), (v, u)];
        let flat = around.iter().all(|&(v, u)| {
            v < 48 && rgb(v, u).iter().zip(rgb(around[4].0, around[4].1)).all(|(a, b)| a.abs_diff(b) < 3)
        });
        if flat {
            let seen = canvas.pixel(u, v).unwrap();
            assert!(seen.iter().zip(rgb(v, u)).all(|(a, b)| a.abs_diff(b) <= 1), "{seen:?}, not {:?}", rgb(v, u));
            colors.insert(seen);
        }
        let expected = [
            (64 + u, v, depth_color(depth[(1, v, u)], range)),
            (u, 48 + v, mask_color(mask[(1, v, u)])),
            (64 + u, 48 + v, normal_color([0, 1, 2].map(|k| normal[(1, v, u, k)]))),
        ];
        for (x, y, color) in expected {
            assert_eq!(canvas.pixel(x, y), Some(color), "pixel {x} {y}");
        }
        seen.insert(mask[(1, v, u)]);
    }
    assert!(seen.len() >= 2, "the cube and the ground: {seen:?}");
    assert!(colors.iter().any(|c| c[0] > 2 * c[1].max(c[2])), "the cube is red: {colors:?}");
    assert!(colors.len() > 3, "{colors:?}");
    assert!(!panel.draw(&snapshot, 1, 0, 64, &mut canvas), "there is no such camera");
    assert!(!panel.draw(&snapshot, 0, 9, 64, &mut canvas), "there is no such environment");
    assert!(panel.draw(&snapshot, 0, 0, 0, &mut canvas), "as small as can be");
}

/// The masks in a panel of 64 x 48 pixels each, below the title.
fn masks(canvas: &Canvas) -> Vec<[u8; 3]> {
    (15..48).flat_map(|v| (0..64).map(move |u| (u, 48 + v))).map(|(u, v)| canvas.pixel(u, v).unwrap()).collect()
}

/// What a sensor's own mask looks like there.
fn masks_of(mask: ndarray::ArrayView3<'_, i32>) -> Vec<[u8; 3]> {
    (15..48).flat_map(|v| (0..64).map(move |u| (v, u))).map(|(v, u)| mask_color(mask[(0, v, u)])).collect()
}

/// Cameras of every kind are there, each as it sees: a pair of eyes, one ray for each pixel, a lens that bends the rays.
#[test]
fn the_panel_has_cameras_of_every_kind() {
    let mut sample = sample(1);
    let placement = Placement::LookAt { eye: [0.6, 0.5, 0.8], target: [0.2, 0.0, 0.1], up: [0.0, 0.0, 1.0] };
    let cfg = CameraCfg {
        width: 64,
        height: 48,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels { mask: true, ..Channels::NONE },
        ..Default::default()
    };
    let pair = StereoCameraCfg { camera: cfg.clone(), left_to_right_pos: [0.2, 0.0, 0.0], ..Default::default() };
    let pair = sample.sim.add_sensor("pair", pair).unwrap();
    let intrinsics = Intrinsics::Pixels { fx: 25.0, fy: 25.0, cx: 32.0, cy: 24.0 };
    let lens = Equidistant { max_angle: 1.6 }.into();
    let fish = CameraCfg { renderer: Renderer::FastRayTraced, intrinsics, lens, ..cfg.clone() };
    let fish = sample.sim.add_sensor("fish", fish).unwrap();
    let rays = RayCasterCameraCfg {
        width: 64,
        height: 48,
        intrinsics: cfg.intrinsics,
        extrinsics: cfg.extrinsics.clone(),
        ..Default::default()
    };
    let rays = sample.sim.add_sensor("rays", rays).unwrap();
    sample.sim.update(100);
    let snapshot = sample.sim.viewer(Wants::default()).newest().unwrap();
    assert_eq!(snapshot.names.cameras, ["eye", "fish", "pair/left", "pair/right", "rays"]);
    let (mut panel, mut canvas) = (Panel::new(1), Canvas::default());
    let mut drawn = |camera: usize| {
        assert!(panel.draw(&snapshot, camera, 0, 64, &mut canvas));
        masks(&canvas)
    };
    let [fisheye, left, right, cast] = [1, 2, 3, 4].map(&mut drawn);
    let sim = &sample.sim;
    assert!(fisheye == masks_of(sim.sensor(fish).unwrap().mask().unwrap()));
    assert!(left == masks_of(sim.sensor(pair).unwrap().left().mask().unwrap()));
    assert!(right == masks_of(sim.sensor(pair).unwrap().right().mask().unwrap()));
    // Rays and rasterizer may differ where an edge goes through the middle of a pixel.
    let own = masks_of(sim.sensor(rays).unwrap().mask());
    let unlike = own.iter().zip(&cast).filter(|(a, b)| a != b).count();
    assert!(unlike < 20, "{unlike} of {} pixels", own.len());
    // The controls: each of them sees something else.
    assert!(left != right && fisheye != left);
    let colors: BTreeSet<_> = fisheye.iter().collect();
    assert!(colors.len() >= 2, "{colors:?}");
}

/// What other sensors show is in the colours of a camera that draws it, there and in the panel, and in nothing else.
#[test]
fn the_panel_shows_markers_where_the_camera_draws_them() {
    let mut sample = sample(1);
    let placement = Placement::LookAt { eye: [0.6, 0.5, 0.8], target: [0.2, 0.0, 0.1], up: [0.0, 0.0, 1.0] };
    let cfg = CameraCfg {
        width: 64,
        height: 48,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels { color: true, ..Channels::NONE },
        draw_markers: true,
        ..Default::default()
    };
    sample.sim.add_sensor("marked", cfg).unwrap();
    // Another camera above the cube shows its frame.
    let placement = Placement::LookAt { eye: [0.2, 0.1, 0.4], target: [0.0; 3], up: [0.0, 0.0, 1.0] };
    let other = CameraCfg { extrinsics: Extrinsics { placement, ..Default::default() }, ..CameraCfg::default() };
    let other = sample.sim.add_sensor("other", other).unwrap();
    sample.sim.set_debug_vis(other, true).unwrap();
    sample.sim.update(100);
    let snapshot = sample.sim.viewer(Wants::default()).newest().unwrap();
    let [plain, marked] = [0, 1].map(|camera| {
        let mut canvas = Canvas::default();
        assert!(Panel::new(1).draw(&snapshot, camera, 0, 64, &mut canvas));
        canvas
    });
    let differs = |x: [usize; 2], y: [usize; 2]| {
        let places = (y[0]..y[1]).flat_map(|v| (x[0]..x[1]).map(move |u| (u, v)));
        places.filter(|&(u, v)| plain.pixel(u, v) != marked.pixel(u, v)).count()
    };
    assert!(differs([0, 64], [0, 48]) > 5, "colours");
    assert_eq!([differs([64, 128], [0, 48]), differs([0, 128], [48, 96])], [0, 0], "depth, mask and normals");
}

#[test]
fn pictures_of_every_size_can_be_drawn() {
    let (mut sample, snapshot) = stage(1);
    let mut painter = Painter::new(2);
    let mut canvas = Canvas::default();
    for [width, height] in [[1, 1], [1, 500], [2000, 3]] {
        let view = Eye::default().view(width, height);
        let overlays = Overlays { names: true, contacts: true, frames: true, ..Overlays::default() };
        painter.draw(&snapshot, &view, &Look { overlays, ..Look::default() }, &mut canvas).unwrap();
        assert_eq!(canvas.dimensions(), [width, height]);
    }
    // An environment that diverged is shown where it stood.
    sample.sim.update(1);
    assert!(sample.sim.contacts(Some(&[EnvId(5)])).is_err());
}

/// The place that was clicked on has a ball, as large from near as from far, which is no obstacle to the next click.
#[test]
fn what_was_clicked_on_is_marked() {
    let (_sample, snapshot) = stage(1);
    let mut painter = Painter::new(1);
    for distance in [0.8, 3.0] {
        let eye = Eye { distance, ..Eye::looking([0.3, 0.2, 1.5], [0.0, 0.0, 2.0 * HALF]).unwrap() };
        let view = eye.view(201, 101);
        let picked = painter.pick(&snapshot, &view, &Look::default(), [100.5, 50.5]).unwrap();
        let (mut with, mut without) = (Canvas::default(), Canvas::default());
        painter.draw(&snapshot, &view, &Look::default(), &mut without).unwrap();
        let look = Look { picked: Some(&picked), ..Look::default() };
        painter.draw(&snapshot, &view, &look, &mut with).unwrap();
        // A disc of radius 4 has 50 pixels; half of the ball or more is above the face, and so is the tip of no axis.
        let marked = unlike(&with, &without);
        assert!((25..90).contains(&marked), "{marked} pixels from {distance} m");
        assert_eq!(painter.pick(&snapshot, &view, &look, [100.5, 50.5]), Some(picked));
    }
}
