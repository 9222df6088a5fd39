"""Physics on a device against MuJoCo's C library in double precision, on Warp's CPU device, which runs the same kernels.

Tolerances follow from the rounding of single precision, 2^-24 = 6e-8 of a number.
"""

import json

import mujoco
import numpy as np
import pytest
import warp_scenes as scenes

from kinetoscope.warp import WarpPhysics

pytestmark = pytest.mark.needs_warp

EPS = 2.0**-24
# While a drive is saturated, up to 50 steps of 0.01 s here, nothing forgets an error: independent errors of the acceleration add up
# to h^2 T^1.5 / sqrt(3) of their size in the position. A row of the solver sums 10 degrees of freedom, with up to 1000 rad/s^2:
# 113 N m at 0.1 kg m^2.
POSITION = 10 * 1000 * EPS * 0.01**2 * 50**1.5 / 3**0.5
# Stiffness times the error of a position.
EFFORT = 1e4 * POSITION


def load(tmp_path, xml, num_envs=3, device="warp-cpu", **fields):
    model, text = scenes.write_scene(tmp_path, xml, **fields)
    physics = WarpPhysics(device)
    physics.load(str(tmp_path), text, num_envs)
    return physics, scenes.Judge(tmp_path, text), model


def repeat(row, count=3):
    return np.tile(np.asarray(row, np.float32).ravel(), (count, 1))


def step(physics, count=1, capture=()):
    return json.loads(physics.step(count, capture))


# Integrator, cone, targets of velocity, feedforward efforts, stiffness and implicit damping of the arm.
MOTIONS = {
    "targets": {},
    "implicitfast": {"options": {"integrator": "implicitfast"}},
    "elliptic": {"options": {"cone": "elliptic", "impratio": 10}},
    "velocity": {"target_velocity": 0.2, "stiffness": 0.0},
    "feedforward": {"feedforward": 3.0},
    # The last joint of the arm is driven by its feedforward effort, beyond and then within its limit.
    "no gains": {"stiffness": [1e4] * 5 + [0.0] + [1e3] * 2, "damping": [1e3] * 5 + [0.0] + [1e2] * 2, "feedforward": 30.0, "viscous": 40.0},
    "viscous damping": {"viscous": 40.0},
    "higher limits": {"max_effort": 2.0},
}


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_of_an_arm(name, tmp_path):
    """100 steps to a target, with saturated drives at first."""
    motion = dict(MOTIONS[name])
    viscous, options = motion.pop("viscous", 0.0), motion.pop("options", {})
    # The armature contains the implicit half of the damping.
    damped = [(dof, viscous) for dof in range(6)] if viscous else []
    physics, judge, _ = load(tmp_path, scenes.arm_xml(armature=0.01 * viscous, **options), damped=damped)
    inputs = {"target_position": scenes.ARM_TARGET, "target_velocity": np.zeros(8), "feedforward": np.zeros(8)}
    inputs |= {"stiffness": judge.stiffness.copy(), "damping": judge.damping.copy(), "max_effort": judge.max_effort.copy()}
    for key, value in motion.items():
        inputs[key] = judge.max_effort * value if key == "max_effort" else np.broadcast_to(np.float64(value), 8)
    for key, value in inputs.items():
        # The numbers that both compute with.
        setattr(judge, key, value.astype(np.float32).astype(float))
        physics.write(key, None, repeat(value))
    worst = peak = 0.0
    for _ in range(20):
        report = step(physics, 5)
        for _ in range(5):
            judge.step()
        position, effort = physics.read("qpos"), physics.read("effort")
        worst = max(worst, np.abs(position - judge.data.qpos).max())
        peak = max(peak, np.abs(effort / judge.max_effort).max())
        assert np.abs(effort - judge.effort).max() < EFFORT
    assert worst < POSITION
    # The limit is a number of the solver, so it is exact.
    assert peak <= 1.0
    assert report["diverged"] == [] and np.abs(judge.data.qpos).max() > 0.05
    assert (physics.read("qpos") == physics.read("qpos")[0]).all()


def test_numbers_of_the_scene(tmp_path):
    """Numbers that differ from those of the file, and the constants of equalities and limits that follow from them."""
    model, text = scenes.write_scene(tmp_path, scenes.arm_xml())
    numbers = json.loads(text)["model"]
    numbers |= {"body_mass": (1.5 * model.body_mass).tolist(), "dof_armature": [0.2] * 6 + [0.001] * 4}
    numbers["body_ipos"] = (model.body_ipos + 0.01).ravel().tolist()
    physics, judge, _ = load(tmp_path, scenes.arm_xml(), model=numbers, timestep=0.005)
    other, _, _ = load(tmp_path, scenes.arm_xml())
    judge.target_position = scenes.ARM_TARGET.astype(np.float32).astype(float)
    for each in (physics, other):
        each.write("target_position", None, repeat(scenes.ARM_TARGET))
        step(each, 60)
    for _ in range(60):
        judge.step()
    assert np.abs(physics.read("qpos") - judge.data.qpos).max() < POSITION
    assert np.abs(other.read("qpos") - judge.data.qpos).max() > 100 * POSITION


def test_saturation_and_rest(tmp_path):
    """The drives reach their limits exactly, and the arm settles at its targets, but for the weight that stiffness balances."""
    physics, judge, _ = load(tmp_path, scenes.arm_xml())
    physics.write("target_position", None, repeat(scenes.ARM_TARGET))
    judge.target_position = scenes.ARM_TARGET
    peak, expected = np.zeros(8), np.zeros(8)
    for _ in range(400):
        step(physics)
        judge.step()
        peak, expected = np.maximum(peak, np.abs(physics.read("effort")[0])), np.maximum(expected, np.abs(judge.effort))
    saturated = expected == judge.max_effort
    assert saturated.sum() >= 3 and (peak[saturated] == judge.max_effort[saturated]).all()
    sag = physics.read("effort")[0] / judge.stiffness
    assert np.abs(physics.read("qpos")[0, judge.qpos] + sag - scenes.ARM_TARGET).max() < POSITION


def contacts_of(model, data):
    """Contacts of MuJoCo with constraint rows, in the order and columns of `read`."""
    rows, force = [], np.zeros(6)
    for k, contact in enumerate(data.contact):
        if contact.efc_address >= 0:
            mujoco.mj_contactForce(model, data, k, force)
            rows.append([*contact.geom, contact.dist, *contact.pos, *contact.frame, *force[:3]])
    return np.array(sorted(rows, key=lambda row: row[:2])).reshape(-1, 18)


# The normal force of a contact error is stiffness-like: the weight of a row (about M/h^2 of the links, 5 kg / 1e-4 s^2) times the
# rounding of positions near 1 m.
CONTACT_FORCE = 5e4 * 10 * EPS


@pytest.mark.parametrize("options", [{}, {"cone": "elliptic", "impratio": 100}], ids=["pyramidal", "elliptic"])
def test_contacts_of_a_standing_box(options, tmp_path):
    """Forces of the feet, and their sum, which is the weight."""
    physics, judge, _ = load(tmp_path, scenes.box_xml(**options))
    step(physics, 299)
    for _ in range(299):
        judge.step()
    step(physics, 1, ["contacts"])
    expected = []
    judge.step(lambda model, data: expected.append(contacts_of(model, data)))
    rows = physics.read("contacts")
    assert rows.shape == (12, 19) and (rows[:, 0] == np.repeat([0, 1, 2], 4)).all()
    own = rows[rows[:, 0] == 1][:, 1:]
    assert (own[:, :2] == expected[0][:, :2]).all()
    assert np.abs(own[:, 2:15] - expected[0][:, 2:15]).max() < 100 * EPS
    assert np.abs(own[:, 15:] - expected[0][:, 15:]).max() < CONTACT_FORCE
    assert abs(own[:, 15].sum() - 2 * 9.81) < 4 * CONTACT_FORCE


def test_motion_and_wrenches(tmp_path):
    """Accelerations and joint forces in the middle of a motion, at the state of the start of the step."""
    physics, judge, _ = load(tmp_path, scenes.arm_xml())
    physics.write("target_position", None, repeat(scenes.ARM_TARGET))
    judge.target_position = scenes.ARM_TARGET.astype(np.float32).astype(float)
    step(physics, 9)
    for _ in range(9):
        judge.step()
    step(physics, 1, ["wrenches", "motion"])
    expected = {}

    def capture(model, data):
        mujoco.mj_rnePostConstraint(model, data)
        for name in ("xpos", "xquat", "subtree_com", "cvel", "cacc", "cfrc_int"):
            expected[name] = getattr(data, name).ravel().copy()

    judge.step(capture)
    # Errors of the accelerations of 10 joints in a chain, of velocities after 10 steps, and of a force on 5 kg.
    acceleration = 10 * 10 * 1000 * EPS
    tolerance = {"xpos": POSITION, "xquat": POSITION, "subtree_com": POSITION, "cvel": 10 * 0.01 * acceleration,
                 "cacc": acceleration, "cfrc_int": 5 * acceleration}
    for name, values in expected.items():
        found = physics.read(name)
        assert found.shape == (3, values.size), name
        assert np.abs(found - values).max() < tolerance[name], name
        assert np.abs(values).max() > 100 * tolerance[name], f"{name}: too small to test"


def test_solve_keeps_the_state(tmp_path):
    """Contacts of a state that was written, without a step."""
    physics, judge, _ = load(tmp_path, scenes.box_xml())
    other, _, _ = load(tmp_path, scenes.box_xml())
    start = judge.data.qpos.copy()
    start[2] -= 0.002
    for each in (physics, other):
        each.write("qpos", None, repeat(start))
    judge.data.qpos[:] = start.astype(np.float32)
    before = [physics.read(name) for name in ("qpos", "qvel", "qacc_warmstart")]
    assert json.loads(physics.solve(["contacts"])) == {"diverged": [], "grown": [], "warnings": {}}
    assert all((a == physics.read(name)).all() for a, name in zip(before, ("qpos", "qvel", "qacc_warmstart"), strict=True))
    expected = []
    judge.step(lambda model, data: expected.append(contacts_of(model, data)))
    own = physics.read("contacts")[:4, 1:]
    assert np.abs(own[:, 15:] - expected[0][:, 15:]).max() < CONTACT_FORCE and own[:, 15].min() > 1.0
    for each in (physics, other):
        step(each, 20)
    assert (physics.read("qpos") == other.read("qpos")).all()


def test_forces_of_users(tmp_path):
    """Forces on joints and bodies stay until they are written again."""
    physics, judge, model = load(tmp_path, scenes.arm_xml())
    force, wrench = np.append(np.linspace(-30, 30, 6), np.zeros(4)), np.zeros((model.nbody, 6))
    wrench[4] = [50, -30, 20, 1, 2, 3]
    physics.write("qfrc_applied", None, repeat(force))
    physics.write("xfrc_applied", np.array([0, 2]), repeat(wrench, 2))
    judge.user_force[:] = force.astype(np.float32)
    judge.data.xfrc_applied[:] = wrench.astype(np.float32)
    step(physics, 40)
    for _ in range(40):
        judge.step()
    found = physics.read("qpos")
    assert np.abs(found[[0, 2]] - judge.data.qpos).max() < POSITION
    assert np.abs(found[1] - judge.data.qpos).max() > 50 * POSITION


# Rows of the solver: 2500/s^2, the stiffness of contacts at the default time constant, times the rounding of positions near 1 m;
# 10 rows, over 0.2 s.
SLIP = 10 * 2500 * EPS * 0.2**2 / 2


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize(("friction", "fall"), [(1.0, 0.0), (0.1, 9.81 - 2 * 0.1 * 5 / 0.2)], ids=["held", "slips"])
def test_grip(friction, fall, cone, tmp_path):
    """A box between two fingers: with a coefficient below 0.2, friction of 5 N on both sides does not carry its weight."""
    physics, judge, _ = load(tmp_path, scenes.grip_xml(friction, cone=cone, impratio=10))
    target = np.full(2, 0.05, np.float32)
    physics.write("target_position", None, repeat(target))
    judge.target_position = target.astype(float)
    step(physics, 20)
    for _ in range(20):
        judge.step()
    way = 1 - physics.read("qpos")[:, 4]
    assert np.abs(way - (1 - judge.data.qpos[4])).max() < SLIP
    # Semi-implicit steps: t (t + h) / 2. The fingers push from the second step on: without that friction for one step, the box
    # gains 5 m/s^2 * 0.01 s, over 0.2 s. Held boxes creep.
    assert abs(way[0] - fall * 0.2 * 0.21 / 2) < 0.01
