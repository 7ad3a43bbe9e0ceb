"""What a model gets wrong, from tables."""

from __future__ import annotations

import json
import os
import pathlib

import numpy as np
import pandas
import pyarrow
import pytest
from conftest import CLONE, STACK, said
from test_plume import excess_ppm

import plumage

MODEL = STACK | {"mission": {"name": "gap"}}


def weaving(lag_s: float, *, gain: float = 1.0) -> pandas.DataFrame:
    """An aircraft that weaves across the plume of the stack, as its formula has it, with a sensor of that lag."""
    rng = np.random.default_rng(5)
    # Twenty steps a second, so that nothing of a lag looks like a late clock.
    fine_s = np.arange(0.0, 900.0, 0.05)
    true_ppm = 420.0 + gain * excess_ppm(np.full_like(fine_s, 1500.0), 400.0 * np.sin(fine_s / 25.0), 300.0)
    read_ppm = true_ppm.copy()
    follow = 1.0 - np.exp(-0.05 / lag_s) if lag_s > 0 else 1.0
    for k in range(1, len(read_ppm)):
        read_ppm[k] = read_ppm[k - 1] + follow * (0.5 * (true_ppm[k] + true_ppm[k - 1]) - read_ppm[k - 1])
    if lag_s == 0:
        read_ppm = true_ppm
    time_s, read_ppm = fine_s[::20], read_ppm[::20]
    north_m = 400.0 * np.sin(time_s / 25.0)
    known = plumage.Scenario.from_dict(MODEL)
    places = [known.to_geodetic(1500.0, north) for north in north_m]
    return pandas.DataFrame(
        {
            "time_s": time_s,
            "platform": "uav",
            "lat_deg": [lat for lat, _ in places],
            "lon_deg": [lon for _, lon in places],
            "alt_amsl_m": 640.0,
            "co2_ppm": read_ppm + rng.normal(0.0, 1.0, len(time_s)),
            "wind_speed_m_s": 7.0,
            "wind_from_deg": 270.0,
        }
    )


def test_a_lag_is_found_in_a_frame_and_nothing_where_there_is_none():
    told = []
    found = plumage.gap_plume(weaving(8.0), MODEL, progress=lambda part, doing: told.append(part))
    assert found["verdict"] == "named"
    assert [cause["mechanisms"] for cause in found["causes"]] == [["sensor-lag"]]
    lag = found["causes"][0]["parameters"][0]
    assert abs(lag["value"] - 8.0) < 3 * lag["sd"] + 0.5
    assert told and told == sorted(told)
    assert 'id = "sensor-lag"' in found.extended.to_toml()
    frame = found.to_pandas()
    assert list(frame.mechanisms) == ["sensor-lag"] and frame.value[0] == lag["value"]
    assert str(found).startswith(found["summary"])
    assert plumage.gap_plume(weaving(0.0), MODEL)["verdict"] == "none"


def test_a_table_is_read_as_its_file_is(command, tmp_path):
    frame = weaving(8.0)
    file, scenario = tmp_path / "obs.csv", tmp_path / "model.toml"
    frame.to_csv(file, index=False)
    scenario.write_text(plumage.Scenario.from_dict(MODEL).to_toml())
    of_frame = plumage.gap_plume(frame, scenario)
    assert of_frame == plumage.gap_plume(pyarrow.Table.from_pandas(frame), scenario)
    assert of_frame == plumage.gap_plume([file], scenario)
    said(command, "gap", "plume", file, "--scenario", scenario, "--out", tmp_path / "out")
    assert of_frame == json.loads((tmp_path / "out" / "gap.json").read_text())
    extended = (tmp_path / "out" / "extended.toml").read_text()
    assert of_frame.extended.to_toml() == plumage.Scenario.from_text(extended).to_toml()
    applied = plumage.gap_plume(frame, scenario, apply=of_frame)
    assert applied["applied"]["says"]


def test_calibration_finds_the_strength(command, tmp_path):
    uncertain = MODEL | {"uncertain": {"source.c_max_ppm": 100.0}}
    frame = weaving(0.0, gain=1.5)
    corrected = plumage.calibrate(frame, uncertain)
    c_max = corrected["c_max_ppm"]
    assert abs(c_max["value"] - 180.0) < 4 * c_max["sd"]
    assert corrected.to_pandas().set_index("name").loc["c_max_ppm", "value"] == c_max["value"]
    assert corrected.scenario.to_dict()["source"][0]["c_max_ppm"] == pytest.approx(c_max["value"])
    file, scenario = tmp_path / "obs.csv", tmp_path / "model.toml"
    frame.to_csv(file, index=False)
    scenario.write_text(plumage.Scenario.from_dict(uncertain).to_toml())
    said(command, "calibrate", file, "--scenario", scenario, "--out", tmp_path / "out")
    assert corrected == json.loads((tmp_path / "out" / "calibration.json").read_text())
    with pytest.raises(plumage.InputError, match="reference nobody: expected one of uav"):
        plumage.calibrate(frame, uncertain, reference="nobody")


def test_what_is_no_table_is_refused():
    with pytest.raises(plumage.InputError, match="observations: int; expected a file, or a table"):
        plumage.gap_plume(5, MODEL)
    with pytest.raises(plumage.InputError, match="co2_ppm"):
        plumage.gap_plume(weaving(0.0).drop(columns="co2_ppm"), MODEL)


@pytest.mark.skipif("PLUMAGE_DATA" not in os.environ, reason="PLUMAGE_DATA is not set")
def test_a_tracer_experiment_is_analysed_as_by_the_command(command, tmp_path):
    data = pathlib.Path(os.environ["PLUMAGE_DATA"]) / "prairie-grass"
    receptors, trials = data / "receptors.csv", data / "trials.csv"
    found = plumage.gap_tracer(pandas.read_csv(receptors, dtype=str), trials)
    said(command, "gap", "tracer", "--receptors", receptors, "--trials", trials, "--out", tmp_path / "out")
    assert found == json.loads((tmp_path / "out" / "gap.json").read_text())
    assert found.extended == (tmp_path / "out" / "extended.toml").read_text()


def test_rates_and_plans_are_frames():
    # Three passes at one height give no curtain: the inversion of the plume integrals stays.
    rates = plumage.flux(weaving(0.0), MODEL)
    frame = rates.to_pandas()
    assert list(frame.columns)[:3] == ["name", "gas", "method"] and len(frame) >= 1
    row = frame.iloc[0]
    assert row["low95_kg_s"] < row["value_kg_s"] < row["high95_kg_s"]
    assert plumage.flux(weaving(0.0), MODEL, method="inversion")["sources"][0]["method"] == "inversion"
    with pytest.raises(plumage.InputError, match="expected auto, curtain"):
        plumage.flux(weaving(0.0), MODEL, method="guess")

    told = []
    short = plumage.Scenario(CLONE / "scenarios" / "as-pontes-steady.toml").changed(duration_s=600.0)
    forecast = plumage.plan(short, missions=2, progress=lambda part, doing: told.append(part))
    assert told == [0.5, 1.0] and forecast["missions"] == 2
    expected = forecast.to_pandas()
    assert list(expected.columns) == ["name", "sd", "error", "unit"] and "axis (towards)" in set(expected["name"])
    with pytest.raises(plumage.InputError, match="expected 1 to 1000"):
        plumage.plan(short, missions=0)
