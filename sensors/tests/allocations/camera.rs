//! Cameras allocate nothing after the first pictures, whatever goes wrong with them.

use ndarray::Array2;
use scene::shape::{Plane, Sphere};
use scene::{Instance, Light, Material, PoseF32, RenderScene, SceneState, VisibleState};
use sensors::camera::channel::{Color, Depth};
use sensors::camera::imperfection::{DepthNoise, Exposure, Holes, ReadNoise, ShotNoise, Vignetting};
use sensors::camera::{Channels, Extrinsics, Imperfections, Placement};
use sensors::{CameraCfg, NoiseCfg, Sensor, SensorCfg, SensorContext};
use std::sync::Arc;

fn state(step: u64) -> SceneState {
    let mut instance_poses = Array2::from_elem((2, 2), PoseF32::IDENTITY);
    for env in 0..2 {
        instance_poses[(env, 1)] = PoseF32::from_translation([0.01 * step as f32, 0.0, 0.5]);
    }
    let lights = Array2::from_elem((2, 1), Light::default());
    SceneState {
        step: vec![step; 2],
        time: vec![0.01 * step as f64; 2],
        visible: Some(VisibleState { instance_poses, lights }),
        ..SceneState::new(2)
    }
}

#[test]
fn pictures_allocate_nothing() {
    let instances = vec![
        Instance::new(Plane::INFINITE, Material::default(), 1),
        Instance::new(Sphere { radius: 0.3 }, Material::default(), 2),
    ];
    let scene = Some(Arc::new(RenderScene::new(instances).expect("a good scene")));
    let context = SensorContext { num_envs: 2, dt: 0.01, scene, threads: 1, ..SensorContext::default() };
    let placement = Placement::LookAt { eye: [-1.6, 0.0, 0.9], target: [0.0, 0.0, 0.5], up: [0.0, 0.0, 1.0] };
    let perfect = CameraCfg {
        width: 64,
        height: 48,
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { flow: false, ..Channels::ALL },
        ..CameraCfg::default()
    };
    let noise = NoiseCfg { std: 0.1, bias_std: 0.1, bias_walk: 0.1, resolution: 0.01 };
    let troubled = CameraCfg {
        update_period: 0.02,
        history_length: 3,
        latency_steps: 5,
        dropout: 0.2,
        noise: ["color", "depth", "distance"].map(|name| (name.to_string(), noise)).into(),
        imperfections: Imperfections {
            vignetting: Some(Vignetting::default()),
            exposure: Some(Exposure::default()),
            shot_noise: Some(ShotNoise::default()),
            read_noise: Some(ReadNoise::default()),
            holes: Some(Holes::default()),
            depth_noise: Some(DepthNoise::default()),
        },
        ..perfect.clone()
    };
    let states: Vec<SceneState> = (0..=60).map(state).collect();
    for (cfg, pictures) in [(perfect, 60), (troubled, 15)] {
        for lazy in [true, false] {
            let mut camera = CameraCfg { lazy, ..cfg.clone() }.build(&context).expect("a good configuration");
            camera.reset(&[0, 1], &states[0]).expect("a good state");
            let mut steps = |range: std::ops::RangeInclusive<usize>| {
                for step in range {
                    camera.update(&states[step]).expect("a good state");
                    camera.due_in(&states[step].step);
                    if step % 3 == 0 {
                        camera.channel::<Color>().expect("a good picture");
                        camera.history::<Depth>().expect("good pictures");
                    }
                }
            };
            steps(1..=20);
            let count = allocation_counter::measure(|| steps(21..=60)).count_total;
            assert_eq!(count, 0, "{camera:?}, lazy {lazy}");
            assert!(camera.frame_counts()[0] >= pictures, "the control: {}", camera.frame_counts());
        }
    }
    let control = allocation_counter::measure(|| drop(vec![0u8; 100])).count_total;
    assert_eq!(control, 1, "the control: the counter counts");
}
