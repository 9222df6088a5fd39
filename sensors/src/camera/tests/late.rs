//! Pictures that come late, get lost or are remembered, against those of a perfect camera.

use super::super::channel::{Color, Depth, Distance, Listed, Mask, Normal, Position, ShadingNormal};
use super::super::imperfection::{DepthNoise, Exposure, Holes, Imperfections, ReadNoise, ShotNoise, Vignetting};
use super::super::{Camera, CameraCfg, CameraConvention, CameraError, Channels, Extrinsics, Intrinsics};
use super::stage::{DT, bits, built, cfg, context, state};
use crate::error::SensorError;
use crate::noise::NoiseCfg;
use crate::sensor::{Sensor, SensorCfg};
use ndarray::{Axis, array};

/// A past picture as bits, in the order of [`bits`].
pub(super) fn past_bits(camera: &Camera, row: usize, age: usize) -> Vec<u32> {
    fn of<C: Listed>(camera: &Camera, row: usize, age: usize, bits: impl Fn(C::Number) -> u32) -> Vec<u32> {
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

/// A camera with everything that a camera can have against it.
pub(super) fn troubled() -> CameraCfg {
    let noise = NoiseCfg { std: 0.02, bias_std: 0.01, bias_walk: 0.05, resolution: 0.001 };
    let color = NoiseCfg { std: 3.0, bias_std: 2.0, bias_walk: 1.0, resolution: 0.0 };
    CameraCfg {
        update_period: 2.0 * DT,
        history_length: 3,
        latency_steps: 3,
        dropout: 0.3,
        noise: [("depth", noise), ("distance", noise), ("rgb", color)].map(|(name, n)| (name.to_string(), n)).into(),
        imperfections: Imperfections {
            vignetting: Some(Vignetting::default()),
            exposure: Some(Exposure { stops: 0.5 }),
            shot_noise: Some(ShotNoise { electrons: 500.0 }),
            read_noise: Some(ReadNoise::default()),
            holes: Some(Holes::default()),
            depth_noise: Some(DepthNoise::default()),
        },
        ..cfg()
    }
}

#[test]
fn late_pictures_are_those_of_a_perfect_camera_so_many_steps_ago() {
    let context = context(2);
    for (period, latency) in [(1, 0), (1, 1), (1, 3), (4, 1), (4, 4), (4, 6), (3, 20)] {
        let perfect = CameraCfg { update_period: period as f64 * DT, ..cfg() };
        let late = CameraCfg { latency_steps: latency, history_length: 2, ..perfect.clone() };
        let (mut perfect, mut late) = (built(&perfect, &context), built(&late, &context));
        let mut seen = vec![bits(&perfect, 0..2)];
        assert!(bits(&late, 0..2) == seen[0], "what there is at the start is seen at once");
        for now in 1..=30u64 {
            perfect.update(&state(&[now, now])).unwrap();
            if now % period == 0 {
                seen.push(bits(&perfect, 0..2));
            }
            late.update(&state(&[now, now])).unwrap();
            let arrived = (now.saturating_sub(latency.into()) / period) as usize;
            let case = format!("period {period}, latency {latency}, step {now}");
            assert_eq!(late.frame_counts(), array![arrived as u64, arrived as u64], "{case}");
            assert!(bits(&late, 0..2) == seen[arrived], "{case}");
            let captured = |age: usize| ((arrived - age) as u64 * period) as f64 * DT;
            assert_eq!(late.stamps(), array![captured(0), captured(0)], "the stamp is that of the capture");
            for env in 0..2 {
                assert_eq!(late.history_filled(env).unwrap(), arrived.min(2));
                for age in 0..2 {
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
        }
        assert!(seen.windows(2).all(|two| two[0] != two[1]), "the control: every picture is another one");
        // What is shown and what is remembered is drawn once.
        assert_eq!(late.draws(), 2 * (1 + late.frame_counts()[0]), "period {period}, latency {latency}");
    }
}

#[test]
fn shapes_and_lengths() {
    let context = context(3);
    let mut camera = built(&CameraCfg { history_length: 4, ..cfg() }, &context);
    camera.update(&state(&[1, 1, 1])).unwrap();
    assert_eq!(camera.history::<Depth>().unwrap().dim(), (3, 4, 32, 48));
    assert_eq!(camera.history::<Color>().unwrap().dim(), (3, 4, 32, 48, 4));
    assert_eq!((camera.stamp_history().dim(), camera.history_length()), ((3, 4), 4));
    let newest = camera.history::<Depth>().unwrap().index_axis_move(Axis(1), 0);
    assert_eq!(newest, camera.depth().unwrap());
    let none = built(&cfg(), &context);
    assert_eq!(none.history::<Depth>().unwrap().dim(), (3, 0, 32, 48));
    assert_eq!(none.history::<Normal>().unwrap().dim(), (3, 0, 32, 48, 3));
    assert_eq!((none.stamp_history().dim(), none.history_length(), none.history_filled(2)), ((3, 0), 0, Ok(0)));
    assert!(none.history_filled(3).is_err());
    let channels = Channels { depth: true, ..Channels::default() };
    let camera = built(&CameraCfg { channels, history_length: 1, ..cfg() }, &context);
    assert_eq!(
        camera.history::<Mask>().unwrap_err().to_string(),
        "the camera does not measure mask; it measures depth"
    );
}

/// Those that nobody looked at are drawn when somebody does, and only they.
#[test]
fn a_lazy_history_draws_what_is_looked_at() {
    let context = context(1);
    let mut camera = built(&CameraCfg { history_length: 3, ..cfg() }, &context);
    for step in 1..=10 {
        camera.update(&state(&[step])).unwrap();
    }
    assert_eq!(camera.draws(), 0);
    camera.history::<Depth>().unwrap();
    camera.history::<Color>().unwrap();
    camera.depth().unwrap();
    assert_eq!(camera.draws(), 3, "10, 9 and 8");
    camera.update(&state(&[11])).unwrap();
    camera.history::<Depth>().unwrap();
    assert_eq!(camera.draws(), 4, "11");
    camera.update(&state(&[12])).unwrap();
    camera.depth().unwrap();
    camera.history::<Depth>().unwrap();
    assert_eq!(camera.draws(), 5, "12, once");
}

#[test]
fn an_owner_who_updates_only_what_is_due_sees_the_same() {
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
    // Captures at 4, 8, .., 40 and arrivals at 9, 13, .., 37.
    assert_eq!(updates, 10 + 8);
}

/// Of 300 pictures that get lost with probability 0.4, 180 arrive, with a deviation of sqrt(300 0.4 0.6) = 8.5: six times that.
#[test]
fn lost_pictures_leave_the_one_before() {
    let context = context(2);
    let mut camera = built(&CameraCfg { dropout: 0.4, channels: depth_only(), ..cfg() }, &context);
    let mut perfect = built(&CameraCfg { channels: depth_only(), ..cfg() }, &context);
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
            let row = |pictures: ndarray::ArrayView3<'_, f32>| pictures.index_axis(Axis(0), env).to_owned();
            assert_eq!(row(camera.depth().unwrap()), row(last[env].view()), "step {now}");
        }
        together += u32::from(came[0] == came[1]);
    }
    for count in camera.frame_counts() {
        assert!(count.abs_diff(180) < 51, "{count}");
    }
    // Independent environments agree with probability 0.52.
    assert!(together.abs_diff(156) < 52, "{together}");
    let mut none = built(&CameraCfg { dropout: 1.0, channels: depth_only(), ..cfg() }, &context);
    none.update(&state(&[5, 5])).unwrap();
    assert_eq!((none.frame_counts(), none.stamps()), (array![0, 0].view(), array![0.0, 0.0].view()));
}

fn depth_only() -> Channels {
    Channels { depth: true, ..Channels::default() }
}

#[test]
fn a_reset_forgets_what_is_on_its_way_and_what_was() {
    let context = context(2);
    let cfg = CameraCfg { update_period: 2.0 * DT, latency_steps: 6, history_length: 2, ..cfg() };
    let mut camera = built(&cfg, &context);
    for now in 1..=9 {
        camera.update(&state(&[now, now])).unwrap();
    }
    camera.history::<Depth>().unwrap();
    assert_eq!(camera.frame_counts(), array![1, 1]);
    let other = past_bits(&camera, 0, 0);
    camera.reset(&[1], &state(&[9, 0])).unwrap();
    assert_eq!((camera.history_filled(0), camera.history_filled(1)), (Ok(1), Ok(0)));
    assert!(past_bits(&camera, 1, 0).iter().all(|bits| *bits == 0));
    assert_eq!(past_bits(&camera, 0, 0), other);
    let start = bits(&camera, [1]);
    assert_eq!(start, bits(&built(&cfg, &context), [1]), "what there is at the start is seen at once");
    for k in 1..=7 {
        camera.update(&state(&[9 + k, k])).unwrap();
        assert_eq!((bits(&camera, [1]), camera.frame_counts()[1]), (start.clone(), 0));
    }
    camera.update(&state(&[17, 8])).unwrap();
    assert_eq!((camera.stamps()[1], camera.frame_counts()[1]), (2.0 * DT, 1));
    assert_eq!((camera.stamps()[0], camera.frame_counts()[0]), (10.0 * DT, 5));
    assert_ne!(bits(&camera, [1]), start, "the control");
}

/// As samplers have it: what was captured before somebody wrote does not replace what was written, but is remembered.
#[test]
fn what_was_captured_before_a_refresh_does_not_replace_it() {
    let context = context(1);
    let cfg = CameraCfg { update_period: 2.0 * DT, latency_steps: 4, history_length: 9, ..cfg() };
    let mut camera = built(&cfg, &context);
    for now in 1..=5 {
        camera.update(&state(&[now])).unwrap();
    }
    camera.refresh(&[0], &state(&[5])).unwrap();
    let fresh = bits(&camera, [0]);
    let mut stamps = Vec::new();
    for now in 6..=10 {
        camera.update(&state(&[now])).unwrap();
        stamps.push((camera.stamps()[0] / DT).round());
        if now < 10 {
            assert_eq!(bits(&camera, [0]), fresh, "step {now}");
        }
    }
    assert_eq!(stamps, [5.0, 5.0, 5.0, 5.0, 6.0]);
    assert_eq!(camera.stamp_history().to_vec_of_steps(), [6, 4, 2, 0, 0, 0, 0, 0, 0]);
    assert_eq!((camera.frame_counts()[0], camera.history_filled(0)), (3, Ok(3)));
    let mut perfect = built(&CameraCfg { update_period: 2.0 * DT, ..super::stage::cfg() }, &context);
    perfect.update(&state(&[4])).unwrap();
    assert_eq!(past_bits(&camera, 0, 1), bits(&perfect, [0]), "it is remembered as it was");
}

/// Stamps of the first environment, in steps.
trait Steps {
    fn to_vec_of_steps(&self) -> Vec<u64>;
}

impl Steps for ndarray::ArrayView2<'_, f64> {
    fn to_vec_of_steps(&self) -> Vec<u64> {
        self.row(0).iter().map(|stamp| (stamp / DT).round() as u64).collect()
    }
}

#[test]
fn setters_act_on_what_is_shown_and_on_its_way_and_not_on_the_past() {
    let context = context(1);
    let cfg = CameraCfg { latency_steps: 2, history_length: 3, ..cfg() };
    let mut camera = built(&cfg, &context);
    for now in 1..=4 {
        camera.update(&state(&[now])).unwrap();
    }
    let before = [0, 1].map(|age| past_bits(&camera, 0, age));
    let lens = Intrinsics::Fovy { radians: 0.6 };
    camera.set_intrinsics(&[lens], None).unwrap();
    let from_there = |step: u64| {
        let mut perfect = built(&super::stage::cfg(), &context);
        perfect.refresh(&[0], &state(&[step])).unwrap();
        perfect.set_intrinsics(&[lens], None).unwrap();
        bits(&perfect, [0])
    };
    assert_eq!(bits(&camera, [0]), from_there(2), "the same instant through the new lens");
    assert_eq!([0, 1].map(|age| past_bits(&camera, 0, age)), before);
    camera.update(&state(&[5])).unwrap();
    assert_eq!(bits(&camera, [0]), from_there(3));
    assert_eq!(past_bits(&camera, 0, 0), from_there(3));
    assert_eq!([1, 2].map(|age| past_bits(&camera, 0, age)), before);
    assert_ne!(from_there(3), from_there(2), "the control");
}

/// The same things happen to both: one draws at once, the other one when somebody looks.
#[test]
fn lazy_ones_show_the_same_bits() {
    let context = context(2);
    let mut lazy = built(&troubled(), &context);
    let mut eager = built(&CameraCfg { lazy: false, ..troubled() }, &context);
    let mut looked = 0;
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
                    let pose = scene::pose::from_xyz_rpy([-1.4, 0.1, 0.8], [0.0, 0.1, 0.0]);
                    camera.set_local_pose(&pose, None, CameraConvention::World).unwrap();
                }
                _ => {}
            }
        }
        // At odd times, so that some pictures are never drawn.
        if [3, 9, 10, 13, 18, 19, 27, 40].contains(&now) {
            looked += 1;
            assert!(bits(&lazy, 0..2) == bits(&eager, 0..2), "step {now}");
            for (env, age) in [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)] {
                assert!(past_bits(&lazy, env, age) == past_bits(&eager, env, age), "step {now}: {env}, {age}");
            }
            assert_eq!((lazy.stamps(), lazy.frame_counts()), (eager.stamps(), eager.frame_counts()));
        }
    }
    assert!(looked == 8 && lazy.draws() < eager.draws(), "{} {}", lazy.draws(), eager.draws());
}

#[test]
fn threads_change_no_bit_of_any_of_it() {
    let mut context = context(5);
    let pictures: Vec<Vec<u32>> = [1, 3, 4]
        .map(|threads| {
            context.threads = threads;
            let mut camera = built(&troubled(), &context);
            (1..=12).for_each(|step| camera.update(&state(&[step; 5])).unwrap());
            [bits(&camera, 0..5), past_bits(&camera, 4, 1)].concat()
        })
        .into();
    assert!(pictures.iter().all(|other| *other == pictures[0]));
    context.seed += 1;
    let mut other = built(&troubled(), &context);
    (1..=12).for_each(|step| other.update(&state(&[step; 5])).unwrap());
    assert!([bits(&other, 0..5), past_bits(&other, 4, 1)].concat() != pictures[0], "the control: another seed");
}

#[test]
fn some_environments_are_those_of_all_with_all_that_happens_to_them() {
    let context = context(4);
    let (mut all, mut some) =
        (built(&troubled(), &context), built(&CameraCfg { env_ids: Some(vec![3, 1]), ..troubled() }, &context));
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
fn what_does_not_fit_into_memory_is_refused() {
    let refused = |cfg: CameraCfg| cfg.build(&context(2)).unwrap_err();
    let history = refused(CameraCfg { history_length: 1 << 40, ..cfg() });
    assert!(matches!(history, SensorError::Camera(CameraError::Past { captures: 1, .. })), "{history}");
    let endless = refused(CameraCfg { history_length: usize::MAX, ..cfg() });
    assert!(matches!(endless, SensorError::Camera(CameraError::Past { .. })), "{endless}");
    let late = refused(CameraCfg { latency_steps: u32::MAX, ..cfg() });
    assert_eq!(
        late.to_string(),
        "0 past pictures and 4294967296 captures on their way, in each of 2 environments, do not fit into memory (at most \
         68719476736 bytes); make history_length or latency_steps smaller"
    );
    // 2000 pictures of 48 x 32 pixels do.
    assert!(CameraCfg { history_length: 200, latency_steps: 1000, ..cfg() }.build(&context(2)).is_ok());
}

#[test]
fn bad_options_are_refused() {
    let refused = |cfg: CameraCfg| cfg.build(&context(1)).unwrap_err();
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
    let error = refused(noise("mask", NoiseCfg::white(1.0))).to_string();
    assert!(error.starts_with("there is no channel that can have noise \"mask\"; known are "), "{error}");
    let error = refused(noise("dept", NoiseCfg::white(1.0))).to_string();
    assert!(error.starts_with("there is no channel that can have noise \"dept\"; known are \"depth\""), "{error}");
    let off = CameraCfg { channels: depth_only(), ..noise("color", NoiseCfg::white(1.0)) };
    assert!(matches!(refused(off), SensorError::UnknownName { .. }), "it does not measure that");
    let twice =
        [("depth", 1.0), ("distance_to_image_plane", 2.0)].map(|(name, std)| (name.to_string(), NoiseCfg::white(std)));
    let error = refused(CameraCfg { noise: twice.into(), ..cfg() }).to_string();
    assert_eq!(error, "the noise of \"depth\" is given by two names");
    let imperfections = Imperfections { holes: Some(Holes::default()), ..Imperfections::default() };
    let channels = Channels { color: true, ..Channels::default() };
    let error = refused(CameraCfg { imperfections, channels, ..cfg() }).to_string();
    assert_eq!(error, "the camera does not measure depth; it measures color");
    let extrinsics = Extrinsics { parent: Some("tip".into()), ..Extrinsics::default() };
    assert!(CameraCfg { extrinsics, ..troubled() }.build(&context(1)).is_ok(), "the control");
}
