"""The application of Isaac: command-line flags, and a loop condition."""

from __future__ import annotations

import argparse
from typing import Any

from .. import step_limit
from .sim import SimulationContext


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

    def __init__(self, launcher_args: argparse.Namespace | dict[str, Any] | None = None, **kwargs: Any) -> None:
        given = dict(launcher_args) if isinstance(launcher_args, dict) else vars(launcher_args or argparse.Namespace())
        given = {**given, **kwargs}
        AppLauncher.headless = bool(given.get("headless", False)) or int(given.get("livestream", -1)) > 0
        SimulationContext.wants_window = not AppLauncher.headless
        self.app = SimulationApp(AppLauncher.headless)

    @staticmethod
    def add_app_launcher_args(parser: argparse.ArgumentParser) -> None:
        """Adds the flags. Those without a meaning here are accepted and ignored."""
        group = parser.add_argument_group("app_launcher arguments")
        group.add_argument("--headless", action="store_true", default=False, help="run without a window")
        group.add_argument("--livestream", type=int, default=-1, choices=[-1, 0, 1, 2], help="ignored")
        group.add_argument("--offscreen_render", action="store_true", default=False, help="ignored: images need no flag")
        group.add_argument("--enable_cameras", action="store_true", default=False, help="ignored: images need no flag")
        group.add_argument("--device", type=str, default="cpu", help="device of the physics: cpu, cuda, cuda:N or warp-cpu")
        group.add_argument("--cpu", action="store_true", default=False, help="ignored")
        group.add_argument("--verbose", action="store_true", default=False, help="ignored")
        group.add_argument("--info", action="store_true", default=False, help="ignored")
        group.add_argument("--experience", type=str, default="", help="ignored")
        group.add_argument("--rendering_mode", type=str, default=None, help="ignored")
        group.add_argument("--kit_args", type=str, default="", help="ignored")
        group.add_argument("--xr", action="store_true", default=False, help="ignored")
