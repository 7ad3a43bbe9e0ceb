"""Agent-steps a second of 1,024 searches side by side, and of other people's environments where they are installed.

An agent-step is one action of one aircraft. What it costs grows with the simulated time between two actions, which is
stated for ours; that of the others is what they have by default.
"""

import argparse
import os
import time
from importlib.metadata import version

import numpy as np

from plumage.gym import SearchVectorEnv


def rate(step, agents: int, seconds: float) -> float:
    """Agent-steps a second of `step`, called for so long."""
    step()
    begun, count = time.perf_counter(), 0
    while time.perf_counter() - begun < seconds:
        step()
        count += 1
    return count * agents / (time.perf_counter() - begun)


def ours(step_s: float, air: str, seconds: float, count: int = 1024) -> float:
    env = SearchVectorEnv(count, step_s=step_s, air=air)
    env.reset(seed=1)
    rng = np.random.default_rng(1)
    # Straight ahead in the mean, so that searches last; actions are made beforehand, as a policy's cost is its own.
    actions = rng.uniform(-1, 1, (64, count, 3)).astype(np.float32)
    turn = iter(range(10**9))
    return rate(lambda: env.step(actions[next(turn) % 64]), count, seconds)


def other(env, seconds: float) -> float:
    """Agent-steps a second of one aircraft in an environment of Gymnasium that acts by chance."""
    env.reset(seed=1)

    def step():
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()

    return rate(step, 1, seconds)


def pyflyt():
    import gymnasium
    import PyFlyt.gym_envs  # noqa: F401

    return gymnasium.make("PyFlyt/Fixedwing-Waypoints-v3", render_mode=None)


def gym_pybullet_drones():
    from gym_pybullet_drones.envs.HoverAviary import HoverAviary

    return HoverAviary(gui=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0, help="for each figure")
    seconds = parser.parse_args().seconds
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
    for step_s, air in ((0.04, "steady"), (0.1, "steady"), (1.0, "steady"), (1.0, "unsteady")):
        print(f"1,024 searches, {step_s} s a step, {air:8} {ours(step_s, air, seconds):12,.0f} agent-steps/s")
    for package, make in (("PyFlyt", pyflyt), ("gym-pybullet-drones", gym_pybullet_drones)):
        try:
            per_s = other(make(), seconds)
            print(f"{package} {version(package)}, one aircraft on one processor {per_s:12,.0f} agent-steps/s")
        except Exception as why:
            print(f"{package}: left out ({type(why).__name__}: {why})")


if __name__ == "__main__":
    main()
