"""Ready-made tasks. Importing this module registers them with Gymnasium.

>>> import gymnasium
>>> import kinetoscope.envs
>>> envs = gymnasium.make_vec("Kinetoscope/Balance-v0", num_envs=64)

A task is a folder below ``assets/tasks`` with a scene, ``scene.toml``, and the terms of the task, ``task.toml``.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import gymnasium

from ._sim import SimulationManager, Task
from .assets import asset
from .errors import UnknownNameError
from .vector_env import Env, VectorEnv

TASKS = {
    "Balance-v0": "balance",
    "QuadrupedVelocity-v0": "quadruped_velocity",
    "QuadrupedVelocityRough-v0": "quadruped_velocity_rough",
}
"""Folders of the ready-made tasks, by their name in Gymnasium behind ``Kinetoscope/``."""


def load(
    name: str,
    num_envs: int = 1,
    *,
    autoreset: str | None = None,
    dtype: Literal["float32", "float64"] = "float32",
    simulation: dict[str, Any] | None = None,
) -> Task:
    """The ready-made task ``name``, such as ``"balance"``, in a new simulation.

    ``autoreset`` replaces the mode of the task. ``simulation`` has fields of ``SimulationManagerCfg`` that replace those
    of the scene, such as ``threads`` and ``shard``.
    """
    if name not in TASKS.values():
        near = difflib.get_close_matches(name, TASKS.values(), 1)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        raise UnknownNameError(f"the task {name!r} is unknown{hint} Known: {', '.join(sorted(TASKS.values()))}")
    terms = tomllib.loads(Path(asset(f"tasks/{name}/task.toml")).read_text())
    if autoreset is not None:
        terms["autoreset"] = autoreset
    fields = {**(simulation or {}), "num_envs": num_envs}
    sim = SimulationManager.from_file(asset(f"tasks/{name}/scene.toml"), **fields)
    return Task(sim, terms, dtype=dtype)


def make_vec(
    name: str,
    num_envs: int = 1,
    *,
    render_mode: str | None = None,
    render_size: Sequence[int] = (480, 360),
    **fields: Any,
) -> VectorEnv:
    """The ready-made task ``name`` as a vector environment. ``fields`` are those of :func:`load`."""
    return VectorEnv(load(name, num_envs, **fields), render_mode=render_mode, render_size=render_size)


def make(
    name: str, *, render_mode: str | None = None, render_size: Sequence[int] = (480, 360), **fields: Any
) -> Env:
    """The ready-made task ``name`` as a single environment. ``fields`` are those of :func:`load`."""
    return Env(load(name, **{"autoreset": "disabled", **fields}), render_mode=render_mode, render_size=render_size)


for _name, _folder in TASKS.items():
    gymnasium.register(
        f"Kinetoscope/{_name}",
        entry_point="kinetoscope.envs:make",
        vector_entry_point="kinetoscope.envs:make_vec",
        kwargs={"name": _folder},
    )
