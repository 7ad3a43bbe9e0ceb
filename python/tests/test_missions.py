"""Missions: the same as the command's, as tables, interrupted, and read back."""

from __future__ import annotations

import json
import os
import signal
import threading
import time

import numpy as np
import pandas
import pyarrow
import pytest
from conftest import AS_PONTES, STACK, said

import plumage


@pytest.fixture(scope="module")
def mission(tmp_path_factory) -> plumage.Mission:
    path = tmp_path_factory.mktemp("mission") / "mission.mcap"
    mission = plumage.run(AS_PONTES, seed=7, duration_s=120, record=path)
    mission.path = path
    return mission


def test_a_mission_is_the_commands(mission, command, tmp_path):
    out = tmp_path / "out"
    said(command, "run", AS_PONTES, "--seed", 7, "--duration", 120, "--no-serve", "--out", out)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["digest"] == mission.digest
    wall = ("wall_s", "real_time_factor")
    assert {k: v for k, v in mission.summary.items() if k not in wall} == {
        k: v for k, v in summary.items() if k not in wall
    }
    # Its own table of what was read says the same.
    said(command, "export", out / "mission.mcap", "--to", "csv", "--out", tmp_path / "readings.csv")
    pandas.testing.assert_frame_equal(
        pandas.read_csv(tmp_path / "readings.csv", dtype={"platform": str}).drop(columns="time_utc", errors="ignore"),
        mission.readings.to_pandas().drop(columns="time_utc", errors="ignore"),
        check_dtype=False,
        check_exact=True,
    )


def test_another_seed_is_another_mission(mission):
    assert plumage.run(AS_PONTES, seed=8, duration_s=120).digest != mission.digest


def test_a_recording_reads_back(mission):
    read = plumage.read_recording(mission.path)
    assert read.digest == mission.digest
    assert read.notices == []
    for name in ("readings", "tracks", "model"):
        pandas.testing.assert_frame_equal(getattr(read, name).to_pandas(), getattr(mission, name).to_pandas())
    assert read.scenario.to_toml() == mission.scenario.to_toml()


def test_tables_are_those_of_pandas_and_arrow(mission):
    tracks = mission.tracks
    frame, table = tracks.to_pandas(), pyarrow.table(tracks)
    assert len(frame) == table.num_rows == tracks.num_rows > 1000
    assert list(frame.columns) == table.column_names == list(tracks)
    assert set(frame["platform"]) == set(mission.scenario.vehicles)
    # The way by positions is what the summary says, within what it leaves out as jitter (legs below 10 m).
    for vehicle in mission.summary["vehicles"]:
        own = frame[(frame["platform"] == vehicle["id"]) & (frame["airborne"] == 1)]
        flown_m = np.hypot(own["vel_north_m_s"], own["vel_east_m_s"]).mean() * np.ptp(own["time_s"])
        assert flown_m == pytest.approx(vehicle["distance_m"], rel=0.05, abs=30)
    model = pyarrow.table(mission.model)
    assert model.num_rows >= 12
    # What is not known is null.
    assert model["peak_ppm"].null_count == int(np.isnan(mission.model["peak_ppm"]).sum())


def test_progress_is_told_and_others_run_meanwhile():
    told, counted, stop = [], [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    plumage.run(AS_PONTES, duration_s=120, progress=lambda sim_s, of_s: told.append((sim_s, of_s, counted[0])))
    stop.set()
    thread.join()
    times = [sim_s for sim_s, _, _ in told]
    assert times == sorted(times) and times[-1] == 120 and {of_s for _, of_s, _ in told} == {120}
    assert told[-1][2] > told[0][2] > 0


def test_an_interrupt_ends_a_mission():
    # A process that a script starts in the background ignores SIGINT.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    begun = time.monotonic()
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        plumage.run(AS_PONTES, duration_s=1e6)
    assert time.monotonic() - begun < 20


def test_what_progress_raises_ends_a_mission():
    def no_more(sim_s, of_s):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        plumage.run(AS_PONTES, progress=no_more)


def test_a_scenario_is_a_file_a_text_and_tables():
    known = plumage.Scenario.from_dict(STACK)
    assert (known.name, known.seed, known.gas) == ("stack", 3, "co2")
    again = plumage.Scenario.from_text(known.to_toml())
    assert again.to_dict() == known.to_dict() == plumage.Scenario.from_dict(known.to_dict()).to_dict()
    changed = known.changed(seed=9, duration_s=77)
    assert (changed.seed, changed.duration_s, known.seed) == (9, 77, 3)
    east_m, north_m = known.to_local(43.4417, -7.85)
    assert known.to_geodetic(east_m, north_m) == pytest.approx((43.4417, -7.85), abs=1e-9)
    # Length of a degree of longitude there, by WGS84: 80,975 m.
    assert east_m == pytest.approx(0.0131 * 80_975, rel=1e-3)


def test_errors_have_the_commands_words(command, tmp_path):
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("[site]\nlat_deg = \"north\"\n")
    missing = tmp_path / "missing.toml"
    for file in (wrong, missing):
        commands = said(command, "run", file, "--no-serve", code=2).stderr
        with pytest.raises(plumage.InputError) as raised:
            plumage.run(file)
        assert commands.strip().removeprefix("error: ") == str(raised.value)
    # An option of the command is an argument here: the value and its range are the same, the rest is not.
    commands = said(command, "run", AS_PONTES, "--no-serve", "--duration", "0.5", code=2).stderr
    with pytest.raises(plumage.InputError) as raised:
        plumage.run(AS_PONTES, duration_s=0.5)
    for words in (commands, str(raised.value)):
        assert "duration" in words and "0.5" in words and "1 to 1000000" in words
    with pytest.raises(ValueError, match="expected"):
        plumage.run(AS_PONTES, gas="argon")
