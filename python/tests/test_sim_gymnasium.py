"""Tasks as environments of Gymnasium, judged by Gymnasium's own checks, wrappers and vector environments."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import vector as wrappers

import kinetoscope as ks
import kinetoscope.envs
from kinetoscope.vector_env import Env

CART = """<mujoco><worldbody><body name="cart"><joint name="slide" type="slide" axis="1 0 0" limited="true" range="-0.3 0.3"/>
<geom size="0.1" mass="2" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
MODES = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}


def cart_task(num_envs, autoreset, dtype="float32", **changes):
    """Carts whose episodes end after 12 steps or beyond 0.3 m. Nothing is random."""
    sim = ks.SimulationManager(num_envs=num_envs, threads=1)
    sim.add_robot(ks.RobotCfg(uid="cart", mjcf=ks.MjcfFile(text=CART), drive={"drive_type": "none"}))
    policy = {"place": {"type": "joint_pos_rel"}, "speed": {"type": "joint_vel", "clip": [-4.0, 4.0]}}
    cfg = {
        "decimation": 5,
        "episode_steps": 12,
        "autoreset": autoreset,
        "actions": {"push": {"type": "joint_efforts", "joints": ["slide"], "bound": 20.0}},
        "observations": {"policy": policy},
        "rewards": {"alive": {"type": "is_alive", "weight": 1.0}, "rate": {"type": "action_rate", "weight": -0.01}},
        "terminations": {"away": {"type": "joint_out_of_limits", "joints": ["slide"]}},
        **changes,
    }
    return ks.Task(sim, cfg, dtype=dtype)


def assert_same(found, expected):
    """Equal in bits, recursively, for observations and infos."""
    assert type(found) is type(expected), (found, expected)
    if isinstance(expected, tuple):
        assert len(found) == len(expected)
        for one, other in zip(found, expected):
            assert_same(one, other)
    elif isinstance(expected, dict):
        assert found.keys() == expected.keys()
        for key in expected:
            assert_same(found[key], expected[key])
    elif isinstance(expected, np.ndarray) and expected.dtype == object:
        assert len(found) == len(expected)
        for one, other in zip(found, expected):
            assert_same(one, other)
    elif isinstance(expected, np.ndarray):
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)
    else:
        assert found == expected


@pytest.mark.parametrize("autoreset", MODES)
def test_same_as_gymnasiums_vector_environment(autoreset):
    """Judge: SyncVectorEnv of single environments, with other actions in each."""
    count = 4
    ours = ks.VectorEnv(cart_task(count, autoreset))
    mode = MODES[autoreset]
    judge = SyncVectorEnv([lambda: Env(cart_task(1, "disabled"))] * count, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is ours.autoreset_mode is judge.autoreset_mode is mode
    assert ours.single_observation_space == judge.single_observation_space
    assert ours.single_action_space == judge.single_action_space
    assert (ours.observation_space, ours.action_space) == (judge.observation_space, judge.action_space)
    assert_same(ours.reset(seed=3), judge.reset(seed=3))
    pushes = np.array([[0.0], [20.0], [-13.0], [4.0]], np.float32)
    ends = partial = 0
    for step in range(40):
        actions = pushes * (1 if step % 3 else -0.2)
        found, expected = ours.step(actions), judge.step(actions)
        ended = expected[2] | expected[3]
        ends += int(ended.sum())
        names = {"end_reason", "_end_reason"} & found[4].keys()
        if autoreset == "same_step":
            # Gymnasium puts all infos of the last step of an episode into final_info.
            assert found[4].get("final_info", {}).keys() <= {"end_reason", "_end_reason"}
            assert_same(found[4].get("final_obs"), expected[4].get("final_obs"))
            assert_same(found[4].get("_final_obs"), expected[4].get("_final_obs"))
        elif ended.any():
            assert_same({name: found[4][name] for name in names}, {name: expected[4][name] for name in names})
            assert names
        for one, other in zip(found[:4], expected[:4]):
            assert_same(one, other)
        if autoreset == "disabled" and ended.any():
            partial += not ended.all()
            options = lambda: {"options": {"reset_mask": ended.copy()}}
            assert_same(ours.reset(**options())[0], judge.reset(**options())[0])
    assert ends > 8 and (partial > 2 or autoreset != "disabled")
    ours.close()
    judge.close()
    assert ours.closed and ours.task.sim is not None


def test_gymnasiums_checks():
    for name in kinetoscope.envs.TASKS:
        env = gymnasium.make(f"Kinetoscope/{name}", render_mode="rgb_array", render_size=(64, 48))
        check_env(env.unwrapped, skip_render_check=False)
        env.close()


@pytest.mark.parametrize("name", kinetoscope.envs.TASKS)
def test_registered_tasks(name):
    envs = gymnasium.make_vec(f"Kinetoscope/{name}", num_envs=3, render_mode="rgb_array", render_size=(40, 30))
    assert isinstance(envs.unwrapped, ks.VectorEnv) and envs.num_envs == 3 and envs.spec.id == f"Kinetoscope/{name}"
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    observations, infos = envs.reset(seed=5)
    assert observations in envs.observation_space and observations.dtype == np.float32 and infos == {}
    envs.action_space.seed(1)
    for _ in range(30):
        observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
        assert observations in envs.observation_space and rewards.shape == (3,)
        total = sum(values for key, values in infos["reward_terms"].items() if not key.startswith("_"))
        np.testing.assert_allclose(rewards, total, rtol=1e-12, atol=1e-12)
    frames = envs.render()
    assert len(frames) == 3 and all(frame.shape == (30, 40, 3) and frame.std() > 1 for frame in frames)
    assert len(envs.unwrapped.call("render")) == 3
    # The same seed gives the same episodes, with other threads too.
    other = gymnasium.make_vec(f"Kinetoscope/{name}", num_envs=3, simulation={"threads": 1})
    np.testing.assert_array_equal(envs.reset(seed=5)[0], other.reset(seed=5)[0])
    actions = envs.action_space.sample()
    np.testing.assert_array_equal(envs.step(actions)[0], other.step(actions)[0])
    envs.close()
    other.close()


def test_wrappers():
    envs = ks.VectorEnv(cart_task(3, "next_step"))
    envs = wrappers.NormalizeObservation(wrappers.RecordEpisodeStatistics(envs))
    envs = wrappers.DictInfoToList(envs)
    envs.reset(seed=1)
    lengths = []
    for _ in range(30):
        _, _, _, _, infos = envs.step(np.zeros((3, 1), np.float32))
        assert len(infos) == 3 and infos[0]["reward_terms"].keys() == {"alive", "rate"}
        lengths += [info["episode"]["l"] for info in infos if "episode" in info]
    # An episode of 12 steps, and the step that begins the next one.
    assert lengths == [12] * 6, lengths


def test_groups_and_images():
    sim = ks.SimulationManager(num_envs=2, threads=1)
    sim.add_robot(ks.RobotCfg(uid="cart", mjcf=ks.MjcfFile(text=CART), drive={"drive_type": "none"}))
    place = ks.Placement.look_at(eye=[1, -1, 1], target=[0, 0, 0])
    sim.add_sensor("eye", ks.CameraCfg(width=16, height=12, extrinsics=ks.Extrinsics(placement=place)))
    cfg = {
        "actions": {"push": {"type": "joint_efforts", "bound": 1.0}},
        "observations": {
            "policy": {"view": {"type": "camera_rgb", "camera": "eye"}},
            "critic": {"place": {"type": "joint_pos_rel"}},
        },
        "episode_steps": 2,
        "rewards": {"alive": {"type": "is_alive", "weight": 1.0}},
    }
    envs = ks.VectorEnv(ks.Task(sim, cfg, dtype="float32"))
    assert set(envs.single_observation_space.spaces) == {"critic", "policy/view"}
    view = envs.single_observation_space["policy/view"]
    assert view.shape == (12, 16, 3) and view.dtype == np.uint8
    observations, _ = envs.reset(seed=1)
    assert observations in envs.observation_space
    for _ in range(2):
        observations, _, _, truncated, infos = envs.step(np.ones((2, 1), np.float32))
        assert observations in envs.observation_space
    assert truncated.all() and infos["final_obs"][1]["policy/view"].shape == (12, 16, 3)
    # The cart moved before the next episode began.
    last = infos["final_obs"][1]["critic"]
    np.testing.assert_array_equal(last, envs.task.observations("critic", final=True)[1])
    assert last[0] > 0 and observations["critic"][1, 0] == 0


def test_refusals():
    envs = ks.VectorEnv(cart_task(2, "disabled"))
    envs.reset(seed=1)
    for call, parts in [
        (lambda: envs.reset(options={"mask": 1}), ["mask", "reset_mask"]),
        (lambda: envs.reset(options={"reset_mask": np.ones(3, bool)}), ["(3,)", "(2,)"]),
        (lambda: envs.reset(options={"reset_mask": np.ones(2)}), ["float64", "booleans"]),
        (lambda: envs.reset(seed=[1, 2]), ["[1, 2]", "one number"]),
        (lambda: envs.step(np.zeros((2, 3))), ["[2, 3]", "[2, 1]"]),
        (lambda: envs.step(np.full((2, 1), np.nan)), ["NaN"]),
        (lambda: ks.VectorEnv(cart_task(1, "disabled"), render_mode="human"), ["human", "rgb_array"]),
        (lambda: Env(cart_task(2, "disabled")), ["2 environments", "VectorEnv"]),
        (lambda: Env(cart_task(1, "next_step")), ["next_step", "disabled"]),
        (lambda: kinetoscope.envs.load("balanc"), ["balanc", "balance"]),
        (lambda: gymnasium.make_vec("Kinetoscope/Balance-v0", autoreset="never"), ["never", "next_step"]),
    ]:
        with pytest.raises(ks.KinetoscopeError) as error:
            call()
        assert all(part in str(error.value) for part in parts), error.value
