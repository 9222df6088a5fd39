"""Physics of all environments on a GPU, computed by MuJoCo Warp in single precision.

The packages `mujoco-warp` and `warp-lang` are imported when a `WarpPhysics` is created, not before. The modules need
nothing else of kinetoscope than its exception classes, so a worker process runs without the extension module.
"""

from __future__ import annotations

from .errors import DeviceError, UnsupportedSceneError
from .physics import WarpPhysics

__all__ = ["DeviceError", "UnsupportedSceneError", "WarpPhysics"]
