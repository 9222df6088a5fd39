"""Environments of a device that diverge, grow, and have their own models, bit by bit."""

import json

import mujoco
import numpy as np
import pytest
import warp_scenes as scenes

from kinetoscope.warp import DeviceError, WarpPhysics, sizes

pytestmark = pytest.mark.needs_warp

STATE = ("qpos", "qvel", "qacc_warmstart", "effort")


def load(tmp_path, xml, num_envs=4):
    _, text = scenes.write_scene(tmp_path, xml)
    physics = WarpPhysics("warp-cpu")
    physics.load(str(tmp_path), text, num_envs)
    return physics


def different_targets(count):
    return (np.linspace(0.4, 1.0, count)[:, None] * scenes.ARM_TARGET).astype(np.float32)


def step(physics, count, capture=()):
    return json.loads(physics.step(count, capture))


def state(physics, envs=slice(None)):
    return np.concatenate([physics.read(name)[envs] for name in STATE], axis=1)


BAD = {"nan": np.nan, "infinite": np.inf, "huge": 1e20}


@pytest.mark.parametrize("name", BAD)
def test_divergence_stays_in_its_environment(name, tmp_path):
    """A bad velocity freezes its environment in the first step, and leaves the bits of the others alone."""
    physics, other = (load(tmp_path, scenes.arm_xml()) for _ in range(2))
    for each in (physics, other):
        each.write("target_position", None, different_targets(4))
        assert step(each, 20)["diverged"] == []
    bad = physics.read("qvel")[[2]]
    bad[0, 1] = BAD[name]
    physics.write("qvel", np.array([2]), bad)
    before = physics.read("qpos")[2]
    report, usual = step(physics, 37), step(other, 37)
    assert report == usual | {"diverged": [[2, 0, "qacc"]]}
    assert (physics.read("qpos")[2] == before).all()
    assert (state(physics, [0, 1, 3]) == state(other, [0, 1, 3])).all()
    # Reported once, and frozen until its positions are written.
    physics.write("qvel", np.array([2]), np.zeros((1, 10)))
    assert step(physics, 3)["diverged"] == [] and (physics.read("qpos")[2] == before).all()
    step(other, 3)
    for each in (physics, other):
        for name in ("qpos", "qvel", "qacc_warmstart"):
            each.write(name, np.array([2]), np.full((1, 10), 0.1))
        step(each, 10)
    assert (state(physics) == state(other)).all()


def test_divergence_in_a_later_step(tmp_path):
    """The state before the step comes back, the report has the step, and the capture has no contacts of that environment."""
    physics, other = (load(tmp_path, scenes.box_xml(), 3) for _ in range(2))
    # 1e9 m/s^2 upwards, steps of 0.01 s: after n steps the height is 1e5 m n (n + 1) / 2, more than 1e10 m for n = 447.
    physics.write("xfrc_applied", np.array([1]), np.array([[0.0] * 14 + [2e9, 0, 0, 0]]))
    report = step(physics, 500, ["contacts"])
    ((env, at, reason),) = report["diverged"]
    assert (env, at, reason) == (1, 446, "qpos")
    # Within the rounding of the sum of 447 numbers.
    height = 1e5 * 446 * 447 / 2
    assert abs(physics.read("qpos")[1, 2] - height) < 447 * height * 2.0**-24
    assert abs(physics.read("qvel")[1, 2] - 446e7) < 447 * 446e7 * 2.0**-24
    step(other, 500, ["contacts"])
    assert (state(physics, [0, 2]) == state(other, [0, 2])).all()
    rows = physics.read("contacts")
    assert (rows == other.read("contacts")[[*range(4), *range(8, 12)]]).all() and len(rows) == 8


def test_a_frozen_environment_has_no_contacts(tmp_path):
    """It stands on the ground, but its forces are not those of its state."""
    physics = load(tmp_path, scenes.box_xml(), 3)
    step(physics, 20)
    physics.write("qvel", np.array([0]), np.full((1, 6), np.nan))
    for _ in range(2):
        step(physics, 2, ["contacts"])
        assert set(physics.read("contacts")[:, 0]) == {1, 2}
    physics.solve(["contacts"])
    assert set(physics.read("contacts")[:, 0]) == {1, 2}


def grown_by(physics, count):
    """Growths in `count` calls, and the largest numbers of rows and contacts in their last blocks."""
    grown, peaks = [], []
    for _ in range(count):
        grown += step(physics, 16, ["contacts"])["grown"]
        peaks.append((physics._worlds.peak_rows.numpy().max(), physics._worlds.peak_contacts.numpy()[0] / 4))
    return grown, np.max(peaks, axis=0)


def test_sizes_grow_without_a_trace(tmp_path):
    """An arm that presses the ground needs more rows and contacts than it has at first; a batch with room has the same bits."""
    small, large = (load(tmp_path, scenes.arm_xml()) for _ in range(2))
    large._worlds.resize(256, 64)
    # Far below the ground.
    targets = np.tile(2 * scenes.PRESSING_TARGET, (4, 1))
    force = np.zeros((4, 10), np.float32)
    force[3, 0] = 5.0
    view = small.tensor("qpos")
    for each in (small, large):
        each.write("target_position", None, targets)
        each.write("qfrc_applied", None, force)
        # An environment that is frozen during the growth.
        bad = np.zeros((1, 10), np.float32)
        bad[0, 2] = np.nan
        each.write("qvel", np.array([1]), bad)
    grown, _ = grown_by(small, 10)
    none, peaks = grown_by(large, 10)
    assert grown and not none
    # Rows are counted before some are missing: afterwards, the arm falls through the ground.
    assert small.sizes() == tuple(grown[-1])
    assert all(size <= sizes.rounded(1.5 * peak) for size, peak in zip(small.sizes(), peaks, strict=True))
    # The frozen environment keeps the state that was written.
    np.testing.assert_array_equal(state(small), state(large))
    rows, others = small.read("contacts"), large.read("contacts")
    assert len(rows) > 0 and (rows == others).all() and set(rows[:, 0]) == {0, 2, 3}
    assert (view.numpy() == small.read("qpos")).all()


def test_growth_is_limited_by_memory(tmp_path, monkeypatch):
    """Without memory, the error names the sizes; the state is that of the start of the block, and other calls work."""
    physics = load(tmp_path, scenes.arm_xml())
    physics.write("target_position", None, np.tile(scenes.PRESSING_TARGET, (4, 1)))
    monkeypatch.setattr(sizes, "available_bytes", lambda device: 0)
    with pytest.raises(DeviceError, match=r"4 environments with up to \d+ contacts and \d+ constraint rows each need about .* GiB"):
        for _ in range(20):
            before = physics.read("qpos")
            step(physics, 16)
    assert (physics.read("qpos") == before).all()
    physics.write("target_position", None, np.zeros((4, 8)))
    monkeypatch.undo()
    assert step(physics, 40)["diverged"] == []


def heavier(model):
    model.body_mass *= 1.5
    model.body_inertia *= 1.5


def other_gravity(model):
    model.opt.gravity[:] = [2.0, 0.0, -5.0]


def more_damping(model):
    model.dof_damping[:6] = 30.0


def more_armature(model):
    model.dof_armature[:6] = 0.4


# The change of a model, and the arrays that it changes.
CHANGES = {
    "mass": (heavier, ("body_mass", "body_inertia", "body_subtreemass", "body_invweight0", "dof_invweight0")),
    "gravity": (other_gravity, ("gravity",)),
    "damping": (more_damping, ("dof_damping",)),
    "armature": (more_armature, ("dof_armature", "dof_invweight0", "body_invweight0")),
}


def array_of(model, name):
    return (model.opt.gravity if name == "gravity" else getattr(model, name)).ravel()


# As in test_warp_physics.
POSITION = 10 * 1000 * 2.0**-24 * 0.01**2 * 50**1.5 / 3**0.5


@pytest.mark.parametrize("name", CHANGES)
def test_model_of_one_environment(name, tmp_path):
    """One environment follows its own model; the others keep their bits."""
    change, arrays = CHANGES[name]
    physics, other = (load(tmp_path, scenes.arm_xml()) for _ in range(2))
    model, text = scenes.write_scene(tmp_path, scenes.arm_xml())
    judge = scenes.Judge(tmp_path, text)
    target = scenes.ARM_TARGET.astype(np.float32)
    judge.target_position = target.astype(float)
    change(judge.model)
    mujoco.mj_setConst(judge.model, judge.data)
    for key in arrays:
        values = np.tile(array_of(model, key), (4, 1))
        values[1] = array_of(judge.model, key)
        physics.write(key, None, values)
    for each in (physics, other):
        each.write("target_position", None, np.tile(target, (4, 1)))
        # Later, a finger touches the ground.
        step(each, 40)
    for _ in range(40):
        judge.step()
    own = physics.read("qpos")[1]
    assert np.abs(own - judge.data.qpos).max() < POSITION
    assert np.abs(own - other.read("qpos")[1]).max() > 20 * POSITION
    if name != "damping":
        # Damping changes the integrator of all environments: another solution of the same equations.
        assert (state(physics, [0, 2, 3]) == state(other, [0, 2, 3])).all()
    assert np.abs(physics.read("qpos")[0] - other.read("qpos")[0]).max() < POSITION


def test_friction_of_one_environment(tmp_path):
    """Boxes with a push: one slides, as its friction is smaller."""
    physics = load(tmp_path, scenes.box_xml(cone="elliptic"), 2)
    model, _ = scenes.write_scene(tmp_path, scenes.box_xml(cone="elliptic"))
    step(physics, 1)
    friction = np.tile(model.geom_friction.ravel(), (2, 1)).reshape(2, -1, 3)
    friction[1, :, 0] = 0.1
    physics.write("geom_friction", None, friction.reshape(2, -1))
    # Half the weight, more than a tenth of it.
    push = np.zeros((2, 18))
    push[:, 12] = 0.5 * 2 * 9.81
    physics.write("xfrc_applied", None, push)
    step(physics, 50)
    x = physics.read("qpos")[:, 0]
    # x = (F - mu m g) t^2 / 2 / m, of semi-implicit steps: t (t + h) / 2; the ground is soft.
    assert abs(x[0]) < 1e-3 and abs(x[1] - 0.4 * 9.81 * 0.5 * 0.51 / 2) < 0.02 * x[1]


@pytest.mark.parametrize("count", [1, 3])
def test_static_body_of_one_environment(count, tmp_path):
    """A static block moves below the box of one environment, which then stands on it."""
    physics = load(tmp_path, scenes.box_xml(), count)
    model, _ = scenes.write_scene(tmp_path, scenes.box_xml())
    pos = np.tile(model.body_pos.ravel(), (count, 1))
    block = model.body("block").id
    pos[-1, 3 * block:3 * block + 3] = [0, 0, -0.1]
    physics.write("body_pos", None, pos)
    start = np.tile(model.qpos0, (count, 1))
    start[-1, 2] += 0.1
    physics.write("qpos", None, start)
    step(physics, 100, ["contacts"])
    height = physics.read("qpos")[:, 2]
    # The top of the block is at 0.1 m. The ground is soft.
    assert np.abs(height - ([0.13] * (count - 1) + [0.23])).max() < 1e-3
    rows = physics.read("contacts")
    assert (rows[rows[:, 0] == count - 1][:, 1:3].min(axis=1) == model.geom("block").id).all()


def test_masked_writes(tmp_path):
    """A reset of some environments; the others keep their bits, whether or not it happens."""
    physics, other = (load(tmp_path, scenes.arm_xml(), 5) for _ in range(2))
    for each in (physics, other):
        each.write("target_position", None, different_targets(5))
        step(each, 25)
    envs = np.array([3, 0])
    for name in ("qpos", "qvel", "qacc_warmstart"):
        physics.write(name, envs, np.zeros((2, 10)))
    assert (physics.read("qpos")[envs] == 0).all()
    for each in (physics, other):
        step(each, 25)
    assert (state(physics, [1, 2, 4]) == state(other, [1, 2, 4])).all()
    # A reset environment repeats its first steps.
    fresh = load(tmp_path, scenes.arm_xml(), 5)
    fresh.write("target_position", None, different_targets(5))
    step(fresh, 25)
    assert (state(physics, [0, 3]) == state(fresh, [0, 3])).all()


def test_equalities_can_be_disabled(tmp_path):
    """Without its equality, a finger tip moves on its own. MuJoCo 2.2.2 has 11 numbers of an equality, MuJoCo 4 has 12."""
    physics = load(tmp_path, scenes.arm_xml(), 3)
    model, _ = scenes.write_scene(tmp_path, scenes.arm_xml())
    physics.write("target_position", None, np.tile(scenes.ARM_TARGET, (3, 1)))
    physics.write("eq_active", np.array([1]), np.array([[0.0, 1.0]]))
    data = np.tile(model.eq_data[:, :11], (3, 1, 1))
    data[2, :, 1] = 0.3
    physics.write("eq_data", None, data.reshape(3, 22))
    step(physics, 80)
    position = physics.read("qpos")
    tip, finger = position[:, [7, 9]], position[:, [6, 8]]
    ratio = tip / finger
    # Equalities are soft: tips lag behind by less than a tenth while the arm brakes.
    assert np.abs(ratio[0] - 0.8).max() < 0.08 and np.abs(ratio[2] - 0.3).max() < 0.08
    assert abs(ratio[1, 0] - 0.8) > 0.1 and abs(ratio[1, 1] - 0.8) < 0.08


@pytest.mark.parametrize("wanted", [(), ("contacts", "motion", "wrenches")])
def test_graphs_and_single_launches(wanted, tmp_path):
    """A graph has the bits of its kernels, launched one by one, in blocks of any length."""
    import warp as wp

    physics, eager, other = (load(tmp_path, scenes.arm_xml()) for _ in range(3))
    for each in (physics, eager, other):
        each.write("target_position", None, different_targets(4))
    step(physics, 40, wanted)
    for _ in range(8):
        step(other, 5, wanted)
    worlds = eager._worlds
    with wp.ScopedDevice("cpu"):
        worlds.prepare_capture(wanted)
        worlds.forward_once(())
        for _ in range(40):
            worlds.step_once(wanted)
    assert (state(physics) == state(eager)).all() and (state(physics) == state(other)).all()
    if wanted:
        for name in ("cacc", "cfrc_int", "xpos"):
            assert (physics.read(name) == eager.read(name)).all()


def test_number_of_environments_does_not_matter(tmp_path):
    """The bits of an environment are the same in batches of 1 and 7."""
    one, seven = (load(tmp_path, scenes.arm_xml(), count) for count in (1, 7))
    targets = different_targets(7)
    one.write("target_position", None, targets[[4]])
    seven.write("target_position", None, targets)
    for each in (one, seven):
        step(each, 30)
    assert (state(one)[0] == state(seven)[4]).all()
