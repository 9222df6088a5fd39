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
from typing import TYPE_CHECKING, Any

from ._preload import preload

preload()

from . import cfg, errors  # noqa: E402
from ._sim import (  # noqa: E402
    FileRecording,
    FoxgloveServer,
    IkResult,
    ImageWindow,
    KinematicChain,
    MjcfPart,
    Playback,
    Recorder,
    RecordingSummary,
    RenderProgress,
    RigidObject,
    RigidObjectGroup,
    Robot,
    Segmentation,
    Sensor,
    Server,
    SimulationManager,
    Snapshot,
    Task,
    Terrain,
    Topic,
    Viewer,
    Weld,
    Window,
    __version__,
    assemble_urdf,
    inspect,
    json_schema,
    mujoco_version,
    read_calibration,
    read_series,
    recording_topics,
    recover,
    to_toml,
)
from .assets import asset, bundled_robot  # noqa: E402
from .cfg import *  # noqa: E402, F403
from .diagnostics import Diagnostic  # noqa: E402
from .errors import *  # noqa: E402, F403

if TYPE_CHECKING:
    from kinetoscope_render import BatchRenderer, Renderer, patch_mujoco

    from .vector_env import VectorEnv

# Loaded at the first use: the renderer imports mujoco, and environments import gymnasium. Each takes longer than all of this
# package.
_LATER = {
    "BatchRenderer": "kinetoscope_render",
    "Renderer": "kinetoscope_render",
    "VectorEnv": "kinetoscope.vector_env",
    "patch_mujoco": "kinetoscope_render",
}

# Type checkers would accept any misspelt name of a module with this function.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Classes of other packages, and those that need other packages."""
        if name in _LATER:
            return getattr(importlib.import_module(_LATER[name]), name)
        raise AttributeError(f"module 'kinetoscope' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATER})


__all__ = [
    "BatchRenderer",
    "Diagnostic",
    "FileRecording",
    "FoxgloveServer",
    "IkResult",
    "ImageWindow",
    "KinematicChain",
    "MjcfPart",
    "Playback",
    "Recorder",
    "RecordingSummary",
    "RenderProgress",
    "Renderer",
    "RigidObject",
    "RigidObjectGroup",
    "Robot",
    "Segmentation",
    "Sensor",
    "Server",
    "SimulationManager",
    "Snapshot",
    "Task",
    "Terrain",
    "Topic",
    "VectorEnv",
    "Viewer",
    "Weld",
    "Window",
    "__version__",
    "assemble_urdf",
    "asset",
    "bundled_robot",
    "cfg",
    "errors",
    "inspect",
    "json_schema",
    "mujoco_version",
    "patch_mujoco",
    "read_calibration",
    "read_series",
    "recording_topics",
    "recover",
    "to_toml",
    *cfg.__all__,
    *errors.__all__,
]
