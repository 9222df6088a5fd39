"""Reads and writes of rows of all environments, or of some."""

from __future__ import annotations

from typing import Any

import mujoco_warp as mjw
import numpy as np
from numpy.typing import NDArray
import warp as wp

from . import kernels
from .errors import ArgumentError
from .worlds import CONTACT_COLUMNS, DRIVE_INPUTS, INPUTS, MOTION, STATE, WRENCHES, Worlds

# Arrays of the model of which environments can have their own row.
MODEL_ARRAYS = (
    "body_mass",
    "body_subtreemass",
    "body_inertia",
    "body_ipos",
    "body_iquat",
    "body_pos",
    "body_quat",
    "body_invweight0",
    "dof_invweight0",
    "dof_armature",
    "dof_damping",
    "dof_frictionloss",
    "tendon_frictionloss",
    "tendon_invweight0",
    "geom_friction",
    "geom_size",
    "geom_rbound",
    "geom_aabb",
    "gravity",
    "eq_data",
)
WRITABLE = (*STATE, *INPUTS, "qfrc_applied", *DRIVE_INPUTS, "viscous_damping", *MODEL_ARRAYS)
# Arrays that `Data` and the kernels keep for the whole life of the environments.
KEPT = ("qpos", "qvel", "qacc_warmstart", "act", "qacc")
CAPTURED = (*MOTION, *WRENCHES)
# Results of the last step that stay in `Data`.
SOLVED = ("actuator_force", "qfrc_actuator", "qfrc_constraint")
READABLE = (*KEPT, "effort", *SOLVED, *CAPTURED, "contacts")
# Numbers of an equality constraint in MuJoCo 2.2.2; MuJoCo 4 has one more.
OLD_EQUALITY_NUMBERS = 11


def row_width(array: wp.array) -> int:
    """Numbers of an array for one environment."""
    if array.size == 0:
        return 0
    return int(array.strides[0]) // (1 if array.dtype is wp.bool else 4)


def rows_of(array: wp.array) -> wp.array:
    """Numbers of an array, shape (environments, numbers), in the same memory."""
    dtype = wp.bool if array.dtype is wp.bool else wp.float32
    return wp.array(ptr=array.ptr, shape=(array.shape[0], row_width(array)), dtype=dtype, device=array.device)


def writable_array(worlds: Worlds, name: str) -> wp.array:
    """Array of an input, with one row for each environment."""
    if name in worlds.drives:
        return worlds.drives[name]
    if name == "viscous_damping":
        return worlds.viscous_damping
    if name == "qfrc_applied":
        return worlds.user_force
    if name in MODEL_ARRAYS:
        return model_array(worlds, name)
    return worlds.kept_arrays[name]


def model_array(worlds: Worlds, name: str) -> wp.array:
    """Array of the model with one row for each environment, made at the first use."""
    owner: Any = worlds.model.opt if name == "gravity" else worlds.model
    array = getattr(owner, name)
    if array.shape[0] != worlds.num_envs:
        array = wp.array(np.repeat(array.numpy(), worlds.num_envs, axis=0), dtype=array.dtype)
        setattr(owner, name, array)
        # Graphs contain the address of the shared row.
        worlds.graphs.clear()
    return array


def write(worlds: Worlds, name: str, envs: NDArray[Any] | None, values: NDArray[Any]) -> None:
    """Writes rows of the array `name`, one of `WRITABLE`: those of the environments `envs`, or of all."""
    array = writable_array(worlds, name)
    width = row_width(array)
    if name == "eq_data":
        values = padded_equalities(values, worlds.scene.model.neq, width)
    if values.shape[1] != width:
        raise ArgumentError(f"{name}: got {values.shape[1]} numbers for each environment; expected {width}")
    if values.size == 0:
        return
    prepare_model(worlds, name, values)
    flags = array.dtype is wp.bool
    rows = rows_of(array)
    ids = wp.array(np.arange(worlds.num_envs) if envs is None else envs, dtype=int)
    if envs is None and not flags:
        rows.assign(values)
    else:
        kernel = kernels.write_flags if flags else kernels.write_rows
        wp.launch(kernel, dim=values.shape, inputs=[ids, wp.array(values, dtype=float)], outputs=[rows])
    if name == "qpos":
        wp.launch(kernels.unfreeze, dim=ids.size, inputs=[ids], outputs=[worlds.frozen, worlds.bad])
    if name in STATE or name in MODEL_ARRAYS:
        worlds.is_forward_needed = True


def prepare_model(worlds: Worlds, name: str, values: NDArray[Any]) -> None:
    """Enables the parts of a step that Warp or `model.prepare` left out for the model as it was loaded."""
    flag = int(mjw.DisableBit.EULERDAMP)
    if name == "dof_damping" and values.any() and worlds.model.opt.disableflags & flag:
        worlds.model.opt.disableflags &= ~flag
        worlds.graphs.clear()
    if name in ("body_pos", "body_quat") and not worlds.are_bodies_moved:
        worlds.are_bodies_moved = True
        worlds.graphs.clear()


def padded_equalities(values: NDArray[Any], count: int, width: int) -> NDArray[Any]:
    """Numbers of equality constraints in the layout of MuJoCo 4. Those of MuJoCo 2.2.2 get zeros."""
    if values.shape[1] != OLD_EQUALITY_NUMBERS * count or count == 0:
        return values
    rows = values.reshape(len(values), count, OLD_EQUALITY_NUMBERS)
    return np.pad(rows, ((0, 0), (0, 0), (0, width // count - OLD_EQUALITY_NUMBERS))).reshape(len(values), width)


def read(worlds: Worlds, name: str) -> NDArray[Any]:
    """Numbers of the array `name`, one of `READABLE`, float32, shape (environments, numbers); (contacts, 19) for contacts."""
    if name == "contacts" or name in CAPTURED:
        if name not in worlds.captured:
            kind = name if name == "contacts" else "motion" if name in MOTION else "wrenches"
            raise ArgumentError(f'"{name}" was not captured; expected a step or solve with the capture "{kind}" before')
        if name == "contacts":
            return read_contacts(worlds)
        array = worlds.captured[name]
    elif name == "effort":
        array = worlds.effort
    elif name in SOLVED:
        array = getattr(worlds.data, name)
    else:
        array = worlds.kept_arrays[name]
    if array.size == 0:
        return np.zeros((worlds.num_envs, 0), np.float32)
    return np.ascontiguousarray(rows_of(array).numpy())


def read_contacts(worlds: Worlds) -> NDArray[Any]:
    """Captured contacts, sorted by environment, geoms, and number within the pair."""
    count = int(worlds.captured["used"].numpy()[0])
    if count == 0:
        return np.zeros((0, CONTACT_COLUMNS - 1), np.float32)
    rows = worlds.captured["contacts"][:count].numpy()
    order = np.lexsort((rows[:, 19], rows[:, 2], rows[:, 1], rows[:, 0]))
    return np.ascontiguousarray(rows[order, : CONTACT_COLUMNS - 1])
