"""rsl_rl: a ``VecEnv`` of a task.

>>> from rsl_rl.runners import OnPolicyRunner
>>> from kinetoscope.rl.rsl_rl import RslRlVecEnv
>>> envs = RslRlVecEnv("Kinetoscope/QuadrupedVelocity-v0", num_envs=1024)
>>> OnPolicyRunner(envs, cfg, log_dir="logs").learn(300, init_at_random_ep_len=True)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..vector_env import VectorEnv
from ._requirements import require, vector_env

require("kinetoscope.rl.rsl_rl", "rsl-rl-lib", "5.0", "rsl_rl.env")

import torch  # noqa: E402
from rsl_rl.env import VecEnv  # noqa: E402
from tensordict import TensorDict  # noqa: E402


@dataclass(frozen=True)
class RslRlEnvCfg:
    """Description of an environment for the logs of rsl_rl."""

    task: str
    """Registered name of the task, or its representation."""

    num_envs: int
    """Number of environments."""

    step_dt: float
    """Duration of a step [s]."""

    episode_steps: int
    """Limit of an episode in steps."""


class RslRlVecEnv(VecEnv):
    """The environments of a task as a ``VecEnv`` of rsl_rl.

    ``env`` is a :class:`kinetoscope.VectorEnv` whose task has the autoreset ``"same_step"``, the dtype ``"float32"`` and
    ``episode_steps``, or the registered name of a task. ``num_envs`` and ``fields``, those of
    :func:`kinetoscope.envs.make_vec`, are for a task by name. ``device`` is where tensors are; on the CPU, they use the
    memory of the task's arrays.

    Observations are a ``TensorDict`` of the groups of the task, ``policy``, ``critic`` and so on, and of their images
    (``group/image``) as float32 of shape (num_envs, components, height, width). ``extras`` has ``time_outs`` and ``log``:
    means of the reward terms, and where episodes ended the share of each reason.

    ``episode_length_buf`` is writable: an environment begins its next episode, as at a time limit, when its number
    reaches ``max_episode_length``. The episodes of the task begin in the constructor, with ``seed``.
    """

    def __init__(
        self,
        env: VectorEnv | str,
        num_envs: int | None = None,
        *,
        device: torch.device | str = "cpu",
        seed: int | None = None,
        **fields: Any,
    ) -> None:
        self.envs = vector_env("RslRlVecEnv", env, num_envs, "same_step", fields)
        task = self.envs.task
        if task.episode_steps is None:
            raise ArgumentError('RslRlVecEnv: the task has no "episode_steps", which rsl_rl needs as the limit of an episode')
        self.device = torch.device(device)
        self.num_envs = task.num_envs
        self.num_actions = len(task.action_space[0])
        self.max_episode_length = task.episode_steps
        name = env if isinstance(env, str) else repr(task)
        self.cfg = RslRlEnvCfg(name, self.num_envs, task.step_dt, task.episode_steps)
        self.reset(seed)

    def reset(self, seed: int | None = None) -> TensorDict:
        """First observations of new episodes in all environments."""
        observations, _ = self.envs.reset(seed=seed)
        self.episode_length_buf = torch.zeros(self.num_envs, dtype=torch.long, device=self.device)
        self._observations = self._tensors(observations)
        return self._observations

    def get_observations(self) -> TensorDict:
        """Observations of the latest step or reset."""
        return self._observations

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Observations, rewards (float32), ends of episodes (int64) and extras of one step with actions, shape
        (num_envs, num_actions)."""
        observations, rewards, terminated, truncated, infos = self.envs.step(actions.detach().cpu().numpy())
        self.episode_length_buf += 1
        over = (self.episode_length_buf >= self.max_episode_length).cpu().numpy() & ~(terminated | truncated)
        if over.any():
            observations, _ = self.envs.reset(options={"reset_mask": over})
            truncated = truncated | over
        dones = torch.from_numpy(terminated | truncated).to(self.device)
        self.episode_length_buf[dones] = 0
        self._observations = self._tensors(observations)
        # Float64 in Gymnasium.
        rewards_of_step = torch.from_numpy(rewards).to(self.device, torch.float32)
        extras = {"time_outs": torch.from_numpy(truncated & ~terminated).to(self.device), "log": self._log(infos, over)}
        return self._observations, rewards_of_step, dones.long(), extras

    def close(self) -> None:
        """Ends the task."""
        self.envs.close()

    def _tensors(self, observations: Any) -> TensorDict:
        groups = observations if isinstance(observations, dict) else {"policy": observations}
        tensors = {}
        for name, rows in groups.items():
            tensor = torch.from_numpy(rows).to(self.device)
            tensors[name] = tensor.permute(0, 3, 1, 2).float() if tensor.dim() == 4 else tensor
        return TensorDict(tensors, batch_size=[self.num_envs], device=self.device)

    def _log(self, infos: dict[str, Any], over: Any) -> dict[str, float]:
        terms = infos["reward_terms"]
        log = {f"Reward/{name}": float(terms[name].mean()) for name in self.envs.task.reward_names}
        ended = infos.get("final_info", {"end_reason": np.full(self.num_envs, None)})["end_reason"].copy()
        ended[over] = "time limit"
        reasons = [reason for reason in ended if reason is not None]
        for reason in sorted(set(reasons)):
            log[f"End/{reason}"] = reasons.count(reason) / len(reasons)
        return log
