//! All environments in one picture, with markers.

use kinetoscope::prelude::*;
use kinetoscope::scene::{Marker, PoseF32};
use kinetoscope::sensors::camera::{Frame, ParallelRasterizer, RasterCfg, Rasterizer, look_at_pose};
use kinetoscope::sensors::visibility::View;
use kinetoscope::sim::staying_crew;

const SIZE: [usize; 2] = [400, 400];

/// A ball of 10 cm beside the middle of every environment, environments 3 m apart.
fn balls(num_envs: usize) -> SimulationManager {
    let cfg = SimulationManagerCfg { num_envs, arena_space: 3.0, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let ball = RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius: 0.1 },
        body_type: BodyType::Static,
        init_pose: Pose::translation(0.4, -0.2, 0.1),
        ..Default::default()
    };
    sim.add_rigid_object(ball).unwrap();
    sim
}

/// From 12 m above.
fn above() -> View {
    let pose = look_at_pose([0.0, 0.0, 12.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let world_from_camera = PoseF32::from(&pose);
    View {
        width: SIZE[0],
        height: SIZE[1],
        fx: 500.0,
        fy: 500.0,
        cx: 200.0,
        cy: 200.0,
        near: 0.1,
        far: 50.0,
        world_from_camera,
    }
}

/// Masks and positions seen from above.
fn from_above(still: &Still) -> (Vec<i32>, Vec<[f32; 3]>) {
    let mut frame = Frame::new(SIZE[0], SIZE[1], Channels { mask: true, position: true, ..Channels::default() });
    Rasterizer::default().render_shot(&still.shot(&above()), &mut frame.as_mut()).unwrap();
    (frame.mask.unwrap(), frame.position.unwrap().as_chunks().0.to_vec())
}

/// Middle of the pixels that `wanted` chooses within 0.5 m of `place`, and how many there are.
fn seen_near(masks: &[i32], positions: &[[f32; 3]], id: i32, place: [f64; 2]) -> (usize, [f64; 2]) {
    let near = |p: &[f32; 3]| (0..2).all(|k| (f64::from(p[k]) - place[k]).abs() < 0.5);
    let chosen: Vec<&[f32; 3]> =
        masks.iter().zip(positions).filter(|(mask, p)| **mask == id && near(p)).map(|(_, p)| p).collect();
    let mean = |k: usize| chosen.iter().map(|p| f64::from(p[k])).sum::<f64>() / chosen.len() as f64;
    (chosen.len(), [mean(0), mean(1)])
}

#[test]
fn environments_stand_at_their_origins_and_markers_in_them() {
    let mut sim = balls(5);
    let marker = Marker::sphere([-0.5, 0.3, 0.5], 0.1, [1.0, 0.0, 0.0, 1.0]);
    let all = Still::overview(&mut sim, None, &[(EnvId(2), marker)]).unwrap();
    let (masks, positions) = from_above(&all);
    let id = sim.mask_ids().iter().find(|id| id.object == "ball").unwrap().id;
    let origins = sim.env_origins();
    for env in 0..5 {
        let place = [origins[(env, 0)] + 0.4, origins[(env, 1)] - 0.2];
        let (count, middle) = seen_near(&masks, &positions, id, place);
        // A pixel is 24 mm wide down there: the ball is some 54 of them. The side that faces the camera is what is seen,
        // whose middle is off by less than a tenth of the radius at 25 degrees.
        assert!((35..75).contains(&count), "environment {env}: {count} pixels");
        assert!((0..2).all(|k| (middle[k] - place[k]).abs() < 0.03), "environment {env}: {middle:?}, not {place:?}");
    }
    assert_eq!(masks.iter().filter(|mask| **mask == id).count(), {
        let near = |env: usize| [origins[(env, 0)] + 0.4, origins[(env, 1)] - 0.2];
        (0..5).map(|env| seen_near(&masks, &positions, id, near(env)).0).sum::<usize>()
    });
    let place = [origins[(2, 0)] - 0.5, origins[(2, 1)] + 0.3];
    let (count, middle) = seen_near(&masks, &positions, Marker::MASK_ID, place);
    assert!(count > 35 && (0..2).all(|k| (middle[k] - place[k]).abs() < 0.03), "{count} pixels at {middle:?}");
    assert_eq!(masks.iter().filter(|mask| **mask == Marker::MASK_ID).count(), count, "only there");
    assert!(masks.iter().all(|mask| *mask != 0), "the ground is everywhere");
}

#[test]
fn some_environments_and_mistakes() {
    let mut sim = balls(4);
    let two = Still::overview(&mut sim, Some(&[EnvId(1), EnvId(3)]), &[]).unwrap();
    let id = sim.mask_ids().iter().find(|id| id.object == "ball").unwrap().id;
    let (masks, positions) = from_above(&two);
    let origins = sim.env_origins();
    for env in 0..4 {
        let place = [origins[(env, 0)] + 0.4, origins[(env, 1)] - 0.2];
        assert_eq!(seen_near(&masks, &positions, id, place).0 > 0, env % 2 == 1, "environment {env}");
    }
    assert!(Still::overview(&mut sim, Some(&[EnvId(4)]), &[]).is_err());
    let marker = Marker::sphere([0.0; 3], 0.1, [1.0; 4]);
    assert!(Still::overview(&mut sim, None, &[(EnvId(9), marker)]).is_err());
}

/// Threads that stay draw what a single one draws, picture after picture, and go on drawing after another crew was dropped.
#[test]
fn threads_that_stay_draw_the_same_pictures() {
    let mut sim = balls(5);
    let still = Still::overview(&mut sim, None, &[]).unwrap();
    let channels = Channels { depth: true, mask: true, position: true, ..Channels::default() };
    let draw = |rasterizer: &mut ParallelRasterizer| {
        let views = [0.0, 0.4, 0.8, 1.2].map(|shift| View { cx: 200.0 + 100.0 * shift, ..above() });
        let mut frames = [(); 4].map(|()| Frame::new(SIZE[0], SIZE[1], channels));
        let shots = views.iter().map(|view| still.shot(view)).zip(&mut frames);
        let mut jobs: Vec<_> = shots.map(|(shot, frame)| (shot, frame.as_mut())).collect();
        rasterizer.render(&mut jobs).unwrap();
        drop(jobs);
        frames
    };
    let alone = draw(&mut ParallelRasterizer::new(RasterCfg::default(), 1));
    let ball = sim.mask_ids().iter().find(|id| id.object == "ball").unwrap().id;
    assert!(alone.iter().all(|frame| frame.mask.as_ref().unwrap().contains(&ball)));
    let mut staying = ParallelRasterizer::new(RasterCfg::default(), 3).with_crew(staying_crew());
    assert_eq!(draw(&mut staying), alone);
    let mut other = ParallelRasterizer::new(RasterCfg::default(), 2).with_crew(staying_crew());
    assert_eq!(draw(&mut other), alone);
    drop(other);
    assert_eq!(draw(&mut staying), alone);
}
