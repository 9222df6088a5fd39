"""Configuration classes in the style of Orbit and Isaac Lab."""

from __future__ import annotations

import copy
import dataclasses
import inspect
from typing import Any, TypeVar, dataclass_transform

T = TypeVar("T")
MISSING = dataclasses.MISSING


def _is_value(name: str, value: Any) -> bool:
    if name.startswith("__") or inspect.isclass(value) or inspect.isfunction(value):
        return False
    return not isinstance(value, property | classmethod | staticmethod)


def fields_of(cls: type) -> dict[str, Any]:
    """Fields with their defaults, those of base classes first, in the order of declaration."""
    fields: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        own = vars(base)
        for name, annotation in own.get("__annotations__", {}).items():
            if "ClassVar" not in str(annotation) and name not in own:
                fields.setdefault(name, MISSING)
        for name, value in own.items():
            if _is_value(name, value) and not name.startswith("_"):
                fields[name] = value
    return fields


@dataclass_transform(kw_only_default=True)
def configclass(cls: type[T]) -> type[T]:
    """Turns a class into a configuration: class attributes, annotated or not, are fields that each object gets a copy
    of. Objects have ``copy``, ``replace`` and ``to_dict``."""

    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        fields = fields_of(type(self))
        if len(args) > len(fields):
            raise TypeError(f"{type(self).__name__} takes at most {len(fields)} values")
        given = dict(zip(fields, args, strict=False)) | kwargs
        unknown = [name for name in given if name not in fields]
        if unknown:
            raise TypeError(f"{type(self).__name__} has no field {unknown[0]!r}; fields: {', '.join(fields)}")
        for name, default in fields.items():
            value = given.get(name, default)
            if value is MISSING:
                raise TypeError(f"{type(self).__name__} needs a value for the field {name!r}")
            setattr(self, name, value if name in given else copy.deepcopy(value))
        post = getattr(self, "__post_init__", None)
        if post is not None:
            post()

    def replace(self: Any, **changes: Any) -> Any:
        made = copy.deepcopy(self)
        unknown = [name for name in changes if name not in fields_of(type(self))]
        if unknown:
            raise TypeError(f"{type(self).__name__} has no field {unknown[0]!r}")
        for name, value in changes.items():
            setattr(made, name, value)
        return made

    def to_dict(self: Any) -> dict[str, Any]:
        values = {name: getattr(self, name) for name in fields_of(type(self))}
        return {name: value.to_dict() if hasattr(value, "to_dict") else value for name, value in values.items()}

    def __repr__(self: Any) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={getattr(self, k)!r}' for k in fields_of(type(self)))})"

    def __eq__(self: Any, other: Any) -> bool:
        return type(self) is type(other) and bool(vars(self) == vars(other))

    def __setattr__(self: Any, name: str, value: Any) -> None:
        # Classes of scripts may have attributes of their own.
        closed = type(self).__module__.startswith(__package__) and not getattr(self, "_accepts_new", False)
        if closed and not name.startswith("_") and name not in fields_of(type(self)):
            known = ", ".join(fields_of(type(self)))
            raise AttributeError(f"{type(self).__name__} has no field {name!r}; fields: {known}")
        object.__setattr__(self, name, value)

    for function in (__init__, replace, to_dict, __repr__, __eq__, __setattr__):
        setattr(cls, function.__name__, function)
    cls.copy = copy.deepcopy  # type: ignore[attr-defined]
    cls.__hash__ = None  # type: ignore[assignment]
    return cls
