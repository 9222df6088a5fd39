//! A sampler allocates nothing after it was built, whatever it is configured to do.

use scene::SceneState;
use sensors::{Channel, NoiseCfg, Requires, Sampler, SamplingCfg, SensorContext};

#[test]
fn measuring_allocates_nothing() {
    let context = SensorContext { num_envs: 3, dt: 0.01, ..SensorContext::default() };
    let noise = NoiseCfg { std: 0.1, bias_std: 0.1, bias_walk: 0.1, resolution: 0.01 };
    let cfg = SamplingCfg {
        history_length: 4,
        latency_steps: 5,
        dropout: 0.1,
        noise: [("a".to_string(), noise)].into(),
        ..SamplingCfg::every(0.02)
    };
    let channels = [Channel::new("a", 6), Channel::exact("b", 2)];
    let mut sampler = Sampler::new("test", Requires::NONE, &context, &cfg, &channels).expect("a good configuration");
    let mut state = SceneState::new(3);
    let count = allocation_counter::measure(|| {
        for step in 1..=100 {
            state.step.fill(step);
            sampler.update(&state, |env, row| row.fill(env as f64)).expect("a good state");
            sampler.refresh(&[1], &state, |env, row| row.fill(env as f64)).expect("a good state");
        }
        state.step[2] = 0;
        sampler.reset(&[2], &state, |env, row| row.fill(env as f64)).expect("a good state");
    });
    assert_eq!(count.count_total, 0);
    let control = allocation_counter::measure(|| drop(sampler.values("a").to_owned()));
    assert_eq!(control.count_total, 1, "the control: the counter counts");
}
