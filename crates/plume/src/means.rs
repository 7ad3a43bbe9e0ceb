//! Readings that are means: over the time before they are logged, along the straight line between two places, or both.
//!
//! Each is the weighted mean of what a sensor would read at points: moments in the middle of parts of the time, places in
//! the middle of parts of the line. Parts are short beside the plume that is met there and beside what is known of
//! the wind. The points of a place along the line are a series in time, so that a slow sensor remembers.

use std::sync::Arc;

use air::geo::Enu;

use crate::PlumeError;
use crate::field::{DispersionModel, InPlume, Place, Transport};
use crate::row::Row;
use crate::stability::Stability;
use crate::track::Track;

/// What a reading is the mean over.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Span {
    /// A time that ends at the row's, s; 0 for a moment.
    pub averaging_s: f64,
    /// The other end of a line that begins at the row's place; none for a point.
    pub to: Option<Place>,
    /// Standard deviation of the times of the readings whose plain mean, at their mean time, the row is, s; 0 of one.
    pub spread_s: f64,
}

impl Span {
    /// Whether it is one moment at one place.
    pub fn is_a_point(&self) -> bool {
        self.averaging_s <= 0.0 && self.to.is_none()
    }
}

/// Length of a part of a line, or of the way that a platform goes in a part of the time, over the plume's standard
/// deviation there, at most. Midpoints h apart are right to 2 exp(-2 π² σ²/h²) of a normal law (Trefethen and Weideman
/// 2014, theorem 5.1): to 3 in 10⁴ where a plume is found to be a third as wide. Of a line that ends inside of a plume they
/// are right to 2 in 10³ of its middle; times end there as a rule, and are cut into twice as many parts.
const MAX_PART_SIGMAS: f64 = 0.5;
/// Most parts of a line, and of an averaging time: cost.
const MOST_PLACES: usize = 256;
const MOST_MOMENTS: usize = 60;
/// A plume is no narrower than so near its source, m.
const NEAREST_M: f64 = 1.0;

/// The points of all rows.
#[derive(Debug, Clone)]
pub(crate) struct Means {
    points: Track,
    of_rows: Arc<[OfRow]>,
    /// How long the part of each point is, s; 0 of a moment.
    duration_s: Arc<[f64]>,
    row_of: Arc<[usize]>,
}

/// Which points a row is the mean of: `count` in each of `places` series, which begin `stride` apart.
#[derive(Debug, Clone, Copy)]
struct OfRow {
    first: usize,
    count: usize,
    places: usize,
    stride: usize,
}

impl OfRow {
    fn points(self) -> impl Iterator<Item = usize> {
        let series = move |p: usize| (0..self.count).map(move |k| self.first + p * self.stride + k);
        (0..self.places).flat_map(series)
    }
}

/// A part of the time that somebody's readings are means over.
#[derive(Debug, Clone, Copy)]
struct Part {
    from_s: f64,
    to_s: f64,
    row: usize,
}

impl Part {
    fn middle_s(self) -> f64 {
        0.5 * (self.from_s + self.to_s)
    }
}

/// The rows at the middles of what they are means over; each later than the one before of its platform.
pub(crate) fn middles(rows: &[Row], spans: &[Span]) -> Vec<Row> {
    let mut out: Vec<Row> = Vec::with_capacity(rows.len());
    for (i, (row, span)) in rows.iter().zip(spans).enumerate() {
        let mut time_s = row.time_s - 0.5 * span.averaging_s;
        if let (Some(last), Some(before)) = (out.last(), i.checked_sub(1).map(|k| &rows[k]))
            && before.platform == row.platform
        {
            // Means over times of different lengths: still in order.
            time_s = time_s.max(last.time_s + 0.5 * (row.time_s - last.time_s) * LEAST_STEP);
        }
        let own = Way { rows, spans };
        let platform = first_of(rows, i)..end_of(rows, i);
        let place = own.place(platform, time_s, 0.5);
        out.push(Row {
            time_s,
            place,
            ..*row
        });
    }
    out
}

/// Part of the way to its own time by which a row comes after the one before at least.
const LEAST_STEP: f64 = 1e-3;

fn first_of(rows: &[Row], i: usize) -> usize {
    rows[..i].partition_point(|r| r.platform != rows[i].platform)
}

fn end_of(rows: &[Row], i: usize) -> usize {
    i + rows[i..].partition_point(|r| r.platform == rows[i].platform)
}

/// Where platforms are at any time.
struct Way<'a> {
    rows: &'a [Row],
    spans: &'a [Span],
}

impl Way<'_> {
    /// The place at a time, in this part of the line from the row's place to the other end.
    fn place(&self, platform: std::ops::Range<usize>, time_s: f64, part: f64) -> Place {
        let own = &self.rows[platform.clone()];
        let next = own.partition_point(|r| r.time_s < time_s);
        let at = |k: usize| {
            let (from, to) = (own[k].place, self.spans[platform.start + k].to);
            to.map_or(from, |to| between(from, to, part))
        };
        match (next.checked_sub(1), next < own.len()) {
            (Some(k), true) => {
                let (a, b) = (own[k].time_s, own[next].time_s);
                between(at(k), at(next), (time_s - a) / (b - a))
            }
            (Some(k), false) => at(k),
            (None, _) => at(0),
        }
    }
}

fn between(a: Place, b: Place, part: f64) -> Place {
    let mix = |a: f64, b: f64| a + part * (b - a);
    Place {
        east_m: mix(a.east_m, b.east_m),
        north_m: mix(a.north_m, b.north_m),
        height_agl_m: mix(a.height_agl_m, b.height_agl_m),
    }
}

impl Means {
    /// Those of `rows` with their `spans`, for a track whose rows at their middles have been carried by `transport`.
    pub fn new(
        model: &DispersionModel,
        track: &Track,
        rows: &[Row],
        spans: &[Span],
    ) -> Result<Self, PlumeError> {
        let log = Log::of(track, rows);
        let way = Way { rows, spans };
        let (mut names, mut points): (Vec<String>, Vec<Row>) = (Vec::new(), Vec::new());
        let (mut transport, mut duration_s, mut row_of) = (Vec::new(), Vec::new(), Vec::new());
        let mut of_rows = Vec::with_capacity(rows.len());
        for (platform, range) in track.platforms().iter().zip(track.ranges()) {
            let moments = |i: usize| moments(model, rows, spans, &log, i, range.start);
            let counts: Vec<usize> = range.clone().map(moments).collect();
            let parts = parts(rows, spans, range.clone(), &counts);
            let lines = range.clone().map(|i| {
                let to = spans[i].to;
                to.map_or(1, |to| places(model, rows[i].place, to, MOST_PLACES))
            });
            let places = lines.max().unwrap_or(1);
            let first = points.len();
            for place in 0..places {
                let share = (place as f64 + 0.5) / places as f64;
                for part in &parts {
                    let own = &rows[part.row];
                    let time_s = part.middle_s();
                    points.push(Row {
                        platform: names.len(),
                        time_s,
                        place: way.place(range.clone(), time_s, share),
                        wind: None,
                        air: own.air,
                    });
                    let is_alone = counts[part.row - range.start] == 1;
                    let as_row = track.transport()[part.row];
                    transport.push(if is_alone {
                        as_row
                    } else {
                        log.at(time_s, as_row)
                    });
                    duration_s.push(part.to_s - part.from_s);
                    row_of.push(part.row);
                }
                names.push(platform.clone());
            }
            for i in range.clone() {
                let (to_s, from_s) = (rows[i].time_s, rows[i].time_s - spans[i].averaging_s);
                let from = parts.partition_point(|p| p.from_s < from_s);
                let end = parts.partition_point(|p| p.to_s <= to_s);
                of_rows.push(OfRow {
                    first: first + from,
                    count: end.saturating_sub(from).max(1),
                    places,
                    stride: parts.len(),
                });
            }
        }
        let mut points = Track::new(model, &names, &points)?;
        points.transport_mut().copy_from_slice(&transport);
        Ok(Self {
            points,
            of_rows: of_rows.into(),
            duration_s: duration_s.into(),
            row_of: row_of.into(),
        })
    }

    /// Fills in the means of predicted readings, and of what is due to the plume.
    pub fn predict(
        &self,
        model: &DispersionModel,
        readings: &mut [f64],
        plume_part: Option<&mut [f64]>,
    ) {
        let mut read = vec![0.0; self.points.len()];
        let mut of_plume = vec![0.0; if plume_part.is_some() { read.len() } else { 0 }];
        let wanted = plume_part.is_some().then_some(&mut of_plume[..]);
        self.points.predict_parts(model, &mut read, wanted);
        self.average(&read, readings);
        if let Some(parts) = plume_part {
            self.average(&of_plume, parts);
        }
    }

    fn average(&self, of_points: &[f64], out: &mut [f64]) {
        for (own, out) in self.of_rows.iter().zip(out) {
            let (mut sum, mut weight, mut plain, mut count) = (0.0, 0.0, 0.0, 0.0);
            for k in own.points() {
                sum += self.duration_s[k] * of_points[k];
                weight += self.duration_s[k];
                plain += of_points[k];
                count += 1.0;
            }
            // Of a moment all points count alike.
            *out = if weight > 0.0 {
                sum / weight
            } else {
                plain / count
            };
        }
    }

    /// Where each row lies in the plume of the first source: where it meets it best.
    pub fn in_first_plume(&self, model: &DispersionModel) -> Vec<Option<InPlume>> {
        let points = self.points.in_first_plume(model);
        let off = |p: &InPlume| p.across_sigmas.powi(2) + p.above_sigmas.powi(2);
        let of = |own: &OfRow| {
            let met = own.points().filter_map(|k| points[k]);
            met.min_by(|a, b| off(a).total_cmp(&off(b)))
        };
        self.of_rows.iter().map(of).collect()
    }

    /// Lets other winds carry the plume to the points.
    pub fn carry(&mut self, wind: &mut dyn FnMut(Place, f64, Transport) -> Transport) {
        self.points.carry(wind);
    }

    /// The same in air whose stability class is `class` at each time.
    pub fn in_classes(self, class: &dyn Fn(f64) -> Stability) -> Self {
        Self {
            points: self.points.in_classes(class),
            ..self
        }
    }

    /// The same in a plume whose axis rises from a source at these slopes, degrees, at every row.
    pub fn inclined(&self, upward_deg: &[f64], source: Enu) -> Self {
        let slopes: Vec<f64> = self.row_of.iter().map(|i| upward_deg[*i]).collect();
        Self {
            points: self.points.inclined(&slopes, source),
            ..self.clone()
        }
    }

    /// The same in a wind turned clockwise by some degrees at every row.
    pub fn turned(&self, clockwise_deg: &[f64]) -> Self {
        let turns: Vec<f64> = self.row_of.iter().map(|i| clockwise_deg[*i]).collect();
        Self {
            points: self.points.turned(&turns),
            ..self.clone()
        }
    }
}

/// The winds that were logged, in order of time.
struct Log(Vec<(f64, Transport)>);

impl Log {
    fn of(track: &Track, rows: &[Row]) -> Self {
        let logged = (0..rows.len()).filter(|i| rows[*i].wind.is_some());
        let mut log: Vec<_> = logged
            .map(|i| (track.time_s()[i], track.transport()[i]))
            .collect();
        log.sort_by(|a, b| a.0.total_cmp(&b.0));
        log.dedup_by(|b, a| a.0 == b.0);
        Self(log)
    }

    /// How many times there are between two others.
    fn count(&self, from_s: f64, to_s: f64) -> usize {
        let before = |time_s: f64| self.0.partition_point(|l| l.0 < time_s);
        before(to_s).saturating_sub(before(from_s))
    }

    /// The wind logged nearest to a time; another where none is.
    fn at(&self, time_s: f64, otherwise: Transport) -> Transport {
        let next = self.0.partition_point(|l| l.0 < time_s);
        let near = [next.checked_sub(1), Some(next)].into_iter().flatten();
        let near = near.filter_map(|k| self.0.get(k));
        let nearest = near.min_by(|a, b| (a.0 - time_s).abs().total_cmp(&(b.0 - time_s).abs()));
        nearest.map_or(otherwise, |l| l.1)
    }
}

/// Into how many parts the averaging time of row `i` is cut: one for each wind that is logged meanwhile, or so many that
/// its platform goes no farther in each than the plume allows.
fn moments(
    model: &DispersionModel,
    rows: &[Row],
    spans: &[Span],
    log: &Log,
    i: usize,
    first: usize,
) -> usize {
    let averaging_s = spans[i].averaging_s;
    if averaging_s <= 0.0 {
        return 1;
    }
    let winds = log.count(rows[i].time_s - averaging_s, rows[i].time_s);
    let gone = if i > first {
        let step_s = rows[i].time_s - rows[i - 1].time_s;
        let parts = places(model, rows[i - 1].place, rows[i].place, MOST_MOMENTS);
        (2.0 * parts as f64 * averaging_s / step_s).ceil() as usize
    } else {
        1
    };
    winds.max(gone).clamp(1, MOST_MOMENTS)
}

/// Into how many parts the way from one place to another is cut.
fn places(model: &DispersionModel, from: Place, to: Place, most: usize) -> usize {
    let along_m = (to.east_m - from.east_m).hypot(to.north_m - from.north_m);
    let up_m = (to.height_agl_m - from.height_agl_m).abs();
    let of = |source: Enu| {
        let near_m = distance_m(from, to, source).max(NEAREST_M);
        let (sigma_y_m, sigma_z_m) = model.sigmas_m(near_m);
        (along_m / sigma_y_m).hypot(up_m / sigma_z_m) / MAX_PART_SIGMAS
    };
    let sources = model.spec().sources.iter().map(|s| of(s.place));
    (sources.fold(1.0, f64::max).ceil() as usize).clamp(1, most)
}

/// Distance along the ground of a source from the line between two places, m.
fn distance_m(from: Place, to: Place, source: Enu) -> f64 {
    let (east, north) = (to.east_m - from.east_m, to.north_m - from.north_m);
    let (de, dn) = (source.east_m - from.east_m, source.north_m - from.north_m);
    let square = east * east + north * north;
    let part = if square > 0.0 {
        ((de * east + dn * north) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (de - part * east).hypot(dn - part * north)
}

/// The parts of the times that the rows of a platform are means over, in order; those of several rows are shared.
fn parts(
    rows: &[Row],
    spans: &[Span],
    range: std::ops::Range<usize>,
    counts: &[usize],
) -> Vec<Part> {
    let (mut edges, mut out) = (Vec::new(), Vec::new());
    for i in range.clone() {
        let (to_s, averaging_s) = (rows[i].time_s, spans[i].averaging_s.max(0.0));
        edges.push((to_s - averaging_s, 1));
        edges.push((to_s, -1));
        if averaging_s == 0.0 {
            out.push(Part {
                from_s: to_s,
                to_s,
                row: i,
            });
        }
    }
    edges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut within, mut row) = (0, range.start);
    for edge in edges.windows(2) {
        let ((from_s, opens), (to_s, _)) = (edge[0], edge[1]);
        within += opens;
        if within <= 0 || to_s <= from_s {
            continue;
        }
        // The first row that ends no sooner; its time is in parts of one length.
        while row + 1 < range.end && rows[row].time_s < to_s {
            row += 1;
        }
        let step_s = spans[row].averaging_s / counts[row - range.start] as f64;
        let count = ((to_s - from_s) / step_s.max(f64::MIN_POSITIVE))
            .round()
            .clamp(1.0, MOST_MOMENTS as f64) as usize;
        let at = |k: usize| from_s + (to_s - from_s) * k as f64 / count as f64;
        let last = |k: usize| if k == count { to_s } else { at(k) };
        out.extend((0..count).map(|k| Part {
            from_s: at(k),
            to_s: last(k + 1),
            row,
        }));
    }
    out.sort_by(|a, b| a.middle_s().total_cmp(&b.middle_s()));
    out.dedup_by(|b, a| a.middle_s() == b.middle_s());
    out
}

#[cfg(test)]
#[path = "means_tests.rs"]
mod tests;
