"""Sizes of the arrays for constraint rows and contacts, and the memory that they need."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from .errors import DeviceError

# Memory of the solver inside a graph, relative to that of the data.
SOLVER_SHARE = 0.5
MARGIN = 1.5
SMALLEST = 16


def rounded(count: float) -> int:
    """Next size of the series 16, 24, 32, 48, 64, 96, ...: few sizes need few kernels."""
    size = SMALLEST
    while True:
        for candidate in (size, size * 3 // 2):
            if candidate >= count:
                return candidate
        size *= 2


def initial_sizes(model: Any) -> tuple[int, int]:
    """Constraint rows and contacts for each environment: 1.5 times those of the initial state."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return rounded(MARGIN * data.nefc), rounded(MARGIN * data.ncon)


def enlarged(size: int, need: int) -> int:
    """A larger size than `size`, with a margin over `need`: each growth compiles kernels."""
    return rounded(max(size + 1, MARGIN * need))


def array_bytes(data: Any) -> int:
    """Bytes of the arrays of a dataclass of Warp, without those of nested dataclasses."""
    arrays = (getattr(data, field.name) for field in dataclasses.fields(data))
    return sum(array.capacity for array in arrays if hasattr(array, "capacity"))


def available_bytes(device: Any) -> int:
    """Free memory of a device [bytes]."""
    if device.is_cuda:
        return int(device.free_memory)
    for line in Path("/proc/meminfo").read_text().splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    raise DeviceError("/proc/meminfo has no line MemAvailable; expected a Linux kernel of version 3.14 or newer")


def check_memory(data: Any, device: Any, rows: int, contacts: int) -> None:
    """Raises DeviceError if arrays for `rows` constraint rows and `contacts` contacts of each environment do not fit.

    The arrays of `data` are freed before the new ones are made.
    """
    environments = data.nworld
    row_bytes, contact_bytes, other = array_bytes(data.efc), array_bytes(data.contact), array_bytes(data)
    needed = other + row_bytes * rows / data.njmax + contact_bytes * contacts * environments / data.naconmax
    available = available_bytes(device) + other + row_bytes + contact_bytes
    if needed * (1.0 + SOLVER_SHARE) > available:
        raise DeviceError(
            f"{environments} environments with up to {contacts} contacts and {rows} constraint rows each need about "
            f"{needed * (1.0 + SOLVER_SHARE) / 2**30:.1f} GiB, but the device {device.alias} has {available / 2**30:.1f} GiB; "
            "expected fewer environments, fewer contacts in each, or a device with more memory"
        )
