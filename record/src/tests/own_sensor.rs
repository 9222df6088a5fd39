//! A sensor of another crate, recorded with its own columns, units and stamps.

use super::*;
use kinetoscope_scene::SceneState;
use kinetoscope_scene::StateFields;
use kinetoscope_sensors::{SampleChannel, Sampler, SamplingCfg, Sensor, SensorCfg, SensorContext, SensorError, Stamp};

const STEPS: usize = 6;

/// Tactile skin with two pads.
#[derive(Clone, Copy)]
struct SkinCfg;

#[derive(Debug)]
struct Skin {
    pads: Vec<String>,
    sampler: Sampler,
}

impl SensorCfg for SkinCfg {
    type Sensor = Skin;

    fn requires(&self) -> StateFields {
        StateFields::NONE
    }

    fn build(&self, context: &SensorContext) -> std::result::Result<Skin, SensorError> {
        let channels = [
            SampleChannel::new("pressures", 2).with_unit("Pa").with_stamp(Stamp::Force),
            SampleChannel::new("temperatures", 2).with_unit("K"),
            SampleChannel::noiseless("pad_counts", 1),
        ];
        let sampler = Sampler::new("skin", self.requires(), context, &SamplingCfg::default(), &channels)?;
        Ok(Skin { pads: ["left", "right"].map(String::from).into(), sampler })
    }
}

/// Numbers that differ in environment, step and column.
fn read(state: &SceneState, env: usize, row: &mut [f64]) {
    let base = 1000.0 * env as f64 + state.step[env] as f64;
    row.copy_from_slice(&[base + 0.1, base + 0.2, base + 300.3, base + 300.4, 2.0]);
}

impl Sensor for Skin {
    fn update(&mut self, state: &SceneState) -> std::result::Result<(), SensorError> {
        self.sampler.update(state, |env, row| read(state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> std::result::Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| read(state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> std::result::Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| read(state, env, row))
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }
}

impl Sampled for Skin {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    fn columns(&self) -> &[String] {
        &self.pads
    }
}

/// Stamps and values of a channel in environment 1, step by step.
type Measured = (Vec<f64>, Vec<Vec<f64>>);

/// Records a skin sensor; returns its pressures and temperatures.
fn record_skin(path: &Path) -> [Measured; 2] {
    let mut sim = falling(2);
    let skin = sim.add_sensor("skin", SkinCfg).unwrap();
    let mut measured: [Measured; 2] = Default::default();
    record(&mut sim, RecorderCfg::new(path), |sim| {
        for _ in 0..STEPS {
            sim.update(1);
            let skin = sim.sensor(skin).unwrap();
            let stamps = [skin.force_stamps()[1], skin.stamps()[1]];
            for (k, channel) in ["pressures", "temperatures"].into_iter().enumerate() {
                measured[k].0.push(stamps[k]);
                measured[k].1.push(skin.sampler.values(channel).row(1).to_vec());
            }
        }
    });
    // Forces are those of the beginning of the step.
    assert!(measured[0].0.iter().zip(&measured[1].0).all(|(force, state)| force < state));
    measured
}

#[test]
fn archive() {
    let (_folder, path) = scratch("run.npz");
    let measured = record_skin(&path);
    let about: Value = serde_json::from_slice(&member(&path, "recording.json")).unwrap();
    let stream = list(&about["streams"]).iter().find(|stream| stream["name"] == "skin").unwrap();
    assert_eq!(stream["columns"], json!(["left", "right"]));
    let arrays = json!([
        { "name": "skin/pressures", "shape": [2], "of_forces": true, "unit": "Pa" },
        { "name": "skin/temperatures", "shape": [2], "of_forces": false, "unit": "K" },
        { "name": "skin/pad_counts", "shape": [1], "of_forces": false },
    ]);
    assert_eq!(stream["arrays"], arrays);
    let recording = Recording::open(&path).unwrap();
    for (channel, (stamps, values)) in ["pressures", "temperatures"].into_iter().zip(measured) {
        for (column, pad) in ["left", "right"].into_iter().enumerate() {
            let wanted = FieldSelector::new("/env_1/skin", format!("{channel}[{pad}]"));
            let samples = recording.time_series(&[wanted]).unwrap().remove(0);
            assert_eq!(samples.values, values.iter().map(|row| row[column]).collect::<Vec<_>>(), "{channel} {pad}");
            assert_eq!(samples.times, stamps, "{channel} {pad}");
        }
    }
}

#[test]
fn messages_and_metadata() {
    let (_folder, path) = scratch("run.mcap");
    let measured = record_skin(&path);
    let all = messages(&path);
    for (channel, (stamps, values)) in ["pressures", "temperatures"].into_iter().zip(measured) {
        let found = messages_on(&all, &format!("/env_1/skin/{channel}"));
        assert_eq!(found.len(), STEPS);
        for (message, (stamp, values)) in found.into_iter().zip(stamps.into_iter().zip(values)) {
            assert!(message.time == nanos(stamp) && message.contains(&bytes(values)), "{channel}: {message:?}");
        }
    }
    let file = std::fs::read(&path).unwrap();
    for (channel, unit) in [("pressures", Some("Pa")), ("temperatures", Some("K")), ("pad_counts", None)] {
        let topic = format!("/env_1/skin/{channel}");
        let found = mcap::MessageStream::new(&file).unwrap().map(|message| message.unwrap().channel);
        let metadata = found.into_iter().find(|channel| channel.topic == topic).unwrap().metadata.clone();
        let wanted = [("rows", Some("left,right")), ("unit", unit)];
        let wanted = wanted.into_iter().filter_map(|(key, text)| Some((key.into(), text?.into())));
        assert_eq!(metadata, wanted.collect(), "{channel}");
    }
}
