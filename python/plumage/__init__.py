"""Simulate teams of virtual and real aircraft that map the plume of an air-pollution source.

Quantities carry their unit, frame and datum in their names, as in the files of Plumage: ``alt_amsl_m`` is metres
above mean sea level, ``height_agl_m`` metres above the site's ground, ``wind_from_deg`` the direction from which
the wind blows, ``_ppm`` a mole fraction in parts per million.

>>> import plumage
>>> mission = plumage.run("scenarios/as-pontes.toml", seed=7, duration_s=60)
>>> len(mission.digest)
64
"""

from ._gap import Calibration, Finding, Flux, Forecast, calibrate, flux, gap_flight, gap_plume, gap_tracer, plan
from ._mission import Mission, read_recording, run
from ._plume import Plume
from ._plumage import VERSION as __version__
from ._plumage import Aircraft, Flight, InputError, RunError, Scenario
from ._table import Table

__all__ = [
    "Aircraft",
    "Calibration",
    "Finding",
    "Flight",
    "Flux",
    "Forecast",
    "InputError",
    "Mission",
    "Plume",
    "RunError",
    "Scenario",
    "Table",
    "__version__",
    "calibrate",
    "flux",
    "gap_flight",
    "gap_plume",
    "gap_tracer",
    "plan",
    "read_recording",
    "run",
]
