"""Compiled model of a scene with the numbers that Kinetoscope computed, and the table of its drives."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import DeviceError, UnsupportedSceneError

SCENE_VERSION = 1
SCENE_FILE = "scene.xml"
FIELDS = ("timestep", "sizes", "model", "silent_actuators", "drives", "damped")

# Arrays of the compiled model that the scene may replace.
REPLACED = (
    "body_mass",
    "body_inertia",
    "body_ipos",
    "body_iquat",
    "dof_armature",
    "dof_damping",
    "dof_frictionloss",
)

# A limit that is never reached, for drives without one. A larger number times the weight of a row overflows in single precision.
UNLIMITED = 1e9


@dataclasses.dataclass
class Scene:
    """A compiled model, and the inputs that Kinetoscope adds to it."""

    model: Any
    """`mujoco.MjModel`, prepared for constraint rows of drives."""
    drive_names: list[str]
    dof: NDArray[Any]
    """Degree of freedom of each drive, shape (drives,)."""
    qpos: NDArray[Any]
    """Index of each drive in `qpos`, shape (drives,)."""
    ctrl: NDArray[Any]
    """Index of each drive in `ctrl`, shape (drives,)."""
    stiffness: NDArray[Any]
    """Stiffness [N m/rad or N/m], shape (drives,)."""
    damping: NDArray[Any]
    """Damping [N m s/rad or N s/m], shape (drives,)."""
    max_effort: NDArray[Any]
    """Limit of the effort [N m or N], shape (drives,)."""
    damped: NDArray[Any]
    """Degrees of freedom with implicit damping, shape (damped,)."""
    viscous_damping: NDArray[Any]
    """Coefficients of the implicit damping [N m s/rad or N s/m], shape (damped,)."""


def load_scene(folder: str, text: str) -> Scene:
    """Compiles `scene.xml` of `folder` and applies the numbers of `text`, the JSON of a scene.

    Raises UnsupportedSceneError for an option that Warp or the drive rows do not support, and DeviceError for a file that does
    not compile to the model that the numbers belong to.
    """
    import mujoco

    scene = read_numbers(text)
    path = Path(folder) / SCENE_FILE
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, OSError) as error:
        raise DeviceError(f"MuJoCo {mujoco.__version__} does not compile {path}: {error}") from error
    check_sizes(model, scene["sizes"])
    replace_numbers(model, scene["model"])
    model.opt.timestep = scene["timestep"]
    drives = scene["drives"]
    damped = np.array(scene["damped"], dtype=float).reshape(-1, 2)
    check_indices(model, drives, damped, scene["silent_actuators"])
    check_options(model, bool(drives))
    prepare(model, [drive["dof"] for drive in drives], scene["silent_actuators"])
    return Scene(
        model=model,
        drive_names=[drive["name"] for drive in drives],
        dof=np.array([drive["dof"] for drive in drives], dtype=np.int32),
        qpos=np.array([drive["qpos"] for drive in drives], dtype=np.int32),
        ctrl=np.array([drive["ctrl"] for drive in drives], dtype=np.int32),
        stiffness=np.array([drive["stiffness"] for drive in drives], dtype=float),
        damping=np.array([drive["damping"] for drive in drives], dtype=float),
        max_effort=np.array([UNLIMITED if drive["max_effort"] is None else drive["max_effort"] for drive in drives], dtype=float),
        damped=damped[:, 0].astype(np.int32),
        viscous_damping=damped[:, 1],
    )


def read_numbers(text: str) -> dict[str, Any]:
    """Fields of the JSON of a scene. Raises DeviceError for other JSON, and for another version."""
    try:
        scene: Any = json.loads(text)
    except ValueError as error:
        raise DeviceError(f"the numbers of the scene are not JSON: {error}") from error
    version = scene.get("version") if isinstance(scene, dict) else None
    if version != SCENE_VERSION:
        raise DeviceError(f"the numbers of the scene have version {version!r}; expected {SCENE_VERSION}: install kinetoscope again")
    missing = [name for name in FIELDS if name not in scene]
    if missing:
        raise DeviceError(f"the numbers of the scene have no field {missing[0]}; expected {', '.join(FIELDS)}")
    return dict(scene)


def check_sizes(model: Any, sizes: dict[str, int]) -> None:
    """Raises DeviceError if MuJoCo compiled the scene to other sizes than those of Kinetoscope's model."""
    for name, expected in sizes.items():
        found = getattr(model, name)
        if found != expected:
            raise DeviceError(f"the scene compiles differently in MuJoCo 4: {name} is {found}; expected {expected}")


def replace_numbers(model: Any, arrays: dict[str, list[float]]) -> None:
    """Replaces arrays of the model, and recomputes the constants that depend on them."""
    import mujoco

    for name, numbers in arrays.items():
        if name not in REPLACED:
            raise DeviceError(f'the scene replaces the array "{name}" of the model; expected one of {", ".join(REPLACED)}')
        target = getattr(model, name)
        if len(numbers) != target.size:
            sizes = f"{name} has {target.size} numbers; expected {len(numbers)}"
            raise DeviceError(f"the scene compiles differently in MuJoCo 4: {sizes}")
        target[:] = np.array(numbers, dtype=float).reshape(target.shape)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def check_indices(model: Any, drives: list[dict[str, Any]], damped: NDArray[Any], silent: list[int]) -> None:
    """Raises DeviceError for an index outside of the model, and for two drives of one degree of freedom."""
    indices = [(f'drive "{drive["name"]}"', axis, drive[axis], size)
               for drive in drives for axis, size in (("dof", model.nv), ("qpos", model.nq), ("ctrl", model.nu))]
    indices += [("damping", "dof", int(dof), model.nv) for dof in damped[:, 0]]
    indices += [("silent actuators", "ctrl", actuator, model.nu) for actuator in silent]
    for owner, axis, index, size in indices:
        if not 0 <= index < size:
            raise DeviceError(f"{owner}: index {index} of {axis} does not exist; the model has {size}")
    owners: dict[int, str] = {}
    for drive in drives:
        if drive["dof"] in owners:
            both = f'"{owners[drive["dof"]]}" and "{drive["name"]}"'
            raise DeviceError(f"the drives {both} have the same degree of freedom {drive['dof']}")
        owners[drive["dof"]] = drive["name"]


def check_options(model: Any, has_drives: bool) -> None:
    """Raises UnsupportedSceneError for options with which Warp would compute something else than MuJoCo."""
    import mujoco

    integrators = (mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    if model.opt.integrator not in integrators:
        name = mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_")
        raise UnsupportedSceneError(f"integrator {name} is not supported on a device; expected Euler or implicitfast")
    if model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
        raise UnsupportedSceneError("solver PGS is not supported on a device; expected Newton or CG")
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        raise UnsupportedSceneError("sleeping bodies are not supported on a device; expected the flag sleep to be disabled")
    rows = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    if has_drives and model.opt.disableflags & rows:
        raise UnsupportedSceneError("drives need the flags constraint and frictionloss; expected both to be enabled")
    if model.nplugin:
        raise UnsupportedSceneError("plugins are not supported on a device; expected a scene without plugins")


def prepare(model: Any, dofs: list[int], silent: list[int]) -> None:
    """Gives every driven degree of freedom a friction row, and silences actuators; their `ctrl` is still stored."""
    import mujoco

    # Friction rows then are entries of a diagonal, in place of dense rows.
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    # Any positive value makes MuJoCo build the row; the drive kernel writes its limit in every step.
    model.dof_frictionloss[dofs] = 1.0
    model.actuator_gainprm[silent] = 0.0
    model.actuator_biasprm[silent] = 0.0
    # Sensors of MuJoCo are evaluated on the CPU.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
    if not model.dof_damping.any():
        # Without damping of joints, the implicit Euler integrator would factorize the inertia twice for the same result.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
