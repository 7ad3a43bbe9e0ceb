"""Plume searches as environments for reinforcement learning.

- :class:`SearchEnv`: one aircraft, for Gymnasium (``gymnasium.make("plumage/Search-v0")`` once this is imported);
- :func:`parallel_env`: a team, for PettingZoo;
- :class:`SearchVectorEnv`: many parallel searches, flown in Rust on all processors.

**Scene.** Each seed gives one: a stack at the origin, a wind of 3 to 9 m/s from any direction, air of class C, D or E, and
a plume whose axis is turned from the wind by 15° (one standard deviation), lies 200 to 550 m above ground and has 50
to 500 ppm at 2 km. Aircraft start upwind of the stack and fly with the six-degree-of-freedom model and the autopilot
of missions. They must stay 800 m to 3 km from the stack and 40 to 760 m above ground.
With ``air="unsteady"`` the plume meanders and breaks into puffs, and gusts move the aircraft.

**Action.** Three numbers from −1 to 1: how far to turn from the course over ground (±90°), height (100 to 700 m above
ground), airspeed (from the slowest of the aircraft to 0.9 of its fastest).

**Observation.** Sixteen numbers from −1 to 1; "along" is downwind of the stack and "across" to the left of it, for
the wind that the team assumes:

====== ========================================================================================
0, 1   place along and across, in 3 km
2      height, −1 at 100 m to 1 at 700 m
3, 4   direction of flight over ground, along and across
5      airspeed, in the aircraft's fastest
6      climb, in 5 m/s
7      wind speed at this height, in 15 m/s
8      reading s = ln(1 + excess / noise), in 7; noise is 3 ppm
9      highest reading s of the team so far
10–12  its position: along, across, height
13     fraction of the time that remains
14, 15 the nearest other aircraft, along and across from this one, in 3 km; zeros if there is none
====== ========================================================================================

**Reward.** ``reward="peak"``: by how much the team's highest reading s grows, and 10 when the place of the highest
mean concentration outside the keep-out is found (within 60 m on the map and 40 m in height), which ends the episode.
``reward="information"``: information gain, in nats, about the plume's direction, height and strength: half the growth of the logarithm of the determinant of their information matrix, a reading a second.
Both: −10 for leaving the allowed space, which ends an aircraft's episode; −1 per second within 50 m of another aircraft.

**Drawing.** With ``render_mode="rgb_array"``, ``render()`` returns a map of 400 × 400 pixels: the allowed ring, the wind
that the team assumes, the tracks coloured by readings, and the true peak.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("plumage.gym needs Gymnasium: pip install 'plumage[gym]'") from error
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ._drawing import Drawing, Frame
from ._plumage import Aircraft, InputError, Searches

__all__ = ["SearchEnv", "SearchVectorEnv", "parallel_env"]

Reward = Literal["peak", "information"]
Air = Literal["steady", "unsteady"]
RenderMode = Literal["rgb_array"]
RENDER_MODES = ["rgb_array"]

#: Seeds are drawn below this where none is given.
_SEEDS = 2**63


def _observation_space() -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-1.0, 1.0, (Searches.OBSERVED,), np.float32)


def _action_space() -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-1.0, 1.0, (Searches.ACTED,), np.float32)


def _searches(
    count: int,
    agents: int,
    step_s: float,
    duration_s: float,
    reward: Reward,
    air: Air,
    aircraft: Aircraft | None,
    goes_on: bool,
) -> Searches:
    return Searches(
        count,
        agents=agents,
        step_s=step_s,
        duration_s=duration_s,
        goal=reward,
        air=air,
        aircraft=aircraft or Aircraft(),
        goes_on=goes_on,
    )


def _render_mode(mode: str | None) -> RenderMode | None:
    if mode not in (None, *RENDER_MODES):
        raise InputError(f"render_mode {mode!r}: expected None or 'rgb_array'")
    return "rgb_array" if mode else None


def _flat(actions: Any) -> NDArray[np.float32]:
    return np.ascontiguousarray(actions, dtype=np.float32).reshape(-1)


class SearchEnv(gymnasium.Env):
    """One aircraft that searches for one plume; the module describes observation, action and reward.

    step_s: simulated time between two actions, s.
    duration_s: length of an episode, s; longer episodes are truncated.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 10}

    def __init__(
        self,
        *,
        step_s: float = 1.0,
        duration_s: float = 600.0,
        reward: Reward = "peak",
        air: Air = "steady",
        aircraft: Aircraft | None = None,
        render_mode: RenderMode | None = None,
    ) -> None:
        self.observation_space = _observation_space()
        self.action_space = _action_space()
        self.render_mode = _render_mode(render_mode)
        self._drawing = Drawing()
        self._searches = _searches(1, 1, step_s, duration_s, reward, air, aircraft, False)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start the scene of ``seed``, or the next one of the current sequence."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(_SEEDS)) if seed is None else seed
        self._searches.reset([0], [drawn])
        seen = self._searches.observe()
        self._drawing.begin(seen[None])
        return seen, {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Fly for ``step_s``."""
        seen, rewards, terminated, truncated, _ = self._searches.step(_flat(action))
        info = {"found": self._searches.truth(0)["found"]}
        if self.render_mode is not None:
            self._drawing.add(seen[None])
        return seen, float(rewards[0]), bool(terminated[0]), bool(truncated[0]), info

    def render(self) -> Frame | None:
        """Return a map of the search so far; None without a ``render_mode``."""
        return None if self.render_mode is None else self._drawing.frame(self.truth())

    def truth(self) -> dict[str, Any]:
        """Wind and peak of the scene, hidden from the aircraft."""
        return self._searches.truth(0)


class SearchVectorEnv(gymnasium.vector.VectorEnv):
    """Many parallel searches with one aircraft each, flown in Rust on all processors.

    A finished search restarts in the same step with the next scene of its seed; ``final_obs`` of the info has its
    last observation.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_modes": RENDER_MODES, "render_fps": 10}

    def __init__(
        self,
        num_envs: int,
        *,
        step_s: float = 1.0,
        duration_s: float = 600.0,
        reward: Reward = "peak",
        air: Air = "steady",
        aircraft: Aircraft | None = None,
        render_mode: RenderMode | None = None,
    ) -> None:
        self.num_envs = num_envs
        self.render_mode = _render_mode(render_mode)
        self._drawings = [Drawing() for _ in range(num_envs if self.render_mode else 0)]
        self.single_observation_space = _observation_space()
        self.single_action_space = _action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._searches = _searches(num_envs, 1, step_s, duration_s, reward, air, aircraft, True)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start all searches in the scenes of ``seed``, ``seed`` + 1 and so on, of a list of seeds, or of drawn seeds."""
        if isinstance(seed, (list, tuple)):
            given = list(seed)
        elif seed is None:
            given = [None] * self.num_envs
        else:
            super().reset(seed=seed)
            given = [seed + k for k in range(self.num_envs)]
        seeds = [int(self.np_random.integers(_SEEDS)) if one is None else one for one in given]
        self._searches.reset(list(range(self.num_envs)), seeds)
        seen = self._observations(self._searches.observe())
        for drawing, own in zip(self._drawings, seen, strict=False):
            drawing.begin(own[None])
        return seen, {}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Fly all searches for ``step_s``."""
        seen, rewards, terminated, truncated, last = self._searches.step(_flat(actions))
        info: dict[str, Any] = {}
        over = terminated | truncated
        if over.any():
            finals = np.full(self.num_envs, None, dtype=object)
            last = self._observations(last)
            for k in np.flatnonzero(over):
                finals[k] = last[k]
            info = {"final_obs": finals, "_final_obs": over, "final_info": {}, "_final_info": over}
        observed = self._observations(seen)
        for drawing, own, ended in zip(self._drawings, observed, over, strict=False):
            (drawing.begin if ended else drawing.add)(own[None])
        return observed, rewards, terminated, truncated, info

    def render(self) -> tuple[Frame, ...] | None:
        """Return a map of each search so far; None without a ``render_mode``."""
        if self.render_mode is None:
            return None
        return tuple(drawing.frame(self._searches.truth(k)) for k, drawing in enumerate(self._drawings))

    def _observations(self, flat: NDArray[np.float32]) -> NDArray[np.float32]:
        return flat.reshape(self.num_envs, Searches.OBSERVED)


def parallel_env(
    *,
    agents: int = 3,
    step_s: float = 1.0,
    duration_s: float = 600.0,
    reward: Reward = "peak",
    air: Air = "steady",
    aircraft: Aircraft | None = None,
    render_mode: RenderMode | None = None,
) -> Any:
    """Create a team of ``agents`` (1 to 16) that searches for one plume, as an environment of PettingZoo's parallel API.

    All share the highest reading, and each is rewarded for its own contribution.
    """
    from ._team import TeamEnv

    searches = _searches(1, agents, step_s, duration_s, reward, air, aircraft, False)
    return TeamEnv(searches, agents, _render_mode(render_mode))


gymnasium.register("plumage/Search-v0", entry_point="plumage.gym:SearchEnv")
