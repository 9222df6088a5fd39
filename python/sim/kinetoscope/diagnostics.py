"""Warnings about files and configurations."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self


class Diagnostic(str):
    """A warning about the input: what was repaired, ignored or unusual. It is the text that Rust prints, with its parts as
    attributes."""

    kind: str
    """Stable name, such as ``"inertia-repaired"``: that of the counts in ``SimulationManager.warnings``."""
    message: str
    """Full sentence that names the element."""
    file: Path | None
    """File of the element; None without a location."""
    line: int | None
    """Line of the element, counted from 1; None without a location."""

    def __new__(cls, text: str, kind: str, message: str, file: Path | None = None, line: int | None = None) -> Self:
        self = super().__new__(cls, text)
        self.kind, self.message, self.file, self.line = kind, message, file, line
        return self

    def __getnewargs__(self) -> tuple[Any, ...]:
        """Arguments for copies and pickles."""
        return str(self), self.kind, self.message, self.file, self.line
