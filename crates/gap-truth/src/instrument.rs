//! From the mean excess along a track to what a platform logs: intermittency, the sensor with
//! its faults, position noise, the wind log, weather sensors, gaps and frozen stretches.

use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::physics::TruthModel;
use crate::random::{OrnsteinUhlenbeck, between, normal, stream, student_3};
use crate::scene::{LoggedWind, MARGIN_S, SUB_STEP_S, Scene};
use crate::wind::{WindLog, WindTruth};

/// Time constants of slow sensors as the scenario states them, s: of non-dispersive infrared ones
/// in the open they reach from a few seconds to about twenty.
pub const SLOW_SENSORS_S: [f64; 3] = [6.0, 12.0, 20.0];

/// The form of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoiseForm {
    /// White and slow additive noise, intermittency in proportion to the mean, few outliers:
    /// all but the outliers normal.
    Usual,
    /// Heavy tails, log-normal intermittency that is stronger at the edge, coarse steps, gaps.
    Unusual,
    /// The usual, read by sensors with time constants of 6 to 20 s: what turbulence does reaches the
    /// readings late.
    SlowSensors,
    /// The usual, in a wind that swings and surges as turbulence does at the height of a plume.
    GustyWind,
    /// The usual, in a wind that swings and surges as weather does over minutes, and that nobody logs.
    UnloggedWind,
}

/// Faults of one platform's sensors. The default has none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Faults {
    /// Time constant in series with the stated one, s.
    pub lag_s: f64,
    /// Whether that lag is two stages of half its length.
    pub two_stages: bool,
    /// Logarithm of the gain.
    pub log_gain: f64,
    /// The gain turns about this, ppm; `None` is the background.
    pub pivot_ppm: Option<f64>,
    /// Added to the reading, ppm.
    pub offset_ppm: f64,
    /// Growth of the zero, ppm/h.
    pub drift_ppm_per_h: f64,
    /// Highest reading, ppm.
    pub limit_ppm: Option<f64>,
    /// ppm per % of relative humidity above 50 %.
    pub per_percent: f64,
    /// ppm per K above 15 °C.
    pub per_k: f64,
    /// ppm per hPa above 1013.25 hPa.
    pub per_hpa: f64,
    /// Logged time of a reading = true time + this, s.
    pub clock_s: f64,
    /// Logged place = true place + this, m east, north, up.
    pub place_m: [f64; 3],
    /// A second sensor takes turns, each this long, s, and is late by this, s.
    pub second_sensor: Option<(f64, f64)>,
    /// Waves of the zero: amplitude, ppm, and period, s.
    pub waves: Option<(f64, f64)>,
}

/// What is wrong with the raw data of a platform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damage {
    /// The reading stands still in this stretch, s.
    Frozen(f64, f64),
    /// No reading in this stretch, s.
    Gap(f64, f64),
    /// Readings above this do not come through, ppm.
    Clipped(f64),
}

/// One logged row; `None` is a missing cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogRow {
    /// Time, s.
    pub time_s: f64,
    /// Latitude, longitude, degrees.
    pub lat_lon_deg: (f64, f64),
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Reading, ppm.
    pub co2_ppm: Option<f64>,
    /// What it would be on average: without intermittency, noise and rounding.
    pub mean_ppm: f64,
    /// The plume's part of the air that it is of, on average, ppm.
    pub mean_excess_ppm: f64,
    /// By how much a swing that no log shows turns the plume there, degrees.
    pub unlogged_turn_deg: f64,
    /// Direction from, degrees, and speed, m/s.
    pub wind: Option<(f64, f64)>,
    /// Temperature, °C; relative humidity, %; pressure, hPa.
    pub weather: [f64; 3],
}

/// Sizes of the noise, drawn once a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseLevels {
    /// Its form.
    pub form: NoiseForm,
    white_ppm: f64,
    slow_ppm: (f64, f64),
    gusts: (f64, f64),
    step_ppm: f64,
    outlier_chance: f64,
}

impl NoiseLevels {
    /// Noise of `form` for the case of `seed`.
    pub fn draw(seed: u64, form: NoiseForm, stated_white_ppm: f64) -> Self {
        let mut rng = stream(seed, "noise");
        let white_ppm = stated_white_ppm * between(&mut rng, 0.85, 1.15);
        let slow_ppm = (between(&mut rng, 0.2, 1.2), between(&mut rng, 15.0, 60.0));
        let time_scale_s = between(&mut rng, 2.0, 12.0);
        let size = between(&mut rng, 0.05, 0.25);
        let coarse = between(&mut rng, 2.0, 5.0);
        match form {
            NoiseForm::Unusual => Self {
                form,
                white_ppm,
                slow_ppm,
                gusts: (size * 1.6, time_scale_s),
                step_ppm: if rng.random_bool(0.5) { coarse } else { 0.1 },
                outlier_chance: 0.002,
            },
            _ => Self {
                form,
                white_ppm,
                slow_ppm,
                gusts: (size, time_scale_s),
                step_ppm: if rng.random_bool(0.5) { 0.1 } else { 1.0 },
                outlier_chance: 0.0005,
            },
        }
    }

    /// White noise of a reading, ppm.
    pub fn white_ppm(&self) -> f64 {
        self.white_ppm
    }

    fn white(&self, rng: &mut ChaCha8Rng) -> f64 {
        let z = match self.form {
            NoiseForm::Unusual => student_3(rng),
            _ => normal(rng),
        };
        // Both draws are made always, so that an effect cannot shift the stream.
        let (outlier, size) = (rng.random::<f64>(), normal(rng));
        let spike = if outlier < self.outlier_chance {
            40.0 * size
        } else {
            0.0
        };
        self.white_ppm * z + spike
    }

    /// Factor on the mean excess for a standard normal `g`.
    fn gust(&self, g: f64) -> f64 {
        let s = self.gusts.0;
        match self.form {
            NoiseForm::Unusual => (s * g - 0.5 * s * s).exp(),
            _ => 1.0 + s * g,
        }
    }
}

/// All that one platform's log depends on.
pub struct Platform<'a> {
    /// Seed of the case.
    pub seed: u64,
    /// Its index.
    pub index: usize,
    /// The scene.
    pub scene: &'a Scene,
    /// The wind.
    pub wind: &'a WindTruth,
    /// The world.
    pub world: &'a TruthModel<'a>,
    /// Sizes of the noise.
    pub noise: &'a NoiseLevels,
    /// Faults that are hidden.
    pub faults: &'a Faults,
    /// Damage to the raw data.
    pub damage: &'a [Damage],
}

impl Platform<'_> {
    fn rng(&self, what: &str) -> ChaCha8Rng {
        stream(self.seed, &format!("{what}/{}", self.index))
    }

    fn points(&self) -> usize {
        ((self.scene.duration_s + 2.0 * MARGIN_S) / SUB_STEP_S) as usize
    }

    /// (excess, background) at every sub-step, with intermittency or without, ppm.
    fn air(&self, intermittent: bool) -> Vec<(f64, f64)> {
        let mut rng = self.rng("gusts");
        let mut gust = OrnsteinUhlenbeck::new(self.noise.gusts.1, &mut rng);
        let track = &self.scene.tracks[self.index];
        (0..self.points())
            .map(|k| {
                let time_s = k as f64 * SUB_STEP_S - MARGIN_S;
                let place = self.scene.east_north_m(&track[k]);
                let factor = if intermittent {
                    self.noise.gust(gust.step(SUB_STEP_S, &mut rng)).max(0.0)
                } else {
                    1.0
                };
                let excess = self.world.excess_ppm(place, track[k][2], time_s);
                let background = self.world.background_ppm(place, track[k][2], time_s);
                (excess * factor, background)
            })
            .collect()
    }

    /// The sensor's answer at every sub-step: (excess, background) after its lags.
    fn answered(&self, intermittent: bool) -> Vec<(f64, f64)> {
        let mut air = self.air(intermittent);
        let mut constants = vec![self.scene.lag_s];
        if self.faults.two_stages {
            constants.extend([self.faults.lag_s / 2.0; 2]);
        } else {
            constants.push(self.faults.lag_s);
        }
        for tau_s in constants {
            if tau_s <= 0.0 {
                continue;
            }
            // Exact for an input that is straight between two sub-steps.
            let keep = (-SUB_STEP_S / tau_s).exp();
            let mean = (1.0 - keep) * tau_s / SUB_STEP_S;
            let follow = |state: f64, before: f64, now: f64| {
                keep * state + (mean - keep) * before + (1.0 - mean) * now
            };
            let mut state = air[0];
            let mut before = air[0];
            for now in &mut air {
                state = (
                    follow(state.0, before.0, now.0),
                    follow(state.1, before.1, now.1),
                );
                before = *now;
                *now = state;
            }
        }
        air
    }

    /// The rows, one a second.
    pub fn log(&self) -> Vec<LogRow> {
        let gusty = self.answered(true);
        let mean = self.answered(false);
        let at = |answered: &[(f64, f64)], time_s: f64| {
            let place = ((time_s + MARGIN_S) / SUB_STEP_S).clamp(0.0, answered.len() as f64 - 2.0);
            let (i, share) = (place as usize, place.fract());
            let (a, b) = (answered[i], answered[i + 1]);
            (a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1))
        };
        let mut log = Log::start(self);
        let mut rows = Vec::with_capacity(self.scene.duration_s as usize);
        for second in 0..self.scene.duration_s as usize {
            let time_s = second as f64;
            let late = self.faults.second_sensor.map_or(0.0, |(turn_s, late_s)| {
                if (time_s / turn_s) as usize % 2 == 1 {
                    late_s
                } else {
                    0.0
                }
            });
            // The log's clock runs ahead of the truth by its offset, so that a row shows earlier air.
            let true_s = time_s - self.faults.clock_s - log.own_clock_s - late;
            rows.push(log.row(time_s, at(&gusty, true_s), at(&mean, true_s)));
        }
        self.apply_damage(&mut rows);
        rows
    }

    fn apply_damage(&self, rows: &mut [LogRow]) {
        for damage in self.damage {
            let mut held = None;
            for row in rows.iter_mut() {
                match *damage {
                    Damage::Frozen(from, to) if row.time_s >= from && row.time_s < to => {
                        held = held.or(row.co2_ppm);
                        row.co2_ppm = held;
                    }
                    Damage::Gap(from, to) if row.time_s >= from && row.time_s < to => {
                        row.co2_ppm = None;
                    }
                    Damage::Clipped(limit) => row.co2_ppm = row.co2_ppm.map(|c| c.min(limit)),
                    _ => {}
                }
            }
        }
    }
}

/// The running state of one platform's log.
struct Log<'a> {
    of: &'a Platform<'a>,
    rng: ChaCha8Rng,
    slow: OrnsteinUhlenbeck,
    gps: [OrnsteinUhlenbeck; 3],
    gps_rng: ChaCha8Rng,
    wind: WindLog,
    wind_rng: ChaCha8Rng,
    weather: [OrnsteinUhlenbeck; 2],
    weather_rng: ChaCha8Rng,
    humidity_percent: f64,
    own_clock_s: f64,
    own_offset_ppm: f64,
    own_gain: f64,
}

impl<'a> Log<'a> {
    fn start(of: &'a Platform<'a>) -> Self {
        let mut rng = of.rng("readings");
        let mut gps_rng = of.rng("gps");
        let wind_name = match of.scene.logged_wind {
            LoggedWind::Site => "wind-log".to_owned(),
            _ => format!("wind-log/{}", of.index),
        };
        let mut wind_rng = stream(of.seed, &wind_name);
        // The weather is the site's: the same for all platforms but for their instruments.
        let mut weather_rng = stream(of.seed, "weather-log");
        let humidity_percent = between(&mut weather_rng, 35.0, 75.0);
        let time_scales = [60.0, 60.0, 80.0];
        let white_deg = between(&mut wind_rng, 0.8, 3.0);
        // Faults of workmanship that every instrument has, well below what is worth naming: a finder
        // must not take them for a cause.
        let own_clock_s = 0.02 * normal(&mut rng);
        let own_offset_ppm = 0.15 * normal(&mut rng);
        let own_gain = (0.003 * normal(&mut rng)).exp();
        Self {
            slow: OrnsteinUhlenbeck::new(of.noise.slow_ppm.1, &mut rng),
            gps: time_scales.map(|t| OrnsteinUhlenbeck::new(t, &mut gps_rng)),
            wind: WindLog::new([1.5, 0.04], [white_deg, 0.04], 6.0, &mut wind_rng),
            weather: [
                OrnsteinUhlenbeck::new(180.0, &mut weather_rng),
                OrnsteinUhlenbeck::new(240.0, &mut weather_rng),
            ],
            of,
            rng,
            gps_rng,
            wind_rng,
            weather_rng,
            humidity_percent,
            own_clock_s,
            own_offset_ppm,
            own_gain,
        }
    }

    fn row(&mut self, time_s: f64, air_now: (f64, f64), air_mean: (f64, f64)) -> LogRow {
        let (scene, faults) = (self.of.scene, self.of.faults);
        let index = ((time_s + MARGIN_S) / SUB_STEP_S).round() as usize;
        let point = &scene.tracks[self.of.index][index];
        let mut place = scene.east_north_m(point);
        let mut height_m = point[2];
        let sizes = [0.5, 0.5, 0.7];
        let mut off = faults.place_m;
        for (k, size) in sizes.iter().enumerate() {
            off[k] +=
                size * self.gps[k].step(1.0, &mut self.gps_rng) + 0.2 * normal(&mut self.gps_rng);
        }
        place[0] += off[0];
        place[1] += off[1];
        height_m += off[2];
        let air = scene.air;
        let temperature =
            air.temperature_at_c(point[2]) + 0.8 * self.weather[0].step(1.0, &mut self.weather_rng);
        let wetter = 7.0 * self.weather[1].step(1.0, &mut self.weather_rng);
        let humidity = (self.humidity_percent + wetter - 0.01 * point[2]).clamp(2.0, 99.0);
        let pressure = air.pressure_at_hpa(point[2]);
        let weather = [temperature, humidity, pressure];
        let noise_ppm = self.noise();
        let limited = |c: f64| c.min(faults.limit_ppm.unwrap_or(f64::INFINITY));
        let reading = limited(self.converted(time_s, air_now, weather) + noise_ppm);
        let mean_ppm = limited(self.converted(time_s, air_mean, weather));
        let step_ppm = self.of.noise.step_ppm;
        let factor = scene.height_factor(point[2]);
        let wind = (scene.logged_wind != LoggedWind::Absent).then(|| {
            let from = self.of.wind.logged_from_deg(time_s) - scene.off("weather.wind_from_deg");
            let speed = self.of.wind.speed_m_s(time_s) * factor;
            self.wind.read(from, speed, 1.0, &mut self.wind_rng)
        });
        LogRow {
            time_s,
            lat_lon_deg: scene.lat_lon_deg(place),
            alt_amsl_m: scene.ground_amsl_m + height_m,
            co2_ppm: Some((reading / step_ppm).round() * step_ppm),
            mean_ppm,
            mean_excess_ppm: air_mean.0,
            unlogged_turn_deg: self
                .of
                .world
                .unlogged_turn_deg(scene.east_north_m(point), time_s),
            wind,
            weather,
        }
    }

    /// What the sensor makes of air, without noise, ppm.
    fn converted(&self, time_s: f64, (excess, background): (f64, f64), weather: [f64; 3]) -> f64 {
        let (scene, faults) = (self.of.scene, self.of.faults);
        let hours = time_s / 3600.0;
        let pivot = faults.pivot_ppm.unwrap_or(scene.background_ppm);
        let mut c = background + excess * self.own_gain;
        c = pivot + faults.log_gain.exp() * (c - pivot);
        c += faults.offset_ppm + self.own_offset_ppm + faults.drift_ppm_per_h * hours;
        c += faults.per_k * (weather[0] - 15.0)
            + faults.per_percent * (weather[1] - 50.0)
            + faults.per_hpa * (weather[2] - 1013.25);
        if let Some((amplitude, period)) = faults.waves {
            c += amplitude * (std::f64::consts::TAU * time_s / period).sin();
        }
        c
    }

    /// Slow and white noise, ppm.
    fn noise(&mut self) -> f64 {
        let noise = self.of.noise;
        noise.slow_ppm.0 * self.slow.step(1.0, &mut self.rng) + noise.white(&mut self.rng)
    }
}
