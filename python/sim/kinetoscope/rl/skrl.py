"""skrl: a wrapped environment of a task, with the observation group ``critic`` as the state of asymmetric agents.

>>> from skrl.trainers.torch import SequentialTrainer
>>> from kinetoscope.rl.skrl import SkrlEnv
>>> envs = SkrlEnv("Kinetoscope/QuadrupedVelocity-v0", num_envs=512)
>>> SequentialTrainer(env=envs, agents=agent, cfg={"timesteps": 10_000}).train()
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from ..errors import ArgumentError
from ..vector_env import VectorEnv
from ._requirements import require, vector_env

require("kinetoscope.rl.skrl", "skrl", "2.0", "skrl")
require("kinetoscope.rl.skrl", "torch", "2.0", "torch")

import torch  # noqa: E402
from skrl.envs.wrappers.torch import Wrapper  # noqa: E402
from skrl.utils.spaces.torch import flatten_tensorized_space, tensorize_space  # noqa: E402

_Result = tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, dict[str, Any]]


class SkrlEnv(Wrapper):
    """The environments of a task, wrapped for skrl.

    ``env`` is a :class:`kinetoscope.VectorEnv` whose task has the autoreset ``"same_step"`` and the dtype ``"float32"``, or
    the registered name of a task. ``num_envs`` and ``fields``, those of :func:`kinetoscope.envs.make_vec`, are for a task by
    name. ``device`` is where tensors are; skrl's own default if it is None.

    The group ``critic`` and its images are the state, all other groups the observations; skrl flattens both. The first
    ``reset`` begins the episodes, with ``seed``; later ones return the latest observations, because episodes begin
    automatically. ``infos["episode"]`` has the means of the reward terms, which skrl logs.
    """

    def __init__(
        self,
        env: VectorEnv | str,
        num_envs: int | None = None,
        *,
        device: torch.device | str | None = None,
        seed: int | None = None,
        **fields: Any,
    ) -> None:
        self.envs = vector_env("SkrlEnv", env, num_envs, "same_step", fields)
        super().__init__(self.envs)
        if device is not None:
            self._device = torch.device(device)
        self._seed = seed
        self._latest: tuple[torch.Tensor, torch.Tensor | None] | None = None
        space, self._state_space = self.envs.single_observation_space, None
        if isinstance(space, gymnasium.spaces.Dict):
            of_critic = {name: part for name, part in space.items() if name.partition("/")[0] == "critic"}
            others = {name: part for name, part in space.items() if name not in of_critic}
            if not others:
                raise ArgumentError(f"SkrlEnv: the task has the observations {sorted(of_critic)} only; expected others too")
            space = _space(others)
            self._state_space = _space(of_critic) if of_critic else None
        self._observation_space = space

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        """Space of the observations of one environment."""
        return self._observation_space

    @property
    def state_space(self) -> gymnasium.Space[Any] | None:
        """Space of the state of one environment; None without the group ``critic``."""
        return self._state_space

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        """Space of the actions of one environment."""
        return self.envs.single_action_space

    def reset(self) -> tuple[torch.Tensor, dict[str, Any]]:
        """First or latest observations, shape (num_envs, numbers)."""
        if self._latest is None:
            observations, _ = self.envs.reset(seed=self._seed)
            self._latest = self._tensors(observations)
        return self._latest[0], {}

    def step(self, actions: torch.Tensor) -> _Result:
        """Observations, rewards, terminated, truncated, shape (num_envs, 1) each, and infos of one step."""
        observations, rewards, terminated, truncated, infos = self.envs.step(actions.detach().cpu().numpy())
        self._latest = self._tensors(observations)
        terms = infos["reward_terms"]
        log = {f"Reward / {name}": torch.tensor(np.mean(terms[name])) for name in self.envs.task.reward_names}
        reward, *ends = (torch.from_numpy(rows).to(self.device)[:, None] for rows in (rewards, terminated, truncated))
        return self._latest[0], reward.float(), ends[0], ends[1], {"episode": log}

    def state(self) -> torch.Tensor | None:
        """State of the latest step or reset, shape (num_envs, numbers); None without the group ``critic``."""
        return self._latest[1] if self._latest else None

    def render(self, *args: Any, **kwargs: Any) -> Any:
        """Images of all environments; None without a render mode."""
        return self.envs.render()

    def close(self) -> None:
        """Ends the task."""
        self.envs.close()

    def _tensors(self, observations: Any) -> tuple[torch.Tensor, torch.Tensor | None]:
        """Flat observations and state."""
        return self._flat(self._observation_space, observations), self._flat(self._state_space, observations)

    def _flat(self, space: gymnasium.Space[Any] | None, observations: Any) -> torch.Tensor | None:
        if space is None:
            return None
        if isinstance(space, gymnasium.spaces.Dict):
            values = {name: observations[name] for name in space}
        elif isinstance(observations, dict):
            values = observations["critic" if space is self._state_space else "policy"]
        else:
            values = observations
        return flatten_tensorized_space(tensorize_space(space, values, device=self.device))


def _space(parts: dict[str, gymnasium.Space[Any]]) -> gymnasium.Space[Any]:
    """The space of one group without images, or a dict of spaces."""
    names = list(parts)
    return parts[names[0]] if names in (["policy"], ["critic"]) else gymnasium.spaces.Dict(parts)
