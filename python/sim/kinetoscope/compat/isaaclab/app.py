"""The application of Isaac: command-line flags, and a loop condition."""

from __future__ import annotations

import argparse
import logging
import warnings
from typing import Any, ClassVar

from .. import step_limit
from .carb import LOG
from .sim import SimulationContext

# Flags that have no counterpart here, and what replaces them.
REFUSED = {
    "cpu": "use --device cpu",
    "ros": 'there is no bridge to ROS; scene.native.record("run.mcap") writes messages of ROS 2',
    "xr": "use a window, or a browser with --livestream 1",
    "anim_recording_enabled": 'there are no USD files; use scene.native.record("run.mcap")',
}
# Flags with texts that only Omniverse Kit reads, and the reason why they have no effect.
WITHOUT_EFFECT = {
    "experience": "there are no experience files",
    "kit_args": "there is no Omniverse Kit",
    "rendering_mode": "cameras are rasterized in each mode",
}


class SimulationApp:
    """Loop condition of a script."""

    def __init__(self, headless: bool) -> None:
        self.headless = headless
        self._count = 0

    def is_running(self) -> bool:
        """False after the number of steps of ``KINETOSCOPE_COMPAT_STEPS``, or when the user closed the window."""
        limit = step_limit()
        context = SimulationContext.instance()
        steps = 0 if context is None else context.step_count
        if limit is not None and steps >= limit:
            return False
        return context is None or context.window is None or bool(context.window.is_open)

    def update(self) -> None:
        """Does nothing: windows draw on their own threads."""

    def close(self) -> None:
        """Frees the simulation."""
        context = SimulationContext.instance()
        if context is not None:
            context.close()


class AppLauncher:
    """Reads the flags and makes the application."""

    # True if later simulations open no window.
    headless = True
    # Flags that the script defined itself, and reads itself.
    _of_script: ClassVar[set[str]] = set()

    def __init__(self, launcher_args: argparse.Namespace | dict[str, Any] | None = None, **kwargs: Any) -> None:
        given = dict(launcher_args) if isinstance(launcher_args, dict) else vars(launcher_args or argparse.Namespace())
        given = {name: value for name, value in given.items() if name not in AppLauncher._of_script or name == "headless"}
        given |= kwargs
        for name, replacement in REFUSED.items():
            # Orbit's --ros is a number, and 0 and -1 are no bridge.
            if int(given.get(name) or 0) > 0:
                raise ValueError(f"AppLauncher: this layer does not support --{name}: {replacement}")
        for name, reason in WITHOUT_EFFECT.items():
            if given.get(name):
                warnings.warn(f"AppLauncher: --{name} has no effect: {reason}", stacklevel=2)
        if given.get("verbose") or given.get("info"):
            logging.basicConfig()
            LOG.setLevel(logging.DEBUG if given.get("verbose") else logging.INFO)
        is_served = int(given.get("livestream", -1)) > 0
        AppLauncher.headless = bool(given.get("headless", False)) or is_served
        SimulationContext.wants_window = not AppLauncher.headless
        SimulationContext.wants_server = is_served
        self.app = SimulationApp(AppLauncher.headless)

    @staticmethod
    def add_app_launcher_args(parser: argparse.ArgumentParser) -> None:
        """Adds the flags of Orbit 0.3 and Isaac Lab 2, except those that the script has defined."""
        group = parser.add_argument_group("app_launcher arguments")
        AppLauncher._of_script = set()

        def add(name: str, **options: Any) -> None:
            if f"--{name}" in parser._option_string_actions:
                AppLauncher._of_script.add(name)
            else:
                group.add_argument(f"--{name}", **options)

        def flag(name: str, text: str) -> None:
            add(name, action="store_true", default=False, help=text)

        flag("headless", "run without a window")
        add("livestream", type=int, default=-1, choices=[-1, 0, 1, 2, 3], help="1, 2 and 3 show the simulation in a browser")
        flag("offscreen_render", "not needed: cameras render without a window")
        flag("enable_cameras", "not needed: cameras render without a flag")
        add("device", type=str, default="cpu", help="device of the physics: cpu, cuda, cuda:N or warp-cpu")
        flag("verbose", "print all messages of carb")
        flag("info", "print the messages of carb but those for debugging")
        for name in WITHOUT_EFFECT:
            choices = ["performance", "balanced", "quality"] if name == "rendering_mode" else None
            default = None if name == "rendering_mode" else ""
            add(name, type=str, default=default, choices=choices, help=f"no effect: {WITHOUT_EFFECT[name]}")
        add("ros", type=int, default=-1, choices=[-1, 0, 1, 2], help=f"refused: {REFUSED['ros']}")
        for name in ("cpu", "xr", "anim_recording_enabled"):
            flag(name, f"refused: {REFUSED[name]}")
        for name, default_time in (("anim_recording_start_time", 0.0), ("anim_recording_stop_time", 10.0)):
            add(name, type=float, default=default_time, help="of --anim_recording_enabled")
