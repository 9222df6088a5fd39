"""OpenCV for scripts that show images: windows where there is a display, PNG files or nothing where not.

``from kinetoscope.compat import cv2``. All other functions are those of the installed OpenCV; where it is not installed,
only ``cvtColor`` between RGB, BGR and gray is available. Without a display, ``imshow`` writes ``<title>_<count>.png``
into the folder of the environment variable ``KINETOSCOPE_COMPAT_IMAGES``, if it is set.
"""

from __future__ import annotations

import importlib
import os
import re
from pathlib import Path
from typing import Any

import numpy as np

from ..notebook import png

# The module, or None: OpenCV is no requirement of this package, whose types do not depend on it.
_opencv: Any = None
try:
    _opencv = importlib.import_module("cv2")
except ImportError:
    pass

COLOR_BGR2RGB = COLOR_RGB2BGR = 4
COLOR_GRAY2BGR = COLOR_GRAY2RGB = 8

_shown: dict[str, int] = {}


def __getattr__(name: str) -> Any:
    if _opencv is None:
        raise AttributeError(f"cv2.{name} needs OpenCV: pip install opencv-python")
    return getattr(_opencv, name)


def cvtColor(image: Any, code: int) -> Any:  # noqa: N802
    """Converts the colors of an image."""
    if _opencv is not None:
        return _opencv.cvtColor(np.ascontiguousarray(image), code)
    if code == COLOR_GRAY2BGR:
        return np.repeat(np.asarray(image)[..., None], 3, axis=-1)
    if code == COLOR_BGR2RGB:
        return np.asarray(image)[..., ::-1].copy()
    raise ValueError(f"the color conversion {code} needs OpenCV: pip install opencv-python")


def _has_windows() -> bool:
    if not os.environ.get("DISPLAY") or _opencv is None:
        return False
    # The package opencv-python-headless has no windows.
    return "GUI:                           NONE" not in _opencv.getBuildInformation()


def imshow(title: str, image: Any) -> None:
    """Shows an image in a window, or writes it to a file."""
    count = _shown[title] = _shown.get(title, 0) + 1
    if _has_windows():
        _opencv.imshow(title, np.ascontiguousarray(image))
        return
    folder = os.environ.get("KINETOSCOPE_COMPAT_IMAGES")
    if folder:
        name = re.sub(r"\W+", "_", title).strip("_")
        pixels = np.atleast_3d(np.asarray(image, dtype=np.uint8))
        Path(folder, f"{name}_{count}.png").write_bytes(png(pixels[..., ::-1]))


def waitKey(delay: int = 0) -> int:  # noqa: N802
    """Handles the events of windows. Without windows, returns -1 at once."""
    return int(_opencv.waitKey(delay)) if _has_windows() else -1
