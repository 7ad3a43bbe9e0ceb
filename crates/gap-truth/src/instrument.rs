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
    /// Strong intermittency with a memory of seconds, sensors that wander slowly, and a gusty wind that
    /// is logged: what field data look like.
    Realistic,
    /// The usual, with strong log-normal intermittency as near a source: by half to 1.3 of the mean, with a
    /// memory of seconds.
    Intermittent,
    /// Intermittent, with an axis that wanders by a few degrees with a memory of about a minute, which no log
    /// shows: what eddies of the size of the plume do.
    Meandering,
}

/// How far a position jumps, degrees of latitude: half a kilometre, as after a false fix.
const JUMP_DEG: f64 = 0.005;

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
    /// The logged place is elsewhere in this stretch, s.
    Jump(f64, f64),
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
    /// The plume's part of that, ppm.
    pub mean_excess_ppm: f64,
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
    wander: Option<(f64, f64)>,
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
                wander: None,
            },
            NoiseForm::Realistic => Self {
                form,
                white_ppm,
                slow_ppm: (between(&mut rng, 1.0, 3.0), between(&mut rng, 100.0, 400.0)),
                gusts: (between(&mut rng, 0.1, 0.3), between(&mut rng, 2.0, 10.0)),
                step_ppm: 0.1,
                outlier_chance: 0.0005,
                wander: None,
            },
            NoiseForm::Intermittent | NoiseForm::Meandering => {
                let meanders = form == NoiseForm::Meandering;
                let (low, high) = if meanders { (0.3, 0.8) } else { (0.5, 1.3) };
                let relative = between(&mut rng, low, high);
                let wander = (between(&mut rng, 2.0, 5.0), between(&mut rng, 30.0, 90.0));
                Self {
                    form,
                    white_ppm,
                    slow_ppm,
                    // The logarithm's standard deviation that makes this of the mean.
                    gusts: (relative.hypot(1.0).powi(2).ln().sqrt(), time_scale_s),
                    step_ppm: 0.1,
                    outlier_chance: 0.0005,
                    wander: meanders.then_some(wander),
                }
            }
            _ => Self {
                form,
                white_ppm,
                slow_ppm,
                gusts: (size, time_scale_s),
                step_ppm: if rng.random_bool(0.5) { 0.1 } else { 1.0 },
                outlier_chance: 0.0005,
                wander: None,
            },
        }
    }

    /// Wander of the transport that no log shows: standard deviation, degrees, and correlation time, s.
    pub fn wander(&self) -> Option<(f64, f64)> {
        self.wander
    }

    /// The same with this intermittency: standard deviation over the mean, and correlation time, s.
    pub fn with_gusts(self, gusts: (f64, f64)) -> Self {
        Self { gusts, ..self }
    }

    /// White noise of a reading, ppm.
    pub fn white_ppm(&self) -> f64 {
        self.white_ppm
    }

    /// Variance of white noise and rounding, ppm².
    pub fn white_variance(&self) -> f64 {
        self.white_ppm.powi(2) + self.step_ppm.powi(2) / 12.0
    }

    /// Slow noise: standard deviation, ppm, and correlation time, s.
    pub fn slow_ppm(&self) -> (f64, f64) {
        self.slow_ppm
    }

    /// Intermittency: standard deviation over the mean excess, and correlation time, s.
    pub fn gusts(&self) -> (f64, f64) {
        let (s, time_scale_s) = self.gusts;
        match self.form {
            _ if self.is_log_normal() => ((s * s).exp_m1().sqrt(), time_scale_s),
            _ => (s, time_scale_s),
        }
    }

    fn is_log_normal(&self) -> bool {
        use NoiseForm as F;
        matches!(self.form, F::Unusual | F::Intermittent | F::Meandering)
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
            _ if self.is_log_normal() => (s * g - 0.5 * s * s).exp(),
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
    /// The air is that of places this far from those flown, m east, north, up: what a model expects
    /// that takes a false log of places for true.
    pub seen_off_m: [f64; 3],
}

/// What a platform would read without noise.
#[derive(Debug, Clone)]
pub struct MeanLog {
    /// The rows; their readings are the means.
    pub rows: Vec<LogRow>,
    /// Excess of the air met at every sub-step, ppm.
    pub air_ppm: Vec<f64>,
    /// Sub-step whose air each row shows; of a clock or a sensor that is late an earlier one.
    pub seen_at: Vec<usize>,
}

impl Platform<'_> {
    fn rng(&self, what: &str) -> ChaCha8Rng {
        stream(self.seed, &format!("{what}/{}", self.index))
    }

    fn points(&self) -> usize {
        ((self.scene.duration_s + 2.0 * MARGIN_S) / SUB_STEP_S) as usize
    }

    /// (excess, background) at every sub-step, without intermittency, ppm: at every `stride`-th as it is,
    /// straight between them.
    pub fn air(&self, stride: usize) -> Vec<(f64, f64)> {
        let last = self.points() - 1;
        let known: Vec<(f64, f64)> = (0..=last.div_ceil(stride))
            .map(|j| self.air_at((j * stride).min(last)))
            .collect();
        (0..=last)
            .map(|k| {
                let (j, from) = (k / stride, k / stride * stride);
                if k == from {
                    return known[j];
                }
                let to = (from + stride).min(last);
                let share = (k - from) as f64 / (to - from) as f64;
                let mix = |a: f64, b: f64| a + share * (b - a);
                let (a, b) = (known[j], known[j + 1]);
                (mix(a.0, b.0), mix(a.1, b.1))
            })
            .collect()
    }

    /// (excess, background) at sub-step `k`, ppm.
    fn air_at(&self, k: usize) -> (f64, f64) {
        let track = &self.scene.tracks[self.index];
        let off = self.seen_off_m;
        let time_s = k as f64 * SUB_STEP_S - MARGIN_S;
        let place = self.scene.east_north_m(&track[k]);
        let place = [place[0] + off[0], place[1] + off[1]];
        let z_m = track[k][2] + off[2];
        let excess = self.world.excess_ppm(place, z_m, time_s);
        (excess, self.world.background_ppm(place, z_m, time_s))
    }

    /// The same with intermittency.
    fn gusty(&self, air: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let mut rng = self.rng("gusts");
        let mut gust = OrnsteinUhlenbeck::new(self.noise.gusts.1, &mut rng);
        air.iter()
            .map(|&(excess, background)| {
                let factor = self.noise.gust(gust.step(SUB_STEP_S, &mut rng)).max(0.0);
                (excess * factor, background)
            })
            .collect()
    }

    /// Time constants of a sensor's stages, s.
    pub fn stages_s(scene: &Scene, faults: &Faults) -> Vec<f64> {
        let mut constants = vec![scene.lag_s];
        if faults.two_stages {
            constants.extend([faults.lag_s / 2.0; 2]);
        } else {
            constants.push(faults.lag_s);
        }
        constants.retain(|tau_s| *tau_s > 0.0);
        constants
    }

    /// The sensor's answer to air at every sub-step: (excess, background) after its lags.
    fn answered(&self, mut air: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
        for tau_s in Self::stages_s(self.scene, self.faults) {
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

    /// The rows.
    pub fn log(&self) -> Vec<LogRow> {
        let air = self.air(1);
        let gusty = self.answered(self.gusty(&air));
        let mut rows = self.rows(&gusty, &self.answered(air)).0;
        self.apply_damage(&mut rows);
        rows
    }

    /// What would be read of `air` without noise.
    pub fn mean_log(&self, air: Vec<(f64, f64)>) -> MeanLog {
        let air_ppm = air.iter().map(|a| a.0).collect();
        let mean = self.answered(air);
        let (rows, seen_at) = self.rows(&mean, &mean);
        MeanLog {
            rows,
            air_ppm,
            seen_at,
        }
    }

    /// A row each [`Scene::row_step_s`], and the sub-step that it shows.
    fn rows(&self, gusty: &[(f64, f64)], mean: &[(f64, f64)]) -> (Vec<LogRow>, Vec<usize>) {
        let place =
            |time_s: f64| ((time_s + MARGIN_S) / SUB_STEP_S).clamp(0.0, gusty.len() as f64 - 2.0);
        let at = |answered: &[(f64, f64)], time_s: f64| {
            let (i, share) = (place(time_s) as usize, place(time_s).fract());
            let (a, b) = (answered[i], answered[i + 1]);
            (a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1))
        };
        let mut log = Log::start(self);
        let (mut rows, mut seen_at) = (Vec::new(), Vec::new());
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
            // Instruments run on between rows.
            let row = log.row(time_s, at(gusty, true_s), at(mean, true_s));
            if second.is_multiple_of(self.scene.row_step_s) {
                rows.push(row);
                seen_at.push(place(true_s).round() as usize);
            }
        }
        (rows, seen_at)
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
                    Damage::Jump(from, to) if row.time_s >= from && row.time_s < to => {
                        row.lat_lon_deg.0 += JUMP_DEG;
                    }
                    Damage::Clipped(limit) => row.co2_ppm = row.co2_ppm.map(|c| c.min(limit)),
                    _ => {}
                }
            }
        }
    }
}

/// Local turbulence in a log of the wind: degrees, share of the speed, and correlation time, s.
pub const LOG_TURBULENCE: (f64, f64, f64) = (1.5, 0.04, 6.0);
/// White noise of a log of the wind's speed, share of it.
pub const LOG_SPEED_NOISE: f64 = 0.04;
/// Slow errors of logged places east, north and up: standard deviation, m, and correlation time, s.
pub const PLACE_NOISE: [(f64, f64); 3] = [(0.5, 60.0), (0.5, 60.0), (0.7, 80.0)];
/// White noise of logged places along each axis, m.
pub const PLACE_WHITE_M: f64 = 0.2;
/// Standard deviation of each log's own clock, s.
pub const OWN_CLOCK_S: f64 = 0.02;
/// Standard deviation of each sensor's own zero, ppm.
pub const OWN_OFFSET_PPM: f64 = 0.15;
/// Standard deviation of the logarithm of each sensor's own gain.
pub const OWN_LOG_GAIN: f64 = 0.003;

/// White noise of a platform's wind direction, degrees, and the stream of its log of the wind.
pub fn wind_instrument(scene: &Scene, seed: u64, index: usize) -> (f64, ChaCha8Rng) {
    let name = match scene.logged_wind {
        LoggedWind::Site => "wind-log".to_owned(),
        _ => format!("wind-log/{index}"),
    };
    let mut rng = stream(seed, &name);
    (between(&mut rng, 0.8, 3.0), rng)
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
        let (white_deg, mut wind_rng) = wind_instrument(of.scene, of.seed, of.index);
        // The weather is the site's: the same for all platforms but for their instruments.
        let mut weather_rng = stream(of.seed, "weather-log");
        let humidity_percent = between(&mut weather_rng, 35.0, 75.0);
        // Faults of workmanship that every instrument has, well below what is worth naming: a finder
        // must not take them for a cause.
        let own_clock_s = OWN_CLOCK_S * normal(&mut rng);
        let own_offset_ppm = OWN_OFFSET_PPM * normal(&mut rng);
        let own_gain = (OWN_LOG_GAIN * normal(&mut rng)).exp();
        Self {
            slow: OrnsteinUhlenbeck::new(of.noise.slow_ppm.1, &mut rng),
            gps: PLACE_NOISE.map(|(_, lasts_s)| OrnsteinUhlenbeck::new(lasts_s, &mut gps_rng)),
            wind: WindLog::new(
                [LOG_TURBULENCE.0, LOG_TURBULENCE.1],
                [white_deg, LOG_SPEED_NOISE],
                LOG_TURBULENCE.2,
                &mut wind_rng,
            ),
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
        let mut off = faults.place_m;
        for (k, (size_m, _)) in PLACE_NOISE.iter().enumerate() {
            off[k] += size_m * self.gps[k].step(1.0, &mut self.gps_rng)
                + PLACE_WHITE_M * normal(&mut self.gps_rng);
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
            mean_excess_ppm: if mean_ppm < faults.limit_ppm.unwrap_or(f64::INFINITY) {
                air_mean.0 * faults.log_gain.exp()
            } else {
                // Nothing of the plume comes through a sensor at its ceiling.
                0.0
            },
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
