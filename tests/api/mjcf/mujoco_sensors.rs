//! MuJoCo's own sensors: its numbers, bit for bit, and what they must be.

use super::{empty, machine};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{Data, Overflow};

/// What decides how MuJoCo goes on.
fn data_of(sim: &SimulationManager, ctrl: &[f64]) -> Data {
    let buffers = sim.batch().read(0, |env| env.data().model().buffers());
    let buffers = buffers.enlarged(Overflow::Contacts).enlarged(Overflow::Constraints);
    let mut data = Data::new(&sim.batch().model().with_buffers(buffers)).unwrap();
    data.ctrl_mut().copy_from_slice(ctrl);
    data
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// `mj_step` leaves all sensors of the state before it; here positions and velocities are of the state after it. Stepped
/// side by side, every value has the same bits: what is solved those of this `mj_step`, the rest those of the next.
#[test]
fn values_are_mujocos_bit_for_bit() {
    const STEPS: usize = 200;
    let controls = array![[0.4, -0.3, 0.8], [0.1, 0.2, 0.3]];
    let mut sim = empty(2);
    let part = sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    let id = sim.add_sensor("all", MujocoSensorCfg::default()).unwrap();
    sim.mjcf_part_mut(part).set_ctrl(&controls, None, None).unwrap();
    assert_eq!(sim.sensor(id).unwrap().names().len(), 19);
    let mut plain: Vec<Data> = controls.rows().into_iter().map(|row| data_of(&sim, row.as_slice().unwrap())).collect();
    plain.iter_mut().for_each(|data| data.step().unwrap());
    let (mut checked, mut differs) = ([0, 0], 0);
    for step in 0..STEPS {
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        for (env, data) in plain.iter_mut().enumerate() {
            assert!((sensor.stamps()[env] - sensor.force_stamps()[env] - 0.002).abs() < 1e-12);
            let then = data.sensordata().to_vec();
            data.step().unwrap();
            let now = data.sensordata();
            for (one, name) in sensor.sensors().iter().zip(sensor.names()) {
                let range = one.first..one.first + one.width;
                let (expected, other) = if one.solved { (&then[..], now) } else { (now, &then[..]) };
                let values: Vec<f64> = sensor.columns(name).unwrap().map(|c| sensor.values()[(env, c)]).collect();
                let expected = &expected[range.clone()];
                assert_eq!(bits(&values), bits(expected), "{name} after {step}: {values:?} {expected:?}");
                checked[usize::from(one.solved)] += 1;
                differs += usize::from(bits(&values) != bits(&other[range]));
            }
        }
    }
    assert!(checked[0] > 10 * STEPS && checked[1] > 10 * STEPS, "{checked:?}");
    // The other instant gives other numbers: the comparison can fail.
    assert!(differs > 20 * STEPS, "{differs} of {checked:?}");
}

/// A write is seen at once, by sensors of forces too, and all of them are of the state as it is.
#[test]
fn nothing_stale_is_read_after_a_write() {
    let mut sim = empty(2);
    let part = sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    let id = sim.add_sensor("all", MujocoSensorCfg::default()).unwrap();
    let at_start = sim.sensor(id).unwrap().values().to_owned();
    let mut plain = data_of(&sim, &[0.0; 3]);
    plain.forward().unwrap();
    assert_eq!(bits(&at_start.row(0).to_vec()), bits(plain.sensordata()), "before any step");
    sim.update(40);
    let (mut qpos, qvel) = (sim.mjcf_part(part).get_qpos(), sim.mjcf_part(part).get_qvel());
    qpos[(1, 0)] += 0.3;
    let before = sim.sensor(id).unwrap().values().to_owned();
    sim.mjcf_part_mut(part).write_qpos(&qpos, None).unwrap();
    let sensor = sim.sensor(id).unwrap();
    for env in 0..2 {
        assert_eq!(sensor.stamps()[env], sensor.force_stamps()[env]);
        plain.qpos_mut().copy_from_slice(&qpos.row(env).to_vec());
        plain.qvel_mut().copy_from_slice(&qvel.row(env).to_vec());
        sim.batch().read(env, |env| {
            plain.act_mut().copy_from_slice(env.data().act());
            plain.qacc_warmstart_mut().copy_from_slice(env.data().qacc_warmstart());
            plain.set_time(env.data().time());
        });
        plain.forward().unwrap();
        // Quaternions were normalised once more: the last bits of positions, times the stiffest contact (1e6 N/m).
        for (value, expected) in sensor.values().row(env).iter().zip(plain.sensordata()) {
            assert!((value - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{value} is not {expected}");
        }
    }
    assert!(
        (sensor.value("angle").unwrap()[(1, 0)] - before[(1, sensor.columns("angle").unwrap().start)] - 0.3).abs()
            < 1e-9
    );
    sim.reset(Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.sensor(id).unwrap().values().row(1), at_start.row(1));
}

#[test]
fn names_dims_and_units_are_those_of_the_types() {
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    let patterns = ["acc", "touch", "angle", "speed", "turn", "length", "sensor13", "clock"];
    let cfg = MujocoSensorCfg { sensors: Some(patterns.map(Into::into).to_vec()), ..Default::default() };
    let id = sim.add_sensor("some", cfg).unwrap();
    let sensor = sim.sensor(id).unwrap();
    assert_eq!(sensor.names()[6], "m/sensor13", "one without a name");
    assert_eq!(sensor.dims(), [3, 1, 1, 1, 4, 1, 4, 1]);
    let units = [Some("m/s²"), Some("N"), Some("rad"), Some("m/s"), Some("1"), None, Some("1"), Some("s")];
    assert_eq!(sensor.units(), units);
    assert_eq!(sensor.values().dim(), (1, 16));
    let kinds: Vec<&str> = sensor.sensors().iter().map(|s| s.kind.as_ref()).collect();
    assert_eq!(kinds[..4], ["accelerometer", "touch", "jointpos", "jointvel"]);
    let wrong = MujocoSensorCfg { sensors: Some(vec!["accc".into()]), ..Default::default() };
    let text = sim.add_sensor("wrong", wrong).unwrap_err().to_string();
    assert!(text.contains("\"acc\""), "{text}");
}

/// A block of 2 kg that stands on the ground, a lamp of 0.3 kg that hangs in the world.
const AT_REST: &str = r#"<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="block" pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="2"/>
    <site name="block" type="box" size="0.11 0.11 0.11"/></body>
  <body name="ceiling" pos="1 0 2">
    <body name="lamp" pos="0 0 -0.2"><geom type="sphere" size="0.05" mass="0.3" pos="0.1 0 -0.4"/><site name="mount"/></body>
  </body></worldbody>
  <sensor><accelerometer name="acc" site="block"/><touch name="touch" site="block"/><gyro name="gyro" site="block"/>
    <force name="force" site="mount"/><torque name="torque" site="mount"/>
    <framepos name="pos" objtype="site" objname="mount"/></sensor></mujoco>"#;

/// At rest an accelerometer reads +g, what touches carries the weight, and a mount holds force and torque of its load.
#[test]
fn readings_at_rest_are_closed_forms() {
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("rest", AT_REST)).unwrap();
    let id = sim.add_sensor("all", MujocoSensorCfg::default()).unwrap();
    let near = |found: Vec<f64>, expected: &[f64], within: f64| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < within), "{found:?} is not {expected:?}");
    };
    let g = 9.81;
    let value = |sim: &SimulationManager, name: &str| sim.sensor(id).unwrap().value(name).unwrap().row(0).to_vec();
    // Statics of the mount are exact from the start: weight in the centre of the lamp, 0.1 m along x. MuJoCo gives what the
    // lamp exerts on the ceiling's side as the force that holds it: up, and r x F = (0.1, 0, -0.4) x (0, 0, m g).
    let weight = 0.3 * g;
    near(value(&sim, "force"), &[0.0, 0.0, weight], 1e-12);
    near(value(&sim, "torque"), &[0.0, -0.1 * weight, 0.0], 1e-12);
    near(value(&sim, "pos"), &[1.0, 0.0, 1.8], 1e-15);
    // The block sinks into its soft contact for some tenths of a second (time constant 20 ms): after 2 s it stands.
    sim.update(1000);
    near(value(&sim, "acc"), &[0.0, 0.0, g], 1e-6);
    near(value(&sim, "gyro"), &[0.0; 3], 1e-6);
    near(value(&sim, "touch"), &[2.0 * g], 1e-5);
    // Thrown up it falls freely: nothing is felt, and nothing touches.
    let qvel = Array2::from_shape_fn((1, 6), |(_, k)| if k == 2 { 3.0 } else { 0.0 });
    let part = sim.mjcf_id("rest").unwrap();
    sim.mjcf_part_mut(part).write_qvel(&qvel, None).unwrap();
    sim.update(100);
    near(value(&sim, "acc"), &[0.0; 3], 1e-9);
    near(value(&sim, "touch"), &[0.0], 1e-12);
}

/// Environments that are told different things read the same bits, whoever steps them.
#[test]
fn threads_change_no_bit() {
    let run = |threads| {
        let cfg = SimulationManagerCfg { num_envs: 5, threads: Some(threads), physics_dt: 0.002, ..Default::default() };
        let mut sim = SimulationManager::new(cfg).unwrap();
        let part = sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
        let id = sim.add_sensor("all", MujocoSensorCfg::default()).unwrap();
        let controls = Array2::from_shape_fn((5, 3), |(env, k)| 0.1 * env as f64 - 0.2 * k as f64);
        sim.mjcf_part_mut(part).set_ctrl(&controls, None, None).unwrap();
        sim.update(150);
        let values = sim.sensor(id).unwrap().values().to_owned();
        (sim.mjcf_part(part).get_qpos(), values)
    };
    let ((qpos, values), (other_qpos, other_values)) = (run(1), run(3));
    assert_eq!(bits(qpos.as_slice().unwrap()), bits(other_qpos.as_slice().unwrap()));
    assert_eq!(bits(values.as_slice().unwrap()), bits(other_values.as_slice().unwrap()));
    assert_ne!(qpos.row(0), qpos.row(1));
}

/// Rate, history and resets are those of all sensors.
#[test]
fn samples_come_at_their_rate() {
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    let sampling = SamplingCfg { history_length: 3, ..SamplingCfg::every(0.01) };
    let id = sim.add_sensor("angle", MujocoSensorCfg { sensors: Some(vec!["angle".into()]), sampling }).unwrap();
    let mut angles = Vec::new();
    for step in 1..=23_u32 {
        sim.update(1);
        if step % 5 == 0 {
            angles.push(sim.mjcf_part(sim.mjcf_id("m").unwrap()).get_qpos()[(0, 0)]);
        }
    }
    let sensor = sim.sensor(id).unwrap();
    assert_eq!(sensor.sample_counts()[0], 4);
    assert_eq!(sensor.values()[(0, 0)], angles[3]);
    let history: Vec<f64> = (0..3).map(|age| sensor.value_history()[(0, age, 0)]).collect();
    assert_eq!(history, [angles[3], angles[2], angles[1]]);
    sim.reset(None).unwrap();
    assert_eq!(sim.sensor(id).unwrap().sample_counts()[0], 0);
}
