"""Names of joints and bodies by pattern."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any


def resolve(patterns: Any, names: Sequence[str], preserve_order: bool, what: str) -> tuple[list[int], list[str]]:
    """Indices and names that match a pattern or a list of patterns as a whole, in the order of ``names``, or with
    ``preserve_order`` in that of the patterns. Each pattern must match."""
    found: list[int] = []
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        matched = [at for at, name in enumerate(names) if re.fullmatch(pattern, name)]
        if not matched:
            plural = {"body": "bodies"}.get(what, f"{what}s")
            raise ValueError(f"no {what} matches {pattern!r}; {plural}: {', '.join(names)}")
        found += [at for at in matched if at not in found]
    if not preserve_order:
        found.sort()
    return found, [names[at] for at in found]
