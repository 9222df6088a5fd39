//! Rewards and ends of a task in datasets and other recordings.

use super::*;
use kinetoscope_sim::{JointIndex, Observer, SimEvent, StepResult};
use kinetoscope_tasks::{ActionTerm, Env, EnvBuilder, EnvCfg, EventTerm, ObservationTerm, RewardTerm, TerminationTerm};
use kinetoscope_testkit::worlds::{mjcf_robot, passive};
use ndarray::Array1;
use std::any::TypeId;

const ENVS: usize = 3;
/// Physics steps in a step of the task.
const DECIMATION: u32 = 2;
/// Steps of the longest episode.
const EPISODE: u64 = 7;
const STEPS: usize = 25;

/// A cart on a rail, moved by forces. Its reward is its position; an episode ends when the cart is too far away.
fn task() -> Env {
    let cart = r#"<mujoco><worldbody><body name="rail"><geom size="0.01"/><body name="cart">
        <joint name="slide" type="slide" axis="1 0 0"/><geom size="0.1" mass="2"/></body></body></worldbody></mujoco>"#;
    let mut sim = simulation(ENVS);
    let cart = sim.add_robot(passive(mjcf_robot("cart", cart))).unwrap();
    let push = kinetoscope_tasks::Space::uniform(["slide"], [-1e5, 1e5]).unwrap();
    EnvBuilder::new(sim, EnvCfg { decimation: DECIMATION, episode_steps: Some(EPISODE), ..EnvCfg::default() })
        .action(ActionTerm::new("push", push, move |sim, forces| {
            Ok(sim.robot_mut(cart).set_qf_target(forces, None, None)?)
        }))
        .observation(ObservationTerm::new("place", ["slide"], move |now| Ok(now.sim().robot(cart).qpos())))
        .reward(RewardTerm::new("place", 3.0, move |now| Ok(now.sim().robot(cart).qpos().column(0).to_owned())))
        .termination(TerminationTerm::new("far", move |now| {
            Ok(now.sim().robot(cart).qpos().column(0).mapv(|x| x.abs() > 0.1))
        }))
        .event(EventTerm::on_reset("scatter", move |sim, rng| {
            for die in rng {
                let start = array![[die.uniform_range(-0.05, 0.05)]];
                sim.robot_mut(cart).write_qpos(&start, Some(&[JointIndex(0)]), Some(&[die.env()]))?;
            }
            Ok(())
        }))
        .build()
        .unwrap()
}

/// An episode as reported by the task: the reward of each step, and true if it has ended.
#[derive(Clone, Debug, Default, PartialEq)]
struct ExpectedEpisode {
    env: usize,
    /// Physics steps before it.
    begin: u64,
    rewards: Vec<f64>,
    ended: bool,
}

/// Runs the task with recorders (a path and `period_steps`), and returns its episodes in the order in which they begin.
fn run(recordings: &[(&Path, u64)]) -> Vec<ExpectedEpisode> {
    let mut env = task();
    let begin = |(path, every): &(&Path, u64)| {
        env.sim_mut().record(RecorderCfg { period_steps: *every, ..RecorderCfg::new(*path) }).unwrap()
    };
    let recorders: Vec<_> = recordings.iter().map(begin).collect();
    env.reset(None, Some(3)).unwrap();
    let mut all: Vec<ExpectedEpisode> =
        (0..ENVS).map(|env| ExpectedEpisode { env, ..ExpectedEpisode::default() }).collect();
    let mut now: Vec<usize> = (0..ENVS).collect();
    for step in 0..STEPS {
        // Each environment has other actions. The last cart is pushed so hard that its episode ends early.
        let actions = Array2::from_shape_fn((ENVS, 1), |(env, _)| 1e4 * env as f64 * (1.0 + 0.1 * step as f64));
        let done = env.step(&actions).unwrap();
        for k in 0..ENVS {
            let episode = &mut all[now[k]];
            episode.rewards.push(done.rewards[k]);
            episode.ended = done.terminated[k] || done.truncated[k];
            if episode.ended {
                now[k] = all.len();
                let begin = u64::from(DECIMATION) * (step as u64 + 1);
                all.push(ExpectedEpisode { env: k, begin, ..ExpectedEpisode::default() });
            }
        }
    }
    recorders.into_iter().for_each(|recorder| drop(env.sim_mut().finish_recording(recorder).unwrap()));
    // An episode that has just begun has no frame.
    all.retain(|episode| !episode.rewards.is_empty());
    let is_long = |episode: &ExpectedEpisode| episode.ended && episode.rewards.len() == EPISODE as usize;
    assert!(all.iter().any(is_long) && all.iter().any(|episode| episode.ended && !is_long(episode)), "{all:?}");
    assert!(all.iter().any(|episode| !episode.ended), "one episode has not ended: {all:?}");
    all
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn lerobot() {
    let folder = tempfile::tempdir().unwrap();
    let files = [2, 1, 4].map(|every| (folder.path().join(format!("{every}.lerobot")), every));
    let told = run(&files.each_ref().map(|(path, every)| (&**path, *every)));
    for (path, every) in &files {
        let found = script_output("read_lerobot.py", path);
        let episodes = list(&found["episodes"]);
        // The rows of an episode are at multiples of `period_steps`. Each but the last is a frame.
        let end_of = |episode: &ExpectedEpisode| episode.begin + u64::from(DECIMATION) * episode.rewards.len() as u64;
        let rows_of = |episode: &ExpectedEpisode| -> Vec<u64> {
            (episode.begin.next_multiple_of(*every)..=end_of(episode)).step_by(*every as usize).collect()
        };
        let mut told: Vec<&ExpectedEpisode> = told.iter().filter(|episode| rows_of(episode).len() > 1).collect();
        // Sorted by their ends, then by environment. The end of the recording is after all others.
        told.sort_by_key(|episode| (if episode.ended { end_of(episode) } else { u64::MAX }, episode.env));
        assert_eq!(episodes.len(), told.len(), "every {every}");
        for (episode, told) in episodes.iter().map(list).zip(told) {
            let rows = rows_of(told);
            let frames = rows.len() - 1;
            assert_eq!(episode.len(), frames, "every {every}");
            // A frame has the rewards until the next row. The last frame also has those until the end of the episode.
            let mut wanted = vec![0.0; frames];
            for (k, reward) in told.rewards.iter().enumerate() {
                let at = told.begin + u64::from(DECIMATION) * (k as u64 + 1);
                // A reward before the first row is in no frame.
                if let Some(frame) = rows.iter().rposition(|row| *row < at) {
                    wanted[frame.min(frames - 1)] += reward;
                }
            }
            for (k, (frame, reward)) in episode.iter().zip(wanted).enumerate() {
                assert_eq!(number(&frame["reward"]), f64::from(reward as f32), "every {every}: {told:?}");
                assert_eq!(frame["done"], json!(k + 1 == frames && told.ended), "every {every}");
            }
        }
    }
}

/// Archives and messages have task results at the time of the step.
#[test]
fn archive_and_messages() {
    let folder = tempfile::tempdir().unwrap();
    let (npz, mcap) = (folder.path().join("run.npz"), folder.path().join("run.mcap"));
    let told = run(&[(&npz, 5), (&mcap, 5)]);
    for (path, topics, fields) in [
        (npz, ["task"; 3], ["reward[0]", "terminated[0]", "truncated[0]"]),
        (mcap, ["task/reward", "task/terminated", "task/truncated"], ["data[0]"; 3]),
    ] {
        let recording = Recording::open(&path).unwrap();
        for env in 0..ENVS {
            let wanted = [0, 1, 2].map(|k| FieldSelector::new(format!("/env_{env}/{}", topics[k]), fields[k]));
            let samples = recording.time_series(&wanted).unwrap();
            let rewards: Vec<f64> = told.iter().filter(|e| e.env == env).flat_map(|e| e.rewards.clone()).collect();
            assert_eq!(samples[0].values, rewards, "{}", path.display());
            for (k, time) in samples[0].times.iter().enumerate() {
                assert!((time - 0.02 * (k + 1) as f64).abs() < 1e-9, "{}: {:?}", path.display(), samples[0].times);
            }
            let ends = samples[1].values.iter().zip(&samples[2].values).filter(|(a, b)| **a + **b > 0.0).count();
            assert_eq!(ends, told.iter().filter(|episode| episode.env == env && episode.ended).count());
        }
    }
}

/// The observer of a program with its own task.
struct OwnTask;

impl Observer for OwnTask {
    fn due_in(&self, _: &SimulationManager) -> u64 {
        u64::MAX
    }

    fn on_event(&mut self, _: &mut SimulationManager, _: &SimEvent) {}

    fn publishes(&self, event: TypeId) -> bool {
        event == TypeId::of::<StepResult>()
    }
}

/// A program with its own task publishes the results itself. A recording without a task has no results.
#[test]
fn own_task() {
    let (_folder, path) = scratch("run.npz");
    let mut sim = task().into_sim();
    let cfg = RecorderCfg::new(&path).with_topics([Topic::TaskResults]);
    kinetoscope_testkit::error_tables::assert_error(sim.record(cfg.clone()), "NoTask", &["Env"]);
    record(&mut sim, RecorderCfg::new(&path), |sim| sim.update(3));
    assert!(Recording::open(&path).unwrap().topic("task", None).is_err());

    let mut sim = task().into_sim();
    assert!(!sim.observers().is_published::<StepResult>());
    sim.observers_mut().add(OwnTask);
    assert!(sim.observers().is_published::<StepResult>());
    let outcome = |reward: f64, count: usize| {
        let ends = Array1::from_elem(ENVS, false);
        let rewards = (0..count).map(|env| reward + env as f64).collect();
        StepResult { rewards, terminated: ends.clone(), truncated: ends }
    };
    record(&mut sim, overwriting(cfg), |sim| {
        for step in 0..4 {
            sim.update(2);
            outcome(f64::from(step), ENVS).publish(sim).unwrap();
            // An array with one number too few is refused and not recorded.
            let error = outcome(100.0, ENVS - 1).publish(sim).unwrap_err().to_string();
            assert!(error.contains("rewards"), "{error}");
        }
    });
    let samples =
        Recording::open(&path).unwrap().time_series(&[FieldSelector::new("/env_2/task", "reward[0]")]).unwrap();
    assert_eq!(samples[0].values, [2.0, 3.0, 4.0, 5.0]);
}
