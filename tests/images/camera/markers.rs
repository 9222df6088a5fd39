//! What sensors show, in the colours of cameras that draw it.

use kinetoscope::prelude::*;
use kinetoscope::scene::{Marker, SceneState};
use kinetoscope::sensors::camera::{Channels, RasterCfg, Renderer, Shutter};
use kinetoscope::sensors::{Requires, Sensor, SensorCfg, SensorContext, SensorError};

const SIDE: usize = 64;
/// Focal length \[pixels\].
const FOCAL: f64 = 60.0;
/// Where the camera is \[m\]; it looks along -x.
const EYE: [f64; 3] = [2.0, 0.0, 1.0];
const RADIUS: f64 = 0.4;

/// Shows a red ball in one environment, `place` away from the origin: from step to step it rises by `rise` \[m\].
#[derive(Clone, Copy, Debug)]
struct Ball {
    env: usize,
    place: [f64; 3],
    rise: f64,
    step: u64,
}

const STILL: Ball = Ball { env: 1, place: [0.0, 0.1, 1.05], rise: 0.0, step: 0 };

impl SensorCfg for Ball {
    type Sensor = Self;

    fn requires(&self) -> Requires {
        Requires::POSES
    }

    fn build(&self, _: &SensorContext) -> Result<Self, SensorError> {
        Ok(*self)
    }
}

impl Sensor for Ball {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.step = state.step[self.env];
        Ok(())
    }

    fn reset(&mut self, _: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.update(state)
    }

    fn refresh(&mut self, _: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.update(state)
    }

    fn markers(&self, env: usize, _: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let [x, y, z] = self.place;
        let ball = Marker::sphere([x, y, z + self.rise * self.step as f64], RADIUS as f32, [0.9, 0.05, 0.05, 1.0]);
        (env == self.env).then_some(ball).into_iter().collect()
    }
}

/// A camera without shadows: those of a ball are beside it.
fn camera(renderer: Renderer, draw_markers: bool) -> CameraCfg {
    CameraCfg {
        width: SIDE,
        height: SIDE,
        intrinsics: Intrinsics::Pixels { fx: FOCAL, fy: FOCAL, cx: SIDE as f64 / 2.0, cy: SIDE as f64 / 2.0 },
        extrinsics: Extrinsics {
            placement: Placement::LookAt { eye: EYE, target: [0.0, 0.0, 1.0], up: [0.0, 0.0, 1.0] },
            ..Default::default()
        },
        channels: Channels { color: true, depth: true, mask: true, normal: true, position: true, ..Channels::NONE },
        raster: RasterCfg { shadows: false, ..RasterCfg::default() },
        renderer,
        draw_markers,
        ..Default::default()
    }
}

/// Two environments with a cube on the ground behind where the ball is.
fn world() -> SimulationManager {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let cube = RigidObjectCfg {
        uid: "cube".into(),
        body_type: BodyType::Static,
        shape: ObjectShape::Box { size: [0.4, 0.4, 0.8] },
        init_pose: Pose::translation(-1.0, 0.3, 0.4),
        ..Default::default()
    };
    sim.add_rigid_object(cube).unwrap();
    sim
}

/// By how many pixels the ray of a pixel's centre passes the edge of the ball; negative inside. The ray's direction in the camera
/// is ((u - cx) / f, (v - cy) / f, 1), and it meets the ball where its angle to the centre is at most asin(r / d). A pixel is
/// at least 1 / f (1 + tan²) wide as an angle, which is 0.78 / f in the corners.
fn beyond_the_edge(center: [f64; 3], u: usize, v: usize) -> f64 {
    let ray = [u, v].map(|k| (k as f64 + 0.5 - SIDE as f64 / 2.0) / FOCAL);
    let ray = nalgebra::Vector3::new(ray[0], ray[1], 1.0);
    // Looking along -x with z up: right in the picture is +y, down is -z.
    let to = nalgebra::Vector3::new(center[1] - EYE[1], EYE[2] - center[2], EYE[0] - center[0]);
    (ray.angle(&to) - (RADIUS / to.norm()).asin()) * FOCAL / 0.78
}

/// Colours of environment `env`: row after row, red, green, blue.
fn colors(sim: &SimulationManager, id: SensorId<Camera>, env: usize) -> Vec<[u8; 3]> {
    let camera = sim.sensor(id).unwrap();
    let color = camera.color().unwrap();
    (0..SIDE * SIDE).map(|k| [0, 1, 2].map(|c| color[(env, k / SIDE, k % SIDE, c)])).collect()
}

fn is_red([r, g, b]: [u8; 3]) -> bool {
    r > 60 && u32::from(r) > 2 * u32::from(g.max(b))
}

/// Inside of the edge every pixel is the ball's, beyond it every pixel is what it was.
#[track_caller]
fn covers(center: [f64; 3], with: &[[u8; 3]], without: &[[u8; 3]], same_elsewhere: bool) {
    let (mut inside, mut outside) = (0, 0);
    for k in 0..SIDE * SIDE {
        let beyond = beyond_the_edge(center, k % SIDE, k / SIDE);
        if beyond < -1.0 {
            inside += 1;
            assert!(is_red(with[k]), "pixel {k}, {beyond} pixels inside, is {:?}", with[k]);
        } else if beyond > 1.0 {
            outside += 1;
            let same = if same_elsewhere { with[k] == without[k] } else { !is_red(with[k]) };
            assert!(same, "pixel {k}, {beyond} pixels outside, is {:?} instead of {:?}", with[k], without[k]);
        }
    }
    // A disc of 0.4 m at 2 m through 60 pixels has a radius of about 12.
    assert!((300..600).contains(&inside) && outside > 3000, "{inside} inside, {outside} outside");
}

#[test]
fn a_ball_covers_its_disc_with_every_renderer_and_only_in_colours() {
    let few = Renderer::RayTraced { samples: 4, max_bounces: 1, denoise: false, seed: 0 };
    for renderer in [Renderer::Raster, Renderer::FastRayTraced, Renderer::Hybrid, few] {
        let mut sim = world();
        sim.add_sensor("ball", STILL).unwrap();
        let off = sim.add_sensor("off", camera(renderer, false)).unwrap();
        let on = sim.add_sensor("on", camera(renderer, true)).unwrap();
        let mut bare = world();
        let reference = bare.add_sensor("off", camera(renderer, false)).unwrap();
        for steps in [0, 1] {
            sim.update(steps);
            bare.update(steps);
            let exact = renderer != few;
            covers(STILL.place, &colors(&sim, on, 1), &colors(&bare, reference, 1), exact);
            if exact {
                assert_eq!(colors(&sim, on, 0), colors(&bare, reference, 0), "the other environment");
            }
            let [on, off, bare] =
                [(&sim, on), (&sim, off), (&bare, reference)].map(|(sim, id)| sim.sensor(id).unwrap());
            assert_eq!(off.color().unwrap(), bare.color().unwrap(), "who does not ask for it draws nothing of it");
            for other in [on, off] {
                assert_eq!(other.depth().unwrap(), bare.depth().unwrap(), "{renderer:?}");
                assert_eq!(other.mask().unwrap(), bare.mask().unwrap(), "{renderer:?}");
                assert_eq!(other.normal().unwrap(), bare.normal().unwrap(), "{renderer:?}");
                assert_eq!(other.position().unwrap(), bare.position().unwrap(), "{renderer:?}");
            }
        }
        // The control: the switch of the sensor, from the next picture on.
        let ball = sim.sensor_ids::<Ball>()[0].1;
        sim.set_debug_vis(ball, false).unwrap();
        assert!(colors(&sim, on, 1).iter().any(|pixel| is_red(*pixel)), "what was captured is there still");
        sim.update(1);
        bare.update(1);
        if renderer != few {
            assert_eq!(colors(&sim, on, 1), colors(&bare, reference, 1));
        }
        assert!(!colors(&sim, on, 1).iter().any(|pixel| is_red(*pixel)));
    }
}

/// However late a picture is read, and however late it arrives: the ball is where it was at its instant.
#[test]
fn markers_are_those_of_the_instant_of_the_picture() {
    let rising = Ball { rise: 0.03, ..STILL };
    for (lazy, latency_steps, seen_at) in [(true, 0, 10), (false, 0, 10), (true, 4, 10), (false, 4, 10), (true, 8, 5)] {
        let mut sim = world();
        sim.add_sensor("ball", rising).unwrap();
        let slow = |renderer, draw_markers| CameraCfg {
            update_period: 0.05,
            lazy,
            latency_steps,
            history_length: 2,
            ..camera(renderer, draw_markers)
        };
        let on = sim.add_sensor("on", slow(Renderer::Raster, true)).unwrap();
        let off = sim.add_sensor("off", slow(Renderer::Raster, false)).unwrap();
        assert_eq!(sim.cfg().physics_dt, 0.01);
        sim.update(14);
        let [x, y, z] = STILL.place;
        let at = |step: u32| [x, y, z + 0.03 * f64::from(step)];
        covers(at(seen_at), &colors(&sim, on, 1), &colors(&sim, off, 1), true);
        // A write to the state is seen at once, and so is what is shown of it.
        sim.reset(None).unwrap();
        covers(at(0), &colors(&sim, on, 1), &colors(&sim, off, 1), true);
    }
}

/// A shutter that takes time sees markers, too, which stand still.
#[test]
fn markers_stand_still_while_the_shutter_is_open() {
    let mut sim = world();
    sim.add_sensor("ball", Ball { rise: 0.03, ..STILL }).unwrap();
    let renderer = Renderer::RayTraced { samples: 2, max_bounces: 0, denoise: false, seed: 0 };
    let shutter = Shutter { row_time: 0.0005, exposure_time: 0.01 };
    let cfg = CameraCfg { shutter, update_period: 0.1, ..camera(renderer, true) };
    let on = sim.add_sensor("on", cfg.clone()).unwrap();
    let off = sim.add_sensor("off", CameraCfg { draw_markers: false, ..cfg }).unwrap();
    sim.update(10);
    let [x, y, z] = STILL.place;
    covers([x, y, z + 0.3], &colors(&sim, on, 1), &colors(&sim, off, 1), false);
    assert_eq!(sim.sensor(on).unwrap().depth().unwrap(), sim.sensor(off).unwrap().depth().unwrap());
}

/// Things that are nearer hide markers, and a camera does not draw its own: its frame would be all it sees.
#[test]
fn what_is_nearer_hides_markers_and_nobody_sees_its_own() {
    let mut sim = world();
    sim.add_sensor("ball", STILL).unwrap();
    let wall = RigidObjectCfg {
        uid: "wall".into(),
        body_type: BodyType::Static,
        shape: ObjectShape::Box { size: [0.02, 4.0, 4.0] },
        init_pose: Pose::translation(0.8, 0.0, 1.0),
        ..Default::default()
    };
    sim.add_rigid_object(wall).unwrap();
    let cfg = |draw_markers| CameraCfg { debug_vis: true, ..camera(Renderer::Raster, draw_markers) };
    let off = sim.add_sensor("off", cfg(false)).unwrap();
    sim.set_debug_vis(off, false).unwrap();
    let on = sim.add_sensor("on", cfg(true)).unwrap();
    assert_eq!(colors(&sim, on, 1), colors(&sim, off, 1));
    // The control: what another camera shows is seen.
    let beside = Placement::LookAt { eye: [1.5, 0.3, 1.0], target: [0.8, 0.3, 1.2], up: [0.0, 0.0, 1.0] };
    let other = CameraCfg { extrinsics: Extrinsics { placement: beside, ..Default::default() }, ..cfg(false) };
    sim.add_sensor("other", other).unwrap();
    sim.update(1);
    assert_ne!(colors(&sim, on, 1), colors(&sim, off, 1));
}
