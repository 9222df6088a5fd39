//! Mistakes of users give typed errors, and a reset recovers from them.

use super::bundled::{cart_task, cfg, idle, world};
use kinetoscope::ndarray::{Array1, Array2, array};
use kinetoscope::tasks::{
    ActionTerm, CommandTerm, Env, EnvBuilder, EnvCfg, EnvError, EventMode, EventTerm, Noise, ObservationTerm,
    RewardTerm, Space, TermKind, TerminationTerm, terms,
};
use kinetoscope_testkit::error_tables::assert_errors;

fn empty() -> EnvBuilder {
    EnvBuilder::new(world(cfg(2, 1), false).0, EnvCfg::default())
}

/// A task with the constant observation 1.
fn builder() -> EnvBuilder {
    empty().action(idle()).observation(ones("one"))
}

fn ones(name: &str) -> ObservationTerm {
    ObservationTerm::new(name, ["a"], |now| Ok(Array2::ones((now.num_envs(), 1))))
}

fn cart(num_envs: usize, cfg: EnvCfg) -> EnvBuilder {
    let (sim, robot) = world(super::bundled::cfg(num_envs, 1), false);
    cart_task(sim, robot, cfg)
}

fn event(when: EventMode) -> EventTerm {
    EventTerm::new("event", when, |_, _| Ok(()))
}

#[test]
fn building() {
    let command = || CommandTerm::new("goal", ["x"], |_| [0.0]);
    let end = || TerminationTerm::new("end", |now| Ok(Array1::from_elem(now.num_envs(), false)));
    let alive = |weight| terms::is_alive("alive", weight);
    let noisy = |noise| builder().observation(ones("other").with_noise(noise));
    let scaled = |scale| builder().observation(ones("other").scaled(scale));
    let clipped = builder().observation(ones("other").clipped([1.0, 0.0]));
    let two_a = ObservationTerm::new("twice", ["a", "a"], |now| Ok(Array2::ones((now.num_envs(), 2))));
    let fails = EventTerm::new("e", EventMode::Startup, |_, _| Err("no idea".into()));
    let rows = [
        (cart(1, EnvCfg { decimation: 0, ..EnvCfg::default() }), "Config { field: \"decimation\""),
        (cart(1, EnvCfg { episode_steps: Some(0), ..EnvCfg::default() }), "Config { field: \"episode_steps\""),
        (empty().observation(ones("one")), "NoTerm { kind: Action"),
        (empty().action(idle()), "NoTerm { kind: Observation"),
        (builder().action(idle()), "RepeatedTerm { kind: Action"),
        (builder().observation(ones("one")), "RepeatedTerm { kind: Observation"),
        (builder().command(command()).command(command()), "RepeatedTerm { kind: Command"),
        (builder().event(event(EventMode::Reset)).event(event(EventMode::Startup)), "RepeatedTerm { kind: Event"),
        (builder().reward(alive(1.0)).reward(alive(1.0)), "RepeatedTerm { kind: Reward"),
        (builder().termination(end()).termination(end()), "RepeatedTerm { kind: Termination"),
        (builder().reward(terms::is_alive("", 1.0)), "TermName { kind: Reward"),
        (builder().reward(terms::is_alive("a/b", 1.0)), "TermName { kind: Reward"),
        (noisy(Noise::Normal { std: -1.0 }), "Config { field: \"noise of"),
        (noisy(Noise::Normal { std: f64::NAN }), "Config { field: \"noise of"),
        (noisy(Noise::Uniform { low: 1.0, high: 0.0 }), "Config { field: \"noise of"),
        (scaled(0.0), "Config { field: \"scale of"),
        (scaled(f64::INFINITY), "Config { field: \"scale of"),
        (builder().reward(alive(f64::NAN)), "Config { field: \"the weight of"),
        (builder().event(event(EventMode::Interval { steps: [0, 3] })), "Config { field: \"the interval of"),
        (builder().event(event(EventMode::Interval { steps: [4, 3] })), "Config { field: \"the interval of"),
        (clipped, "Bounds { column: \"a\", low: 1.0, high: 0.0"),
        (builder().observation(two_a), "RepeatedColumn { column: \"a\""),
        (builder().event(fails), "Term { kind: Event"),
    ];
    assert_errors(rows.into_iter().enumerate().map(|(row, (builder, variant))| (row, builder.build(), variant, [])));
}

#[test]
fn actions_and_masks() {
    let mut env = cart(2, EnvCfg::default()).build().unwrap();
    let first = |env: &mut Env| env.step(&array![[0.0], [0.0]]).unwrap_err();
    assert!(matches!(first(&mut env), EnvError::ResetFirst { env: 0 }));
    env.reset(Some(&[true, false]), None).unwrap();
    assert!(matches!(first(&mut env), EnvError::ResetFirst { env: 1 }));
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
    assert_eq!((env.sim().time(), env.context().episode_steps()), (vec![0.0; 2], &[0, 0][..]), "nothing happened");
    env.step(&array![[1.0], [1.0]]).unwrap();
}

#[test]
fn unknown_names() {
    let (sim, robot) = world(cfg(1, 1), true);
    let error = terms::joint_pos_rel(&sim, "positions", robot, &["slidr"]).unwrap_err();
    assert!(error.to_string().contains("slide"), "{error}");
    let asks = RewardTerm::new("asks", 1.0, |now| Ok(now.command("gaol")?.column(0).to_owned()));
    let mut env = builder().command(CommandTerm::new("goal", ["x"], |_| [0.0])).reward(asks).build().unwrap();
    env.reset(None, None).unwrap();
    let error = env.step(&Array2::zeros((2, 1))).unwrap_err();
    let EnvError::Term { kind: TermKind::Reward, name, error: inner } = &error else { panic!("{error}") };
    assert_eq!(name, "asks");
    assert!(inner.to_string().contains("\"gaol\"") && inner.to_string().contains("goal"), "{inner}");
    let error = env.action_space().column_index("idle/b").unwrap_err();
    assert!(matches!(&error, EnvError::UnknownName { candidates, .. } if *candidates == ["idle/a"]), "{error}");
}

/// Terms that return invalid values end the step with an error; a reset starts again.
#[test]
fn terms_in_steps() {
    let reward = |weight, value: fn(usize) -> Array1<f64>| {
        builder().reward(RewardTerm::new("r", weight, move |now| Ok(value(now.num_envs()))))
    };
    let action = ActionTerm::new("b", Space::uniform(["b"], [0.0, 1.0]).unwrap(), |_, _| Err("no idea".into()));
    let event = EventTerm::new("e", EventMode::Interval { steps: [1, 1] }, |_, _| Err("no idea".into()));
    for (what, wrong) in [
        ("shape", reward(1.0, |_| Array1::zeros(5))),
        ("shape", builder().termination(TerminationTerm::new("t", |_| Ok(Array1::from_elem(1, false))))),
        ("finite", reward(1.0, |envs| Array1::from_elem(envs, f64::NAN))),
        ("finite", reward(1e300, |envs| Array1::from_elem(envs, 1e300))),
        ("failed", builder().reward(RewardTerm::new("r", 1.0, |_| Err("no idea".into())))),
        ("failed", builder().action(action)),
        ("failed", builder().event(event)),
    ] {
        let mut env = wrong.build().unwrap();
        env.reset(None, None).unwrap();
        let actions = Array2::zeros((2, env.action_space().len()));
        let error = env.step(&actions).unwrap_err();
        assert!(error.to_string().contains(what), "{what}: {error}");
        assert!(matches!(env.step(&actions), Err(EnvError::ResetFirst { env: 0 })), "{what}");
    }
    // Non-finite numbers are never observations; a clip makes an infinite number finite.
    for (value, clip, good) in [(f64::NAN, true, false), (f64::INFINITY, false, false), (f64::INFINITY, true, true)] {
        let term = ObservationTerm::new("late", ["x"], move |now| {
            let late = |(e, _): (usize, usize)| if now.episode_steps()[e] == 3 { value } else { 0.0 };
            Ok(Array2::from_shape_fn((now.num_envs(), 1), late))
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
                assert!(env.step(&actions).is_ok(), "continues after a reset");
            }
        }
    }
    // The same at the start of an episode.
    let bad = CommandTerm::new("goal", ["x"], |_| [f64::NAN]);
    let error = builder().command(bad).build().unwrap().reset(None, None).unwrap_err();
    assert!(matches!(&error, EnvError::NotFinite { column, .. } if column == "x"), "{error}");
}

/// A panic in a term is an error that names the term. A reset recovers.
#[test]
fn panics() {
    let observation = ObservationTerm::new("o", ["x"], |now| {
        assert!(now.episode_steps()[0] < 2, "too late");
        Ok(Array2::zeros((now.num_envs(), 1)))
    });
    let action = ActionTerm::new("a", Space::uniform(["a"], [0.0, 1.0]).unwrap(), |_, _| panic!("an action"));
    let index = RewardTerm::new("r", 1.0, |now| Ok(Array1::from_elem(2, now.actions()[(7, 0)])));
    for (task, kind, name, message) in [
        (builder().observation(observation), TermKind::Observation, "o", "too late"),
        (builder().action(action), TermKind::Action, "a", "an action"),
        (builder().reward(index), TermKind::Reward, "r", "out of bounds"),
        (builder().termination(TerminationTerm::new("t", |_| panic!("an end"))), TermKind::Termination, "t", "an end"),
        (
            builder().event(EventTerm::new("e", EventMode::Interval { steps: [2, 2] }, |_, _| panic!("a push"))),
            TermKind::Event,
            "e",
            "a push",
        ),
    ] {
        let mut env = task.build().unwrap();
        for _ in 0..2 {
            env.reset(None, None).unwrap();
            let actions = Array2::zeros((2, env.action_space().len()));
            let error = (0..2).find_map(|_| env.step(&actions).err()).unwrap();
            let EnvError::TermPanic { kind: of, name: found, message: text } = &error else { panic!("{error}") };
            assert_eq!((*of, found.as_str()), (kind, name));
            assert!(text.contains(message), "{text}");
            assert!(matches!(env.step(&actions), Err(EnvError::ResetFirst { env: 0 })));
        }
    }
    let command = CommandTerm::new("c", ["x"], |rng| [[1.0][usize::from(rng.uniform() < 2.0)]]);
    let error = builder().command(command).build().unwrap().reset(None, None).unwrap_err();
    assert!(error.to_string().starts_with("the command term \"c\" panicked: index out of bounds"), "{error}");
}
