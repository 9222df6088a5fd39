"""Tasks for learning agents."""

import numpy as np
import pytest

import kinetoscope as ks

CART = """<mujoco><worldbody><body name="rail"><geom size="0.01" contype="0" conaffinity="0"/><body name="cart">
<joint name="slide" type="slide" axis="1 0 0" limited="true" range="-1 1"/>
<geom size="0.1" mass="2" contype="0" conaffinity="0"/></body></body></worldbody></mujoco>"""
PUSH = {"type": "joint_efforts", "robot": "cart", "joints": ["slide"], "bound": 5.0}


def cart_sim(num_envs=3):
    sim = ks.SimulationManager(num_envs=num_envs, threads=1)
    cart = sim.add_robot(ks.RobotCfg(uid="cart", mjcf=ks.MjcfFile(text=CART), drive={"drive_type": "none"}))
    return sim, cart


def task_cfg(**changes):
    return {
        "decimation": 2,
        "actions": {"push": PUSH},
        "observations": {
            "policy": {
                "place": {"type": "joint_pos_rel"},
                "speed": {"type": "joint_vel", "robot": "cart", "joints": [".*"], "scale": 10.0, "clip": [-1.0, 1.0]},
                "last": {"type": "last_action"},
            }
        },
        "rewards": {"alive": {"type": "is_alive", "weight": 1.0}, "rate": {"type": "action_rate", "weight": -0.5}},
        **changes,
    }


def test_steps_are_those_of_the_simulation():
    sim, cart = cart_sim()
    task = ks.Task(sim, task_cfg())
    assert task.action_space == (["push/slide"], [-5.0], [5.0])
    names, low, high = task.observation_space
    assert names == ["place/slide", "speed/slide", "last/push/slide"] and (low[1], high[1]) == (-10.0, 10.0)
    assert task.num_envs == 3 and task.step_dt == pytest.approx(0.02) and task.reward_names == ["alive", "rate"]
    observations, info = task.reset(seed=1)
    assert observations.shape == (3, 3) and observations.dtype == np.float64 and info == {}
    # Judge: the same steps by hand, in bits.
    other, own = cart_sim()
    pushes = np.array([[3.0], [-2.0], [9.0]])
    previous = np.zeros_like(pushes)
    for step in range(1, 11):
        observations, rewards, terminated, truncated, info = task.step(pushes)
        own.set_qf_target(np.clip(pushes, -5, 5))
        other.update(2)
        np.testing.assert_array_equal(observations[:, 0], own.qpos[:, 0])
        np.testing.assert_array_equal(observations[:, 1], 10 * np.clip(own.qvel[:, 0], -1, 1))
        clipped = np.clip(pushes, -5, 5)
        np.testing.assert_array_equal(observations[:, 2:], clipped)
        rate = -0.5 * (clipped - previous)[:, 0] ** 2
        np.testing.assert_allclose(info["reward_terms"], np.stack([np.ones(3), rate], axis=1))
        np.testing.assert_allclose(rewards, 1 + rate)
        assert not terminated.any() and not truncated.any() and info["ended"] == []
        np.testing.assert_array_equal(info["final_observations"], observations)
        # Newton: v = F t / m.
        np.testing.assert_allclose(cart.qvel, clipped * 0.02 * step / 2, rtol=1e-9)
        previous = clipped
    # The simulation is usable between steps.
    assert task.sim["cart"].qpos.shape == (3, 1) and sim.time[0] == pytest.approx(0.2)


def test_episodes():
    cfg = task_cfg(
        episode_steps=5,
        commands={"goal": {"type": "uniform_command", "columns": {"x": [0.2, 0.4], "y": [7, 7]}}},
        terminations={"away": {"type": "joint_out_of_limits", "robot": "cart", "joints": ["slide"]}},
        events={"start": {"type": "reset_joints_by_offset", "robot": "cart", "joints": ["slide"], "positions": [-0.1, 0.1], "velocities": [0, 0]}},
    )
    cfg["observations"]["policy"] = {
        "goal": {"type": "generated_commands", "command": "goal"},
        "place": {"type": "joint_pos_rel", "robot": "cart", "joints": [".*"]},
    }
    task = ks.Task(cart_sim()[0], cfg)
    first, _ = task.reset(seed=3)
    assert ((first[:, 0] >= 0.2) & (first[:, 0] <= 0.4)).all() and (first[:, 1] == 7).all()
    assert (np.abs(first[:, 2]) <= 0.1).all() and len(set(first[:, 2])) == 3
    # The same seed gives the same episodes, another one does not.
    assert (task.reset(seed=3)[0] == first).all() and (task.reset(seed=4)[0] != first).any()
    started, _ = task.reset(seed=3)
    for step in range(1, 6):
        observations, _, terminated, truncated, info = task.step(np.zeros((3, 1)))
        assert truncated.all() == (step == 5) and not terminated.any()
    assert [ended["reason"] for ended in info["ended"]] == ["time limit"] * 3
    assert [(ended["env"], ended["steps"]) for ended in info["ended"]] == [(0, 5), (1, 5), (2, 5)]
    np.testing.assert_array_equal(info["ended"][1]["reward_sums"], [5.0, 0.0])
    # The carts did not move; the next episodes start elsewhere.
    np.testing.assert_array_equal(info["final_observations"], started)
    assert (observations[:, 2] != started[:, 2]).all()
    # A cart beyond the limit ends its episode; the others go on.
    task.sim["cart"].write_qpos([[0.99]], env_ids=[1])
    task.sim["cart"].write_qvel([[5.0]], env_ids=[1])
    _, _, terminated, _, info = task.step(np.zeros((3, 1)))
    assert terminated.tolist() == [False, True, False] and info["ended"][0]["reason"] == "away"
    masked, _ = task.reset(mask=[True, False, False])
    assert masked.shape == (3, 3)


def test_terms_of_legged_robots():
    sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=2, threads=1))
    dog = sim.add_robot(ks.bundled_robot("quadruped", uid="dog"))
    sim.add_sensor("base", ks.ContactSensorCfg(bodies=["dog/base"]))
    robot = {"robot": "dog"}
    task = ks.Task(
        sim,
        {
            "decimation": 4,
            "actions": {"legs": {"type": "relative_joint_positions", **robot, "joints": [".*"], "step": 0.01}},
            "commands": {"velocity": {"type": "uniform_command", "columns": {"x": [0.5, 0.5], "y": [0, 0]}}},
            "observations": {
                "policy": {
                    "linear": {"type": "base_lin_vel", **robot},
                    "angular": {"type": "base_ang_vel", **robot},
                    "up": {"type": "projected_gravity", **robot, "noise": {"std": 0.01}},
                }
            },
            "rewards": {
                "track": {"type": "track_lin_vel", "weight": 2.0, **robot, "command": "velocity", "std": 0.5},
                "flat": {"type": "flat_orientation", "weight": -1.0, **robot},
                "torques": {"type": "joint_torques_l2", "weight": -1e-4, **robot, "joints": [".*"]},
            },
            "terminations": {
                "fallen": {"type": "bad_orientation", **robot, "angle": 1.0},
                "low": {"type": "root_height_below_minimum", **robot, "height": 0.2},
                "touch": {"type": "illegal_contact", "sensor": "base", "force": 1.0},
                "time": {"type": "time_out", "steps": 8, "truncating": True},
            },
            "events": {"start": {"type": "reset_root_uniform", **robot, "position": [[-1, 1], [-1, 1], [0, 0]]}},
        },
    )
    task.reset(seed=1)
    places = dog.root_pose[:, :2].copy()
    assert (places[0] != places[1]).all() and np.abs(places).max() <= 1
    before = dog.qpos_target
    observations, rewards, *_, info = task.step(np.ones((2, 12)))
    np.testing.assert_allclose(dog.qpos_target, before + 0.01, rtol=1e-12)
    # Terms rotate velocities by the quaternion in the state, robots by MuJoCo's pose of the body: other rounding.
    velocities = np.concatenate([dog.root_lin_vel_b, dog.root_ang_vel_b], axis=1)
    np.testing.assert_allclose(observations[:, :6], velocities, rtol=1e-12, atol=1e-15)
    assert 0 < np.abs(observations[:, 6:] - dog.projected_gravity_b).max() < 0.06
    error = ((dog.root_lin_vel_b[:, :2] - [0.5, 0]) ** 2).sum(axis=1)
    np.testing.assert_allclose(info["reward_terms"][:, 0], 2 * np.exp(-error / 0.25), rtol=1e-12)
    np.testing.assert_allclose(info["reward_terms"][:, 2], -1e-4 * (dog.qf**2).sum(axis=1), rtol=1e-12)
    np.testing.assert_allclose(rewards, info["reward_terms"].sum(axis=1), rtol=1e-12)
    for _ in range(7):
        *_, truncated, info = task.step(np.zeros((2, 12)))
    assert truncated.all() and [ended["reason"] for ended in info["ended"]] == ["time", "time"]


@pytest.mark.parametrize(("mode", "first_of_next"), [("same_step", 1), ("next_step", 0), ("disabled", 0)])
def test_autoreset_modes(mode, first_of_next):
    """The step that ends an episode returns the first observation of the next one in the mode same_step, else the last."""
    cfg = task_cfg(episode_steps=2, autoreset=mode)
    cfg["observations"]["policy"] = {"place": {"type": "joint_pos_rel"}}
    task = ks.Task(cart_sim()[0], cfg)
    task.reset()
    push = np.full((3, 1), 5.0)
    task.step(push)
    observations, _, _, truncated, info = task.step(push)
    assert truncated.all() and (info["final_observations"] > 0).all()
    assert (observations == (0 if first_of_next else info["final_observations"])).all()
    if mode == "disabled":
        with pytest.raises(ks.ArgumentError, match="automatic resets are disabled"):
            task.step(push)
        observations, _ = task.reset(mask=[True] * 3)
        assert (observations == 0).all()
    else:
        observations, rewards, _, truncated, _ = task.step(push)
        assert not truncated.any() and (rewards != 0).all() == first_of_next
        assert (observations != 0).all() == first_of_next


def test_groups_and_images():
    sim, cart = cart_sim()
    look = ks.Placement.look_at(eye=[0, -2, 0.5], target=[0, 0, 0])
    cfg = ks.CameraCfg(width=20, height=10, channels=["rgb", "depth"], extrinsics=ks.Extrinsics(placement=look))
    eye = sim.add_sensor("eye", cfg)
    cfg = task_cfg(episode_steps=3)
    cfg["observations"]["critic"] = {
        "speed": {"type": "joint_vel"},
        "view": {"type": "camera_rgb", "camera": "eye"},
        "near": {"type": "camera_depth", "camera": "eye", "range": [0.5, 4.0]},
    }
    task = ks.Task(sim, cfg)
    assert task.group_names == ["policy", "critic"]
    assert task.group_space("critic")[0] == ["speed/slide"] and task.group_space("policy") == task.observation_space
    assert task.image_spaces("policy") == {}
    spaces = task.image_spaces("critic")
    assert spaces == {"view": ((10, 20, 3), "uint8", 0.0, 255.0), "near": ((10, 20, 1), "float32", 0.5, 4.0)}
    task.reset()
    for step in range(1, 4):
        observations, *_, info = task.step(np.full((3, 1), 5.0))
        np.testing.assert_array_equal(task.observations("policy"), observations)
        np.testing.assert_array_equal(task.observations("policy", final=True), info["final_observations"])
        np.testing.assert_array_equal(task.observations("critic"), cart.qvel)
        np.testing.assert_array_equal(task.images("critic", "view"), eye["rgb"][..., :3])
        np.testing.assert_array_equal(task.images("critic", "near")[..., 0], eye["depth"].clip(0.5, 4.0))
    # The episode has ended in the last step: the next one begins at rest.
    assert (task.observations("critic") == 0).all() and (task.observations("critic", final=True) > 0).all()
    assert (task.images("critic", "view") != task.images("critic", "view", final=True)).any()
    for call, word in [
        (lambda: task.observations("crtic"), "critic"),
        (lambda: task.images("critic", "vieW"), "view"),
        (lambda: task.group_space("x"), "policy"),
    ]:
        with pytest.raises(ks.UnknownNameError, match=word):
            call()


def test_single_precision():
    tasks = [ks.Task(cart_sim()[0], task_cfg(), **dtype) for dtype in ({}, {"dtype": "float32"})]
    double, single = ([task.reset(seed=1)[0]] for task in tasks)
    for _ in range(3):
        for task, seen in zip(tasks, (double, single), strict=True):
            observations, *_, info = task.step(np.full((3, 1), 1 / 3))
            seen += [observations, info["final_observations"], task.observations("policy")]
    for wide, narrow in zip(double, single, strict=True):
        assert (wide.dtype, narrow.dtype) == (np.float64, np.float32)
        np.testing.assert_array_equal(wide.astype(np.float32), narrow)
    # A control: the numbers need more digits.
    assert (double[-1] != single[-1]).any()
    with pytest.raises(ks.ArgumentError, match="float16.*float32"):
        ks.Task(cart_sim()[0], task_cfg(), dtype="float16")


def test_curricula_on_a_terrain_grid():
    """A robot that is carried beyond half a tile moves up a row, one that stays moves down."""
    grid = ks.TerrainGrid(
        tile_size=[4.0, 4.0],
        rows=3,
        columns=2,
        platform=1.0,
        border=1.0,
        tiles=[
            ks.TileShare(tile=ks.TerrainTile.stairs_up(ks.StairsTile(step_height=[0.1, 0.2]))),
            ks.TileShare(tile=ks.TerrainTile.flat()),
        ],
    )
    sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=4, threads=1, ground=None))
    terrain = sim.add_terrain(heights=ks.TerrainGenerator.grid(grid))
    # Platforms of rows of difficulty 0, 0.5 and 1 after (4 - 1) / 2 / 0.3 = 5 steps, and the flat tiles.
    for row in range(3):
        assert terrain.height_at(4 * (row - 1), -2) == pytest.approx(5 * (0.1 + 0.05 * row), abs=1e-6)
        assert terrain.height_at(4 * (row - 1), 2) == pytest.approx(0, abs=1e-6)
    dog = sim.add_robot(ks.bundled_robot("quadruped", uid="dog"))
    task = ks.Task(
        sim,
        {
            "episode_steps": 1,
            "actions": {"legs": {"type": "relative_joint_positions", "step": 0.01}},
            "observations": {"policy": {"joints": {"type": "joint_pos_rel"}}},
            "curricula": {"level": {"type": "terrain_levels", "grid": grid, "max_initial_level": 1}},
            "events": {"start": {"type": "reset_root_on_terrain", "grid": grid, "curriculum": "level"}},
        },
    )
    assert task.curriculum_names == ["level"]
    task.set_curriculum("level", [0, 1, 1, 2])
    task.reset()
    np.testing.assert_allclose(dog.root_pose[:, :2], [[-4, -2], [0, 2], [0, -2], [4, 2]])
    heights = [terrain.height_at(*place) for place in dog.root_pose[:, :2]]
    np.testing.assert_allclose(dog.root_pose[:, 2] - heights, dog.default_root_state[:, 2], atol=1e-6)
    moved = dog.root_pose
    moved[[0, 1], 0] += 2.5
    dog.write_root_pose(moved)
    task.step(np.zeros((4, 12)))
    np.testing.assert_array_equal(task.curriculum("level"), [1, 2, 0, 1])
    for name, values, error in [("lev", [0] * 4, ks.UnknownNameError), ("level", [0], ks.ArgumentError)]:
        with pytest.raises(error, match="level"):
            task.set_curriculum(name, values)


def policy(term):
    return {"observations": {"policy": {"x": term}}}


def command(columns):
    return {"commands": {"c": {"type": "uniform_command", "columns": columns}}}


def start(kind, **ranges):
    return {"events": {"e": {"type": kind, **ranges}}}


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"actions": {"push": {**PUSH, "type": "joint_effort"}}}, ks.UnknownNameError, "actions.push.*joint_effort.*relative_joint_positions"),
        ({"actions": {"push": {**PUSH, "bond": 1.0}}}, ks.ConfigError, "actions.push.*bond"),
        ({"actions": {"push": {**PUSH, "robot": "crat"}}}, ks.UnknownNameError, 'actions.push: unknown robot "crat".*cart'),
        ({"actions": {"push": {**PUSH, "joints": ["slid"]}}}, ks.UnknownNameError, "actions.push.*slide"),
        ({"actions": {"push": {**PUSH, "bound": -1.0}}}, ks.ConfigError, "slide"),
        ({"actions": {}}, ks.ConfigError, "action"),
        (policy({"type": "last_action", "sclae": 1.0}), ks.ConfigError, "observations.policy.x.*sclae"),
        (policy({"type": "generated_commands", "command": "goal"}), ks.UnknownNameError, "observations.policy.x.*goal"),
        (policy({"type": "last_action", "scale": 0.0}), ks.ConfigError, "scale"),
        (policy({"type": "last_action", "clip": [1, -1]}), ks.ConfigError, "bounds"),
        (policy({"type": "last_action", "noise": 0.1}), ks.ConfigError, "observations.policy.x.noise"),
        (policy({"type": "last_action", "noise": {"low": 1, "high": 0}}), ks.ConfigError, "in order"),
        ({"observations": {"x": {"type": "last_action"}}}, ks.ConfigError, "observations.policy.x"),
        (command({}), ks.ConfigError, "commands.c.*at least one column"),
        (command({"x": [2, 1]}), ks.ConfigError, "commands.c.*2 to 1.*in order"),
        (command({"x": [float("nan"), 1]}), ks.ConfigError, "commands.c.*finite"),
        (start("reset_joints_by_offset", positions=[0.1, -0.1], velocities=[0, 0]), ks.ConfigError, "events.e.*positions.*in order"),
        (start("reset_root_uniform", angular=[[0, 0], [0, 0], [1, 0]]), ks.ConfigError, "events.e.*angular.*in order"),
        ({"terminations": {"t": {"type": "illegal_contact", "sensor": "s", "force": 1.0}}}, ks.UnknownNameError, 'sensor.*"s"'),
        ({"curricula": {"c": {"type": "terrain_level"}}}, ks.UnknownNameError, "terrain_levels"),
        ({"autoreset": "next"}, ks.UnknownNameError, "next_step"),
        ({"decimation": 0}, ks.ConfigError, "decimation"),
        ({"rewrads": {}}, ks.ConfigError, "rewrads"),
    ],
)
def test_invalid_tasks(change, error, text):
    sim, cart = cart_sim()
    with pytest.raises(error, match=text):
        ks.Task(sim, task_cfg(**change))
    # The simulation is usable after an error, and for a valid task.
    sim.update()
    assert cart.qpos.shape == (3, 1)
    ks.Task(sim, task_cfg()).reset()


def test_use_of_tasks():
    sim, cart = cart_sim()
    task = ks.Task(sim, task_cfg())
    with pytest.raises(ks.ArgumentError, match="reset"):
        task.step(np.zeros((3, 1)))
    task.reset()
    with pytest.raises(ks.ArgumentError, match="already has a task"):
        ks.Task(sim, task_cfg())
    for wrong in (np.zeros((2, 1)), np.zeros((3, 2)), np.full((3, 1), np.nan)):
        with pytest.raises(ks.ArgumentError):
            task.step(wrong)
    with pytest.raises(ks.ArgumentError, match="mask"):
        task.reset(mask=[True])
    assert "1 action and 3 observation columns, 3 envs" in repr(task)
    task.step(np.ones((3, 1)))
    moved = cart.qpos
    task.close()
    with pytest.raises(ks.DestroyedError, match="task was closed"):
        task.reset()
    assert repr(task) == "<Task: closed>"
    # The simulation goes on where the task ended.
    np.testing.assert_array_equal(cart.qpos, moved)
    sim.update(3)
    assert (cart.qpos != moved).all()
    again = ks.Task(sim, task_cfg())
    again.reset()
    # The first task does not act on the second one.
    with pytest.raises(ks.DestroyedError, match="task was closed"):
        task.step(np.ones((3, 1)))
    task.close()
    again.step(np.ones((3, 1)))
    sim.destroy()
    with pytest.raises(ks.DestroyedError):
        again.reset()
