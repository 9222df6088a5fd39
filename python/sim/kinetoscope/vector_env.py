"""Tasks as environments of Gymnasium: many environments that step together, or one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ._sim import Task
from .errors import ArgumentError

_AUTORESET = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}
_RENDER_MODES = ("rgb_array",)

_Array = NDArray[Any]
_Observations = _Array | dict[str, _Array]


class VectorEnv(gymnasium.vector.VectorEnv[Any, Any, _Array]):
    """A task as a vector environment of Gymnasium.

    Observations are an array, shape (num_envs, columns), if the task has only the group ``policy`` and that group has no
    images. Otherwise they are a dict of the groups, with images of shape (num_envs, height, width, components) below
    ``group/image``. Their type is that of the task. Rewards are float64.

    ``autoreset_mode``, also in ``metadata``, is the mode of the task, and ``options={"reset_mask": mask}`` resets chosen
    environments. A seed is one number, from which each environment derives its own random numbers.

    Infos have ``reward_terms``, the weighted rewards by term, and where episodes end ``end_reason``, the termination
    term or ``"time limit"``. In the mode ``SAME_STEP``, ``final_obs`` has the last observations of ended episodes, and
    ``final_info`` their ``end_reason``.

    ``close`` ends the task; its simulation goes on.
    """

    def __init__(self, task: Task, *, render_mode: str | None = None, render_size: Sequence[int] = (480, 360)) -> None:
        if render_mode is not None and render_mode not in _RENDER_MODES:
            raise ArgumentError(f"VectorEnv: render_mode {render_mode!r} is unknown; known: {_RENDER_MODES} and None")
        self.task = task
        self.num_envs = task.num_envs
        self.render_mode = render_mode
        self._render_size = [int(side) for side in render_size]
        self.autoreset_mode = _AUTORESET[task.autoreset]
        self.metadata = {
            "autoreset_mode": self.autoreset_mode,
            "render_modes": list(_RENDER_MODES),
            "render_fps": round(1 / task.step_dt),
        }
        self._images = {group: list(task.image_spaces(group)) for group in task.group_names}
        self._is_dict = len(self._images) > 1 or any(self._images.values())
        self.single_observation_space = self._space()
        _, low, high = task.action_space
        self.single_action_space = spaces.Box(np.asarray(low, np.float32), np.asarray(high, np.float32), dtype=np.float32)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def _space(self) -> spaces.Space[Any]:
        dtype = np.dtype(self.task.dtype).type
        found: dict[str, spaces.Space[Any]] = {}
        for group, images in self._images.items():
            _, low, high = self.task.group_space(group)
            if low or not images:
                found[group] = spaces.Box(np.asarray(low, dtype), np.asarray(high, dtype), dtype=dtype)
            for name, (shape, element, least, most) in self.task.image_spaces(group).items():
                found[f"{group}/{name}"] = spaces.Box(least, most, shape, np.dtype(element).type)
        return spaces.Dict(found) if self._is_dict else found["policy"]

    def _observations(self, policy: _Array, final: bool = False) -> _Observations:
        if not self._is_dict:
            return policy
        found: dict[str, _Array] = {}
        for group, images in self._images.items():
            values = policy if group == "policy" else self.task.observations(group, final=final)
            if values.shape[1] or not images:
                found[group] = values
            for name in images:
                found[f"{group}/{name}"] = self.task.images(group, name, final=final)
        return found

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Observations, dict[str, Any]]:
        """Begins new episodes, in the environments of ``options["reset_mask"]`` or in all."""
        mask = None
        if options:
            unknown = sorted(set(options) - {"reset_mask"})
            if unknown:
                raise ArgumentError(f"reset: options has the unknown keys {unknown}; known: ['reset_mask']")
            mask = np.asarray(options["reset_mask"])
            if mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
                raise ArgumentError(
                    f"reset: reset_mask has the shape {mask.shape} and the type {mask.dtype}; "
                    f"expected booleans of shape ({self.num_envs},)"
                )
        if seed is not None and not isinstance(seed, (int, np.integer)):
            raise ArgumentError(f"reset: the seed {seed!r} is not a number; environments derive theirs from one number")
        super().reset(seed=None if seed is None else int(seed))
        policy, _ = self.task.reset(None if seed is None else int(seed), None if mask is None else mask.tolist())
        return self._observations(policy), {}

    def step(self, actions: Any) -> tuple[_Observations, _Array, _Array, _Array, dict[str, Any]]:
        """One step of all environments with actions, shape (num_envs, columns)."""
        policy, rewards, terminated, truncated, more = self.task.step(actions)
        everywhere = np.ones(self.num_envs, np.bool_)
        terms = more["reward_terms"]
        by_name: dict[str, _Array] = {}
        for column, name in enumerate(self.task.reward_names):
            by_name[name], by_name[f"_{name}"] = terms[:, column].copy(), everywhere
        infos: dict[str, Any] = {"reward_terms": by_name, "_reward_terms": everywhere}
        if more["ended"]:
            self._add_ends(infos, more)
        return self._observations(policy), rewards, terminated, truncated, infos

    def _add_ends(self, infos: dict[str, Any], more: dict[str, Any]) -> None:
        ended = np.zeros(self.num_envs, np.bool_)
        reasons = np.full(self.num_envs, None, dtype=object)
        for episode in more["ended"]:
            ended[episode["env"]], reasons[episode["env"]] = True, episode["reason"]
        about = {"end_reason": reasons, "_end_reason": ended}
        if self.autoreset_mode != AutoresetMode.SAME_STEP:
            infos.update(about)
            return
        last = self._observations(more["final_observations"], final=True)
        final = np.full(self.num_envs, None, dtype=object)
        for env in np.flatnonzero(ended):
            final[env] = {key: rows[env] for key, rows in last.items()} if isinstance(last, dict) else last[env]
        infos.update(final_obs=final, _final_obs=ended, final_info=about, _final_info=ended)

    def render(self) -> tuple[_Array, ...] | None:
        """Images of all environments, u8, shape (height, width, 3) each; None without a render mode."""
        if self.render_mode is None:
            return None
        sim, size = self.task.sim, self._render_size
        images = (sim.screenshot(size=size, env=env) for env in range(self.num_envs))
        return tuple(image[..., :3] for image in images if image is not None)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """The attribute ``name``, or the result of calling it, once for each environment. A tuple with one entry for
        each environment, such as that of ``render``, is returned as it is."""
        value = getattr(self, name)
        if callable(value):
            value = value(*args, **kwargs)
        return value if isinstance(value, tuple) and len(value) == self.num_envs else (value,) * self.num_envs

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """The attribute ``name``, once for each environment."""
        return self.call(name)

    def close_extras(self, **kwargs: Any) -> None:
        """Ends the task."""
        self.task.close()


class Env(gymnasium.Env[Any, Any]):
    """The one environment of a task as an environment of Gymnasium, with observations, actions and infos of
    :class:`VectorEnv` without their first axis. The mode of automatic resets of the task must be ``"disabled"``, because
    ``reset`` begins the next episode."""

    def __init__(self, task: Task, *, render_mode: str | None = None, render_size: Sequence[int] = (480, 360)) -> None:
        if task.num_envs != 1 or task.autoreset != "disabled":
            raise ArgumentError(
                f"Env: the task has {task.num_envs} environments and the autoreset {task.autoreset!r}; "
                "expected 1 and 'disabled', or use VectorEnv"
            )
        self._envs = VectorEnv(task, render_mode=render_mode, render_size=render_size)
        self.task = task
        self.render_mode = render_mode
        self.metadata = {key: value for key, value in self._envs.metadata.items() if key != "autoreset_mode"}
        self.observation_space = self._envs.single_observation_space
        self.action_space = self._envs.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins the next episode."""
        super().reset(seed=seed)
        observations, _ = self._envs.reset(seed=seed, options=options)
        return _first(observations), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step with an action, shape (columns,)."""
        observations, rewards, terminated, truncated, infos = self._envs.step(np.asarray(action)[None])
        return _first(observations), float(rewards[0]), bool(terminated[0]), bool(truncated[0]), _without_masks(infos)

    def render(self) -> Any:
        """Image of the environment, u8, shape (height, width, 3); None without a render mode."""
        images = self._envs.render()
        return images[0] if images else None

    def close(self) -> None:
        """Ends the task."""
        self._envs.close()


def _first(observations: _Observations) -> Any:
    if isinstance(observations, dict):
        return {key: rows[0] for key, rows in observations.items()}
    return observations[0]


def _without_masks(infos: dict[str, Any]) -> dict[str, Any]:
    """Infos of the first environment."""
    found: dict[str, Any] = {}
    for key, value in infos.items():
        if f"_{key}" in infos and infos[f"_{key}"][0]:
            found[key] = _without_masks(value) if isinstance(value, dict) else value[0]
    return found
