"""Environments to learn in."""

from __future__ import annotations

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import plumage
import plumage.gym
from plumage.gym import SearchEnv, SearchVectorEnv, parallel_env


@pytest.mark.parametrize("air", ["steady", "unsteady"])
@pytest.mark.parametrize("reward", ["peak", "information"])
def test_gymnasium_finds_nothing_wrong(air, reward):
    from gymnasium.utils.env_checker import check_env

    made = gymnasium.make("plumage/Search-v0", air=air, reward=reward, render_mode="rgb_array")
    check_env(made.unwrapped)


@pytest.mark.parametrize("agents", [1, 3])
def test_pettingzoo_finds_nothing_wrong(agents):
    test = pytest.importorskip("pettingzoo.test")
    test.parallel_api_test(parallel_env(agents=agents, duration_s=60.0), num_cycles=300)
    test.parallel_seed_test(lambda: parallel_env(agents=agents, duration_s=60.0), num_cycles=20)


def actions(count: int, steps: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (steps, count, 3)).astype(np.float32)


@pytest.mark.parametrize("air", ["steady", "unsteady"])
def test_many_side_by_side_fly_as_each_alone(air):
    many = SearchVectorEnv(5, step_s=0.25, duration_s=15.0, air=air)
    acted = actions(5, 59, 1)
    seen = [many.reset(seed=40)[0]]
    rewards = []
    for row in acted:
        observed, reward, terminated, truncated, _ = many.step(row)
        assert not (terminated | truncated).any()
        seen.append(observed)
        rewards.append(reward)
    for k in range(5):
        alone = SearchEnv(step_s=0.25, duration_s=15.0, air=air)
        np.testing.assert_array_equal(alone.reset(seed=40 + k)[0], seen[0][k])
        for step, row in enumerate(acted):
            observed, reward, *_ = alone.step(row[k])
            np.testing.assert_array_equal(observed, seen[step + 1][k])
            assert reward == rewards[step][k]
    # The step that comes to the end is the last one, and another search begins in it.
    observed, _, _, truncated, info = many.step(acted[0])
    assert truncated.all() and info["_final_obs"].all()
    assert info["final_obs"][0][13] == pytest.approx(0.0, abs=1e-6) and observed[0][13] == 1.0


def to_the_peak(env: SearchEnv) -> np.ndarray:
    """Flies to where the truth says that the peak is, round the keep-out; a test may look."""
    truth = env.truth()
    wind = np.deg2rad(truth["wind_from_deg"] + 180.0)
    downwind, left = np.array([np.sin(wind), np.cos(wind)]), np.array([-np.cos(wind), np.sin(wind)])
    peak = np.array([truth["peak_east_m"], truth["peak_north_m"]])
    return np.array([peak @ downwind, peak @ left])


def steer(observed: np.ndarray, goal: np.ndarray, height_m: float) -> np.ndarray:
    """An action that turns towards a goal (along, across; m) at a height."""
    here = observed[:2] * 3000.0
    wanted = goal - here
    course = np.arctan2(observed[4], observed[3])
    turn = np.arctan2(wanted[1], wanted[0]) - course
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    # Across is to the left, and turns are to the right.
    return np.array([np.clip(-turn / (np.pi / 2), -1, 1), 2 * (height_m - 100) / 600 - 1, 0.0], np.float32)


@pytest.mark.parametrize("seed", range(6))
def test_who_flies_to_the_peak_finds_it_and_reads_what_the_plume_has(seed):
    env = SearchEnv(duration_s=900.0)
    observed, _ = env.reset(seed=seed)
    truth, goal = env.truth(), to_the_peak(env)
    side = 1.0 if observed[1] >= 0 else -1.0
    # Up the axis, so that the sensor has met the plume before.
    way = [np.array([-1300.0, side * 1400.0]), np.array([600.0, side * 1400.0]), goal * 2.6, goal * 1.06]
    total, over = 0.0, False
    while not over:
        observed, reward, terminated, truncated, info = env.step(steer(observed, way[0], truth["peak_height_agl_m"]))
        total += reward
        over = terminated or truncated
        if len(way) > 1 and np.hypot(*(observed[:2] * 3000.0 - way[0])) < 150.0:
            way.pop(0)
    assert info["found"] and terminated
    best = 3.0 * np.expm1(observed[9] * 7.0)
    assert total == pytest.approx(10.0 + observed[9] * 7.0, abs=1e-3)
    # Read near the peak, not at it; the sensor lags and is noisy.
    assert 0.2 * (truth["peak_ppm"] - 420) < best < 1.2 * (truth["peak_ppm"] - 420) + 12


def test_the_keep_out_ends_an_episode():
    env = SearchEnv()
    observed, _ = env.reset(seed=3)
    for _ in range(600):
        observed, reward, terminated, truncated, _ = env.step(steer(observed, np.zeros(2), 300.0))
        if terminated:
            break
    assert terminated and reward == pytest.approx(-10.0, abs=0.5)
    assert np.hypot(*(observed[:2] * 3000.0)) == pytest.approx(800.0, abs=30.0)


def test_only_the_plume_informs():
    """Upwind nothing is learnt; a reading inside tells more than the next one at the same place."""
    env = SearchEnv(reward="information")
    observed, _ = env.reset(seed=0)
    _, reward, *_ = env.step(np.zeros(3, np.float32))
    assert reward == 0.0
    total = 0.0
    truth, goal = env.truth(), to_the_peak(env)
    side = 1.0 if observed[1] >= 0 else -1.0
    way = [np.array([-1300.0, side * 1400.0]), np.array([600.0, side * 1400.0]), goal * 1.3]
    for _ in range(400):
        observed, reward, terminated, *_ = env.step(steer(observed, way[0], truth["peak_height_agl_m"]))
        assert reward >= 0.0 or terminated
        total += max(reward, 0.0)
        if len(way) > 1 and np.hypot(*(observed[:2] * 3000.0 - way[0])) < 150.0:
            way.pop(0)
    # Direction from 15° and strength from a factor of two to a few percent each: some ln(10) each.
    assert 3.0 < total < 25.0


def test_a_team_shares_its_best_reading():
    env = parallel_env(agents=3)
    env.reset(seed=1)
    for _ in range(100):
        seen, *_ = env.step({name: np.zeros(3, np.float32) for name in env.agents})
    assert len({tuple(one[9:13]) for one in seen.values()}) == 1
    assert len({tuple(one[:2]) for one in seen.values()}) == 3
    # 100 m apart at the start, in 3 km.
    first = env.reset(seed=1)[0]["aircraft_1"]
    assert np.hypot(first[14], first[15]) == pytest.approx(100 / 3000, rel=0.01)


def pixel(frame: np.ndarray, east_m: float, north_m: float) -> tuple[int, ...]:
    """The colour of a place, by the scale of the map: 6.4 km are 400 pixels."""
    return tuple(frame[round((3200 - north_m) / 6400 * 399), round((3200 + east_m) / 6400 * 399)].tolist())


def test_the_map_shows_peak_keep_out_and_track():
    env = SearchEnv(render_mode="rgb_array", step_s=5.0)
    observed, _ = env.reset(seed=2)
    before, truth = env.render(), env.truth()
    assert before.shape == (400, 400, 3) and before.dtype == np.uint8
    assert pixel(before, truth["peak_east_m"], truth["peak_north_m"]) == (20, 90, 40)
    # The keep-out is a disc around the stack, upwind of which aircraft start.
    wind = np.deg2rad(truth["wind_from_deg"])
    assert pixel(before, 600 * np.sin(wind), 600 * np.cos(wind)) == (240, 214, 210)
    start = -3000.0 * observed[0] * np.array([np.sin(wind), np.cos(wind)])
    start += 3000.0 * observed[1] * np.array([np.cos(wind), -np.sin(wind)])
    assert pixel(before, *start) == (20, 20, 20)
    for _ in range(6):
        env.step(np.zeros(3, np.float32))
    # Its place at the start is now a part of the track in clean air.
    assert pixel(env.render(), *start) != (255, 255, 255)
    assert (env.render() != before).any()
    assert SearchEnv().render() is None
    with pytest.raises(plumage.InputError, match="expected None or 'rgb_array'"):
        SearchEnv(render_mode="human")


def test_teams_and_vectors_draw_too():
    team = parallel_env(agents=3, render_mode="rgb_array")
    team.reset(seed=1)
    alone = parallel_env(agents=1, render_mode="rgb_array")
    alone.reset(seed=1)
    black = lambda frame: int((frame == 20).all(axis=-1).sum())
    assert black(team.render()) > 2 * black(alone.render()) - 25
    many = SearchVectorEnv(2, step_s=5.0, duration_s=10.0, render_mode="rgb_array")
    many.reset(seed=0)
    first = many.render()
    many.step(np.zeros((2, 3), np.float32))
    assert len(first) == 2 and (first[0] != first[1]).any()
    assert (many.render()[0] != first[0]).any()
    # The next scene starts with an empty map: a single place of one aircraft.
    many.step(np.zeros((2, 3), np.float32))
    assert black(many.render()[0]) <= 49 + 25


def test_wrong_settings_are_refused():
    for wrong, words in (
        ({"step_s": 0.001}, "step_s 0.001: expected 0.02 to 60 s"),
        ({"reward": "fame"}, "expected peak or information"),
        ({"air": "wild"}, "expected steady or unsteady"),
    ):
        with pytest.raises(plumage.InputError, match=words):
            SearchEnv(**wrong)
    with pytest.raises(plumage.InputError, match="expected 1 to 16"):
        parallel_env(agents=0)


def test_stable_baselines3_learns_from_many_side_by_side():
    stable_baselines3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecMonitor

    from plumage.sb3 import SearchVecEnv

    searches = SearchVecEnv(4, step_s=5.0, duration_s=50.0)
    searches.seed(7)
    first = searches.reset()
    searches.seed(7)
    assert np.array_equal(first, searches.reset()) and first.dtype == np.float32
    assert not np.array_equal(first, searches.reset())
    # An episode that time ends is no failure to learn from, and its last observation is not that of the next.
    ends = []
    for _ in range(12):
        seen, _, over, infos = searches.step(np.zeros((4, 3), np.float32))
        ends += [(info, seen[k]) for k, info in enumerate(infos) if over[k]]
    assert ends and all(not np.array_equal(info["terminal_observation"], after) for info, after in ends)
    assert any(info["TimeLimit.truncated"] for info, _ in ends)
    assert searches.get_attr("num_envs", [0, 2]) == [4, 4] and searches.env_is_wrapped(VecMonitor) == [False] * 4
    learner = stable_baselines3.PPO("MlpPolicy", VecMonitor(searches), n_steps=32, batch_size=64, seed=1)
    learner.learn(256)
    action, _ = learner.predict(first)
    assert action.shape == (4, 3)
