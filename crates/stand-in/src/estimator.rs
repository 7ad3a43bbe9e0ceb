//! The state estimate of the stand-in's own autopilot: the truth and slow errors of satellite
//! navigation, barometer and wind estimate, of the size that ArduPlane's filter shows in flight.

use fdm::FlightState;
use fdm::autopilot::Sensed;
use fdm::multirotor::Navigation;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Time over which errors of position and wind change, s.
const POSITION_ERROR_TIME_S: f64 = 60.0;
const WIND_ERROR_TIME_S: f64 = 90.0;
/// Time over which the wind estimate follows the wind, s.
const WIND_FOLLOWS_S: f64 = 8.0;
/// Standard deviations of velocity, airspeed and wind, m/s.
const VELOCITY_SD_M_S: f64 = 0.05;
const AIRSPEED_SD_M_S: f64 = 0.15;
const WIND_SD_M_S: f64 = 0.4;

/// Errors that drift slowly, and the wind as estimated.
#[derive(Debug, Clone)]
pub(crate) struct Estimator {
    /// Standard deviation of each component of position, m.
    position_sd_m: [f64; 3],
    position_error_m: [f64; 3],
    velocity_error_m_s: [f64; 3],
    airspeed_error_m_s: f64,
    wind_error_m_s: [f64; 2],
    wind_m_s: Option<[f64; 2]>,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// One exact step of an Ornstein-Uhlenbeck process.
fn ornstein_uhlenbeck(value: f64, sd: f64, dt_s: f64, time_s: f64, rng: &mut ChaCha8Rng) -> f64 {
    // Exact for any step, with a variance that does not depend on it: a longer tick gives the same
    // errors in the mean.
    let decay = (-dt_s / time_s).exp();
    decay * value + sd * (1.0 - decay * decay).sqrt() * normal(rng)
}

impl Estimator {
    pub(crate) fn new(navigation: Navigation, rng: &mut ChaCha8Rng) -> Self {
        let position_sd_m = [
            navigation.horizontal_sd_m,
            navigation.horizontal_sd_m,
            navigation.vertical_sd_m,
        ];
        Self {
            position_error_m: position_sd_m.map(|sd| sd * normal(rng)),
            position_sd_m,
            velocity_error_m_s: [0.0; 3],
            airspeed_error_m_s: 0.0,
            wind_error_m_s: [WIND_SD_M_S * normal(rng), WIND_SD_M_S * normal(rng)],
            wind_m_s: None,
        }
    }

    /// Lets the errors drift for `dt_s`; the wind is estimated in flight only.
    pub(crate) fn step(
        &mut self,
        dt_s: f64,
        wind_ned_m_s: [f64; 3],
        flying: bool,
        rng: &mut ChaCha8Rng,
    ) {
        for (error, sd) in self.position_error_m.iter_mut().zip(self.position_sd_m) {
            *error = ornstein_uhlenbeck(*error, sd, dt_s, POSITION_ERROR_TIME_S, rng);
        }
        // Velocity and airspeed are measured anew each time: white, unlike position and wind.
        for error in &mut self.velocity_error_m_s {
            *error = VELOCITY_SD_M_S * normal(rng);
        }
        self.airspeed_error_m_s = AIRSPEED_SD_M_S * normal(rng);
        for error in &mut self.wind_error_m_s {
            *error = ornstein_uhlenbeck(*error, WIND_SD_M_S, dt_s, WIND_ERROR_TIME_S, rng);
        }
        if flying {
            // The estimate follows the true wind with the lag of a filter.
            let now = [wind_ned_m_s[0], wind_ned_m_s[1]];
            let follow = 1.0 - (-dt_s / WIND_FOLLOWS_S).exp();
            let before = self.wind_m_s.unwrap_or(now);
            self.wind_m_s = Some([0, 1].map(|k| before[k] + follow * (now[k] - before[k])));
        }
    }

    /// What the autopilot senses when the truth is `state`.
    pub(crate) fn sensed(&self, state: &FlightState, density_kg_m3: f64) -> Sensed {
        let truth = Sensed::perfect(state, density_kg_m3);
        let [north, east, up] = self.position_error_m;
        let v = self.velocity_error_m_s;
        Sensed {
            north_m: truth.north_m + north,
            east_m: truth.east_m + east,
            alt_amsl_m: truth.alt_amsl_m + up,
            vel_ned_m_s: [0, 1, 2].map(|k| truth.vel_ned_m_s[k] + v[k]),
            // A pitot tube reads no negative airspeed.
            airspeed_m_s: (truth.airspeed_m_s + self.airspeed_error_m_s).max(0.0),
            ..truth
        }
    }

    /// The wind as estimated, a vector towards, north and east, m/s; none before flight.
    pub(crate) fn wind_m_s(&self) -> Option<[f64; 2]> {
        let [north, east] = self.wind_m_s?;
        let [north_error, east_error] = self.wind_error_m_s;
        Some([north + north_error, east + east_error])
    }
}
