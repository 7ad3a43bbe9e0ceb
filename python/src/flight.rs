//! Aircraft, and flights stepped by hand.

use crate::error::{self, InputError};
use air::isa::Atmosphere;
use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
use fdm::{AirAround, FlightSim, SurfaceCommand};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;
use tasks::measured::AircraftFile;

/// The aircraft that every installation has.
const BUILT_IN: (&str, &str) = ("x8.toml", include_str!("../../aircraft/x8.toml"));

/// An aircraft model from its file; Aircraft() is the Skywalker X8, which is built in.
#[pyclass(frozen, module = "plumage")]
pub(crate) struct Aircraft {
    pub(crate) aircraft: Arc<fdm::Aircraft>,
}

impl Aircraft {
    pub(crate) fn of(aircraft: fdm::Aircraft) -> Self {
        Self {
            aircraft: Arc::new(aircraft),
        }
    }
}

#[pymethods]
impl Aircraft {
    #[new]
    #[pyo3(signature = (path = None))]
    fn new(path: Option<PathBuf>) -> PyResult<Self> {
        let Some(path) = path else {
            return Self::from_text(BUILT_IN.1, BUILT_IN.0);
        };
        let file = AircraftFile::read(&path).map_err(error::of_task)?;
        Ok(Self::of(file.aircraft))
    }

    /// Reads the text of an aircraft file, which is called `name` in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name = "aircraft"))]
    fn from_text(text: &str, name: &str) -> PyResult<Self> {
        let aircraft = fdm::Aircraft::from_toml(name, text).map_err(|e| error::input(&e))?;
        Ok(Self::of(aircraft))
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.aircraft.name
    }

    /// The text of its file.
    fn to_toml(&self) -> PyResult<String> {
        self.aircraft.to_toml().map_err(|e| error::run(&e))
    }

    fn __repr__(&self) -> String {
        format!("Aircraft('{}')", self.aircraft.name)
    }
}

/// One aircraft in flight, stepped by the caller: six degrees of freedom with servos and motor, with or without autopilot.
///
/// It begins in trimmed level flight in still air, `north_m` and `east_m` from the site's origin, at `alt_amsl_m`
/// (m above mean sea level), with its nose to `heading_deg` (degrees from true north) and at `airspeed_m_s`
/// (true airspeed, m/s).
#[pyclass(module = "plumage")]
pub(crate) struct Flight {
    sim: FlightSim,
    autopilot: Autopilot,
    demand: Demand,
    atmosphere: Atmosphere,
    time_s: f64,
}

/// Longest step between two looks of the autopilot, s: it is tuned for 50 a second.
const TICK_S: f64 = 0.02;
/// Longest stretch that is flown at once, s.
const LONGEST_S: f64 = 1e6;

fn finite(name: &str, value: f64) -> PyResult<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(InputError::new_err(format!(
        "{name} {value}: expected a finite number"
    )))
}

#[pymethods]
impl Flight {
    #[new]
    #[pyo3(signature = (aircraft = None, *, north_m = 0.0, east_m = 0.0, alt_amsl_m = 400.0, heading_deg = 0.0, airspeed_m_s = 18.0))]
    fn new(
        aircraft: Option<&Aircraft>,
        north_m: f64,
        east_m: f64,
        alt_amsl_m: f64,
        heading_deg: f64,
        airspeed_m_s: f64,
    ) -> PyResult<Self> {
        for (name, value) in [
            ("north_m", north_m),
            ("east_m", east_m),
            ("alt_amsl_m", alt_amsl_m),
            ("heading_deg", heading_deg),
            ("airspeed_m_s", airspeed_m_s),
        ] {
            finite(name, value)?;
        }
        let own = match aircraft {
            Some(_) => None,
            None => Some(Aircraft::new(None)?),
        };
        let aircraft = aircraft.or(own.as_ref()).map(|a| &a.aircraft);
        let Some(aircraft) = aircraft else {
            return Err(InputError::new_err("expected an aircraft"));
        };
        let sim = FlightSim::airborne(
            aircraft,
            north_m,
            east_m,
            alt_amsl_m,
            heading_deg,
            airspeed_m_s,
        )
        .map_err(|e| error::input(&e))?;
        Ok(Self {
            sim,
            autopilot: Autopilot::new(aircraft),
            demand: Demand {
                path: Path::Course { deg: heading_deg },
                alt_amsl_m,
                airspeed_m_s,
            },
            atmosphere: Atmosphere::standard(),
            time_s: 0.0,
        })
    }

    /// Commands the autopilot; what is not given stays. Takes one of a course over ground (degrees), a heading of the nose
    /// (degrees) and a point `to_m` = (north, east), m, which it circles after arrival.
    #[pyo3(signature = (*, course_deg = None, heading_deg = None, to_m = None, alt_amsl_m = None, airspeed_m_s = None))]
    fn steer(
        &mut self,
        course_deg: Option<f64>,
        heading_deg: Option<f64>,
        to_m: Option<(f64, f64)>,
        alt_amsl_m: Option<f64>,
        airspeed_m_s: Option<f64>,
    ) -> PyResult<()> {
        let mut demand = self.demand;
        demand.path = match (course_deg, heading_deg, to_m) {
            (None, None, None) => demand.path,
            (Some(deg), None, None) => Path::Course {
                deg: finite("course_deg", deg)?,
            },
            (None, Some(deg), None) => Path::Heading {
                deg: finite("heading_deg", deg)?,
            },
            (None, None, Some((north_m, east_m))) => Path::GoTo {
                north_m: finite("to_m", north_m)?,
                east_m: finite("to_m", east_m)?,
            },
            _ => {
                return Err(InputError::new_err(
                    "expected one of course_deg, heading_deg and to_m",
                ));
            }
        };
        if let Some(alt_amsl_m) = alt_amsl_m {
            demand.alt_amsl_m = finite("alt_amsl_m", alt_amsl_m)?;
        }
        if let Some(airspeed_m_s) = airspeed_m_s {
            demand.airspeed_m_s = finite("airspeed_m_s", airspeed_m_s)?;
        }
        self.demand = demand;
        Ok(())
    }

    /// Flies with the autopilot for `duration_s` in air of the standard atmosphere that moves as the vector
    /// `wind_ned_m_s` (north, east, down, m/s, towards).
    #[pyo3(signature = (duration_s, *, wind_ned_m_s = [0.0; 3]))]
    fn step(&mut self, py: Python<'_>, duration_s: f64, wind_ned_m_s: [f64; 3]) -> PyResult<()> {
        if !(duration_s > 0.0 && duration_s <= LONGEST_S) {
            return Err(InputError::new_err(format!(
                "duration_s {duration_s}: expected above 0 and at most {LONGEST_S} s"
            )));
        }
        for part in wind_ned_m_s {
            finite("wind_ned_m_s", part)?;
        }
        let ticks = (duration_s / TICK_S - 1e-9).ceil().max(1.0);
        let dt_s = duration_s / ticks;
        py.detach(|| {
            for _ in 0..ticks as u64 {
                let state = self.sim.state();
                let air = AirAround {
                    wind_ned_m_s,
                    density_kg_m3: self.atmosphere.at(state.alt_amsl_m).density_kg_m3(),
                };
                let sensed = Sensed::perfect(&state, air.density_kg_m3);
                let command = self.autopilot.command(dt_s, &sensed, &self.demand);
                self.sim.step(dt_s, &air, &command);
            }
        });
        self.time_s += duration_s;
        Ok(())
    }

    /// Flies one step of `dt_s` with commands to the surfaces (degrees; elevator trailing edge down positive, aileron
    /// rolls right positive, rudder trailing edge left positive) and the throttle (0 to 1) instead of the autopilot.
    #[pyo3(signature = (dt_s, *, elevator_deg = 0.0, aileron_deg = 0.0, rudder_deg = 0.0, throttle = 0.0, wind_ned_m_s = [0.0; 3]))]
    fn step_surfaces(
        &mut self,
        dt_s: f64,
        elevator_deg: f64,
        aileron_deg: f64,
        rudder_deg: f64,
        throttle: f64,
        wind_ned_m_s: [f64; 3],
    ) -> PyResult<()> {
        if !(dt_s > 0.0 && dt_s <= 1.0) {
            return Err(InputError::new_err(format!(
                "dt_s {dt_s}: expected above 0 and at most 1 s"
            )));
        }
        for part in wind_ned_m_s {
            finite("wind_ned_m_s", part)?;
        }
        let density_kg_m3 = self
            .atmosphere
            .at(self.sim.state().alt_amsl_m)
            .density_kg_m3();
        let air = AirAround {
            wind_ned_m_s,
            density_kg_m3,
        };
        let command = SurfaceCommand {
            elevator_rad: finite("elevator_deg", elevator_deg)?.to_radians(),
            aileron_rad: finite("aileron_deg", aileron_deg)?.to_radians(),
            rudder_rad: finite("rudder_deg", rudder_deg)?.to_radians(),
            throttle: finite("throttle", throttle)?,
            launch: false,
        };
        self.sim.step(dt_s, &air, &command);
        self.time_s += dt_s;
        Ok(())
    }

    /// Time since the start, s.
    #[getter]
    fn time_s(&self) -> f64 {
        self.time_s
    }

    /// State of the aircraft now, with units in the names.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let s = self.sim.state();
        let state = PyDict::new(py);
        for (name, value) in [
            ("north_m", s.north_m),
            ("east_m", s.east_m),
            ("alt_amsl_m", s.alt_amsl_m),
            ("vel_north_m_s", s.vel_ned_m_s[0]),
            ("vel_east_m_s", s.vel_ned_m_s[1]),
            ("vel_down_m_s", s.vel_ned_m_s[2]),
            ("roll_deg", s.roll_rad.to_degrees()),
            ("pitch_deg", s.pitch_rad.to_degrees()),
            ("heading_deg", air::geo::wrap_deg(s.yaw_rad.to_degrees())),
            ("roll_rate_deg_s", s.rate_rad_s[0].to_degrees()),
            ("pitch_rate_deg_s", s.rate_rad_s[1].to_degrees()),
            ("yaw_rate_deg_s", s.rate_rad_s[2].to_degrees()),
            ("airspeed_m_s", s.airspeed_m_s),
            ("alpha_deg", s.alpha_rad.to_degrees()),
            ("beta_deg", s.beta_rad.to_degrees()),
            ("elevator_deg", s.elevator_rad.to_degrees()),
            ("aileron_deg", s.aileron_rad.to_degrees()),
            ("rudder_deg", s.rudder_rad.to_degrees()),
            ("throttle", s.throttle),
        ] {
            state.set_item(name, value)?;
        }
        state.set_item("stalled", s.flags.stalled)?;
        state.set_item("on_ground", s.flags.on_ground)?;
        state.set_item("outside_model", s.flags.outside_model)?;
        Ok(state)
    }
}
