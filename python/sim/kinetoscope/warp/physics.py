"""Physics of all environments of a scene on a device, with plain arrays as arguments and results."""

from __future__ import annotations

import difflib
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import ArgumentError, DeviceError, UnknownNameError
from .model import load_scene
from .requirements import find_device

if TYPE_CHECKING:
    from .worlds import Worlds

# Steps between two looks at the flags of the device.
BLOCK = 16
# Bits of Warp's overflow that are not sizes, by their positions.
WARNINGS = {
    5: "height_field_contacts",
    6: "contact_sensor_matches",
    8: "convex_collision_horizon",
    9: "solver_iterations",
    10: "line_search_iterations",
}


class WarpPhysics:
    """Physics of a batch of environments of one scene on a device.

    `device` is "cuda", "cuda:N" or "warp-cpu"; the last one runs the same kernels on the CPU. All numbers are in single
    precision. Raises DeviceError if the device or a package is missing.
    """

    def __init__(self, device: str) -> None:
        self._device, self.versions = find_device(device)
        self.device = device
        self._worlds: Worlds | None = None

    def load(self, folder: str, scene: str, num_envs: int) -> None:
        """Loads `scene.xml` of `folder` with the numbers of `scene`, JSON, into `num_envs` environments.

        Replaces a scene that was loaded before, also if it raises. Raises UnsupportedSceneError for a scene that MuJoCo Warp does
        not support, and DeviceError for one that does not fit into the memory of the device.
        """
        import warp as wp

        from .worlds import Worlds

        if num_envs < 1:
            raise ArgumentError(f"num_envs is {num_envs}; expected 1 or more")
        self._worlds = None
        with wp.ScopedDevice(self._device):
            # Kernels are compiled at the first step: a program may add further entities before.
            self._worlds = Worlds(load_scene(folder, scene), self._device, num_envs)

    def write(self, name: str, envs: NDArray[Any] | None, values: NDArray[Any]) -> None:
        """Writes rows of the array `name`: those of the environments `envs`, or of all.

        `values` has shape (environments, numbers). A write of "qpos" lets a diverged environment step again.
        """
        from . import access

        worlds = self._loaded()
        check_name(name, access.WRITABLE, "written")
        values = np.ascontiguousarray(values, dtype=np.float32)
        count = worlds.num_envs
        if envs is not None:
            envs = np.ascontiguousarray(envs, dtype=np.int32)
            if envs.ndim != 1 or (envs.size and not (0 <= envs.min() and envs.max() < worlds.num_envs)):
                raise ArgumentError(f"{name}: expected a list of environments from 0 to {worlds.num_envs - 1}; got {envs.tolist()}")
            count = envs.size
        if values.ndim != 2 or len(values) != count:
            raise ArgumentError(f"{name}: got an array of shape {values.shape}; expected ({count}, numbers of one environment)")
        with self._scope():
            access.write(worlds, name, envs, values)

    def step(self, steps: int, capture: Sequence[str] = ()) -> str:
        """Does `steps` steps in all environments, and captures quantities in the last one.

        `capture` is a subset of "contacts", "motion" and "wrenches". Returns a report, JSON: "diverged", a list of environment,
        step of this call from 0 and reason ("qpos", "qvel" or "qacc"); "grown", a list of constraint rows and contacts for each
        environment; "warnings", numbers of environments by name.
        """
        worlds, wanted = self._loaded(), self._capture(capture)
        if steps < 0:
            raise ArgumentError(f"steps is {steps}; expected 0 or more")
        grown: list[tuple[int, int]] = []
        warnings: dict[str, int] = {}
        diverged = 0
        with self._scope():
            worlds.begin_call()
            for first in range(0, steps, BLOCK):
                count = min(BLOCK, steps - first)
                diverged = self._run(worlds, "step_once", count, wanted if first + count == steps else (), grown, warnings)
            if steps == 0:
                worlds.forward()
            lost = worlds.divergences() if diverged else []
        return json.dumps({"diverged": lost, "grown": grown, "warnings": warnings})

    def solve(self, capture: Sequence[str]) -> str:
        """Solves and captures the current state, which stays the same, as do the efforts. Returns a report as `step` does.

        An environment that would diverge in its next step has no contacts in the capture.
        """
        worlds, wanted = self._loaded(), self._capture(capture)
        grown: list[tuple[int, int]] = []
        warnings: dict[str, int] = {}
        with self._scope():
            worlds.begin_call()
            self._run(worlds, "solve_once", 1, wanted, grown, warnings)
        return json.dumps({"diverged": [], "grown": grown, "warnings": warnings})

    def read(self, name: str) -> NDArray[Any]:
        """Numbers of the array `name`, float32, shape (environments, numbers).

        For "contacts", shape (contacts, 19): environment, two geoms, distance [m], point [m] (3), normal from the first geom to the
        second and two tangents (9), and the force on the second geom along these axes [N] (3). Bodies are captured at the
        start of the step.
        """
        from . import access

        worlds = self._loaded()
        check_name(name, access.READABLE, "read")
        with self._scope():
            return access.read(worlds, name)

    def tensor(self, name: str) -> Any:
        """Array `name` of the state on the device (`warp.array`), for views of other libraries.

        It is valid until the next `load`. A position or velocity written to it takes part in contacts one step later than one
        that `write` wrote.
        """
        from . import access

        worlds = self._loaded()
        check_name(name, access.KEPT, "shared")
        return worlds.kept_arrays[name]

    def num_envs(self) -> int:
        """Number of environments."""
        return self._loaded().num_envs

    def sizes(self) -> tuple[int, int]:
        """Constraint rows and contacts for each environment that fit into the arrays of the device."""
        worlds = self._loaded()
        return worlds.rows, worlds.contacts

    def close(self) -> None:
        """Frees the memory of the device."""
        self._worlds = None

    def _loaded(self) -> Worlds:
        if self._worlds is None:
            raise DeviceError("no scene is loaded on the device; expected a call of load before")
        return self._worlds

    def _scope(self) -> Any:
        import warp as wp

        return wp.ScopedDevice(self._device)

    def _capture(self, capture: Sequence[str]) -> tuple[str, ...]:
        from .worlds import CAPTURES

        for name in capture:
            check_name(name, CAPTURES, "captured")
        # In the order of the list, so that each subset has one graph.
        return tuple(name for name in CAPTURES if name in capture)

    def _run(
        self,
        worlds: Worlds,
        operation: str,
        count: int,
        wanted: tuple[str, ...],
        grown: list[tuple[int, int]],
        warnings: dict[str, int],
    ) -> int:
        """Runs a block until all arrays were large enough. Returns the number of environments that diverged in this call."""
        from .worlds import SIZE_BITS

        while True:
            summary = worlds.run(operation, count, wanted)
            if summary.overflow & SIZE_BITS == 0:
                break
            worlds.grow(summary)
            grown.append((worlds.rows, worlds.contacts))
        for bit, name in WARNINGS.items():
            if summary.bits[bit]:
                warnings[name] = max(warnings.get(name, 0), summary.bits[bit])
        return summary.diverged


def check_name(name: str, known: Sequence[str], verb: str) -> None:
    """Raises UnknownNameError for a name that is not in `known`."""
    if name not in known:
        near = difflib.get_close_matches(name, known, n=3)
        raise UnknownNameError(f'"{name}" cannot be {verb}; expected one of {", ".join(near or known)}')
