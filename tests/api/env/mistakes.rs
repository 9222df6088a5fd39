//! What a user gets wrong is said in typed errors, and what ran before goes on.

use super::tasks::{cart_task, cfg, idle, world};
use kinetoscope::env::{
    ActionTerm, CommandTerm, EnvBuilder, EnvCfg, EnvError, EventTerm, Noise, ObservationTerm, RewardTerm, Space,
    TermKind, TerminationTerm, When, terms,
};
use kinetoscope::ndarray::{Array1, Array2, array};

/// A task with one number, 1, to see.
fn builder() -> EnvBuilder {
    let (sim, _) = world(cfg(2, 1), false);
    EnvBuilder::new(sim, EnvCfg::default()).action(idle()).observation(one())
}

fn one() -> ObservationTerm {
    ObservationTerm::new("one", ["a"], |now| Ok(Array2::ones((now.num_envs(), 1))))
}

#[test]
fn lengths_of_zero_are_refused() {
    for (cfg, named) in [
        (EnvCfg { decimation: 0, episode_steps: None }, "decimation"),
        (EnvCfg { decimation: 1, episode_steps: Some(0) }, "episode_steps"),
    ] {
        let (sim, robot) = world(super::tasks::cfg(1, 1), false);
        let error = cart_task(sim, robot, cfg).build().unwrap_err();
        assert!(matches!(&error, EnvError::Config { field, .. } if field == named), "{error}");
    }
}

#[test]
fn terms_that_cannot_be_are_refused() {
    let (sim, _) = world(cfg(1, 1), false);
    let error = EnvBuilder::new(sim, EnvCfg::default()).observation(one()).build().unwrap_err();
    assert!(matches!(error, EnvError::NoTerm { kind: TermKind::Action }), "{error}");
    let (sim, _) = world(cfg(1, 1), false);
    let error = EnvBuilder::new(sim, EnvCfg::default()).action(idle()).build().unwrap_err();
    assert!(matches!(error, EnvError::NoTerm { kind: TermKind::Observation }), "{error}");
    let command = || CommandTerm::new("goal", ["x"], |_| [0.0]);
    let event = |when| EventTerm::new("event", when, |_, _| Ok(()));
    let end = || TerminationTerm::new("end", |now| Ok(Array1::from_elem(now.num_envs(), false)));
    let alive = || terms::alive("alive", 1.0);
    for (kind, twice) in [
        (TermKind::Action, builder().action(idle())),
        (TermKind::Observation, builder().observation(one())),
        (TermKind::Command, builder().command(command()).command(command())),
        (TermKind::Event, builder().event(event(When::Reset)).event(event(When::Startup))),
        (TermKind::Reward, builder().reward(alive()).reward(alive())),
        (TermKind::Termination, builder().termination(end()).termination(end())),
    ] {
        let error = twice.build().unwrap_err();
        assert!(matches!(&error, EnvError::RepeatedTerm { kind: of, .. } if *of == kind), "{kind}: {error}");
    }
    for name in ["", "a/b"] {
        let error = builder().reward(terms::alive(name, 1.0)).build().unwrap_err();
        assert!(matches!(&error, EnvError::TermName { kind: TermKind::Reward, .. }), "{name:?}: {error}");
    }
    let nan = f64::NAN;
    let named = |name: &str, term: ObservationTerm| (name.to_string(), builder().observation(term));
    let other = || ObservationTerm::new("other", ["a"], |now| Ok(Array2::ones((now.num_envs(), 1))));
    for (what, wrong) in [
        named("noise", other().with_noise(Noise::Normal { std: -1.0 })),
        named("noise", other().with_noise(Noise::Normal { std: nan })),
        named("noise", other().with_noise(Noise::Uniform { low: 1.0, high: 0.0 })),
        named("scale", other().scaled(0.0)),
        named("scale", other().scaled(f64::INFINITY)),
        ("weight".into(), builder().reward(terms::alive("alive", nan))),
        ("interval".into(), builder().event(event(When::Interval { steps: [0, 3] }))),
        ("interval".into(), builder().event(event(When::Interval { steps: [4, 3] }))),
    ] {
        let error = wrong.build().unwrap_err();
        assert!(matches!(&error, EnvError::Config { field, .. } if field.contains(&what)), "{what}: {error}");
    }
    let error = builder().observation(other().clipped([1.0, 0.0])).build().unwrap_err();
    assert!(matches!(error, EnvError::Bounds { low: 1.0, high: 0.0, .. }), "{error}");
    let twice = ObservationTerm::new("twice", ["a", "a"], |now| Ok(Array2::ones((now.num_envs(), 2))));
    let error = builder().observation(twice).build().unwrap_err();
    assert!(matches!(&error, EnvError::RepeatedColumn { column } if column == "a"), "{error}");
}

#[test]
fn actions_of_the_wrong_shape_or_not_finite_are_refused_and_nothing_happens() {
    let (sim, robot) = world(cfg(2, 1), false);
    let mut env = cart_task(sim, robot, EnvCfg::default()).build().unwrap();
    let error = env.step(&array![[0.0], [0.0]]).unwrap_err();
    assert!(matches!(error, EnvError::ResetFirst { env: 0 }), "{error}");
    env.reset(Some(&[true, false]), None).unwrap();
    let error = env.step(&array![[0.0], [0.0]]).unwrap_err();
    assert!(matches!(error, EnvError::ResetFirst { env: 1 }), "{error}");
    env.reset(None, None).unwrap();
    for wrong in [array![[0.0]], array![[0.0, 0.0], [0.0, 0.0]], Array2::zeros((3, 1)), Array2::zeros((0, 0))] {
        let error = env.step(&wrong).unwrap_err();
        assert!(matches!(&error, EnvError::Shape { expected, .. } if *expected == [2, 1]), "{error}");
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = env.step(&array![[0.0], [bad]]).unwrap_err();
        let EnvError::NotFinite { env: 1, column, value, .. } = &error else { panic!("{error}") };
        assert_eq!((column.as_str(), value.to_bits()), ("push/slide", bad.to_bits()));
    }
    let error = env.reset(Some(&[true; 3]), None).unwrap_err();
    assert!(matches!(&error, EnvError::Shape { found, .. } if *found == [3]), "{error}");
    assert_eq!((env.sim().time(), env.now().episode_steps()), (vec![0.0; 2], &[0, 0][..]));
    env.step(&array![[1.0], [1.0]]).unwrap();
}

#[test]
fn unknown_names_come_with_candidates() {
    let (sim, robot) = world(cfg(1, 1), true);
    let error = terms::joint_positions(&sim, "positions", robot, &["slidr"]).unwrap_err();
    assert!(error.to_string().contains("slide"), "{error}");
    let asks = RewardTerm::new("asks", 1.0, |now| Ok(now.command("gaol")?.column(0).to_owned()));
    let mut env = builder().command(CommandTerm::new("goal", ["x"], |_| [0.0])).reward(asks).build().unwrap();
    env.reset(None, None).unwrap();
    let error = env.step(&Array2::zeros((2, 1))).unwrap_err();
    let EnvError::Term { kind: TermKind::Reward, name, error: inner } = &error else { panic!("{error}") };
    assert_eq!(name, "asks");
    assert!(inner.to_string().contains("\"gaol\"") && inner.to_string().contains("goal"), "{inner}");
    let error = env.action_space().column("idle/b").unwrap_err();
    assert!(matches!(&error, EnvError::UnknownName { candidates, .. } if *candidates == ["idle/a"]), "{error}");
}

#[test]
fn terms_that_give_nonsense_end_the_step_and_a_reset_starts_again() {
    type Wrong = fn(EnvBuilder) -> EnvBuilder;
    let late = |k: u64, value: f64| if k == 3 { value } else { 0.0 };
    let cases: [(&str, Wrong); 7] = [
        ("shape", |b| b.reward(RewardTerm::new("r", 1.0, |_| Ok(Array1::zeros(5))))),
        ("shape", |b| b.termination(TerminationTerm::new("t", |_| Ok(Array1::from_elem(1, false))))),
        ("finite", |b| b.reward(RewardTerm::new("r", 1.0, |now| Ok(Array1::from_elem(now.num_envs(), f64::NAN))))),
        ("finite", |b| b.reward(RewardTerm::new("r", 1e300, |now| Ok(Array1::from_elem(now.num_envs(), 1e300))))),
        ("failed", |b| b.reward(RewardTerm::new("r", 1.0, |_| Err("no idea".into())))),
        ("failed", |b| {
            let space = Space::uniform(["b"], [0.0, 1.0]).unwrap();
            b.action(ActionTerm::new("b", space, |_, _| Err("no idea".into())))
        }),
        ("failed", |b| b.event(EventTerm::new("e", When::Interval { steps: [1, 1] }, |_, _| Err("no idea".into())))),
    ];
    for (what, wrong) in cases {
        let mut env = wrong(builder()).build().unwrap();
        env.reset(None, None).unwrap();
        let actions = Array2::zeros((2, env.action_space().len()));
        let error = env.step(&actions).unwrap_err();
        assert!(error.to_string().contains(what), "{what}: {error}");
        let error = env.step(&actions).unwrap_err();
        assert!(matches!(error, EnvError::ResetFirst { env: 0 }), "{error}");
    }
    // What is not finite never is an observation; a clip makes it a number where it is infinite.
    for (value, clip, good) in [(f64::NAN, true, false), (f64::INFINITY, false, false), (f64::INFINITY, true, true)] {
        let term = ObservationTerm::new("late", ["x"], move |now| {
            Ok(Array2::from_shape_fn((now.num_envs(), 1), |(e, _)| late(now.episode_steps()[e], value)))
        });
        let term = if clip { term.clipped([-9.0, 9.0]) } else { term };
        let mut env = builder().observation(term).build().unwrap();
        env.reset(None, None).unwrap();
        let actions = Array2::zeros((2, 1));
        env.step(&actions).unwrap();
        env.step(&actions).unwrap();
        match env.step(&actions) {
            Ok(step) => assert!(good && step.observations[(0, 1)] == 9.0),
            Err(error) => {
                let EnvError::NotFinite { env: 0, column, .. } = &error else { panic!("{error}") };
                assert!(!good && column == "x", "{error}");
                env.reset(None, None).unwrap();
                assert!(env.step(&actions).is_ok(), "goes on after a reset");
            }
        }
    }
    // At the start of an episode, too.
    let bad = CommandTerm::new("goal", ["x"], |_| [f64::NAN]);
    let error = builder().command(bad).build().unwrap().reset(None, None).unwrap_err();
    assert!(matches!(&error, EnvError::NotFinite { column, .. } if column == "x"), "{error}");
    let fails = EventTerm::new("e", When::Startup, |_, _| Err("no idea".into()));
    assert!(matches!(builder().event(fails).build(), Err(EnvError::Term { kind: TermKind::Event, .. })));
}
