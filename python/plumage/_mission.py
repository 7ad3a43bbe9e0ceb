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
    """A mission that was flown, or read from its recording."""

    def __init__(self, flown: _plumage.Flown, folder: str = "") -> None:
        self._flown = flown
        self._folder = folder

    @property
    def digest(self) -> str:
        """SHA-256 over all that the agents said: the same as that of ``plumage run`` whenever the run is the same."""
        return self._flown.digest

    @cached_property
    def summary(self) -> dict[str, Any]:
        """What the mission found, as ``summary.json`` has it."""
        return self._flown.summary()

    @cached_property
    def readings(self) -> Table:
        """What was read: one row a reading, with time (s), vehicle (``platform``), place, ``<gas>_ppm``, wind and motion."""
        return Table(self._flown.readings())

    @cached_property
    def tracks(self) -> Table:
        """How the vehicles moved: one row a state, with place, velocity over ground (m/s) and attitude (degrees)."""
        return Table(self._flown.tracks())

    @cached_property
    def model(self) -> Table:
        """What was known of the plume: one row each time the world simulator said it, with standard deviations (``_sd``)."""
        return Table(self._flown.model())

    @property
    def scenario(self) -> Scenario:
        """The scenario as it was flown, with all defaults."""
        return Scenario.from_text(self._flown.scenario_toml, folder=self._folder)

    @property
    def notices(self) -> list[str]:
        """What is missing of a recording, in words."""
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
    """Flies a mission in this process, as fast as it goes, and gives what came of it.

    Other threads run on meanwhile, and an interrupt (Ctrl-C) ends it with KeyboardInterrupt.

    scenario: a Scenario, its file, or its tables as a dict.
    seed: of every random number, instead of the scenario's.
    duration_s: length of the mission in simulated seconds, instead of the scenario's.
    gas: the gas that is read; that of the first source if not given.
    progress: called some times a second with the simulated time and its end, s; what it raises ends the mission.
    record: file (MCAP) into which every message is recorded, for ``plumage replay``, ``export`` and others.
    strategy: called every ``search.step_s`` simulated seconds of the search with the situation, a dict, and says where
        vehicles shall look: ``{vehicle: (lat_deg, lon_deg, alt_amsl_m)}``, or None for what was said before. The squadron
        controller keeps them inside the fence and apart. The situation has ``time_s``, ``phase``, ``vehicles`` (the last
        state of each by its id), ``readings`` (since the last call, with ``vehicle`` and ``time_s``) and ``model`` (None before
        the first), each as the bus has it (docs/records.md). What is said is recorded, so that ``plumage replay --verify``
        flies the same mission without the strategy.

    Raises InputError where the scenario is wrong or must not take off; what is doubtful is warned of.
    """
    changed = scenario_of(scenario).changed(seed=seed, duration_s=duration_s, gas=gas)
    path = None if record is None else os.fspath(record)
    flown = _plumage.run(changed, progress=progress, record=path, strategy=strategy)
    return Mission(flown, os.fspath(changed.folder))


def read_recording(path: str | os.PathLike[str]) -> Mission:
    """The mission of a recording (MCAP), also of one that was cut short: ``notices`` says what is missing."""
    path = os.fspath(path)
    return Mission(_plumage.read_recording(path), os.path.dirname(path))
