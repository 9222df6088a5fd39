"""Names, arguments and semantics of other simulators on top of this package.

- ``kinetoscope.compat.embodichain`` for scripts on EmbodiChain's ``SimulationManager``,
- ``kinetoscope.compat.isaaclab`` for scripts on Orbit or Isaac Lab scenes and sensors,
- ``kinetoscope.compat.numpy_torch`` for scripts that use a few functions of torch where torch is not installed,
- ``kinetoscope.compat.cv2`` for scripts that show images where there is no display.

A script needs other import lines and nothing else. Tensors are torch tensors where torch is installed, and NumPy arrays
with the same methods where not.

The environment variable ``KINETOSCOPE_COMPAT_STEPS`` bounds endless loops: after this number of steps,
``SimulationManager.update`` raises ``KeyboardInterrupt`` as Ctrl+C does, and ``SimulationApp.is_running`` returns False.
"""

from __future__ import annotations

import os


def unsupported(owner: str, **fields: bool) -> None:
    """Raises NotImplementedError for the first field that is set, so that no setting is ignored silently."""
    for name, is_set in fields.items():
        if is_set:
            raise NotImplementedError(f"{owner}: this layer does not support {name}")


def step_limit() -> int | None:
    """Value of ``KINETOSCOPE_COMPAT_STEPS``, or None."""
    text = os.environ.get("KINETOSCOPE_COMPAT_STEPS", "")
    return int(text) if text else None
