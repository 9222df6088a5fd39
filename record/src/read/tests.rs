use super::*;
use crate::tests::*;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::worlds::{mjcf_robot, passive};

/// A mass of 1 kg that slides on a spring of 40 N/m, without friction.
const SPRING: &str = r#"<mujoco><worldbody><body name="cart" pos="0 0 1">
    <joint name="x" type="slide" axis="1 0 0" stiffness="40"/><geom type="sphere" size="0.1" mass="1"/></body></worldbody></mujoco>"#;
const STEPS: u32 = 300;

fn carts(names: &[&str]) -> SimulationManager {
    let mut sim = simulation(2);
    for name in names {
        let cart = sim.add_robot(passive(mjcf_robot(name, SPRING))).unwrap();
        sim.robot_mut(cart).write_qpos(&array![[0.3], [0.1]], None, None).unwrap();
    }
    sim
}

fn recorded(path: &Path, reset_at: Option<u32>) {
    record(&mut carts(&["cart"]), RecorderCfg::new(path), |sim| {
        for step in 0..STEPS {
            if reset_at == Some(step) {
                sim.reset(Some(&[EnvId(1)])).unwrap();
            }
            sim.update(1);
        }
    });
}

/// Exact solution of MuJoCo's Euler steps of length h for a spring: v' = v - h w² x and x' = x + h v' give x'' - 2 x' +
/// x = -(h w)² x', whose solution from rest at `start` is start (cos(k a) - tan(a/2) sin(k a)) with 2 cos(a) = 2 - (h
/// w)².
fn swing(start: f64, step: u32) -> f64 {
    let (h, w2) = (0.01_f64, 40.0);
    let a = (1.0 - 0.5 * h * h * w2).acos();
    let k = f64::from(step);
    start * ((k * a).cos() - (0.5 * a).tan() * (k * a).sin())
}

#[test]
fn spring() {
    let folder = tempfile::tempdir().unwrap();
    let mut all = Vec::new();
    for name in ["run.mcap", "run.npz"] {
        let path = folder.path().join(name);
        recorded(&path, None);
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.env_ids(), [0, 1]);
        let [first, second] = [None, Some(1)].map(|env| recording.topic("joint_states", env).unwrap());
        assert_eq!([&first.name, &second.name], ["/env_0/cart/joint_states", "/env_1/cart/joint_states"]);
        assert_eq!(first.count, u64::from(STEPS) + 1);
        let wanted = [first, second].map(|topic| FieldSelector::new(&topic.name, "position[x]"));
        let samples = recording.time_series(&wanted).unwrap();
        for (samples, start) in samples.iter().zip([0.3, 0.1]) {
            assert_eq!((samples.times.len(), samples.values.len()), (301, 301));
            for (step, (time, x)) in (0..).zip(samples.times.iter().zip(&samples.values)) {
                // Times are whole nanoseconds; each of 300 steps rounds numbers below 4 (velocities) to the last bit.
                assert!((time - 0.01 * f64::from(step)).abs() < 1e-9, "{name}: {time}");
                assert!((x - swing(start, step)).abs() < 1e-12, "{name}: {x} at step {step}");
            }
        }
        // Control: the comparison detects a spring that is 0.1 % stiffer.
        let off = (0..=STEPS).map(|k| (swing(0.3, k) - 0.3 * (0.01 * f64::from(k) * 40.04_f64.sqrt()).cos()).abs());
        assert!(off.fold(0.0, f64::max) > 1e-3);
        all.push(samples.into_iter().map(|samples| samples.values).collect::<Vec<_>>());
    }
    assert_eq!(all[0], all[1], "the same bits in both formats");
}

#[test]
fn reset() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| {
        let path = folder.path().join(name);
        recorded(&path, Some(100));
        let recording = Recording::open(&path).unwrap();
        let wanted = [0, 1].map(|env| FieldSelector::new(format!("/env_{env}/cart/joint_states"), "position[x]"));
        recording.time_series(&wanted).unwrap()
    };
    let [mcap, npz] = ["run.mcap", "run.npz"].map(read);
    for (a, b) in mcap.iter().zip(&npz) {
        assert_eq!(a.values, b.values);
        assert!(a.times.iter().zip(&b.times).all(|(a, b)| (a - b).abs() < 1e-9), "{:?}\n{:?}", a.times, b.times);
        assert!(a.times.is_sorted() && (a.times[a.times.len() - 1] - 3.0).abs() < 1e-6);
    }
    // The reset has a row of its own in its environment, with the time of the reset: two rows at 1 s.
    assert_eq!((npz[0].times.len(), npz[1].times.len()), (301, 302));
    assert!((npz[1].times[100] - 1.0).abs() < 1e-6 && (npz[1].times[101] - 1.0).abs() < 1e-6);
    assert_eq!(npz[1].values[101], 0.0, "a reset is to the initial state");
}

/// Errors list the candidates.
#[test]
fn unknown_names() {
    for name in ["run.mcap", "run.npz"] {
        let (_folder, path) = scratch(name);
        record(&mut carts(&["left", "right"]), RecorderCfg::new(&path), |sim| sim.update(3));
        let recording = Recording::open(&path).unwrap();
        assert_error(
            recording.topic("joint_states", None),
            "",
            &["/env_0/left/joint_states, /env_0/right/joint_states"],
        );
        assert_error(recording.topic("left/joint_state", None), "", &["known names: /left/joint_states"]);
        assert_error(recording.topic("left/joint_states", Some(2)), "", &["environment 2"]);
        assert_eq!(recording.topic("/left/joint_states", Some(1)).unwrap().name, "/env_1/left/joint_states");
        let wanted = |topic: &str, field: &str| recording.time_series(&[FieldSelector::new(topic, field)]);
        assert_error(wanted("/env_0/left/joint_states", "position[y]"), "", &["position[x]"]);
        assert_error(wanted("/env_9/left", "position[x]"), "UnknownName { what: \"topic\"", &[]);
    }
}

/// Root cause: the field was looked up in the topic that a short name finds, but the series was read under the short
/// name. An MCAP file gave an empty series, and an archive an error.
#[test]
fn short_topic_names() {
    for name in ["run.mcap", "run.npz"] {
        let (_folder, path) = scratch(name);
        record(&mut carts(&["cart"]), RecorderCfg::new(&path), |sim| (0..3).for_each(|_| sim.update(1)));
        let recording = Recording::open(&path).unwrap();
        let names = ["/env_0/cart/joint_states", "cart/joint_states", "/joint_states", "/env_1/cart/joint_states"];
        let wanted = names.map(|topic| FieldSelector::new(topic, "position[x]"));
        let series = recording.time_series(&wanted).unwrap();
        assert_eq!(series[0].values.len(), 4, "{name}");
        assert!(series[1] == series[0] && series[2] == series[0], "{name}: {series:?}");
        // Control: the other environment has other positions.
        assert_ne!(series[3], series[0], "{name}");
    }
}

#[test]
fn damaged_recordings() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.mcap", "run.npz"] {
        let path = folder.path().join(name);
        recorded(&path, None);
        let whole = std::fs::read(&path).unwrap();
        for end in [0, 5, 100, whole.len() / 2, whole.len() - 3] {
            std::fs::write(&path, &whole[..end]).unwrap();
            let error = Recording::open(&path).unwrap_err();
            assert!(matches!(error, RecordError::Malformed { .. }), "{name} {end}: {error}");
        }
        let mut damaged = whole.clone();
        let middle = whole.len() / 2;
        damaged[middle..middle + 16].iter_mut().for_each(|byte| *byte ^= 0x5a);
        std::fs::write(&path, &damaged).unwrap();
        // Archives are read on demand, so that damage is found when the damaged array is read.
        let all = |recording: Recording| {
            let fields = recording
                .topics()
                .iter()
                .flat_map(|of| of.fields.iter().map(|field| FieldSelector::new(&of.name, field)));
            recording.time_series(&fields.collect::<Vec<_>>())?;
            recording.attachment(crate::scene_file::SCENE_ARCHIVE)?;
            crate::replay::num_envs(&path)
        };
        assert_eq!(Recording::open(&path).is_err(), name == "run.mcap");
        assert!(matches!(Recording::open(&path).and_then(all), Err(RecordError::Malformed { .. })), "{name}");
        // Control: the undamaged file.
        std::fs::write(&path, &whole).unwrap();
        let all_of_it = Recording::open(&path).and_then(all);
        assert!(all_of_it.is_ok() || name == "run.mcap", "{all_of_it:?}");
    }
    for (name, words) in [("none.mcap", "No such file"), ("a.mcap.part", "recover"), ("a.bag", ".mcap or .npz")] {
        assert_error(Recording::open(folder.path().join(name)), "", &[words]);
    }
}

/// Root cause: for topics with the same fields in all messages, only the first message was read at opening. A later
/// damaged message made all reading fail.
#[test]
fn unreadable_messages() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("run.mcap"), folder.path().join("other.mcap"));
    recorded(&path, None);
    // A file of another program: two topics whose second and fourth messages are truncated, and one with only truncated
    // messages.
    let bytes = std::fs::read(&path).unwrap();
    let mut writer = ::mcap::Writer::new(std::fs::File::create(&other).unwrap()).unwrap();
    let mut seen = std::collections::BTreeMap::new();
    for message in ::mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        writer.write(&message).unwrap();
        for (id, of, topic, cuts) in [
            (97, "/env_0/tf", "/env_0/torn", &[2, 4][..]),
            (98, "/env_0/cart/joint_states", "/env_0/torn/joint_states", &[2, 4]),
            (99, "/env_0/tf", "/env_0/none", &[][..]),
        ] {
            if message.channel.topic == of {
                let number = seen.entry(topic).or_insert(0);
                *number += 1;
                let channel = ::mcap::Channel { id, topic: topic.into(), ..(*message.channel).clone() };
                let cut = cuts.is_empty() || cuts.contains(number);
                let data = message.data[..if cut { 10 } else { message.data.len() }].to_vec().into();
                writer.write(&::mcap::Message { channel: channel.into(), data, ..message.clone() }).unwrap();
            }
        }
    }
    writer.finish().unwrap();
    let all = u64::from(STEPS) + 1;
    assert!(seen.len() == 3 && seen.values().all(|count| *count == all), "{seen:?}");
    assert!(Recording::open(&path).unwrap().warnings().is_empty());
    let recording = Recording::open(&other).unwrap();
    let [none, torn, joints] = recording.warnings() else { panic!("{:?}", recording.warnings()) };
    assert!(none.contains("/env_0/none is left out") && none.contains("TFMessage"), "{none}");
    assert!(torn.contains("/env_0/torn lacks 2 of its 301 messages") && torn.contains("message 2"), "{torn}");
    assert!(joints.contains("/env_0/torn/joint_states lacks 2 of its 301 messages"), "{joints}");
    assert!(recording.topic("none", None).unwrap().fields.is_empty());
    let x = |topic: &str| FieldSelector::new(topic, "position[x]");
    let [whole, lacking] =
        &recording.time_series(&[x("/env_0/cart/joint_states"), x("/env_0/torn/joint_states")]).unwrap()[..]
    else {
        panic!("two series")
    };
    let own = Recording::open(&path).unwrap().time_series(&[x("/env_0/cart/joint_states")]).unwrap();
    assert_eq!(*whole, own[0]);
    let without = |all: &[f64]| all.iter().enumerate().filter(|(k, _)| ![1, 3].contains(k)).map(|(_, x)| *x).collect();
    assert_eq!(*lacking, TimeSeries { times: without(&whole.times), values: without(&whole.values) });
}

/// Root cause: fields of later messages were collected only for lists of structures. Joints of a second publisher on a
/// topic were unknown.
#[test]
fn two_publishers() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("run.mcap"), folder.path().join("other.mcap"));
    recorded(&path, None);
    // The joint states of two articulations, on one topic.
    let bytes = std::fs::read(&path).unwrap();
    let mut writer = ::mcap::Writer::new(std::fs::File::create(&other).unwrap()).unwrap();
    let mut names = std::collections::BTreeSet::new();
    for message in ::mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic.ends_with("/joint_states") {
            names.insert(message.channel.topic.clone());
            let channel = ::mcap::Channel { id: 97, topic: "/joint_states".into(), ..(*message.channel).clone() };
            writer.write(&::mcap::Message { channel: channel.into(), ..message }).unwrap();
        }
    }
    writer.finish().unwrap();
    let fields = |path: &Path, topic: &str| Recording::open(path).unwrap().topic(topic, None).unwrap().fields.clone();
    let mut expected: Vec<String> = names.iter().flat_map(|topic| fields(&path, topic)).collect();
    let mut found = fields(&other, "/joint_states");
    expected.sort();
    found.sort();
    expected.dedup();
    assert!(names.len() > 1, "{names:?}");
    assert_eq!(found, expected);
}
