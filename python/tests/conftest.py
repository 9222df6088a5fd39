"""Simulations shared by the tests of the package kinetoscope."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess

import numpy as np
import pytest

# Ray sends no reports of its use from tests, and its processes have the priority of the tests.
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
os.environ["RAY_worker_niceness"] = "0"

# A shell starts background programs with Ctrl+C ignored, and so would the programs that tests start and interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config):
    config.addinivalue_line("markers", "needs_seeds: needs the tutorials of EmbodiChain and Orbit in KINETOSCOPE_SEEDS")
    config.addinivalue_line("markers", "needs_robots: needs the vendors' robots in KINETOSCOPE_ROBOTS")
    config.addinivalue_line("markers", "needs_warp: needs mujoco-warp and warp-lang")
    config.addinivalue_line("markers", "needs_learning: needs torch and the libraries of kinetoscope.rl")


@pytest.fixture
def arm_sim():
    """Two environments with the bundled arm."""
    import kinetoscope as ks

    sim = ks.SimulationManager(num_envs=2, threads=2)
    arm = sim.add_robot(ks.bundled_robot("sr5", uid="arm"))
    yield sim, arm
    sim.destroy()


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture
def display():
    """A virtual display."""
    with virtual_display() as name:
        yield name


@contextlib.contextmanager
def virtual_display(*options):
    """A virtual display, by its name."""
    if shutil.which("Xvfb") is None:
        pytest.fail("this test needs Xvfb")
    process = subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "1280x800x24", *options], stdout=subprocess.PIPE, text=True)
    try:
        yield f":{process.stdout.readline().strip()}"
    finally:
        process.terminate()
        process.wait()
