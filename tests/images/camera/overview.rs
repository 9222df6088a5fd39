//! All environments in one image, with markers.

use kinetoscope::exec::ThreadPool;
use kinetoscope::prelude::*;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::render::{ImageRenderer, ParallelRenderer, RasterCfg};
use kinetoscope::scene::{Marker, PoseF32};
use kinetoscope::sensors::camera::look_at_pose;
use kinetoscope::sim::OffscreenScene;
use kinetoscope_testkit::worlds::{cfg, fixed, mask_id, object};

const SIZE: [usize; 2] = [400, 400];

/// A ball of 10 cm next to the center of every environment; the environments are 3 m apart.
fn balls(num_envs: usize) -> SimulationManager {
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg { arena_space: 3.0, ..cfg(num_envs, 2) });
    sim.add_rigid_object(fixed(object("ball", ObjectShape::Sphere { radius: 0.1 }, [0.4, -0.2, 0.1]))).unwrap();
    sim
}

/// A view from 12 m above.
fn above() -> View {
    let pose = look_at_pose([0.0, 0.0, 12.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let (world_from_camera, [width, height]) = (PoseF32::from(&pose), SIZE);
    View {
        parallel: false,
        width,
        height,
        fx: 500.0,
        fy: 500.0,
        cx: 200.0,
        cy: 200.0,
        near: 0.1,
        far: 50.0,
        world_from_camera,
    }
}

/// Mask and position image from above.
struct TopView(Vec<i32>, Vec<[f32; 3]>);

impl TopView {
    fn of(still: &OffscreenScene) -> Self {
        let mut frame = Frame::new(SIZE[0], SIZE[1], Channels { mask: true, position: true, ..Channels::default() });
        ImageRenderer::default().render_request(&still.render_request(&above()), &mut frame.as_mut()).unwrap();
        Self(frame.mask.unwrap(), frame.position.unwrap().as_chunks().0.to_vec())
    }

    /// Number of pixels of an object within 0.5 m of `place` \[m\]; asserts that their mean position is within 3 cm of
    /// it.
    fn near(&self, id: i32, place: [f64; 2]) -> usize {
        let near = |p: &[f32; 3]| (0..2).all(|k| (f64::from(p[k]) - place[k]).abs() < 0.5);
        let chosen: Vec<_> = self.0.iter().zip(&self.1).filter(|(mask, p)| **mask == id && near(p)).collect();
        let middle = [0, 1].map(|k| chosen.iter().map(|(_, p)| f64::from(p[k])).sum::<f64>() / chosen.len() as f64);
        let off = (0..2).any(|k| (middle[k] - place[k]).abs() >= 0.03);
        assert!(!off, "{} pixels at {middle:?}, not {place:?}", chosen.len());
        chosen.len()
    }
}

#[test]
fn environments_and_markers() {
    let mut sim = balls(5);
    let marker = Marker::sphere([-0.5, 0.3, 0.5], 0.1, [1.0, 0.0, 0.0, 1.0]);
    let seen = TopView::of(&OffscreenScene::overview(&mut sim, None, &[(EnvId(2), marker)]).unwrap());
    let (id, origins) = (mask_id(&sim, "ball"), sim.cfg().env_origins());
    let mut of_balls = 0;
    for env in 0..5 {
        let count = seen.near(id, [origins[(env, 0)] + 0.4, origins[(env, 1)] - 0.2]);
        // A pixel is 24 mm wide at this distance, so the ball covers about 54 pixels. Only the side that faces the
        // camera is visible; its mean is off by less than a tenth of the radius at 25 degrees.
        assert!((35..75).contains(&count), "environment {env}: {count} pixels");
        of_balls += count;
    }
    let total = |id: i32| seen.0.iter().filter(|mask| **mask == id).count();
    assert_eq!(total(id), of_balls);
    let count = seen.near(Marker::MASK_ID, [origins[(2, 0)] - 0.5, origins[(2, 1)] + 0.3]);
    assert!(count > 35, "{count} pixels");
    assert_eq!(total(Marker::MASK_ID), count, "only there");
    assert_eq!(total(0), 0, "the ground is everywhere");
}

/// Lights and cameras of an MJCF file are at their places in environment 0, where its bodies are.
///
/// Regression: they were at their places without the origin of the environment.
#[test]
fn lights_and_cameras() {
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg { arena_space: 3.0, ..cfg(4, 1) });
    let file = "<mujoco><worldbody><light name='spot' pos='0.3 0.2 2'/><camera name='eye' pos='0.1 -0.2 1'/>\
                <body pos='0.1 0.2 1'><freejoint/><geom size='0.1'/></body></worldbody></mujoco>";
    sim.add_mjcf(MjcfPartCfg::text("part", file)).unwrap();
    let origin = [0, 1].map(|k| sim.cfg().env_origins()[(0, k)]);
    assert!(origin.iter().all(|x| *x != 0.0), "the control: {origin:?}");
    let seen = OffscreenScene::overview(&mut sim, None, &[]).unwrap();
    let camera = seen.camera("part/eye").unwrap().world_from_camera.translation;
    let view = above();
    let lights = seen.render_request(&view).lights.unwrap();
    let spot = lights.iter().find(|light| light.position[2] == 2.0).unwrap();
    for (k, [of_camera, of_light]) in [(0, [0.1, 0.3]), (1, [-0.2, 0.2])] {
        assert!((camera.vector[k] - origin[k] - of_camera).abs() < 1e-12, "{camera}");
        assert!((f64::from(spot.position[k]) - origin[k] - of_light).abs() < 1e-6, "{spot:?}");
    }
}

#[test]
fn selection_and_refusals() {
    let mut sim = balls(4);
    let two = TopView::of(&OffscreenScene::overview(&mut sim, Some(&[EnvId(1), EnvId(3)]), &[]).unwrap());
    let (id, origins) = (mask_id(&sim, "ball"), sim.cfg().env_origins());
    for env in 0..4 {
        let place = [origins[(env, 0)] + 0.4, origins[(env, 1)] - 0.2];
        assert_eq!(two.near(id, place) > 0, env % 2 == 1, "environment {env}");
    }
    assert!(OffscreenScene::overview(&mut sim, Some(&[EnvId(4)]), &[]).is_err());
    let marker = Marker::sphere([0.0; 3], 0.1, [1.0; 4]);
    assert!(OffscreenScene::overview(&mut sim, None, &[(EnvId(9), marker)]).is_err());
}

/// Persistent worker threads render the same images as a single thread, and continue after another pool was dropped.
#[test]
fn persistent_threads() {
    let mut sim = balls(5);
    let still = OffscreenScene::overview(&mut sim, None, &[]).unwrap();
    let channels = Channels { depth: true, mask: true, position: true, ..Channels::default() };
    let draw = |rasterizer: &mut ParallelRenderer| {
        let views = [0.0, 0.4, 0.8, 1.2].map(|shift| View { cx: 200.0 + 100.0 * shift, ..above() });
        let mut frames = [(); 4].map(|()| Frame::new(SIZE[0], SIZE[1], channels));
        let requests = views.iter().map(|view| still.render_request(view)).zip(&mut frames);
        let mut jobs: Vec<_> = requests.map(|(request, frame)| (request, frame.as_mut())).collect();
        rasterizer.render(&mut jobs).unwrap();
        drop(jobs);
        frames
    };
    let alone = draw(&mut ParallelRenderer::new(RasterCfg::default(), 1));
    let ball = mask_id(&sim, "ball");
    assert!(alone.iter().all(|frame| frame.mask.as_ref().unwrap().contains(&ball)));
    let mut staying = ParallelRenderer::new(RasterCfg::default(), 3).with_pool(ThreadPool::new());
    assert_eq!(draw(&mut staying), alone);
    let mut other = ParallelRenderer::new(RasterCfg::default(), 2).with_pool(ThreadPool::new());
    assert_eq!(draw(&mut other), alone);
    drop(other);
    assert_eq!(draw(&mut staying), alone);
}
