"""Mean plume on arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _plumage
from ._plumage import InputError
from ._scenario import ScenarioLike, scenario_of


class Plume:
    """Mean concentration of a scenario's gas: the plumes of all sources plus the background.

    scenario: a Scenario, its file, or its tables as a dict.
    reality: use the stand-ins' world (``[reality]``), not the scenario's model.
    """

    def __init__(self, scenario: ScenarioLike, *, reality: bool = False) -> None:
        known = scenario_of(scenario)
        self._plume = _plumage.Plume(known.reality() if reality else known)

    def ppm(
        self,
        east_m: ArrayLike,
        north_m: ArrayLike,
        height_agl_m: ArrayLike,
        *,
        time_s: float = 0.0,
        out: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the mole fraction at places, ppm, including the background; arrays are broadcast.

        east_m, north_m: metres from the site's origin.
        height_agl_m: metres above the site's ground.
        time_s: mission time, s.
        out: array for the result, float64, contiguous, of the result's shape.
        """
        columns = np.broadcast_arrays(
            *(np.asarray(a, dtype=np.float64) for a in (east_m, north_m, height_agl_m))
        )
        shape = columns[0].shape
        if out is None:
            out = np.empty(shape)
        elif out.shape != shape or out.dtype != np.float64 or not out.flags.c_contiguous:
            raise InputError(
                f"out: {out.dtype} of shape {out.shape}; expected a contiguous float64 array of shape {shape}"
            )
        east, north, height = (np.ascontiguousarray(c).reshape(-1) for c in columns)
        self._plume.fill_ppm(east, north, height, time_s, out.reshape(-1))
        return out

    def ppm_at(
        self,
        lat_deg: ArrayLike,
        lon_deg: ArrayLike,
        alt_amsl_m: ArrayLike,
        *,
        time_s: float = 0.0,
    ) -> NDArray[np.float64]:
        """Return the mole fraction at latitudes and longitudes (degrees, WGS84) and altitudes (m above mean sea level)."""
        lat, lon, alt = np.broadcast_arrays(
            *(np.asarray(a, dtype=np.float64) for a in (lat_deg, lon_deg, alt_amsl_m))
        )
        flat = (np.ascontiguousarray(c).reshape(-1) for c in (lat, lon))
        east_m, north_m = (c.reshape(lat.shape) for c in self._plume.local(*flat))
        return self.ppm(east_m, north_m, alt - self._plume.ground_amsl_m, time_s=time_s)

    @property
    def notices(self) -> list[str]:
        """Notices about the model, such as a calm."""
        return self._plume.notices
