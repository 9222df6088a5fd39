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
class LidarPatternCfg:
    """Rays of a spinning lidar: channels at equal steps of elevation, azimuth fastest. Angles are in degrees."""

    channels: int = 16
    vertical_fov_range: Any = (-15.0, 15.0)
    horizontal_fov_range: Any = (-180.0, 180.0)
    horizontal_res: float = 1.0

    def to_native(self) -> dict[str, Any]:
        return {
            "lidar": {
                "channels": int(self.channels),
                "vertical_fov_deg": [float(x) for x in self.vertical_fov_range],
                "horizontal_fov_deg": [float(x) for x in self.horizontal_fov_range],
                "horizontal_resolution_deg": float(self.horizontal_res),
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
