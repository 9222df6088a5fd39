//! The state of a robot that terms share is the present one in every term, in every mode of automatic resets.

use super::bundled::{cfg, idle, world};
use kinetoscope::ndarray::{Array1, Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::RobotState;
use kinetoscope::tasks::{
    AutoresetMode, CommandTerm, CurriculumTerm, EnvBuilder, EnvCfg, EventMode, EventTerm, ObservationTerm, RewardTerm,
    TerminationTerm,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Compares a shared state with one that is gathered now, and counts the comparisons.
#[derive(Clone)]
struct Check {
    robot: RobotId,
    count: Arc<[AtomicUsize; 6]>,
}

impl Check {
    fn compare(&self, term: usize, sim: &SimulationManager, shared: &RobotState) {
        let robot = sim.robot(self.robot);
        assert!(shared.qpos() == robot.qpos() && shared.qvel() == robot.qvel(), "term {term}: another state");
        assert!(shared.root_pose() == robot.root_pose(), "term {term}: another pose");
        self.count[term].fetch_add(1, Ordering::Relaxed);
    }
}

#[test]
fn every_term() {
    for autoreset in [AutoresetMode::SameStep, AutoresetMode::NextStep, AutoresetMode::Disabled] {
        let (sim, robot) = world(cfg(4, 2), true);
        let check = Check { robot, count: Arc::default() };
        let [one, two, three, four, five, six] = std::array::from_fn(|_| check.clone());
        let n = 4;
        let mut env = EnvBuilder::new(sim, EnvCfg { decimation: 2, episode_steps: Some(5), autoreset })
            .action(idle())
            .termination(TerminationTerm::new("end", move |now| {
                one.compare(0, now.sim(), now.robot(robot));
                Ok(Array1::from_shape_fn(n, |env| now.episode_steps()[env] == env as u64 + 2))
            }))
            .reward(RewardTerm::new("zero", 1.0, move |now| {
                two.compare(1, now.sim(), now.robot(robot));
                Ok(Array1::zeros(n))
            }))
            .event(EventTerm::with_context("push", EventMode::Interval { steps: [1, 2] }, move |now, rngs| {
                three.compare(2, now.sim(), now.robot(robot));
                let envs = kinetoscope::tasks::env_ids(rngs);
                let speed = array![[rngs[0].uniform(), -1.0]];
                now.sim_mut().robot_mut(robot).write_qvel(&speed, None, Some(&envs))?;
                three.compare(2, now.sim(), now.robot(robot));
                Ok(())
            }))
            .event(EventTerm::on_reset("start", move |sim, rngs| {
                for rng in rngs {
                    let start = array![[rng.uniform(), 0.1]];
                    sim.robot_mut(robot).write_qpos(&start, None, Some(&[rng.env()]))?;
                }
                Ok(())
            }))
            .curriculum(CurriculumTerm::new(
                "level",
                |_| 0.0,
                move |now, rngs, _| {
                    four.compare(3, now.sim(), now.robot(robot));
                    Ok(vec![0.0; rngs.len()])
                },
            ))
            .command(CommandTerm::derived(
                "goal",
                ["x"],
                |_| [0.0],
                move |now, _| {
                    five.compare(4, now.sim(), now.robot(robot));
                    Ok(Array2::zeros((n, 1)))
                },
            ))
            .observation(ObservationTerm::new("at", ["slide", "hinge"], move |now| {
                six.compare(5, now.sim(), now.robot(robot));
                Ok(now.robot(robot).qpos().to_owned())
            }))
            .build()
            .unwrap();
        env.reset(None, Some(1)).unwrap();
        for _ in 0..20 {
            let step = env.step(&Array2::zeros((n, 1))).unwrap();
            assert_eq!(step.observations, env.sim().robot(robot).qpos());
            if autoreset == AutoresetMode::Disabled && !step.info.ended.is_empty() {
                let mut mask = vec![false; n];
                step.info.ended.iter().for_each(|ended| mask[ended.env.0] = true);
                env.reset(Some(&mask), None).unwrap();
            }
            // A change between two steps.
            env.sim_mut().robot_mut(robot).write_qpos(&array![[0.3, 0.2]], None, Some(&[EnvId(1)])).unwrap();
            assert!(env.context().robot(robot).qpos() == env.sim().robot(robot).qpos());
        }
        let counts = check.count.each_ref().map(|count| count.load(Ordering::Relaxed));
        assert!(counts.iter().all(|count| *count > 10), "{counts:?}");
    }
}
