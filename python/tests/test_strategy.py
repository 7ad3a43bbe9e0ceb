"""Strategies in Python."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import AS_PONTES, said

import plumage


class Fly:
    """Sends every simulated vehicle to one place, and keeps what it was shown."""

    def __init__(self, place):
        self.place = place
        self.shown = []

    def __call__(self, situation):
        self.shown.append(situation)
        return {vehicle: self.place for vehicle, state in situation["vehicles"].items() if state["kind"] == "simulated"}


PLACE = (43.4600, -7.8350, 900.0)


@pytest.fixture(scope="module")
def led(tmp_path_factory):
    strategy = Fly(PLACE)
    path = tmp_path_factory.mktemp("led") / "mission.mcap"
    mission = plumage.run(AS_PONTES, seed=2, duration_s=1800, record=path, strategy=strategy)
    return mission, strategy, path


def test_vehicles_look_where_a_strategy_says(led):
    mission, strategy, _ = led
    times = [situation["time_s"] for situation in strategy.shown]
    assert len(times) > 5 and np.diff(times) == pytest.approx(10.0, abs=0.03)
    assert all(situation["phase"] == "search" for situation in strategy.shown)
    # Each reading is shown once, and those between two questions only.
    for before, after in zip(strategy.shown, strategy.shown[1:]):
        assert after["readings"]
        assert all(before["time_s"] - 0.03 <= read["time_s"] <= after["time_s"] for read in after["readings"])
    known = mission.scenario
    goal = known.to_local(*PLACE[:2])
    last = strategy.shown[-1]["vehicles"]
    simulated = [s for s in last.values() if s["kind"] == "simulated"]
    assert len(simulated) == 5
    off = [((e - goal[0]) ** 2 + (n - goal[1]) ** 2) ** 0.5 for e, n in (known.to_local(s["lat_deg"], s["lon_deg"]) for s in simulated)]
    # Those whose way and height are free are there, within circle and separation.
    assert sorted(off)[0] < 500.0


def test_a_mission_that_was_led_is_flown_again_without_its_strategy(led, command):
    mission, _, path = led
    assert mission.digest in said(command, "replay", path, "--verify").stdout


def test_a_strategy_that_says_something_else_is_told_what_is_expected():
    for says, words in (
        ([1], "expected None, or a dict"),
        ({"1": (43.4, -7.8)}, "expected None, or a dict"),
        ({"99": PLACE}, "vehicle '99': expected one of 1, 2"),
        ({"1": (43.4, float("nan"), 900.0)}, "vehicle '1': expected finite numbers"),
    ):
        with pytest.raises(plumage.InputError, match=words):
            plumage.run(AS_PONTES, strategy=lambda situation, says=says: says)

    def gives_up(situation):
        raise LookupError("no idea")

    with pytest.raises(LookupError, match="no idea"):
        plumage.run(AS_PONTES, strategy=gives_up)
