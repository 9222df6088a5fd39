"""Display of simulations and images in notebooks."""

from __future__ import annotations

import base64
import html
import struct
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._sim import Sensor, Server, SimulationManager

MAX_IMAGES = 4


class Frame:
    """A browser view in a frame of a notebook."""

    def __init__(self, server: Server, width: int, height: int) -> None:
        self.server = server
        self.width = width
        self.height = height

    def _repr_html_(self) -> str:
        url = html.escape(self.server.url, quote=True)
        return f'<iframe src="{url}" width="{self.width}" height="{self.height}" style="border:0"></iframe>'

    def __repr__(self) -> str:
        return f"<Frame {self.server.url}>"


def png(pixels: np.ndarray[Any, Any]) -> bytes:
    """PNG file of an image, u8, shape (height, width, 1, 3 or 4)."""
    height, width, components = pixels.shape
    kind = {1: 0, 3: 2, 4: 6}[components]
    rows = np.ascontiguousarray(pixels, dtype=np.uint8).reshape(height, width * components)
    # Each row begins with its filter, 0 for none.
    content = np.insert(rows, 0, 0, axis=1).tobytes()

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(content)) + chunk(b"IEND", b"")


def to_image(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any] | None:
    """Colors of an image channel in one environment, u8, or None for values that are not an image."""
    if values.dtype == np.uint8 and values.ndim == 3:
        return values
    if values.dtype == np.float32 and values.ndim == 3 and values.shape[2] == 3:
        return np.asarray((np.nan_to_num(values) + 1) * 127.5).clip(0, 255).astype(np.uint8)
    if values.dtype == np.float32 and values.ndim == 2:
        finite = np.isfinite(values)
        low, high = (values[finite].min(), values[finite].max()) if finite.any() else (0.0, 1.0)
        gray = np.where(finite, 255 - 200 * (values - low) / max(float(high - low), 1e-9), 0)
        return np.asarray(gray).astype(np.uint8)[..., None]
    if values.dtype == np.int32 and values.ndim == 2:
        ids = values.astype(np.uint32)
        return np.asarray(np.stack([(ids * step) & 255 for step in (97, 57, 23)], axis=-1), dtype=np.uint8)
    return None


def simulation_html(sim: SimulationManager) -> str:
    """Table of the entities of a simulation, with the text of each. It is as safe as the texts: a destroyed simulation and one
    in use have texts too."""
    rows = [(name, repr(sim[name])) for name in sim.keys()] if not repr(sim).startswith("<SimulationManager of") else []
    cells = "".join(f"<tr><td>{html.escape(name)}</td><td>{html.escape(text)}</td></tr>" for name, text in rows)
    return f"<b>{html.escape(repr(sim))}</b><table>{cells}</table>"


def sensor_html(sensor: Sensor) -> str:
    """Images of the first environments of a camera, or the summary of another sensor."""
    cells = []
    for channel in sensor.channels:
        if "camera" not in sensor.kind:
            break
        for env, values in enumerate(sensor[channel][:MAX_IMAGES]):
            image = to_image(values)
            if image is not None:
                data = base64.b64encode(png(image)).decode()
                name = html.escape(f"{channel}, env {env}")
                cells.append(f'<figure style="display:inline-block"><img src="data:image/png;base64,{data}"/>'
                             f"<figcaption>{name}</figcaption></figure>")
    return "".join(cells) or f"<pre>{html.escape(str(sensor))}</pre>"
