"""RLlib, new API stack: each env runner steps a batch of environments of a task.

>>> from ray.rllib.algorithms.ppo import PPOConfig
>>> from kinetoscope.rl.rllib import with_task
>>> config = with_task(PPOConfig(), "Kinetoscope/Balance-v0", num_envs_per_env_runner=64, num_env_runners=8)
>>> config.build_algo().train()
"""

from __future__ import annotations

from typing import Any, TypeVar

import gymnasium

from ..cfg import Shard
from ..errors import ArgumentError
from ..vector_env import VectorEnv
from ._requirements import require, vector_env

require("kinetoscope.rl.rllib", "ray[rllib]", "2.50", "ray.rllib")
require("kinetoscope.rl.rllib", "torch", "2.0", "torch")

from ray.rllib.algorithms.algorithm_config import AlgorithmConfig  # noqa: E402
from ray.rllib.env.env_context import EnvContext  # noqa: E402
from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner  # noqa: E402
from ray.tune.registry import register_env  # noqa: E402

_Config = TypeVar("_Config", bound=AlgorithmConfig)


class ShardEnvRunner(SingleAgentEnvRunner):
    """An env runner whose environments are the shard of its index, so that no two env runners for training
    have the same episodes."""

    def make_env(self) -> None:
        """Creates the environments."""
        # RLlib does not pass the index of the env runner on to makers of vector environments.
        fields = dict(self.config.env_config)
        shard = Shard(rank=self.worker_index, world=(self.num_workers or 0) + 1)
        fields["simulation"] = {**fields.get("simulation", {}), "shard": shard}
        self.config.env_config = EnvContext(fields, self.worker_index, num_workers=self.num_workers)
        super().make_env()


def make_env(fields: dict[str, Any]) -> VectorEnv:
    """The vector environment of a task, with the autoreset that RLlib's env runners assume."""
    fields = dict(fields)
    return vector_env("with_task", fields.pop("task"), fields.pop("num_envs", 1), "next_step", fields)


def with_task(config: _Config, task: str, num_envs_per_env_runner: int, num_env_runners: int = 0, **fields: Any) -> _Config:
    """``config`` for a task by its registered name: environment, env runners and their number of environments.

    ``fields`` are those of :func:`kinetoscope.envs.make_vec`. An env runner has a shard of the environments, by its index; the
    driver has the shard 0. Use ``config.env_runners(num_cpus_per_env_runner=..)`` beside ``simulation={"threads": ..}``.
    """
    if not getattr(config, "enable_env_runner_and_connector_v2", False):
        raise ArgumentError("with_task: the configuration uses RLlib's old API stack; enable the new one with api_stack()")
    for name, value, least in (("num_envs_per_env_runner", num_envs_per_env_runner, 1), ("num_env_runners", num_env_runners, 0)):
        if value < least:
            raise ArgumentError(f"with_task: {name} is {value}; expected at least {least}")
    # Errors of the task surface here, and not in the actors.
    make_env({"task": task, **fields}).close()
    register_env("Kinetoscope", make_env)
    config.environment("Kinetoscope", env_config={"task": task, **fields})
    config.env_runners(
        env_runner_cls=ShardEnvRunner,
        num_env_runners=num_env_runners,
        num_envs_per_env_runner=num_envs_per_env_runner,
        gym_env_vectorize_mode=gymnasium.VectorizeMode.VECTOR_ENTRY_POINT,
    )
    return config
