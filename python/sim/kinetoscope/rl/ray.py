"""Rollouts on Ray: actors step shards of the environments and return whole fragments.

>>> from kinetoscope.rl.ray import RolloutCfg, ShardedRollout
>>> cfg = RolloutCfg("Kinetoscope/QuadrupedVelocity-v0", policy, num_envs=4096, steps=24, rows_per_call=256)
>>> rollout = ShardedRollout(cfg, shards=16)
>>> fragments = ray.get(rollout.collect(weights))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..cfg import Shard
from ..errors import ArgumentError
from ._requirements import require
from .fragment import Fragment, RolloutCfg
from .rollout import RolloutShard

require("kinetoscope.rl.ray", "ray", "2.10", "ray")

import ray  # noqa: E402

__all__ = ["Fragment", "RolloutCfg", "ShardedRollout"]


class ShardActor:
    """A shard in a process of Ray."""

    def __init__(self, cfg: RolloutCfg, rank: int, world: int) -> None:
        self._place = (cfg, rank, world)
        self._shard: RolloutShard | None = None

    def prepare(self) -> RolloutShard:
        """Creates the shard. Ray would report an error in the constructor as a lost actor."""
        if self._shard is not None:
            self._shard.close()
        self._shard = RolloutShard(*self._place)
        return self._shard

    def check(self) -> None:
        """Raises the errors of the task."""
        self.prepare()

    def fragment(self, weights: Any, number: int, trail: list[Any]) -> tuple[Fragment, Any, bool]:
        """Fragment ``number``, the next part of the trail, and True if the shard was created anew and repeated ``trail``."""
        shard, is_replaced = self._shard, False
        if shard is None or shard.next_fragment != number:
            shard, is_replaced = self.prepare(), True
            shard.replay(ray.get(trail))
        return *shard.fragment(weights), is_replaced


class ShardedRollout:
    """Actors of Ray that step the environments of a task, each a shard of them.

    ``shards`` is the number of actors, or one :class:`kinetoscope.Shard` for each. Fragments stay in Ray's object store until
    they are read, and weights are put there once. The results have the bits of one :class:`RolloutShard` with all
    environments, if ``cfg.rows_per_call`` is set.

    Ray restarts an actor whose process ends, at most ``max_restarts`` times, and the new process repeats the physics since the
    last checkpoint: the fragment has the same bits. ``replacements`` counts shards
    that were created anew, also after an error of the policy. An actor needs ``cfg.threads`` CPUs;
    ``actor_options`` are other options of ``ray.remote``. The constructor waits until Ray has placed all actors, at most
    ``placement_timeout`` seconds, because other work can hold the CPUs.
    """

    def __init__(
        self,
        cfg: RolloutCfg,
        shards: int | Sequence[Shard],
        *,
        max_restarts: int = 3,
        actor_options: Mapping[str, Any] | None = None,
        placement_timeout: float = 600.0,
    ) -> None:
        self.cfg, self.world, self.replacements = cfg, _world(shards), 0
        cfg.envs_per_shard(self.world)
        options = {"num_cpus": cfg.threads, "max_restarts": max_restarts, "max_task_retries": max_restarts, **(actor_options or {})}
        if not ray.is_initialized():
            ray.init()
        needed, found = self.world * options["num_cpus"], ray.cluster_resources().get("CPU", 0)
        if needed > found:
            raise ArgumentError(
                f"ShardedRollout: {self.world} actors with {options['num_cpus']} CPUs each do not fit into the {found:g} CPUs of "
                'the cluster; use fewer shards or threads, or actor_options={"num_cpus": ..}'
            )
        actor = ray.remote(ShardActor).options(**options)
        # A restarted actor reads its arguments again, so the reference must stay.
        self._settings = ray.put(cfg)
        self.actors = [actor.remote(self._settings, rank, self.world) for rank in range(self.world)]
        self._next_fragment = 0
        self._trails: list[list[ray.ObjectRef[Any]]] = [[] for _ in self.actors]
        try:
            ray.get([actor.check.remote() for actor in self.actors], timeout=placement_timeout)
        except ray.exceptions.GetTimeoutError as error:
            free = ray.available_resources().get("CPU", 0)
            self.close()
            raise ArgumentError(
                f"ShardedRollout: in {placement_timeout:g} s, Ray has not placed the {self.world} actors with "
                f"{options['num_cpus']} CPUs each; {free:g} CPUs of the cluster are free"
            ) from error

    def collect(self, weights: Any) -> list[ray.ObjectRef[Fragment]]:
        """Steps all shards with one set of weights, an object or a reference to one. Returns a reference to the
        :class:`Fragment` of each shard, in order, when all are complete. Their arrays are read-only."""
        shared = weights if isinstance(weights, ray.ObjectRef) else ray.put(weights)
        calls = [
            actor.fragment.options(num_returns=3).remote(shared, self._next_fragment, trail)
            for actor, trail in zip(self.actors, self._trails, strict=True)
        ]
        self.replacements += sum(ray.get([is_replaced for _, _, is_replaced in calls]))
        self._next_fragment += 1
        is_checkpoint = self._next_fragment % self.cfg.reset_every == 0
        for trail, (_, part, _) in zip(self._trails, calls, strict=True):
            trail[:] = [part] if is_checkpoint else [*trail, part]
        return [fragment for fragment, _, _ in calls]

    def close(self) -> None:
        """Ends all actors."""
        for actor in self.actors:
            ray.kill(actor)


def _world(shards: int | Sequence[Shard]) -> int:
    """Number of shards. ArgumentError if they are not all shards of one rollout."""
    if isinstance(shards, int):
        if shards < 1:
            raise ArgumentError(f"ShardedRollout: {shards} shards; expected at least 1")
        return shards
    worlds, ranks = {shard.world for shard in shards}, [shard.rank for shard in shards]
    if len(worlds) != 1:
        raise ArgumentError(f"ShardedRollout: the shards have the worlds {sorted(worlds)}; expected one number for all")
    world = worlds.pop()
    twice = sorted({rank for rank in ranks if ranks.count(rank) > 1})
    missing = sorted(set(range(world)) - set(ranks))
    outside = sorted(set(ranks) - set(range(world)))
    for ranks_of_error, problem in ((twice, "overlap"), (missing, "are missing"), (outside, f"are not 0 to {world - 1}")):
        if ranks_of_error:
            raise ArgumentError(f"ShardedRollout: of the {world} shards, the ranks {ranks_of_error} {problem}")
    return world
