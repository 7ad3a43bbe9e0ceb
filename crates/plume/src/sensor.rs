//! A gas sensor: lag, noise, slope, offset, drift, cross-sensitivity, limit, resolution.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::effects::{HOUR_S, SensorAir, SensorEffects};
use crate::field::Place;
use crate::lag::lag_step;
use crate::mechanism::Mechanism;
use crate::{PlumeError, in_range};

/// What a sensor is like; the default is ideal.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorSpec {
    /// First-order time constant, s; 0 answers at once.
    pub time_constant_s: f64,
    /// White noise of one reading, one standard deviation, ppm.
    pub noise_sd_ppm: f64,
    /// Slow wander of the zero, one standard deviation, ppm; 0 for none.
    pub slow_sd_ppm: f64,
    /// Time over which the wander forgets, s.
    pub slow_time_s: f64,
    /// Added to every reading, ppm.
    pub offset_ppm: f64,
    /// Slope about zero concentration.
    pub gain: f64,
    /// Drift of the zero since time 0, ppm/h.
    pub drift_ppm_per_h: f64,
    /// Smallest step of the reading, ppm; 0 for none.
    pub resolution_ppm: f64,
    /// Highest reading, ppm; `None`: no limit.
    pub saturation_ppm: Option<f64>,
}

impl Default for SensorSpec {
    fn default() -> Self {
        Self {
            time_constant_s: 0.0,
            noise_sd_ppm: 0.0,
            slow_sd_ppm: 0.0,
            slow_time_s: 100.0,
            offset_ppm: 0.0,
            gain: 1.0,
            drift_ppm_per_h: 0.0,
            resolution_ppm: 0.0,
            saturation_ppm: None,
        }
    }
}

impl SensorSpec {
    /// Checks every value.
    ///
    /// # Errors
    /// A value that no sensor has.
    pub fn validate(&self) -> Result<(), PlumeError> {
        in_range("sensor time_constant_s", self.time_constant_s, 0.0, 600.0)?;
        in_range("sensor noise_sd_ppm", self.noise_sd_ppm, 0.0, 1e5)?;
        in_range("sensor slow_sd_ppm", self.slow_sd_ppm, 0.0, 1e5)?;
        in_range("sensor slow_time_s", self.slow_time_s, 1e-3, 1e7)?;
        in_range("sensor offset_ppm", self.offset_ppm, -1e5, 1e5)?;
        in_range("sensor gain", self.gain, 1e-3, 1e3)?;
        in_range("sensor drift_ppm_per_h", self.drift_ppm_per_h, -1e5, 1e5)?;
        in_range("sensor resolution_ppm", self.resolution_ppm, 0.0, 1e5)?;
        if let Some(limit) = self.saturation_ppm {
            in_range("sensor saturation_ppm", limit, 1.0, 1e6)?;
        }
        Ok(())
    }

    /// Response time of a platform's sensor, s: the sum of its lags of first order.
    pub fn response_s(&self, mechanisms: &[Mechanism], platform: &str) -> f64 {
        self.effects(mechanisms, platform).lags_s.iter().sum()
    }

    /// This sensor and the mechanisms that apply to `platform` as one joint effect.
    pub(crate) fn effects(&self, mechanisms: &[Mechanism], platform: &str) -> SensorEffects {
        let mut own = SensorEffects::none();
        if self.time_constant_s > 0.0 {
            own.lags_s.push(self.time_constant_s);
        }
        own.gain = self.gain;
        own.offset_ppm = self.offset_ppm;
        own.drift_ppm_s = self.drift_ppm_per_h / HOUR_S;
        own.limit_ppm = self.saturation_ppm.unwrap_or(f64::INFINITY);
        own.with(mechanisms, platform)
    }
}

/// The slow wander of a sensor's zero: an Ornstein-Uhlenbeck process.
#[derive(Debug, Clone, PartialEq)]
struct SlowWander {
    sd_ppm: f64,
    time_s: f64,
    /// None before the first reading.
    now_ppm: Option<f64>,
}

impl SlowWander {
    /// The zero `dt_s` later, ppm. A zero that does not wander draws no number.
    fn after<R: Rng>(&mut self, dt_s: f64, rng: &mut R) -> f64 {
        if self.sd_ppm == 0.0 {
            return 0.0;
        }
        let kept = self.now_ppm.map_or(0.0, |_| (-dt_s / self.time_s).exp());
        let drawn: f64 = StandardNormal.sample(rng);
        let new_ppm = self.sd_ppm * (1.0 - kept * kept).sqrt() * drawn;
        let now_ppm = kept * self.now_ppm.unwrap_or(0.0) + new_ppm;
        self.now_ppm = Some(now_ppm);
        now_ppm
    }
}

/// A sensor at work on one platform.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    effects: SensorEffects,
    noise_sd_ppm: f64,
    slow: SlowWander,
    resolution_ppm: f64,
    time_s: f64,
    input_ppm: Option<f64>,
    stages_ppm: Vec<f64>,
}

impl Sensor {
    /// A sensor at time 0 that has not read yet; its first reading is settled.
    pub fn new(spec: &SensorSpec, mechanisms: &[Mechanism], platform: &str) -> Self {
        let effects = spec.effects(mechanisms, platform);
        Self {
            stages_ppm: vec![0.0; effects.lags_s.len()],
            effects,
            noise_sd_ppm: spec.noise_sd_ppm,
            slow: SlowWander {
                sd_ppm: spec.slow_sd_ppm,
                time_s: spec.slow_time_s,
                now_ppm: None,
            },
            resolution_ppm: spec.resolution_ppm,
            time_s: 0.0,
            input_ppm: None,
        }
    }

    /// The reading after `dt_s` in which the concentration went straight from its last value to
    /// `true_ppm`; the air's own influence unknown.
    pub fn read<R: Rng>(&mut self, true_ppm: f64, dt_s: f64, rng: &mut R) -> f64 {
        self.read_in(true_ppm, &SensorAir::UNKNOWN, dt_s, rng)
    }

    /// The same in air of known temperature, humidity and pressure.
    pub fn read_in<R: Rng>(
        &mut self,
        true_ppm: f64,
        air: &SensorAir,
        dt_s: f64,
        rng: &mut R,
    ) -> f64 {
        self.time_s += dt_s;
        let lagged = self.lag(true_ppm, dt_s);
        // Drawn even where its size is zero, so that the stream of numbers does not depend on it.
        let noise: f64 = StandardNormal.sample(rng);
        let wander_ppm = self.slow.after(dt_s, rng);
        let e = &self.effects;
        let reading = e.gain * lagged
            + e.offset_ppm
            + e.drift_ppm_s * self.time_s
            + e.cross_ppm(air)
            + wander_ppm
            + self.noise_sd_ppm * noise;
        // Noise belongs to the detector: it comes after the lag, and the limit and the rounding act on
        // it too.
        let reading = reading.min(e.limit_ppm);
        if self.resolution_ppm > 0.0 {
            (reading / self.resolution_ppm).round() * self.resolution_ppm
        } else {
            reading
        }
    }

    fn lag(&mut self, true_ppm: f64, dt_s: f64) -> f64 {
        let Some(last) = self.input_ppm.replace(true_ppm) else {
            self.stages_ppm.fill(true_ppm);
            return true_ppm;
        };
        // The stages are in series: the output of one is the input of the next. Its ramp over the
        // step is an approximation from the second stage on.
        let (mut before, mut now) = (last, true_ppm);
        for (stage, &tau) in self.stages_ppm.iter_mut().zip(&self.effects.lags_s) {
            let was = *stage;
            *stage = lag_step(was, before, now, dt_s, tau);
            (before, now) = (was, *stage);
        }
        now
    }

    /// Where the platform's log says it is when it is at `place`.
    pub fn logged_place(&self, place: &Place) -> Place {
        let [east, north, up] = self.effects.position_m;
        Place {
            east_m: place.east_m + east,
            north_m: place.north_m + north,
            height_agl_m: place.height_agl_m + up,
        }
    }

    /// What the sensor's clock says at `time_s`.
    pub fn logged_time_s(&self, time_s: f64) -> f64 {
        time_s + self.effects.clock_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;

    fn rng() -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(1)
    }

    #[test]
    fn ideal_by_default() {
        let mut sensor = Sensor::new(&SensorSpec::default(), &[], "1");
        for c in [449.0, 859.0, 0.0] {
            assert_eq!(sensor.read(c, 0.1, &mut rng()), c);
        }
    }

    // A step seen through tau = 2 s: 63.2 % after 2 s (1 - 1/e).
    #[test]
    fn lag_reaches_63_percent() {
        let spec = SensorSpec {
            time_constant_s: 2.0,
            ..SensorSpec::default()
        };
        let mut sensor = Sensor::new(&spec, &[], "1");
        let mut r = rng();
        sensor.read(0.0, 0.1, &mut r);
        sensor.read(100.0, 1e-9, &mut r);
        let mut last = 0.0;
        for _ in 0..20 {
            last = sensor.read(100.0, 0.1, &mut r);
        }
        assert!((last - 63.212).abs() < 0.01, "{last}");
    }

    #[test]
    fn slope_offset_drift_limit_and_resolution() {
        let spec = SensorSpec {
            gain: 1.1,
            offset_ppm: 5.0,
            drift_ppm_per_h: 36.0,
            resolution_ppm: 1.0,
            saturation_ppm: Some(800.0),
            ..SensorSpec::default()
        };
        let mut sensor = Sensor::new(&spec, &[], "1");
        let mut r = rng();
        // 1.1*400 + 5 + 0.01*100 = 446; then limited.
        assert_eq!(sensor.read(400.0, 100.0, &mut r), 446.0);
        assert_eq!(sensor.read(4000.0, 1.0, &mut r), 800.0);
    }

    #[test]
    fn noise_has_its_standard_deviation() {
        let spec = SensorSpec {
            noise_sd_ppm: 3.0,
            ..SensorSpec::default()
        };
        let mut sensor = Sensor::new(&spec, &[], "1");
        let mut r = rng();
        let n = 20_000;
        let sum: f64 = (0..n)
            .map(|_| sensor.read(400.0, 1.0, &mut r) - 400.0)
            .map(|e| e * e)
            .sum();
        let sd = (sum / f64::from(n)).sqrt();
        assert!((sd / 3.0 - 1.0).abs() < 0.02, "{sd}");
    }

    // An Ornstein-Uhlenbeck process: standard deviation 5 at all times, correlation exp(-10/50) = .8187 after 10 s.
    #[test]
    fn the_zero_wanders_with_its_size_and_memory() {
        let spec = SensorSpec {
            slow_sd_ppm: 5.0,
            slow_time_s: 50.0,
            ..SensorSpec::default()
        };
        let mut r = rng();
        let (mut square, mut product) = (0.0, 0.0);
        let n = 20_000;
        for _ in 0..n {
            let mut sensor = Sensor::new(&spec, &[], "1");
            let [first, later] = [1.0, 10.0].map(|dt_s| sensor.read(400.0, dt_s, &mut r) - 400.0);
            square += later * later / f64::from(n);
            product += first * later / f64::from(n);
        }
        assert!((square.sqrt() / 5.0 - 1.0).abs() < 0.02, "{square}");
        assert!((product / 25.0 - 0.8187).abs() < 0.03, "{product}");
    }

    #[test]
    fn cross_sensitivity_and_scope() {
        let humid = Mechanism::new(
            "cross-sensitivity-humidity",
            &[("ppm_per_percent", 0.5), ("reference_percent", 40.0)],
        )
        .unwrap()
        .for_platforms(&["2".into()]);
        let air = SensorAir {
            relative_humidity_pct: 60.0,
            ..SensorAir::UNKNOWN
        };
        let read = |platform: &str| {
            Sensor::new(
                &SensorSpec::default(),
                std::slice::from_ref(&humid),
                platform,
            )
            .read_in(400.0, &air, 1.0, &mut rng())
        };
        assert_eq!(read("1"), 400.0);
        assert_eq!(read("2"), 410.0);
    }

    #[test]
    fn logged_place_and_time_follow_the_signs() {
        let list = [
            Mechanism::new("clock-offset", &[("offset_s", 2.0)]).unwrap(),
            Mechanism::new("position-offset", &[("east_m", 5.0), ("north_m", -3.0)]).unwrap(),
            Mechanism::new("altitude-offset", &[("offset_m", 7.0)]).unwrap(),
        ];
        let sensor = Sensor::new(&SensorSpec::default(), &list, "1");
        assert_eq!(sensor.logged_time_s(10.0), 12.0);
        let logged = sensor.logged_place(&Place::default());
        assert_eq!(
            (logged.east_m, logged.north_m, logged.height_agl_m),
            (5.0, -3.0, 7.0)
        );
    }

    #[test]
    fn refuses_nonsense() {
        for spec in [
            SensorSpec {
                noise_sd_ppm: -1.0,
                ..SensorSpec::default()
            },
            SensorSpec {
                time_constant_s: f64::NAN,
                ..SensorSpec::default()
            },
            SensorSpec {
                gain: 0.0,
                ..SensorSpec::default()
            },
        ] {
            assert!(spec.validate().is_err());
        }
    }
}
