"""Rollouts of one shard of the environments of a task. :mod:`kinetoscope.rl.ray` runs shards in actors of Ray.

Simulation, episodes and noise are keyed by the seed and the global index of an environment, and not by shards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..cfg import Shard
from ..errors import ArgumentError
from ..vector_env import VectorEnv
from ._requirements import vector_env
from .fragment import Array, Checkpoint, Fragment, RolloutCfg


class RolloutShard:
    """The environments ``rank * num_envs / world`` to ``(rank + 1) * num_envs / world - 1`` of a rollout, in this process."""

    def __init__(self, cfg: RolloutCfg, rank: int = 0, world: int = 1) -> None:
        if not 0 <= rank < world:
            raise ArgumentError(f"RolloutShard: rank {rank} of {world}; the rank must be 0 to the number of shards - 1")
        self.cfg, self.next_fragment, self._count = cfg, 0, cfg.envs_per_shard(world)
        self._rank, self._world = rank, world
        self._observations: Any
        self.envs = self._build()
        self._columns = len(self.envs.task.action_space[0])
        self._begin_episodes({})

    def fragment(self, weights: Any) -> tuple[Fragment, Checkpoint | Array]:
        """The next fragment, with actions of the policy for ``weights``, and the next part of the trail for ``replay``."""
        if self.next_fragment < 0:
            raise ArgumentError("RolloutShard: an error interrupted the last fragment; replay the trail in a new shard")
        columns: list[tuple[Any, ...]] = []
        ends: list[tuple[int, int, Any]] = []
        number, noise, self.next_fragment = self.next_fragment, self._noise(), -1
        for step in range(self.cfg.steps):
            actions, extras = self._act(weights, noise[step])
            observations, rewards, terminated, truncated, infos = self.envs.step(actions)
            ends += [(step, int(env), infos["final_obs"][env]) for env in np.flatnonzero(terminated | truncated)]
            columns.append((self._observations, actions, rewards, terminated, truncated, extras))
            self._observations = observations
        part: Checkpoint | Array = np.stack([column[1] for column in columns])
        self.next_fragment = number + 1
        if self.next_fragment % self.cfg.reset_every == 0:
            running = np.flatnonzero(~(terminated | truncated))
            truncated[running] = True
            ends += [(self.cfg.steps - 1, int(env), _map(lambda rows: rows[env], self._observations)) for env in running]
            part = self._checkpoint()
            self._go_on_from(part)
        final = _stack([end[2] for end in ends]) if ends else _map(lambda rows: rows[:0], self._observations)
        names = ("observations", "actions", "rewards", "terminated", "truncated", "extras")
        fields = {name: _stack(column) for name, column in zip(names, zip(*columns, strict=True), strict=True)}
        fields |= {"ends": np.array([end[:2] for end in ends], np.int64).reshape(-1, 2), "final_observations": final}
        return Fragment(**fields, last_observations=self._observations), part

    def replay(self, trail: Sequence[Checkpoint | Array]) -> None:
        """Repeats the physics of an equal shard that was lost. ``trail`` has the parts that its calls of ``fragment`` returned:
        the latest checkpoint, if there is one, and all arrays after it."""
        for part in trail:
            if isinstance(part, Checkpoint):
                self._go_on_from(part)
                continue
            for actions in part:
                self._observations, *_ = self.envs.step(actions)
            self.next_fragment += 1

    def close(self) -> None:
        """Ends the task and its simulation."""
        sim = self.envs.task.sim
        self.envs.close()
        sim.destroy()

    def _build(self) -> VectorEnv:
        """The environments in a new simulation, with random numbers keyed by the number of the next fragment."""
        shard = Shard(rank=self._rank, world=self._world)
        simulation = {"seed": self._seed(), "threads": self.cfg.threads, "shard": shard}
        owner = f"RolloutShard {self._rank} of {self._world}"
        if not callable(self.cfg.task):
            return vector_env(owner, self.cfg.task, self._count, "same_step", {"simulation": simulation})
        envs = vector_env(owner, VectorEnv(self.cfg.task(self._count, simulation)), None, "same_step", {})
        if envs.num_envs != self._count:
            raise ArgumentError(f"{owner}: the task has {envs.num_envs} environments; expected {self._count}")
        return envs

    def _checkpoint(self) -> Checkpoint:
        task = self.envs.task
        curricula = {name: task.curriculum(name) for name in task.curriculum_names}
        return Checkpoint(self.next_fragment, task.sim.snapshot(), curricula)

    def _go_on_from(self, checkpoint: Checkpoint) -> None:
        """Begins new episodes in a new simulation: the noise of sensors depends on the past of a simulation, which a lost shard
        cannot repeat."""
        self.close()
        self.next_fragment = checkpoint.next_fragment
        self.envs = self._build()
        self.envs.task.sim.restore(checkpoint.snapshot, properties=True)
        self._begin_episodes(checkpoint.curricula)

    def _begin_episodes(self, curricula: dict[str, Array]) -> None:
        self._observations, _ = self.envs.reset(seed=self._seed())
        if curricula:
            # A reset with a seed begins curricula anew; events of the next reset read their numbers.
            for name, values in curricula.items():
                self.envs.task.set_curriculum(name, values)
            self._observations, _ = self.envs.reset()

    def _seed(self) -> int:
        """A seed of 63 bits, keyed by the seed of the rollout and the number of the next fragment."""
        return int(np.random.SeedSequence((self.cfg.seed, self.next_fragment)).generate_state(1, np.uint64)[0] >> np.uint64(1))

    def _noise(self) -> Array:
        """Standard normal numbers of the next fragment, float32, shape (steps, environments, action columns)."""
        noise = np.empty((self.cfg.steps, self._count, self._columns), np.float32)
        for env in range(self._count):
            random = np.random.Philox(key=[self.cfg.seed, self._rank * self._count + env], counter=[0, 0, 0, self.next_fragment])
            noise[:, env] = np.random.Generator(random).standard_normal(noise.shape[::2], np.float32)
        return noise

    def _act(self, weights: Any, noise: Array) -> tuple[Array, dict[str, Array]]:
        """Actions and further results of the policy for all environments."""
        rows = self.cfg.rows_per_call or self._count
        results = []
        for first in range(0, self._count, rows):
            call = slice(first, first + rows)
            result = self.cfg.policy(weights, _map(lambda values: values[call], self._observations), noise[call])  # noqa: B023
            actions, extras = result if isinstance(result, tuple) else (result, {})
            if np.shape(actions) != (rows, self._columns):
                raise ArgumentError(f"policy: the actions have the shape {np.shape(actions)}; expected {(rows, self._columns)}")
            results.append((np.asarray(actions, np.float32), extras))
        names = results[0][1]
        extras = {name: np.concatenate([extras[name] for _, extras in results]) for name in names}
        return np.concatenate([actions for actions, _ in results]), extras


def _map(function: Callable[[Array], Array], observations: Any) -> Any:
    """Applies a function to an array, or to all arrays of a dict."""
    if isinstance(observations, dict):
        return {name: function(values) for name, values in observations.items()}
    return function(observations)


def _stack(rows: Sequence[Any]) -> Any:
    """Stacks arrays, or the arrays of dicts by name."""
    if isinstance(rows[0], dict):
        return {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    return np.stack(rows)
