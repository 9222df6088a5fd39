//! Noise, clips and scales of observations.

use super::tasks::{cfg, idle, world};
use kinetoscope::env::{Env, EnvBuilder, EnvCfg, Noise, ObservationTerm};
use kinetoscope::ndarray::Array2;

/// A task that sees the number 2 in two columns, as `change` has it.
fn seeing(change: impl FnOnce(ObservationTerm) -> ObservationTerm) -> Env {
    let (sim, _) = world(cfg(4, 1), false);
    let two = ObservationTerm::new("two", ["a", "b"], |now| Ok(Array2::from_elem((now.num_envs(), 2), 2.0)));
    EnvBuilder::new(sim, EnvCfg::default()).action(idle()).observation(change(two)).build().unwrap()
}

#[test]
fn noise_comes_first_then_the_clip_then_the_scale() {
    let first = |change: fn(ObservationTerm) -> ObservationTerm| {
        let mut env = seeing(change);
        let seen = env.reset(None, None).unwrap();
        (seen, env.observation_space().low()[0], env.observation_space().high()[1])
    };
    let plain = first(|term| term);
    assert_eq!(plain, (Array2::from_elem((4, 2), 2.0), f64::NEG_INFINITY, f64::INFINITY));
    assert_eq!(first(|term| term.scaled(-3.0).clipped([-1.0, 1.5])), (Array2::from_elem((4, 2), -4.5), -4.5, 3.0));
    // Noise of exactly 1 is clipped with the value.
    let noisy = |term: ObservationTerm| term.with_noise(Noise::Uniform { low: 1.0, high: 1.0 });
    assert_eq!(first(noisy).0, Array2::from_elem((4, 2), 3.0));
    let (seen, _, high) =
        first(|term| term.clipped([0.0, 2.5]).with_noise(Noise::Uniform { low: 1.0, high: 1.0 }).scaled(2.0));
    assert_eq!((seen, high), (Array2::from_elem((4, 2), 5.0), 5.0));
}

/// Of n numbers the mean scatters by sigma / sqrt(n), the variance of normal ones by sigma² sqrt(2 / n), that of uniform ones of
/// width 1 by sqrt(1 / 180 / n). Six times that fails once in 5e8 seeds, and the seed is fixed.
#[test]
fn noise_has_the_moments_that_were_asked_for_and_is_of_one_column_alone() {
    for (noise, mean, variance, of_variance) in [
        (Noise::Normal { std: 0.5 }, 2.0, 0.25, 0.25 * 2.0_f64.sqrt()),
        (Noise::Uniform { low: -0.25, high: 0.75 }, 2.25, 1.0 / 12.0, (1.0_f64 / 180.0).sqrt()),
    ] {
        let mut env = seeing(|term| term.with_noise(noise));
        env.reset(None, None).unwrap();
        let idle = Array2::zeros((4, 1));
        let steps = 5000;
        let mut pairs = Vec::new();
        for _ in 0..steps {
            let seen = env.step(&idle).unwrap().observations;
            pairs.extend(seen.rows().into_iter().map(|row| [row[0], row[1]]));
        }
        let n = pairs.len() as f64;
        for column in 0..2 {
            let found = pairs.iter().map(|pair| pair[column]).sum::<f64>() / n;
            assert!((found - mean).abs() < 6.0 * (variance / n).sqrt(), "{noise:?}: mean {found}");
            let found = pairs.iter().map(|pair| (pair[column] - mean).powi(2)).sum::<f64>() / n;
            assert!((found - variance).abs() < 6.0 * of_variance / n.sqrt(), "{noise:?}: variance {found}");
        }
        let together = pairs.iter().map(|[a, b]| (a - mean) * (b - mean)).sum::<f64>() / n;
        assert!(together.abs() < 6.0 * variance / n.sqrt(), "{noise:?}: covariance {together}");
    }
}
