"""What the tests share: the clone's files, and the command to compare with."""

from __future__ import annotations

import os
import pathlib
import subprocess

import pytest

CLONE = pathlib.Path(__file__).resolve().parents[2]
AS_PONTES = CLONE / "scenarios" / "as-pontes.toml"

#: A stack in a steady west wind, of which class D in open country has the spread in closed form (Briggs 1973).
STACK = {
    "mission": {"name": "stack", "seed": 3},
    "site": {"lat_deg": 43.4417, "lon_deg": -7.8631, "ground_amsl_m": 340.0},
    "weather": {
        "wind_speed_m_s": 7.0,
        "wind_height_agl_m": 300.0,
        "wind_from_deg": 270.0,
        "stability": "D",
        "setting": "rural",
    },
    "source": [
        {
            "lat_deg": 43.4417,
            "lon_deg": -7.8631,
            "stack_height_m": 200.0,
            "effective_height_m": 300.0,
            "c_max_ppm": 120.0,
            "c_max_distance_m": 1000.0,
        }
    ],
    "background": {"co2_ppm": 420.0},
    "sensor": {"noise_sd_ppm": 1.0, "time_constant_s": 0.0},
    "plume": {"ground_reflection": False},
}


@pytest.fixture(scope="session")
def command() -> str:
    """The program `plumage`, built from the same source."""
    target = os.environ.get("CARGO_TARGET_DIR", CLONE / "target")
    program = pathlib.Path(os.environ.get("PLUMAGE_COMMAND", pathlib.Path(target) / "release" / "plumage"))
    if not program.is_file():
        pytest.skip(f"no {program}: cargo build --release builds it")
    return str(program)


def said(command: str, *arguments: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    """What the command says, which must end with `code`."""
    done = subprocess.run(
        [command, *map(str, arguments)], cwd=CLONE, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == code, done.stderr
    return done
