"""TorchRL: a batch of environments of a task.

>>> from torchrl.collectors import Collector
>>> from kinetoscope.rl.torchrl import torchrl_env
>>> envs = torchrl_env("Kinetoscope/Balance-v0", num_envs=64)
>>> envs.rollout(100, break_when_any_done=False).shape
torch.Size([64, 100])
"""

from __future__ import annotations

from typing import Any

from ..vector_env import VectorEnv
from ._requirements import require, vector_env

require("kinetoscope.rl.torchrl", "torchrl", "0.9", "torchrl.envs")

from torchrl.envs import GymWrapper  # noqa: E402


def torchrl_env(env: VectorEnv | str, num_envs: int | None = None, *, device: Any = "cpu", **fields: Any) -> GymWrapper:
    """The environments of a task as an environment of TorchRL with the batch size (num_envs,).

    ``env`` is a :class:`kinetoscope.VectorEnv` whose task has the autoreset ``"disabled"``, the mode that TorchRL prefers,
    and the dtype ``"float32"``, or the registered name of a task. ``num_envs`` and ``fields``, those of
    :func:`kinetoscope.envs.make_vec`, are for a task by name. ``device`` is where tensors are.

    TorchRL resets the environments whose episode ended, so ``("next", "observation")`` is the last observation of an
    episode where ``done`` is True. Groups and images are entries of their own names.
    """
    return GymWrapper(vector_env("torchrl_env", env, num_envs, "disabled", fields), device=device)
