"""The browser view of EmbodiChain, which is that of this package here."""

from __future__ import annotations

import argparse
from typing import Any, Literal

from kinetoscope.compat.configclass import configclass


@configclass
class ViserServerCfg:
    """Address of the browser view. Port 0 is a free port."""

    host: str = "127.0.0.1"
    port: int = 8080


@configclass
class VisualizationCfg:
    """A browser view with the backend ``viser``: ``scene_fps`` is its largest number of images per second. Pages show all
    environments or one, as their users choose; sensors and soft bodies have no rates of their own."""

    backend: Literal["none", "viser"] = "none"
    scene_fps: float = 15.0
    sensor_image_fps: float = 2.0
    soft_body_fps: float = 5.0
    env_ids: Any = [0]
    viser_server: ViserServerCfg = ViserServerCfg()


def _env_id(text: str) -> int | str:
    return text if text == "all" else int(text)


def add_viser_args_to_parser(parser: argparse.ArgumentParser) -> None:
    """Adds the flags of the browser view."""
    defaults = VisualizationCfg()
    server = defaults.viser_server
    parser.add_argument("--viser", action="store_true", help="show the simulation in a browser")
    parser.add_argument("--viser-host", default=server.host, help="address of the browser view")
    parser.add_argument("--viser-port", type=int, default=server.port, help="port of the browser view")
    parser.add_argument("--viser-fps", type=float, default=defaults.scene_fps, help="largest number of images per second")
    parser.add_argument("--viser-image-fps", type=float, default=defaults.sensor_image_fps, help="no effect")
    parser.add_argument("--viser-soft-body-fps", type=float, default=defaults.soft_body_fps, help="no effect")
    parser.add_argument("--viser-env-ids", type=_env_id, nargs="+", default=list(defaults.env_ids), help="no effect: pages choose")


def visualization_cfg_from_args(args: argparse.Namespace) -> VisualizationCfg:
    """The configuration of the browser view of parsed flags."""
    env_ids = list(args.viser_env_ids)
    if "all" in env_ids and env_ids != ["all"]:
        raise ValueError(f"--viser-env-ids is {env_ids}; use all, or indices of environments")
    return VisualizationCfg(
        backend="viser" if args.viser else "none",
        scene_fps=args.viser_fps,
        sensor_image_fps=args.viser_image_fps,
        soft_body_fps=args.viser_soft_body_fps,
        env_ids=None if env_ids == ["all"] else env_ids,
        viser_server=ViserServerCfg(host=args.viser_host, port=args.viser_port),
    )
