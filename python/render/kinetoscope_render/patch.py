"""Replacement of the renderers of `mujoco`, Gymnasium, dm_control and robosuite."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.util
import sys
import types
from typing import Any, Callable, Optional

import mujoco

from kinetoscope_render import software_context
from kinetoscope_render.renderer import Renderer

_FUNCTIONS = (
    "MjrContext", "mjr_render", "mjr_readPixels", "mjr_setBuffer", "mjr_resizeOffscreen", "mjr_uploadTexture",
    "mjr_uploadMesh", "mjr_uploadHField", "mjr_overlay",
)
_GL_MODULES = ("mujoco.osmesa", "mujoco.egl", "mujoco.glfw")
_MISSING = object()
# What unpatch_mujoco undoes: owner, name, old value. Owners are modules, or sys.modules itself.
_undo: list[tuple[Any, str, Any]] = []


def _set(owner: Any, name: str, value: Any) -> None:
    if isinstance(owner, dict):
        _undo.append((owner, name, owner.get(name, _MISSING)))
        owner[name] = value
    else:
        _undo.append((owner, name, getattr(owner, name, _MISSING)))
        setattr(owner, name, value)


def _gl_module(name: str, **attributes: Any) -> None:
    """Puts a module without OpenGL into the place of one that imports OpenGL."""
    module = types.ModuleType(name)
    for key, value in attributes.items():
        setattr(module, key, value)
    _set(sys.modules, name, module)
    parent, _, child = name.rpartition(".")
    if parent in sys.modules:
        _set(sys.modules[parent], child, module)


def _exists(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


def _patch_library() -> None:
    for name in _FUNCTIONS:
        if hasattr(mujoco, name):
            _set(mujoco, name, getattr(software_context, name))
    _set(mujoco, "GLContext", software_context.GLContext)
    _set(mujoco, "Renderer", Renderer)
    for name in ("mujoco.renderer", "mujoco.rendering.classic.renderer"):
        if name in sys.modules:
            _set(sys.modules[name], "Renderer", Renderer)
    for name in _GL_MODULES:
        _gl_module(name, GLContext=software_context.GLContext)


class _AfterImport(importlib.abc.MetaPathFinder):
    """Calls `action` with a module when a program imports it: patch_mujoco imports no library."""

    def __init__(self, name: str, action: Callable[[Any], None]) -> None:
        self._name, self._action, self._is_searching = name, action, False

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        """Specification of the module whose loader also calls the action; None for other modules."""
        del path, target
        if fullname != self._name or self._is_searching:
            return None
        self._is_searching = True
        try:
            spec = importlib.util.find_spec(fullname)
        finally:
            self._is_searching = False
        loader: Optional[Any] = spec.loader if spec is not None else None
        if loader is None:
            return spec
        execute = loader.exec_module

        def execute_and_act(module: Any) -> None:
            execute(module)
            # unpatch_mujoco may have run since.
            if self in sys.meta_path:
                self._action(module)

        loader.exec_module = execute_and_act
        return spec


def _patch_dm_control() -> None:
    name = "dm_control._render"
    if name in sys.modules:
        _patch_dm_control_render(sys.modules[name])
    else:
        sys.meta_path.insert(0, _AfterImport(name, _patch_dm_control_render))


def _patch_dm_control_render(render: Any) -> None:
    # Its contexts are those of OpenGL libraries, whose import may fail; a fake one needs only this interface.
    base = importlib.import_module("dm_control._render.base")
    executor = importlib.import_module("dm_control._render.executor")

    class SoftwareContext(base.ContextBase):  # type: ignore[name-defined, misc]
        """A context of dm_control without OpenGL."""

        def __init__(self, max_width: int, max_height: int) -> None:
            super().__init__(max_width, max_height, executor.PassthroughRenderExecutor)

        def _platform_init(self, max_width: int, max_height: int) -> None:
            del max_width, max_height

        def _platform_make_current(self) -> None:
            pass

        def _platform_free(self) -> None:
            pass

    _set(render, "Renderer", SoftwareContext)


class _RobosuiteContext(software_context.GLContext):
    """A context of robosuite without OpenGL."""

    def __init__(self, max_width: int = 0, max_height: int = 0, device_id: int = 0) -> None:
        super().__init__()
        del max_width, max_height, device_id


def _patch_robosuite() -> None:
    # binding_utils imports one of these, by platform and MUJOCO_GL.
    for kind, name in (("osmesa", "OSMesaGLContext"), ("egl", "EGLGLContext"), ("glfw", "GLFWGLContext")):
        _gl_module(f"robosuite.renderers.context.{kind}_context", **{name: _RobosuiteContext})
    utils = sys.modules.get("robosuite.utils.binding_utils")
    if utils is not None:
        _set(utils, "GLContext", _RobosuiteContext)


def patched() -> list[str]:
    """Names of the attributes that are replaced now."""
    return [f"{getattr(owner, '__name__', 'sys.modules')}.{name}" for owner, name, _ in _undo]


def patch_mujoco() -> list[str]:
    """Replaces the renderers of `mujoco`, Gymnasium, dm_control and robosuite in this process.

    The rendering functions of `mujoco` (`mujoco.Renderer`, `mujoco.MjrContext`, `mujoco.mjr_render`,
    `mujoco.mjr_readPixels`, ...) and its OpenGL contexts are replaced. Gymnasium calls these; so do dm_control and
    robosuite, whose own OpenGL contexts are replaced too. Objects that exist already keep their renderer, and so do
    names imported earlier by `from mujoco import Renderer`. A second call changes nothing. Windows (`mujoco.viewer`,
    `render_mode="human"`) are not replaced: they draw with OpenGL.

    No library is imported for this: dm_control's context is replaced when the program imports it. If a replacement
    fails, all are undone, and the error is raised.

    Returns:
        The names of the attributes that are replaced now.
    """
    if not _undo:
        try:
            _patch_library()
            if _exists("dm_control"):
                _patch_dm_control()
            if _exists("robosuite"):
                _patch_robosuite()
        except BaseException:
            unpatch_mujoco()
            raise
    return patched()


def unpatch_mujoco() -> None:
    """Undoes `patch_mujoco`.

    Renderers of this package keep working. Environments that were created in between cannot render any more: MuJoCo's
    own functions raise `TypeError` for their contexts.
    """
    sys.meta_path[:] = [finder for finder in sys.meta_path if not isinstance(finder, _AfterImport)]
    while _undo:
        owner, name, old = _undo.pop()
        if isinstance(owner, dict):
            if old is _MISSING:
                owner.pop(name, None)
            else:
                owner[name] = old
        elif old is _MISSING:
            delattr(owner, name)
        else:
            setattr(owner, name, old)
