"""Adapters for libraries of reinforcement learning, judged by the libraries' own checks and by Gymnasium's interface of the same
task. They need torch."""

import importlib
import importlib.util
import re
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from test_sim_gymnasium import cart_task

import kinetoscope as ks
import kinetoscope.envs

LIBRARIES = {"sb3": "stable_baselines3", "rsl_rl": "rsl_rl", "skrl": "skrl", "torchrl": "torchrl", "rllib": "tree"}
PROJECT = Path(__file__).parents[2]
BALANCE = "Kinetoscope/Balance-v0"


@pytest.mark.parametrize("name", LIBRARIES)
def test_missing_libraries(name):
    """The error names the package and the command that installs it; with the library, the module is there."""
    module = f"kinetoscope.rl.{name}"
    if importlib.util.find_spec(LIBRARIES[name]) is not None:
        importlib.import_module(module)
        return
    with pytest.raises(ks.MissingPackageError, match=rf"{module} needs the package .*pip install '") as error:
        importlib.import_module(module)
    assert isinstance(error.value, ImportError)


def actions_of(space, count, steps, seed=0):
    """Random actions within the bounds, different in each environment."""
    space.seed(seed)
    return [np.stack([space.sample() for _ in range(count)]) for _ in range(steps)]


def critic_task(num_envs, autoreset):
    """Carts with an image, and with their speed as the only observation of the critic."""
    sim = ks.SimulationManager(num_envs=num_envs, threads=1)
    cart = "<mujoco><worldbody><body name='c'><joint type='slide' axis='1 0 0'/><geom size='0.1'/></body></worldbody></mujoco>"
    sim.add_robot(ks.RobotCfg(uid="cart", mjcf=ks.MjcfFile(text=cart), drive={"drive_type": "none"}))
    place = ks.Placement.look_at(eye=[1, -1, 1], target=[0, 0, 0])
    sim.add_sensor("eye", ks.CameraCfg(width=40, height=36, extrinsics=ks.Extrinsics(placement=place)))
    cfg = {
        "autoreset": autoreset,
        "episode_steps": 3,
        "actions": {"push": {"type": "joint_efforts", "bound": 5.0}},
        "observations": {
            "policy": {"place": {"type": "joint_pos_rel"}, "view": {"type": "camera_rgb", "camera": "eye"}},
            "critic": {"speed": {"type": "joint_vel"}},
        },
        "rewards": {"alive": {"type": "is_alive", "weight": 1.0}},
    }
    return ks.Task(sim, cfg, dtype="float32")


# Constructors by library, with the mode of automatic resets that the library expects.
def sb3(env, *arguments, **fields):
    from kinetoscope.rl.sb3 import Sb3VecEnv

    return Sb3VecEnv(env, *arguments, **fields)


def rsl_rl(env, *arguments, **fields):
    from kinetoscope.rl.rsl_rl import RslRlVecEnv

    return RslRlVecEnv(env, *arguments, **fields)


def skrl(env, *arguments, **fields):
    from kinetoscope.rl.skrl import SkrlEnv

    return SkrlEnv(env, *arguments, device="cpu", **fields)


def torchrl(env, *arguments, **fields):
    from kinetoscope.rl.torchrl import torchrl_env

    return torchrl_env(env, *arguments, **fields)


@pytest.mark.needs_learning
@pytest.mark.parametrize(("make", "autoreset"), [(sb3, "same_step"), (rsl_rl, "same_step"), (skrl, "same_step"), (torchrl, "disabled")])
def test_refusals_of_constructors(make, autoreset):
    def task(mode=autoreset, **changes):
        return ks.VectorEnv(cart_task(2, mode, **changes))

    for call, error, parts in [
        (lambda: make("Kinetoscope/Balanse-v0", 2), ks.UnknownNameError, ["'Kinetoscope/Balance-v0'", "Known: "]),
        (lambda: make(3), ks.ArgumentError, ["3", "VectorEnv", "Kinetoscope/Balance-v0"]),
        (lambda: make(task(), 2), ks.ArgumentError, ["num_envs", "2 environments"]),
        (lambda: make(task("next_step")), ks.ArgumentError, ["'next_step'", repr(autoreset)]),
        (lambda: make(task(dtype="float64")), ks.ArgumentError, ["float64", "float32"]),
        (lambda: make(BALANCE, 2, autoreset=autoreset), ks.ArgumentError, ["autoreset"]),
        (lambda: make(BALANCE, 0), ks.KinetoscopeError, ["num_envs"]),
    ]:
        with pytest.raises(error) as caught:
            call()
        assert all(part in str(caught.value) for part in parts), caught.value


@pytest.mark.needs_learning
def test_steps_of_sb3():
    """Judge: Stable-Baselines3's DummyVecEnv of single environments of the task."""
    from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

    from kinetoscope.vector_env import Env

    count = 4
    ours = sb3(ks.VectorEnv(cart_task(count, "same_step")))
    judge = DummyVecEnv([lambda: Env(cart_task(1, "disabled"))] * count)
    assert (ours.observation_space, ours.action_space) == (judge.observation_space, judge.action_space)
    assert ours.num_envs == count and ours.render_mode is None and ours.seed(5) == judge.seed(5)
    np.testing.assert_array_equal(ours.reset(), judge.reset())
    reasons = set()
    for actions in actions_of(ours.action_space, count, 60):
        found, expected = ours.step(actions), judge.step(actions)
        for one, other in zip(found[:3], expected[:3], strict=True):
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)
        for one, other in zip(found[3], expected[3], strict=True):
            assert one["TimeLimit.truncated"] == other["TimeLimit.truncated"]
            assert one.get("end_reason") == other.get("end_reason")
            np.testing.assert_array_equal(one.get("terminal_observation"), other.get("terminal_observation"))
            reasons.add(one.get("end_reason"))
    assert reasons == {None, "away", "time limit"}
    # A seed counts for one reset, and gives the same episodes again.
    envs = sb3(BALANCE, 3)
    envs.seed(7)
    first, second = envs.reset(), envs.reset()
    envs.seed(7)
    np.testing.assert_array_equal(envs.reset(), first)
    assert (first != second).any(axis=1).all() and (first[0] != first[1]).any()
    # Episodes by the library's own monitor: 12 steps in the carts that stay.
    monitored, lengths = VecMonitor(sb3(ks.VectorEnv(cart_task(2, "same_step")))), []
    monitored.reset()
    for _ in range(24):
        lengths += [info["episode"]["l"] for info in monitored.step(np.zeros((2, 1), np.float32))[3] if "episode" in info]
    assert lengths == [12] * 4


@pytest.mark.needs_learning
def test_methods_of_sb3():
    from stable_baselines3.common.monitor import Monitor

    envs = sb3(BALANCE, 3, render_mode="rgb_array", render_size=(40, 30))
    envs.reset()
    assert envs.render_mode == "rgb_array" and len(envs.get_images()) == 3 and envs.render().shape[2] == 3
    assert envs.get_attr("render_mode", [0, 2]) == ["rgb_array"] * 2 and envs.get_attr("step_dt", 1) == [0.02]
    assert not envs.has_attr("no_such_name") and envs.env_is_wrapped(Monitor, [1]) == [False]
    images = envs.env_method("render")
    assert len(images) == 3 and images[0].shape == (30, 40, 3)
    envs.set_attr("note", 5)
    assert envs.get_attr("note") == [5] * 3
    envs.set_options({"reset_mask": [True] * 3})
    for call, parts in [
        (lambda: envs.set_attr("note", 6, indices=[1]), ["set_attr('note')", "3 environments", "[1]"]),
        (lambda: envs.env_method("render", indices=0), ["env_method('render')", "[0]"]),
        (lambda: envs.reset(), ["reset_mask"]),
        (lambda: envs.step(np.full((3, 2), np.nan)), ["NaN"]),
        (lambda: envs.step(np.zeros((3, 1))), ["[3, 1]", "[3, 2]"]),
        (lambda: envs.step_wait(), ["step_async"]),
    ]:
        with pytest.raises(ks.ArgumentError) as error:
            call()
        assert all(part in str(error.value) for part in parts), error.value
    envs.close()
    with pytest.raises(ks.DestroyedError):
        envs.reset()


@pytest.mark.needs_learning
def test_groups_of_sb3():
    envs = sb3(ks.VectorEnv(critic_task(2, "same_step")))
    first = envs.reset()
    assert set(first) == {"policy", "policy/view", "critic"} and first in gymnasium.vector.utils.batch_space(envs.observation_space, 2)
    for _ in range(3):
        _, _, dones, infos = envs.step(np.ones((2, 1), np.float32))
    last = infos[1]["terminal_observation"]
    assert dones.all() and last in envs.observation_space and last["critic"][0] > 0


@pytest.fixture
def one_thread():
    """One thread of torch: with more, small networks wait for threads that other processes keep from running."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.mark.needs_learning
def test_sb3_learns_to_balance(one_thread):
    """The untrained policy falls in about 1 s; the trained one stands at least twice as long."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    envs = VecMonitor(sb3(BALANCE, 32, simulation={"threads": 1}))
    model = PPO("MlpPolicy", envs, n_steps=64, batch_size=512, n_epochs=5, learning_rate=1e-3, seed=0, device="cpu")
    lengths = []
    model.learn(60_000, callback=lambda known, _: lengths.extend(info["episode"]["l"] for info in known["infos"] if "episode" in info) or True)
    tenth = len(lengths) // 10
    before, after = np.mean(lengths[:tenth]), np.mean(lengths[-tenth:])
    print(f"mean length of episodes: {before:.1f} before, {after:.1f} after")
    assert after > 2 * before


@pytest.mark.needs_learning
def test_steps_of_rsl_rl():
    """Judge: Gymnasium's interface of the same task."""
    import torch

    count = 4
    ours = rsl_rl(ks.VectorEnv(cart_task(count, "same_step")), seed=3)
    judge = ks.VectorEnv(cart_task(count, "same_step"))
    assert (ours.num_envs, ours.num_actions, ours.max_episode_length) == (count, 1, 12) and ours.device == torch.device("cpu")
    assert (ours.cfg.num_envs, ours.cfg.episode_steps, ours.cfg.step_dt) == (count, 12, 0.05)
    np.testing.assert_array_equal(ours.get_observations()["policy"], judge.reset(seed=3)[0])
    lengths, ends = np.zeros(count, int), 0
    for actions in actions_of(judge.single_action_space, count, 40):
        observations, rewards, dones, extras = ours.step(torch.from_numpy(actions))
        expected, rewards_of_judge, terminated, truncated, infos = judge.step(actions)
        assert observations is ours.get_observations() and observations.batch_size == (count,)
        assert observations["policy"].dtype == rewards.dtype == torch.float32 and rewards.shape == dones.shape == (count,)
        np.testing.assert_array_equal(observations["policy"], expected)
        np.testing.assert_array_equal(rewards, rewards_of_judge.astype(np.float32))
        np.testing.assert_array_equal(dones, terminated | truncated)
        np.testing.assert_array_equal(extras["time_outs"], truncated & ~terminated)
        lengths = np.where(terminated | truncated, 0, lengths + 1)
        np.testing.assert_array_equal(ours.episode_length_buf, lengths)
        assert extras["log"]["Reward/alive"] == pytest.approx(infos["reward_terms"]["alive"].mean())
        shares = {name: share for name, share in extras["log"].items() if name.startswith("End/")}
        assert bool(shares) == (terminated | truncated).any() and sum(shares.values()) == pytest.approx(float(bool(shares)))
        ends += int(dones.sum())
    assert ends > 8


@pytest.mark.needs_learning
def test_episode_lengths_of_rsl_rl():
    """Episodes end when their number reaches the limit, also where the runner wrote it."""
    import torch

    envs = rsl_rl(ks.VectorEnv(cart_task(3, "same_step")))
    envs.episode_length_buf = torch.tensor([0, 9, 11])
    push = torch.ones(3, 1)
    ends = []
    for step in range(1, 13):
        observations, _, dones, extras = envs.step(push)
        np.testing.assert_array_equal(dones, extras["time_outs"])
        ends += [(step, int(env)) for env in torch.nonzero(dones)]
        # The carts begin at rest in the middle.
        assert ((observations["policy"][:, 0] == 0) == dones.bool()).all()
        if dones.any():
            assert extras["log"]["End/time limit"] == 1.0
    assert ends == [(1, 2), (3, 1), (12, 0)] and envs.episode_length_buf.tolist() == [0, 9, 11]
    for actions, text in [(torch.full((3, 1), torch.nan), "NaN"), (torch.zeros(3, 2), r"\[3, 2\]")]:
        with pytest.raises(ks.ArgumentError, match=text):
            envs.step(actions)
    unlimited = cart_task(1, "same_step", episode_steps=None)
    with pytest.raises(ks.ArgumentError, match="episode_steps"):
        rsl_rl(ks.VectorEnv(unlimited))


@pytest.mark.needs_learning
def test_groups_of_rsl_rl():
    import torch

    envs = rsl_rl(ks.VectorEnv(critic_task(2, "same_step")))
    observations = envs.step(torch.ones(2, 1))[0]
    assert set(observations.keys()) == {"policy", "policy/view", "critic"}
    image = envs.envs.task.images("policy", "view")
    assert observations["policy/view"].shape == (2, 3, 36, 40) and observations["policy/view"].dtype == torch.float32
    np.testing.assert_array_equal(observations["policy/view"].permute(0, 2, 3, 1), image)


def runner_cfg(steps):
    network = {"class_name": "MLPModel", "hidden_dims": [64, 64], "activation": "elu"}
    distribution = {"class_name": "GaussianDistribution", "init_std": 1.0}
    return {
        "num_steps_per_env": steps,
        "save_interval": 1000,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": {**network, "obs_normalization": True, "distribution_cfg": distribution},
        "critic": {**network, "obs_normalization": True},
        "algorithm": {
            "class_name": "PPO",
            "entropy_coef": 0.005,
            "desired_kl": 0.01,
            "learning_rate": 1e-3,
            "num_learning_epochs": 5,
            "num_mini_batches": 4,
        },
    }


@pytest.mark.needs_learning
def test_rsl_rl_learns(one_thread, tmp_path):
    """The runner itself, on the balancing robot."""
    import torch
    from rsl_rl.runners import OnPolicyRunner

    torch.manual_seed(0)
    envs = rsl_rl(BALANCE, 64, seed=0, simulation={"threads": 1})
    runner = OnPolicyRunner(envs, runner_cfg(24), log_dir=str(tmp_path))
    means = []
    for _ in range(2):
        runner.learn(20, init_at_random_ep_len=True)
        means.append(np.mean(runner.logger.rewbuffer))
    print("mean return of 100 episodes:", means)
    assert means[1] > 1.5 * means[0]


@pytest.mark.needs_learning
def test_steps_of_skrl():
    """Judge: Gymnasium's interface of the same task."""
    import torch

    ours, judge = skrl(ks.VectorEnv(cart_task(4, "same_step")), seed=3), ks.VectorEnv(cart_task(4, "same_step"))
    assert (ours.observation_space, ours.action_space) == (judge.single_observation_space, judge.single_action_space)
    assert (ours.num_envs, ours.num_agents, ours.state_space, ours.state()) == (4, 1, None, None)
    np.testing.assert_array_equal(ours.reset()[0], judge.reset(seed=3)[0])
    ends = 0
    for actions in actions_of(judge.single_action_space, 4, 40):
        found, expected = ours.step(torch.from_numpy(actions)), judge.step(actions)
        np.testing.assert_array_equal(found[0], expected[0])
        np.testing.assert_array_equal(ours.reset()[0], expected[0])
        for one, other in zip(found[1:4], expected[1:4], strict=True):
            assert one.shape == (4, 1) and one.dtype in (torch.float32, torch.bool)
            np.testing.assert_array_equal(one[:, 0], other.astype(one.numpy().dtype))
        mean = expected[4]["reward_terms"]["rate"].mean()
        assert float(found[4]["episode"]["Reward / rate"]) == pytest.approx(mean)
        ends += int((found[2] | found[3]).sum())
    assert ends > 8
    with pytest.raises(ks.ArgumentError, match="NaN"):
        ours.step(torch.full((4, 1), torch.nan))


@pytest.mark.needs_learning
def test_groups_of_skrl():
    """The group ``critic`` is the state; skrl flattens the other groups in the order of their names."""
    import torch

    envs = skrl(ks.VectorEnv(critic_task(2, "same_step")))
    assert set(envs.observation_space) == {"policy", "policy/view"} and envs.state_space.shape == (1,)
    envs.reset()
    observations = envs.step(torch.ones(2, 1))[0]
    task = envs.envs.task
    np.testing.assert_array_equal(envs.state(), task.observations("critic"))
    assert observations.shape == (2, 1 + 36 * 40 * 3) and (envs.state() > 0).all()
    np.testing.assert_array_equal(observations[:, 0], task.observations("policy")[:, 0])
    np.testing.assert_array_equal(observations[:, 1:], task.images("policy", "view").reshape(2, -1))


@pytest.mark.needs_learning
def test_skrl_trains(one_thread, tmp_path):
    """skrl's trainer and PPO run on the balancing robot."""
    import torch
    from skrl.agents.torch.ppo import PPO, PPO_CFG
    from skrl.memories.torch import RandomMemory
    from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
    from skrl.trainers.torch import SequentialTrainer

    envs = skrl(BALANCE, 8, seed=0)

    class Policy(GaussianMixin, Model):
        def __init__(self):
            Model.__init__(self, observation_space=envs.observation_space, state_space=None, action_space=envs.action_space, device="cpu")
            GaussianMixin.__init__(self)
            self.net = torch.nn.Linear(11, 2)
            self.log_std = torch.nn.Parameter(torch.zeros(2))

        def compute(self, inputs, role):
            return self.net(inputs["observations"]), {"log_std": self.log_std}

    class Value(DeterministicMixin, Model):
        def __init__(self):
            Model.__init__(self, observation_space=envs.observation_space, state_space=None, action_space=envs.action_space, device="cpu")
            DeterministicMixin.__init__(self)
            self.net = torch.nn.Linear(11, 1)

        def compute(self, inputs, role):
            return self.net(inputs["observations"]), {}

    models = {"policy": Policy(), "value": Value()}
    before = models["policy"].net.weight.clone()
    cfg = PPO_CFG()
    cfg.rollouts = 16
    cfg.experiment.directory, cfg.experiment.write_interval, cfg.experiment.checkpoint_interval = str(tmp_path), 0, 0
    agent = PPO(
        models=models,
        memory=RandomMemory(memory_size=16, num_envs=8, device="cpu"),
        observation_space=envs.observation_space,
        state_space=None,
        action_space=envs.action_space,
        device="cpu",
        cfg=cfg,
    )
    SequentialTrainer(env=envs, agents=agent, cfg={"timesteps": 48, "headless": True, "close_environment_at_exit": False}).train()
    assert (models["policy"].net.weight != before).any() and models["policy"].net.weight.isfinite().all()


@pytest.mark.needs_learning
def test_steps_of_torchrl():
    """Judges: TorchRL's own check, and Gymnasium's interface with resets by masks."""
    import torch
    from torchrl.envs.utils import check_env_specs

    check_env_specs(torchrl(BALANCE, 3), seed=0)
    ours, judge = torchrl(ks.VectorEnv(cart_task(4, "disabled"))), ks.VectorEnv(cart_task(4, "disabled"))
    assert ours.batch_size == (4,) and ours.action_spec.shape == (4, 1)
    ours.set_seed(3)
    data = ours.reset()
    expected, _ = judge.reset(seed=3)
    pushes = torch.from_numpy(np.array([[0.0], [20.0], [-13.0], [4.0]], np.float32))
    ends = partial = 0
    for _ in range(40):
        np.testing.assert_array_equal(data["observation"], expected)
        following, data = ours.step_and_maybe_reset(data.set("action", pushes))
        expected, rewards, terminated, truncated, _ = judge.step(pushes.numpy())
        np.testing.assert_array_equal(following["next", "observation"], expected)
        np.testing.assert_array_equal(following["next", "reward"][:, 0], rewards.astype(np.float32))
        np.testing.assert_array_equal(following["next", "terminated"][:, 0], terminated)
        np.testing.assert_array_equal(following["next", "truncated"][:, 0], truncated)
        ended = terminated | truncated
        if ended.any():
            partial += not ended.all()
            expected, _ = judge.reset(options={"reset_mask": ended})
        ends += int(ended.sum())
    assert ends > 8 and partial > 2
    groups = torchrl(ks.VectorEnv(critic_task(2, "disabled"))).rollout(5, break_when_any_done=False)
    assert groups["policy/view"].shape == (2, 5, 36, 40, 3) and groups["critic"].shape == (2, 5, 1)
    assert groups["next", "truncated"][:, :, 0].tolist() == [[False, False, True, False, False]] * 2


@pytest.fixture(scope="module")
def cluster():
    import ray

    ray.init(address="local", num_cpus=3, include_dashboard=False, object_store_memory=100 * 2**20, log_to_driver=False)
    yield
    ray.shutdown()


@pytest.mark.needs_learning
def test_rllib_trains(cluster):
    """PPO with two env runners, which have different shards."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.algorithms.algorithm_config import AlgorithmConfig

    from kinetoscope.rl.rllib import with_task

    config = with_task(PPOConfig(), BALANCE, num_envs_per_env_runner=4, num_env_runners=2, simulation={"threads": 1})
    config.training(train_batch_size_per_learner=256, minibatch_size=128, num_epochs=1)
    # A busy machine samples slowly; the default is a minute.
    config.env_runners(sample_timeout_s=600)
    algorithm = config.build_algo()
    # The reset of an env runner without a seed gives the episodes of its shard.
    starts = algorithm.env_runner_group.foreach_env_runner(
        lambda runner: runner.env.unwrapped.reset()[0], local_env_runner=False
    )
    judge = kinetoscope.envs.make_vec("balance", 12, autoreset="next_step")
    expected, _ = judge.reset()
    np.testing.assert_array_equal(np.concatenate(starts), expected[4:])
    result = algorithm.train()
    assert result["num_env_steps_sampled_lifetime"] >= 256
    algorithm.stop()
    for call, parts in [
        (lambda: with_task(PPOConfig(), "Kinetoscope/Balanc-v0", 4), ["Balanc-v0", "Balance-v0"]),
        (lambda: with_task(PPOConfig(), BALANCE, 0), ["num_envs_per_env_runner is 0"]),
        (lambda: with_task(PPOConfig(), BALANCE, 4, -1), ["num_env_runners is -1"]),
        (lambda: with_task(AlgorithmConfig().api_stack(False, False), BALANCE, 4), ["old API stack"]),
    ]:
        with pytest.raises(ks.KinetoscopeError) as error:
            call()
        assert all(part in str(error.value) for part in parts), error.value


@pytest.mark.needs_learning
def test_programs_of_the_page(cluster, one_thread, tmp_path, monkeypatch):
    """The programs of docs/learning.md, with fewer environments and steps."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (PROJECT / "docs" / "learning.md").read_text(), re.DOTALL)
    changes = {"60_000": "2048", "1024)": "8)", "learn(300": "learn(1", "512)": "2)", "num_envs_per_env_runner=64": "num_envs_per_env_runner=2"}
    for old, new in changes.items():
        assert any(old in block for block in blocks), old
        blocks = [block.replace(old, new) for block in blocks]
    assert len(blocks) == 6
    names = [{} for _ in blocks]
    for block, own in zip(blocks, names, strict=True):
        exec(block, own)  # noqa: S102
        # Its env runners leave too few CPUs for the actors of the next program.
        if "algorithm" in own:
            own["algorithm"].stop()
    assert names[0]["model"].num_timesteps == 2048 and names[3]["rollout"].shape == (64, 100)
    assert [fragment.observations.shape for fragment in names[5]["fragments"]] == [(50, 32, 11)] * 2
    names[5]["rollout"].close()
