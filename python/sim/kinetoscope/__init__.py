"""Robots, objects and sensors in parallel environments on MuJoCo, on any CPU.

>>> import kinetoscope as ks
>>> sim = ks.SimulationManager(num_envs=4)
>>> arm = sim.add_robot(ks.RobotCfg(urdf=ks.asset("sr5/SR5.urdf"), control_parts={"arm": ["JOINT[1-6]"]}))
>>> sim.update(100)
>>> arm.qpos.shape
(4, 6)
"""

from __future__ import annotations

import importlib
from typing import Any

from ._preload import preload

preload()

from . import cfg, errors  # noqa: E402
from ._sim import (  # noqa: E402
    IkResult,
    MjcfPart,
    Playback,
    Recorder,
    RecordingSummary,
    RigidObject,
    RigidObjectGroup,
    Robot,
    Sensor,
    Server,
    SimulationManager,
    Snapshot,
    Terrain,
    Topic,
    Weld,
    Window,
    __version__,
    mujoco_version,
    read_series,
    recording_topics,
    to_toml,
)
from .assets import asset, bundled_robot  # noqa: E402
from .cfg import *  # noqa: E402, F403
from .errors import *  # noqa: E402, F403


def __getattr__(name: str) -> Any:
    """The renderer of the package kinetoscope-render, where it is installed."""
    if name in ("Renderer", "BatchRenderer", "patch_mujoco"):
        try:
            render = importlib.import_module("kinetoscope_render")
        except ImportError as error:
            raise AttributeError(f"kinetoscope.{name} needs the package kinetoscope-render: {error}") from None
        return getattr(render, name)
    raise AttributeError(f"module 'kinetoscope' has no attribute {name!r}")


__all__ = [
    "IkResult",
    "MjcfPart",
    "Playback",
    "Recorder",
    "RecordingSummary",
    "RigidObject",
    "RigidObjectGroup",
    "Robot",
    "Sensor",
    "Server",
    "SimulationManager",
    "Snapshot",
    "Terrain",
    "Topic",
    "Weld",
    "Window",
    "__version__",
    "asset",
    "bundled_robot",
    "cfg",
    "errors",
    "mujoco_version",
    "read_series",
    "recording_topics",
    "to_toml",
    *cfg.__all__,
    *errors.__all__,
]
