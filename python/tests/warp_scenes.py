"""Scenes for the tests of physics on a device, and the same physics in MuJoCo's C library as their judge.

The judge works in double precision. Its drive law is written from the equations of `docs` and `sim/src/drive/implicit.rs`, apart from
the kernels.
"""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np

UNLIMITED = 1e15


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


def scene_json(model, damped=(), **replaced):
    """Numbers of a scene, as Kinetoscope writes them, for an exported scene."""
    drives = drives_of(model)
    names = ("nq", "nv", "nu", "nbody", "ngeom", "neq", "ntendon", "na", "nmocap")
    arrays = ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature", "dof_damping", "dof_frictionloss")
    scene = {
        "version": 1,
        "timestep": model.opt.timestep,
        "sizes": {name: int(getattr(model, name)) for name in names},
        "model": {name: getattr(model, name).ravel().tolist() for name in arrays},
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
