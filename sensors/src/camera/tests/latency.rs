//! Latency, dropout and history of images, compared with a perfect camera.

use super::super::imperfection::{Exposure, Holes, Imperfections, ShotNoise};
use super::super::{Camera, CameraCfg, CameraConvention, CameraError, CameraPlacement, Extrinsics};
use super::test_scene::{DT, bits, built, cfg, context, state};
use crate::SensorContext;
use crate::error::SensorError;
use crate::noise::NoiseCfg;
use crate::sensor::{Sensor, SensorCfg};
use kinetoscope_render::Intrinsics;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::frame::{Color, Depth, Distance, ListedChannel, Mask, Normal, Position, ShadingNormal};
use ndarray::{Axis, array};

/// A past image as bits, in the order of [`bits`].
fn past_bits(camera: &Camera, row: usize, age: usize) -> Vec<u32> {
    fn of<C: ListedChannel>(camera: &Camera, row: usize, age: usize, bits: impl Fn(C::Element) -> u32) -> Vec<u32> {
        let history = camera.history::<C>().unwrap();
        let [rows, length] = [camera.env_ids().len(), camera.history_length()];
        assert_eq!(history.shape()[..2], [rows, length]);
        let flat = history.to_slice().unwrap();
        let each = flat.len() / (rows * length);
        flat[(row * length + age) * each..][..each].iter().map(|number| bits(*number)).collect()
    }
    [
        of::<Color>(camera, row, age, u32::from),
        of::<Mask>(camera, row, age, |id| id as u32),
        of::<Depth>(camera, row, age, f32::to_bits),
        of::<Distance>(camera, row, age, f32::to_bits),
        of::<Normal>(camera, row, age, f32::to_bits),
        of::<ShadingNormal>(camera, row, age, f32::to_bits),
        of::<Position>(camera, row, age, f32::to_bits),
    ]
    .concat()
}

/// A camera with noise, dropout, latency, history and every imperfection.
fn imperfect_cfg() -> CameraCfg {
    let noise = NoiseCfg { std: 0.02, bias_std: 0.01, bias_walk: 0.05, resolution: 0.001 };
    let color = NoiseCfg { std: 3.0, bias_std: 2.0, bias_walk: 1.0, resolution: 0.0 };
    CameraCfg {
        update_period: 2.0 * DT,
        history_length: 3,
        latency_steps: 3,
        dropout: 0.3,
        noise: [("depth", noise), ("distance", noise), ("rgb", color)].map(|(name, n)| (name.to_string(), n)).into(),
        imperfections: Imperfections {
            vignetting: Some(Default::default()),
            exposure: Some(Exposure { stops: 0.5 }),
            shot_noise: Some(ShotNoise { electrons: 500.0 }),
            read_noise: Some(Default::default()),
            holes: Some(Default::default()),
            depth_noise: Some(Default::default()),
        },
        ..cfg()
    }
}

/// Late images equal those of a perfect camera the same number of steps ago; images of the reset are shown at once.
#[test]
fn latency() {
    let context = context(2);
    for (period, latency) in [(1, 0), (1, 1), (1, 3), (4, 1), (4, 4), (4, 6), (3, 20)] {
        let perfect = CameraCfg { update_period: period as f64 * DT, ..cfg() };
        let late = CameraCfg { latency_steps: latency, history_length: 2, ..perfect.clone() };
        let (mut perfect, mut late) = (built(&perfect, &context), built(&late, &context));
        let mut seen = vec![bits(&perfect, 0..2)];
        assert!(bits(&late, 0..2) == seen[0]);
        for now in 1..=30u64 {
            perfect.update(&state(&[now, now])).unwrap();
            if now % period == 0 {
                seen.push(bits(&perfect, 0..2));
            }
            late.update(&state(&[now, now])).unwrap();
            let arrived = (now.saturating_sub(latency.into()) / period) as usize;
            let case = format!("period {period}, latency {latency}, step {now}");
            let captured = |age: usize| ((arrived - age) as u64 * period) as f64 * DT;
            assert_eq!(late.frame_counts(), array![arrived as u64, arrived as u64], "{case}");
            assert_eq!(late.stamps(), array![captured(0), captured(0)], "{case}");
            assert!(bits(&late, 0..2) == seen[arrived], "{case}");
            for (env, age) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                assert_eq!(late.history_filled(env).unwrap(), arrived.min(2));
                if age < arrived {
                    let expected = &seen[arrived - age];
                    let half = expected.len() / 2;
                    assert!(past_bits(&late, env, age) == expected[env * half..(env + 1) * half], "{case}, {age}");
                    assert_eq!(late.stamp_history()[(env, age)], captured(age));
                } else {
                    assert!(past_bits(&late, env, age).iter().all(|bits| *bits == 0), "nothing yet");
                    assert_eq!(late.stamp_history()[(env, age)], 0.0);
                }
            }
        }
        assert!(seen.windows(2).all(|two| two[0] != two[1]), "the control: images differ");
        // An image that is shown and in the history is rendered once.
        assert_eq!(late.render_count(), 2 * (1 + late.frame_counts()[0]), "period {period}, latency {latency}");
    }
}

#[test]
fn history_shapes() {
    let context = context(3);
    let mut camera = built(&CameraCfg { history_length: 4, ..cfg() }, &context);
    camera.update(&state(&[1, 1, 1])).unwrap();
    assert_eq!(camera.history::<Depth>().unwrap().dim(), (3, 4, 32, 48));
    assert_eq!(camera.history::<Color>().unwrap().dim(), (3, 4, 32, 48, 4));
    assert_eq!((camera.stamp_history().dim(), camera.history_length()), ((3, 4), 4));
    assert_eq!(camera.history::<Depth>().unwrap().index_axis_move(Axis(1), 0), camera.depth().unwrap());
    let none = built(&cfg(), &context);
    assert_eq!(none.history::<Depth>().unwrap().dim(), (3, 0, 32, 48));
    assert_eq!(none.history::<Normal>().unwrap().dim(), (3, 0, 32, 48, 3));
    assert_eq!((none.stamp_history().dim(), none.history_length(), none.history_filled(2)), ((3, 0), 0, Ok(0)));
    assert!(none.history_filled(3).is_err());
    let camera = built(&CameraCfg { channels: depth_only(), history_length: 1, ..cfg() }, &context);
    let error = camera.history::<Mask>().unwrap_err().to_string();
    assert_eq!(error, "the camera does not measure mask; it measures depth");
}

/// Images of the history are rendered when they are read, each once.
#[test]
fn lazy_history() {
    let mut camera = built(&CameraCfg { history_length: 3, ..cfg() }, &context(1));
    (1..=10).for_each(|step| camera.update(&state(&[step])).unwrap());
    assert_eq!(camera.render_count(), 0);
    camera.history::<Depth>().unwrap();
    camera.history::<Color>().unwrap();
    camera.depth().unwrap();
    assert_eq!(camera.render_count(), 3, "frames 10, 9 and 8");
    camera.update(&state(&[11])).unwrap();
    camera.history::<Depth>().unwrap();
    assert_eq!(camera.render_count(), 4, "frame 11");
    camera.update(&state(&[12])).unwrap();
    camera.depth().unwrap();
    camera.history::<Depth>().unwrap();
    assert_eq!(camera.render_count(), 5, "frame 12, once");
}

/// An owner that updates only at due steps gets the same images.
#[test]
fn due() {
    let context = context(2);
    let cfg = CameraCfg { update_period: 4.0 * DT, latency_steps: 5, history_length: 2, ..cfg() };
    let (mut rare, mut often) = (built(&cfg, &context), built(&cfg, &context));
    let (mut next, mut updates) = (rare.due_in(&[0, 0]), 0);
    for now in 1..=40 {
        often.update(&state(&[now, now])).unwrap();
        if now == next {
            rare.update(&state(&[now, now])).unwrap();
            next = now + rare.due_in(&[now, now]);
            updates += 1;
        }
        assert!(bits(&rare, 0..2) == bits(&often, 0..2), "step {now}");
        assert_eq!((rare.frame_counts(), rare.stamps()), (often.frame_counts(), often.stamps()));
    }
    // Captures at 4, 8, .., 40 and deliveries at 9, 13, .., 37.
    assert_eq!(updates, 10 + 8);
}

/// A lost image keeps the previous one. Of 300 images lost with probability 0.4, 180 are delivered, with a standard
/// deviation of sqrt(300 0.4 0.6) = 8.5; the bound is six times that.
#[test]
fn dropout() {
    let context = context(2);
    let lossy = |dropout| built(&CameraCfg { dropout, channels: depth_only(), ..cfg() }, &context);
    let (mut camera, mut perfect) = (lossy(0.4), lossy(0.0));
    let mut last = [perfect.depth().unwrap().to_owned(), perfect.depth().unwrap().to_owned()];
    let mut together = 0;
    for now in 1..=300 {
        let before = camera.frame_counts().to_owned();
        camera.update(&state(&[now, now])).unwrap();
        perfect.update(&state(&[now, now])).unwrap();
        let came = [0, 1].map(|env| camera.frame_counts()[env] > before[env]);
        for env in 0..2 {
            if came[env] {
                last[env] = perfect.depth().unwrap().to_owned();
            }
            let row = |images: ndarray::ArrayView3<'_, f32>| images.index_axis(Axis(0), env).to_owned();
            assert_eq!(row(camera.depth().unwrap()), row(last[env].view()), "step {now}");
        }
        together += u32::from(came[0] == came[1]);
    }
    assert!(camera.frame_counts().iter().all(|count| count.abs_diff(180) < 51), "{}", camera.frame_counts());
    // Independent environments agree with probability 0.52.
    assert!(together.abs_diff(156) < 52, "{together}");
    let mut none = lossy(1.0);
    none.update(&state(&[5, 5])).unwrap();
    assert_eq!((none.frame_counts(), none.stamps()), (array![0, 0].view(), array![0.0, 0.0].view()));
}

fn depth_only() -> Channels {
    Channels { depth: true, ..Channels::default() }
}

/// A reset drops frames in flight and the history.
#[test]
fn resets() {
    let context = context(2);
    let cfg = CameraCfg { update_period: 2.0 * DT, latency_steps: 6, history_length: 2, ..cfg() };
    let mut camera = built(&cfg, &context);
    (1..=9).for_each(|now| camera.update(&state(&[now, now])).unwrap());
    camera.history::<Depth>().unwrap();
    assert_eq!(camera.frame_counts(), array![1, 1]);
    let other = past_bits(&camera, 0, 0);
    camera.reset(&[1], &state(&[9, 0])).unwrap();
    assert_eq!((camera.history_filled(0), camera.history_filled(1)), (Ok(1), Ok(0)));
    assert!(past_bits(&camera, 1, 0).iter().all(|bits| *bits == 0));
    assert_eq!(past_bits(&camera, 0, 0), other);
    let start = bits(&camera, [1]);
    assert_eq!(start, bits(&built(&cfg, &context), [1]), "the image of the reset is shown at once");
    for k in 1..=7 {
        camera.update(&state(&[9 + k, k])).unwrap();
        assert_eq!((bits(&camera, [1]), camera.frame_counts()[1]), (start.clone(), 0));
    }
    camera.update(&state(&[17, 8])).unwrap();
    assert_eq!((camera.stamps()[1], camera.frame_counts()[1]), (2.0 * DT, 1));
    assert_eq!((camera.stamps()[0], camera.frame_counts()[0]), (10.0 * DT, 5));
    assert_ne!(bits(&camera, [1]), start, "the control");
}

/// As in samplers: an image captured before a write does not replace the image of the write, but is in the history.
#[test]
fn refresh() {
    let context = context(1);
    let cfg = CameraCfg { update_period: 2.0 * DT, latency_steps: 4, history_length: 9, ..cfg() };
    let mut camera = built(&cfg, &context);
    (1..=5).for_each(|now| camera.update(&state(&[now])).unwrap());
    camera.refresh(&[0], &state(&[5])).unwrap();
    let fresh = bits(&camera, [0]);
    let steps = |stamp: &f64| (stamp / DT).round() as u64;
    let mut stamps = Vec::new();
    for now in 6..=10 {
        camera.update(&state(&[now])).unwrap();
        stamps.push(steps(&camera.stamps()[0]));
        assert!(now == 10 || bits(&camera, [0]) == fresh, "step {now}");
    }
    assert_eq!(stamps, [5, 5, 5, 5, 6]);
    let history: Vec<u64> = camera.stamp_history().row(0).iter().map(steps).collect();
    assert_eq!(history, [6, 4, 2, 0, 0, 0, 0, 0, 0]);
    assert_eq!((camera.frame_counts()[0], camera.history_filled(0)), (3, Ok(3)));
    let mut perfect = built(&CameraCfg { update_period: 2.0 * DT, ..super::test_scene::cfg() }, &context);
    perfect.update(&state(&[4])).unwrap();
    assert_eq!(past_bits(&camera, 0, 1), bits(&perfect, [0]));
}

/// Setters act on the shown image and on images in flight, not on the history.
#[test]
fn setters() {
    let context = context(1);
    let mut camera = built(&CameraCfg { latency_steps: 2, history_length: 3, ..cfg() }, &context);
    (1..=4).for_each(|now| camera.update(&state(&[now])).unwrap());
    let before = [0, 1].map(|age| past_bits(&camera, 0, age));
    let lens = Intrinsics::Fovy { radians: 0.6 };
    camera.set_intrinsics(&[lens], None).unwrap();
    let at = |step: u64| {
        let mut perfect = built(&cfg(), &context);
        perfect.refresh(&[0], &state(&[step])).unwrap();
        perfect.set_intrinsics(&[lens], None).unwrap();
        bits(&perfect, [0])
    };
    assert_eq!(bits(&camera, [0]), at(2), "the same instant through the new lens");
    assert_eq!([0, 1].map(|age| past_bits(&camera, 0, age)), before);
    camera.update(&state(&[5])).unwrap();
    assert_eq!((bits(&camera, [0]), past_bits(&camera, 0, 0)), (at(3), at(3)));
    assert_eq!([1, 2].map(|age| past_bits(&camera, 0, age)), before);
    assert_ne!(at(3), at(2), "the control");
}

/// A lazy camera has the same bits as an eager camera, through resets, refreshes and setters.
#[test]
fn lazy_and_eager() {
    let context = context(2);
    let mut lazy = built(&imperfect_cfg(), &context);
    let mut eager = built(&CameraCfg { lazy: false, ..imperfect_cfg() }, &context);
    for now in 1..=40u64 {
        for camera in [&mut lazy, &mut eager] {
            let there = state(&[now, if now > 20 { now - 20 } else { now }]);
            if now == 21 {
                camera.reset(&[1], &state(&[20, 0])).unwrap();
            }
            camera.update(&there).unwrap();
            match now {
                9 => camera.refresh(&[0], &there).unwrap(),
                13 => camera.set_intrinsics(&[Intrinsics::Fovy { radians: 0.7 }], Some(&[0])).unwrap(),
                17 => {
                    let pose = kinetoscope_scene::pose::from_xyz_rpy([-1.4, 0.1, 0.8], [0.0, 0.1, 0.0]);
                    camera.set_local_pose(&pose, None, CameraConvention::World).unwrap();
                }
                _ => {}
            }
        }
        // Irregular reads, so that some images are never rendered.
        if [3, 9, 10, 13, 18, 19, 27, 40].contains(&now) {
            assert!(bits(&lazy, 0..2) == bits(&eager, 0..2), "step {now}");
            for (env, age) in [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)] {
                assert!(past_bits(&lazy, env, age) == past_bits(&eager, env, age), "step {now}: {env}, {age}");
            }
            assert_eq!((lazy.stamps(), lazy.frame_counts()), (eager.stamps(), eager.frame_counts()));
        }
    }
    assert!(lazy.render_count() < eager.render_count(), "{} {}", lazy.render_count(), eager.render_count());
}

/// The number of threads changes no bit, and a subset of the environments has the same images.
#[test]
fn threads_and_environments() {
    let images = |context: &SensorContext| {
        let mut camera = built(&imperfect_cfg(), context);
        (1..=12).for_each(|step| camera.update(&state(&[step; 5])).unwrap());
        [bits(&camera, 0..5), past_bits(&camera, 4, 1)].concat()
    };
    let by_threads = [0, 1, 2, 3, 4].map(|threads| images(&SensorContext { threads, ..context(5) }));
    assert!(by_threads.iter().all(|other| *other == by_threads[0]));
    let seed = context(5).seed + 1;
    assert!(images(&SensorContext { seed, ..context(5) }) != by_threads[0], "the control: another seed");
    let (mut all, mut some) = (
        built(&imperfect_cfg(), &context(4)),
        built(&CameraCfg { env_ids: Some(vec![3, 1]), ..imperfect_cfg() }, &context(4)),
    );
    for now in 1..=14 {
        for camera in [&mut all, &mut some] {
            camera.update(&state(&[now, now + 1, now, now])).unwrap();
            if now == 8 {
                camera.reset(&[0, 1], &state(&[8, 9, 8, 8])).unwrap();
            }
        }
    }
    assert_eq!(bits(&some, 0..2), bits(&all, [3, 1]));
    assert_eq!(past_bits(&some, 0, 1), past_bits(&all, 3, 1));
    assert_ne!(bits(&all, [3]), bits(&all, [2]), "the control");
}

#[test]
fn bad_options() {
    let refused = |cfg: CameraCfg| cfg.build(&context(2)).unwrap_err();
    let history = refused(CameraCfg { history_length: 1 << 40, ..cfg() });
    assert!(matches!(history, SensorError::Camera(CameraError::HistoryMemory { pending_frames: 1, .. })), "{history}");
    let endless = refused(CameraCfg { history_length: usize::MAX, ..cfg() });
    assert!(matches!(endless, SensorError::Camera(CameraError::HistoryMemory { .. })), "{endless}");
    // 2000 images of 48 x 32 pixels fit.
    assert!(CameraCfg { history_length: 200, latency_steps: 1000, ..cfg() }.build(&context(2)).is_ok());
    for dropout in [-0.1, 1.1, f64::NAN] {
        let error = refused(CameraCfg { dropout, ..cfg() });
        assert!(matches!(&error, SensorError::OutOfRange { field, .. } if field == "dropout"), "{error}");
    }
    let noise = |name: &str, noise: NoiseCfg| CameraCfg { noise: [(name.to_string(), noise)].into(), ..cfg() };
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        for noise_cfg in [NoiseCfg::white(bad), NoiseCfg { bias_walk: bad, ..NoiseCfg::default() }] {
            let error = refused(noise("distance_to_image_plane", noise_cfg));
            assert!(matches!(&error, SensorError::OutOfRange { field, .. } if field.contains("\"depth\"")), "{error}");
        }
    }
    let off = CameraCfg { channels: depth_only(), ..noise("color", NoiseCfg::white(1.0)) };
    assert!(matches!(refused(off), SensorError::UnknownName { .. }), "not measured");
    let twice =
        [("depth", 1.0), ("distance_to_image_plane", 2.0)].map(|(name, std)| (name.to_string(), NoiseCfg::white(std)));
    let imperfections = Imperfections { holes: Some(Holes::default()), ..Imperfections::default() };
    let channels = Channels { color: true, ..Channels::default() };
    let holes = CameraCfg { imperfections, channels, ..cfg() };
    let past = "0 images of history and 4294967296 frames in flight, in each of 2 environments, do not fit into memory (at most \
                68719476736 bytes); reduce history_length or latency_steps";
    let (mask, dept) = (noise("mask", NoiseCfg::white(1.0)), noise("dept", NoiseCfg::white(1.0)));
    for (cfg, exact, text) in [
        (CameraCfg { latency_steps: u32::MAX, ..cfg() }, true, past),
        (mask, false, "unknown noise channel \"mask\"; known names: "),
        (dept, false, "unknown noise channel \"dept\"; known names: \"depth\""),
        (
            CameraCfg { noise: twice.into(), ..cfg() },
            true,
            "the noise of \"depth\" is given twice, by two names of the channel",
        ),
        (holes, true, "the camera does not measure depth; it measures color"),
    ] {
        let error = refused(cfg).to_string();
        assert!(error.starts_with(text) && (!exact || error == text), "{error}");
    }
    let extrinsics = Extrinsics { parent: Some("tip".into()), ..Extrinsics::default() };
    assert!(CameraCfg { extrinsics, ..imperfect_cfg() }.build(&context(1)).is_ok(), "the control");
}
