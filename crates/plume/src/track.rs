//! The one forward model of observations: rows of places, times and logged air of one or many
//! platforms to the readings that a model with its mechanisms predicts.
//!
//! Rows stand platform by platform, in order of time; columns are stored apart so that a
//! prediction is one pass over memory, because a fit asks for hundreds of them.

use std::ops::Range;
use std::sync::Arc;

use crate::PlumeError;
use crate::effects::{SensorAir, SensorEffects};
use air::geo::Enu;

use crate::field::along::RowColumns;
use crate::field::batch::PlaceColumns;
use crate::field::{DispersionModel, DispersionSpec, InPlume, Place, Transport, cos_sin, rotate};
use crate::lag;
use crate::means::{Means, Span, middles};
pub use crate::row::Row;
use crate::sample_points::{SamplePoint, SamplePoints};
use crate::stability::Stability;

/// Rows of all platforms as columns.
#[derive(Debug, Clone)]
pub struct Track {
    platforms: Arc<[String]>,
    ranges: Arc<[Range<usize>]>,
    samples: Arc<SamplePoints>,
    time_s: Arc<[f64]>,
    east_m: Arc<[f64]>,
    north_m: Arc<[f64]>,
    height_m: Arc<[f64]>,
    /// The same above an axis that the air has not raised, where it has raised some.
    height_in_plume_m: Arc<[f64]>,
    /// All that differs between winds, for which tracks are made by the hundred.
    transport: Vec<Transport>,
    ppm_per_mol_m3: Arc<[f64]>,
    air: Arc<[SensorAir]>,
    /// The stability class of the air of each row, where it changes.
    classes: Option<Arc<[Stability]>>,
    /// What readings are means over, where some are.
    means: Option<Box<Means>>,
    /// [`Span::spread_s`] of each row, where some row is the mean of several readings.
    spread_s: Option<Arc<[f64]>>,
}

/// Longest step from a row to its neighbours over which their values show how the reading curves, s: rows of one second,
/// with one missing.
const MAX_SPREAD_STEP_S: f64 = 2.0;

impl Track {
    /// A track from rows that stand platform by platform, each in order of time. The logged
    /// wind speed is carried to the first source's effective height by the scenario's profile.
    ///
    /// # Errors
    /// Rows out of order, a platform index without a name, or a value that is not finite.
    pub fn new(
        model: &DispersionModel,
        platforms: &[String],
        rows: &[Row],
    ) -> Result<Self, PlumeError> {
        let ranges = ranges(platforms.len(), rows)?;
        let spec = model.spec();
        let transport: Vec<Transport> = rows.iter().map(|r| row_transport(spec, r)).collect();
        let height_m: Arc<[f64]> = rows.iter().map(|r| r.place.height_agl_m).collect();
        Ok(Self {
            platforms: platforms.into(),
            samples: SamplePoints::new(model, &ranges, rows, &transport).into(),
            ranges: ranges.into(),
            time_s: rows.iter().map(|r| r.time_s).collect(),
            east_m: rows.iter().map(|r| r.place.east_m).collect(),
            north_m: rows.iter().map(|r| r.place.north_m).collect(),
            height_in_plume_m: Arc::clone(&height_m),
            height_m,
            transport,
            ppm_per_mol_m3: rows
                .iter()
                .map(|r| model.ppm_per_mol_m3(r.place.height_agl_m))
                .collect(),
            air: rows.iter().map(|r| r.air).collect(),
            classes: None,
            means: None,
            spread_s: None,
        })
    }

    /// The same of rows whose readings are means over `spans`, one for each. A row then stands at the middle of its
    /// time and line, and has its wind and air in the mean over them.
    ///
    /// # Errors
    /// As of [`Track::new`], and another number of spans than of rows, or a time of a span that is not finite.
    pub fn of_means(
        model: &DispersionModel,
        platforms: &[String],
        rows: &[Row],
        spans: &[Span],
    ) -> Result<Self, PlumeError> {
        let is_known = |s: &Span| s.averaging_s.is_finite() && s.spread_s.is_finite();
        if spans.len() != rows.len() || !spans.iter().all(is_known) {
            return Err(PlumeError::Shape {
                what: "observation track",
                problem: format!("{} finite spans of {} rows", spans.len(), rows.len()),
            });
        }
        if spans.iter().all(Span::is_a_point) {
            let mut track = Self::new(model, platforms, rows)?;
            let is_spread = spans.iter().any(|s| s.spread_s > 0.0);
            track.spread_s = is_spread.then(|| spans.iter().map(|s| s.spread_s).collect());
            return Ok(track);
        }
        ranges(platforms.len(), rows)?;
        let mut track = Self::new(model, platforms, &middles(rows, spans))?;
        let means = Means::new(model, &track, rows, spans)?;
        track.means = Some(Box::new(means));
        Ok(track)
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
    pub fn air(&self) -> &[SensorAir] {
        &self.air
    }

    /// Transport of all rows, at the first source's effective height.
    pub fn transport(&self) -> &[Transport] {
        &self.transport
    }

    /// The same, to be replaced by a smoothed one; of means over a time or a line only that of their middles.
    pub fn transport_mut(&mut self) -> &mut [Transport] {
        &mut self.transport
    }

    /// Lets other winds carry the plume, of which `wind` tells each by place, time and what has carried it there.
    pub fn carry(&mut self, wind: &mut dyn FnMut(Place, f64, Transport) -> Transport) {
        for i in 0..self.len() {
            self.transport[i] = wind(self.place(i), self.time_s[i], self.transport[i]);
        }
        if let Some(means) = &mut self.means {
            means.carry(wind);
        }
    }

    /// The same track in air whose stability class is `class` at each time, instead of the model's.
    #[must_use]
    pub fn in_classes(mut self, class: &dyn Fn(f64) -> Stability) -> Self {
        self.classes = Some(self.time_s.iter().map(|t| class(*t)).collect());
        self.means = self.means.map(|m| Box::new(m.in_classes(class)));
        self
    }

    /// The models of the classes that the rows have; the model alone where they have its own.
    fn models(&self, model: &DispersionModel) -> Vec<(Stability, DispersionModel)> {
        let Some(classes) = &self.classes else {
            return Vec::new();
        };
        let present = Stability::ALL.into_iter().filter(|c| classes.contains(c));
        let of = |stability| {
            let spec = DispersionSpec {
                stability,
                ..model.spec().clone()
            };
            // A class makes of a model that holds one that holds.
            Some((stability, DispersionModel::new(spec).ok()?))
        };
        present.filter_map(of).collect()
    }

    /// Fills in the plumes' part of the air at rows or points, each in its own class.
    fn fill(
        &self,
        (model, models): (&DispersionModel, &[(Stability, DispersionModel)]),
        conditions: &Conditions,
        of_rows: &[usize],
        offset_m: [f64; 3],
        out: &mut [f64],
    ) {
        let Some(classes) = &self.classes else {
            model.fill_excess(&conditions.columns(), offset_m, out);
            return;
        };
        for (class, model) in models {
            let own = (0..of_rows.len()).filter(|k| classes[of_rows[*k]] == *class);
            let own: Vec<usize> = own.collect();
            let part = conditions.some(&own);
            let mut values = vec![0.0; own.len()];
            model.fill_excess(&part.columns(), offset_m, &mut values);
            own.iter()
                .zip(values)
                .for_each(|(k, value)| out[*k] = value);
        }
    }

    /// How long the air of row `i` has been under way from a place, in the row's wind, s.
    pub fn under_way_s(&self, i: usize, from: Enu) -> f64 {
        let far_m = (self.east_m[i] - from.east_m).hypot(self.north_m[i] - from.north_m);
        self.transport[i].under_way_s(far_m)
    }

    /// The same track in a wind that is turned clockwise by a number of degrees at every row.
    #[must_use]
    pub fn turned(&self, clockwise_deg: &[f64]) -> Self {
        let mut out = self.clone();
        if let Some(means) = &mut out.means {
            **means = means.turned(clockwise_deg);
        }
        // Mostly all rows turn by the same: one sine and cosine.
        let (mut last_deg, mut turn) = (f64::NAN, (1.0, 0.0));
        for (transport, deg) in out.transport.iter_mut().zip(clockwise_deg) {
            if *deg != last_deg {
                (last_deg, turn) = (*deg, cos_sin(*deg));
            }
            *transport = rotate(*transport, turn);
        }
        out
    }

    /// The same track in a plume whose axis rises from a source at these slopes, degrees, at every row.
    #[must_use]
    pub fn inclined(&self, upward_deg: &[f64], source: Enu) -> Self {
        let mut out = self.clone();
        if let Some(means) = &mut out.means {
            **means = means.inclined(upward_deg, source);
        }
        let below_m = |(i, deg): (usize, &f64)| {
            let far_m = (self.east_m[i] - source.east_m).hypot(self.north_m[i] - source.north_m);
            self.height_m[i] - far_m * deg.to_radians().tan()
        };
        out.height_in_plume_m = upward_deg.iter().enumerate().map(below_m).collect();
        out
    }

    /// Where every row lies in the plume of the first source; none upwind of it.
    pub fn in_first_plume(&self, model: &DispersionModel) -> Vec<Option<InPlume>> {
        if let Some(means) = &self.means {
            return means.in_first_plume(model);
        }
        (0..self.len())
            .map(|i| model.in_first_plume(&self.place(i), self.time_s[i], self.transport[i]))
            .collect()
    }

    /// Predicted readings of all rows, ppm, without noise and quantisation. `readings` must have
    /// [`Track::len`] elements; extra ones are left alone.
    pub fn predict(&self, model: &DispersionModel, readings: &mut [f64]) {
        self.predict_parts(model, readings, None);
    }

    /// The same, and what of each reading is due to the plume, after lag and slope.
    pub fn predict_parts(
        &self,
        model: &DispersionModel,
        readings: &mut [f64],
        mut plume_part: Option<&mut [f64]>,
    ) {
        if let Some(means) = &self.means {
            means.predict(model, readings, plume_part);
            return;
        }
        let spec = model.spec();
        let models = self.models(model);
        for (which, platform) in self.platforms.iter().enumerate() {
            let range = self.ranges[which].clone();
            let effects = spec.sensor.effects(&spec.mechanisms, platform);
            let excess = &mut readings[range.clone()];
            self.excess((model, &models), &effects, range.clone(), excess);
            let mut between = self.excess_between((model, &models), &effects, which);
            if let Some(parts) = plume_part.as_deref_mut() {
                // The lag is linear, so that the plume's part and the background may pass it apart.
                let part = &mut parts[range.clone()];
                part.copy_from_slice(excess);
                self.lag(&effects, which, part, &between);
                self.spread(range.clone(), part);
                part.iter_mut().for_each(|p| *p *= effects.gain);
            }
            for (i, value) in range.clone().zip(excess.iter_mut()) {
                *value += model.background_ppm(&self.place(i), self.time_s[i]);
            }
            for (point, value) in self.samples.between(which).zip(&mut between) {
                let place = self.place_on(point.row, point.share);
                *value += model.background_ppm(&place, point.time_s);
            }
            self.lag(&effects, which, excess, &between);
            self.spread(range.clone(), excess);
            self.convert(&effects, range.clone(), excess);
        }
    }

    /// The plumes' part of the air at the rows of a platform, ppm.
    fn excess(
        &self,
        (model, models): (&DispersionModel, &[(Stability, DispersionModel)]),
        effects: &SensorEffects,
        range: Range<usize>,
        out: &mut [f64],
    ) {
        if effects.clock_s != 0.0 || self.classes.is_some() {
            let times_s = self.time_s[range.clone()].iter().copied();
            let of_rows: Vec<usize> = range.clone().collect();
            let conditions = self.conditions(effects, range, times_s);
            self.fill(
                (model, models),
                &conditions,
                &of_rows,
                effects.position_m,
                out,
            );
            return;
        }
        let rows = RowColumns {
            places: PlaceColumns {
                east_m: &self.east_m[range.clone()],
                north_m: &self.north_m[range.clone()],
                height_agl_m: &self.height_in_plume_m[range.clone()],
            },
            time_s: &self.time_s[range.clone()],
            wind: &self.transport[range.clone()],
            ppm_per_mol_m3: &self.ppm_per_mol_m3[range],
        };
        model.fill_excess(&rows, effects.position_m, out);
    }

    /// The same at its points between rows.
    fn excess_between(
        &self,
        models: (&DispersionModel, &[(Stability, DispersionModel)]),
        effects: &SensorEffects,
        which: usize,
    ) -> Vec<f64> {
        let times_s = self.samples.between(which).map(|s| s.time_s);
        let conditions = self.conditions(effects, self.ranges[which].clone(), times_s);
        let mut out = vec![0.0; conditions.time_s.len()];
        let of_rows: Vec<usize> = self.samples.between(which).map(|s| s.row).collect();
        self.fill(models, &conditions, &of_rows, effects.position_m, &mut out);
        out
    }

    /// Returns the conditions at the sensor of the rows `range` when its clock showed each of `clock_times_s`, which grow,
    /// on the path between two rows.
    fn conditions(
        &self,
        effects: &SensorEffects,
        range: Range<usize>,
        clock_times_s: impl Iterator<Item = f64>,
    ) -> Conditions {
        let mut conditions = Conditions::default();
        let mut row = range.start;
        for clock_time_s in clock_times_s {
            let time_s = clock_time_s - effects.clock_s;
            row = self.seek(range.clone(), row, time_s);
            let share = self.share(range.clone(), row, time_s);
            let place = self.place_on(row, share);
            conditions.east_m.push(place.east_m);
            conditions.north_m.push(place.north_m);
            let height_m = interpolated(&self.height_in_plume_m, row, share);
            conditions.height_m.push(height_m);
            conditions.time_s.push(time_s);
            conditions.wind.push(self.transport_on(row, share));
            let ppm = interpolated(&self.ppm_per_mol_m3, row, share);
            conditions.ppm_per_mol_m3.push(ppm);
        }
        conditions
    }

    /// The row at or before `time_s` in `range`, searched from `cursor`.
    fn seek(&self, range: Range<usize>, cursor: usize, time_s: f64) -> usize {
        // From the last answer: times mostly go forward, and a search from there takes a step or two.
        let mut i = cursor.clamp(range.start, range.end - 1);
        while i > range.start && self.time_s[i] > time_s {
            i -= 1;
        }
        while i + 1 < range.end && self.time_s[i + 1] <= time_s {
            i += 1;
        }
        i
    }

    /// The share of the way from row `i` to the next in `range` that is behind at `time_s`; none
    /// beyond the ends.
    fn share(&self, range: Range<usize>, i: usize, time_s: f64) -> f64 {
        if i + 1 >= range.end || time_s <= self.time_s[i] {
            return 0.0;
        }
        (time_s - self.time_s[i]) / (self.time_s[i + 1] - self.time_s[i])
    }

    /// The place on the straight way from row `i` to the next.
    #[inline]
    fn place_on(&self, i: usize, share: f64) -> Place {
        Place {
            east_m: interpolated(&self.east_m, i, share),
            north_m: interpolated(&self.north_m, i, share),
            height_agl_m: interpolated(&self.height_m, i, share),
        }
    }

    /// The transport of the row that is nearer: it hardly turns from one row to the next.
    fn transport_on(&self, i: usize, share: f64) -> Transport {
        self.transport[if share < 0.5 { i } else { i + 1 }]
    }

    /// What the sensor of a platform shows of the air at its rows, in their place; `between` are the
    /// values at the points between them.
    fn lag(&self, effects: &SensorEffects, which: usize, values: &mut [f64], between: &[f64]) {
        let range = self.ranges[which].clone();
        if between.is_empty() {
            for &time_constant_s in &effects.lags_s {
                lag::apply(&self.time_s[range.clone()], time_constant_s, values);
            }
            return;
        }
        let mut between = between.iter();
        let mut next = |point: SamplePoint| match point.share {
            0.0 => values.get(point.row - range.start),
            _ => between.next(),
        };
        let conditions = self
            .samples
            .of(which)
            .map(|s| next(s).copied().unwrap_or_default());
        let mut shown: Vec<f64> = conditions.collect();
        for &time_constant_s in &effects.lags_s {
            lag::apply(self.samples.times_s(which), time_constant_s, &mut shown);
        }
        let points = self.samples.of(which).zip(shown);
        for ((_, shown), value) in points.filter(|(s, _)| s.is_row()).zip(values) {
            *value = shown;
        }
    }

    /// Replaces the values of moments by means over readings about them, to second order: their variance in time times half
    /// the curvature of a parabola through three rows. A plume that a vehicle crosses in some seconds is otherwise
    /// estimated too wide by the path of a second.
    fn spread(&self, range: Range<usize>, values: &mut [f64]) {
        let Some(spread_s) = &self.spread_s else {
            return;
        };
        let time_s = &self.time_s[range.clone()];
        let spread_s = &spread_s[range];
        let mut before = values.first().copied().unwrap_or_default();
        for k in 1..values.len().saturating_sub(1) {
            let value = values[k];
            let steps_s = [time_s[k] - time_s[k - 1], time_s[k + 1] - time_s[k]];
            if steps_s.iter().all(|s| *s <= MAX_SPREAD_STEP_S) {
                let slopes = [
                    (value - before) / steps_s[0],
                    (values[k + 1] - value) / steps_s[1],
                ];
                let half_curvature = (slopes[1] - slopes[0]) / (steps_s[0] + steps_s[1]);
                values[k] += spread_s[k].powi(2) * half_curvature;
            }
            before = value;
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

/// The conditions at a sensor at some times, in columns.
#[derive(Default)]
struct Conditions {
    east_m: Vec<f64>,
    north_m: Vec<f64>,
    height_m: Vec<f64>,
    time_s: Vec<f64>,
    wind: Vec<Transport>,
    ppm_per_mol_m3: Vec<f64>,
}

impl Conditions {
    /// Some of them.
    fn some(&self, which: &[usize]) -> Self {
        let of = |column: &[f64]| which.iter().map(|k| column[*k]).collect();
        Self {
            east_m: of(&self.east_m),
            north_m: of(&self.north_m),
            height_m: of(&self.height_m),
            time_s: of(&self.time_s),
            wind: which.iter().map(|k| self.wind[*k]).collect(),
            ppm_per_mol_m3: of(&self.ppm_per_mol_m3),
        }
    }

    fn columns(&self) -> RowColumns<'_> {
        RowColumns {
            places: PlaceColumns {
                east_m: &self.east_m,
                north_m: &self.north_m,
                height_agl_m: &self.height_m,
            },
            time_s: &self.time_s,
            wind: &self.wind,
            ppm_per_mol_m3: &self.ppm_per_mol_m3,
        }
    }
}

/// The value between row `i` and the next, straight.
#[inline]
fn interpolated(of_rows: &[f64], i: usize, share: f64) -> f64 {
    if share == 0.0 {
        return of_rows[i];
    }
    of_rows[i] + share * (of_rows[i + 1] - of_rows[i])
}

fn row_transport(spec: &DispersionSpec, row: &Row) -> Transport {
    let height = spec.sources[0].effective_height_agl_m;
    match row.wind {
        // The power law's ratio, not its speed: the log knows how strong the wind is now, the
        // profile only how it changes with height.
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
                "row {i} is out of order; expected rows platform by platform, each with increasing times"
            )));
        }
    }
    Ok(out)
}

#[cfg(test)]
#[path = "track_tests.rs"]
mod tests;
