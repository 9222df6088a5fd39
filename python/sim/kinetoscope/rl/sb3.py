"""Stable-Baselines3: a ``VecEnv`` of a task.

>>> from stable_baselines3 import PPO
>>> from stable_baselines3.common.vec_env import VecMonitor
>>> from kinetoscope.rl.sb3 import Sb3VecEnv
>>> envs = VecMonitor(Sb3VecEnv("Kinetoscope/Balance-v0", num_envs=16))
>>> PPO("MlpPolicy", envs, n_steps=128).learn(100_000)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..vector_env import VectorEnv
from ._requirements import require, vector_env

require("kinetoscope.rl.sb3", "stable-baselines3", "2.4", "stable_baselines3")

from stable_baselines3.common.vec_env import VecEnv  # noqa: E402

_Array = NDArray[Any]
_Indices = int | Iterable[int] | None


class Sb3VecEnv(VecEnv):
    """The environments of a task as a ``VecEnv`` of Stable-Baselines3.

    ``env`` is a :class:`kinetoscope.VectorEnv` whose task has the autoreset ``"same_step"`` and the dtype ``"float32"``,
    or the registered name of a task. ``num_envs`` and ``fields``, those of :func:`kinetoscope.envs.make_vec`, are for a
    task by name.

    The infos of the last step of an episode have ``terminal_observation`` and ``end_reason``, the termination term or
    ``"time limit"``; ``TimeLimit.truncated`` is in all infos. Returns and lengths of episodes come from ``VecMonitor``.

    All environments belong to one object, ``envs``: ``get_attr`` reads its attributes for each environment, and
    ``set_attr`` and ``env_method`` act on all environments, so they refuse ``indices`` of a part of them.
    """

    def __init__(self, env: VectorEnv | str, num_envs: int | None = None, **fields: Any) -> None:
        self.envs = vector_env("Sb3VecEnv", env, num_envs, "same_step", fields)
        self._actions: _Array | None = None
        super().__init__(self.envs.num_envs, self.envs.single_observation_space, self.envs.single_action_space)

    def reset(self) -> Any:
        """First observations of new episodes. Each environment derives its random numbers from the seed of ``seed``."""
        options = self._options
        self._reset_options()
        if any(options):
            raise ArgumentError(f"Sb3VecEnv: reset supports no options, and set_options got {options[0]}")
        observations, _ = self.envs.reset(seed=self._seeds[0])
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._actions = None
        self._reset_seeds()
        return observations

    def step_async(self, actions: _Array) -> None:
        """Keeps the actions, shape (num_envs, columns), for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, _Array, _Array, list[dict[str, Any]]]:
        """Observations, rewards (float32), ends of episodes, and infos of one step."""
        if self._actions is None:
            raise ArgumentError("Sb3VecEnv: step_wait without actions; call step_async, or step(actions)")
        actions, self._actions = self._actions, None
        observations, rewards, terminated, truncated, infos = self.envs.step(actions)
        rows: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(self.num_envs)]
        dones = terminated | truncated
        for env in np.flatnonzero(dones):
            rows[env] = {
                "TimeLimit.truncated": bool(truncated[env] and not terminated[env]),
                "terminal_observation": infos["final_obs"][env],
                "end_reason": infos["final_info"]["end_reason"][env],
            }
        return observations, rewards.astype(np.float32), dones, rows

    def close(self) -> None:
        """Ends the task."""
        self.envs.close()

    def get_images(self) -> Sequence[_Array | None]:
        """Images of all environments, u8, shape (height, width, 3) each; None without a render mode."""
        return self.envs.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: _Indices = None) -> list[Any]:
        """The attribute of ``envs`` or of its task, once for each of ``indices``."""
        owner = self.envs if hasattr(self.envs, attr_name) else self.envs.task
        return [getattr(owner, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: _Indices = None) -> None:
        """Sets an attribute of ``envs``."""
        self._refuse_part(f"set_attr({attr_name!r})", indices)
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: _Indices = None, **method_kwargs: Any) -> list[Any]:
        """Calls a method of ``envs`` or of its task once. Returns its results by environment, or its one result for each."""
        self._refuse_part(f"env_method({method_name!r})", indices)
        owner = self.envs if hasattr(self.envs, method_name) else self.envs.task
        result = getattr(owner, method_name)(*method_args, **method_kwargs)
        per_env = isinstance(result, tuple) and len(result) == self.num_envs
        return list(result) if per_env else [result] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type[Any], indices: _Indices = None) -> list[bool]:
        """False for each of ``indices``: wrappers of Gymnasium for single environments do not apply here."""
        return [False] * len(list(self._get_indices(indices)))

    def _refuse_part(self, call: str, indices: _Indices) -> None:
        chosen = sorted(self._get_indices(indices))
        if chosen != list(range(self.num_envs)):
            raise ArgumentError(
                f"Sb3VecEnv: {call} acts on all {self.num_envs} environments, and indices are {chosen}; leave them out"
            )
