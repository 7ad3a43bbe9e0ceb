//! The vehicle's last telemetry, and the state and readings made from it.

use crate::dialect::{
    AIRSPEED_DATA, ATTITUDE_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA,
    HEARTBEAT_DATA, HYGROMETER_SENSOR_DATA, MavLandedState, MavModeFlag, MavState,
    SCALED_PRESSURE_DATA, VFR_HUD_DATA, WIND_COV_DATA, WIND_DATA,
};
use air::geo::{Geodetic, wrap_deg};
use air::isa::{Air, Atmosphere};
use protocol::SimTime;
use protocol::message::{Reading, State, VehicleKind};
use std::collections::VecDeque;

/// Metres in a degree of latitude (mean), to carry a position over a fraction of a second.
const METRES_PER_DEGREE: f64 = 111_195.0;
/// A position older than this is no place of a reading, s.
const POSITION_LASTS_S: f64 = 2.0;
/// A wind, pressure or temperature older than this is left out, s.
const WEATHER_LASTS_S: f64 = 10.0;
/// A landed state older than this is not trusted, s.
const LANDED_LASTS_S: f64 = 5.0;

/// Positions kept for readings that come late: 10 s of them at 10 Hz.
const POSITIONS: usize = 100;
/// A reading that came later than the others of its sensor by this was read before now, s: ticks and links
/// take some hundredths.
const LATE_S: f64 = 0.25;
/// By how much the clocks of vehicle and ground may drift apart, s per s.
const CLOCK_DRIFT: f64 = 1e-4;

/// A message with when it came.
type Received<T> = Option<(SimTime, T)>;

/// The last message of each kind.
#[derive(Debug, Clone)]
pub(crate) struct Telemetry {
    atmosphere: Atmosphere,
    /// Whether MAV_STATE_ACTIVE means that it flies.
    active_flies: bool,
    pub heartbeat: Received<HEARTBEAT_DATA>,
    pub position: Received<GLOBAL_POSITION_INT_DATA>,
    /// The last positions in order of the vehicle's time.
    positions: VecDeque<GLOBAL_POSITION_INT_DATA>,
    /// Mission time less the gas sensor's own where it came soonest, and when, both s.
    gas_clock_s: Option<(f64, f64)>,
    pub attitude: Received<ATTITUDE_DATA>,
    pub hud: Received<VFR_HUD_DATA>,
    pub wind: Received<WIND_DATA>,
    pub pressure: Received<SCALED_PRESSURE_DATA>,
    pub hygrometer: Received<HYGROMETER_SENSOR_DATA>,
    pub airspeed: Received<AIRSPEED_DATA>,
    pub landed: Received<EXTENDED_SYS_STATE_DATA>,
}

fn fresh<T>(received: &Received<T>, now: SimTime, lasts_s: f64) -> Option<&T> {
    received
        .as_ref()
        .filter(|(at, _)| now.since_s(*at) <= lasts_s)
        .map(|(_, message)| message)
}

impl Telemetry {
    pub(crate) fn new(atmosphere: Atmosphere, active_flies: bool) -> Self {
        Self {
            atmosphere,
            active_flies,
            heartbeat: None,
            position: None,
            positions: VecDeque::new(),
            gas_clock_s: None,
            attitude: None,
            hud: None,
            wind: None,
            pressure: None,
            hygrometer: None,
            airspeed: None,
            landed: None,
        }
    }

    /// Equivalent airspeed over true airspeed at `alt_amsl_m`: the square root of density over
    /// that of the standard atmosphere at sea level. Pressure as the vehicle measures it where
    /// it says so, temperature of the site's atmosphere: an autopilot's own thermometer sits in
    /// its warm case.
    pub(crate) fn eas_over_tas(&self, alt_amsl_m: f64, now: SimTime) -> f64 {
        let model = self.atmosphere.at(alt_amsl_m);
        let air = Air {
            pressure_pa: self
                .pressure_hpa(now)
                .map_or(model.pressure_pa, |p| p * 100.0),
            ..model
        };
        air.eas_over_tas()
    }

    fn pressure_hpa(&self, now: SimTime) -> Option<f64> {
        let hpa = f64::from(fresh(&self.pressure, now, WEATHER_LASTS_S)?.press_abs);
        (200.0..1100.0).contains(&hpa).then_some(hpa)
    }

    /// Receives a position; false if it is not newer, by the vehicle's own time, than the last one.
    pub(crate) fn take_position(&mut self, m: GLOBAL_POSITION_INT_DATA, now: SimTime) -> bool {
        let behind = |(_, last): &(SimTime, GLOBAL_POSITION_INT_DATA)| {
            m.time_boot_ms < last.time_boot_ms
                || (m.time_boot_ms == last.time_boot_ms && m == *last && m.time_boot_ms != 0)
        };
        let newer = !self.position.as_ref().is_some_and(behind);
        let at = self
            .positions
            .partition_point(|p| p.time_boot_ms <= m.time_boot_ms);
        self.positions.insert(at, m.clone());
        if self.positions.len() > POSITIONS {
            self.positions.pop_front();
        }
        if newer {
            self.position = Some((now, m));
        }
        newer
    }

    /// Receives a wind velocity.
    pub(crate) fn take_wind(&mut self, m: &WIND_COV_DATA, now: SimTime) {
        self.wind = Some((
            now,
            WIND_DATA {
                direction: (-m.wind_y).atan2(-m.wind_x).to_degrees(),
                speed: m.wind_x.hypot(m.wind_y),
                speed_z: m.wind_z,
            },
        ));
    }

    /// The vehicle has started anew, and its clock with it.
    pub(crate) fn restarted(&mut self) {
        self.positions.clear();
        (self.position, self.attitude, self.gas_clock_s) = (None, None, None);
    }

    /// Air temperature, °C: a hygrometer's, else that of the airspeed sensor, else that of the barometer,
    /// which sits in a warm case.
    fn temperature_c(&self, now: SimTime) -> Option<f64> {
        let hygrometer = fresh(&self.hygrometer, now, WEATHER_LASTS_S).map(|h| h.temperature);
        // i16::MAX means that the sensor has none; ArduPlane sends 0 with a sensor that does not measure it.
        let airspeed = fresh(&self.airspeed, now, WEATHER_LASTS_S).map(|a| a.temperature);
        let barometer = fresh(&self.pressure, now, WEATHER_LASTS_S).map(|p| p.temperature);
        let measured = airspeed.filter(|&c| c != i16::MAX && c != 0);
        let centi = hygrometer.or(measured).or(barometer)?;
        Some(f64::from(centi) / 100.0)
    }

    /// When a reading was read, if it came later than the sensor's others; `time_boot_ms` is by the sensor's clock.
    fn read_at(&mut self, time_boot_ms: u32, now: SimTime) -> Option<SimTime> {
        let own_s = f64::from(time_boot_ms) / 1e3;
        let offset_s = now.s() - own_s;
        let soonest_s = match self.gas_clock_s {
            Some((offset, at_s)) => offset + CLOCK_DRIFT * (now.s() - at_s).max(0.0),
            None => offset_s,
        };
        // A clock that jumps is another one.
        let same_clock = offset_s - soonest_s < f64::from(u16::MAX) / 1e3;
        if offset_s <= soonest_s || !same_clock {
            self.gas_clock_s = Some((offset_s, now.s()));
            return None;
        }
        let late_s = offset_s - soonest_s;
        (late_s > LATE_S).then(|| SimTime::from_s(now.s() - late_s))
    }

    /// Altitude of home above mean sea level, m.
    pub(crate) fn home_amsl_m(&self) -> Option<f64> {
        let (_, position) = self.position.as_ref()?;
        Some(f64::from(position.alt - position.relative_alt) / 1000.0)
    }

    /// Sets whether a heartbeat's status ACTIVE means that it flies.
    pub(crate) fn set_active_flies(&mut self, active_flies: bool) {
        self.active_flies = active_flies;
    }

    /// Altitude above home, m.
    pub(crate) fn above_home_m(&self) -> Option<f64> {
        let (_, position) = self.position.as_ref()?;
        Some(f64::from(position.relative_alt) / 1000.0)
    }

    /// Whether it flies: by EXTENDED_SYS_STATE if it is sent, else by the heartbeat's status
    /// (ArduPlane: ACTIVE in flight, STANDBY on the ground; PX4 is ACTIVE when armed), else by speed and height.
    pub(crate) fn airborne(&self, now: SimTime) -> bool {
        if let Some(state) = fresh(&self.landed, now, LANDED_LASTS_S) {
            match state.landed_state {
                MavLandedState::MAV_LANDED_STATE_ON_GROUND => return false,
                MavLandedState::MAV_LANDED_STATE_IN_AIR
                | MavLandedState::MAV_LANDED_STATE_LANDING => return true,
                MavLandedState::MAV_LANDED_STATE_TAKEOFF => {
                    return self.above_home_m().is_some_and(|h| h > 2.0);
                }
                MavLandedState::MAV_LANDED_STATE_UNDEFINED => {}
            }
        }
        match self.heartbeat.as_ref().map(|(_, h)| h.system_status) {
            Some(MavState::MAV_STATE_ACTIVE) if self.active_flies => true,
            Some(
                MavState::MAV_STATE_ACTIVE
                | MavState::MAV_STATE_CRITICAL
                | MavState::MAV_STATE_EMERGENCY,
            ) => {
                let speed = self.hud.as_ref().map_or(0.0, |(_, h)| h.groundspeed);
                speed > 5.0 && self.above_home_m().is_some_and(|h| h > 5.0)
            }
            _ => false,
        }
    }

    /// Whether the motor may run.
    pub(crate) fn armed(&self) -> bool {
        self.heartbeat.as_ref().is_some_and(|(_, h)| {
            h.base_mode
                .contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED)
        })
    }

    /// The state, once position, attitude and airspeed have all been received and make sense.
    pub(crate) fn state(&self, now: SimTime) -> Option<State> {
        let (_, position) = self.position.as_ref()?;
        let (_, attitude) = self.attitude.as_ref()?;
        let (_, hud) = self.hud.as_ref()?;
        if !plausible(position) {
            return None;
        }
        let alt_amsl_m = f64::from(position.alt) / 1000.0;
        let angles = [attitude.roll, attitude.pitch, attitude.yaw].map(f64::from);
        let equivalent_airspeed_m_s = f64::from(hud.airspeed);
        let finite = angles.iter().all(|a| a.is_finite()) && equivalent_airspeed_m_s.is_finite();
        finite.then(|| State {
            kind: VehicleKind::Real,
            lat_deg: f64::from(position.lat) / 1e7,
            lon_deg: f64::from(position.lon) / 1e7,
            alt_amsl_m,
            vel_ned_m_s: velocity_m_s(position),
            roll_deg: angles[0].to_degrees(),
            pitch_deg: angles[1].to_degrees(),
            heading_deg: wrap_deg(angles[2].to_degrees()),
            airspeed_m_s: equivalent_airspeed_m_s.max(0.0) / self.eas_over_tas(alt_amsl_m, now),
            throttle: (f64::from(hud.throttle) / 100.0).clamp(0.0, 1.0),
            airborne: self.airborne(now),
        })
    }

    /// A reading at the place where the vehicle was when it was taken, by the vehicle's own clock: the position
    /// nearest in time carried on by its velocity over the difference of the two messages' own times.
    /// `time_boot_ms` is none for a sensor without that clock: it was then read when it came.
    pub(crate) fn reading(
        &mut self,
        co2_ppm: f64,
        time_boot_ms: Option<u32>,
        now: SimTime,
    ) -> Option<Reading> {
        let time_ns = time_boot_ms
            .and_then(|t| self.read_at(t, now))
            .map(SimTime::ns);
        let latest = fresh(&self.position, now, POSITION_LASTS_S)?;
        let later_s = |p: &GLOBAL_POSITION_INT_DATA, t: u32| {
            (i64::from(t) - i64::from(p.time_boot_ms)) as f64 / 1e3
        };
        // Of two as near the later one, which carries what is known of the way since.
        let nearest = time_boot_ms.and_then(|t| {
            let all = self.positions.iter().rev().map(|p| (p, later_s(p, t)));
            all.min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
                .filter(|(_, dt_s)| dt_s.abs() <= POSITION_LASTS_S)
        });
        let (position, dt_s) = nearest.unwrap_or((latest, 0.0));
        if !plausible(position) {
            return None;
        }
        let [north, east, down] = velocity_m_s(position);
        let lat_deg = f64::from(position.lat) / 1e7;
        let east_m_per_degree = METRES_PER_DEGREE * lat_deg.to_radians().cos().max(0.01);
        // A wind of exactly 0 counts as no wind: an autopilot without an estimate, such as ArduCopter by default, sends zeros.
        let wind = fresh(&self.wind, now, WEATHER_LASTS_S)
            .filter(|w| w.speed.is_finite() && w.direction.is_finite() && w.speed > 0.0);
        Some(Reading {
            kind: VehicleKind::Real,
            lat_deg: lat_deg + north * dt_s / METRES_PER_DEGREE,
            lon_deg: f64::from(position.lon) / 1e7 + east * dt_s / east_m_per_degree,
            alt_amsl_m: f64::from(position.alt) / 1000.0 - down * dt_s,
            co2_ppm,
            wind_speed_m_s: wind.map(|w| f64::from(w.speed)),
            wind_from_deg: wind.map(|w| wrap_deg(f64::from(w.direction))),
            temperature_c: self.temperature_c(now),
            pressure_hpa: self.pressure_hpa(now),
            time_ns,
        })
    }
}

fn velocity_m_s(position: &GLOBAL_POSITION_INT_DATA) -> [f64; 3] {
    [position.vx, position.vy, position.vz].map(|v| f64::from(v) / 100.0)
}

/// A place in the troposphere over Earth, and not the null island of a receiver without a fix.
fn plausible(position: &GLOBAL_POSITION_INT_DATA) -> bool {
    let on_earth = (-900_000_000..=900_000_000).contains(&position.lat)
        && (-1_800_000_000..=1_800_000_000).contains(&position.lon)
        && (-500_000..=11_000_000).contains(&position.alt);
    on_earth && (position.lat, position.lon) != (0, 0)
}

/// Distance of two places that are near each other, m.
pub(crate) fn distance_m(a: Geodetic, b: Geodetic) -> f64 {
    let east_deg = (b.lon_deg - a.lon_deg) * a.lat_deg.to_radians().cos();
    METRES_PER_DEGREE * (b.lat_deg - a.lat_deg).hypot(east_deg)
}
