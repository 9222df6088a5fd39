"""Benchmark of physics on a device: steps per second beside plain MuJoCo Warp, memory, and calls of one step.

`python -m kinetoscope.warp.benchmark --scene FOLDER --device cuda:0` prints a table. Both sides step in turns, in one process, from
the same start and with the same targets. The plain side steps the exported scene with `mujoco_warp.step` in a CUDA graph: its
drives are actuators of MuJoCo instead of constraint rows.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import ArgumentError, DeviceError
from .model import SCENE_FILE, load_scene
from .physics import WarpPhysics
from .requirements import find_device

NUMBERS_FILE = "scene.json"
START_FILE = "start.json"
# Steps before the measurement: kernels are compiled, arrays grow.
WARM_UP = 32

SCENE_HELP = f"""folder with {SCENE_FILE}, the document that --dump of the examples writes as run.mjcf.xml, and {NUMBERS_FILE}, its
numbers. `write_scene` in python/tests/warp_scenes.py of the repository makes both from the document. {START_FILE} is optional: a
JSON object with the initial qpos and with ctrl, the targets of the actuators"""


@dataclasses.dataclass(frozen=True)
class BenchmarkScene:
    """An exported scene and the start of all environments."""

    folder: Path
    numbers: str
    """JSON of drives and of numbers of the compiled model."""
    qpos: NDArray[Any]
    """Initial positions, shape (nq,)."""
    ctrl: NDArray[Any]
    """Target of each actuator, shape (nu,)."""
    drive_ctrl: NDArray[Any]
    """Actuator of each drive with a constraint row, shape (drives,)."""


@dataclasses.dataclass(frozen=True)
class Result:
    """Measurements of one number of environments. Rates are environment steps per second."""

    envs: int
    ours: list[float]
    """Rate of each turn."""
    plain: list[float]
    """Rate of each turn of plain MuJoCo Warp."""
    single: float
    """Rate in calls of one step."""
    bytes_per_env: int | None
    """Memory of the device for each environment [bytes]; None on the CPU."""
    first: float
    """Time to load the scene and to do the first steps, with the compilation of kernels that are not cached [s]."""
    sizes: tuple[int, int]
    """Constraint rows and contacts for each environment."""
    plain_diverged: int
    """Environments of plain MuJoCo Warp with a number that is not finite."""


def read_scene(folder: Path) -> BenchmarkScene:
    """Reads an exported scene. Raises ArgumentError or DeviceError for a missing or invalid file."""
    path = folder / NUMBERS_FILE
    if not path.is_file():
        raise ArgumentError(f"{folder} has no file {NUMBERS_FILE}; expected a folder with {SCENE_FILE} and {NUMBERS_FILE}")
    numbers = path.read_text()
    scene = load_scene(str(folder), numbers)
    model, path = scene.model, folder / START_FILE
    qpos, ctrl = model.qpos0.copy(), np.zeros(model.nu)
    if path.is_file():
        try:
            start = json.loads(path.read_text())
            qpos, ctrl = (np.array(start[name], float) for name in ("qpos", "ctrl"))
        except (ValueError, KeyError, TypeError) as error:
            raise ArgumentError(f"{path} is invalid ({error!r}); expected an object with numbers in qpos and ctrl") from error
        if qpos.shape != (model.nq,) or ctrl.shape != (model.nu,):
            expected = f"{model.nq} and {model.nu}"
            raise ArgumentError(f"{path} has {qpos.size} numbers in qpos and {ctrl.size} in ctrl; expected {expected}")
    return BenchmarkScene(folder, numbers, qpos, ctrl, scene.ctrl)


def repeated(row: NDArray[Any], envs: int) -> NDArray[Any]:
    """The same row for each environment, shape (envs, numbers)."""
    return np.tile(np.asarray(row, np.float32), (envs, 1))


def load_ours(scene: BenchmarkScene, device: str, envs: int) -> WarpPhysics:
    """Physics of this package at the start of the scene."""
    physics = WarpPhysics(device)
    physics.load(str(scene.folder), scene.numbers, envs)
    physics.write("qpos", None, repeated(scene.qpos, envs))
    physics.write("target_position", None, repeated(scene.ctrl[scene.drive_ctrl], envs))
    physics.step(WARM_UP)
    return physics


def load_plain(scene: BenchmarkScene, device: Any, envs: int, sizes: tuple[int, int]) -> tuple[Any, Any]:
    """Data of plain MuJoCo Warp at the start of the scene, and the graph of a step."""
    import mujoco
    import mujoco_warp as mjw
    import warp as wp

    model = mujoco.MjModel.from_xml_path(str(scene.folder / SCENE_FILE))
    # The options of our side.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    if not model.dof_damping.any():
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    with wp.ScopedDevice(device):
        on_device = mjw.put_model(model)
        on_device.opt.warn_overflow = 0
        data = mjw.make_data(model, nworld=envs, njmax=sizes[0], nconmax=sizes[1])
        # Kernels cannot be loaded while a graph is recorded.
        mjw.step(on_device, data)
        with wp.ScopedCapture() as capture:
            mjw.step(on_device, data)
        data.qpos.assign(repeated(scene.qpos, envs))
        data.qvel.zero_()
        data.qacc_warmstart.zero_()
        data.ctrl.assign(repeated(scene.ctrl, envs))
        step_plain(device, capture.graph, WARM_UP)
    return data, capture.graph


def step_plain(device: Any, graph: Any, steps: int) -> None:
    """Launches the graph of a step, and waits for the device."""
    import warp as wp

    with wp.ScopedDevice(device):
        for _ in range(steps):
            wp.capture_launch(graph)
        wp.synchronize_device()


def rate(envs: int, steps: int, act: Callable[[], object]) -> float:
    """Environment steps per second of a call that does `steps` steps."""
    start = time.perf_counter()
    act()
    return envs * steps / (time.perf_counter() - start)


def used_bytes(device: Any) -> int | None:
    """Memory of the device that arrays take [bytes]; None on the CPU."""
    import warp as wp

    if not device.is_cuda:
        return None
    wp.synchronize_device(device)
    return int(wp.get_mempool_used_mem_current(device))


def measure(scene: BenchmarkScene, name: str, envs: int, steps: int, turns: int) -> Result:
    """Measures `envs` environments: `turns` turns of `steps` steps on each side."""
    device, _ = find_device(name)
    before, start = used_bytes(device), time.perf_counter()
    physics = load_ours(scene, name, envs)
    first, after = time.perf_counter() - start, used_bytes(device)
    memory = None if before is None or after is None else (after - before) // envs
    data, graph = load_plain(scene, device, envs, physics.sizes())
    ours, plain = [], []
    for _ in range(turns):
        ours.append(rate(envs, steps, lambda: physics.step(steps)))
        plain.append(rate(envs, steps, lambda: step_plain(device, graph, steps)))
    single = rate(envs, steps, lambda: [physics.step(1) for _ in range(steps)])
    lost = int((~np.isfinite(data.qpos.numpy()).all(axis=1)).sum())
    result = Result(envs, ours, plain, single, memory, first, physics.sizes(), lost)
    physics.close()
    return result


def rounded(number: float) -> str:
    """A number with three significant digits."""
    digits = max(0, 2 - math.floor(math.log10(abs(number)))) if number else 0
    return f"{number:.{digits}f}" if digits else str(int(float(f"{number:.3g}")))


def table(results: list[Result]) -> str:
    """Table of medians over the turns, in Markdown."""
    lines = [
        "| environments | ours [steps/s] | plain mujoco_warp [steps/s] | ratio | ours, calls of one step [steps/s] "
        "| bytes per environment | first steps [s] | rows, contacts | plain diverged |",
        "|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for result in results:
        ratio = statistics.median(ours / plain for ours, plain in zip(result.ours, result.plain, strict=True))
        memory = "-" if result.bytes_per_env is None else str(result.bytes_per_env)
        cells = [
            str(result.envs), rounded(statistics.median(result.ours)), rounded(statistics.median(result.plain)), f"{ratio:.2f}",
            rounded(result.single), memory, rounded(result.first), "{}, {}".format(*result.sizes), str(result.plain_diverged),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def positive(text: str) -> int:
    """A number from 1 on."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 on")
    return int(text)


def main(arguments: list[str] | None = None) -> int:
    """Runs the benchmark. Returns the exit code: 0, or 1 without a usable device or scene."""
    parser = argparse.ArgumentParser(prog="kinetoscope.warp.benchmark", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--scene", required=True, type=Path, help=SCENE_HELP)
    parser.add_argument("--device", default="cuda:0", help='"cuda", "cuda:N" or "warp-cpu" (default: %(default)s)')
    parser.add_argument("--envs", nargs="+", type=positive, default=[1024, 8192, 32768], help="numbers of environments")
    parser.add_argument("--steps", type=positive, default=192, help="steps of a turn (default: %(default)s)")
    parser.add_argument("--turns", type=positive, default=3, help="turns of each side (default: %(default)s)")
    chosen = parser.parse_args(arguments)
    try:
        device, versions = find_device(chosen.device)
        scene = read_scene(chosen.scene)
        results = [measure(scene, chosen.device, envs, chosen.steps, chosen.turns) for envs in chosen.envs]
    except (ArgumentError, DeviceError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{device.name}, {', '.join(f'{name} {version}' for name, version in versions.items())}\n\n{table(results)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
