"""Fields of configurations that may be None."""

from __future__ import annotations

import dataclasses
from functools import cache

from . import cfg


@cache
def _fields() -> dict[str, dict[str, bool]]:
    """For each type of scene files and each class, the names of its fields, with True where None is a value."""
    known = {}
    for name in cfg.__all__:
        cls = getattr(cfg, name)
        if dataclasses.is_dataclass(cls):
            kind = "simulation" if cls is cfg.SimulationManagerCfg else getattr(cls, "_type", f"class {name}")
            known[kind] = {field.name: "None" in str(field.type).split(" | ") for field in dataclasses.fields(cls)}
    return known


def is_optional(kind: str, field: str) -> bool:
    """True if the field of a configuration may be None. ``kind`` is a type of scene files, ``"simulation"``, or ``""``
    for a dict inside another, whose type is unknown: then the fields of this name in all classes count. True for an
    unknown field, whose name Rust refuses."""
    classes = _fields()
    if kind in classes:
        return classes[kind].get(field, True)
    named = [fields[field] for fields in classes.values() if field in fields]
    return not named or any(named)
