"""The tutorials of other simulators with other import lines, for tests: ``python seeds.py NAME torch|numpy [flags]``."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

# Import lines of the scripts, and the lines in their place. No other line changes.
REPLACED = [
    (r"\bfrom embodichain\b", "from kinetoscope.compat.embodichain"),
    (r"\bomni\.isaac\.orbit_assets\b", "kinetoscope.compat.isaaclab.orbit_assets"),
    (r"\bomni\.isaac\.orbit\b", "kinetoscope.compat.isaaclab"),
    (r"^import carb$", "from kinetoscope.compat.isaaclab import carb"),
    (r"^import cv2$", "from kinetoscope.compat import cv2"),
]
WITHOUT_TORCH = (r"^import torch$", "from kinetoscope.compat import numpy_torch as torch")


def adapted(source: str, with_torch: bool) -> str:
    """The script with replaced import lines."""
    rules = REPLACED if with_torch else [*REPLACED, WITHOUT_TORCH]

    def replace(line: str) -> str:
        if re.match(r"\s*(import|from)\s", line):
            for pattern, text in rules:
                line = re.sub(pattern, text, line)
        return line

    return "\n".join(replace(line) for line in source.split("\n"))


def folder() -> Path:
    """Folder of the scripts, outside of the project, from ``KINETOSCOPE_SEEDS``."""
    named = os.environ.get("KINETOSCOPE_SEEDS")
    if not named:
        raise RuntimeError("set KINETOSCOPE_SEEDS to the folder of the tutorials of EmbodiChain and Orbit")
    return Path(named)


def main() -> None:
    name, tensors, *flags = sys.argv[1:]
    if tensors == "numpy":
        os.environ["KINETOSCOPE_COMPAT_TORCH"] = "0"
    path = folder() / name
    source = adapted(path.read_text(), tensors == "torch")
    sys.argv = [name, *flags]
    exec(compile(source, str(path), "exec"), {"__name__": "__main__"})  # noqa: S102


if __name__ == "__main__":
    main()
