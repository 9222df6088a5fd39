"""Simulation of EmbodiChain."""

from __future__ import annotations

from .cfg import SimulationManagerCfg
from .manager import SimulationManager

__all__ = ["SimulationManager", "SimulationManagerCfg"]
