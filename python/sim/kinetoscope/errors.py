"""Exception classes. The messages are those of the Rust library."""

from __future__ import annotations

__all__ = [
    "ArgumentError",
    "ConfigError",
    "DestroyedError",
    "DeviceError",
    "FileError",
    "ForeignHandleError",
    "ForkError",
    "InternalError",
    "KinetoscopeError",
    "MissingPackageError",
    "ModelError",
    "OutOfRangeError",
    "RecordingError",
    "SensorError",
    "SnapshotError",
    "UnknownNameError",
    "ViewerError",
]


class KinetoscopeError(Exception):
    """Base class of all exceptions of this package."""

    def __str__(self) -> str:
        # LookupError and OSError would format their argument.
        return " ".join(str(argument) for argument in self.args)


class ConfigError(KinetoscopeError, ValueError):
    """A field of a configuration or scene file is unknown or invalid."""


class ModelError(KinetoscopeError, ValueError):
    """A URDF, MJCF or mesh file is invalid, or MuJoCo rejects the model."""


class UnknownNameError(KinetoscopeError, LookupError):
    """A name does not exist; the message lists the nearest existing names."""


class OutOfRangeError(KinetoscopeError, IndexError):
    """An index does not exist."""


class ArgumentError(KinetoscopeError, ValueError):
    """An argument has the wrong shape, or contains an invalid value."""


class SensorError(KinetoscopeError, RuntimeError):
    """The configuration of a sensor is invalid, or a sensor failed."""


class SnapshotError(KinetoscopeError, ValueError):
    """A snapshot is damaged, or belongs to another scene or MuJoCo version."""


class FileError(KinetoscopeError, OSError):
    """A file cannot be found, read or written."""


class RecordingError(KinetoscopeError, RuntimeError):
    """A recording cannot be written or read."""


class ViewerError(KinetoscopeError, RuntimeError):
    """A window, browser view or screenshot is not possible."""


class DestroyedError(KinetoscopeError, RuntimeError):
    """The simulation was destroyed, or the task was closed."""


class DeviceError(KinetoscopeError, RuntimeError):
    """The physics of a device is not available, does not support the scene, or failed."""


class ForeignHandleError(KinetoscopeError, ValueError):
    """A handle belongs to another simulation."""


class ForkError(KinetoscopeError, RuntimeError):
    """A simulation that has threads, or was in use during the fork, was used in a forked process."""


class MissingPackageError(KinetoscopeError, ImportError):
    """A package that ``kinetoscope.rl`` needs is missing or too old; the message has the command that installs it."""


class InternalError(KinetoscopeError, RuntimeError):
    """A bug in the library, with the message of the panic."""
