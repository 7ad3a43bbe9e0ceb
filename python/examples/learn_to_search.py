"""Learns where to look for a plume, and compares with a lawnmower on scenes that neither has seen.

    python learn_to_search.py                      # what was learned before against the lawnmower, in 256 scenes
    python learn_to_search.py --generations 8      # learns anew

Both steer by the same pilot, and say where to fly next and how high. The lawnmower flies arcs close around the keep-out, where the plume
is strongest, one above the other, and turns where the plume lies between with a probability of 95 %. The learned one has
fourteen numbers, found by the cross-entropy method (Rubinstein and Kroese 2004): in each generation policies are drawn from a normal
distribution, flown through scenes of their own, and the distribution is moved to the best of them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from plumage.gym import SearchVectorEnv

#: Simulated time between two decisions, and of a search, s.
STEP_S, DURATION_S = 2.0, 600.0
ARENA_M, KEEP_OUT_M = 3000.0, 800.0
#: Arcs are flown this far from the stack: outside the keep-out, with room for an aircraft that turns, m.
NEAR_M = 842.0
#: Lowest and highest plume of the scenes, m above ground, and one standard deviation of its direction, degrees.
LOW_M, HIGH_M, AXIS_SD_DEG = 200.0, 550.0, 15.0
#: A peak counts as found within 40 m in height: arcs are as far apart as that lets them be.
ARC_APART_M = 75.0
#: What finding the peak is worth in rewards; readings alone never give so much in a step.
FOUND = 9.0
#: Scenes to learn on, and others to compare on, have seeds from here on.
LEARN_SEED, COMPARE_SEED = 10_000, 5_000_000

#: Policies of a generation, scenes that each flies, the best that the next generation is drawn from, and the least spread.
POLICIES, SCENES, ELITE, LEAST_SD = 40, 8, 6, 0.02

Array = NDArray[np.float64]


def pilot(observed: Array, bearing_rad: Array, range_m: Array, height_m: Array) -> NDArray[np.float32]:
    """Actions that fly to places at a bearing from downwind (to the left) and a distance from the stack, round the keep-out."""
    here = ARENA_M * observed[:, :2]
    goal = range_m[:, None] * np.stack([np.cos(bearing_rad), np.sin(bearing_rad)], 1)
    own_range = np.hypot(*here.T)
    own_bearing = np.arctan2(here[:, 1], here[:, 0])
    left_to_go = _wrapped(bearing_rad - own_bearing)
    # Far around the stack the way is along a circle, and outwards or inwards to the distance that is wanted.
    side = np.where(left_to_go >= 0.0, 1.0, -1.0)
    outwards = np.clip((np.maximum(range_m, NEAR_M) - own_range) / 240.0, -1.0, 1.0)
    around = own_bearing + side * (0.5 * np.pi - 0.25 * np.pi * outwards + 0.012 * np.pi)
    straight = np.arctan2(goal[:, 1] - here[:, 1], goal[:, 0] - here[:, 0])
    course = np.where(np.abs(left_to_go) > np.deg2rad(20.0), around, straight)
    # Never at the keep-out: away from it the nearer it is.
    inwards = (own_range < KEEP_OUT_M + 25.0) & (np.abs(_wrapped(course - own_bearing)) > 0.47 * np.pi)
    course = np.where(inwards, own_bearing + side * 0.43 * np.pi, course)
    heading = np.arctan2(observed[:, 4], observed[:, 3])
    turn = _wrapped(course - heading)
    # Who turns about does so away from the stack.
    turn = np.where((np.abs(turn) > 0.5 * np.pi) & (own_range < NEAR_M + 60.0), -np.abs(turn) * np.sign(np.sin(heading - own_bearing)), turn)
    # Across is to the left, and turns are to the right.
    return np.stack([np.clip(-turn / (0.5 * np.pi), -1, 1), (height_m - 400.0) / 300.0, np.zeros_like(turn)], 1).astype(np.float32)


def _wrapped(angle_rad: Array) -> Array:
    return (angle_rad + np.pi) % (2.0 * np.pi) - np.pi


class Lawnmower:
    """Arcs around the keep-out, one above the other."""

    def __init__(self, count: int) -> None:
        self.side = np.zeros(count)
        self.arc = np.zeros(count)
        self.half_rad = 2.0 * np.deg2rad(AXIS_SD_DEG)

    def __call__(self, observed: Array) -> NDArray[np.float32]:
        bearing = np.arctan2(observed[:, 1], observed[:, 0])
        # The first turn is at the farther end.
        self.side = np.where(self.side == 0.0, np.where(bearing >= 0.0, -1.0, 1.0), self.side)
        past = (self.side * bearing > self.half_rad) & (np.abs(bearing) < 0.5 * np.pi)
        self.side = np.where(past, -self.side, self.side)
        self.arc += past
        height = LOW_M + 0.5 * ARC_APART_M + ARC_APART_M * (self.arc % 5)
        return pilot(observed, self.side * (self.half_rad + 0.35), np.full(len(observed), NEAR_M), height)


class Learned:
    """Sweeps around the keep-out until something stands out, then about the best reading, as its numbers say: a row for each search."""

    #: Where learning begins: sweeps as wide as the lawnmower's, six up and down, and no narrower about the best reading.
    FIRST = np.array([0.6, 6.0, 0.0, 0.0, 0.7, 1.5, 0.0, 0.5, 0.6, 6.0, 1.0, 0.5, 1.5, 0.0])

    #: What eight generations gave.
    LEARNED = np.array(
        [0.5487, 7.1572, -0.1383, -0.2446, 0.5553, 1.7255, 0.0177, 0.6108, 0.221, 5.5989, 0.6713, 0.2673, 2.4918, -0.0779]
    )

    def __init__(self, numbers: Array) -> None:
        self.numbers = numbers.T

    def __call__(self, observed: Array) -> NDArray[np.float32]:
        wide, sweeps, sweep_at, middle, tall, rises, rise_at, stands_out, narrow, more, keep, low, again, above = self.numbers
        time = 1.0 - observed[:, 13]
        known = observed[:, 9] > 0.5 * stands_out
        best_bearing = np.arctan2(observed[:, 11], observed[:, 10])
        bearing = wide * np.sin(2.0 * np.pi * (sweeps * time + sweep_at))
        bearing = np.where(known, keep * best_bearing + narrow * np.sin(2.0 * np.pi * more * time), bearing)
        height = middle + tall * np.sin(2.0 * np.pi * (rises * time + rise_at))
        height = np.where(known, observed[:, 12] + above + low * np.sin(2.0 * np.pi * again * time), height)
        height_m = np.clip(400.0 + 300.0 * height, 140.0, 660.0)
        return pilot(observed, np.clip(bearing, -1.2, 1.2), np.full(len(observed), NEAR_M), height_m)


def fly(policy: Callable[[Array], NDArray[np.float32]], seeds: list[int]) -> tuple[Array, NDArray[np.bool_], Array]:
    """What a policy earns in the scenes of these seeds, whether it finds the peak, and when, s."""
    env = SearchVectorEnv(len(seeds), step_s=STEP_S, duration_s=DURATION_S, reward="peak", air="steady")
    observed, _ = env.reset(seed=list(seeds))
    earned, found_s, flies = np.zeros(len(seeds)), np.full(len(seeds), np.inf), np.ones(len(seeds), bool)
    for step in range(round(DURATION_S / STEP_S)):
        observed, reward, terminated, truncated, _ = env.step(policy(observed.astype(float)))
        earned += np.where(flies, reward, 0.0)
        found_s[flies & (reward > FOUND)] = (step + 1) * STEP_S
        flies &= ~(terminated | truncated)
        if not flies.any():
            break
    return earned, np.isfinite(found_s), found_s


def learn(generations: int, say: Callable[[str], object] = print) -> Array:
    """The numbers of a policy, by the cross-entropy method."""
    rng = np.random.default_rng(1)
    mean, sd = Learned.FIRST.copy(), 0.15 + 0.2 * np.abs(Learned.FIRST)
    for generation in range(generations):
        drawn = mean + sd * rng.normal(size=(POLICIES, len(mean)))
        seeds = LEARN_SEED + SCENES * generation + np.arange(SCENES)
        earned, found, found_s = fly(Learned(np.repeat(drawn, SCENES, 0)), list(map(int, np.tile(seeds, POLICIES))))
        # The sooner the better, which the reward does not say.
        worth = (earned + np.where(found, 5.0 * (1.0 - np.minimum(found_s, DURATION_S) / DURATION_S), 0.0)).reshape(POLICIES, SCENES).mean(1)
        elite = drawn[np.argsort(worth)[-ELITE:]]
        mean, sd = elite.mean(0), np.maximum(0.5 * sd + 0.5 * elite.std(0), LEAST_SD)
        say(f"generation {generation + 1:2}: reward {earned.mean():6.2f}, found {100 * found.mean():3.0f} %, best policy {worth.max():6.2f}")
    return mean


def compare(numbers: Array, scenes: int, first_seed: int = COMPARE_SEED) -> dict[str, dict[str, float]]:
    """Lawnmower and learned policy in the same scenes."""
    seeds = [first_seed + k for k in range(scenes)]
    rows = {}
    for name, policy in (("lawnmower", Lawnmower(scenes)), ("learned", Learned(np.tile(numbers, (scenes, 1))))):
        earned, found, found_s = fly(policy, seeds)
        share = found.mean()
        rows[name] = {
            "found": float(share),
            "found_sd": float(np.sqrt(share * (1.0 - share) / scenes)),
            "median_s": float(np.median(found_s)),
            "reward": float(earned.mean()),
            "reward_sd": float(earned.std(ddof=1) / np.sqrt(scenes)),
        }
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=0, help="to learn anew")
    parser.add_argument("--scenes", type=int, default=256, help="to compare on")
    arguments = parser.parse_args()
    numbers = Learned.LEARNED
    if arguments.generations > 0:
        numbers = learn(arguments.generations)
        print(", ".join(f"{n:.4f}" for n in numbers))
    for name, row in compare(numbers, arguments.scenes).items():
        print(
            f"{name:10} found {100 * row['found']:.0f} ± {100 * row['found_sd']:.0f} % in {DURATION_S:.0f} s, half of the scenes by "
            f"{row['median_s']:.0f} s, reward {row['reward']:.2f} ± {row['reward_sd']:.2f}"
        )


if __name__ == "__main__":
    main()
