"""Exception classes of physics on a device."""

from __future__ import annotations

from ..errors import ArgumentError, KinetoscopeError, UnknownNameError

__all__ = ["ArgumentError", "DeviceError", "KinetoscopeError", "UnknownNameError", "UnsupportedSceneError"]


class DeviceError(KinetoscopeError, RuntimeError):
    """A device, or a package that it needs, is missing or unsuitable; the message says how to repair that."""


class UnsupportedSceneError(DeviceError):
    """MuJoCo Warp does not support a feature of the scene; the message names it."""
