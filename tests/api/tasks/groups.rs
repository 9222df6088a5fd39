//! Observation groups, single precision, and images.

use super::bundled::{cart_task, cfg, idle, world};
use kinetoscope::ndarray::{Array2, Array4, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sim::Shard;
use kinetoscope::tasks::{
    AutoresetMode, Env, EnvBuilder, EnvCfg, EnvError, ImageBatch, ImageElement, ImageSpace, ImageTerm, Noise,
    ObservationTerm, POLICY_GROUP, terms,
};
use kinetoscope_testkit::bits::bits;
use kinetoscope_testkit::worlds::camera;

fn steps_done(name: &str) -> ObservationTerm {
    ObservationTerm::new(name, ["k"], |now| {
        Ok(Array2::from_shape_fn((now.num_envs(), 1), |(env, _)| now.episode_steps()[env] as f64))
    })
}

/// A task with a noisy policy group, and with a group without noise if `critic` is true.
fn task(critic: bool, autoreset: AutoresetMode) -> Env {
    let (sim, _) = world(cfg(3, 1), false);
    let builder = EnvBuilder::new(sim, EnvCfg { episode_steps: Some(2), autoreset, ..EnvCfg::default() })
        .action(idle())
        .observation(steps_done("steps").with_noise(Noise::Normal { std: 0.1 }));
    let builder = match critic {
        true => builder
            .observation_in("critic", steps_done("steps").scaled(2.0))
            .observation_in("critic", steps_done("noisy").with_noise(Noise::Uniform { low: 0.0, high: 1.0 })),
        false => builder,
    };
    builder.build().unwrap()
}

#[test]
fn groups() {
    for mode in AutoresetMode::ALL {
        let (mut with, mut without) = (task(true, mode), task(false, mode));
        let names: Vec<&str> = with.groups().map(|group| group.name()).collect();
        assert_eq!(names, [POLICY_GROUP, "critic"]);
        assert_eq!(with.group("critic").unwrap().space().names(), ["steps/k", "noisy/k"]);
        assert_eq!(with.observation_space(), with.group(POLICY_GROUP).unwrap().space());
        let (a, b) = (with.reset(None, Some(1)).unwrap(), without.reset(None, Some(1)).unwrap());
        assert_eq!(bits(&a), bits(&b), "the critic does not change the noise of the policy");
        let actions = Array2::zeros((3, 1));
        for k in 1..=2 {
            let (a, b) = (with.step(&actions).unwrap(), without.step(&actions).unwrap());
            assert_eq!(bits(&a.observations), bits(&b.observations));
            let (policy, critic) = (with.group(POLICY_GROUP).unwrap(), with.group("critic").unwrap());
            assert_eq!(bits(policy.observations()), bits(&a.observations));
            assert_eq!(bits(policy.final_observations()), bits(&a.final_observations));
            // The episode ends after two steps. The observation of the new one is 0, the final one of the old one 4.
            let seen = if k == 2 && mode == AutoresetMode::SameStep { 0.0 } else { 2.0 * f64::from(k) };
            assert_eq!(critic.observations().column(0), array![seen, seen, seen], "{mode}, step {k}");
            assert_eq!(critic.final_observations().column(0), array![2.0, 2.0, 2.0] * f64::from(k));
            let noise = critic.final_observations().column(1).to_owned() - f64::from(k);
            assert!(noise.iter().all(|noise| (0.0..1.0).contains(noise)) && noise[0] != noise[1], "{noise}");
        }
        // Single precision is the rounded number.
        let critic = with.group("critic").unwrap();
        let narrow = critic.observations_f32().unwrap();
        assert!(narrow.iter().zip(critic.observations()).all(|(narrow, wide)| *narrow == *wide as f32));
        let narrow = critic.final_observations_f32().unwrap();
        assert!(narrow.iter().zip(critic.final_observations()).all(|(narrow, wide)| *narrow == *wide as f32));
    }
    let Err(EnvError::UnknownName { candidates, .. }) = task(true, AutoresetMode::SameStep).group("critik").map(drop)
    else {
        panic!("there is no such group")
    };
    assert_eq!(candidates[0], "critic");
}

#[test]
fn single_precision_overflows() {
    let (sim, _) = world(cfg(2, 1), false);
    let large = ObservationTerm::new("large", ["x"], |now| Ok(Array2::from_elem((now.num_envs(), 1), 1e39)));
    let mut env = EnvBuilder::new(sim, EnvCfg::default()).action(idle()).observation(large).build().unwrap();
    env.reset(None, None).unwrap();
    let error = env.group(POLICY_GROUP).unwrap().observations_f32().unwrap_err();
    assert!(matches!(&error, EnvError::NotFinite { env: 0, column, .. } if column == "large/x"), "{error}");
}

/// A cart that moves in front of a camera, observed by images and by its position.
fn filmed(settings: SimulationManagerCfg, autoreset: AutoresetMode) -> (Env, SensorId<Camera>) {
    let (mut sim, robot) = world(settings, false);
    let channels = Channels::from_names(&["color", "depth", "mask"]).unwrap();
    let camera = sim.add_sensor("camera", camera([32, 24], [0.0, -1.5, 1.0], [0.0, 0.0, 1.0], channels)).unwrap();
    let images = [
        terms::camera_rgb(&sim, "color", camera).unwrap(),
        terms::camera_depth(&sim, "depth", camera, [0.5, 3.0]).unwrap(),
        terms::camera_mask(&sim, "mask", camera).unwrap(),
    ];
    let cfg = EnvCfg { decimation: 20, episode_steps: Some(4), autoreset };
    let task = cart_task(sim, robot, cfg);
    (images.into_iter().fold(task, EnvBuilder::image).build().unwrap(), camera)
}

fn u8s(batch: &ImageBatch) -> &Array4<u8> {
    let ImageBatch::U8(array) = batch else { panic!("{:?}", batch.element()) };
    array
}

fn f32s(batch: &ImageBatch) -> &Array4<f32> {
    let ImageBatch::F32(array) = batch else { panic!("{:?}", batch.element()) };
    array
}

/// Images of the terms are those of the camera; images of an ended episode are those of its last state.
#[test]
fn images() {
    for mode in [AutoresetMode::SameStep, AutoresetMode::NextStep] {
        let (mut env, camera) = filmed(cfg(2, 2), mode);
        env.reset(None, Some(1)).unwrap();
        let spaces: Vec<(&str, ImageSpace)> = env.group(POLICY_GROUP).unwrap().image_spaces().collect();
        assert_eq!(spaces.iter().map(|(name, _)| *name).collect::<Vec<_>>(), ["color", "depth", "mask"]);
        let rgb = ImageSpace { height: 24, width: 32, components: 3, element: ImageElement::U8, bounds: [0.0, 255.0] };
        assert_eq!(spaces[0].1, rgb);
        let first = env.group(POLICY_GROUP).unwrap().image("depth").unwrap().clone();
        let forces = array![[2.5], [-2.5]];
        for k in 1..=4 {
            let before = env.group(POLICY_GROUP).unwrap().image("color").unwrap().clone();
            env.step(&forces).unwrap();
            let seen = env.group(POLICY_GROUP).unwrap();
            let sensor = env.sim().sensor(camera).unwrap();
            let [color, depth, mask] = ["color", "depth", "mask"].map(|name| seen.image(name).unwrap());
            let own = sensor.color().unwrap();
            assert!(u8s(color).indexed_iter().all(|((e, v, u, c), value)| own[(e, v, u, c)] == *value));
            let own = sensor.depth().unwrap();
            let clipped = |depth: f32| depth.clamp(0.5, 3.0);
            assert!(f32s(depth).indexed_iter().all(|((e, v, u, _), value)| clipped(own[(e, v, u)]) == *value));
            let ImageBatch::I32(mask) = mask else { panic!("{:?}", mask.element()) };
            assert!(mask.iter().any(|id| *id > 0) && mask.iter().any(|id| *id == 0));
            let last = seen.final_image("depth").unwrap();
            assert_ne!(seen.final_image("color").unwrap(), &before, "the cart moves");
            if k == 4 && mode == AutoresetMode::SameStep {
                assert!(depth == &first && last != &first, "the new episode begins at the start");
            } else {
                assert!(depth == last && depth != &first, "{mode}, step {k}");
            }
        }
        let error = env.group(POLICY_GROUP).unwrap().image("rgb").map(drop).unwrap_err();
        assert!(matches!(&error, EnvError::UnknownName { candidates, .. } if candidates.len() == 3), "{error}");
    }
}

/// Images have the same bits for any number of threads, environments and processes.
#[test]
fn image_bits() {
    let run = |settings: SimulationManagerCfg| {
        let first = settings.first_env();
        let (mut env, _) = filmed(settings, AutoresetMode::SameStep);
        let n = env.num_envs();
        env.reset(None, Some(3)).unwrap();
        let mut all: Vec<Vec<u8>> = vec![Vec::new(); n];
        for k in 0..6 {
            env.step(&Array2::from_shape_fn((n, 1), |(e, _)| 2.0 * (first + e) as f64 - f64::from(k))).unwrap();
            let group = env.group(POLICY_GROUP).unwrap();
            for (e, all) in all.iter_mut().enumerate() {
                for batch in [group.image("color").unwrap(), group.final_image("color").unwrap()] {
                    all.extend(u8s(batch).index_axis(Axis(0), e));
                }
                all.extend(
                    f32s(group.image("depth").unwrap()).index_axis(Axis(0), e).iter().flat_map(|x| x.to_le_bytes()),
                );
            }
        }
        all
    };
    let one = run(cfg(4, 1));
    assert!(run(cfg(4, 3)) == one);
    let halves: Vec<Vec<u8>> =
        (0..2).flat_map(|rank| run(SimulationManagerCfg { shard: Shard { rank, world: 2 }, ..cfg(2, 1) })).collect();
    assert!(halves == one);
    assert_ne!(one[0], one[3], "the control");
}

/// A policy may see images only; invalid images are errors that name the term.
#[test]
fn image_terms() {
    let space = ImageSpace { height: 2, width: 3, components: 1, element: ImageElement::F32, bounds: [0.0, 1.0] };
    let build = |term: ImageTerm| {
        let (sim, _) = world(cfg(2, 1), false);
        EnvBuilder::new(sim, EnvCfg::default()).action(idle()).image(term).build()
    };
    let with = |image: fn() -> ImageBatch| ImageTerm::new("own", space, move |_| Ok(image()));
    let mut env = build(with(|| ImageBatch::F32(Array4::from_elem([2, 2, 3, 1], 0.5)))).unwrap();
    assert_eq!(env.reset(None, None).unwrap().dim(), (2, 0));
    assert_eq!(env.group(POLICY_GROUP).unwrap().image("own").unwrap().shape(), [2, 2, 3, 1]);
    for (image, words) in [
        (
            with(|| ImageBatch::F32(Array4::zeros([2, 3, 2, 1]))),
            "\"own\" has shape [2, 3, 2, 1]; expected [2, 2, 3, 1]",
        ),
        (with(|| ImageBatch::U8(Array4::zeros([2, 2, 3, 1]))), "\"own\" has components of type U8; expected F32"),
        (with(|| ImageBatch::F32(Array4::from_elem([2, 2, 3, 1], f32::INFINITY))), "row 0, column 0, component 0"),
    ] {
        let error = build(image).unwrap().reset(None, None).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let flat = ImageTerm::new("own", ImageSpace { height: 0, ..space }, |_| Err("never".into()));
    assert!(matches!(build(flat), Err(EnvError::Config { .. })));
    let (sim, _) = world(cfg(2, 1), false);
    let unnamed = EnvBuilder::new(sim, EnvCfg::default()).action(idle()).observation_in("a/b", steps_done("k"));
    let error = unnamed.observation(steps_done("k")).build().map(drop).unwrap_err();
    assert!(error.to_string().contains("observation group"), "{error}");
}
