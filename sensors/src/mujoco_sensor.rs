//! Sensors of the physics engine, declared in its models: MuJoCo's `<sensor>` elements.

use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampled, Sampler, SamplingCfg, Stamp};
use crate::schedule::Schedule;
use crate::select::{Selection, at_least_one, select};
use crate::sensor::{EngineSensor, Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::SceneState;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::pattern::closest_names;
use ndarray::{ArrayView2, ArrayView3, Axis, Slice};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;

/// Selection of MuJoCo's own sensors that a [`MujocoSensor`] reads, and their sampling.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MujocoSensorCfg {
    /// Name patterns of the sensors to read (`uid/sensor`, or `sensor` alone), in the order they are reported; `None`
    /// reads all.
    pub sensors: Option<Vec<String>>,
    /// Rate, history, latency, dropout and noise of the channel `values`; noise is rejected if one of the sensors is a
    /// quaternion.
    pub sampling: SamplingCfg,
}

/// Values of MuJoCo sensors in all environments. Shapes: N environments, D values, sensor by sensor.
///
/// Without noise, the values are MuJoCo's numbers, bit for bit. They refer to two instants, as all states do. Sensors
/// of positions and velocities are captured at [`Sampled::stamps`]. Sensors of accelerations and forces
/// ([`EngineSensor::force_stage`]) are captured at [`Sampled::force_stamps`], one step of the engine earlier. After a
/// reset or a write to the state, both refer to the current state. [`SampleChannel::stamp`] of the only channel
/// `values` is [`Stamp::Force`] if all sensors are of accelerations and forces, else [`Stamp::State`].
#[derive(Clone, Debug)]
pub struct MujocoSensor {
    sensors: Vec<EngineSensor>,
    names: Vec<String>,
    columns: Vec<Range<usize>>,
    sampler: Sampler,
}

impl SensorCfg for MujocoSensorCfg {
    type Sensor = MujocoSensor;

    fn requires(&self) -> StateFields {
        StateFields::SENSORDATA
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// # Errors
    ///
    /// A pattern that matches nothing, a sensor that two patterns match, an empty selection, a scene without MuJoCo
    /// sensors, or an invalid sampling configuration, such as noise on quaternions.
    fn build(&self, context: &SensorContext) -> Result<MujocoSensor, SensorError> {
        let known: Vec<String> = context.engine_sensors.iter().map(|s| s.name.clone()).collect();
        let chosen = match &self.sensors {
            Some(patterns) => select(patterns, &known, "MuJoCo sensor")?,
            None => (0..known.len()).collect(),
        };
        at_least_one(chosen.len(), Selection { sensor: "MuJoCo", field: "sensors", what: "MuJoCo sensor" }, &known)?;
        let sensors: Vec<EngineSensor> = chosen.iter().map(|&s| context.engine_sensors[s].clone()).collect();
        let mut columns = Vec::with_capacity(sensors.len());
        let mut width = 0;
        for sensor in &sensors {
            columns.push(width..width + sensor.width);
            width += sensor.width;
        }
        let noisy = !sensors.iter().any(|s| s.is_quaternion);
        // All values are one channel: a mix of both kinds is stamped as positions.
        let stamp = if sensors.iter().all(|s| s.force_stage) { Stamp::Force } else { Stamp::State };
        let channels = [SampleChannel {
            noisy,
            ..SampleChannel::new("values", width).with_unit(unit(&sensors)).with_stamp(stamp)
        }];
        Ok(MujocoSensor {
            names: sensors.iter().map(|s| s.name.clone()).collect(),
            sensors,
            columns,
            sampler: Sampler::new("MuJoCo", self.requires(), context, &self.sampling, &channels)?,
        })
    }
}

/// Returns the common unit of all sensors, or else all units, separated by commas; an unknown unit is empty.
fn unit(sensors: &[EngineSensor]) -> String {
    let units: Vec<&str> = sensors.iter().map(|s| s.unit.as_deref().unwrap_or_default()).collect();
    match units.as_slice() {
        [first, rest @ ..] if rest.iter().all(|unit| unit == first) => (*first).into(),
        _ => units.join(","),
    }
}

/// Writes the measurement of environment `env` to `row`.
fn read(sensors: &[EngineSensor], state: &SceneState, env: usize, row: &mut [f64]) {
    let Some(values) = &state.sensordata else { return };
    let values = sensors.iter().flat_map(|s| (s.first..s.first + s.width).map(|k| values[(env, k)]));
    row.iter_mut().zip(values).for_each(|(number, value)| *number = value);
}

impl Sensor for MujocoSensor {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| read(&self.sensors, state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| read(&self.sensors, state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| read(&self.sensors, state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }
}

/// Writes a summary of several lines.
impl fmt::Display for MujocoSensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        summary::write_sampled(f, "MuJoCo's own sensors", &self.sampler, &[("sensors", &summary::list(&self.names))])
    }
}

impl Sampled for MujocoSensor {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    fn columns(&self) -> &[String] {
        &self.names
    }
}

impl MujocoSensor {
    /// The sensors in the order of their columns, with name, type, unit and instant.
    pub fn sensors(&self) -> &[EngineSensor] {
        &self.sensors
    }

    /// Names of the sensors, `uid/sensor`.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of values of each sensor.
    pub fn dims(&self) -> Vec<usize> {
        self.columns.iter().map(ExactSizeIterator::len).collect()
    }

    /// Unit of each sensor, `1` for numbers without a unit; `None` if the unit depends on the observed quantity and is
    /// unknown.
    pub fn units(&self) -> Vec<Option<&str>> {
        self.sensors.iter().map(|s| s.unit.as_deref()).collect()
    }

    /// Range of the sensor `name` on the axis D: `name` is the full name, or the part after the first slash.
    ///
    /// # Errors
    ///
    /// A name that matches none or several of the sensors; the error lists candidates.
    pub fn columns_of(&self, name: &str) -> Result<Range<usize>, SensorError> {
        let bare = |full: &str| full.split_once('/').is_some_and(|(_, rest)| rest == name);
        let exact = self.names.iter().position(|full| full == name);
        let matches: Vec<usize> = match exact {
            Some(index) => vec![index],
            None => (0..self.names.len()).filter(|&i| bare(&self.names[i])).collect(),
        };
        match matches.as_slice() {
            [index] => Ok(self.columns[*index].clone()),
            [] => Err(SensorError::UnknownName {
                what: "MuJoCo sensor",
                name: name.into(),
                candidates: closest_names(name, self.names.iter().map(String::as_str))
                    .into_iter()
                    .map(Into::into)
                    .collect(),
            }),
            several => Err(SensorError::AmbiguousName {
                what: "MuJoCo sensor",
                name: name.into(),
                candidates: several.iter().map(|&i| self.names[i].clone()).collect(),
            }),
        }
    }

    /// Values of all sensors, shape (N, D).
    pub fn values(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("values")
    }

    /// Values of the sensor `name`, shape (N, number of its values).
    ///
    /// # Errors
    ///
    /// Same as [`columns_of`](Self::columns_of).
    pub fn value(&self, name: &str) -> Result<ArrayView2<'_, f64>, SensorError> {
        let columns = self.columns_of(name)?;
        let mut values = self.values();
        values.slice_axis_inplace(Axis(1), Slice::from(columns));
        Ok(values)
    }

    /// History of the values, newest first, shape \[num_envs, history_length, D\]; 0 where not filled yet.
    pub fn value_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("values")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::NoiseCfg;
    use ndarray::{Array2, array};
    use std::collections::BTreeMap;

    fn context() -> SensorContext {
        let sensor = |name: &str, kind: &str, first, width, force_stage| EngineSensor {
            name: name.into(),
            kind: kind.into(),
            unit: Some("m".into()),
            first,
            width,
            force_stage,
            is_quaternion: kind == "framequat",
        };
        let engine_sensors = [
            sensor("a/pos", "framepos", 0, 3, false),
            sensor("a/quat", "framequat", 3, 4, false),
            sensor("b/pos", "framepos", 7, 3, false),
            sensor("b/touch", "touch", 10, 1, true),
        ];
        SensorContext { num_envs: 2, dt: 0.01, engine_sensors: engine_sensors.into(), ..SensorContext::default() }
    }

    fn state() -> SceneState {
        let values = Array2::from_shape_fn((2, 11), |(env, k)| 100.0 * env as f64 + k as f64);
        SceneState { sensordata: Some(values), ..SceneState::new(2) }
    }

    fn cfg(patterns: &[&str]) -> MujocoSensorCfg {
        let sensors = Some(patterns.iter().map(|p| (*p).into()).collect());
        MujocoSensorCfg { sensors, ..Default::default() }
    }

    #[test]
    fn values() {
        let mut sensor = cfg(&["b/touch", "pos"]).build(&context()).unwrap();
        sensor.reset(&[0, 1], &state()).unwrap();
        assert_eq!(sensor.names(), ["b/touch", "a/pos", "b/pos"]);
        assert_eq!((sensor.dims().to_vec(), sensor.units().to_vec()), (vec![1, 3, 3], vec![Some("m"); 3]));
        assert_eq!(sensor.values().row(1).to_vec(), [110.0, 100.0, 101.0, 102.0, 107.0, 108.0, 109.0]);
        assert_eq!(sensor.value("touch").unwrap(), array![[10.0], [110.0]]);
        assert_eq!(sensor.value("b/pos").unwrap(), array![[7.0, 8.0, 9.0], [107.0, 108.0, 109.0]]);
        let error = sensor.value("pos").unwrap_err().to_string();
        assert!(error.contains("\"a/pos\", \"b/pos\""), "{error}");
        let error = sensor.value("b/tuch").unwrap_err().to_string();
        assert!(error.starts_with("unknown MuJoCo sensor \"b/tuch\"; known names: \"b/touch\""), "{error}");
    }

    #[test]
    fn mistakes() {
        let wrong = |cfg: MujocoSensorCfg| cfg.build(&context()).unwrap_err().to_string();
        // Root cause: an empty list was accepted, which created a sensor without values.
        let nothing = "the MuJoCo sensor has nothing to measure: no MuJoCo sensor is selected by sensors; known names: \"a/pos\",";
        assert!(wrong(cfg(&[])).starts_with(nothing), "{}", wrong(cfg(&[])));
        let without_sensors = SensorContext { engine_sensors: [].into(), ..context() };
        let error = MujocoSensorCfg::default().build(&without_sensors).unwrap_err();
        assert!(matches!(&error, SensorError::EmptySelection { candidates, .. } if candidates.is_empty()), "{error}");
        assert!(wrong(cfg(&["pso"])).starts_with("unknown MuJoCo sensor \"pso\"; known names: \"pos\""));
        assert!(wrong(cfg(&["a/.*", "pos"])).contains("matched by both"));
        let noise = BTreeMap::from([("values".to_string(), NoiseCfg::default())]);
        let noisy = |patterns| MujocoSensorCfg {
            sampling: SamplingCfg { noise: noise.clone(), ..SamplingCfg::default() },
            ..cfg(patterns)
        };
        assert!(noisy(&["pos"]).build(&context()).is_ok());
        assert!(noisy(&["quat"]).build(&context()).is_err(), "a noisy quaternion is no longer a rotation");
        // A state of another scene.
        let mut sensor = MujocoSensorCfg::default().build(&context()).unwrap();
        let short = SceneState { sensordata: Some(Array2::zeros((2, 10))), ..SceneState::new(2) };
        assert!(sensor.update(&short).unwrap_err().to_string().contains("values of MuJoCo sensors"));
        assert!(sensor.update(&SceneState::new(2)).unwrap_err().to_string().contains("sensordata"));
    }
}
