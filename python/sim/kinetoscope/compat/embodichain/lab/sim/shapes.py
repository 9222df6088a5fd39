"""Shapes of EmbodiChain's rigid objects."""

from __future__ import annotations

from typing import Any

from kinetoscope.compat.configclass import configclass


@configclass
class ShapeCfg:
    """Base of shapes."""

    visual_material: Any = None


@configclass
class CubeCfg(ShapeCfg):
    """A box with full side lengths [m]."""

    size: Any = (1.0, 1.0, 1.0)


@configclass
class SphereCfg(ShapeCfg):
    """A sphere [m]."""

    radius: float = 1.0
    resolution: int = 20


@configclass
class MeshCfg(ShapeCfg):
    """A mesh file, which collides as its convex hull, or as at most ``max_convex_hull_num`` convex pieces if that is above 1."""

    fpath: str = ""
    max_convex_hull_num: int = 1
