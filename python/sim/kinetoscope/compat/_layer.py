"""Common parts of the layers for scripts of other simulators."""

from __future__ import annotations

import difflib
from typing import Any

from ._tensors import device


def _public(names: Any) -> list[str]:
    return [name for name in names if not name.startswith("_")]


class Layer:
    """Base of the classes of the layers. ``native`` is the object of this package behind an object, if there is one."""

    @property
    def device(self) -> Any:
        """The device of all tensors: the CPU."""
        return device()

    def __getattr__(self, name: str) -> Any:
        """Names the nearest attributes of the layer and of the object of this package."""
        if name in dir(type(self)):
            # A property raised AttributeError, which is the error to report.
            return object.__getattribute__(self, name)
        kind = type(self).__name__
        if name.startswith("_"):
            raise AttributeError(f"{kind!r} object has no attribute {name!r}")
        own, message = _public({*dir(type(self)), *vars(self)}), f"{kind}.{name} is not in this layer"
        near = difflib.get_close_matches(name, own, n=3, cutoff=0.5)
        if near:
            message += f"; nearest names: {', '.join(near)}"
        native, near_native = vars(self).get("native", vars(self).get("_native")), []
        if native is not None:
            known = _public(dir(native))
            near_native = [name] if name in known else difflib.get_close_matches(name, known, n=3, cutoff=0.5)
        if near_native:
            message += f"; `native`, the {type(native).__name__} of this package, has {', '.join(near_native)}"
        if not near and not near_native:
            message += f"; known names: {', '.join(sorted(own))}"
        raise AttributeError(message)
