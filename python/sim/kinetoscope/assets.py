"""Bundled robots and their files."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from . import _sim
from .cfg import RobotCfg
from .errors import FileError

# In an installed package the files are below this folder; in a source tree, Rust knows their place.
_FOLDER = Path(__file__).parent / "assets"
if _FOLDER.is_dir():
    os.environ.setdefault("KINETOSCOPE_ASSETS", str(_FOLDER))


def asset(path: str | os.PathLike[str]) -> str:
    """Path of a bundled asset such as ``"sr5/SR5.urdf"``.

    An existing absolute path is returned unchanged. Other paths are searched below the folder of the environment
    variable ``KINETOSCOPE_ASSETS``, then in the package. A missing asset raises ``FileError``.
    """
    bundled = _FOLDER / path
    try:
        return str(_sim.asset_path(os.fspath(path)))
    except FileError:
        if bundled.exists():
            return str(bundled)
        raise


def bundled_robot(name: str, **fields: Any) -> RobotCfg:
    """Configuration of a bundled robot: ``"quadruped"``, ``"sr5"``, ``"revo1_left"`` or ``"sr5_with_hand"``."""
    scene = tomllib.loads(_sim.bundled_robot(name))
    ((uid, entity),) = scene["entities"].items()
    entity.pop("type")
    return RobotCfg(**{"uid": uid, **entity, **fields})
