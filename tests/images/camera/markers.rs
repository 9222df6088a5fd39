//! Debug markers of sensors in the color images of cameras with `draw_markers`.

use kinetoscope::prelude::*;
use kinetoscope::render::frame::Channels;
use kinetoscope::render::{RasterCfg, Renderer, Shutter};
use kinetoscope::scene::StateFields;
use kinetoscope::scene::{Marker, SceneState};
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::{Sensor, SensorCfg, SensorContext, SensorError};
use kinetoscope_testkit::worlds::{cfg, fixed, look_at, object};

const SIDE: usize = 64;
/// Focal length \[pixels\].
const FOCAL: f64 = 60.0;
/// Position of the camera \[m\]; it looks along -x.
const EYE: [f64; 3] = [2.0, 0.0, 1.0];
const RADIUS: f64 = 0.4;

/// A sensor with a marker: a red ball in environment 1 that rises by `rise` \[m\] per step.
#[derive(Clone, Copy, Debug)]
struct Ball {
    rise: f64,
    step: u64,
}

impl Ball {
    /// Center of the ball after `step` steps \[m\].
    fn at(self, step: u64) -> [f64; 3] {
        [0.0, 0.1, 1.05 + self.rise * step as f64]
    }
}

const STILL: Ball = Ball { rise: 0.0, step: 0 };
const RISING: Ball = Ball { rise: 0.03, step: 0 };

impl SensorCfg for Ball {
    type Sensor = Self;

    fn requires(&self) -> StateFields {
        StateFields::POSES
    }

    fn build(&self, _: &SensorContext) -> Result<Self, SensorError> {
        Ok(*self)
    }
}

impl Sensor for Ball {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.step = state.step[1];
        Ok(())
    }

    fn reset(&mut self, _: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.update(state)
    }

    fn refresh(&mut self, _: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.update(state)
    }

    fn markers(&self, env: usize, _: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let ball = Marker::sphere(self.at(self.step), RADIUS as f32, [0.9, 0.05, 0.05, 1.0]);
        (env == 1).then_some(ball).into_iter().collect()
    }
}

/// A camera without shadows, which would show beside the ball.
fn camera(renderer: Renderer, draw_markers: bool) -> CameraCfg {
    CameraCfg {
        width: SIDE,
        height: SIDE,
        intrinsics: Intrinsics::Pixels { fx: FOCAL, fy: FOCAL, cx: SIDE as f64 / 2.0, cy: SIDE as f64 / 2.0 },
        extrinsics: look_at(EYE, [0.0, 0.0, 1.0]),
        channels: Channels { color: true, depth: true, mask: true, normal: true, position: true, ..Channels::NONE },
        raster: RasterCfg { shadows: false, ..RasterCfg::default() },
        renderer,
        draw_markers,
        ..Default::default()
    }
}

/// Two environments with a box on the ground behind the ball.
fn world() -> SimulationManager {
    let mut sim = kinetoscope_testkit::worlds::sim(cfg(2, 2));
    sim.add_rigid_object(fixed(object("cube", ObjectShape::Box { size: [0.4, 0.4, 0.8] }, [-1.0, 0.3, 0.4]))).unwrap();
    sim
}

/// Distance of the ray through a pixel's center from the outline of the ball \[pixels\]; negative inside.
///
/// The ray's direction in the camera frame is ((u - cx) / f, (v - cy) / f, 1). It meets the ball if its angle to the
/// center is at most asin(r / d). The angular width of a pixel is at least 1 / f (1 + tan²), which is 0.78 / f in the
/// corners.
fn distance_to_outline(center: [f64; 3], u: usize, v: usize) -> f64 {
    let ray = [u, v].map(|k| (k as f64 + 0.5 - SIDE as f64 / 2.0) / FOCAL);
    let ray = nalgebra::Vector3::new(ray[0], ray[1], 1.0);
    // The camera looks along -x with z up: right in the image is +y, down is -z.
    let to = nalgebra::Vector3::new(center[1] - EYE[1], EYE[2] - center[2], EYE[0] - center[0]);
    (ray.angle(&to) - (RADIUS / to.norm()).asin()) * FOCAL / 0.78
}

/// RGB colors of environment `env`, in row-major order.
fn colors(sim: &SimulationManager, id: SensorId<Camera>, env: usize) -> Vec<[u8; 3]> {
    let camera = sim.sensor(id).unwrap();
    let color = camera.color().unwrap();
    (0..SIDE * SIDE).map(|k| [0, 1, 2].map(|c| color[(env, k / SIDE, k % SIDE, c)])).collect()
}

fn is_red([r, g, b]: [u8; 3]) -> bool {
    r > 60 && u32::from(r) > 2 * u32::from(g.max(b))
}

/// Asserts that all pixels inside the outline show the ball. Pixels outside must be unchanged, or not red if
/// `same_elsewhere` is false.
#[track_caller]
fn assert_covers(center: [f64; 3], with: &[[u8; 3]], without: &[[u8; 3]], same_elsewhere: bool) {
    let (mut inside, mut outside) = (0, 0);
    for k in 0..SIDE * SIDE {
        let beyond = distance_to_outline(center, k % SIDE, k / SIDE);
        if beyond < -1.0 {
            inside += 1;
            assert!(is_red(with[k]), "pixel {k}, {beyond} pixels inside, is {:?}", with[k]);
        } else if beyond > 1.0 {
            outside += 1;
            let same = if same_elsewhere { with[k] == without[k] } else { !is_red(with[k]) };
            assert!(same, "pixel {k}, {beyond} pixels outside, is {:?} instead of {:?}", with[k], without[k]);
        }
    }
    // A disc of 0.4 m at 2 m, with a focal length of 60 pixels, has a radius of about 12 pixels.
    assert!((300..600).contains(&inside) && outside > 3000, "{inside} inside, {outside} outside");
}

#[test]
fn every_renderer() {
    let few = Renderer::RayTraced { samples: 4, max_bounces: 1, denoise: false, seed: 0 };
    for renderer in [Renderer::Raster, Renderer::FastRayTraced, Renderer::Hybrid, few] {
        let exact = renderer != few;
        let (mut sim, mut bare) = (world(), world());
        let ball = sim.add_sensor("ball", STILL).unwrap();
        // The noise of the path tracer is keyed by the name of the camera.
        let [off, on] =
            [("off", false), ("on", true)].map(|(name, draw)| sim.add_sensor(name, camera(renderer, draw)).unwrap());
        let reference = bare.add_sensor("off", camera(renderer, false)).unwrap();
        for steps in [0, 1] {
            sim.update(steps);
            bare.update(steps);
            assert_covers(STILL.at(0), &colors(&sim, on, 1), &colors(&bare, reference, 1), exact);
            if exact {
                assert_eq!(colors(&sim, on, 0), colors(&bare, reference, 0), "the other environment");
            }
            let [on, off, bare] =
                [(&sim, on), (&sim, off), (&bare, reference)].map(|(sim, id)| sim.sensor(id).unwrap());
            assert_eq!(off.color().unwrap(), bare.color().unwrap(), "a camera that does not draw markers");
            for other in [on, off] {
                assert_eq!(other.depth().unwrap(), bare.depth().unwrap(), "{renderer:?}");
                assert_eq!(other.mask().unwrap(), bare.mask().unwrap(), "{renderer:?}");
                assert_eq!(other.normal().unwrap(), bare.normal().unwrap(), "{renderer:?}");
                assert_eq!(other.position().unwrap(), bare.position().unwrap(), "{renderer:?}");
            }
        }
        // Control: the sensor's debug switch removes the marker from the next image on.
        sim.scene_mut().set_debug_vis(ball, false).unwrap();
        assert!(colors(&sim, on, 1).iter().any(|pixel| is_red(*pixel)), "the captured image stays");
        sim.update(1);
        bare.update(1);
        if exact {
            assert_eq!(colors(&sim, on, 1), colors(&bare, reference, 1));
        }
        assert!(!colors(&sim, on, 1).iter().any(|pixel| is_red(*pixel)));
    }
}

/// The ball is shown at its position at the capture time, for lazy rendering and for delayed images.
#[test]
fn instant_of_the_image() {
    for (lazy, latency_steps, seen_at) in [(true, 0, 10), (false, 0, 10), (true, 4, 10), (false, 4, 10), (true, 8, 5)] {
        let mut sim = world();
        sim.add_sensor("ball", RISING).unwrap();
        let [on, off] = [true, false].map(|draw| {
            let base = camera(Renderer::Raster, draw);
            let cfg = CameraCfg { update_period: 0.05, lazy, latency_steps, history_length: 2, ..base };
            sim.add_sensor(format!("{draw}"), cfg).unwrap()
        });
        assert_eq!(sim.cfg().physics_dt, 0.01);
        sim.update(14);
        assert_covers(RISING.at(seen_at), &colors(&sim, on, 1), &colors(&sim, off, 1), true);
        // A write to the state refreshes the image and its markers at once.
        sim.reset(None).unwrap();
        assert_covers(RISING.at(0), &colors(&sim, on, 1), &colors(&sim, off, 1), true);
    }
}

/// Images with exposure time and rolling shutter show markers too; the markers do not move within an exposure.
#[test]
fn shutter() {
    let mut sim = world();
    sim.add_sensor("ball", RISING).unwrap();
    let renderer = Renderer::RayTraced { samples: 2, max_bounces: 0, denoise: false, seed: 0 };
    let shutter = Shutter { row_time: 0.0005, exposure_time: 0.01 };
    let [on, off] = [true, false].map(|draw| {
        let cfg = CameraCfg { shutter, update_period: 0.1, ..camera(renderer, draw) };
        sim.add_sensor(format!("{draw}"), cfg).unwrap()
    });
    sim.update(10);
    assert_covers(RISING.at(10), &colors(&sim, on, 1), &colors(&sim, off, 1), false);
    assert_eq!(sim.sensor(on).unwrap().depth().unwrap(), sim.sensor(off).unwrap().depth().unwrap());
}

/// Closer objects occlude markers. A camera does not draw its own marker, whose frustum would cover the image.
#[test]
fn hidden_and_own() {
    let mut sim = world();
    sim.add_sensor("ball", STILL).unwrap();
    sim.add_rigid_object(fixed(object("wall", ObjectShape::Box { size: [0.02, 4.0, 4.0] }, [0.8, 0.0, 1.0]))).unwrap();
    let cfg = |draw_markers| CameraCfg { debug_vis: true, ..camera(Renderer::Raster, draw_markers) };
    let off = sim.add_sensor("off", cfg(false)).unwrap();
    sim.scene_mut().set_debug_vis(off, false).unwrap();
    let on = sim.add_sensor("on", cfg(true)).unwrap();
    assert_eq!(colors(&sim, on, 1), colors(&sim, off, 1));
    // Control: markers of another camera are visible.
    let extrinsics = look_at([1.5, 0.3, 1.0], [0.8, 0.3, 1.2]);
    sim.add_sensor("other", CameraCfg { extrinsics, ..cfg(false) }).unwrap();
    sim.update(1);
    assert_ne!(colors(&sim, on, 1), colors(&sim, off, 1));
}
