"""Places of fields in MuJoCo's structures.

The structures `mjvGeom` and `mjvLight` differ between versions of MuJoCo. The places of their fields are measured once
per process: each field of a scratch scene is set to two values, and the bytes that change are the field.
"""

from __future__ import annotations

import ctypes
import functools
import struct
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

_GEOM_NUMBERS = (
    "type", "dataid", "objtype", "objid", "category", "matid", "texid", "texuniform", "segid", "emission", "specular",
    "shininess", "reflectance",
)
_GEOM_ARRAYS = ("size", "pos", "mat", "rgba", "texrepeat")
_GEOM_OPTIONAL = ("matid", "texid", "texuniform", "texrepeat")
_LIGHT_NUMBERS = ("id", "type", "directional", "cutoff", "exponent", "headlight", "castshadow")
_LIGHT_ARRAYS = ("pos", "dir", "attenuation", "ambient", "diffuse", "specular")
_SIZES = {
    "size": 3, "pos": 3, "mat": 9, "rgba": 4, "texrepeat": 2, "dir": 3, "attenuation": 3, "ambient": 3, "diffuse": 3,
}
_LIGHT_OPTIONAL = ("id", "type", "directional")
_TYPES = (
    "mjGEOM_SKIN", "mjGEOM_FLEX", "mjGEOM_SDF", "mjGEOM_ARROW", "mjGEOM_ARROW1", "mjGEOM_ARROW2", "mjGEOM_LINE",
    "mjGEOM_LINEBOX", "mjGEOM_TRIANGLE",
)
# Values of which all bytes differ.
_INTEGERS = (0x5A5B5C5D, 0x25242322)
_FLOATS = struct.unpack("=ff", struct.pack("=II", *_INTEGERS))


class LayoutError(ImportError):
    """The installed `mujoco` has structures that this package does not recognize."""


@dataclass(frozen=True)
class Layouts:
    """Byte offsets of fields, with the size `stride` of their structure."""

    geom: dict[str, int]
    light: dict[str, int]


def _address(structure: Any, field: str) -> int:
    array = getattr(structure, field)
    size = _SIZES.get(field)
    is_valid = isinstance(array, np.ndarray) and array.dtype == np.float32 and array.flags.c_contiguous
    if not is_valid or size is not None and array.size != size:
        raise LayoutError(
            f"the field {field!r} of mujoco {mujoco.__version__} is not an array of {size} single-precision numbers"
        )
    return int(array.__array_interface__["data"][0])


def _memory(address: int, size: int) -> np.ndarray:
    return np.ctypeslib.as_array((ctypes.c_ubyte * size).from_address(address))


def _changed_bytes(structure: Any, field: str, memory: np.ndarray) -> np.ndarray:
    """Indices of the bytes of `memory` that hold the number `field` of a structure."""
    old = getattr(structure, field)
    values: tuple[Any, ...] = _FLOATS if isinstance(old, float) else _INTEGERS
    try:
        setattr(structure, field, values[0])
    except (TypeError, ValueError, OverflowError):  # one byte
        values = (1, 0)
        setattr(structure, field, values[0])
    before = memory.copy()
    setattr(structure, field, values[1])
    changed = np.flatnonzero(before != memory)
    setattr(structure, field, old)
    return changed


def _measure(
    name: str, structures: Any, numbers: tuple[str, ...], arrays: tuple[str, ...], optional: tuple[str, ...]
) -> dict[str, int]:
    """Offsets of the fields of a structure, from the first field."""
    pos = _address(structures[1], "pos")
    stride = _address(structures[2], "pos") - pos
    if not 0 < stride < 1024:
        raise LayoutError(f"{name} of mujoco {mujoco.__version__} has a size of {stride} bytes")
    # A structure begins at most its own size before its position.
    memory = _memory(pos - stride, 2 * stride)
    offsets = {}
    for field in numbers + arrays:
        if not hasattr(structures[1], field):
            if field in optional:
                continue
            raise LayoutError(f"{name} of mujoco {mujoco.__version__} has no field {field!r}")
        if field in arrays:
            offsets[field] = _address(structures[1], field) - pos
            continue
        changed = _changed_bytes(structures[1], field, memory)
        width = len(changed)
        if width not in (1, 4) or changed[-1] - changed[0] != width - 1:
            raise LayoutError(
                f"the field {field!r} of {name} of mujoco {mujoco.__version__} is not a number of 1 or 4 bytes: "
                f"it changes the bytes {changed.tolist()}"
            )
        offsets[field] = int(changed[0]) - stride
    start = min(offsets.values())
    if max(offsets.values()) - start >= stride:
        raise LayoutError(f"the fields of {name} of mujoco {mujoco.__version__} overlap the next structure")
    fields = {field: offset - start for field, offset in offsets.items()}
    return {**fields, "stride": stride}


def _check(name: str, structure: Any, start: int, fields: dict[str, int]) -> None:
    """Writes a structure through its attributes, and compares its memory.

    Raises:
        LayoutError: A field is at another place.
    """
    memory = _memory(start, fields["stride"])
    for index, (field, offset) in enumerate(fields.items()):
        if field == "stride":
            continue
        old = getattr(structure, field)
        if isinstance(old, np.ndarray):
            old = old.copy()
            values = np.arange(old.size, dtype=np.float32) + index + 0.5
            getattr(structure, field)[:] = values.reshape(old.shape)
            found = memory[offset : offset + 4 * old.size].view(np.float32).tolist()
            expected = values.tolist()
            getattr(structure, field)[:] = old
        else:
            is_float = isinstance(old, float)
            expected = [index + 0.5 if is_float else 1]
            setattr(structure, field, expected[0])
            width = 1 if isinstance(old, bool) or field in ("directional", "headlight", "castshadow") else 4
            block = memory[offset : offset + width]
            found = block.view(np.float32 if is_float else np.int32 if width == 4 else np.uint8).tolist()
            setattr(structure, field, old)
        if found != expected:
            raise LayoutError(
                f"the field {field!r} of {name} of mujoco {mujoco.__version__} is not at byte {offset}: it reads "
                f"{found} instead of {expected}"
            )


@functools.lru_cache(maxsize=1)
def layouts() -> Layouts:
    """Layouts of the installed `mujoco`.

    Raises:
        LayoutError: A structure is not recognized.
    """
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    scene = mujoco.MjvScene(model, 8)
    geom = _measure("mjvGeom", scene.geoms, _GEOM_NUMBERS, _GEOM_ARRAYS, _GEOM_OPTIONAL)
    light = _measure("mjvLight", scene.lights, _LIGHT_NUMBERS, _LIGHT_ARRAYS, _LIGHT_OPTIONAL)
    for name, structures, fields in (("mjvGeom", scene.geoms, geom), ("mjvLight", scene.lights, light)):
        _check(name, structures[1], _address(structures[1], "pos") - fields["pos"], fields)
    if "type" not in light and "directional" not in light:
        raise LayoutError(f"mjvLight of mujoco {mujoco.__version__} has neither 'type' nor 'directional'")
    geom.update({name: int(getattr(mujoco.mjtGeom, name)) for name in _TYPES if hasattr(mujoco.mjtGeom, name)})
    return Layouts(geom=geom, light=light)


def scene_memory(scene: Any) -> tuple[np.ndarray, np.ndarray]:
    """Memory of all geoms and of all lights of a scene, uint8, (count, stride).

    The arrays are valid as long as `scene` exists.
    """
    found = layouts()
    blocks = []
    for structures, fields in ((scene.geoms, found.geom), (scene.lights, found.light)):
        count, stride = len(structures), fields["stride"]
        start = _address(structures[0], "pos") - fields["pos"]
        blocks.append(_memory(start, count * stride).reshape(count, stride))
    return blocks[0], blocks[1]
