"""Bundled robots and their files."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from . import _sim
from .cfg import RobotCfg

_sim._set_assets(Path(__file__).parent / "assets")


def asset(path: str | os.PathLike[str]) -> str:
    """Path of a bundled asset such as ``"sr5/SR5.urdf"``.

    An existing absolute path is returned unchanged. Other paths are searched below the folder of the environment
    variable ``KINETOSCOPE_ASSETS``, then in the package. A missing asset raises ``FileError``.
    """
    return str(_sim.asset_path(os.fspath(path)))


def bundled_robot(name: str, **fields: Any) -> RobotCfg:
    """Configuration of a bundled robot: ``"quadruped"``, ``"sr5"``, ``"revo1_left"`` or ``"sr5_with_hand"``. Keyword
    arguments replace its fields."""
    scene = tomllib.loads(_sim.bundled_robot(name))
    ((uid, entity),) = scene["entities"].items()
    entity.pop("type")
    return RobotCfg(**{"uid": uid, **entity, **fields})
