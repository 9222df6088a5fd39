"""Ray patterns of Isaac."""

from __future__ import annotations

from typing import Any

from .. import unsupported
from ..configclass import configclass


@configclass
class GridPatternCfg:
    """Parallel rays on a grid, x fastest with ``xy``."""

    resolution: float = 0.1
    size: Any = (1.0, 1.0)
    direction: Any = (0.0, 0.0, -1.0)
    ordering: str = "xy"

    def to_native(self) -> dict[str, Any]:
        return {
            "grid": {
                "resolution": float(self.resolution),
                "size": [float(x) for x in self.size],
                "direction": [float(x) for x in self.direction],
                "order": self.ordering,
            }
        }


@configclass
class BpearlPatternCfg:
    """Rays of a hemispherical lidar, angles in degrees."""

    horizontal_fov: float = 360.0
    horizontal_res: float = 10.0

    def to_native(self) -> dict[str, Any]:
        unsupported(
            "BpearlPatternCfg", horizontal_fov=self.horizontal_fov != 360.0, horizontal_res=self.horizontal_res != 10.0
        )
        return {"bpearl": {}}
