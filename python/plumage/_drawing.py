"""Maps of searches as images, for ``render()``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Width and height of a map, pixels.
SIZE = 400
#: Half of its width, and the limits of the allowed ring, m (see :mod:`plumage.gym`).
_ARENA_M, _KEEP_OUT_M = 3000.0, 800.0
_MARGIN_M = 200.0
_PAPER, _OUTSIDE, _KEEP_OUT = (255, 255, 255), (222, 225, 229), (240, 214, 210)
_AXIS, _PEAK, _AIRCRAFT = (120, 150, 200), (20, 90, 40), (20, 20, 20)
#: Colours of readings, as in reports: clean air to the strongest reading that an observation resolves.
_CLEAN, _STRONG = np.array([158.0, 163.0, 170.0]), np.array([190.0, 10.0, 38.0])

Frame = NDArray[np.uint8]


def _pixels(places_m: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return rows and columns of places east and north of the stack, with north up."""
    half_m = _ARENA_M + _MARGIN_M
    column = (places_m[..., 0] + half_m) / (2 * half_m) * (SIZE - 1)
    row = (half_m - places_m[..., 1]) / (2 * half_m) * (SIZE - 1)
    return np.stack([row, column], axis=-1).round().astype(np.int64)


def _mark(frame: Frame, places_m: NDArray[np.float64], colours: Any, half_width: int) -> None:
    """Draw squares of ``2 * half_width + 1`` pixels."""
    at = _pixels(np.asarray(places_m, dtype=np.float64).reshape(-1, 2))
    for row in range(-half_width, half_width + 1):
        for column in range(-half_width, half_width + 1):
            rows, columns = np.clip(at + (row, column), 0, SIZE - 1).T
            frame[rows, columns] = colours


def _ground() -> Frame:
    half_m = _ARENA_M + _MARGIN_M
    axis_m = np.linspace(-half_m, half_m, SIZE)
    far_m = np.hypot(axis_m[:, None], axis_m[None, :])
    frame = np.full((SIZE, SIZE, 3), _PAPER, dtype=np.uint8)
    frame[far_m > _ARENA_M] = _OUTSIDE
    frame[far_m < _KEEP_OUT_M] = _KEEP_OUT
    return frame


class Drawing:
    """Tracks of one search, coloured by readings, on a map with the stack in the middle and north up.

    The line from the stack is downwind by the wind that the team assumes; the green square is the true peak.
    """

    def __init__(self) -> None:
        self._rows: list[NDArray[np.float32]] = []

    def begin(self, observed: NDArray[np.float32]) -> None:
        """Forget the tracks, and start others with the observations of all aircraft."""
        self._rows = [observed.copy()]

    def add(self, observed: NDArray[np.float32]) -> None:
        """Continue the tracks."""
        self._rows.append(observed.copy())

    def frame(self, truth: dict[str, Any]) -> Frame:
        """Return the map as rows of red, green and blue."""
        frame = _ground()
        towards = np.deg2rad(truth["wind_from_deg"] + 180.0)
        along = np.array([np.sin(towards), np.cos(towards)])
        left = np.array([-along[1], along[0]])
        _mark(frame, np.linspace(0.0, _ARENA_M, SIZE)[:, None] * along, _AXIS, 0)
        _mark(frame, np.zeros(2), _AIRCRAFT, 2)
        _mark(frame, np.array([truth["peak_east_m"], truth["peak_north_m"]]), _PEAK, 3)
        if self._rows:
            observed = np.stack(self._rows).astype(np.float64)
            places_m = _ARENA_M * (observed[..., :1] * along + observed[..., 1:2] * left)
            strength = np.clip(observed[..., 8:9], 0.0, 1.0)
            colours = (_CLEAN + strength * (_STRONG - _CLEAN)).astype(np.uint8)
            _mark(frame, places_m, colours.reshape(-1, 3), 1)
            _mark(frame, places_m[-1], _AIRCRAFT, 3)
        return frame
