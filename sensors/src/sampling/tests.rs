//! Tests of latency, dropout and noise: exact values, or statistical bounds.

use super::*;
use ndarray::array;

const DT: f64 = 0.005;

fn context(num_envs: usize) -> SensorContext {
    SensorContext { num_envs, dt: DT, name: "encoder".into(), seed: 42, ..SensorContext::default() }
}

fn try_built(context: &SensorContext, cfg: &SamplingCfg) -> Result<Sampler, SensorError> {
    let channels = [SampleChannel::new("a", 1), SampleChannel::new("b", 2), SampleChannel::noiseless("n", 1)];
    Sampler::new("encoder", StateFields::NONE, context, cfg, &channels)
}

fn sampler(num_envs: usize, cfg: &SamplingCfg) -> Sampler {
    try_built(&context(num_envs), cfg).unwrap()
}

fn state(steps: &[u64]) -> SceneState {
    SceneState {
        step: steps.to_vec(),
        time: steps.iter().map(|&s| s as f64).collect(),
        force_time: steps.iter().map(|&s| s as f64 - 0.5).collect(),
        ..SceneState::new(steps.len())
    }
}

/// Measures zeros, so that all values are noise.
fn zeros(_env: usize, _row: &mut [f64]) {}

impl Sampled for Sampler {
    fn sampler(&self) -> &Sampler {
        self
    }
}

/// Measures the step.
fn step(sampler: &mut Sampler, steps: &[u64]) {
    sampler.update(&state(steps), |env, row| row.fill(steps[env] as f64)).unwrap();
}

fn reset(sampler: &mut Sampler, envs: &[usize], steps: &[u64]) {
    sampler.reset(envs, &state(steps), |env, row| row.fill(steps[env] as f64)).unwrap();
}

/// A measurement can be read exactly `latency_steps` after its capture.
#[test]
fn latency() {
    for (period, latency) in [(1, 1), (1, 7), (4, 1), (4, 3), (4, 4), (4, 5), (4, 9), (3, 100)] {
        let cfg = SamplingCfg { latency_steps: latency, history_length: 3, ..SamplingCfg::every(period as f64 * DT) };
        let mut sampler = sampler(1, &cfg);
        reset(&mut sampler, &[0], &[0]);
        for now in 1..=150 {
            step(&mut sampler, &[now]);
            // The newest capture that is old enough.
            let arrived = now.saturating_sub(latency.into()) / period;
            let captured = (arrived * period) as f64;
            assert_eq!(sampler.sample_counts()[0], arrived, "period {period}, latency {latency}, step {now}");
            assert_eq!((sampler.values("b"), sampler.stamps()[0]), (array![[captured, captured]].view(), captured));
            assert_eq!(sampler.history_filled(0), arrived.min(3) as usize);
            for age in 0..sampler.history_filled(0) {
                let expected = captured - (age as u64 * period) as f64;
                let stamps = (sampler.stamp_history()[(0, age)], sampler.force_stamp_history()[(0, age)]);
                assert_eq!((sampler.history("a")[(0, age, 0)], stamps), (expected, (expected, expected - 0.5)));
            }
        }
    }
}

/// Measurements in flight at a write are delivered one after the other, in the history and in `latest_delivered`. Those from
/// before the write do not replace the written value.
#[test]
fn refresh() {
    let read = |s: &Sampler| {
        (s.latest_delivered("b")[(0, 1)], s.latest_delivered_stamps()[0], s.values("b")[(0, 1)], s.stamps()[0])
    };
    let mut sampler = sampler(1, &SamplingCfg { latency_steps: 4, ..SamplingCfg::default() });
    reset(&mut sampler, &[0], &[0]);
    for now in 1..=15 {
        step(&mut sampler, &[now]);
        if now == 6 {
            sampler.refresh(&[0], &state(&[6]), |_, row| row.fill(100.0)).unwrap();
        }
        let captured = now.saturating_sub(4) as f64;
        let (shown, stamp) = if (6..=10).contains(&now) { (100.0, 6.0) } else { (captured, captured) };
        assert_eq!(read(&sampler), (captured, captured, shown, stamp), "step {now}");
        assert_eq!(sampler.latest_delivered_force_stamps()[0], captured - 0.5);
    }
    // Without a latency nothing is in flight: both are the same.
    let mut sampler = self::sampler(1, &SamplingCfg::default());
    step(&mut sampler, &[3]);
    assert_eq!(read(&sampler), (3.0, 3.0, 3.0, 3.0));
    // With a period and a history.
    let cfg = SamplingCfg { latency_steps: 4, history_length: 9, ..SamplingCfg::every(2.0 * DT) };
    let mut sampler = self::sampler(1, &cfg);
    for now in 1..=12 {
        step(&mut sampler, &[now]);
        match now {
            6 => sampler.refresh(&[0], &state(&[6]), |_, row| row.fill(-1.0)).unwrap(),
            7..12 => assert_eq!((sampler.values("a")[(0, 0)], sampler.stamps()[0]), (-1.0, 6.0), "step {now}"),
            12 => assert_eq!(sampler.values("a")[(0, 0)], 8.0),
            _ => {}
        }
        if now == 11 {
            assert_eq!(sampler.history("a").iter().take(4).copied().collect::<Vec<_>>(), [6.0, 4.0, 2.0, 0.0]);
        }
    }
}

/// An owner that updates only at due steps gets the same values at every step.
#[test]
fn due() {
    let cfg = SamplingCfg { latency_steps: 5, ..SamplingCfg::every(4.0 * DT) };
    let (mut lazy, mut eager) = (sampler(2, &cfg), sampler(2, &cfg));
    reset(&mut lazy, &[0, 1], &[0, 2]);
    reset(&mut eager, &[0, 1], &[0, 2]);
    let (mut updates, mut next) = (0, lazy.due_in(&[0, 2]));
    for now in 1..=100 {
        step(&mut eager, &[now, now + 2]);
        if now == next {
            step(&mut lazy, &[now, now + 2]);
            updates += 1;
            next = now + lazy.due_in(&[now, now + 2]);
        }
        assert_eq!(lazy.values("b"), eager.values("b"), "step {now}");
        assert_eq!(lazy.sample_counts(), eager.sample_counts());
    }
    // Captures at 4, 8, .., 100 and deliveries at 9, 13, .., 97.
    assert_eq!(updates, 25 + 23);
}

/// A reset drops measurements in flight.
#[test]
fn resets() {
    let cfg = SamplingCfg { latency_steps: 6, ..SamplingCfg::every(2.0 * DT) };
    let mut sampler = sampler(2, &cfg);
    (1..=9).for_each(|now| step(&mut sampler, &[now, now]));
    assert_eq!(sampler.sample_counts(), array![1, 1]);
    reset(&mut sampler, &[1], &[9, 0]);
    for k in 1..=7 {
        step(&mut sampler, &[9 + k, k]);
        assert_eq!((sampler.values("a")[(1, 0)], sampler.sample_counts()[1]), (0.0, 0));
    }
    step(&mut sampler, &[17, 8]);
    assert_eq!((sampler.values("a"), sampler.sample_counts()), (array![[10.0], [2.0]].view(), array![5, 1].view()));
}

/// A lost measurement is never delivered. The standard deviation of the lost fraction of n is sqrt(p (1 - p) / n); the
/// bound is six times that.
#[test]
fn dropout() {
    let mut sampler = sampler(1, &SamplingCfg { dropout: 0.3, history_length: 2, ..SamplingCfg::default() });
    let (mut before, mut lost, n) = (0.0, 0, 20_000);
    for now in 1..=n {
        step(&mut sampler, &[now]);
        let value = sampler.values("a")[(0, 0)];
        assert!(value == now as f64 || value == before);
        lost += u64::from(value == before);
        assert_eq!((sampler.stamps()[0], sampler.sample_counts()[0]), (value, now - lost));
        assert_eq!(sampler.history("a")[(0, 0, 0)], value);
        before = value;
    }
    assert!((lost as f64 / n as f64 - 0.3).abs() < 6.0 * (0.3 * 0.7 / n as f64).sqrt(), "{lost}");
    let mut sampler = self::sampler(1, &SamplingCfg { dropout: 1.0, ..SamplingCfg::default() });
    (1..100).for_each(|now| step(&mut sampler, &[now]));
    assert_eq!((sampler.sample_counts()[0], sampler.values("a")[(0, 0)]), (0, 0.0));
}

fn with_noise(channel: &str, noise: NoiseCfg) -> SamplingCfg {
    SamplingCfg { noise: [(channel.to_string(), noise)].into(), ..SamplingCfg::default() }
}

/// Bounds are six standard deviations: std / sqrt(n) for the mean of n numbers, std / sqrt(2 n) for their standard
/// deviation.
#[track_caller]
fn assert_normal(values: &[f64], std: f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let found = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    assert!(mean.abs() < 6.0 * std / n.sqrt(), "mean {mean} of {n} numbers with std {std}");
    assert!((found - std).abs() < 6.0 * std / (2.0 * n).sqrt(), "std {found} instead of {std}");
}

/// White noise has its mean and deviation, affects only its channel, and is independent between environments.
#[test]
fn white_noise() {
    let mut sampler = sampler(2, &with_noise("b", NoiseCfg::white(0.2)));
    let mut values = [Vec::new(), Vec::new()];
    for now in 1..=20_000 {
        sampler.update(&state(&[now, now]), zeros).unwrap();
        for (env, values) in values.iter_mut().enumerate() {
            values.push(sampler.values("b")[(env, 0)]);
            assert_ne!(values.last(), Some(&sampler.values("b")[(env, 1)]), "each number for itself");
        }
        assert!(sampler.values("a").iter().chain(sampler.values("n")).all(|&v| v == 0.0));
    }
    let product: f64 = values[0].iter().zip(&values[1]).map(|(a, b)| a * b / 0.04).sum();
    let n = values[0].len() as f64;
    assert!((product / n).abs() < 6.0 / n.sqrt(), "environments are not correlated");
    values.iter().for_each(|values| assert_normal(values, 0.2));
}

/// After t seconds, the walk of `bias_walk` per sqrt(s) has the standard deviation `bias_walk * sqrt(t)`, whatever the
/// period. A reset samples the bias again.
#[test]
fn biases() {
    let n = 4000;
    let all: Vec<usize> = (0..n).collect();
    let values = |sampler: &Sampler| sampler.values("a").column(0).to_vec();
    for period in [1, 5] {
        let noise = NoiseCfg { bias_std: 0.5, bias_walk: 0.3, ..NoiseCfg::default() };
        let cfg = SamplingCfg { update_period: period as f64 * DT, ..with_noise("a", noise) };
        let mut sampler = sampler(n, &cfg);
        sampler.reset(&all, &state(&vec![0; n]), zeros).unwrap();
        let at_reset = values(&sampler);
        assert_normal(&at_reset, 0.5);
        sampler.refresh(&all, &state(&vec![0; n]), zeros).unwrap();
        assert_eq!(values(&sampler), at_reset, "a refresh lets no time pass");
        (1..=200).for_each(|now| sampler.update(&state(&vec![now; n]), zeros).unwrap());
        let walked: Vec<f64> = values(&sampler).iter().zip(&at_reset).map(|(now, then)| now - then).collect();
        assert_normal(&walked, 0.3 * (200.0 * DT).sqrt());
        sampler.reset(&all, &state(&vec![0; n]), zeros).unwrap();
        assert_normal(&values(&sampler), 0.5);
        assert_ne!(values(&sampler), at_reset);
    }
}

#[test]
fn resolution() {
    let noise = NoiseCfg { resolution: 0.25, ..NoiseCfg::default() };
    let mut sampler = sampler(1, &with_noise("a", noise));
    for (k, (value, expected)) in [(0.1, 0.0), (0.13, 0.25), (-1.4, -1.5), (7.0, 7.0)].into_iter().enumerate() {
        sampler.update(&state(&[k as u64 + 1]), |_, row| row[0] = value).unwrap();
        assert_eq!(sampler.values("a")[(0, 0)], expected);
    }
}

/// Noise depends on seed, environment and name only: environment 5 of a simulation equals environment 2 of a shard that
/// begins at 3.
#[test]
fn first_env() {
    let noise = NoiseCfg { std: 0.1, bias_std: 1.0, bias_walk: 0.1, resolution: 0.0 };
    let cfg = SamplingCfg { dropout: 0.2, ..with_noise("a", noise) };
    let run = |context: SensorContext, env: usize| -> Vec<u64> {
        let n = context.num_envs;
        let mut sampler = try_built(&context, &cfg).unwrap();
        sampler.reset(&(0..n).collect::<Vec<_>>(), &state(&vec![0; n]), zeros).unwrap();
        let mut read = |now| {
            sampler.update(&state(&vec![now; n]), zeros).unwrap();
            sampler.values("a")[(env, 0)].to_bits()
        };
        (1..=50).map(&mut read).collect()
    };
    let reference = run(context(8), 5);
    assert_eq!(run(context(6), 5), reference);
    assert_eq!(run(SensorContext { first_env: 3, ..context(4) }, 2), reference);
    assert_ne!(run(context(8), 4), reference);
    assert_ne!(run(SensorContext { seed: 43, ..context(8) }, 5), reference);
    assert_ne!(run(SensorContext { name: "other".into(), ..context(8) }, 5), reference);
}

#[test]
fn mistakes() {
    let wrong = |cfg: SamplingCfg| try_built(&context(2), &cfg).unwrap_err();
    let text = wrong(with_noise("c", NoiseCfg::white(1.0))).to_string();
    assert_eq!(text, "unknown noise channel \"c\"; known names: \"a\", \"b\"");
    assert!(matches!(wrong(with_noise("n", NoiseCfg::white(1.0))), SensorError::UnknownName { .. }));
    let default = NoiseCfg::default;
    for bad in [-1.0, f64::NAN, f64::INFINITY, 1e101] {
        for noise in [
            NoiseCfg::white(bad),
            NoiseCfg { bias_std: bad, ..default() },
            NoiseCfg { bias_walk: bad, ..default() },
            NoiseCfg { resolution: bad, ..default() },
        ] {
            assert!(matches!(wrong(with_noise("a", noise)), SensorError::OutOfRange { .. }));
        }
    }
    for dropout in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(wrong(SamplingCfg { dropout, ..SamplingCfg::default() }), SensorError::OutOfRange { .. }));
    }
    let history = SamplingCfg { history_length: usize::MAX, ..SamplingCfg::default() };
    let latency = SamplingCfg { latency_steps: u32::MAX, ..SamplingCfg::default() };
    assert!([history, latency].map(wrong).iter().all(|error| matches!(error, SensorError::TooLarge { .. })));
    assert!(matches!(wrong(SamplingCfg::every(0.007)), SensorError::PeriodNotMultiple { .. }));
}
