//! A body that is simulated here: flight dynamics, autopilot and gas sensor.

use crate::VaError;
use crate::agent::Report;
use air::geo::{Enu, Geodetic, LocalFrame, wrap_deg};
use air::isa::Air;
use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
use fdm::{AirAround, Aircraft, FlightSim, FlightState, Phase};
use plume::Sensor;
use plume::effects::Ambient as SensorAir;
use protocol::SimTime;
use protocol::message::{
    Ambient, ControlLevel, EventMessage, Mode, PathKind, Reading, Setpoint, Severity, State,
    VehicleKind,
};
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use scenario::random::stream;

/// Without word from the squadron controller or air from the world for this long, s, the
/// Guardian takes over.
const PATIENCE_S: f64 = 5.0;
/// Time between two ambients, s.
const AMBIENT_S: f64 = 0.1;
/// Height above home at which the Guardian circles, m.
const GUARDIAN_HEIGHT_M: f64 = 120.0;
/// Radius of the Guardian's circle, m.
const GUARDIAN_RADIUS_M: f64 = 120.0;

/// What a simulated vehicle needs to start.
pub struct SimulatedConfig<'a> {
    /// The scenario, checked.
    pub scenario: &'a Scenario,
    /// Index of the vehicle in the scenario's team.
    pub index: usize,
    /// Its aircraft.
    pub aircraft: &'a Aircraft,
}

/// A simulated vehicle.
pub struct SimulatedBody {
    frame: LocalFrame,
    sim: FlightSim,
    autopilot: Autopilot,
    sensor: Sensor,
    rng: ChaCha8Rng,
    home: Enu,
    launch_heading_deg: f64,
    tick_s: f64,
    speed_m_s: f64,
    ambient: Option<(SimTime, Ambient)>,
    /// Wind with gust at the last ambient and the slope towards the newest.
    wind_ned_m_s: [f64; 3],
    setpoint: Option<Setpoint>,
    controller_heard: Option<SimTime>,
    level: ControlLevel,
    last_reading_s: f64,
    /// The take-off of this flight is behind it.
    climbed_out: bool,
}

impl SimulatedBody {
    /// A vehicle on its launcher at home.
    ///
    /// # Errors
    /// A vehicle that the scenario does not have, or an aircraft that cannot fly.
    pub fn new(config: SimulatedConfig<'_>) -> Result<Self, VaError> {
        let SimulatedConfig {
            scenario,
            index,
            aircraft,
        } = config;
        let vehicle = scenario
            .vehicles
            .get(index)
            .ok_or_else(|| VaError::NoSuchVehicle(index.to_string()))?;
        let aircraft = &scenario.extend_aircraft(&vehicle.id, aircraft)?;
        let frame = scenario.frame()?;
        let home = scenario.home(index)?;
        let home = frame.to_enu(Geodetic {
            lat_deg: home.lat_deg,
            lon_deg: home.lon_deg,
        });
        let launch_heading_deg = wrap_deg(scenario.weather.wind_from_deg);
        let spec = scenario.world_spec()?;
        Ok(Self {
            sim: FlightSim::on_ground(
                aircraft,
                home.north_m,
                home.east_m,
                frame.ground_amsl_m,
                launch_heading_deg,
            )?,
            autopilot: Autopilot::new(aircraft),
            sensor: Sensor::new(&spec.sensor, &spec.mechanisms, &vehicle.id),
            rng: stream(scenario.mission.seed, &format!("va/{}/sensor", vehicle.id)),
            frame,
            home,
            launch_heading_deg,
            tick_s: scenario.mission.tick_s,
            speed_m_s: scenario.search.airspeed_m_s,
            ambient: None,
            wind_ned_m_s: [0.0; 3],
            setpoint: None,
            controller_heard: None,
            level: ControlLevel::Automatic,
            last_reading_s: 0.0,
            climbed_out: false,
        })
    }

    /// State of the flight, for displays.
    pub fn flight(&self) -> FlightState {
        self.sim.state()
    }

    pub(crate) fn controller_heard(&mut self, now: SimTime) {
        self.controller_heard = Some(now);
    }

    pub(crate) fn setpoint(&mut self, setpoint: &Setpoint, now: SimTime) {
        let numbers = [
            setpoint.lat_deg,
            setpoint.lon_deg,
            setpoint.alt_amsl_m,
            setpoint.airspeed_m_s,
            setpoint.orbit_radius_m,
        ];
        if numbers.iter().all(|v| v.is_finite()) {
            self.setpoint = Some(setpoint.clone());
        }
        self.controller_heard = Some(now);
    }

    pub(crate) fn ambient(&mut self, ambient: &Ambient, now: SimTime) {
        if self.ambient.is_none() {
            self.wind_ned_m_s = total_wind(ambient);
            self.sim.set_ground_amsl_m(ambient.ground_amsl_m);
        }
        self.ambient = Some((now, ambient.clone()));
    }

    pub(crate) fn tick(&mut self, now: SimTime, due: bool) -> Report {
        let mut report = Report::default();
        self.choose_level(now, &mut report);
        self.fly();
        if due {
            self.report(now, &mut report);
        }
        report
    }

    /// The Guardian flies while the controller or the world is silent.
    fn choose_level(&mut self, now: SimTime, report: &mut Report) {
        let silent = |since: Option<SimTime>| since.is_some_and(|t| now.since_s(t) > PATIENCE_S);
        let no_controller = silent(self.controller_heard);
        let no_world = silent(self.ambient.as_ref().map(|a| a.0));
        let (level, reason) = match (no_controller, no_world) {
            (true, _) => (
                ControlLevel::Guardian,
                "no word from the squadron controller",
            ),
            (_, true) => (ControlLevel::Guardian, "no air from the world simulator"),
            _ => (ControlLevel::Automatic, "follows setpoints"),
        };
        if level != self.level {
            self.level = level;
            report.events.push(EventMessage {
                severity: if level == ControlLevel::Guardian {
                    Severity::Warning
                } else {
                    Severity::Info
                },
                code: "control-level".to_owned(),
                text: reason.to_owned(),
            });
        }
        report.mode = Some(Mode {
            level,
            reason: reason.to_owned(),
            setpoints_obeyed: level == ControlLevel::Automatic,
        });
    }

    /// One tick of flight.
    fn fly(&mut self) {
        let air = self.ambient.as_ref().map(|(_, a)| {
            let air = Air {
                temperature_k: a.temperature_k,
                pressure_pa: a.pressure_pa,
            };
            (total_wind(a), air.density_kg_m3())
        });
        let (target, density_kg_m3) =
            air.unwrap_or((self.wind_ned_m_s, AirAround::STANDARD_CALM.density_kg_m3));
        // Gusts come ten times a second: the wind follows each within that time, without a step.
        let part = (self.tick_s / AMBIENT_S).min(1.0);
        for (wind, target) in self.wind_ned_m_s.iter_mut().zip(target) {
            *wind += part * (target - *wind);
        }
        let around = AirAround {
            wind_ned_m_s: self.wind_ned_m_s,
            density_kg_m3,
        };
        let state = self.sim.state();
        let Some(demand) = self.demand(&state) else {
            return;
        };
        let sensed = Sensed::perfect(&state, density_kg_m3);
        let command = self.autopilot.command(self.tick_s, &sensed, &demand);
        self.sim.step(self.tick_s, &around, &command);
        let taking_off = matches!(demand.path, Path::TakeOff { .. });
        self.climbed_out |= taking_off && self.autopilot.status().path_done;
    }

    /// What the autopilot shall do; nothing while the vehicle waits on its launcher.
    fn demand(&self, state: &FlightState) -> Option<Demand> {
        let waits = state.phase == Phase::OnGround;
        if self.level == ControlLevel::Guardian {
            return (!waits).then_some(Demand {
                path: Path::Orbit {
                    north_m: self.home.north_m,
                    east_m: self.home.east_m,
                    radius_m: GUARDIAN_RADIUS_M,
                    clockwise: true,
                },
                alt_amsl_m: self.frame.ground_amsl_m + GUARDIAN_HEIGHT_M,
                airspeed_m_s: self.speed_m_s,
            });
        }
        let setpoint = self.setpoint.as_ref()?;
        if waits && setpoint.path != PathKind::TakeOff {
            return None;
        }
        let at = Geodetic {
            lat_deg: setpoint.lat_deg,
            lon_deg: setpoint.lon_deg,
        };
        let Enu { east_m, north_m } = self.frame.to_enu(at);
        let path = match setpoint.path {
            PathKind::TakeOff if !self.climbed_out => Path::TakeOff {
                heading_deg: self.launch_heading_deg,
            },
            PathKind::TakeOff | PathKind::GoTo => Path::GoTo { north_m, east_m },
            PathKind::Orbit => Path::Orbit {
                north_m,
                east_m,
                radius_m: setpoint.orbit_radius_m,
                clockwise: true,
            },
            PathKind::Land => Path::Land {
                north_m,
                east_m,
                ground_amsl_m: self
                    .ambient
                    .as_ref()
                    .map_or(self.frame.ground_amsl_m, |a| a.1.ground_amsl_m),
                course_deg: None,
            },
        };
        Some(Demand {
            path,
            alt_amsl_m: setpoint.alt_amsl_m,
            airspeed_m_s: setpoint.airspeed_m_s,
        })
    }

    fn report(&mut self, now: SimTime, report: &mut Report) {
        let flight = self.sim.state();
        let at = self.frame.to_geodetic(Enu {
            east_m: flight.east_m,
            north_m: flight.north_m,
        });
        report.state = Some(State {
            kind: VehicleKind::Simulated,
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
            alt_amsl_m: flight.alt_amsl_m,
            vel_ned_m_s: flight.vel_ned_m_s,
            roll_deg: flight.roll_rad.to_degrees(),
            pitch_deg: flight.pitch_rad.to_degrees(),
            heading_deg: wrap_deg(flight.yaw_rad.to_degrees()),
            airspeed_m_s: flight.airspeed_m_s,
            throttle: flight.throttle,
            airborne: flight.phase == Phase::Flying,
        });
        if let Some((_, ambient)) = &self.ambient {
            let air = SensorAir {
                temperature_c: ambient.temperature_k - air::isa::ZERO_CELSIUS_K,
                pressure_hpa: ambient.pressure_pa / 100.0,
                ..SensorAir::UNKNOWN
            };
            let dt_s = (now.s() - self.last_reading_s).max(0.0);
            self.last_reading_s = now.s();
            let [north, east] = self.autopilot.status().wind_estimate_m_s;
            report.reading = Some(Reading {
                kind: VehicleKind::Simulated,
                lat_deg: at.lat_deg,
                lon_deg: at.lon_deg,
                alt_amsl_m: flight.alt_amsl_m,
                co2_ppm: self
                    .sensor
                    .read_in(ambient.co2_ppm, &air, dt_s, &mut self.rng),
                wind_speed_m_s: Some(east.hypot(north)),
                wind_from_deg: Some(air::wind::from_deg(east, north)),
                temperature_c: Some(air.temperature_c),
                pressure_hpa: Some(air.pressure_hpa),
            });
        }
    }
}

fn total_wind(ambient: &Ambient) -> [f64; 3] {
    std::array::from_fn(|k| ambient.wind_ned_m_s[k] + ambient.gust_ned_m_s[k])
}
