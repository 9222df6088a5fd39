"""Images of MuJoCo models without a GPU and without OpenGL.

`Renderer` has the interface of `mujoco.Renderer`. `BatchRenderer` renders many states at once. `patch_mujoco` puts them
in the place of the renderers of `mujoco`, Gymnasium, dm_control and robosuite. `python -m kinetoscope_render doctor`
checks an installation.

    import kinetoscope_render as kr

    with kr.Renderer(model, 480, 640) as renderer:
        renderer.update_scene(data, camera="side")
        rgb = renderer.render()                       # uint8, (480, 640, 3)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from kinetoscope_render._render import __version__

if TYPE_CHECKING:
    from kinetoscope_render.batch import BatchRenderer
    from kinetoscope_render.patch import patch_mujoco, unpatch_mujoco
    from kinetoscope_render.renderer import Renderer

__all__ = ["BatchRenderer", "Renderer", "__version__", "patch_mujoco", "unpatch_mujoco"]

# Modules of the public names. They import mujoco, so that `doctor` can report its absence.
_MODULES = {"BatchRenderer": "batch", "Renderer": "renderer", "patch_mujoco": "patch", "unpatch_mujoco": "patch"}

# Type checkers would accept any misspelt name of a module with this function.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
