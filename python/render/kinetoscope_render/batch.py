"""Images of many states at once."""

from __future__ import annotations

from typing import Any, Iterable, Optional, Sequence, Union

import mujoco
import numpy as np

from kinetoscope_render.renderer import output_buffer
from kinetoscope_render.scene import SceneCapture, check_size

_CHANNELS: dict[str, tuple[tuple[int, ...], Any]] = {
    "rgb": ((3,), np.uint8),
    "depth": ((), np.float32),
    "segmentation": ((2,), np.int32),
    "normal": ((3,), np.float32),
}


class BatchRenderer:
    """Renders many states of one model, on several threads. It releases the GIL while it renders."""

    _capture: Optional[SceneCapture] = None

    def __init__(
        self,
        model: mujoco.MjModel,
        height: int = 240,
        width: int = 320,
        max_geom: Optional[int] = 10000,
        *,
        threads: Optional[int] = None,
        samples: Optional[int] = None,
    ) -> None:
        """Creates a renderer; the arguments are those of `Renderer`."""
        self.height, self.width = check_size(height, width)
        self._capture = SceneCapture(model, max_geom, threads, samples)
        self.scene = self._capture.scene

    def render(
        self,
        datas: Iterable[mujoco.MjData],
        camera: Any = -1,
        scene_option: Optional["mujoco.MjvOption"] = None,
        *,
        channels: Union[str, Sequence[str]] = "rgb",
        out: Any = None,
    ) -> Any:
        """Renders one image per state.

        Args:
            datas: N states of the model.
            camera: A camera as in `Renderer.update_scene`, or a list of N cameras.
            scene_option: Options of the visualizer.
            channels: Name of a channel, or a sequence of names: "rgb" uint8 (N, H, W, 3); "depth" float32 (N, H, W)
                [m]; "segmentation" int32 (N, H, W, 2), object id and type; "normal" float32 (N, H, W, 3), unit vectors
                in the world, 0 in the background.
            out: Array for the images of one channel, or a dictionary of arrays by channel.

        Returns:
            An array if `channels` is a name, or else a dictionary of arrays by channel.

        Raises:
            RuntimeError: The renderer is closed, or another thread uses it.
            ValueError: An unknown channel or camera, an array of another shape, a state of another model.
        """
        capture = self._capture
        if capture is None:
            raise RuntimeError("render cannot be called after close.")
        single = isinstance(channels, str)
        names = [channels] if isinstance(channels, str) else list(channels)
        for name in names:
            if name not in _CHANNELS:
                raise ValueError(f"unknown channel {name!r}; the channels are {', '.join(map(repr, _CHANNELS))}")
        if not names:
            raise ValueError("channels is empty")
        outs = {names[0]: out} if single else dict(out or {})
        for name in outs:
            if name not in names:
                raise ValueError(f"`out` has an array of {name!r}, which is not one of the channels {names}")
        states = list(datas)
        cameras = list(camera) if isinstance(camera, (list, tuple)) else [camera] * len(states)
        if len(cameras) != len(states):
            raise ValueError(f"{len(cameras)} cameras are given for {len(states)} states")
        count, size = len(states), (self.height, self.width)
        buffers = {}
        for name in names:
            components, dtype = _CHANNELS[name]
            buffers[name] = output_buffer(outs.get(name), (count, *size, *components), dtype, f"out[{name!r}]")
        with capture.exclusive():
            capture.frames.clear()
            for data, which in zip(states, cameras):
                capture.update(data, which, scene_option)
                capture.capture(self.height, self.width)
            if states:
                capture.render(self.height, self.width, buffers)
        for name, buffer in buffers.items():
            given = outs.get(name)
            if given is not None and given is not buffer:
                np.copyto(given, buffer, casting="unsafe")
                buffers[name] = given
        return buffers[names[0]] if single else buffers

    def close(self) -> None:
        """Frees the memory of the renderer. A second call does nothing; `render` raises `RuntimeError`."""
        self._capture = None

    def __enter__(self) -> "BatchRenderer":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
