//! Where along a track the concentration is evaluated: at its rows and, where the path from one to the
//! next is long beside the plume's width, between them. A sensor with a lag has sampled what lies
//! between.

use std::ops::Range;

use crate::field::{DispersionModel, Transport};
use crate::lag::MAX_CURVED_STEP_S;
use crate::row::Row;

/// Path across the plume between two points over its standard deviation, at most. What a lag makes
/// of a cubic through such points is right within .5 % of the plume's peak.
const MAX_STEP_SIGMAS: f64 = 0.5;
/// Points from one row to the next, at most.
const MAX_PARTS: f64 = 8.0;
/// A row counts as near a plume within so many standard deviations of its axis...
const NEAR_SD: f64 = 5.0;
/// ... and this part of the distance downwind: the wind may turn it so far, 10 degrees.
const NEAR_TURN: f64 = 0.18;

/// One of the points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SamplePoint {
    /// The row at it or before it.
    pub row: usize,
    /// Share of the path to the next row that is behind; 0 at the row.
    pub share: f64,
    /// Time, s.
    pub time_s: f64,
}

impl SamplePoint {
    /// Whether it is at a row.
    pub fn is_row(self) -> bool {
        self.share == 0.0
    }
}

/// The points of all platforms as columns.
#[derive(Debug, Clone)]
pub(crate) struct SamplePoints {
    spans: Vec<Range<usize>>,
    row: Vec<usize>,
    share: Vec<f64>,
    time_s: Vec<f64>,
}

impl SamplePoints {
    /// Those of `rows`, which stand in `ranges` platform by platform, for the plumes of `model` in the
    /// rows' transport. They stay for models that differ from it as a fit's do.
    pub fn new(
        model: &DispersionModel,
        ranges: &[Range<usize>],
        rows: &[Row],
        transport: &[Transport],
    ) -> Self {
        let mut out = Self {
            spans: Vec::with_capacity(ranges.len()),
            row: Vec::with_capacity(rows.len()),
            share: Vec::with_capacity(rows.len()),
            time_s: Vec::with_capacity(rows.len()),
        };
        for range in ranges {
            let first = out.row.len();
            for i in range.clone() {
                out.push(i, 0.0, rows[i].time_s);
                if i + 1 < range.end {
                    let dt_s = rows[i + 1].time_s - rows[i].time_s;
                    let parts = parts(model, &rows[i], &rows[i + 1], transport[i]);
                    for k in 1..parts {
                        let share = f64::from(k) / f64::from(parts);
                        out.push(i, share, rows[i].time_s + share * dt_s);
                    }
                }
            }
            out.spans.push(first..out.row.len());
        }
        out
    }

    fn push(&mut self, row: usize, share: f64, time_s: f64) {
        self.row.push(row);
        self.share.push(share);
        self.time_s.push(time_s);
    }

    /// Those of a platform, in order.
    pub fn of(&self, which: usize) -> impl Iterator<Item = SamplePoint> {
        self.spans[which].clone().map(|k| SamplePoint {
            row: self.row[k],
            share: self.share[k],
            time_s: self.time_s[k],
        })
    }

    /// Those of a platform that are not at rows, in order.
    pub fn between(&self, which: usize) -> impl Iterator<Item = SamplePoint> {
        self.of(which).filter(|s| !s.is_row())
    }

    /// Times of those of a platform, s.
    pub fn times_s(&self, which: usize) -> &[f64] {
        &self.time_s[self.spans[which].clone()]
    }
}

/// Into how many parts the path between two rows is cut: a power of two, so that steps have few
/// lengths and the coefficients of a lag can be kept.
fn parts(model: &DispersionModel, from: &Row, to: &Row, wind: Transport) -> u32 {
    if to.time_s - from.time_s > MAX_CURVED_STEP_S {
        return 1;
    }
    let (a, b) = (&from.place, &to.place);
    let (east_m, north_m) = (b.east_m - a.east_m, b.north_m - a.north_m);
    let across_m = (east_m * wind.north - north_m * wind.east).abs();
    let up_m = (b.height_agl_m - a.height_agl_m).abs();
    let of = |(x_m, y_m): (f64, f64)| {
        let (sigma_y_m, sigma_z_m) = model.sigmas_m(x_m);
        if y_m.abs() > NEAR_SD * sigma_y_m + NEAR_TURN * x_m + across_m {
            return 0.0;
        }
        (across_m / sigma_y_m).hypot(up_m / sigma_z_m)
    };
    let way = model
        .downwind_of_sources_m(a, wind)
        .map(of)
        .fold(0.0, f64::max);
    let parts = (way / MAX_STEP_SIGMAS).clamp(1.0, MAX_PARTS);
    (parts.ceil() as u32).next_power_of_two()
}
