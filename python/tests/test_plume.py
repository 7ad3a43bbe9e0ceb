"""The plume on arrays, against its formula in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import STACK

import plumage


def excess_ppm(east_m, north_m, height_agl_m):
    """The stack of conftest by its formula: Briggs' curves of class D in open country, wind from the west."""
    x = np.maximum(east_m, 1.0)
    sigma_y = lambda x: 0.08 * x / np.sqrt(1 + 0.0001 * x)
    sigma_z = lambda x: 0.06 * x / np.sqrt(1 + 0.0015 * x)
    axis = 120.0 * sigma_y(1000.0) * sigma_z(1000.0) / (sigma_y(x) * sigma_z(x))
    shape = np.exp(-0.5 * (north_m / sigma_y(x)) ** 2 - 0.5 * ((height_agl_m - 300.0) / sigma_z(x)) ** 2)
    return np.where(east_m < 1.0, 0.0, axis * shape)


def test_the_plume_is_its_formula():
    rng = np.random.default_rng(1)
    east_m = rng.uniform(-500, 6000, 10_000)
    north_m = rng.uniform(-800, 800, 10_000)
    height_agl_m = rng.uniform(0, 700, 10_000)
    ppm = plumage.Plume(STACK).ppm(east_m, north_m, height_agl_m)
    np.testing.assert_allclose(ppm - 420.0, excess_ppm(east_m, north_m, height_agl_m), rtol=1e-6, atol=1e-7)


def test_arrays_are_broadcast_and_filled():
    plume = plumage.Plume(STACK)
    east_m, north_m = np.meshgrid(np.linspace(100, 3000, 30), np.linspace(-300, 300, 20))
    ppm = plume.ppm(east_m, north_m, 300.0)
    assert ppm.shape == (20, 30)
    np.testing.assert_allclose(ppm - 420.0, excess_ppm(east_m, north_m, 300.0), rtol=1e-6, atol=1e-7)
    out = np.empty((20, 30))
    assert plume.ppm(east_m, north_m, 300.0, out=out) is out
    np.testing.assert_array_equal(out, ppm)
    np.testing.assert_array_equal(plume.ppm(east_m.T, north_m.T, 300.0), ppm.T)
    assert plume.ppm(1000, 0, 300) == pytest.approx(540.0)
    for wrong in (np.empty((30, 20)), np.empty((20, 30), np.float32), np.empty((40, 30))[::2]):
        with pytest.raises(plumage.InputError, match="out: .*expected a contiguous float64"):
            plume.ppm(east_m, north_m, 300.0, out=wrong)


def test_places_may_be_geodetic():
    known = plumage.Scenario.from_dict(STACK)
    lat_deg, lon_deg = known.to_geodetic(1500.0, 40.0)
    ppm = plumage.Plume(known).ppm_at([lat_deg], [lon_deg], 640.0)
    assert ppm[0] - 420.0 == pytest.approx(excess_ppm(1500.0, 40.0, 300.0), rel=1e-5)


def test_the_reality_is_another_plume():
    tables = STACK | {"reality": {"weather": {"wind_from_deg": 180.0}}}
    plume, reality = plumage.Plume(tables), plumage.Plume(tables, reality=True)
    assert reality.ppm(0, 1000, 300) == pytest.approx(plume.ppm(1000, 0, 300))
    assert plume.ppm(0, 1000, 300) == pytest.approx(420.0)
