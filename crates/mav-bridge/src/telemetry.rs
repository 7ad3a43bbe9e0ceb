//! What the vehicle last said of itself, and state and reading made of it.

use crate::dialect::{
    ATTITUDE_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA,
    HYGROMETER_SENSOR_DATA, MavLandedState, MavModeFlag, MavState, SCALED_PRESSURE_DATA,
    VFR_HUD_DATA, WIND_DATA,
};
use air::geo::wrap_deg;
use air::isa::{Air, Atmosphere};
use protocol::SimTime;
use protocol::message::{Reading, State, VehicleKind};

/// Metres in a degree of latitude (mean), to carry a position over a fraction of a second.
const METRES_PER_DEGREE: f64 = 111_195.0;
/// A position older than this is no place of a reading, s.
const POSITION_LASTS_S: f64 = 2.0;
/// A wind, pressure or temperature older than this is left out, s.
const WEATHER_LASTS_S: f64 = 10.0;
/// A landed state older than this is not trusted, s.
const LANDED_LASTS_S: f64 = 5.0;

/// A message with when it came.
type Received<T> = Option<(SimTime, T)>;

/// The last message of each kind.
#[derive(Debug, Clone)]
pub(crate) struct Telemetry {
    atmosphere: Atmosphere,
    pub heartbeat: Received<HEARTBEAT_DATA>,
    pub position: Received<GLOBAL_POSITION_INT_DATA>,
    pub attitude: Received<ATTITUDE_DATA>,
    pub hud: Received<VFR_HUD_DATA>,
    pub wind: Received<WIND_DATA>,
    pub pressure: Received<SCALED_PRESSURE_DATA>,
    pub hygrometer: Received<HYGROMETER_SENSOR_DATA>,
    pub landed: Received<EXTENDED_SYS_STATE_DATA>,
}

fn fresh<T>(received: &Received<T>, now: SimTime, lasts_s: f64) -> Option<&T> {
    received
        .as_ref()
        .filter(|(at, _)| now.since_s(*at) <= lasts_s)
        .map(|(_, message)| message)
}

impl Telemetry {
    pub(crate) fn new(atmosphere: Atmosphere) -> Self {
        Self {
            atmosphere,
            heartbeat: None,
            position: None,
            attitude: None,
            hud: None,
            wind: None,
            pressure: None,
            hygrometer: None,
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
        (air.density_kg_m3() / Atmosphere::standard().at(0.0).density_kg_m3()).sqrt()
    }

    fn pressure_hpa(&self, now: SimTime) -> Option<f64> {
        let hpa = f64::from(fresh(&self.pressure, now, WEATHER_LASTS_S)?.press_abs);
        (200.0..1100.0).contains(&hpa).then_some(hpa)
    }

    /// Altitude above home, m.
    pub(crate) fn above_home_m(&self) -> Option<f64> {
        let (_, position) = self.position.as_ref()?;
        Some(f64::from(position.relative_alt) / 1000.0)
    }

    /// Whether it flies: by EXTENDED_SYS_STATE if it is sent, else by the heartbeat's status
    /// (ArduPlane: ACTIVE in flight, STANDBY on the ground), else by speed and height.
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
            Some(MavState::MAV_STATE_ACTIVE) => true,
            Some(MavState::MAV_STATE_CRITICAL | MavState::MAV_STATE_EMERGENCY) => {
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

    /// A reading at the place where the vehicle was when it was taken, by the vehicle's own clock: the last
    /// position carried on by its velocity over the difference of the two messages' own times.
    pub(crate) fn reading(&self, co2_ppm: f64, time_boot_ms: u32, now: SimTime) -> Option<Reading> {
        let position = fresh(&self.position, now, POSITION_LASTS_S)?;
        if !plausible(position) {
            return None;
        }
        let later_s = (i64::from(time_boot_ms) - i64::from(position.time_boot_ms)) as f64 / 1e3;
        let dt_s = if later_s.abs() <= POSITION_LASTS_S {
            later_s
        } else {
            0.0
        };
        let [north, east, down] = velocity_m_s(position);
        let lat_deg = f64::from(position.lat) / 1e7;
        let east_m_per_degree = METRES_PER_DEGREE * lat_deg.to_radians().cos().max(0.01);
        let wind = fresh(&self.wind, now, WEATHER_LASTS_S)
            .filter(|w| w.speed.is_finite() && w.direction.is_finite() && w.speed >= 0.0);
        Some(Reading {
            kind: VehicleKind::Real,
            lat_deg: lat_deg + north * dt_s / METRES_PER_DEGREE,
            lon_deg: f64::from(position.lon) / 1e7 + east * dt_s / east_m_per_degree,
            alt_amsl_m: f64::from(position.alt) / 1000.0 - down * dt_s,
            co2_ppm,
            wind_speed_m_s: wind.map(|w| f64::from(w.speed)),
            wind_from_deg: wind.map(|w| wrap_deg(f64::from(w.direction))),
            temperature_c: fresh(&self.hygrometer, now, WEATHER_LASTS_S)
                .map(|h| f64::from(h.temperature) / 100.0),
            pressure_hpa: self.pressure_hpa(now),
            time_ns: None,
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
