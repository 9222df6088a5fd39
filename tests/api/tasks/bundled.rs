//! Worlds and tasks of the task tests.

use kinetoscope::ndarray::{Array2, Array3, ArrayView2, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::WrenchFrame;
use kinetoscope::tasks::{
    ActionTerm, AutoresetMode, CommandTerm, Env, EnvBuilder, EnvCfg, EventMode, EventTerm, Noise, ObservationTerm,
    RewardTerm, Space, TerminationTerm, terms,
};
use kinetoscope_testkit::worlds::{mjcf_robot, passive};

/// A cart of 1 kg on a rail, and optionally a pole of 0.1 kg and 0.5 m on it.
pub(crate) fn cart(with_pole: bool) -> String {
    let pole = r#"<body name="pole"><joint name="hinge" type="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.02" mass="0.1"/></body>"#;
    format!(
        r#"<mujoco><worldbody><body name="rail" pos="0 0 1"><geom size="0.01" mass="1"/><body name="cart">
             <joint name="slide" type="slide" axis="1 0 0"/><geom type="box" size="0.1 0.05 0.05" mass="1"/>
             {}</body></body></worldbody></mujoco>"#,
        if with_pole { pole } else { "" }
    )
}

pub(crate) fn cfg(num_envs: usize, threads: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { ground: None, seed: 3, ..kinetoscope_testkit::worlds::cfg(num_envs, threads) }
}

/// A world with a cart whose joints are passive.
pub(crate) fn world(cfg: SimulationManagerCfg, with_pole: bool) -> (SimulationManager, RobotId) {
    let mut sim = SimulationManager::new(cfg).unwrap();
    let robot = sim.add_robot(passive(mjcf_robot("cart", &cart(with_pole)))).unwrap();
    (sim, robot)
}

/// A task that pushes the cart, observes its position, and rewards staying near 0.
pub(crate) fn cart_task(sim: SimulationManager, robot: RobotId, cfg: EnvCfg) -> EnvBuilder {
    let push = terms::joint_efforts(&sim, "push", robot, &["slide"], 10.0).unwrap();
    EnvBuilder::new(sim, cfg)
        .action(push)
        .observation(ObservationTerm::new("place", ["x"], move |now| {
            Ok(now.sim().robot(robot).qpos().select(Axis(1), &[0]))
        }))
        .reward(RewardTerm::new("x", -1.0, move |now| Ok(now.sim().robot(robot).qpos().column(0).to_owned())))
}

/// A cart task without a pole.
pub(crate) fn cart_env(num_envs: usize, episode_steps: Option<u64>) -> Env {
    let (sim, robot) = world(cfg(num_envs, 2), false);
    cart_task(sim, robot, EnvCfg { episode_steps, ..Default::default() }).build().unwrap()
}

/// A task with every kind of term: a pole on a cart with noise, commands, pushes, randomized masses and random starts.
pub(crate) fn all_terms_task(cfg: SimulationManagerCfg) -> Env {
    all_terms_task_in(cfg, AutoresetMode::SameStep)
}

/// The same task with a mode of automatic resets.
pub(crate) fn all_terms_task_in(cfg: SimulationManagerCfg, autoreset: AutoresetMode) -> Env {
    let (sim, robot) = world(cfg, true);
    let push = terms::joint_efforts(&sim, "push", robot, &["slide"], 10.0).unwrap();
    let positions = terms::joint_pos_rel(&sim, "positions", robot, &[".*"]).unwrap();
    let velocities = terms::joint_vel(&sim, "velocities", robot, &["hinge", "slide"]).unwrap();
    let pole = sim.robot(robot).link_id("pole").unwrap();
    EnvBuilder::new(sim, EnvCfg { decimation: 2, episode_steps: Some(40), autoreset })
        .action(push)
        .command(CommandTerm::new("goal", ["x"], |rng| [rng.uniform_range(-0.5, 0.5)]))
        .event(EventTerm::new("masses", EventMode::Startup, |sim, rng| {
            for die in rng {
                let mass = die.uniform_range(0.5, 2.0);
                sim.properties_mut().randomize_with(Some(&[die.env()]), |_, _, properties| {
                    properties.set(Property::Mass, "cart/cart", &[mass])?;
                    Ok(())
                })?;
            }
            Ok(())
        }))
        .event(EventTerm::on_reset("start", move |sim, rng| {
            for die in rng {
                let start = array![[die.uniform_range(-0.2, 0.2), die.uniform_range(-0.1, 0.1)]];
                sim.robot_mut(robot).write_qpos(&start, None, Some(&[die.env()]))?;
            }
            Ok(())
        }))
        .event(EventTerm::new("gust", EventMode::Interval { steps: [5, 15] }, move |sim, rng| {
            for die in rng {
                let force = array![[[0.2 * die.normal(), 0.0, 0.0]]];
                let (none, world) = (Array3::zeros((1, 1, 3)), WrenchFrame::World);
                sim.robot_mut(robot).set_external_wrench(&force, &none, world, Some(&[pole]), Some(&[die.env()]))?;
            }
            Ok(())
        }))
        .observation(positions.with_noise(Noise::Normal { std: 0.01 }))
        .observation(velocities.with_noise(Noise::Uniform { low: -0.1, high: 0.1 }).clipped([-5.0, 5.0]).scaled(0.1))
        .observation(terms::generated_commands("goal", "goal", ["x"]))
        .observation(terms::last_action("action", ["slide"]))
        .reward(terms::is_alive("alive", 1.0))
        .reward(RewardTerm::new("near", -0.5, move |now| {
            let (qpos, goal) = (now.sim().robot(robot).qpos(), now.command("goal")?);
            Ok((&qpos.column(0) - &goal.column(0)).mapv(f64::abs))
        }))
        .reward(terms::action_rate("smooth", -1e-3))
        .termination(TerminationTerm::new("fell", move |now| {
            Ok(now.sim().robot(robot).qpos().column(1).mapv(|angle| angle.abs() > 0.3))
        }))
        .build()
        .unwrap()
}

/// A policy that balances the pole for a while; it depends only on the row of observations.
pub(crate) fn policy(o: ArrayView2<'_, f64>) -> Array2<f64> {
    let force = |(e, _): (usize, usize)| 25.0 * o[(e, 1)] + 30.0 * o[(e, 2)] + 3.0 * (o[(e, 0)] - o[(e, 4)]);
    Array2::from_shape_fn((o.nrows(), 1), force)
}

/// An action without effect, with one column.
pub(crate) fn idle() -> ActionTerm {
    ActionTerm::new("idle", Space::uniform(["a"], [-1.0, 1.0]).unwrap(), |_, _| Ok(()))
}
