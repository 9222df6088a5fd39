"""Checks of installed libraries and of the environments that an adapter gets."""

from __future__ import annotations

import difflib
import importlib
import re
from importlib import metadata
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError, MissingPackageError, UnknownNameError

if TYPE_CHECKING:
    from ..vector_env import VectorEnv


def require(owner: str, package: str, oldest: str, module: str) -> None:
    """Imports ``module`` of ``package``. MissingPackageError if it cannot be imported, or is older than ``oldest``."""
    command = f"pip install '{package}>={oldest}'"
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise MissingPackageError(f"{owner} needs the package {package}, version {oldest} or later: {command} ({error})") from error
    try:
        found = metadata.version(package.partition("[")[0])
    except metadata.PackageNotFoundError:
        # A module without an installed package has no version to compare.
        return
    if _numbers(found) < _numbers(oldest):
        raise MissingPackageError(f"{owner} needs {package} {oldest} or later, and {found} is installed: {command}")


def _numbers(version: str) -> list[int]:
    """The numbers of a version, to compare."""
    release = re.match(r"[\d.]*", version)
    return [int(number) for number in release[0].split(".") if number] if release else []


def vector_env(owner: str, env: VectorEnv | str, num_envs: int | None, autoreset: str, fields: dict[str, Any]) -> VectorEnv:
    """The vector environment ``env``, or that of a task by its registered name, with observations in single precision and
    the mode of automatic resets ``autoreset``."""
    from ..vector_env import VectorEnv

    made = env if isinstance(env, VectorEnv) else _registered(owner, env, num_envs, autoreset, fields)
    if made is env and (fields or num_envs is not None):
        given = sorted({*fields, *([] if num_envs is None else ["num_envs"])})
        raise ArgumentError(f"{owner}: {given} are for tasks by name; the VectorEnv already has {made.num_envs} environments")
    if made.task.autoreset != autoreset:
        raise ArgumentError(
            f"{owner}: the autoreset of the task is {made.task.autoreset!r}; expected {autoreset!r}. "
            f'Create the task with "autoreset": {autoreset!r}'
        )
    if made.task.dtype != "float32":
        raise ArgumentError(
            f"{owner}: the observations of the task are {made.task.dtype}; expected float32. "
            'Create it with Task(..., dtype="float32")'
        )
    return made


def _registered(owner: str, name: object, num_envs: int | None, autoreset: str, fields: dict[str, Any]) -> VectorEnv:
    from .. import envs

    known = {f"Kinetoscope/{task}": folder for task, folder in envs.TASKS.items()}
    if not isinstance(name, str):
        raise ArgumentError(f"{owner}: {name!r} is neither a VectorEnv nor the name of a task; known: {sorted(known)}")
    if name not in known:
        near = difflib.get_close_matches(name, known, 1, cutoff=0.4)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        raise UnknownNameError(f"{owner}: the task {name!r} is unknown{hint} Known: {', '.join(sorted(known))}, or a VectorEnv")
    if "autoreset" in fields:
        raise ArgumentError(f"{owner}: autoreset is {autoreset!r} for this library; leave it out")
    count = 1 if num_envs is None else num_envs
    return envs.make_vec(known[name], count, **{"autoreset": autoreset, "dtype": "float32", **fields})
