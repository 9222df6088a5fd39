"""What configurations accept: their classes, and fields that may be None."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from . import cfg

_SIMULATION = "simulation"

# Names of methods that add entities, by type; those of sensors are added by ``add_sensor``.
_METHODS = {
    "robot": "add_robot",
    "articulation": "add_articulation",
    "rigid_object": "add_rigid_object",
    "rigid_object_group": "add_rigid_object_group",
    "terrain": "add_terrain",
    "mjcf": "add_mjcf",
    "weld": "add_weld",
    _SIMULATION: "SimulationManager",
}


@cache
def _classes() -> dict[str, type]:
    """Classes of configurations: those of entities by their type in scene files, others by their name."""
    known: dict[str, type] = {}
    for name in cfg.__all__:
        cls = getattr(cfg, name)
        if isinstance(cls, type) and dataclasses.is_dataclass(cls):
            known[_kind_of(cls) or name] = cls
    return known


@cache
def _fields() -> dict[str, dict[str, bool]]:
    """For each type of scene files and each class, the names of its fields, with True where None is a value."""
    return {
        kind: {field.name: "None" in str(field.type).split(" | ") for field in dataclasses.fields(cls)}
        for kind, cls in _classes().items()
    }


@cache
def _optional_arguments() -> set[str]:
    """Names of arguments of the constructors of variants that may be None, such as ``hull`` of ``ObjectShape.mesh``."""
    variants = [getattr(cfg, name) for name in cfg.__all__]
    functions = [
        function.__func__
        for cls in variants
        if isinstance(cls, type) and not dataclasses.is_dataclass(cls)
        for function in vars(cls).values()
        if isinstance(function, staticmethod)
    ]
    types = [item for function in functions for item in function.__annotations__.items()]
    return {name for name, kind in types if "None" in str(kind).split(" | ")}


def is_optional(kind: str, field: str) -> bool:
    """True if the field of a configuration may be None. ``kind`` is a type of scene files, ``"simulation"``, or ``""``
    for a dict inside another, whose type is unknown: then the fields of this name in all classes and variants count. True
    for an unknown field, whose name Rust refuses."""
    classes = _fields()
    if kind in classes:
        return classes[kind].get(field, True)
    named = [fields[field] for fields in classes.values() if field in fields]
    return not named or any(named) or field in _optional_arguments()


def _own_class(value: Any) -> type | None:
    """The class of this package that a configuration has; None for other values."""
    if not hasattr(value, "__dataclass_fields__"):
        return None
    own = _classes().values()
    return next((cls for cls in type(value).__mro__ if cls in own), None)


def _one(cls: type) -> str:
    """Name of a class with its article."""
    return f"{'an' if cls.__name__[0] in 'AEIO' else 'a'} {cls.__name__}"


def _advice(kind: str | None) -> str:
    """The call for a configuration of type ``kind``."""
    if kind is None:
        return ""
    return f"; {_METHODS.get(kind, 'add_sensor')}() takes it"


def _kind_of(cls: type) -> str | None:
    """Type of a class in scene files; None for parts of other configurations."""
    kind: str | None = _SIMULATION if cls is cfg.SimulationManagerCfg else getattr(cls, "_type", None)
    return kind


def mistake(kind: str, given: Any) -> str | None:
    """Error message if ``given`` has another class of this package than the configuration of type ``kind`` (``""`` for any
    class), or contains a configuration of another class than its field. None for the right class, dicts without ``type``,
    and other values."""
    expected = _classes().get(kind)
    if isinstance(given, Mapping):
        named = given.get("type")
        if expected is None or named is None or named == kind or named not in _classes():
            return None
        return f"a configuration of type {named!r} is not {_one(expected)}{_advice(named)}"
    found = _own_class(given)
    if found is None:
        return None
    if kind and (expected is None or not issubclass(found, expected)):
        wanted = f"the configuration of a {kind}" if expected is None else _one(expected)
        return f"{_one(found)} is not {wanted}{_advice(_kind_of(found))}"
    fields = (field.name for field in dataclasses.fields(given))
    return next(filter(None, (_mistake_in(name, getattr(given, name), found) for name in fields)), None)


def mistake_in_field(kind: str, field: str, value: Any) -> str | None:
    """Error message if a keyword argument for the configuration of type ``kind`` has another class than its field."""
    return _mistake_in(field, value, _classes().get(kind))


def _mistake_in(field: str, value: Any, owner: type | None) -> str | None:
    known = getattr(owner, "__dataclass_fields__", {}).get(field)
    for item in value if isinstance(value, list | tuple) else [value]:
        found = _own_class(item)
        # Rust checks fields of any type.
        if found is None or known is None or known.type == "Any":
            continue
        if found.__name__ not in re.findall(r"\w+", str(known.type)):
            return f"{field}: {_one(found)} is not a value of this field ({known.type})"
        inner = mistake(_kind_of(found) or found.__name__, item)
        if inner is not None:
            return f"{field}.{inner}"
    return None


def of_table(kind: str, table: Mapping[str, Any]) -> Any:
    """The configuration of type ``kind`` in a table of Rust, which has all fields except those without a value."""
    cls = _classes()[kind]
    return cls(**{field.name: _value_of(field, table.get(field.name)) for field in dataclasses.fields(cls)})


def _value_of(field: dataclasses.Field[Any], value: Any) -> Any:
    """A value of a table in the form that the class has: parts with a class, sequences as in the default, None."""
    from ._sim import _NONE_IS_FALSE

    if value is False and field.name in _NONE_IS_FALSE:
        return None
    if isinstance(value, Mapping):
        named = re.findall(r"\w+", str(field.type))
        kinds = [kind for kind, cls in _classes().items() if cls.__name__ in named]
        return of_table(kinds[0], value) if len(kinds) == 1 else value
    if isinstance(value, list):
        items = [_value_of(field, item) for item in value]
        return tuple(items) if isinstance(field.default, tuple) else items
    return value


def not_a_sensor(kind: str) -> str | None:
    """Error message if ``add_sensor`` got the configuration of another entity."""
    if kind not in _METHODS:
        return None
    return f"{_one(_classes()[kind])} is not the configuration of a sensor{_advice(kind)}"
