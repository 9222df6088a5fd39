"""Command-line flags of EmbodiChain's tutorials."""

from __future__ import annotations

import argparse


def add_env_launcher_args_to_parser(parser: argparse.ArgumentParser, *, require_gym_config: bool = False) -> None:
    """Adds the flags. Those without a meaning here are accepted and ignored."""
    parser.add_argument("--num_envs", "--num-envs", type=int, default=1, help="number of environments")
    parser.add_argument("--device", type=str, default="cpu", help="cpu")
    parser.add_argument("--headless", action="store_true", help="run without a window")
    parser.add_argument(
        "--renderer", choices=["auto", "hybrid", "fast-rt", "rt"], default=None if require_gym_config else "auto"
    )
    parser.add_argument("--arena_space", "--arena-space", type=float, default=5.0, help="distance of environments [m]")
    parser.add_argument("--gpu_id", "--gpu-id", type=int, default=0, help="ignored")
    parser.add_argument("--gym_config", type=str, default="", required=require_gym_config)
    parser.add_argument("--action_config", type=str, default=None)
    parser.add_argument("--max_episodes", type=int, default=None)
    for flag in ("--preview", "--filter_visual_rand", "--filter_dataset_saving"):
        parser.add_argument(flag, action="store_true")
