"""Reality gap, calibration, emission rates and plans."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Union

from . import _plumage
from ._plumage import Aircraft, InputError, Scenario
from ._scenario import ScenarioLike, scenario_of
from ._table import Table

if TYPE_CHECKING:
    import pandas

#: Something measured: a file, a table of pandas or Arrow (or anything with Arrow's PyCapsule interface).
Measured = Union[str, "os.PathLike[str]", Table, Any]
#: Called with the part done, 0 to 1, and what is being done.
Progress = Callable[[float, str], object]


class Finding(dict[str, Any]):
    """Result of a reality-gap analysis: ``gap.json`` and the extended model."""

    #: The scenario (of ``gap_plume``), its tables as TOML (of ``gap_tracer``) or the aircraft (of ``gap_flight``)
    #: with what was found.
    extended: Scenario | Aircraft | str
    #: What was noticed in the data.
    notices: list[str]

    def __str__(self) -> str:
        """Return the answer in words, then what is wrong with the data, a line each."""
        flaws = self.get("data_quality", [])
        return "\n".join([self["summary"], *self.notices, *(flaw["message"] for flaw in flaws)])

    def to_pandas(self) -> pandas.DataFrame:
        """Return the parameters of the causes, a row each, as a pandas DataFrame; needs pandas."""
        import pandas

        rows = [
            {"mechanisms": " or ".join(cause["mechanisms"]), "probability": cause["probability"], **parameter}
            for cause in self["causes"]
            for parameter in cause["parameters"]
        ]
        first = ["mechanisms", "probability", "name", "value", "sd", "unit"]
        return pandas.DataFrame(rows).reindex(columns=first)


class Calibration(dict[str, Any]):
    """Result of a calibration: ``calibration.json`` and the calibrated scenario."""

    #: The corrected scenario, its new uncertainties included.
    scenario: Scenario
    #: What was noticed in the data.
    notices: list[str]

    def to_pandas(self) -> pandas.DataFrame:
        """Return the parameters, a row each, as a pandas DataFrame; needs pandas."""
        import pandas

        known = {name: told for name, told in self.items() if isinstance(told, Mapping) and {"value", "sd"} <= told.keys()}
        rows = [{"name": name, "value": told["value"], "sd": told["sd"]} for name, told in known.items()]
        return pandas.DataFrame(rows, columns=["name", "value", "sd"])


class Flux(dict[str, Any]):
    """Result of an estimate of emission rates: ``flux.json``."""

    #: What was noticed in the data.
    notices: list[str]

    def to_pandas(self) -> pandas.DataFrame:
        """Return the estimates as a pandas DataFrame, the headline of each source first; needs pandas."""
        import pandas

        estimates = [one for source in self["sources"] for one in (source, *source["alternatives"])]
        rows = [
            {key: one[key] for key in ("name", "gas", "method", "upper_limit_kg_s")}
            | {f"{key}_kg_s": value for key, value in (one["kg_s"] or {}).items()}
            for one in estimates
        ]
        rates = ["value_kg_s", "sd_kg_s", "low95_kg_s", "high95_kg_s", "upper_limit_kg_s"]
        return pandas.DataFrame(rows).reindex(columns=["name", "gas", "method", *rates])


class Forecast(dict[str, Any]):
    """Result of a plan: ``plan.json``."""

    def to_pandas(self) -> pandas.DataFrame:
        """Return the expected uncertainties, a row for each number, as a pandas DataFrame; needs pandas."""
        import pandas

        return pandas.DataFrame(self["expected"], columns=["name", "sd", "error", "unit"])


def gap_plume(
    observations: Measured | Sequence[Measured],
    scenario: ScenarioLike,
    *,
    gas: str | None = None,
    apply: Mapping[str, Any] | str | os.PathLike[str] | None = None,
    seed: int = 1,
    progress: Progress | None = None,
) -> Finding:
    """Compare readings along tracks with a scenario's plume model and find causes, like ``plumage gap plume``.

    observations: tables with the columns of docs/gap.md (``time_s``, ``platform``, ``lat_deg``, …), or files
        (CSV, MCAP), one or several.
    apply: result from other readings (``gap.json``, or the result of this function); its causes are scored on these
        readings and not fitted again.
    seed: seed of the bootstrap.
    """
    known = scenario_of(scenario).changed(gas=gas)
    sources = [_source(one, "observations") for one in _listed(observations)]
    told, extended, notices = _plumage.gap_plume(sources, known, _applied(apply), seed, progress)
    return _finding(told, extended, notices)


def gap_tracer(
    receptors: Measured,
    trials: Measured,
    *,
    towers: Measured | None = None,
    apply: Mapping[str, Any] | str | os.PathLike[str] | None = None,
    seed: int = 1,
    progress: Progress | None = None,
) -> Finding:
    """Compare tracer trials with the plume model, like ``plumage gap tracer``; takes tables or files (CSV)."""
    told, extended = _plumage.gap_tracer(
        _source(receptors, "receptors"),
        _source(trials, "trials"),
        None if towers is None else _source(towers, "towers"),
        _applied(apply),
        seed,
        progress,
    )
    return _finding(told, extended, [])


def gap_flight(
    flights: Measured | Sequence[Measured],
    aircraft: Aircraft | str | os.PathLike[str] | None = None,
    *,
    progress: Progress | None = None,
) -> Finding:
    """Compare measured flights with an aircraft model, like ``plumage gap flight``.

    flights: tables or files (CSV), one per flight.
    aircraft: model of the aircraft that flew, or its file; the X8 by default.
    """
    if not isinstance(aircraft, Aircraft):
        aircraft = Aircraft() if aircraft is None else Aircraft(os.fspath(aircraft))
    sources = [_source(one, "flight") for one in _listed(flights)]
    told, extended = _plumage.gap_flight(sources, aircraft, progress)
    return _finding(told, extended, [])


def calibrate(
    observations: Measured | Sequence[Measured],
    scenario: ScenarioLike,
    *,
    gas: str | None = None,
    reference: str | None = None,
) -> Calibration:
    """Calibrate a scenario with readings, like ``plumage calibrate``.

    reference: platform whose sensor is the reference for the others.
    """
    known = scenario_of(scenario).changed(gas=gas)
    sources = [_source(one, "observations") for one in _listed(observations)]
    told, corrected, notices = _plumage.calibrate(sources, known, reference)
    calibration = Calibration(told)
    calibration.scenario, calibration.notices = corrected, notices
    return calibration


def flux(
    observations: Measured | Sequence[Measured],
    scenario: ScenarioLike,
    *,
    gas: str | None = None,
    method: str = "auto",
    tracer: tuple[str, float] | None = None,
) -> Flux:
    """Estimate the emission rate of a scenario's source from readings, like ``plumage flux``.

    method: ``auto``, ``curtain``, ``point``, ``network`` or ``inversion``.
    tracer: gas that is released beside the source and its rate, kg/s; its readings stand in the same tables.
    """
    known = scenario_of(scenario).changed(gas=gas)
    sources = [_source(one, "observations") for one in _listed(observations)]
    told, notices = _plumage.flux(sources, known, method, tracer)
    rates = Flux(told)
    rates.notices = notices
    return rates


def plan(scenario: ScenarioLike, *, missions: int = 6, progress: Progress | None = None) -> Forecast:
    """Predict what a mission would detect, and with what uncertainty, like ``plumage plan``.

    missions: number of realities to draw from ``[uncertain]`` and fly, 1 to 1000.
    """
    if not 1 <= missions <= 1000:
        raise InputError(f"missions {missions}: expected 1 to 1000")
    return Forecast(_plumage.plan(scenario_of(scenario), missions, progress))


def _finding(told: dict[str, Any], extended: Scenario | Aircraft | str, notices: list[str]) -> Finding:
    finding = Finding(told)
    finding.extended, finding.notices = extended, notices
    return finding


def _listed(measured: Measured | Sequence[Measured]) -> Sequence[Measured]:
    return measured if isinstance(measured, (list, tuple)) else [measured]


def _applied(earlier: Mapping[str, Any] | str | os.PathLike[str] | None) -> str | None:
    if earlier is None or isinstance(earlier, Mapping):
        return None if earlier is None else json.dumps(earlier)
    with open(earlier, encoding="utf-8") as file:
        return file.read()


def _source(measured: Measured, name: str) -> str | tuple[str, str]:
    """Return a file as it is, and a table as its name and CSV text, in which every number keeps its value."""
    if isinstance(measured, (str, os.PathLike)):
        return os.fspath(measured)
    if isinstance(measured, Table):
        return name, measured.to_csv()
    if hasattr(measured, "to_csv"):
        return name, measured.to_csv(index=False)
    if not hasattr(measured, "__arrow_c_stream__"):
        raise InputError(
            f"{name}: {type(measured).__name__}; expected a file, or a table of pandas or Arrow"
        )
    import pyarrow
    import pyarrow.csv

    out = io.BytesIO()
    pyarrow.csv.write_csv(pyarrow.table(measured), out)
    return name, out.getvalue().decode()
