"""The searches of :mod:`plumage.gym` for Stable-Baselines3.

>>> from stable_baselines3 import PPO
>>> from plumage.sb3 import SearchVecEnv
>>> model = PPO("MlpPolicy", SearchVecEnv(16, step_s=2.0), n_steps=64)
>>> _ = model.learn(1024)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

try:
    from stable_baselines3.common.vec_env.base_vec_env import VecEnv
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("plumage.sb3 needs Stable-Baselines3: pip install 'plumage[sb3]'") from error

from .gym import SearchVectorEnv

__all__ = ["SearchVecEnv"]


class SearchVecEnv(VecEnv):
    """Many parallel searches as a ``VecEnv`` of Stable-Baselines3.

    Takes the arguments of :class:`plumage.gym.SearchVectorEnv`. The searches are no objects of their own, so attributes
    and methods are those of the vector.
    """

    def __init__(self, num_envs: int, **options: Any) -> None:
        self.searches = SearchVectorEnv(num_envs, **options)
        self._actions: Any = None
        super().__init__(num_envs, self.searches.single_observation_space, self.searches.single_action_space)

    def reset(self) -> Any:
        """Start all searches, in the scenes of the seeds given to ``seed`` since the last reset."""
        observed, _ = self.searches.reset(seed=list(self._seeds))
        self._reset_seeds()
        return observed

    def step_async(self, actions: Any) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Fly all searches for ``step_s``."""
        observed, rewards, terminated, truncated, info = self.searches.step(self._actions)
        over = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(over):
            infos[k] = {
                "terminal_observation": info["final_obs"][k],
                "TimeLimit.truncated": bool(truncated[k] and not terminated[k]),
            }
        return observed, rewards, over, infos

    def get_images(self) -> Sequence[Any]:
        """Return a map of each search; none without ``render_mode="rgb_array"``."""
        return list(self.searches.render() or ())

    def close(self) -> None:
        """Release nothing: the searches hold no resources."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the vector, once for each search."""
        return [getattr(self.searches, attr_name)] * len(self._numbers(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the vector."""
        setattr(self.searches, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Call a method of the vector, once, and return its result for each search."""
        result = getattr(self.searches, method_name)(*method_args, **method_kwargs)
        return [result] * len(self._numbers(indices))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that no search is wrapped."""
        return [False] * len(self._numbers(indices))

    def _numbers(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
