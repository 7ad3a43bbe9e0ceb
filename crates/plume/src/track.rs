//! The one forward model of observations: rows of places, times and logged air of one or many
//! platforms to the readings that a world with its mechanisms predicts.
//!
//! Rows stand platform by platform, in order of time; columns are stored apart so that a
//! prediction is one pass over memory, because a fit asks for hundreds of them.

use std::ops::Range;

use crate::PlumeError;
use crate::effects::{Ambient, SensorEffects, lag_step};
use crate::field::{Place, Transport, World, WorldSpec};

/// One row of an observation track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Index into the track's platforms.
    pub platform: usize,
    /// Time since mission start, s.
    pub time_s: f64,
    /// Logged place.
    pub place: Place,
    /// Wind at the place and its height: speed in m/s, from-direction in degrees; `None` takes
    /// the scenario's.
    pub wind: Option<(f64, f64)>,
    /// Logged air.
    pub air: Ambient,
}

/// Rows of all platforms as columns.
#[derive(Debug, Clone)]
pub struct Track {
    platforms: Vec<String>,
    ranges: Vec<Range<usize>>,
    time_s: Vec<f64>,
    east_m: Vec<f64>,
    north_m: Vec<f64>,
    height_m: Vec<f64>,
    transport: Vec<Transport>,
    /// Factor on the plume's part of each row.
    plume_factor: Vec<f64>,
    /// Ratio of puffs to the straight plume of each row, plume by plume; one where there is none.
    puff_ratios: Vec<Vec<f64>>,
    /// How long before each row the wind, on the mean of the air's way, turned it, s.
    wind_age_s: Vec<f64>,
    ppm_per_mol_m3: Vec<f64>,
    air: Vec<Ambient>,
}

impl Track {
    /// A track from rows that stand platform by platform, each in order of time. The logged
    /// wind speed is carried to the first source's effective height by the scenario's profile.
    ///
    /// # Errors
    /// Rows out of order, a platform index without a name, or a value that is not finite.
    pub fn new(world: &World, platforms: &[String], rows: &[Row]) -> Result<Self, PlumeError> {
        let ranges = ranges(platforms.len(), rows)?;
        let spec = world.spec();
        Ok(Self {
            platforms: platforms.to_vec(),
            ranges,
            time_s: rows.iter().map(|r| r.time_s).collect(),
            east_m: rows.iter().map(|r| r.place.east_m).collect(),
            north_m: rows.iter().map(|r| r.place.north_m).collect(),
            height_m: rows.iter().map(|r| r.place.height_agl_m).collect(),
            transport: rows.iter().map(|r| row_transport(spec, r)).collect(),
            plume_factor: vec![1.0; rows.len()],
            puff_ratios: Vec::new(),
            wind_age_s: vec![0.0; rows.len()],
            ppm_per_mol_m3: rows
                .iter()
                .map(|r| world.ppm_per_mol_m3(r.place.height_agl_m))
                .collect(),
            air: rows.iter().map(|r| r.air).collect(),
        })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether it has no rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Names of the platforms.
    pub fn platforms(&self) -> &[String] {
        &self.platforms
    }

    /// Rows of each platform.
    pub fn ranges(&self) -> &[Range<usize>] {
        &self.ranges
    }

    /// Times of all rows, s.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Logged place of row `i`.
    pub fn place(&self, i: usize) -> Place {
        Place {
            east_m: self.east_m[i],
            north_m: self.north_m[i],
            height_agl_m: self.height_m[i],
        }
    }

    /// Logged air of all rows.
    pub fn air(&self) -> &[Ambient] {
        &self.air
    }

    /// Transport of all rows, at the first source's effective height.
    pub fn transport(&self) -> &[Transport] {
        &self.transport
    }

    /// The same, to be replaced by a smoothed one.
    pub fn transport_mut(&mut self) -> &mut [Transport] {
        &mut self.transport
    }

    /// Factor on all plumes of every row. One at first.
    pub fn plume_factor_mut(&mut self) -> &mut [f64] {
        &mut self.plume_factor
    }

    /// Sets what puffs do to the first `plumes` straight plumes of the world ([`crate::puffs`]), by
    /// the ratio for a plume at a row's place, time in s and transport. Further plumes stay straight,
    /// as all do at first.
    pub fn set_puff_ratios(
        &mut self,
        plumes: usize,
        ratio: impl Fn(usize, &Place, f64, Transport) -> f64,
    ) {
        let of_row = |plume, i| ratio(plume, &self.place(i), self.time_s[i], self.transport[i]);
        let of = |plume| (0..self.len()).map(|i| of_row(plume, i)).collect();
        self.puff_ratios = (0..plumes).map(of).collect();
    }

    /// How long before every row the wind, on the mean of the way that the air took from the source,
    /// turned it, s: the time of which a drift of the wind is taken. Zero at first, and for a plume
    /// that is as the wind of the moment has it.
    pub fn wind_age_s(&self) -> &[f64] {
        &self.wind_age_s
    }

    /// The same, to be replaced.
    pub fn wind_age_s_mut(&mut self) -> &mut [f64] {
        &mut self.wind_age_s
    }

    /// Predicted readings of all rows, ppm, without noise and quantisation. `readings` must have
    /// [`Track::len`] elements; extra ones are left alone.
    pub fn predict(&self, world: &World, readings: &mut [f64]) {
        self.predict_parts(world, readings, None);
    }

    /// The same, and what of each reading is due to the plume, after lag and slope.
    pub fn predict_parts(
        &self,
        world: &World,
        readings: &mut [f64],
        mut plume_part: Option<&mut [f64]>,
    ) {
        let spec = world.spec();
        for (platform, range) in self.platforms.iter().zip(&self.ranges) {
            let effects = spec.sensor.effects(&spec.mechanisms, platform);
            let excess = &mut readings[range.clone()];
            self.excess(world, &effects, range.clone(), excess);
            if let Some(parts) = plume_part.as_deref_mut() {
                let part = &mut parts[range.clone()];
                part.copy_from_slice(excess);
                self.lag(&effects, range.clone(), part);
                part.iter_mut().for_each(|p| *p *= effects.gain);
            }
            for (i, value) in range.clone().zip(excess.iter_mut()) {
                *value += world.background_ppm(&self.place(i), self.time_s[i]);
            }
            self.lag(&effects, range.clone(), excess);
            self.convert(&effects, range.clone(), excess);
        }
    }

    /// Time constants of every platform's sensor, its own and those added in series together, s.
    pub fn lags_s(&self, world: &World) -> Vec<f64> {
        let spec = world.spec();
        let of = |platform: &String| {
            let effects = spec.sensor.effects(&spec.mechanisms, platform);
            effects.lags_s.iter().sum()
        };
        self.platforms.iter().map(of).collect()
    }

    fn excess(&self, world: &World, effects: &SensorEffects, range: Range<usize>, out: &mut [f64]) {
        let moved = effects.clock_s != 0.0;
        let [east, north, up] = effects.position_m;
        let mut cursor = range.start;
        for (i, value) in range.clone().zip(out.iter_mut()) {
            let (mut place, mut wind, mut time) =
                (self.place(i), self.transport[i], self.time_s[i]);
            if moved {
                time -= effects.clock_s;
                cursor = self.seek(range.clone(), cursor, time);
                (place, wind) = self.between(range.clone(), cursor, time);
            }
            place.east_m -= east;
            place.north_m -= north;
            place.height_agl_m -= up;
            let ratio = |plume: usize| self.puff_ratios.get(plume).map_or(1.0, |r| r[i]);
            let (molar, direct) = world.excess_after(&place, time, self.wind_age_s[i], wind, ratio);
            *value = (molar * self.ppm_per_mol_m3[i] + direct) * self.plume_factor[i];
        }
    }

    /// The row at or before `time_s` in `range`, searched from `cursor`.
    fn seek(&self, range: Range<usize>, cursor: usize, time_s: f64) -> usize {
        let mut i = cursor.clamp(range.start, range.end - 1);
        while i > range.start && self.time_s[i] > time_s {
            i -= 1;
        }
        while i + 1 < range.end && self.time_s[i + 1] <= time_s {
            i += 1;
        }
        i
    }

    /// Place and transport at `time_s`, straight between rows; beyond the ends as at the ends.
    fn between(&self, range: Range<usize>, i: usize, time_s: f64) -> (Place, Transport) {
        let (a, wind) = (self.place(i), self.transport[i]);
        if i + 1 >= range.end || time_s <= self.time_s[i] {
            return (a, wind);
        }
        let b = self.place(i + 1);
        let part = (time_s - self.time_s[i]) / (self.time_s[i + 1] - self.time_s[i]);
        let place = Place {
            east_m: a.east_m + part * (b.east_m - a.east_m),
            north_m: a.north_m + part * (b.north_m - a.north_m),
            height_agl_m: a.height_agl_m + part * (b.height_agl_m - a.height_agl_m),
        };
        (
            place,
            if part < 0.5 {
                wind
            } else {
                self.transport[i + 1]
            },
        )
    }

    fn lag(&self, effects: &SensorEffects, range: Range<usize>, values: &mut [f64]) {
        let times = &self.time_s[range];
        for &tau in &effects.lags_s {
            let Some(&first) = values.first() else { return };
            let input = values.to_vec();
            let mut state = first;
            // Rows mostly keep one step: its coefficients are worked out once.
            let mut step = LagStep::new(0.0, tau);
            if input.len() < 2 {
                return;
            }
            let mut slope_before = slope(times, &input, 0);
            for k in 1..values.len() {
                let dt = times[k] - times[k - 1];
                if dt != step.dt_s {
                    step = LagStep::new(dt, tau);
                }
                let slope_now = slope(times, &input, k);
                state = step.decay * state + step.before * input[k - 1] + step.now * input[k];
                if dt <= LONGEST_CURVED_S {
                    state += step.slope_before * slope_before + step.slope_now * slope_now;
                }
                slope_before = slope_now;
                values[k] = state;
            }
        }
    }

    fn convert(&self, effects: &SensorEffects, range: Range<usize>, values: &mut [f64]) {
        let crossed = effects.humidity[0] != 0.0
            || effects.temperature[0] != 0.0
            || effects.pressure[0] != 0.0;
        for (i, value) in range.zip(values.iter_mut()) {
            let mut reading =
                effects.gain * *value + effects.offset_ppm + effects.drift_ppm_s * self.time_s[i];
            if crossed {
                reading += effects.cross_ppm(&self.air[i]);
            }
            *value = reading.min(effects.limit_ppm);
        }
    }
}

/// Longest step over which the input is taken as curved, s: beyond it nobody knows.
const LONGEST_CURVED_S: f64 = 3.0;

/// Slope at row `k` of a parabola through it and its neighbours, per second.
fn slope(times: &[f64], values: &[f64], k: usize) -> f64 {
    let chord = |k: usize| (values[k] - values[k - 1]) / (times[k] - times[k - 1]);
    let last = values.len() - 1;
    // Over a stretch the two end slopes of a parabola have the chord's as their mean.
    match k {
        _ if last < 2 => return chord(1),
        0 => return 2.0 * chord(1) - slope(times, values, 1),
        _ if k == last => return 2.0 * chord(last) - slope(times, values, last - 1),
        _ => {}
    }
    let (before, after) = (times[k] - times[k - 1], times[k + 1] - times[k]);
    if before > LONGEST_CURVED_S || after > LONGEST_CURVED_S {
        return chord(k);
    }
    let (rise, next) = (values[k] - values[k - 1], values[k + 1] - values[k]);
    (rise * after / before + next * before / after) / (before + after)
}

/// One step of a first-order lag while the input follows the cubic of Hermite through two rows
/// with given slopes, as weights of what it starts from: a straight line between rows a second
/// apart would cut the peaks off a narrow plume.
struct LagStep {
    dt_s: f64,
    decay: f64,
    before: f64,
    now: f64,
    slope_before: f64,
    slope_now: f64,
}

impl LagStep {
    fn new(dt_s: f64, time_constant_s: f64) -> Self {
        // The cubic is the straight line, which lag_step has exactly, and the rest of the
        // Hermite polynomials: t(1-t)((1-2t)(u0-u1) + dt((1-t) m0 - t m1)) on 0 to 1.
        let weight = |f: &dyn Fn(f64) -> f64| answer_to(dt_s / time_constant_s, f);
        let bend = weight(&|t| t * (1.0 - t) * (1.0 - 2.0 * t));
        Self {
            dt_s,
            decay: lag_step(1.0, 0.0, 0.0, dt_s, time_constant_s),
            before: lag_step(0.0, 1.0, 0.0, dt_s, time_constant_s) + bend,
            now: lag_step(0.0, 0.0, 1.0, dt_s, time_constant_s) - bend,
            slope_before: dt_s * weight(&|t| t * (1.0 - t) * (1.0 - t)),
            slope_now: -dt_s * weight(&|t| t * t * (1.0 - t)),
        }
    }
}

/// Answer at the end of a unit step to an input `f` of the part of the step gone, by a lag from
/// rest whose time constant is 1/`rate` steps: k∫exp(-k(1-t)) f(t) dt, by Gauss–Legendre
/// quadrature over the stretch that the lag remembers.
fn answer_to(rate: f64, f: &dyn Fn(f64) -> f64) -> f64 {
    const NODES: [(f64, f64); 5] = [
        (0.046_910_077_030_668, 0.118_463_442_528_095),
        (0.230_765_344_947_158, 0.239_314_335_249_683),
        (0.5, 0.284_444_444_444_444),
        (0.769_234_655_052_842, 0.239_314_335_249_683),
        (0.953_089_922_969_332, 0.118_463_442_528_095),
    ];
    const PIECES: usize = 8;
    if rate.is_nan() || rate <= 0.0 {
        return 0.0;
    }
    let reach = (40.0 / rate).min(1.0);
    let piece = reach / PIECES as f64;
    let mut sum = 0.0;
    for k in 0..PIECES {
        for (node, weight) in NODES {
            let back = (k as f64 + node) * piece;
            sum += weight * piece * rate * (-rate * back).exp() * f(1.0 - back);
        }
    }
    sum
}

fn row_transport(spec: &WorldSpec, row: &Row) -> Transport {
    let height = spec.sources[0].effective_height_agl_m;
    match row.wind {
        Some((speed, from_deg)) => {
            let here = spec.wind.speed_at_m_s(row.place.height_agl_m);
            let ratio = if here > 0.0 {
                spec.wind.speed_at_m_s(height) / here
            } else {
                1.0
            };
            Transport::new(from_deg, speed * ratio)
        }
        None => Transport::new(spec.wind.from_deg(), spec.wind.speed_at_m_s(height)),
    }
}

fn ranges(platforms: usize, rows: &[Row]) -> Result<Vec<Range<usize>>, PlumeError> {
    let wrong = |problem: String| PlumeError::Shape {
        what: "observation track",
        problem,
    };
    let mut out = vec![0..0; platforms];
    for (i, row) in rows.iter().enumerate() {
        let Some(range) = out.get_mut(row.platform) else {
            return Err(wrong(format!(
                "row {i} has platform {}, of {platforms}",
                row.platform
            )));
        };
        let place = row.place;
        let numbers = [row.time_s, place.east_m, place.north_m, place.height_agl_m];
        let wind = row.wind.unwrap_or((1.0, 0.0));
        if !numbers.iter().all(|v| v.is_finite()) || !wind.0.is_finite() || !wind.1.is_finite() {
            return Err(wrong(format!(
                "row {i} has a place, time or wind that is not finite"
            )));
        }
        if range.start == range.end {
            *range = i..i + 1;
        } else if range.end == i && rows[i - 1].time_s < row.time_s {
            range.end = i + 1;
        } else {
            return Err(wrong(format!(
                "row {i} breaks the order: platform by platform, each with increasing times"
            )));
        }
    }
    Ok(out)
}

#[cfg(test)]
#[path = "track_tests.rs"]
mod tests;
