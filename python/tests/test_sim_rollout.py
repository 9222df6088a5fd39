"""Rollouts by shards, in this process and in actors of Ray: the bits do not depend on the number of shards."""

import dataclasses
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
import ray
from ray.cluster_utils import Cluster

import kinetoscope as ks
import kinetoscope.envs
from kinetoscope.rl._requirements import require
from kinetoscope.rl.fragment import Checkpoint, RolloutCfg
from kinetoscope.rl.ray import ShardedRollout
from kinetoscope.rl.rollout import RolloutShard

CART = """<mujoco><worldbody><body name="cart"><joint name="slide" type="slide" axis="1 0 0" limited="true" range="-0.3 0.3"/>
<geom size="0.1" mass="2" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""

CALLS: dict = {}
"""Calls of the policy in this process, by the file that would end it."""


def linear(weights, observations, noise):
    """A linear policy with noise, which also returns its means. While there is a file ``weights["kill"]``, a process that calls
    the policy for the fifth time removes it and ends."""
    name = weights.get("kill")
    CALLS[name] = CALLS.get(name, 0) + 1
    if name and CALLS[name] == 5:
        try:
            os.remove(name)
        except FileNotFoundError:
            pass
        else:
            os.kill(os.getpid(), signal.SIGKILL)
    rows = observations["policy"] if isinstance(observations, dict) else observations
    mean = rows @ weights["gain"]
    return mean + np.float32(2.0) * noise, {"mean": mean}


def gain(columns, actions, scale=0.5):
    return {"gain": np.random.default_rng(1).normal(0, scale, (columns, actions)).astype(np.float32)}


def watched_cart(num_envs, simulation):
    """Carts at random places whose episodes end at the limits, with a camera image of the group ``critic``, a noisy sensor in
    it, and random masses."""
    sim = ks.SimulationManager(num_envs=num_envs, **simulation)
    sim.add_robot(ks.RobotCfg(uid="cart", mjcf=ks.MjcfFile(text=CART), drive={"drive_type": "none"}))
    place = ks.Placement.look_at(eye=[1, -1, 1], target=[0, 0, 0])
    noise = {"depth": ks.NoiseCfg(std=0.1)}
    sim.add_sensor(
        "eye",
        ks.CameraCfg(width=8, height=6, channels=["rgb", "depth"], extrinsics=ks.Extrinsics(placement=place), noise=noise),
    )
    cfg = {
        "decimation": 5,
        "episode_steps": 7,
        "actions": {"push": {"type": "joint_efforts", "bound": 20.0}},
        "observations": {
            "policy": {"place": {"type": "joint_pos_rel", "noise": {"std": 0.01}}, "speed": {"type": "joint_vel"}},
            "critic": {
                "view": {"type": "camera_rgb", "camera": "eye"},
                "near": {"type": "camera_depth", "camera": "eye", "range": [0.1, 5.0]},
            },
        },
        "rewards": {"alive": {"type": "is_alive", "weight": 1.0}, "rate": {"type": "action_rate", "weight": -0.01}},
        "terminations": {"away": {"type": "joint_out_of_limits"}},
        "events": {
            "start": {"type": "reset_joints_by_offset", "positions": [-0.1, 0.1]},
            "mass": {"type": "randomize_mass", "mode": "startup", "bodies": [".*cart"], "op": {"scale": [0.5, 2.0]}},
        },
    }
    return ks.Task(sim, cfg, dtype="float32")


CFGS = {
    "carts": (RolloutCfg(watched_cart, linear, num_envs=8, steps=5, seed=3, reset_every=2, rows_per_call=2), gain(2, 1, 5)),
    "balance": (
        RolloutCfg("Kinetoscope/Balance-v0", linear, num_envs=8, steps=30, reset_every=2, rows_per_call=2),
        gain(11, 2),
    ),
    "quadruped": (
        RolloutCfg("Kinetoscope/QuadrupedVelocity-v0", linear, num_envs=4, steps=20, reset_every=2, rows_per_call=1),
        gain(48, 12, 0.1),
    ),
    "terrain": (
        RolloutCfg("Kinetoscope/QuadrupedVelocityRough-v0", linear, num_envs=4, steps=10, reset_every=2, rows_per_call=1),
        gain(235, 12, 0.1),
    ),
}


def arrays(fragment):
    """All arrays of a fragment by name."""
    found = {}
    for field in dataclasses.fields(fragment):
        value = getattr(fragment, field.name)
        parts = value.items() if isinstance(value, dict) else [("", value)]
        found |= {f"{field.name}/{name}": part for name, part in parts}
    return found


def joined(fragments):
    """The arrays of all shards as those of one, with ends in the order of steps and environments."""
    of_shards = [arrays(fragment) for fragment in fragments]
    count = fragments[0].rewards.shape[1]
    ends = np.concatenate([fragment.ends + [0, shard * count] for shard, fragment in enumerate(fragments)])
    order = np.lexsort(ends.T[::-1])
    found = {}
    for name in of_shards[0]:
        axis = 0 if name.startswith(("last_", "final_", "ends")) else 1
        found[name] = np.concatenate([one[name] for one in of_shards], axis=axis)
        if name.startswith("final_"):
            found[name] = found[name][order]
    return found | {"ends/": ends[order]}


def assert_same(found, expected):
    assert found.keys() == expected.keys()
    for name in expected:
        assert found[name].dtype == expected[name].dtype, name
        np.testing.assert_array_equal(found[name], expected[name], err_msg=name)


def run(shards, weights, count):
    return [joined([shard.fragment(weights)[0] for shard in shards]) for _ in range(count)]


@pytest.fixture(scope="module", params=CFGS)
def case(request):
    """Settings, weights, and the fragments of one shard with all environments."""
    cfg, weights = CFGS[request.param]
    whole = RolloutShard(cfg)
    fragments = run([whole], weights, 5)
    ends = sum(len(fragment["ends/"]) for fragment in fragments)
    # All episodes end at the two checkpoints. On the terrain, none ends before in these few steps.
    assert ends == 2 * cfg.num_envs if request.param == "terrain" else ends > 2 * cfg.num_envs
    return cfg, weights, fragments


def test_steps_are_those_of_the_vector_environment():
    """Judge: a loop over Gymnasium's interface with the recorded actions."""
    cfg, weights = CFGS["balance"]
    first, second = run([RolloutShard(cfg)], weights, 2)
    seed = int(np.random.SeedSequence((cfg.seed, 0)).generate_state(1, np.uint64)[0]) // 2
    envs = kinetoscope.envs.make_vec("balance", cfg.num_envs, autoreset="same_step", simulation={"seed": seed})
    observations, _ = envs.reset(seed=seed)
    ends = 0
    for number, fragment in enumerate((first, second)):
        for step in range(cfg.steps):
            np.testing.assert_array_equal(fragment["observations/"][step], observations)
            observations, rewards, terminated, truncated, infos = envs.step(fragment["actions/"][step])
            np.testing.assert_array_equal(fragment["rewards/"][step], rewards)
            np.testing.assert_array_equal(fragment["terminated/"][step], terminated)
            is_checkpoint = (number, step) == (1, cfg.steps - 1)
            np.testing.assert_array_equal(fragment["truncated/"][step], truncated | (~terminated if is_checkpoint else False))
            for env in np.flatnonzero(fragment["terminated/"][step] | fragment["truncated/"][step]):
                row = np.flatnonzero((fragment["ends/"] == [step, env]).all(axis=1))
                last = infos["final_obs"][env] if terminated[env] or truncated[env] else observations[env]
                np.testing.assert_array_equal(fragment["final_observations/"][row], [last])
                ends += 1
    assert ends == len(first["ends/"]) + len(second["ends/"]) > cfg.num_envs
    # At the checkpoint, all episodes have begun anew.
    assert (first["last_observations/"] == second["observations/"][0]).all()
    assert (observations != second["last_observations/"]).any(axis=1).all()
    # They are others than those at the beginning, and fragments have noise of their own.
    assert (first["observations/"][0] != second["last_observations/"]).any(axis=1).all()
    assert (first["actions/"] - first["extras/mean"] != second["actions/"] - second["extras/mean"]).any(axis=2).all()
    # Means of the policy, in the calls that it was made in.
    means = [rows @ weights["gain"] for rows in first["observations/"][3].reshape(-1, cfg.rows_per_call, 11)]
    np.testing.assert_array_equal(first["extras/mean"][3], np.concatenate(means))
    # Standard normal noise: the mean of n numbers is within 5 / sqrt(n), their variance within 5 sqrt(2 / n).
    noise = ((first["actions/"] - first["extras/mean"]) / 2).ravel()
    assert abs(noise.mean()) < 5 / np.sqrt(noise.size) and abs(noise.var() - 1) < 5 * np.sqrt(2 / noise.size)
    assert len(np.unique(noise)) > 0.99 * noise.size


@pytest.mark.parametrize("world", [2, 4])
def test_same_bits_for_any_number_of_shards(case, world):
    cfg, weights, expected = case
    found = run([RolloutShard(cfg, rank, world) for rank in range(world)], weights, len(expected))
    for one, other in zip(found, expected, strict=True):
        assert_same(one, other)


@pytest.mark.parametrize("lost_after", [1, 2, 3])
def test_a_lost_shard_goes_on_with_the_same_bits(case, lost_after):
    """Before the first checkpoint, at it, and after it."""
    cfg, weights, expected = case
    shard, trail = RolloutShard(cfg), []
    for _ in range(lost_after):
        part = shard.fragment(weights)[1]
        trail = [part] if isinstance(part, Checkpoint) else [*trail, part]
    shard.close()
    again = RolloutShard(cfg)
    again.replay(trail)
    assert again.next_fragment == lost_after
    for one, other in zip(run([again], weights, len(expected) - lost_after), expected[lost_after:], strict=True):
        assert_same(one, other)


def test_curricula_go_on_after_a_checkpoint():
    """Levels that no curriculum begins with, as an earlier run reached them; episodes on them go on after a checkpoint."""
    cfg, weights = CFGS["terrain"]
    shard = RolloutShard(dataclasses.replace(cfg, steps=1))
    shard.envs.task.set_curriculum("level", [4, 3, 4, 3])
    shard.fragment(weights)
    # At the end of an episode, a curriculum may lead to the row before.
    part = shard.fragment(weights)[1]
    assert (part.curricula["level"] >= 2).all()
    np.testing.assert_array_equal(shard.envs.task.curriculum("level"), part.curricula["level"])
    # The robots stand on the rows of their levels, 6 m apart.
    rows = np.round(shard.envs.task.sim["robot"].root_pose[:, 0] / 6) + 2
    np.testing.assert_array_equal(rows, part.curricula["level"])


def test_masses_go_on_after_a_checkpoint():
    """Random masses that are drawn once, with another seed in the simulation after a checkpoint, stay."""
    cfg, weights = CFGS["carts"]
    shard = RolloutShard(cfg)
    before = shard.envs.task.sim.property("mass", "cart/cart")
    shard.fragment(weights)
    assert isinstance(shard.fragment(weights)[1], Checkpoint)
    np.testing.assert_array_equal(shard.envs.task.sim.property("mass", "cart/cart"), before)
    assert len(np.unique(before)) == cfg.num_envs


@pytest.fixture(scope="module")
def cluster():
    """Ray with two nodes on this machine, with an object store and two CPUs each."""
    node = {"num_cpus": 2, "object_store_memory": 100 * 2**20}
    nodes = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
    nodes.add_node(**node)
    ray.init(address=nodes.address, log_to_driver=False)
    yield
    ray.shutdown()
    nodes.shutdown()


@pytest.mark.parametrize(("name", "world"), [("carts", 2), ("balance", 4)])
def test_actors_of_ray(cluster, name, world, tmp_path):
    """Actors, of which one is killed inside a fragment, before and after a checkpoint. Four need the CPUs of both nodes."""
    assert [node["Resources"]["CPU"] for node in ray.nodes()] == [2, 2]
    cfg, weights = CFGS[name]
    expected = run([RolloutShard(cfg)], weights, 5)
    rollout = ShardedRollout(cfg, world)
    for number, fragment in enumerate(expected):
        given, kill = weights, tmp_path / str(number)
        if number in (1, 4):
            kill.touch()
            given = ray.put({**weights, "kill": str(kill)})
        references = rollout.collect(given)
        assert all(isinstance(reference, ray.ObjectRef) for reference in references) and not kill.exists()
        assert_same(joined(ray.get(references)), fragment)
    assert rollout.replacements == 2
    # An error of the policy is raised here, and the shards go on from the fragment before it.
    with pytest.raises(ValueError, match="matmul"):
        rollout.collect({"gain": np.ones((1, 1), np.float32)})
    whole = RolloutShard(cfg)
    following = run([whole], weights, 6)[5]
    assert_same(joined(ray.get(rollout.collect(weights))), following)
    rollout.close()


def test_refusals_of_actors(cluster):
    cfg, _ = CFGS["balance"]
    for shards, parts in [
        (0, ["0 shards"]),
        (3, ["8 environments", "3 equal shards"]),
        (8, ["rows_per_call is 2", "the 1"]),
        ([ks.Shard(rank=0, world=2), ks.Shard(rank=0, world=2)], ["2 shards", "[0] overlap"]),
        ([ks.Shard(rank=0, world=4), ks.Shard(rank=1, world=4), ks.Shard(rank=3, world=4)], ["4 shards", "[2] are missing"]),
        ([ks.Shard(rank=0, world=2), ks.Shard(rank=1, world=2), ks.Shard(rank=2, world=2)], ["[2] are not 0 to 1"]),
        ([ks.Shard(rank=0, world=2), ks.Shard(rank=1, world=4)], ["worlds [2, 4]"]),
        ([], ["worlds []"]),
    ]:
        with pytest.raises(ks.ArgumentError) as error:
            ShardedRollout(cfg, shards)
        assert all(part in str(error.value) for part in parts), error.value
    with pytest.raises(ks.ArgumentError, match="2 actors with 3 CPUs.*4 CPUs of the cluster"):
        ShardedRollout(dataclasses.replace(cfg, threads=3), 2)
    # Errors of a task in an actor are raised at construction.
    with pytest.raises(ks.UnknownNameError, match="Balance-v0"):
        ShardedRollout(dataclasses.replace(cfg, task="Kinetoscope/Balanc-v0"), 2)


def test_refusals():
    cfg, weights = CFGS["balance"]

    def change(**fields):
        return dataclasses.replace(cfg, **fields)

    def fragment(policy):
        return RolloutShard(change(policy=policy)).fragment(weights)

    def small(count, simulation):
        return kinetoscope.envs.load("balance", count // 2, autoreset="same_step", simulation=simulation)

    for call, error, parts in [
        (lambda: change(steps=0), ks.ArgumentError, ["steps is 0"]),
        (lambda: change(seed=-1), ks.ArgumentError, ["seed is -1", "at least 0"]),
        (lambda: change(num_envs=-1), ks.ArgumentError, ["num_envs is -1"]),
        (lambda: RolloutShard(cfg, 2, 2), ks.ArgumentError, ["rank 2 of 2"]),
        (lambda: RolloutShard(change(task="Balance")), ks.UnknownNameError, ["'Balance'", "Kinetoscope/Balance-v0"]),
        (lambda: RolloutShard(change(task=7)), ks.ArgumentError, ["7", "VectorEnv"]),
        (lambda: RolloutShard(change(task=small)), ks.ArgumentError, ["4 environments", "expected 8"]),
        (lambda: RolloutShard(change(task=lambda *_: cart_of("float64"))), ks.ArgumentError, ["float64", "float32"]),
        (lambda: RolloutShard(change(task=lambda *_: cart_of("float32", "next_step"))), ks.ArgumentError, ["'next_step'", "'same_step'"]),
        (lambda: fragment(lambda *_: np.zeros((2, 3))), ks.ArgumentError, ["policy", "(2, 3)", "(2, 2)"]),
        (lambda: fragment(lambda *_: np.full((2, 2), np.nan)), ks.ArgumentError, ["NaN"]),
        (lambda: require("x", "no-such-package", "1.2", "no_such_module"), ks.MissingPackageError, ["x needs", "pip install 'no-such-package>=1.2'"]),
        (lambda: require("x", "numpy", "999.1", "numpy"), ks.MissingPackageError, [np.__version__, "numpy 999.1 or later"]),
    ]:
        with pytest.raises(error) as caught:
            call()
        assert all(part in str(caught.value) for part in parts), caught.value
    # A fragment that an error interrupted leaves no state to go on from.
    shard = RolloutShard(cfg)
    with pytest.raises(ValueError, match="matmul"):
        shard.fragment(gain(3, 2))
    with pytest.raises(ks.ArgumentError, match="replay"):
        shard.fragment(weights)


def cart_of(dtype, autoreset="same_step"):
    sim = ks.SimulationManager(num_envs=8, threads=1)
    sim.add_robot(ks.RobotCfg(uid="cart", mjcf=ks.MjcfFile(text=CART), drive={"drive_type": "none"}))
    cfg = {
        "autoreset": autoreset,
        "actions": {"push": {"type": "joint_efforts", "bound": 20.0}},
        "observations": {"policy": {"place": {"type": "joint_pos_rel"}}},
        "rewards": {"alive": {"type": "is_alive", "weight": 1.0}},
    }
    return ks.Task(sim, cfg, dtype=dtype)
    # All CPUs are taken, and the constructor waits no longer than it may.
    first = ShardedRollout(cfg, 4)
    try:
        with pytest.raises(ks.ArgumentError, match="in 2 s, Ray has not placed the 2 actors with 1 CPUs each; 0 CPUs"):
            ShardedRollout(cfg, 2, placement_timeout=2.0)
    finally:
        first.close()


def test_without_gymnasium():
    program = "import sys; sys.modules['gymnasium'] = None; import kinetoscope.rl.ray"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "MissingPackageError: kinetoscope.rl needs the package gymnasium, version 1.1 or later" in result.stderr
