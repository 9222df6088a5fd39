"""Loads the MuJoCo library of the installed package, so that the extension module finds it wherever it is."""

from __future__ import annotations

import ctypes
import importlib.util
from pathlib import Path

# The extension module is built for this version of the package mujoco-core.
MUJOCO = "4.0.1"
NAMES = (f"libmujoco.so.{MUJOCO}", f"libmujoco.{MUJOCO}.dylib")


def preload() -> None:
    """Loads the library. Raises ImportError if the package is missing or has another version."""
    advice = f"install it with: pip install mujoco-core=={MUJOCO}"
    # find_spec does not import the package, which would load OpenGL.
    spec = importlib.util.find_spec("mujoco")
    if spec is None or not spec.submodule_search_locations:
        raise ImportError(f"kinetoscope needs MuJoCo {MUJOCO}, which is not installed; {advice}")
    folders = [Path(folder) for folder in spec.submodule_search_locations]
    for folder in folders:
        for name in NAMES:
            if (folder / name).is_file():
                ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)
                return
    found = sorted(path.name for folder in folders for path in folder.glob("libmujoco*"))
    raise ImportError(f"kinetoscope needs MuJoCo {MUJOCO}, but {folders[0]} has {', '.join(found) or 'no library'}; {advice}")
