"""Configuration classes."""

from __future__ import annotations

from ..configclass import configclass

__all__ = ["configclass"]
