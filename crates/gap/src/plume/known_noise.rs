//! The noise of the sensor as the scenario states it: sizes learned from clean air, or from earlier records of the same
//! instrument. If each record has to estimate them again, most of the evidence for a cause is lost.

use infer::Policy;
use scenario::tables::SensorTable;

/// No size is known better than this, as a standard deviation of its logarithm: instruments change from day to day.
const LEAST_LN_SD: f64 = 0.05;
/// A zero that is said not to wander wanders by this part of the white noise: a logarithm has no zero.
const LEAST_SLOW: f64 = 0.01;
/// A size beyond so many standard deviations of what is known of it is not the sensor's.
const TOLERATED_SDS: f64 = 3.0;

/// A size or a time, with the factor within which it is known (one standard deviation).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Known {
    value: Option<f64>,
    within: Option<f64>,
}

impl Known {
    fn ln_sd(self, usual: f64) -> f64 {
        self.within.map_or(usual, |f| f.ln().max(LEAST_LN_SD))
    }
}

/// What is known of the white noise and of the slow wander of the zero.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct KnownNoise {
    white: Known,
    slow: Known,
    slow_time: Known,
}

impl KnownNoise {
    /// What a sensor's table states.
    pub fn of(sensor: &SensorTable) -> Self {
        let known = |value, within| Known { value, within };
        Self {
            white: known(sensor.noise_sd_ppm, sensor.noise_sd_ppm_known_within),
            slow: known(sensor.slow_sd_ppm, sensor.slow_sd_ppm_known_within),
            slow_time: known(sensor.slow_time_s, sensor.slow_time_s_known_within),
        }
    }

    /// Tells it to the rules; `sensor_sd` is the size of the white noise, in the unit of the readings.
    pub fn tell(self, sensor_sd: f64, policy: &mut Policy) {
        let [white, slow, slow_time, ..] = &mut policy.noise_ln_sd;
        *white = self.white.ln_sd(*white);
        *slow = self.slow.ln_sd(*slow);
        *slow_time = self.slow_time.ln_sd(*slow_time);
        if let Some(slow_sd) = self.slow.value {
            let part = (slow_sd / sensor_sd).max(LEAST_SLOW);
            policy.noise_median.slow = part;
            let most = part * (TOLERATED_SDS * *slow).exp();
            policy.noise_tolerated.slow = policy.noise_tolerated.slow.max(most);
        }
        if let Some(time_s) = self.slow_time.value {
            policy.noise_median.slow_s = time_s;
        }
    }
}
