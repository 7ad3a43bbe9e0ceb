//! A vehicle that is simulated here: flight dynamics, autopilot and gas sensor.

use crate::control;
use crate::error::VaError;
use crate::guardian::Guardian;
use crate::report::VehicleReport;
use crate::safety_monitor::ObservedPosition;
use air::geo::{Enu, Geodetic, LocalFrame, wrap_deg};
use air::isa::Air;
use fdm::aircraft::StateOfCharge;
use fdm::autopilot::{Demand, Path, Sensed, Sticks};
use fdm::flightgear::{NetFdm, PACKET_BYTES};
use fdm::{AirAround, Airframe, FlightPhase, FlightState, PilotedFlight};
use plume::Sensor;
use plume::effects::SensorAir;
use protocol::SimTime;
use protocol::control_level::{ControlEvent, ControlOutcome, ControlState, Danger};
use protocol::message::{
    Ambient, ControlLevel, Destination, EventMessage, Mode, PathKind, Reading, Setpoint, Severity,
    State, VehicleKind,
};
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use scenario::random::stream;

/// Time between two ambients, s.
const AMBIENT_S: f64 = 0.1;
/// Share of the battery at which the Guardian brings the vehicle home …
const BATTERY_LOW: f64 = 0.2;
/// … and at which it lands there.
const BATTERY_CRITICAL: f64 = 0.08;
/// Radius of the circle of a vehicle in the air that has no setpoint, m.
const WAITING_RADIUS_M: f64 = 100.0;
/// Silence of the sticks after which the remote control counts as lost, s.
const STICKS_S: f64 = 2.0;
/// Released sticks: level flight at a little more than half power.
const CENTRED: Sticks = Sticks {
    roll: 0.0,
    pitch: 0.0,
    throttle: 0.55,
};

/// Configuration of a simulated vehicle.
pub struct SimulatedConfig<'a> {
    /// The scenario, checked.
    pub scenario: &'a Scenario,
    /// Index of the vehicle in the scenario's team.
    pub index: usize,
    /// Its aircraft.
    pub aircraft: &'a Airframe,
    /// Height of the ground at its home, m above mean sea level.
    pub ground_amsl_m: f64,
    /// Height of its layer, which no neighbour shares, m above mean sea level
    /// ([`Scenario::layers_amsl_m`]).
    pub layer_amsl_m: f64,
}

/// A simulated vehicle.
pub struct SimulatedVehicle {
    frame: LocalFrame,
    craft: PilotedFlight,
    /// Its state after the last step: many ask for it in a tick.
    flight: FlightState,
    sensor: Sensor,
    rng: ChaCha8Rng,
    guardian: Guardian,
    launch_heading_deg: f64,
    tick_s: f64,
    speed_m_s: f64,
    ambient: Option<Ambient>,
    /// Wind with gust at the last ambient and the slope towards the newest.
    wind_ned_m_s: [f64; 3],
    setpoint: Option<Setpoint>,
    control: ControlState,
    /// The control state as last published.
    published: Option<ControlState>,
    /// The pilot's sticks.
    sticks: Sticks,
    /// Time of the last sticks, if they have to be repeated.
    sticks_at: Option<SimTime>,
    /// Destination from the pilot, in place of sticks.
    sent_to: Option<Destination>,
    battery: Option<StateOfCharge>,
    events: Vec<EventMessage>,
    last_reading_s: f64,
    /// The take-off of this flight is complete.
    climbed_out: bool,
}

impl SimulatedVehicle {
    /// A vehicle on its launcher at home, or in level flight where the scenario lets it start in the air.
    ///
    /// # Errors
    /// A vehicle that the scenario does not have, or an aircraft that cannot fly.
    pub fn new(config: SimulatedConfig<'_>) -> Result<Self, VaError> {
        Self::of(config, None)
    }

    /// A vehicle that continues from the `state` of another aircraft, in the air or on the ground.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn taking_over(config: SimulatedConfig<'_>, state: &State) -> Result<Self, VaError> {
        Self::of(config, Some(state))
    }

    fn of(config: SimulatedConfig<'_>, from: Option<&State>) -> Result<Self, VaError> {
        let SimulatedConfig {
            scenario,
            index,
            aircraft,
            ground_amsl_m,
            layer_amsl_m,
        } = config;
        let vehicle = scenario
            .vehicles
            .get(index)
            .ok_or_else(|| VaError::NoSuchVehicle(index.to_string()))?;
        let aircraft = &scenario.extend_aircraft(&vehicle.id, aircraft)?;
        let frame = scenario.frame()?;
        let home = frame.to_enu(scenario.home(index)?);
        let launch_heading_deg = wrap_deg(scenario.weather.wind_from_deg);
        let spec = scenario.dispersion_spec()?;
        let starts_at = vehicle.airborne.as_ref().filter(|_| from.is_none());
        let mut wind_ned_m_s = [0.0; 3];
        if let Some(at) = starts_at {
            wind_ned_m_s = wind_at(scenario, at.alt_amsl_m)?;
        }
        let craft = match (from, starts_at) {
            (Some(state), _) => flown_as(state, aircraft, &frame)?,
            (None, Some(at)) => {
                let place = frame.to_enu(Geodetic::new(at.lat_deg, at.lon_deg));
                PilotedFlight::airborne(
                    aircraft,
                    [place.north_m, place.east_m, at.alt_amsl_m],
                    at.heading_deg,
                    scenario.search.airspeed_m_s,
                    wind_ned_m_s,
                )?
            }
            (None, None) => PilotedFlight::on_ground(
                aircraft,
                home.north_m,
                home.east_m,
                ground_amsl_m,
                launch_heading_deg,
            )?,
        };
        let flight = craft.state();
        Ok(Self {
            climbed_out: flight.phase == FlightPhase::Flying,
            craft,
            flight,
            sensor: Sensor::new(&spec.sensor, &spec.mechanisms, &vehicle.id),
            rng: stream(scenario.mission.seed, &format!("va/{}/sensor", vehicle.id)),
            frame,
            guardian: Guardian::new(scenario, index, layer_amsl_m, aircraft.hovers())?,
            battery: aircraft.battery().map(|b| StateOfCharge::full(&b)),
            launch_heading_deg,
            tick_s: scenario.mission.tick_s,
            speed_m_s: scenario.search.airspeed_m_s,
            ambient: None,
            wind_ned_m_s,
            setpoint: None,
            control: ControlState::new(),
            published: None,
            sticks: CENTRED,
            sticks_at: None,
            sent_to: None,
            events: Vec::new(),
            last_reading_s: 0.0,
        })
    }

    /// State of the flight, for displays.
    pub fn flight(&self) -> FlightState {
        self.flight
    }

    pub(crate) fn net_fdm(&self, unix_time_s: u32) -> [u8; PACKET_BYTES] {
        let flight = &self.flight;
        let at = self.frame.to_geodetic(position_of(flight));
        let density_kg_m3 = self
            .ambient
            .as_ref()
            .map_or(AirAround::STANDARD_CALM.density_kg_m3, density_kg_m3);
        let packet = NetFdm {
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
            ground_amsl_m: self.ground_amsl_m(),
            density_kg_m3,
            unix_time_s,
        };
        packet.encode(flight, self.craft.surfaces())
    }

    /// Remaining share of the battery, 0 to 1; none without a battery.
    pub fn battery_left(&self) -> Option<f64> {
        self.battery.map(|charge| charge.fraction())
    }

    /// Position for the safety monitor.
    pub(crate) fn observed_position(&self) -> ObservedPosition {
        let flight = &self.flight;
        ObservedPosition {
            at: position_of(flight),
            alt_amsl_m: flight.alt_amsl_m,
            airborne: flight.phase == FlightPhase::Flying,
        }
    }

    pub(crate) fn setpoint(&mut self, setpoint: &Setpoint) {
        let numbers = [setpoint.airspeed_m_s, setpoint.orbit_radius_m];
        // A broken setpoint is no setpoint: it neither moves the vehicle nor counts as ignored.
        if numbers.iter().any(|v| !v.is_finite()) {
            return;
        }
        let outcome = self.control.handle(ControlEvent::Setpoint);
        if outcome == ControlOutcome::Followed {
            self.setpoint = Some(setpoint.clone());
        }
        self.events.extend(control::outcome_event(outcome));
    }

    /// Hands control to the operator, by `sticks` if given.
    pub(crate) fn take_over(&mut self, sticks: Option<protocol::message::Sticks>, now: SimTime) {
        self.sticks = sticks.map_or(CENTRED, |s| {
            let within = |v: f64, low: f64| {
                if v.is_finite() {
                    v.clamp(low, 1.0)
                } else {
                    0.0
                }
            };
            Sticks {
                roll: within(s.roll, -1.0),
                pitch: within(s.pitch, -1.0),
                throttle: within(s.throttle, 0.0),
            }
        });
        self.sticks_at = sticks.map(|_| now);
        self.sent_to = None;
        self.handle_control(ControlEvent::Takeover);
    }

    /// Sends it to a place, if the operator has taken it over ([`Self::is_piloted`]).
    pub(crate) fn send_to(&mut self, place: &Destination) {
        self.sent_to = Some(*place);
        self.sticks_at = None;
    }

    /// Whether an operator has taken it over.
    pub(crate) fn is_piloted(&self) -> bool {
        self.control.level() == ControlLevel::Pilot
    }

    /// Whether the control level is automatic.
    pub(crate) fn follows_setpoints(&self) -> bool {
        self.control.level() == ControlLevel::Automatic
    }

    /// Applies an event to the control level.
    pub(crate) fn handle_control(&mut self, event: ControlEvent) {
        let before = self.control.level();
        let outcome = self.control.handle(event);
        self.events.extend(control::outcome_event(outcome));
        let level = self.control.level();
        if (event, outcome) == (ControlEvent::HandBack, ControlOutcome::Taken) {
            self.events.push(control::hand_back_event(before, level));
        }
        if level == before {
            return;
        }
        if level == ControlLevel::Automatic {
            // Earlier setpoints may be out of date.
            self.setpoint = None;
        }
        if level != ControlLevel::Pilot {
            self.sticks_at = None;
            self.sent_to = None;
        }
        let severity = match level {
            ControlLevel::Automatic => Severity::Info,
            _ => Severity::Warning,
        };
        let text = format!("{level:?}: {}", self.mode().reason);
        self.events
            .push(EventMessage::new(severity, "control-level", text));
    }

    /// Returns to automatic flight after a silence, if the vehicle is in the air and no pilot has taken it over.
    pub(crate) fn resume(&mut self) {
        if self.control.resumes() && self.flight.phase == FlightPhase::Flying {
            self.events.push(control::resumed_event());
            self.handle_control(ControlEvent::HandBack);
        }
    }

    pub(crate) fn ambient(&mut self, ambient: &Ambient) {
        if self.ambient.is_none() {
            self.wind_ned_m_s = total_wind(ambient);
        }
        self.craft.set_ground_amsl_m(ambient.ground_amsl_m);
        self.ambient = Some(ambient.clone());
    }

    pub(crate) fn tick(&mut self, now: SimTime, due: bool) -> VehicleReport {
        if self.sticks_at.is_some_and(|at| now.since_s(at) > STICKS_S) {
            self.sticks_at = None;
            self.handle_control(ControlEvent::RemoteLost);
        }
        // Touch-down shows as the change of phase over this tick.
        let flew = self.flight.phase != FlightPhase::OnGround;
        self.fly();
        if flew && self.flight.phase == FlightPhase::OnGround {
            self.handle_control(ControlEvent::Landed);
        }
        let mut report = VehicleReport {
            mode: (self.published != Some(self.control)).then(|| self.mode()),
            events: std::mem::take(&mut self.events),
            ..VehicleReport::default()
        };
        self.published = Some(self.control);
        if due {
            self.report(now, &mut report);
        }
        report
    }

    fn mode(&self) -> Mode {
        let doing = match self.control.level() {
            ControlLevel::Automatic => "follows setpoints",
            ControlLevel::Pilot => "the pilot flies it until an explicit hand-back",
            ControlLevel::Guardian => "flies home and circles there",
        };
        control::mode(&self.control, doing)
    }

    /// One tick of flight.
    fn fly(&mut self) {
        let air = self
            .ambient
            .as_ref()
            .map(|a| (total_wind(a), density_kg_m3(a)));
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
        let state = self.flight;
        // The team's own vehicles are simulated without navigation errors; those belong to the
        // stand-in's reality.
        let sensed = Sensed::perfect(&state, density_kg_m3);
        if self.control.level() == ControlLevel::Pilot {
            if state.phase == FlightPhase::OnGround {
                return;
            }
            match self.pilots_demand() {
                Some(demand) => self.craft.fly(self.tick_s, &around, &sensed, &demand),
                None => self
                    .craft
                    .fly_by_wire(self.tick_s, &around, &sensed, &self.sticks),
            }
        } else {
            let Some(demand) = self.demand(&state) else {
                return;
            };
            self.craft.fly(self.tick_s, &around, &sensed, &demand);
            let taking_off = matches!(demand.path, Path::TakeOff { .. });
            self.climbed_out |= taking_off && self.craft.status().path_done;
        }
        self.flight = self.craft.state();
        self.discharge_battery(&state, density_kg_m3);
    }

    fn discharge_battery(&mut self, state: &FlightState, density_kg_m3: f64) {
        let Some(charge) = &mut self.battery else {
            return;
        };
        let power_w = self.craft.power_w(state, density_kg_m3);
        charge.draw(power_w, self.tick_s);
        let low = charge.fraction() < BATTERY_LOW && state.phase == FlightPhase::Flying;
        if low && !self.control.has(Danger::Battery) {
            self.handle_control(ControlEvent::Begins(Danger::Battery));
        }
    }

    /// The autopilot's demand under a pilot; none while sticks fly.
    fn pilots_demand(&self) -> Option<Demand> {
        let place = self.sent_to?;
        let Enu { east_m, north_m } = self
            .frame
            .to_enu(Geodetic::new(place.lat_deg, place.lon_deg));
        Some(Demand {
            path: Path::GoTo { north_m, east_m },
            alt_amsl_m: place.alt_amsl_m,
            airspeed_m_s: self.speed_m_s,
        })
    }

    /// The autopilot's demand; none while the vehicle waits on its launcher.
    fn demand(&mut self, state: &FlightState) -> Option<Demand> {
        let waits = state.phase == FlightPhase::OnGround;
        if self.control.level() == ControlLevel::Guardian {
            return (!waits).then(|| self.guardian_demand(state));
        }
        if waits && self.setpoint.as_ref()?.path != PathKind::TakeOff {
            return None;
        }
        if self.setpoint.is_none() {
            // After a hand-back in the air it circles at its position until the next setpoint, or stops there.
            let path = if self.craft.hovers() {
                PathKind::GoTo
            } else {
                PathKind::Orbit
            };
            self.setpoint = Some(hold_at(&self.frame, state, path, self.speed_m_s));
        }
        let setpoint = self.setpoint.as_ref()?;
        let path = match setpoint.path {
            PathKind::TakeOff if !self.climbed_out => Path::TakeOff {
                heading_deg: self.launch_heading_deg,
            },
            PathKind::Land => self.land_at(place_of(setpoint, &self.frame)),
            _ => path_of(setpoint, &self.frame),
        };
        Some(Demand {
            path,
            alt_amsl_m: setpoint.alt_amsl_m,
            airspeed_m_s: setpoint.airspeed_m_s,
        })
    }

    /// The Guardian's demand: climb out, then fly home; land with an almost empty battery or after touch-down.
    fn guardian_demand(&self, state: &FlightState) -> Demand {
        let empty = self
            .battery_left()
            .is_some_and(|left| left < BATTERY_CRITICAL);
        let path = if !self.climbed_out {
            Path::TakeOff {
                heading_deg: self.launch_heading_deg,
            }
        } else if empty || state.phase == FlightPhase::Sliding {
            self.land_at(self.guardian.home())
        } else {
            self.guardian.path(position_of(state))
        };
        Demand {
            path,
            alt_amsl_m: self.guardian.alt_amsl_m(self.ground_amsl_m()),
            airspeed_m_s: self.speed_m_s,
        }
    }

    fn land_at(&self, at: Enu) -> Path {
        Path::Land {
            north_m: at.north_m,
            east_m: at.east_m,
            ground_amsl_m: self.ground_amsl_m(),
            course_deg: None,
        }
    }

    /// Height of the ground below, if known.
    fn ground_amsl_m(&self) -> f64 {
        self.ambient
            .as_ref()
            .map_or(self.frame.ground_amsl_m, |a| a.ground_amsl_m)
    }

    fn report(&mut self, now: SimTime, report: &mut VehicleReport) {
        let flight = &self.flight;
        let at = self
            .frame
            .to_geodetic(Enu::new(flight.east_m, flight.north_m));
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
            airborne: flight.phase == FlightPhase::Flying,
        });
        if let Some(ambient) = &self.ambient {
            let air = SensorAir {
                temperature_c: ambient.temperature_k - air::isa::ZERO_CELSIUS_K,
                pressure_hpa: ambient.pressure_pa / 100.0,
                ..SensorAir::UNKNOWN
            };
            // The sensor's lag needs the time since its own last reading, not the tick.
            let dt_s = (now.s() - self.last_reading_s).max(0.0);
            self.last_reading_s = now.s();
            let [north, east] = self.craft.status().wind_estimate_m_s;
            report.readings.push(Reading {
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
                time_ns: None,
            });
        }
    }
}

/// The scenario's wind at a height, north, east, down, m/s.
fn wind_at(scenario: &Scenario, alt_amsl_m: f64) -> Result<[f64; 3], VaError> {
    let height_agl_m = (alt_amsl_m - scenario.site.ground_amsl_m).max(0.0);
    let wind = scenario.wind_profile()?.at(height_agl_m);
    Ok([wind.north_m_s, wind.east_m_s, 0.0])
}

/// The initial flight state of an aircraft that replaces another in `state`.
fn flown_as(
    state: &State,
    aircraft: &Airframe,
    frame: &LocalFrame,
) -> Result<PilotedFlight, VaError> {
    let at = frame.to_enu(Geodetic::new(state.lat_deg, state.lon_deg));
    let (north_m, east_m, heading_deg) = (at.north_m, at.east_m, state.heading_deg);
    if !state.airborne {
        let ground_amsl_m = state.alt_amsl_m - aircraft.rest_height_m();
        return Ok(PilotedFlight::on_ground(
            aircraft,
            north_m,
            east_m,
            ground_amsl_m,
            heading_deg,
        )?);
    }
    let mut craft = PilotedFlight::airborne(
        aircraft,
        [north_m, east_m, state.alt_amsl_m],
        heading_deg,
        state.airspeed_m_s,
        [0.0; 3],
    )?;
    let [roll, pitch, yaw] = [state.roll_deg, state.pitch_deg, heading_deg].map(f64::to_radians);
    craft.set_motion(
        state.vel_ned_m_s,
        fdm::quaternion(roll, pitch, yaw),
        [0.0; 3],
    );
    Ok(craft)
}

fn density_kg_m3(ambient: &Ambient) -> f64 {
    let air = Air {
        temperature_k: ambient.temperature_k,
        pressure_pa: ambient.pressure_pa,
    };
    air.density_kg_m3()
}

fn position_of(state: &FlightState) -> Enu {
    Enu::new(state.east_m, state.north_m)
}

/// A setpoint at a vehicle's position.
fn hold_at(frame: &LocalFrame, state: &FlightState, path: PathKind, airspeed_m_s: f64) -> Setpoint {
    let Geodetic { lat_deg, lon_deg } = frame.to_geodetic(position_of(state));
    Setpoint {
        path,
        lat_deg,
        lon_deg,
        alt_amsl_m: state.alt_amsl_m,
        airspeed_m_s,
        orbit_radius_m: WAITING_RADIUS_M,
    }
}

fn place_of(setpoint: &Setpoint, frame: &LocalFrame) -> Enu {
    frame.to_enu(Geodetic::new(setpoint.lat_deg, setpoint.lon_deg))
}

/// The flight path to a setpoint.
pub(crate) fn path_of(setpoint: &Setpoint, frame: &LocalFrame) -> Path {
    let Enu { east_m, north_m } = place_of(setpoint, frame);
    match setpoint.path {
        PathKind::Orbit => Path::Orbit {
            north_m,
            east_m,
            radius_m: setpoint.orbit_radius_m,
            clockwise: true,
        },
        _ => Path::GoTo { north_m, east_m },
    }
}

fn total_wind(ambient: &Ambient) -> [f64; 3] {
    std::array::from_fn(|k| ambient.wind_ned_m_s[k] + ambient.gust_ned_m_s[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");
    const X8: &str = include_str!("../../../aircraft/x8.toml");

    /// The first published state of a vehicle that replaces one in `state`.
    fn first(state: &State) -> State {
        let scenario = Scenario::parse("as-pontes.toml", AS_PONTES).unwrap();
        let aircraft = Airframe::from_toml("x8.toml", X8).unwrap();
        let config = SimulatedConfig {
            scenario: &scenario,
            index: 2,
            aircraft: &aircraft,
            ground_amsl_m: scenario.site.ground_amsl_m,
            layer_amsl_m: scenario.layers_amsl_m()[2],
        };
        let mut vehicle = SimulatedVehicle::taking_over(config, state).unwrap();
        vehicle.tick(SimTime::from_s(700.0), true).state.unwrap()
    }

    #[test]
    fn one_that_takes_over_goes_on_where_the_other_was() {
        let flying = State {
            kind: VehicleKind::Real,
            lat_deg: 43.4432,
            lon_deg: -7.8511,
            alt_amsl_m: 802.0,
            vel_ned_m_s: [5.0, 19.0, -1.0],
            roll_deg: 12.0,
            pitch_deg: 4.0,
            heading_deg: 80.0,
            airspeed_m_s: 18.0,
            throttle: 0.5,
            airborne: true,
        };
        let next = first(&flying);
        // A tick later: .02 s at 20 m/s.
        assert!((next.lat_deg - flying.lat_deg).abs() < 1e-5);
        assert!((next.lon_deg - flying.lon_deg).abs() < 1e-5);
        assert!((next.alt_amsl_m - flying.alt_amsl_m).abs() < 0.1);
        assert!((next.roll_deg - flying.roll_deg).abs() < 2.0);
        assert!((next.heading_deg - flying.heading_deg).abs() < 1.0);
        let off = |k: usize| next.vel_ned_m_s[k] - flying.vel_ned_m_s[k];
        assert!(off(0).hypot(off(1)).hypot(off(2)) < 0.5, "{next:?}");
        assert!(next.airborne && next.kind == VehicleKind::Simulated);

        let standing = State {
            alt_amsl_m: 341.0,
            vel_ned_m_s: [0.0; 3],
            airborne: false,
            ..flying
        };
        let next = first(&standing);
        assert!(
            !next.airborne && (next.alt_amsl_m - 341.0).abs() < 0.01,
            "{next:?}"
        );
    }
}
