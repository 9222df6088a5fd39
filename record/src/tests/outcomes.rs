//! Rewards and ends of a task, as datasets and other recordings have them.

use super::readers::{python, said};
use env::{
    ActionTerm, Env, EnvBuilder, EnvCfg, EventTerm, ObservationTerm, RewardTerm, Space, TerminationTerm,
};
use ndarray::{Array2, array};
use super::*;
use sim::{JointIndex, MjcfFile, Outcome};
use std::path::Path;

const ENVS: usize = 3;
/// Physics steps in a step of the task.
const DECIMATION: u32 = 2;
/// Steps of the longest episode.
const EPISODE: u64 = 7;
const STEPS: usize = 25;

/// A cart on a rail that is pushed, rewarded for being elsewhere in every step, and lost when it is too far away.
fn task() -> Env {
    let cart = r#"<mujoco><worldbody><body name="rail"><geom size="0.01"/><body name="cart">
        <joint name="slide" type="slide" axis="1 0 0"/><geom size="0.1" mass="2"/></body></body></worldbody></mujoco>"#;
    let cfg = SimulationManagerCfg { num_envs: ENVS, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let cart = sim
        .add_robot(RobotCfg {
            uid: "cart".into(),
            mjcf: Some(MjcfFile::text(cart)),
            drive: DriveCfg { drive_type: DriveType::None, ..Default::default() },
            ..Default::default()
        })
        .unwrap();
    let push = Space::uniform(["slide"], [-1e5, 1e5]).unwrap();
    EnvBuilder::new(sim, EnvCfg { decimation: DECIMATION, episode_steps: Some(EPISODE) })
        .action(ActionTerm::new("push", push, move |sim, forces| Ok(sim.robot_mut(cart).set_qf(forces, None, None)?)))
        .observation(ObservationTerm::new("place", ["slide"], move |now| Ok(now.sim().robot(cart).get_qpos())))
        .reward(RewardTerm::new("place", 3.0, move |now| Ok(now.sim().robot(cart).get_qpos().column(0).to_owned())))
        .termination(TerminationTerm::new("far", move |now| {
            Ok(now.sim().robot(cart).get_qpos().column(0).mapv(|x| x.abs() > 0.1))
        }))
        .event(EventTerm::on_reset("scatter", move |sim, dice| {
            for die in dice {
                let start = array![[die.between(-0.05, 0.05)]];
                sim.robot_mut(cart).write_qpos(&start, Some(&[JointIndex(0)]), Some(&[die.env()]))?;
            }
            Ok(())
        }))
        .build()
        .unwrap()
}

/// An episode as the task tells it: what each of its steps earned, and whether it has ended.
#[derive(Clone, Debug, Default, PartialEq)]
struct Told {
    env: usize,
    /// Physics steps before it.
    begin: u64,
    rewards: Vec<f64>,
    ended: bool,
}

/// Runs the task with recorders, and gives its episodes in the order in which they begin.
fn run(cfgs: &[RecorderCfg]) -> Vec<Told> {
    let mut env = task();
    let recorders: Vec<RecorderId> = cfgs.iter().map(|cfg| env.sim_mut().record(cfg.clone()).unwrap()).collect();
    env.reset(None, Some(3)).unwrap();
    let mut all: Vec<Told> = (0..ENVS).map(|env| Told { env, ..Told::default() }).collect();
    let mut now: Vec<usize> = (0..ENVS).collect();
    for step in 0..STEPS {
        // Each environment otherwise: the last is pushed so hard that it is lost.
        let actions = Array2::from_shape_fn((ENVS, 1), |(env, _)| 1e4 * env as f64 * (1.0 + 0.1 * step as f64));
        let done = env.step(&actions).unwrap();
        for k in 0..ENVS {
            let episode = &mut all[now[k]];
            episode.rewards.push(done.rewards[k]);
            episode.ended = done.terminated[k] || done.truncated[k];
            if episode.ended {
                now[k] = all.len();
                let begin = u64::from(DECIMATION) * (step as u64 + 1);
                all.push(Told { env: k, begin, ..Told::default() });
            }
        }
    }
    recorders.into_iter().for_each(|recorder| drop(env.sim_mut().finish_recording(recorder).unwrap()));
    // One that has just begun has no frame.
    all.retain(|episode| !episode.rewards.is_empty());
    let is_long = |episode: &Told| episode.ended && episode.rewards.len() == EPISODE as usize;
    assert!(all.iter().any(is_long) && all.iter().any(|episode| episode.ended && !is_long(episode)), "{all:?}");
    assert!(all.iter().any(|episode| !episode.ended), "one is broken off: {all:?}");
    all
}

fn number(text: &serde_json::Value) -> f64 {
    f64::from_bits(text.as_str().unwrap().parse().unwrap())
}

fn numbers(values: &serde_json::Value) -> Vec<f64> {
    values.as_array().unwrap().iter().map(number).collect()
}

fn cfg(path: &Path, every: u64) -> RecorderCfg {
    RecorderCfg { every, ..RecorderCfg::new(path) }
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn robomimic_has_rewards_ends_and_states() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let [each, finer, coarser] = [2, 1, 4].map(|every| (every, folder.path().join(format!("{every}.hdf5"))));
    let told = run(&[&each, &finer, &coarser].map(|(every, path)| cfg(path, *every)));
    for (every, path) in [each, finer, coarser] {
        let found = said(&python, "read_hdf5.py", &path);
        let episodes = found["episodes"].as_array().unwrap();
        // The rows of an episode are at multiples of `every`, and each but the last is a frame.
        let rows_of = |episode: &Told| -> Vec<u64> {
            let end = episode.begin + u64::from(DECIMATION) * episode.rewards.len() as u64;
            (episode.begin.next_multiple_of(every)..=end).step_by(every as usize).collect()
        };
        let mut told: Vec<&Told> = told.iter().filter(|episode| rows_of(episode).len() > 1).collect();
        // In the order of their first whole frames, those of a row in the order of environments.
        told.sort_by_key(|episode| (rows_of(episode)[1], episode.env));
        assert_eq!(episodes.len(), told.len(), "every {every}");
        for (episode, told) in episodes.iter().zip(told) {
            let rows = rows_of(told);
            let frames = rows.len() - 1;
            assert_eq!(episode["frames"], serde_json::json!(frames), "every {every}");
            assert_eq!(episode["env"], serde_json::json!(told.env));
            // A frame has what came until the row after it; the last one what came until the end.
            let mut wanted = vec![0.0; frames];
            for (k, reward) in told.rewards.iter().enumerate() {
                let at = told.begin + u64::from(DECIMATION) * (k as u64 + 1);
                // What came before the first row is of no frame.
                if let Some(frame) = rows.iter().rposition(|row| *row < at) {
                    wanted[frame.min(frames - 1)] += reward;
                }
            }
            assert_eq!(numbers(&episode["numbers"]["rewards"]), wanted, "every {every}: {told:?}");
            let dones: Vec<u64> = (1..=frames).map(|k| u64::from(k == frames && told.ended)).collect();
            assert_eq!(episode["numbers"]["dones"], serde_json::json!(dones), "every {every}");
            // One joint: time, position, velocity.
            let table =
                |name: &str| episode["numbers"][name].as_array().unwrap().iter().map(numbers).collect::<Vec<_>>();
            let (states, q, v) = (table("states"), table("obs/joint_pos"), table("obs/joint_vel"));
            for (k, state) in states.iter().enumerate() {
                // Sums of some dozen steps of 10 ms.
                let time = 0.01 * (rows[k] - told.begin) as f64;
                assert!((state[0] - time).abs() < 1e-12, "every {every}: {state:?}");
                assert_eq!(state[1..], [q[k][0], v[k][0]], "every {every}");
            }
        }
    }
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn lerobot_has_rewards_and_ends() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.lerobot");
    let told = run(&[cfg(&path, u64::from(DECIMATION))]);
    let found = said(&python, "read_lerobot.py", &path);
    let episodes = found["episodes"].as_array().unwrap();
    assert_eq!(episodes.len(), told.len());
    for (episode, told) in episodes.iter().zip(&told) {
        let frames = episode.as_array().unwrap();
        let rewards: Vec<f64> = frames.iter().map(|frame| number(&frame["reward"])).collect();
        assert_eq!(rewards, told.rewards.iter().map(|x| f64::from(*x as f32)).collect::<Vec<_>>());
        let ends: Vec<bool> = frames.iter().map(|frame| frame["done"].as_bool().unwrap()).collect();
        assert_eq!(ends, (1..=frames.len()).map(|k| k == frames.len() && told.ended).collect::<Vec<_>>());
    }
}

#[test]
fn archives_and_messages_have_them_at_the_time_of_the_step() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["run.npz", "run.mcap"].map(|name| folder.path().join(name));
    let told = run(&paths.each_ref().map(|path| cfg(path, 5)));
    for path in paths {
        let recording = Recording::open(&path).unwrap();
        let (topics, field) = match path.extension().is_some_and(|end| end == "npz") {
            true => (["task"; 3], ["reward[0]", "terminated[0]", "truncated[0]"]),
            false => (["task/reward", "task/terminated", "task/truncated"], ["data[0]"; 3]),
        };
        for env in 0..ENVS {
            let wanted: Vec<Wanted> = topics
                .iter()
                .zip(field)
                .map(|(topic, field)| Wanted::new(format!("/env_{env}/{topic}"), field))
                .collect();
            let samples = recording.samples(&wanted).unwrap();
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

#[test]
fn without_a_task_nothing_is_made_up() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let mut sim = task().into_sim();
    let error = sim.record(RecorderCfg::new(&path).with_topics([Topic::Outcomes])).unwrap_err();
    assert!(matches!(error, RecordError::NoTask { .. }) && error.to_string().contains("Env"), "{error}");
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(3);
    sim.finish_recording(recorder).unwrap();
    assert!(Recording::open(&path).unwrap().topic("task", None).is_err());
}

/// A task that is no `Env` tells by itself.
#[test]
fn whoever_has_a_task_tells_what_comes_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let mut sim = task().into_sim();
    assert_eq!(sim.outcome(), None);
    sim.begin_task();
    assert_eq!(sim.outcome().map(|outcome| outcome.rewards.to_vec()), Some(vec![0.0; ENVS]));
    let recorder = sim.record(RecorderCfg::new(&path).with_topics([Topic::Outcomes])).unwrap();
    let outcome = |reward: f64, count: usize| {
        let ends = ndarray::Array1::from_elem(ENVS, false);
        let rewards = (0..count).map(|env| reward + env as f64).collect();
        Outcome { rewards, terminated: ends.clone(), truncated: ends }
    };
    for step in 0..4 {
        sim.update(2);
        sim.judge(outcome(f64::from(step), ENVS)).unwrap();
        // One number too few is told to nobody.
        let error = sim.judge(outcome(100.0, ENVS - 1)).unwrap_err().to_string();
        assert!(error.contains("rewards"), "{error}");
        assert_eq!(sim.outcome(), Some(&outcome(f64::from(step), ENVS)));
    }
    sim.finish_recording(recorder).unwrap();
    let wanted = [Wanted::new("/env_2/task", "reward[0]")];
    let samples = Recording::open(&path).unwrap().samples(&wanted).unwrap();
    assert_eq!(samples[0].values, [2.0, 3.0, 4.0, 5.0]);
}
