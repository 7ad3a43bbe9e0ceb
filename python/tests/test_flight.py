"""Flight, stepped by hand."""

from __future__ import annotations

import pytest

import plumage


def test_the_wind_carries_what_holds_its_heading():
    flight = plumage.Flight(heading_deg=90.0, alt_amsl_m=400.0, airspeed_m_s=18.0)
    flight.steer(heading_deg=90.0, alt_amsl_m=430.0)
    # Air that moves south at 5 m/s.
    flight.step(120.0, wind_ned_m_s=(-5.0, 0.0, 0.0))
    state = flight.state
    assert flight.time_s == 120.0
    assert state["heading_deg"] == pytest.approx(90.0, abs=1.0)
    assert state["alt_amsl_m"] == pytest.approx(430.0, abs=1.0)
    assert state["vel_north_m_s"] == pytest.approx(-5.0, abs=0.3)
    assert state["vel_east_m_s"] == pytest.approx(state["airspeed_m_s"], abs=0.3)
    assert not state["stalled"] and not state["outside_model"]


def test_without_power_it_comes_down():
    flight = plumage.Flight(plumage.Aircraft())
    for _ in range(500):
        flight.step_surfaces(0.02)
    assert flight.state["throttle"] < 0.01
    assert flight.state["alt_amsl_m"] < 395.0


def test_an_aircraft_is_its_file():
    x8 = plumage.Aircraft()
    again = plumage.Aircraft.from_text(x8.to_toml())
    assert again.to_toml() == x8.to_toml() and again.name == x8.name
    with pytest.raises(plumage.InputError, match="nothing.toml: cannot read the aircraft"):
        plumage.Aircraft("nothing.toml")


def test_wrong_numbers_are_refused():
    flight = plumage.Flight()
    with pytest.raises(plumage.InputError, match="duration_s -1: expected above 0"):
        flight.step(-1.0)
    with pytest.raises(plumage.InputError, match="course_deg NaN: expected a finite number"):
        flight.steer(course_deg=float("nan"))
    with pytest.raises(plumage.InputError, match="expected one of course_deg"):
        flight.steer(course_deg=1.0, heading_deg=2.0)
