"""Settings and results of rollouts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from .._sim import Snapshot, Task
from ..errors import ArgumentError

Array = NDArray[Any]
Policy = Callable[[Any, Any, Array], Any]
"""``policy(weights, observations, noise)`` for the environments of one call, with standard normal ``noise`` of the shape of
the actions. Returns the actions, or the actions and a dict of arrays for :attr:`Fragment.extras`."""


@dataclass(frozen=True)
class RolloutCfg:
    """Settings of a rollout, the same for all shards."""

    task: str | Callable[[int, dict[str, Any]], Task]
    """Registered name of a task, or a function of the number of environments and of fields of ``SimulationManagerCfg``
    (``seed``, which differs after each checkpoint, ``shard``, ``threads``) that creates it, with the autoreset
    ``"same_step"`` and the dtype ``"float32"``."""

    policy: Policy
    """Computes the actions. It must treat environments separately."""

    num_envs: int
    """Number of environments of all shards together."""

    steps: int
    """Steps of a fragment."""

    seed: int = 0
    """Seed of the simulation, the episodes and the noise."""

    reset_every: int = 100
    """Fragments between two checkpoints. At a checkpoint, all episodes are truncated and new ones begin in a new simulation with
    the same state, because a task inside an episode and the noise of sensors cannot be saved. A lost shard repeats the physics
    since its last checkpoint."""

    rows_per_call: int | None = None
    """Environments in one call of the policy; None for all of a shard. The rounding of matrix products can depend on the
    number of rows. A number that divides the environments of a shard gives the same bits with any number of shards."""

    threads: int = 1
    """Threads of the simulation of a shard."""

    def __post_init__(self) -> None:
        """Refuses numbers that are too small."""
        for name, least in {"num_envs": 1, "steps": 1, "seed": 0, "reset_every": 1, "rows_per_call": 1, "threads": 1}.items():
            value = getattr(self, name)
            if value is not None and value < least:
                raise ArgumentError(f"RolloutCfg: {name} is {value}; expected at least {least}")

    def envs_per_shard(self, world: int) -> int:
        """Environments of one of ``world`` shards. ArgumentError if the numbers do not divide."""
        count, rest = divmod(self.num_envs, world)
        if rest or not count:
            raise ArgumentError(f"RolloutCfg: {self.num_envs} environments cannot be split into {world} equal shards")
        if count % (self.rows_per_call or 1):
            raise ArgumentError(f"RolloutCfg: rows_per_call is {self.rows_per_call}, which does not divide the {count} of a shard")
        return count


@dataclass(frozen=True)
class Fragment:
    """Steps of the environments of a shard: arrays with the steps on the first axis and the environments on the second."""

    observations: Any
    """Observations before each step: an array, or a dict of arrays by group and image."""

    actions: Array
    """Actions, float32."""

    rewards: Array
    """Rewards, float64."""

    terminated: Array
    """True where an episode ended by a termination term."""

    truncated: Array
    """True where an episode ended by its time limit or a checkpoint."""

    extras: dict[str, Array]
    """Further results of the policy."""

    last_observations: Any
    """Observations after the last step, without the axis of the steps."""

    ends: Array
    """Step and environment of each end of an episode, shape (ends, 2)."""

    final_observations: Any
    """Last observations of the episodes in ``ends``, shape (ends, ...)."""


@dataclass(frozen=True)
class Checkpoint:
    """State of a shard between two fragments, where all episodes begin."""

    next_fragment: int
    """Number of the next fragment."""

    snapshot: Snapshot
    """States and properties of the environments."""

    curricula: dict[str, Array]
    """Numbers of the curricula by name."""
