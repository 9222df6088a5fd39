"""Command-line flags of EmbodiChain's tutorials."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from kinetoscope.compat.embodichain.lab.visualization import add_viser_args_to_parser

# Flags that have no counterpart here, and what replaces them.
REFUSED = {
    "record_trajectory": 'use sim.native.record("run.npz")',
    "trajectory_save_dir": 'use sim.native.record("run.npz")',
    "profile": "use a profiler of Python; benchmarks of this package are in benches/RESULTS.md",
    "profile_output": "use a profiler of Python; benchmarks of this package are in benches/RESULTS.md",
}


class _Refused(argparse.Action):
    """Ends the program with the replacement of the flag."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,  # noqa: ARG002
        values: str | Sequence[Any] | None,  # noqa: ARG002
        option_string: str | None = None,
    ) -> None:
        parser.error(f"this layer does not support {option_string}: {REFUSED[self.dest]}")


def add_env_launcher_args_to_parser(parser: argparse.ArgumentParser, *, require_gym_config: bool = False) -> None:
    """Adds the flags. Those of gym environments are accepted, and scripts read them."""
    parser.add_argument("--num_envs", "--num-envs", type=int, default=1, help="number of environments")
    parser.add_argument("--device", type=str, default="cpu", help="device of the physics: cpu, cuda, cuda:N or warp-cpu")
    parser.add_argument("--headless", action="store_true", help="run without a window")
    parser.add_argument(
        "--renderer", choices=["auto", "hybrid", "fast-rt", "rt"], default=None if require_gym_config else "auto"
    )
    parser.add_argument("--arena_space", "--arena-space", type=float, default=5.0, help="distance of environments [m]")
    parser.add_argument("--gpu_id", "--gpu-id", type=int, default=0, help="no effect: --device cuda:N selects a GPU")
    parser.add_argument("--gym_config", type=str, default="", required=require_gym_config)
    parser.add_argument("--action_config", type=str, default=None)
    parser.add_argument("--max_episodes", type=int, default=None)
    for flag in ("--preview", "--filter_visual_rand", "--filter_dataset_saving"):
        parser.add_argument(flag, action="store_true")
    for name, replacement in REFUSED.items():
        is_flag = name in ("record_trajectory", "profile")
        text = f"refused: {replacement}"
        parser.add_argument(f"--{name}", action=_Refused, nargs=0 if is_flag else None, default=False if is_flag else None, help=text)
    add_viser_args_to_parser(parser)
