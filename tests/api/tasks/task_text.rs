//! Tasks as text: the same bits as tasks from functions, and errors with candidates.

use super::bundled::{cfg, world};
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::tasks::{
    AutoresetMode, Env, EnvBuilder, EnvCfg, EnvError, Noise, RewardTerm, TaskCfg, TermKind, TermRegistry, terms,
};
use kinetoscope_testkit::bits::bits;

const TASK: &str = r#"
decimation = 2
episode_steps = 20
autoreset = "NEXT_STEP"

[actions.push]
type = "joint_efforts"
robot = "cart"
joints = ["slide"]
bound = 10

[observations.policy.positions]
type = "joint_pos_rel"
noise = { std = 0.01 }
clip = [-1, 1]
scale = 2

[observations.policy.action]
type = "last_action"

[observations.critic.velocities]
type = "joint_vel"
joints = ["hinge", "slide"]
noise = { low = -0.1, high = 0.1 }

[rewards.alive]
type = "is_alive"
weight = 1.0

[rewards.smooth]
type = "action_rate"
weight = -0.001

[terminations.limits]
type = "joint_out_of_limits"
truncating = true

[events.start]
type = "reset_joints_by_offset"
positions = [-0.1, 0.1]
"#;

fn of_text(text: &str) -> Result<Env, EnvError> {
    let cfg = TaskCfg::from_toml(text)?;
    EnvBuilder::from_cfg(world(super::bundled::cfg(3, 1), true).0, &cfg, &TermRegistry::default())?.build()
}

fn of_functions() -> Env {
    let (sim, robot) = world(cfg(3, 1), true);
    let every = &[".*"];
    let positions = terms::joint_pos_rel(&sim, "positions", robot, every).unwrap();
    let velocities = terms::joint_vel(&sim, "velocities", robot, &["hinge", "slide"]).unwrap();
    let start = terms::reset_joints_by_offset(&sim, "start", robot, every, [-0.1, 0.1], [0.0; 2]).unwrap();
    let limits = terms::joint_out_of_limits(&sim, "limits", robot, every).unwrap();
    let push = terms::joint_efforts(&sim, "push", robot, &["slide"], 10.0).unwrap();
    let cfg = EnvCfg { decimation: 2, episode_steps: Some(20), autoreset: AutoresetMode::NextStep };
    EnvBuilder::new(sim, cfg)
        .action(push)
        .observation(positions.with_noise(Noise::Normal { std: 0.01 }).clipped([-1.0, 1.0]).scaled(2.0))
        .observation(terms::last_action("action", ["push/slide"]))
        .observation_in("critic", velocities.with_noise(Noise::Uniform { low: -0.1, high: 0.1 }))
        .reward(terms::is_alive("alive", 1.0))
        .reward(terms::action_rate("smooth", -0.001))
        .termination(limits.truncating())
        .event(start)
        .build()
        .unwrap()
}

#[test]
fn same_bits() {
    let run = |mut env: Env| {
        let mut all = bits(&env.reset(None, Some(7)).unwrap());
        assert_eq!(env.observation_space().names(), ["positions/slide", "positions/hinge", "action/push/slide"]);
        for k in 0..50 {
            let step = env.step(&Array2::from_shape_fn((3, 1), |(e, _)| e as f64 - f64::from(k % 5))).unwrap();
            all.extend([bits(&step.observations), bits(&step.rewards)].concat());
            all.extend(bits(env.group("critic").unwrap().observations()));
            all.extend(step.truncated.iter().map(|over| u64::from(*over)));
        }
        all
    };
    assert!(run(of_text(TASK).unwrap()) == run(of_functions()));
    // Control: another number in the text.
    assert!(run(of_text(&TASK.replace("scale = 2", "scale = 2.001")).unwrap()) != run(of_functions()));
}

/// A command with columns, before the rewards.
fn command(columns: &str) -> String {
    format!("[commands.goal]\ntype = \"uniform_command\"\n[commands.goal.columns]\n{columns}\n[rewards.alive]")
}

const EFFORTS: &str = "type = \"joint_efforts\"\nrobot = \"cart\"\njoints = [\"slide\"]\nbound = 10";
const LIMITS: &str = "type = \"joint_out_of_limits\"";
const START: &str = "type = \"reset_joints_by_offset\"\npositions = [-0.1, 0.1]";
const ALIVE: &str = "[rewards.alive]\ntype = \"is_alive\"";

/// A reward for tracking a command with columns.
fn tracking(of_type: &str, columns: &str, std: &str) -> String {
    command(columns) + &format!("\ntype = \"{of_type}\"\ncommand = \"goal\"\nstd = {std}")
}

/// An event that randomizes masses.
fn mass(keys: &str, op: &str) -> String {
    format!("type = \"randomize_mass\"\n{keys}\nop = {{ {op} }}")
}

/// Each row replaces a part of the text and names the words of the error.
#[test]
fn mistakes() {
    for (from, to, words) in [
        ("decimation", "decimatoin", &["decimatoin", "decimation"][..]),
        ("NEXT_STEP", "NEXT_STOP", &["autoreset mode", "NEXT_STOP", "next_step"]),
        ("decimation = 2", "decimation = 0", &["decimation is 0"]),
        (
            "joint_efforts",
            "joint_effordts",
            &["actions.push", "type of action term", "joint_effordts", "joint_efforts"],
        ),
        ("robot = \"cart\"", "robot = \"card\"", &["actions.push", "robot", "card", "cart"]),
        ("joints = [\"slide\"]", "joints = [\"slidr\"]", &["actions.push", "slidr", "slide"]),
        ("bound = 10", "bond = 10", &["actions.push", "bond", "bound"]),
        ("bound = 10", "", &["actions.push", "missing field", "bound"]),
        ("bound = 10", "bound = \"high\"", &["actions.push", "high"]),
        ("\"joint_pos_rel\"", "\"joint_pos_relative\"", &["observations.policy.positions", "joint_pos_rel"]),
        ("\"joint_pos_rel\"", "\"camera_rbg\"", &["observations.policy.positions", "camera_rgb"]),
        ("std = 0.01", "sdt = 0.01", &["observations.policy.positions.noise"]),
        ("std = 0.01", "std = -1", &["noise of the observation term \"positions\""]),
        ("scale = 2", "scale = true", &["observations.policy.positions.scale"]),
        ("weight = 1.0", "", &["rewards.alive", "weight"]),
        ("weight = 1.0", "weight = 1.0\nrobot = \"cart\"", &["rewards.alive", "robot"]),
        ("type = \"is_alive\"", "", &["rewards.alive", "type"]),
        ("truncating = true", "truncating = 1", &["terminations.limits.truncating"]),
        ("[rewards.alive]", "[rewards]\nalive = 3\n[rewards.other]", &["rewards.alive", "table"]),
        ("[rewards.alive]", "[reward.alive]", &["reward", "rewards"]),
        (
            "type = \"last_action\"",
            "type = \"generated_commands\"\ncommand = \"goal\"",
            &["observations.policy.action", "goal"],
        ),
        (
            "type = \"last_action\"",
            "type = \"camera_rgb\"\ncamera = \"eye\"",
            &["observations.policy.action", "sensor", "eye"],
        ),
        ("positions = [-0.1, 0.1]", "positions = [-0.1]", &["events.start"]),
        // Numbers are drawn from reversed ranges as from ranges in order, which hides the mistake.
        ("positions = [-0.1, 0.1]", "positions = [0.1, -0.1]", &["events.start", "positions", "0.1 to -0.1"]),
        (
            "positions = [-0.1, 0.1]",
            "positions = [0, 0]\nvelocities = [0, nan]",
            &["events.start", "velocities", "finite"],
        ),
        (
            "type = \"reset_joints_by_offset\"\npositions = [-0.1, 0.1]",
            "type = \"reset_root_uniform\"\nrpy = [[0, 0], [0, 0], [1, -1]]",
            &["events.start", "rpy", "1 to -1"],
        ),
        (
            "[rewards.alive]",
            "[observations.angles]\ntype = \"joint_pos_rel\"\n[rewards.alive]",
            &["observations.policy.angles"],
        ),
        ("[rewards.alive]", &*command("x = [2, 1]"), &["commands.goal", "x of the command term", "2 to 1"]),
        ("[rewards.alive]", &*command("x = 2"), &["commands.goal", "columns.x"]),
        ("[rewards.alive]", &*command(""), &["commands.goal", "at least one column"]),
        ("[rewards.alive]", &*command("x = [1, 2]\ny = [1, 2, 3]"), &["commands.goal", "columns.y"]),
        (EFFORTS, "type = \"joint_positions\"\nscale = { slidr = 2 }", &["actions.push", "scale", "slidr", "slide"]),
        (EFFORTS, "type = \"joint_positions\"\nscale = nan", &["actions.push", "scale", "NaN", "finite"]),
        (EFFORTS, "type = \"joint_positions\"\nclip = [1, -1]", &["actions.push", "bounds of column", "slide"]),
        (EFFORTS, "type = \"relative_joint_positions\"\nstep = nan", &["actions.push", "step", "NaN"]),
        (ALIVE, &*tracking("track_lin_vel", "x = [0, 1]", "1"), &["rewards.alive", "1 columns", "at least 2"]),
        (ALIVE, &*tracking("track_ang_vel", "x = [0, 1]\ny = [0, 1]", "1"), &["rewards.alive", "at least 3"]),
        (ALIVE, &*tracking("track_lin_vel", "x = [0, 1]\ny = [0, 1]", "0"), &["rewards.alive", "std is 0"]),
        (
            "type = \"is_alive\"",
            "type = \"feet_air_time\"\nsensor = \"feet\"\ncommand = \"goal\"\nthreshold = 0.5",
            &["rewards.alive", "command", "goal"],
        ),
        (
            "type = \"is_alive\"",
            "type = \"undesired_contacts\"\nsensor = \"feet\"\nforce = 1",
            &["rewards.alive", "sensor", "feet"],
        ),
        (LIMITS, "type = \"root_height_below_minimum\"\nheight = nan", &["terminations.limits", "height is NaN"]),
        (LIMITS, "type = \"bad_orientation\"\nangle = inf", &["terminations.limits", "angle is inf"]),
        (START, &*mass("bodies = [\"cart/crat\"]", "scale = [1, 2]"), &["events.start", "bodies", "crat", "cart/cart"]),
        (START, &*mass("bodies = [\"cart/cart\"]", "scale = [2, 1]"), &["events.start", "2 to 1"]),
        (START, &*mass("bodies = [\"cart/cart\"]", "multiply = [1, 2]"), &["events.start", "multiply", "scale"]),
        (
            START,
            &*mass("bodies = [\"cart/cart\"]\nmode = \"start\"", "scale = [1, 2]"),
            &["events.start", "start", "startup"],
        ),
        (
            START,
            &*mass("bodies = [\"cart/cart\"]\nmode = { interval = [0, 3] }", "scale = [1, 2]"),
            &["the interval of the event term", "0 to 3"],
        ),
        (
            START,
            "type = \"push_by_setting_velocity\"\nmode = \"reset\"\nlinear = [[1, 0], [0, 0], [0, 0]]",
            &["events.start", "linear", "1 to 0"],
        ),
        (START, "type = \"push_by_setting_velocity\"", &["events.start", "missing field", "mode"]),
    ] {
        assert!(TASK.contains(from), "{from}");
        let error = of_text(&TASK.replacen(from, to, 1)).map(drop).expect_err(to).to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{to:?}: {error} lacks one of {words:?}");
    }
    let error = of_text("").map(drop).unwrap_err();
    assert!(matches!(error, EnvError::NoTerm { kind: TermKind::Action }), "{error}");
}

/// A program adds types of its own.
#[test]
fn own_types() {
    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Params {
        offset: f64,
    }
    let mut registry = TermRegistry::default();
    registry.add_reward("own", |args| {
        let (Params { offset }, robot) = (args.params()?, args.robot(None)?);
        Ok(RewardTerm::new(args.name(), args.weight(), move |now| {
            Ok(now.sim().robot(robot).qpos().index_axis(Axis(1), 0).to_owned() + offset)
        }))
    });
    assert!(registry.names(TermKind::Reward).contains(&"own"));
    let text = TASK.replace("type = \"is_alive\"\nweight = 1.0", "type = \"own\"\noffset = 5\nweight = 2");
    let cfg = TaskCfg::from_toml(&text).unwrap();
    let (sim, _) = world(super::bundled::cfg(3, 1), true);
    let mut env = EnvBuilder::from_cfg(sim, &cfg, &registry).unwrap().build().unwrap();
    env.reset(None, Some(1)).unwrap();
    let step = env.step(&Array2::zeros((3, 1))).unwrap();
    let robot = env.sim().entities().robot_id("cart").unwrap();
    let expected = 2.0 * (env.sim().robot(robot).qpos()[(1, 0)] + 5.0);
    assert!((step.info.reward_terms[(1, 0)] - expected).abs() < 1e-12);
    let error = EnvBuilder::from_cfg(
        env.into_sim(),
        &TaskCfg::from_toml(&text.replace("offset = 5", "offzet = 5")).unwrap(),
        &registry,
    );
    assert!(error.map(drop).unwrap_err().to_string().contains("rewards.alive"));
}

/// Every ready-made term has a name, and every name is documented on the page about tasks.
#[test]
fn names() {
    let registry = TermRegistry::default();
    let page = include_str!("../../../docs/tasks.md");
    for kind in [
        TermKind::Action,
        TermKind::Command,
        TermKind::Curriculum,
        TermKind::Event,
        TermKind::Observation,
        TermKind::Reward,
        TermKind::Termination,
    ] {
        let names = registry.names(kind);
        assert!(!names.is_empty());
        for name in names {
            assert!(page.contains(&format!("`{name}`")), "docs/tasks.md lacks the {kind} term {name}");
        }
    }
}
