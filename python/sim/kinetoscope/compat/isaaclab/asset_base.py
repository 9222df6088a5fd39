"""Common parts of the assets of Isaac."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._tensors import array
from ..configclass import configclass


@configclass
class AssetBaseCfg:
    """An asset without state: the ground, or a light."""

    prim_path: str = ""
    spawn: Any = None
    init_state: Any = None
    collision_group: int = 0
    debug_vis: bool = False


def ids_of(values: Any, count: int) -> Any:
    """Indices as an array; None for all of ``count``."""
    if isinstance(values, slice):
        return None if values == slice(None) else np.arange(count)[values]
    return None if values is None else array(values)
