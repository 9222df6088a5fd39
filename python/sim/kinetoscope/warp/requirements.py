"""Check of the packages and devices that physics on a device needs."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from typing import Any

from .errors import DeviceError

# Fields of Warp's model and data, and the order of its kernels, change between releases.
VERSIONS = {"mujoco-warp": "4.0.0", "warp-lang": "1.19.0"}
# Without the requirements of the packages themselves: no release of `mujoco` allows the `mujoco-core` of this package.
OTHERS = ("absl-py", "etils", "fsspec", "typing_extensions", "zipp")
COMMAND = " ".join(["pip install --no-deps", *(f"{name}=={version}" for name, version in VERSIONS.items()), *OTHERS])
# The export, and the drive rows, are written for this series of MuJoCo.
MUJOCO = "4.0"
# The package kinetoscope requires `mujoco-core`, which contains it.
MUJOCO_COMMAND = f'pip install "mujoco-core=={MUJOCO}.*"'
CPU = "warp-cpu"


def installed_versions() -> dict[str, str]:
    """Versions of the installed packages. Raises DeviceError if one is missing or has another version."""
    found = {}
    for name, expected in VERSIONS.items():
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            raise missing(f"{name} {expected}, which is not installed") from None
        if found[name] != expected:
            raise missing(f"{name} {expected}, but {found[name]} is installed")
    if importlib.util.find_spec("mujoco") is None:
        raise missing(f"mujoco {MUJOCO}, which is not installed", MUJOCO_COMMAND)
    return found


def missing(package: str, command: str = COMMAND) -> DeviceError:
    """Error of a package that is missing or has another version, with the command that installs it."""
    return DeviceError(f"physics on a device needs {package}; install it with: {command}")


def find_device(name: str) -> tuple[Any, dict[str, str]]:
    """Warp device of `name`, which is "cuda", "cuda:N" or "warp-cpu", and the versions of the packages.

    Raises DeviceError for a missing package, an unknown name, a missing GPU and an old driver.
    """
    kind, _, index = name.partition(":")
    if name != CPU and not (kind == "cuda" and (index.isdecimal() or name == "cuda")):
        raise DeviceError(f'unknown device "{name}"; expected "cuda", "cuda:N" or "{CPU}"')
    versions = installed_versions()
    try:
        import mujoco
        import warp as wp
    except ImportError as error:
        raise missing(f"packages that can be imported ({error})", f"{COMMAND} --force-reinstall") from error
    versions["mujoco"] = mujoco.__version__
    if not mujoco.__version__.startswith(f"{MUJOCO}."):
        raise missing(f"mujoco {MUJOCO}, but {mujoco.__version__} is installed", MUJOCO_COMMAND)
    # Warp prints its devices, and each kernel that it loads.
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    wp.init()
    if name == CPU:
        return wp.get_device("cpu"), versions
    advice = f'"{CPU}" runs the same kernels on the CPU'
    devices = wp.get_cuda_devices()
    found = ", ".join(f"{device.alias} ({device.name})" for device in devices)
    if not devices:
        raise DeviceError(f'device "{name}" needs an NVIDIA GPU and its driver, but Warp found none; {advice}')
    number = int(index) if index else 0
    if number >= len(devices):
        raise DeviceError(f'device "{name}" does not exist; found {found}; {advice}')
    device = devices[number]
    # The solver iterates inside a CUDA graph until all environments converge.
    if not wp.is_conditional_graph_supported():
        reason = "CUDA graphs with conditional nodes need CUDA 12.4; install a newer driver from NVIDIA"
        raise DeviceError(f'the driver of "{name}" ({device.name}) is too old: {reason}')
    if not wp.is_mempool_enabled(device):
        raise DeviceError(f'"{name}" ({device.name}) has no memory pools, which CUDA graphs need; {advice}')
    return device, versions
