"""Exception classes of physics on a device."""

from __future__ import annotations

from ..errors import ArgumentError, DeviceError, KinetoscopeError, UnknownNameError

__all__ = ["ArgumentError", "DeviceError", "KinetoscopeError", "UnknownNameError", "UnsupportedSceneError"]


class UnsupportedSceneError(DeviceError):
    """MuJoCo Warp does not support a feature of the scene; the message names it."""
