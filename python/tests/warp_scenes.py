"""Scenes for the tests of physics on a device, and the same physics in MuJoCo's C library as their judge.

The judge works in double precision. Its drive law follows the equations of `sim/src/drive/implicit.rs`, apart from the kernels.
"""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np

UNLIMITED = 1e15

SERVO = ('<general name="{0}" joint="{0}" gainprm="{1}" biastype="affine" biasprm="0 -{1} -{2}" forcelimited="true" '
         'forcerange="-{3} {3}"/>')
HEAD = ('<mujoco><compiler angle="radian" autolimits="false" inertiafromgeom="false"/><option timestep="0.01" integrator="{integrator}" '
        'cone="{cone}" impratio="{impratio}" iterations="100" solver="{solver}"/><worldbody><geom name="ground" type="plane" size="9 9 1"/>')
# Axis, length [m] and mass [kg] of the links of an arm, and the limits of its drives [N m].
LINKS = (("0 0 1", 0.1, 6, 113), ("0 1 0", 0.4, 5, 113), ("0 1 0", 0.4, 3, 70), ("0 0 1", 0.1, 1.5, 25), ("0 1 0", 0.1, 1.5, 25),
         ("0 0 1", 0.1, 1, 19))
ARM_TARGET = np.array([0.0, 0.5, 1.2, 0.3, 0.5, 0.0, -0.4, -0.6])
# The hand presses the ground.
PRESSING_TARGET = np.array([0.2, 1.6, 0.7, 0.0, 0.1, 0.0, 0.0, 0.0])


def head(integrator="Euler", cone="pyramidal", impratio=1, solver="Newton"):
    return HEAD.format(integrator=integrator, cone=cone, impratio=impratio, solver=solver)


def arm_xml(armature=0.0, **options):
    """An arm of 6 joints, with two fingers that have two coupled joints each: 10 degrees of freedom, 8 drives."""
    bodies, closing = "", ""
    for k, (axis, length, mass, _) in enumerate(LINKS):
        offset = "0 0 0.1" if k == 0 else f"0 0 {LINKS[k - 1][1]}"
        bodies += (
            f'<body name="link{k}" pos="{offset}"><inertial pos="0 0 {length / 2}" mass="{mass}" diaginertia="0.02 0.02 0.01"/>'
            f'<joint name="j{k}" axis="{axis}" limited="true" range="-3 3" armature="{armature}"/>'
            f'<geom name="link{k}" type="capsule" fromto="0 0 0 0 0 {length}" size="0.04" contype="2" conaffinity="1"/>'
        )
        closing += "</body>"
    fingers = "".join(
        f'<body name="finger{side}" pos="{x} 0 0.12"><inertial pos="0 0 0.02" mass="0.02" diaginertia="1e-5 1e-5 1e-5"/>'
        f'<joint name="f{side}" axis="0 1 0" limited="true" range="-1.5 1.5"/>'
        f'<geom name="finger{side}" type="box" pos="0 0 0.02" size="0.008 0.01 0.02" contype="2" conaffinity="1"/>'
        f'<body name="tip{side}" pos="0 0 0.04"><inertial pos="0 0 0.02" mass="0.01" diaginertia="1e-5 1e-5 1e-5"/>'
        f'<joint name="t{side}" axis="0 1 0" limited="true" range="-1.5 1.5"/>'
        f'<geom name="tip{side}" type="box" pos="0 0 0.02" size="0.007 0.01 0.02" contype="2" conaffinity="1"/></body></body>'
        for side, x in (("a", -0.04), ("b", 0.04))
    )
    equalities = "".join(f'<joint joint1="t{side}" joint2="f{side}" polycoef="0 0.8 0 0 0"/>' for side in "ab")
    servos = "".join(SERVO.format(f"j{k}", 10000, 1000, limit) for k, (*_, limit) in enumerate(LINKS))
    servos += "".join(SERVO.format(f"f{side}", 1000, 100, 2) for side in "ab")
    return f"{head(**options)}{bodies}{fingers}{closing}</worldbody><equality>{equalities}</equality><actuator>{servos}</actuator></mujoco>"


def box_xml(**options):
    """A box of 2 kg on four feet that stands on the ground, and a static block beside it."""
    feet = "".join(f'<geom type="sphere" size="0.03" pos="{x} {y} -0.1" contype="2" conaffinity="1"/>'
                   for x in (-0.2, 0.2) for y in (-0.1, 0.1))
    return (
        f'{head(**options)}<body name="block" pos="3 0 0.2"><geom name="block" type="box" size="0.2 0.2 0.2" contype="1" conaffinity="2"/></body>'
        f'<body name="box" pos="0 0 0.13"><freejoint/><inertial pos="0 0 0" mass="2" diaginertia="0.02 0.03 0.04"/>{feet}</body>'
        "</worldbody></mujoco>"
    )


def grip_xml(friction, **options):
    """Two fingers whose drives push with up to 5 N each on a tall box of 0.2 kg between them, above the ground."""
    fingers = "".join(
        f'<body name="finger{side}" pos="{x} 0 1"><inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'
        f'<joint name="f{side}" type="slide" axis="{axis} 0 0"/>'
        f'<geom type="sphere" size="0.01" friction="{friction} 0.005 0.0001" contype="2" conaffinity="1"/></body>'
        for side, x, axis in (("a", -0.04, 1), ("b", 0.04, -1))
    )
    box = (
        '<body name="box" pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass="0.2" diaginertia="1e-4 1e-4 1e-4"/>'
        f'<geom type="box" size="0.03 0.03 0.15" friction="{friction} 0.005 0.0001"/></body>'
    )
    servos = "".join(SERVO.format(f"f{side}", 1000, 20, 5) for side in "ab")
    return f"{head(**options)}{fingers}{box}</worldbody><actuator>{servos}</actuator></mujoco>"


def drives_of(model):
    """Drives of the position servos in an exported scene: their gains and limits are those of the actuators."""
    drives = []
    for actuator in range(model.nu):
        if model.actuator_biastype[actuator] != mujoco.mjtBias.mjBIAS_AFFINE:
            continue
        joint = model.actuator_trnid[actuator, 0]
        limit = model.actuator_forcerange[actuator, 1] if model.actuator_forcelimited[actuator] else None
        drives.append({
            "name": model.joint(joint).name,
            "dof": int(model.jnt_dofadr[joint]),
            "qpos": int(model.jnt_qposadr[joint]),
            "ctrl": actuator,
            "stiffness": float(model.actuator_gainprm[actuator, 0]),
            "damping": float(-model.actuator_biasprm[actuator, 2]),
            "max_effort": limit,
        })
    return drives


def scene_json(compiled, damped=(), **replaced):
    """Numbers of a scene, as Kinetoscope writes them, for an exported scene."""
    drives = drives_of(compiled)
    names = ("nq", "nv", "nu", "nbody", "ngeom", "neq", "ntendon", "na", "nmocap")
    arrays = ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature", "dof_damping", "dof_frictionloss")
    scene = {
        "version": 1,
        "timestep": compiled.opt.timestep,
        "sizes": {name: int(getattr(compiled, name)) for name in names},
        "model": {name: getattr(compiled, name).ravel().tolist() for name in arrays},
        "silent_actuators": [drive["ctrl"] for drive in drives],
        "drives": drives,
        "damped": [list(pair) for pair in damped],
    }
    return scene | replaced


def write_scene(folder, xml, **fields):
    """Writes a scene to `folder`. Returns its compiled model and the text of its numbers."""
    path = Path(folder) / "scene.xml"
    path.write_text(xml)
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, json.dumps(scene_json(model, **fields))


class Judge:
    """One environment in MuJoCo's C library, double precision, with drives as constraint rows."""

    def __init__(self, folder, text):
        scene = json.loads(text)
        self.model = mujoco.MjModel.from_xml_path(str(Path(folder) / "scene.xml"))
        model, drives = self.model, scene["drives"]
        for name, numbers in scene["model"].items():
            getattr(model, name).flat[:] = numbers
        mujoco.mj_setConst(model, mujoco.MjData(model))
        model.opt.timestep = scene["timestep"]
        self.dof, self.qpos, self.ctrl = (np.array([drive[key] for drive in drives], int) for key in ("dof", "qpos", "ctrl"))
        self.stiffness, self.damping = (np.array([drive[key] for drive in drives], float) for key in ("stiffness", "damping"))
        self.max_effort = np.array([UNLIMITED if drive["max_effort"] is None else drive["max_effort"] for drive in drives], float)
        self.damped = [(int(dof), coefficient) for dof, coefficient in scene["damped"]]
        model.dof_frictionloss[self.dof] = 1.0
        model.actuator_gainprm[scene["silent_actuators"]] = 0.0
        model.actuator_biasprm[scene["silent_actuators"]] = 0.0
        # With islands, MuJoCo reorders the rows.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
        self.data = mujoco.MjData(model)
        zero = np.zeros(len(drives))
        self.target_position, self.target_velocity, self.feedforward, self.effort = zero.copy(), zero.copy(), zero.copy(), zero.copy()
        self.user_force = np.zeros(model.nv)

    def half_step(self):
        """The forward pass, the drive rows, and the solution of the step, before its integration."""
        model, data, h = self.model, self.data, self.model.opt.timestep
        mujoco.mj_step1(model, data)
        data.qfrc_applied[:] = self.user_force
        for dof, coefficient in self.damped:
            data.qfrc_applied[dof] -= coefficient * data.qvel[dof]
        friction = {int(data.efc_id[row]): row for row in range(data.nefc)
                    if data.efc_type[row] == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF}
        self.rows = [friction[dof] for dof in self.dof]
        self.has_gains = (self.stiffness > 0) | (self.damping > 0)
        for k, row in enumerate(self.rows):
            position, velocity = data.qpos[self.qpos[k]], data.qvel[self.dof[k]]
            if self.has_gains[k]:
                weight = h * (self.damping[k] + h * self.stiffness[k])
                effort = self.stiffness[k] * (self.target_position[k] - position) + self.damping[k] * self.target_velocity[k]
                reference, limit = (effort + self.feedforward[k]) / weight - velocity / h, self.max_effort[k]
            else:
                data.qfrc_applied[self.dof[k]] += np.clip(self.feedforward[k], -self.max_effort[k], self.max_effort[k])
                weight, reference, limit = 1e-6, 0.0, 0.0
            data.efc_D[row], data.efc_R[row], data.efc_aref[row], data.efc_frictionloss[row] = weight, 1 / weight, reference, limit

    def step(self, capture=None):
        """One step; `capture` is called between its solution and the next forward pass."""
        self.half_step()
        before = self.data.qvel.copy()
        mujoco.mj_step2(self.model, self.data)
        limited = np.clip(self.feedforward, -self.max_effort, self.max_effort)
        self.effort = np.where(self.has_gains, self.data.efc_force[self.rows], limited)
        if capture is not None:
            after = self.data.qvel.copy()
            self.data.qvel[:] = before
            capture(self.model, self.data)
            self.data.qvel[:] = after
