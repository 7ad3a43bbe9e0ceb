"""Environment of a team, in its own module since it needs PettingZoo."""

from __future__ import annotations

import functools
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from ._drawing import Drawing, Frame
from ._plumage import Searches
from .gym import _SEEDS, RENDER_MODES, RenderMode, _action_space, _observation_space


class TeamEnv(ParallelEnv):  # type: ignore[misc]
    """Team that searches for one plume."""

    metadata = {"name": "plumage_search_v0", "render_modes": RENDER_MODES, "is_parallelizable": True}

    def __init__(self, searches: Searches, agents: int, render_mode: RenderMode | None) -> None:
        self.possible_agents = [f"aircraft_{k + 1}" for k in range(agents)]
        self.agents: list[str] = []
        self.render_mode = render_mode
        self._drawing = Drawing()
        self._searches = searches
        self._numbers = {name: k for k, name in enumerate(self.possible_agents)}
        self._seeds = np.random.default_rng()

    @functools.cache
    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        """Sixteen numbers from −1 to 1."""
        return _observation_space()

    @functools.cache
    def action_space(self, agent: str) -> gymnasium.spaces.Box:
        """Turn, height and airspeed, each −1 to 1."""
        return _action_space()

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, dict[str, Any]]]:
        """Start the scene of ``seed``, or the next one of the current sequence."""
        if seed is not None:
            self._seeds = np.random.default_rng(seed)
        drawn = int(self._seeds.integers(_SEEDS)) if seed is None else seed
        self.agents = list(self.possible_agents)
        self._searches.reset([0], [drawn])
        seen = self._rows(self._searches.observe())
        self._drawing.begin(seen)
        return self._by_agent(seen), {name: {} for name in self.agents}

    def step(self, actions: dict[str, NDArray[np.float32]]) -> tuple[
        dict[str, NDArray[np.float32]],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Fly all active aircraft for ``step_s``."""
        acted = np.zeros((len(self.possible_agents), Searches.ACTED), np.float32)
        for name, action in actions.items():
            acted[self._numbers[name]] = action
        seen, rewards, terminated, truncated, _ = self._searches.step(acted.reshape(-1))
        found = self._searches.truth(0)["found"]
        if self.render_mode is not None:
            self._drawing.add(self._rows(seen))
        answer = (
            self._by_agent(self._rows(seen)),
            {name: float(value) for name, value in self._by_agent(rewards).items()},
            {name: bool(value) for name, value in self._by_agent(terminated).items()},
            {name: bool(value) for name, value in self._by_agent(truncated).items()},
            {name: {"found": found} for name in self.agents},
        )
        over = terminated | truncated
        self.agents = [name for name in self.agents if not over[self._numbers[name]]]
        return answer

    def render(self) -> Frame | None:
        """Return a map of the search so far; None without a ``render_mode``."""
        return None if self.render_mode is None else self._drawing.frame(self.truth())

    def truth(self) -> dict[str, Any]:
        """Wind and peak of the scene, hidden from the team."""
        return self._searches.truth(0)

    def _rows(self, flat: NDArray[np.float32]) -> NDArray[np.float32]:
        return flat.reshape(len(self.possible_agents), Searches.OBSERVED)

    def _by_agent(self, rows: NDArray[Any]) -> dict[str, Any]:
        return {name: rows[self._numbers[name]] for name in self.agents}
