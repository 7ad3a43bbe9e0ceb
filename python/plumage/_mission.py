"""Missions."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, Union

from . import _plumage
from ._plumage import Scenario
from ._scenario import ScenarioLike, scenario_of
from ._table import Table

#: A search strategy: the situation, and where vehicles shall look.
Strategy = Callable[[dict[str, Any]], Union[Mapping[str, tuple[float, float, float]], None]]


class Mission:
    """Result of a mission that was flown or read from a recording."""

    def __init__(self, flown: _plumage.Flown, folder: str = "") -> None:
        self._flown = flown
        self._folder = folder

    @property
    def digest(self) -> str:
        """SHA-256 over all messages of the agents; equals that of ``plumage run`` for the same run."""
        return self._flown.digest

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Results of the mission, as in ``summary.json``."""
        return self._flown.summary()

    @cached_property
    def readings(self) -> Table:
        """Readings, one per row, with time (s), vehicle (``platform``), position, ``<gas>_ppm``, wind and motion."""
        return Table(self._flown.readings())

    @cached_property
    def tracks(self) -> Table:
        """States of the vehicles, one per row, with position, velocity over ground (m/s) and attitude (degrees)."""
        return Table(self._flown.tracks())

    @cached_property
    def model(self) -> Table:
        """Plume model, one row each time the world simulator published it, with standard deviations (``_sd``)."""
        return Table(self._flown.model())

    @property
    def scenario(self) -> Scenario:
        """Scenario as flown, with all defaults."""
        return Scenario.from_text(self._flown.scenario_toml, folder=self._folder)

    @property
    def notices(self) -> list[str]:
        """Notices about what a recording lacks."""
        return self._flown.notices

    def __repr__(self) -> str:
        return f"Mission({self.summary['sim_s']:.0f} s, digest {self.digest[:12]}…)"


def run(
    scenario: ScenarioLike,
    *,
    seed: int | None = None,
    duration_s: float | None = None,
    gas: str | None = None,
    progress: Callable[[float, float], object] | None = None,
    record: str | os.PathLike[str] | None = None,
    strategy: Strategy | None = None,
) -> Mission:
    """Fly a mission in this process as fast as possible and return its result.

    Other threads keep running; an interrupt (Ctrl-C) ends the mission with KeyboardInterrupt.

    scenario: a Scenario, its file, or its tables as a dict.
    seed: seed of all random numbers; the scenario's by default.
    duration_s: length of the mission in simulated seconds; the scenario's by default.
    gas: gas that the sensors measure; that of the first source by default.
    progress: called several times a second with the simulated time and its end, s; an exception ends the mission.
    record: file (MCAP) that records every message, for ``plumage replay``, ``export`` and others.
    strategy: called every ``search.step_s`` simulated seconds of the search with the situation, a dict; returns the
        next waypoints ``{vehicle: (lat_deg, lon_deg, alt_amsl_m)}``, or None to keep the previous ones. The squadron
        controller keeps vehicles inside the fence and separated. The situation has ``time_s``, ``phase``, ``vehicles`` (the last
        state of each by its id), ``readings`` (since the last call, with ``vehicle`` and ``time_s``) and ``model`` (None before
        the first), each as on the bus (docs/records.md). The waypoints are recorded, so that ``plumage replay --verify``
        flies the same mission without the strategy.

    Raises InputError if the scenario is wrong or fails the check before take-off; doubtful points are warnings.
    """
    changed = scenario_of(scenario).changed(seed=seed, duration_s=duration_s, gas=gas)
    path = None if record is None else os.fspath(record)
    flown = _plumage.run(changed, progress=progress, record=path, strategy=strategy)
    return Mission(flown, os.fspath(changed.folder))


def read_recording(path: str | os.PathLike[str]) -> Mission:
    """Read a mission from a recording (MCAP); if that was cut short, ``notices`` says what is missing."""
    path = os.fspath(path)
    return Mission(_plumage.read_recording(path), os.path.dirname(path))
