//! Latency, lost samples and noise: exact where they are exact, with bounds where they are not.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::*;
use ndarray::array;

const DT: f64 = 0.005;

fn context(num_envs: usize) -> SensorContext {
    SensorContext { num_envs, dt: DT, name: "encoder".into(), seed: 42, ..SensorContext::default() }
}

fn sampler(num_envs: usize, cfg: &SamplingCfg) -> Sampler {
    let channels = [Channel::new("a", 1), Channel::new("b", 2), Channel::exact("n", 1)];
    Sampler::new("encoder", Requires::NONE, &context(num_envs), cfg, &channels).unwrap()
}

fn state(steps: &[u64]) -> SceneState {
    SceneState {
        step: steps.to_vec(),
        time: steps.iter().map(|&s| s as f64).collect(),
        force_time: steps.iter().map(|&s| s as f64 - 0.5).collect(),
        ..SceneState::new(steps.len())
    }
}

/// Values that tell the step.
fn tell(state: &SceneState) -> impl Fn(usize, &mut [f64]) + '_ {
    |env, row| row.fill(state.step[env] as f64)
}

/// Values that are always zero: what is read is noise.
fn nothing(_env: usize, _row: &mut [f64]) {}

impl Sampled for Sampler {
    fn sampler(&self) -> &Sampler {
        self
    }
}

fn step(sampler: &mut Sampler, steps: &[u64]) {
    let state = state(steps);
    sampler.update(&state, tell(&state)).unwrap();
}

#[test]
fn a_late_measurement_is_read_exactly_latency_steps_after_its_capture() {
    for (period, latency) in [(1, 1), (1, 7), (4, 1), (4, 3), (4, 4), (4, 5), (4, 9), (3, 100)] {
        let cfg = SamplingCfg { latency_steps: latency, history_length: 3, ..SamplingCfg::every(period as f64 * DT) };
        let mut sampler = sampler(1, &cfg);
        let start = state(&[0]);
        sampler.reset(&[0], &start, tell(&start)).unwrap();
        for now in 1..=150 {
            step(&mut sampler, &[now]);
            // The newest capture that is old enough.
            let arrived = now.saturating_sub(latency.into()) / period;
            let captured = (arrived * period) as f64;
            assert_eq!(sampler.sample_counts()[0], arrived, "period {period}, latency {latency}, step {now}");
            assert_eq!(sampler.values("b"), array![[captured, captured]]);
            assert_eq!(sampler.stamps()[0], captured, "the stamp is that of the capture");
            assert_eq!(sampler.history_filled(0), arrived.min(3) as usize);
            for age in 0..sampler.history_filled(0) {
                let expected = captured - (age as u64 * period) as f64;
                assert_eq!(
                    (sampler.history("a")[(0, age, 0)], sampler.stamp_history()[(0, age)]),
                    (expected, expected)
                );
                assert_eq!(sampler.force_stamp_history()[(0, age)], expected - 0.5);
            }
        }
    }
}

/// What was on its way when somebody wrote to the state arrives one after the other, and is not what is shown.
#[test]
fn what_arrives_after_a_refresh_can_be_read_and_is_not_shown() {
    let mut sampler = sampler(1, &SamplingCfg { latency_steps: 4, ..SamplingCfg::default() });
    let start = state(&[0]);
    sampler.reset(&[0], &start, tell(&start)).unwrap();
    let read =
        |sampler: &Sampler| (sampler.arrived("b")[(0, 1)], sampler.arrived_stamps()[0], sampler.values("b")[(0, 1)]);
    for now in 1..=15 {
        step(&mut sampler, &[now]);
        if now == 6 {
            let state = state(&[6]);
            sampler.refresh(&[0], &state, |_, row| row.fill(100.0)).unwrap();
        }
        let captured = now.saturating_sub(4) as f64;
        let shown = if (6..=10).contains(&now) { 100.0 } else { captured };
        assert_eq!(read(&sampler), (captured, captured, shown), "step {now}");
        assert_eq!(sampler.arrived_force_stamps()[0], captured - 0.5);
    }
    // Without a latency there is nothing on its way: both are the same.
    let mut sampler = self::sampler(1, &SamplingCfg::default());
    step(&mut sampler, &[3]);
    assert_eq!(read(&sampler), (3.0, 3.0, 3.0));
}

/// An owner who only updates when something is due sees the same at every step.
#[test]
fn captures_and_arrivals_are_due() {
    let cfg = SamplingCfg { latency_steps: 5, ..SamplingCfg::every(4.0 * DT) };
    let (mut lazy, mut eager) = (sampler(2, &cfg), sampler(2, &cfg));
    let start = state(&[0, 2]);
    for sampler in [&mut lazy, &mut eager] {
        sampler.reset(&[0, 1], &start, tell(&start)).unwrap();
    }
    let mut updates = 0;
    let mut next = lazy.due_in(&[0, 2]);
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
    // Captures at 4, 8, .., 100 and arrivals at 9, 13, .., 97.
    assert_eq!(updates, 25 + 23);
}

#[test]
fn a_reset_forgets_what_is_on_its_way() {
    let cfg = SamplingCfg { latency_steps: 6, ..SamplingCfg::every(2.0 * DT) };
    let mut sampler = sampler(2, &cfg);
    for now in 1..=9 {
        step(&mut sampler, &[now, now]);
    }
    assert_eq!(sampler.sample_counts(), array![1, 1]);
    let fresh = state(&[9, 0]);
    sampler.reset(&[1], &fresh, tell(&fresh)).unwrap();
    for k in 1..=7 {
        step(&mut sampler, &[9 + k, k]);
        assert_eq!((sampler.values("a")[(1, 0)], sampler.sample_counts()[1]), (0.0, 0));
    }
    step(&mut sampler, &[17, 8]);
    assert_eq!((sampler.values("a")[(1, 0)], sampler.sample_counts()[1]), (2.0, 1));
    assert_eq!((sampler.values("a")[(0, 0)], sampler.sample_counts()[0]), (10.0, 5));
}

#[test]
fn what_was_captured_before_a_refresh_does_not_replace_it() {
    let cfg = SamplingCfg { latency_steps: 4, history_length: 9, ..SamplingCfg::every(2.0 * DT) };
    let mut sampler = sampler(1, &cfg);
    for now in 1..=6 {
        step(&mut sampler, &[now]);
    }
    let written = state(&[6]);
    sampler.refresh(&[0], &written, |_, row| row.fill(-1.0)).unwrap();
    for now in 7..=11 {
        step(&mut sampler, &[now]);
        assert_eq!((sampler.values("a")[(0, 0)], sampler.stamps()[0]), (-1.0, 6.0), "step {now}");
    }
    assert_eq!(sampler.history("a").iter().take(4).copied().collect::<Vec<_>>(), [6.0, 4.0, 2.0, 0.0]);
    step(&mut sampler, &[12]);
    assert_eq!(sampler.values("a")[(0, 0)], 8.0);
}

#[test]
fn a_lost_measurement_never_arrives() {
    let cfg = SamplingCfg { dropout: 0.3, history_length: 2, ..SamplingCfg::default() };
    let mut sampler = sampler(1, &cfg);
    let (mut before, mut lost) = (0.0, 0);
    let n = 20_000;
    for now in 1..=n {
        step(&mut sampler, &[now]);
        let value = sampler.values("a")[(0, 0)];
        assert!(value == now as f64 || value == before);
        lost += u64::from(value == before);
        assert_eq!((sampler.stamps()[0], sampler.sample_counts()[0]), (value, now - lost));
        assert_eq!(sampler.history("a")[(0, 0, 0)], value);
        before = value;
    }
    // The share lost of n scatters by sqrt(p (1 - p) / n).
    let bound = 6.0 * (0.3 * 0.7 / n as f64).sqrt();
    assert!((lost as f64 / n as f64 - 0.3).abs() < bound, "{lost}");
    let all = SamplingCfg { dropout: 1.0, ..SamplingCfg::default() };
    let mut sampler = super::tests::sampler(1, &all);
    (1..100).for_each(|now| step(&mut sampler, &[now]));
    assert_eq!((sampler.sample_counts()[0], sampler.values("a")[(0, 0)]), (0, 0.0));
}

fn with_noise(channel: &str, noise: NoiseCfg) -> SamplingCfg {
    SamplingCfg { noise: [(channel.to_string(), noise)].into(), ..SamplingCfg::default() }
}

/// Mean and standard deviation.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

/// The mean of n numbers scatters by std / sqrt(n), their standard deviation by std / sqrt(2 n); six times that.
#[track_caller]
fn assert_normal(values: &[f64], std: f64) {
    let (mean, found) = moments(values);
    let n = values.len() as f64;
    assert!(mean.abs() < 6.0 * std / n.sqrt(), "mean {mean} of {n} numbers with std {std}");
    assert!((found - std).abs() < 6.0 * std / (2.0 * n).sqrt(), "std {found} instead of {std}");
}

#[test]
fn white_noise_has_its_mean_and_deviation_and_touches_its_channel_only() {
    let mut sampler = sampler(2, &with_noise("b", NoiseCfg::white(0.2)));
    let mut values = [Vec::new(), Vec::new()];
    for now in 1..=20_000 {
        sampler.update(&state(&[now, now]), nothing).unwrap();
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

/// After t seconds the walk of `bias_walk` per sqrt(s) has the standard deviation `bias_walk * sqrt(t)`, whatever the
/// period; at a reset the bias is drawn again.
#[test]
fn biases_are_drawn_at_resets_and_wander_with_the_square_root_of_time() {
    let n = 4000;
    for period in [1, 5] {
        let noise = NoiseCfg { bias_std: 0.5, bias_walk: 0.3, ..NoiseCfg::default() };
        let cfg = SamplingCfg { update_period: period as f64 * DT, ..with_noise("a", noise) };
        let mut sampler = sampler(n, &cfg);
        let all: Vec<usize> = (0..n).collect();
        sampler.reset(&all, &state(&vec![0; n]), nothing).unwrap();
        let at_reset = sampler.values("a").column(0).to_vec();
        assert_normal(&at_reset, 0.5);
        sampler.refresh(&all, &state(&vec![0; n]), nothing).unwrap();
        assert_eq!(sampler.values("a").column(0).to_vec(), at_reset, "a refresh lets no time pass");
        let steps = 200;
        for now in 1..=steps {
            sampler.update(&state(&vec![now; n]), nothing).unwrap();
        }
        let walked: Vec<f64> = sampler.values("a").iter().zip(&at_reset).map(|(now, then)| now - then).collect();
        assert_normal(&walked, 0.3 * (steps as f64 * DT).sqrt());
        sampler.reset(&all, &state(&vec![0; n]), nothing).unwrap();
        let again = sampler.values("a").column(0).to_vec();
        assert_normal(&again, 0.5);
        assert_ne!(again, at_reset);
    }
}

#[test]
fn values_are_rounded_to_the_resolution() {
    let noise = NoiseCfg { resolution: 0.25, ..NoiseCfg::default() };
    let mut sampler = sampler(1, &with_noise("a", noise));
    for (k, (value, expected)) in [(0.1, 0.0), (0.13, 0.25), (-1.4, -1.5), (7.0, 7.0)].into_iter().enumerate() {
        sampler.update(&state(&[k as u64 + 1]), |_, row| row[0] = value).unwrap();
        assert_eq!(sampler.values("a")[(0, 0)], expected);
    }
}

/// Environment 5 of a simulation and environment 2 of a shard that begins at 3 are the same.
#[test]
fn noise_depends_on_seed_environment_and_name_only() {
    let noise = NoiseCfg { std: 0.1, bias_std: 1.0, bias_walk: 0.1, resolution: 0.0 };
    let cfg = SamplingCfg { dropout: 0.2, ..with_noise("a", noise) };
    let run = |context: SensorContext, env: usize| {
        let channels = [Channel::new("a", 1)];
        let n = context.num_envs;
        let mut sampler = Sampler::new("encoder", Requires::NONE, &context, &cfg, &channels).unwrap();
        sampler.reset(&(0..n).collect::<Vec<_>>(), &state(&vec![0; n]), nothing).unwrap();
        let mut values = Vec::new();
        for now in 1..=50 {
            sampler.update(&state(&vec![now; n]), nothing).unwrap();
            values.push(sampler.values("a")[(env, 0)].to_bits());
        }
        values
    };
    let reference = run(context(8), 5);
    assert_eq!(run(context(6), 5), reference);
    assert_eq!(run(SensorContext { first_env: 3, ..context(4) }, 2), reference);
    for other in [
        run(context(8), 4),
        run(SensorContext { seed: 43, ..context(8) }, 5),
        run(SensorContext { name: "other".into(), ..context(8) }, 5),
    ] {
        assert_ne!(other, reference);
    }
}

#[test]
fn mistakes_are_typed_errors() {
    let wrong = |cfg: SamplingCfg| {
        let channels = [Channel::new("forces", 3), Channel::exact("count", 1)];
        Sampler::new("encoder", Requires::NONE, &context(2), &cfg, &channels).unwrap_err()
    };
    let text = wrong(with_noise("force", NoiseCfg::white(1.0))).to_string();
    assert_eq!(text, "there is no channel that can have noise \"force\"; known are \"forces\"");
    assert!(matches!(wrong(with_noise("count", NoiseCfg::white(1.0))), SensorError::UnknownName { .. }));
    for bad in [-1.0, f64::NAN, f64::INFINITY, 1e101] {
        for noise in [
            NoiseCfg::white(bad),
            NoiseCfg { bias_std: bad, ..NoiseCfg::default() },
            NoiseCfg { bias_walk: bad, ..NoiseCfg::default() },
            NoiseCfg { resolution: bad, ..NoiseCfg::default() },
        ] {
            assert!(matches!(wrong(with_noise("forces", noise)), SensorError::OutOfRange { .. }));
        }
    }
    for dropout in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(wrong(SamplingCfg { dropout, ..SamplingCfg::default() }), SensorError::OutOfRange { .. }));
    }
    for cfg in [
        SamplingCfg { history_length: usize::MAX, ..SamplingCfg::default() },
        SamplingCfg { latency_steps: u32::MAX, ..SamplingCfg::default() },
    ] {
        assert!(matches!(wrong(cfg), SensorError::TooLarge { .. }));
    }
    let period = SamplingCfg::every(0.007);
    assert!(matches!(wrong(period), SensorError::PeriodNotMultiple { .. }));
}
