#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use crate::control::{SnapshotRequest, ViewerExt};
use crate::sample::{CUBE_HALF_EDGE, MASS, Sample, differing_pixels, sample};
use kinetoscope_render::View;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens::Equidistant;
use kinetoscope_render::{Intrinsics, Renderer};
use kinetoscope_sensors::camera::colormap::{depth_color, mask_color, normal_color};
use kinetoscope_sensors::camera::{CameraCfg, Extrinsics, Placement, StereoCameraCfg};
use kinetoscope_sensors::ray::RayCasterCameraCfg;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Steps until the cube rests, then takes a snapshot with all contents.
fn stage(num_envs: usize) -> (Sample, Arc<Snapshot>) {
    let mut sample = sample(num_envs);
    sample.sim.update(100);
    let viewer = sample.sim.viewer(SnapshotRequest { contacts: Some(EnvSelection::All), ..SnapshotRequest::default() });
    let snapshot = viewer.newest().unwrap();
    (sample, snapshot)
}

impl Sample {
    /// Returns the newest snapshot.
    fn snapshot(&mut self) -> Arc<Snapshot> {
        self.sim.viewer(SnapshotRequest::default()).newest().unwrap()
    }

    fn put_cube(&mut self, [x, y, z]: [f64; 3]) {
        let cube = self.sim.entities().rigid_object_id("cube").unwrap();
        let pose = ndarray::arr2(&[[x, y, z, 1.0, 0.0, 0.0, 0.0]]);
        self.sim.rigid_object_mut(cube).write_pose(&pose, None).unwrap();
    }
}

fn painted(scene_renderer: &mut SceneRenderer, snapshot: &Snapshot, view: &View, look: &ViewOptions<'_>) -> Canvas {
    let mut canvas = Canvas::default();
    scene_renderer.draw(snapshot, view, look, &mut canvas).unwrap();
    canvas
}

#[test]
fn picking() {
    let (sample, snapshot) = stage(4);
    let mut scene_renderer = SceneRenderer::new(1);
    let origins = sample.sim.cfg().env_origins();
    for env in 0..4 {
        let origin = Vector3::from([0, 1, 2].map(|k| origins[(env, k)]));
        let above = |at: [f64; 3]| {
            let target = origin + Vector3::from(at);
            OrbitCamera::look_at((target + Vector3::new(0.3, 0.2, 1.5)).into(), target.into()).unwrap().view(201, 101)
        };
        let mut pick = |view: &View| scene_renderer.pick(&snapshot, view, &ViewOptions::default(), [100.5, 50.5]);
        // The center of the upper face of the cube, and of the plate, at the image center.
        for (name, at) in [("cube", [0.0, 0.0, 2.0 * CUBE_HALF_EDGE]), ("arm/plate", [1.0, 0.0, 0.525])] {
            let picked = pick(&above(at)).unwrap();
            assert!(picked.name == name && picked.env == env, "{picked:?}");
            assert_eq!(snapshot.names.bodies[picked.body.unwrap()], name);
            // Half a pixel at 1.5 m is 6 mm. The face is flat, so its height is exact to single precision.
            let away = (Vector3::from(picked.point) - Vector3::from(at)).norm();
            assert!(away < 0.01 && (picked.point[2] - at[2]).abs() < 1e-3, "{picked:?}");
            let back = picked.pose(&snapshot).unwrap() * Point3::from(picked.point_in_body);
            assert!((back.coords - Vector3::from(picked.point)).norm() < 1e-9);
        }
        // Beside both is the ground; above the horizon is the sky.
        let picked = pick(&above([0.0, -0.5, 0.0])).unwrap();
        assert!(picked.name == "ground" && picked.body.is_none(), "{picked:?}");
        assert_eq!(pick(&OrbitCamera::look_at([0.0, 0.0, 1.0], [1.0, 0.0, 3.0]).unwrap().view(201, 101)), None);
    }
}

/// The contact forces on a resting cube add up to its weight, m g, upward. The selected point has a marker of the same
/// image size at any distance, which does not block the next click.
#[test]
fn selected_cube() {
    let (_, snapshot) = stage(1);
    let mut scene_renderer = SceneRenderer::new(1);
    for distance in [0.8, 3.0] {
        let eye = OrbitCamera {
            distance,
            ..OrbitCamera::look_at([0.3, 0.2, 1.5], [0.0, 0.0, 2.0 * CUBE_HALF_EDGE]).unwrap()
        };
        let view = eye.view(201, 101);
        let picked = scene_renderer.pick(&snapshot, &view, &ViewOptions::default(), [100.5, 50.5]).unwrap();
        let cube = picked.body.unwrap() as u32;
        let mut sum = Vector3::zeros();
        for contact in &snapshot.envs[0].contacts {
            assert!(contact.bodies.contains(&Some(cube)), "only the cube touches anything: {contact:?}");
            sum += if contact.bodies[1] == Some(cube) { 1.0 } else { -1.0 } * Vector3::from(contact.force);
        }
        // At rest to 1e-3 m/s² after one second.
        assert!((sum - Vector3::new(0.0, 0.0, MASS * 9.81)).norm() < 0.01, "{sum}");
        let text = selection_text(&picked, &snapshot).join("\n");
        assert!(text.starts_with("cube  (environment 0") && text.contains("+19.6"), "{text}");
        let look = ViewOptions { selection: Some(&picked), ..ViewOptions::default() };
        let with = painted(&mut scene_renderer, &snapshot, &view, &look);
        // A disc of radius 4 has 50 pixels. At least half of the marker is above the face; the tips of the axes add
        // some pixels.
        let marked = differing_pixels(&with, &painted(&mut scene_renderer, &snapshot, &view, &ViewOptions::default()));
        assert!((25..90).contains(&marked), "{marked} pixels from {distance} m");
        assert_eq!(scene_renderer.pick(&snapshot, &view, &look, [100.5, 50.5]), Some(picked));
    }
}

/// All environments are drawn in their grid, or only one of them.
#[test]
fn environments() {
    let (_, snapshot) = stage(4);
    let mut scene_renderer = SceneRenderer::new(2);
    let view = OrbitCamera::overview(&snapshot, [160, 120]).view(160, 120);
    let red =
        |canvas: &Canvas| canvas.bytes().chunks(4).filter(|p| p[0] > 100 && p[1] < p[0] / 2 && p[2] < p[0] / 2).count();
    let all = painted(&mut scene_renderer, &snapshot, &view, &ViewOptions::default());
    let one = painted(
        &mut scene_renderer,
        &snapshot,
        &view,
        &ViewOptions { envs: EnvSelection::One(2), ..ViewOptions::default() },
    );
    assert_eq!(all.dimensions(), [160, 120]);
    // Four red cubes, or one of them.
    let (all_red, one_red) = (red(&all), red(&one));
    assert!(one_red > 0 && all_red > 2 * one_red && all_red < 8 * one_red, "{all_red} {one_red}");
    // Rendering again, also with one thread, gives the same bits.
    for scene_renderer in [&mut scene_renderer, &mut SceneRenderer::new(1)] {
        assert!(painted(scene_renderer, &snapshot, &view, &ViewOptions::default()) == all);
    }
    let overlays = Overlays { names: true, contacts: true, frames: true, ..Overlays::default() };
    for [width, height] in [[1, 1], [1, 500], [2000, 3]] {
        let view = OrbitCamera::default().view(width, height);
        let canvas =
            painted(&mut scene_renderer, &snapshot, &view, &ViewOptions { overlays, ..ViewOptions::default() });
        assert_eq!(canvas.dimensions(), [width, height]);
    }
}

/// The lights of an environment are where its bodies are: environments 0 and 3, each seen alone from the same side, give
/// the same image.
///
/// Regression: lights stayed at their places in the environment, without its origin.
#[test]
fn lights_at_the_origin() {
    let cfg = kinetoscope_sim::SimulationManagerCfg {
        num_envs: 4,
        arena_space: 8.0,
        lights: vec![kinetoscope_sim::LightCfg {
            kind: kinetoscope_sim::LightKindCfg::Point,
            position: Vector3::new(0.5, 0.2, 1.5),
            attenuation: [1.0, 0.0, 0.2],
            ..Default::default()
        }],
        ..Default::default()
    };
    let mut sim = kinetoscope_sim::SimulationManager::new(cfg).unwrap();
    sim.add_rigid_object(kinetoscope_sim::RigidObjectCfg::default()).unwrap();
    let snapshot = sim.viewer(SnapshotRequest::default()).newest().unwrap();
    let mut scene_renderer = SceneRenderer::new(1);
    let mut image = |env: usize| {
        let target = Point3::from(snapshot.envs[env].origin);
        let view =
            OrbitCamera::look_at((target + Vector3::new(2.0, -1.5, 2.0)).into(), target.into()).unwrap().view(160, 120);
        let alone = ViewOptions { envs: EnvSelection::One(env), ..ViewOptions::default() };
        painted(&mut scene_renderer, &snapshot, &view, &alone)
    };
    let (first, last) = (image(0), image(3));
    // Positions are rounded to single precision, which moves edges.
    let differs = |(a, b): (&u8, &u8)| a.abs_diff(*b) > 8;
    let count = first.bytes().iter().zip(last.bytes()).filter(|pair| differs(*pair)).count();
    assert!(count < first.bytes().len() / 100, "{count} of {} bytes", first.bytes().len());
}

/// Every overlay changes the image, and disabling it restores the image.
#[test]
fn overlays() {
    let (mut sample, snapshot) = stage(2);
    let mut scene_renderer = SceneRenderer::new(1);
    let [x, y, _] = snapshot.envs[0].origin;
    let view = OrbitCamera { target: [x + 0.5, y, 0.3], distance: 1.5, ..OrbitCamera::default() }.view(200, 150);
    let mut draw = |snapshot: &Snapshot, overlays: Overlays, trails: Option<&Trails>| {
        painted(&mut scene_renderer, snapshot, &view, &ViewOptions { overlays, trails, ..ViewOptions::default() })
    };
    let none = Overlays { sensors: false, ..Overlays::default() };
    let plain = draw(&snapshot, none, None);
    let bare = Overlays { visuals: false, ..none };
    for (base, with) in [
        (none, Overlays { contacts: true, ..none }),
        (none, Overlays { frames: true, ..none }),
        (none, Overlays { joints: true, ..none }),
        (none, Overlays { names: true, ..none }),
        (none, bare),
        (none, Overlays { centers_of_mass: true, ..bare }),
        (bare, Overlays { centers_of_mass: true, ..bare }),
        (none, Overlays { collisions: true, ..bare }),
    ] {
        assert!(differing_pixels(&draw(&snapshot, base, None), &draw(&snapshot, with, None)) > 5, "{with:?}");
    }
    assert_eq!(draw(&snapshot, none, None), plain, "and without them it is as before");
    // Markers of sensors, once they are enabled.
    sample.sim.scene_mut().set_debug_vis(sample.camera, true).unwrap();
    let shown = sample.snapshot();
    assert!(differing_pixels(&draw(&shown, none, None), &draw(&shown, Overlays::default(), None)) > 5);
    // A trail of a moving body.
    let mut trails = Trails::default();
    trails.add(&shown, EnvSelection::All);
    sample.sim.robot_mut(sample.robot).set_qpos_target(&ndarray::arr2(&[[1.5]]), None, None).unwrap();
    let trail = Overlays { trails: true, ..none };
    assert_eq!(draw(&shown, trail, Some(&trails)), draw(&shown, none, None), "nothing has moved yet");
    sample.put_cube([0.0, 0.0, 0.9]);
    for _ in 0..20 {
        sample.sim.update(1);
        trails.add(&sample.snapshot(), EnvSelection::All);
    }
    let moved = sample.snapshot();
    assert!(differing_pixels(&draw(&moved, trail, Some(&trails)), &draw(&moved, none, None)) > 5);
}

/// Repeats the environments of a snapshot up to this number.
fn many(snapshot: &Snapshot, envs: usize) -> Snapshot {
    let envs = snapshot.envs.iter().cycle().take(envs).map(|env| SnapshotEnv { origin: [0.0; 3], ..env.clone() });
    Snapshot { envs: envs.collect(), ..snapshot.clone() }
}

/// With more bodies than trails, the image says so. A single shown environment has trails, even beyond the first 1024
/// bodies, and keeps them when it already has some.
#[test]
fn limit_of_trails() {
    let (mut sample, first) = stage(2);
    let view = OrbitCamera::default().view(400, 100);
    let written = |envs: usize| {
        let (snapshot, mut trails, mut canvas) = (many(&first, envs), Trails::default(), Canvas::new(400, 100));
        trails.add(&snapshot, EnvSelection::All);
        trails.draw(&snapshot, EnvSelection::All, &view, &mut canvas);
        let below = (86..96).flat_map(|y| (0..400).map(move |x| (x, y)));
        below.filter(|&(x, y)| canvas.pixel(x, y) == Some(color::TRAIL)).count()
    };
    let most = 1024 / first.names.bodies.len();
    assert_eq!(written(most), 0, "each has its own");
    assert!(written(most + 1) > 100, "some forty letters");

    let view = OrbitCamera { target: [0.0, 0.0, 0.5], distance: 3.0, ..OrbitCamera::default() }.view(200, 150);
    let mut moments = vec![first];
    for k in 0..10 {
        sample.put_cube([0.0, -0.5 + 0.1 * f64::from(k), 0.9]);
        moments.push(sample.snapshot());
    }
    let drawn = |envs: usize, kept: EnvSelection, shown: EnvSelection| {
        let mut trails = Trails::default();
        moments.iter().for_each(|moment| trails.add(&many(moment, envs), kept));
        let last = many(moments.last().unwrap(), envs);
        trails.add(&last, shown);
        let mut canvas = Canvas::new(200, 150);
        trails.draw(&last, shown, &view, &mut canvas);
        differing_pixels(&canvas, &Canvas::new(200, 150))
    };
    let far = 5000;
    let of_two = drawn(2, EnvSelection::All, EnvSelection::One(1));
    assert!(of_two > 20, "{of_two}: kept from when both were shown");
    let alone = drawn(far + 1, EnvSelection::One(far), EnvSelection::One(far));
    assert!(alone > 20 && alone == drawn(2, EnvSelection::One(0), EnvSelection::One(0)), "{alone}");
    assert_eq!(drawn(far + 1, EnvSelection::All, EnvSelection::One(far)), 0, "it had none: they begin now");
}

/// Without motion since the measurement, the panel draws the pixels that the sensor measures.
#[test]
fn panel() {
    let (sample, snapshot) = stage(2);
    assert_eq!(snapshot.names.cameras, ["eye"]);
    let camera = sample.sim.sensor(sample.camera).unwrap();
    let (mut panel, mut canvas) = (CameraPanel::new(1), Canvas::default());
    assert!(panel.draw(&snapshot, 0, 1, 64, &mut canvas));
    assert_eq!(canvas.dimensions(), [128, 96]);
    let (depth, mask, normal) = (camera.depth().unwrap(), camera.mask().unwrap(), camera.normal().unwrap());
    let finite = depth.index_axis(ndarray::Axis(0), 1).iter().copied().filter(|d| d.is_finite()).collect::<Vec<f32>>();
    let range = finite.iter().fold([f32::MAX, f32::MIN], |[low, high], d| [low.min(*d), high.max(*d)]);
    let color = camera.color().unwrap();
    let (mut seen, mut colors) = (BTreeSet::new(), BTreeSet::new());
    // Below the titles.
    for (v, u) in (15..48usize).flat_map(|v| (0..64usize).map(move |u| (v, u))) {
        // The color of a pixel at an edge or a shading boundary is the mean of four samples.
        let rgb = |v: usize, u: usize| [0, 1, 2].map(|k| color[(1, v, u, k)]);
        let around = [(v - 1, u), (v + 1, u), (v, u.saturating_sub(1)), (v, (u + 1).min(63)), (v, u)];
        let flat = around.iter().all(|&(near, beside)| {
            near < 48 && rgb(near, beside).iter().zip(rgb(v, u)).all(|(a, b)| a.abs_diff(b) < 3)
        });
        if flat {
            let seen = canvas.pixel(u, v).unwrap();
            assert!(seen.iter().zip(rgb(v, u)).all(|(a, b)| a.abs_diff(b) <= 1), "{seen:?}, not {:?}", rgb(v, u));
            colors.insert(seen);
        }
        for (x, y, color) in [
            (64 + u, v, depth_color(depth[(1, v, u)], range)),
            (u, 48 + v, mask_color(mask[(1, v, u)])),
            (64 + u, 48 + v, normal_color([0, 1, 2].map(|k| normal[(1, v, u, k)]))),
        ] {
            assert_eq!(canvas.pixel(x, y), Some(color), "pixel {x} {y}");
        }
        seen.insert(mask[(1, v, u)]);
    }
    assert!(seen.len() >= 2, "the cube and the ground: {seen:?}");
    assert!(colors.iter().any(|c| c[0] > 2 * c[1].max(c[2])), "the cube is red: {colors:?}");
    assert!(colors.len() > 3, "{colors:?}");
    for (what, [camera, env], width, expected) in [
        ("no such camera", [1, 0], 64, false),
        ("no such environment", [0, 9], 64, false),
        ("smallest", [0, 0], 0, true),
    ] {
        assert_eq!(panel.draw(&snapshot, camera, env, width, &mut canvas), expected, "{what}");
    }
}

/// The camera of the sample, with these channels.
fn like_eye(channels: Channels) -> CameraCfg {
    let placement = Placement::LookAt { eye: [0.6, 0.5, 0.8], target: [0.2, 0.0, 0.1], up: [0.0, 0.0, 1.0] };
    CameraCfg {
        width: 64,
        height: 48,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels,
        ..Default::default()
    }
}

/// The panel shows cameras of every kind as they are: a stereo camera, a ray-caster camera, and a camera with a fisheye
/// lens.
#[test]
fn panel_of_every_camera() {
    let mut sample = sample(1);
    let cfg = like_eye(Channels { mask: true, ..Channels::NONE });
    let pair = StereoCameraCfg { camera: cfg.clone(), left_to_right_pos: [0.2, 0.0, 0.0], ..Default::default() };
    let pair = sample.sim.add_sensor("pair", pair).unwrap();
    let intrinsics = Intrinsics::Pixels { fx: 25.0, fy: 25.0, cx: 32.0, cy: 24.0 };
    let lens = Equidistant { max_angle: 1.6 }.into();
    let fish = CameraCfg { renderer: Renderer::FastRayTraced, intrinsics, lens, ..cfg.clone() };
    let fish = sample.sim.add_sensor("fish", fish).unwrap();
    let CameraCfg { width, height, intrinsics, extrinsics, .. } = cfg;
    let rays = RayCasterCameraCfg { width, height, intrinsics, extrinsics, ..Default::default() };
    let rays = sample.sim.add_sensor("rays", rays).unwrap();
    sample.sim.update(100);
    let snapshot = sample.snapshot();
    assert_eq!(snapshot.names.cameras, ["eye", "fish", "pair/left", "pair/right", "rays"]);
    // Masks below the title: in the panel, and of the sensors.
    let places = || (15..48).flat_map(|v| (0..64).map(move |u| (v, u)));
    let (mut panel, mut canvas) = (CameraPanel::new(1), Canvas::default());
    let [fisheye, left, right, cast] = [1, 2, 3, 4].map(|camera: usize| {
        assert!(panel.draw(&snapshot, camera, 0, 64, &mut canvas));
        places().map(|(v, u)| canvas.pixel(u, 48 + v).unwrap()).collect::<Vec<_>>()
    });
    let own =
        |mask: ndarray::ArrayView3<'_, i32>| places().map(|(v, u)| mask_color(mask[(0, v, u)])).collect::<Vec<_>>();
    let sim = &sample.sim;
    assert!(fisheye == own(sim.sensor(fish).unwrap().mask().unwrap()));
    assert!(left == own(sim.sensor(pair).unwrap().left().mask().unwrap()));
    assert!(right == own(sim.sensor(pair).unwrap().right().mask().unwrap()));
    // Ray caster and rasterizer may differ where an edge passes through a pixel center.
    let differ = own(sim.sensor(rays).unwrap().mask()).iter().zip(&cast).filter(|(a, b)| a != b).count();
    assert!(differ < 20, "{differ} of {} pixels", cast.len());
    // Controls: the cameras have different images.
    assert!(left != right && fisheye != left);
    let colors: BTreeSet<_> = fisheye.iter().collect();
    assert!(colors.len() >= 2, "{colors:?}");
}

/// Markers of other sensors are in the color image of a camera that draws them, in the sensor and in the panel, and in
/// no other channel.
#[test]
fn panel_with_markers() {
    let mut sample = sample(1);
    let marked = CameraCfg { draw_markers: true, ..like_eye(Channels { color: true, ..Channels::NONE }) };
    sample.sim.add_sensor("marked", marked).unwrap();
    // Another camera above the cube shows its frame as a marker.
    let placement = Placement::LookAt { eye: [0.2, 0.1, 0.4], target: [0.0; 3], up: [0.0, 0.0, 1.0] };
    let other = CameraCfg { extrinsics: Extrinsics { placement, ..Default::default() }, ..CameraCfg::default() };
    let other = sample.sim.add_sensor("other", other).unwrap();
    sample.sim.scene_mut().set_debug_vis(other, true).unwrap();
    sample.sim.update(100);
    let snapshot = sample.snapshot();
    let [plain, marked] = [0, 1].map(|camera| {
        let mut canvas = Canvas::default();
        assert!(CameraPanel::new(1).draw(&snapshot, camera, 0, 64, &mut canvas));
        canvas
    });
    let differs = |x: [usize; 2], y: [usize; 2]| {
        let places = (y[0]..y[1]).flat_map(|v| (x[0]..x[1]).map(move |u| (u, v)));
        places.filter(|&(u, v)| plain.pixel(u, v) != marked.pixel(u, v)).count()
    };
    assert!(differs([0, 64], [0, 48]) > 5, "colors");
    assert_eq!([differs([64, 128], [0, 48]), differs([0, 128], [48, 96])], [0, 0], "depth, mask and normals");
}
