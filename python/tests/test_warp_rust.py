"""The command ``kinetoscope``, another program, on a device: it starts the worker process of this package."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from test_sim_rust import environment, program

import kinetoscope as ks

pytestmark = pytest.mark.needs_warp


def scene(folder, device):
    """A scene file with an arm whose drives hold a position against gravity."""
    text = ks.to_toml({
        "simulation": ks.SimulationManagerCfg(num_envs=2, device=device),
        "entities": {"arm": ks.bundled_robot("sr5", init_qpos={"JOINT2": 0.6, "JOINT3": -1.0})},
    })
    path = folder / f"{device}.toml"
    path.write_text(text)
    return path


def view(path, *arguments, **variables):
    """Starts a view in browsers, as fast as possible."""
    command = [program(), "view", str(path), "--serve", "127.0.0.1:0", "--speed", "1000", *map(str, arguments)]
    variables = {**environment(), "KINETOSCOPE_PYTHON": sys.executable, **variables}
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=variables)


def test_states_are_those_of_the_cpu(tmp_path):
    states = []
    for device in ("cpu", "warp-cpu"):
        file = tmp_path / f"{device}.npz"
        process = view(scene(tmp_path, device), "--steps", 60, "--record", file)
        output, _ = process.communicate(timeout=300)
        assert process.returncode in (0, 1), output
        with np.load(file) as arrays:
            states.append(arrays["arm/joint_states/positions"])
    cpu, warp = states
    # As in test_warp_simulation.
    assert np.abs(cpu - warp).max() < 1e-5
    assert not np.array_equal(cpu, warp), "the device computes in single precision"
    assert np.ptp(cpu, axis=0).max() > 1e-3, "the drives sag"


def children(pid):
    """Processes that `pid` started."""
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdecimal():
            try:
                with open(f"/proc/{entry}/stat") as file:
                    fields = file.read().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(fields[1]) == pid:
                found.append(int(entry))
    return found


def test_a_killed_worker_is_an_error(tmp_path):
    process = view(scene(tmp_path, "warp-cpu"), "--record", tmp_path / "run.npz")
    try:
        lines = []
        # The first line comes after the worker started.
        for line in process.stdout:
            lines.append(line)
            if "http://" in line:
                break
        workers = children(process.pid)
        assert len(workers) == 1, (workers, lines)
        os.kill(workers[0], signal.SIGKILL)
        start = time.monotonic()
        output, _ = process.communicate(timeout=60)
        assert time.monotonic() - start < 30
    finally:
        process.kill()
    assert process.returncode == 2, "".join(lines) + output
    assert "the physics on the device failed: the worker process ended (signal: 9 (SIGKILL))" in output


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"KINETOSCOPE_PYTHON": "/nonexistent/python"}, "/nonexistent/python does not start"),
        ({"KINETOSCOPE_PYTHON": "false"}, "it needs the Python package kinetoscope"),
    ],
)
def test_missing_python(variables, message, tmp_path):
    process = view(scene(tmp_path, "warp-cpu"), "--steps", 1, **variables)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 2 and message in output, output
