//! The swing of a wind that nobody logged, as the plume itself shows it.
//!
//! Where the plume swings by more than part of its width the readings are no longer straight in the
//! swing, and what a straight line leaves of it would be taken for a cause. Which way the plume lay
//! is looked for on a grid of directions ([`path`]); from there the wind that carried it is fitted
//! ([`series`]). A wind that swings so is beside what the scenario says of its mean: neither that nor
//! its trend is held against it.

mod path;
mod series;

use ::plume::mechanism::MechanismId;

use super::fit::Context;
use super::model::Model;
use super::wind_series::{Grid, Line, kept};
use path::Table;

/// What the path of the plume must gain over its best steady direction, nats, and by how much it must
/// swing about a straight line, degrees: beyond that the readings are not straight in it.
const LEAST_NATS: f64 = 20.0;
const LEAST_DEG: f64 = 1.0;

/// A reading differs from the plume by this part of it in gusts, beside its white noise …
const GUST: f64 = 0.35;
/// … by Student's law of these degrees of freedom …
const FREEDOM: f64 = 4.0;
/// … for this time, s: readings that are nearer in time tell less each.
const ALIKE_S: f64 = 3.0;

/// A swing that the plume shows.
pub(super) struct Shown {
    /// The wind turned about the straight line through its swing, degrees clockwise, from before the
    /// record.
    pub turned_deg: Grid<1>,
    /// Standard deviation of the swing, degrees.
    pub swing_deg: f64,
    /// The straight line, degrees beyond the scenario's direction.
    line: Line<1>,
}

/// How the readings may differ from a plume: for each row that is used, the part that it counts.
struct Readings<'a, 'b> {
    ctx: &'a Context<'b>,
    white_ppm: f64,
    counts: Vec<f64>,
}

impl<'a, 'b> Readings<'a, 'b> {
    fn new(ctx: &'a Context<'b>, white_ppm: f64) -> Self {
        let times = ctx.data.track.time_s();
        let mut counts = vec![0.0; times.len()];
        for range in ctx.data.ranges() {
            let mut last_s = f64::NEG_INFINITY;
            for i in range.clone().filter(|i| ctx.data.used[*i]) {
                counts[i] = ((times[i] - last_s) / ALIKE_S).clamp(0.0, 1.0);
                last_s = times[i];
            }
        }
        Self {
            ctx,
            white_ppm,
            counts,
        }
    }

    fn variance(&self, plume_ppm: f64) -> f64 {
        self.white_ppm.powi(2) + (GUST * plume_ppm).powi(2)
    }

    /// Log likelihood of the reading of a row, nats.
    fn nats(&self, row: usize, reading_ppm: f64, plume_ppm: f64) -> f64 {
        if self.counts[row] == 0.0 {
            return 0.0;
        }
        let off = self.ctx.data.reading_ppm[row] - reading_ppm;
        let variance = self.variance(plume_ppm);
        let far = (off * off / (FREEDOM * variance)).ln_1p();
        -0.5 * self.counts[row] * ((FREEDOM + 1.0) * far + variance.ln())
    }
}

/// The swing that the readings show beside `model`, whose wind is the scenario's; none where the
/// plume lies still.
pub(super) fn shown(ctx: &Context<'_>, model: &Model, white_ppm: f64) -> Option<Shown> {
    let readings = Readings::new(ctx, white_ppm);
    let table = Table::new(&readings, model);
    let path = table.likeliest();
    let still = table.still_nats();
    let (line, left_deg) = table.about_line(&path)?;
    if path.nats < still + LEAST_NATS || left_deg < LEAST_DEG {
        return None;
    }
    let (from, to) = ctx.data.span_s();
    let swing_deg = left_deg / left_by_line(to - from);
    let mut turned_deg = series::fitted(&readings, model, &path.turned_deg, swing_deg);
    turned_deg.add(&line, -1.0);
    Some(Shown {
        turned_deg,
        swing_deg,
        line,
    })
}

/// The model with its wind where the scenario has it.
pub(super) fn with_stated_wind(model: &Model) -> Model {
    let mut model = model.clone();
    for k in 0..model.dimension() {
        if matches!(
            model.id_of(k),
            MechanismId::WindDirectionOffset | MechanismId::WindDirectionDrift
        ) {
            model.set_coordinate(k, model.free[k].centre);
        }
    }
    model
}

/// The base beside a wind that swings, with its other parameters as in `at`: the wind's mean and its
/// trend may be anything, and start on the swing's straight line.
pub(super) fn base_beside(base: &Model, at: &Model, shown: &Shown) -> Model {
    let mut model = base.clone().placed_as(at);
    for k in 0..model.dimension() {
        let on_line = match model.id_of(k) {
            MechanismId::WindDirectionOffset => shown.line.at(0.0)[0],
            MechanismId::WindDirectionDrift => 3600.0 * shown.line.per_s[0],
            _ => continue,
        };
        let physical = model.spec_of(k).prior_sd;
        let free = &mut model.free[k];
        free.sd = free.sd.max(physical);
        free.stated = false;
        model.set_coordinate(k, on_line);
    }
    model
}

/// Places of a record by which its swing is meant.
const PLACES: usize = 60;

/// Standard deviation of what a straight line through a record of `length_s` leaves of a swing that
/// the weather remembers and that has a standard deviation of one.
fn left_by_line(length_s: f64) -> f64 {
    let n = PLACES as f64;
    let along = |k: usize| (k as f64 + 0.5) / n - 0.5;
    let square: f64 = (0..PLACES).map(|k| along(k).powi(2)).sum();
    let (mut mean, mut rise) = (0.0, 0.0);
    for i in 0..PLACES {
        for j in 0..PLACES {
            let both = kept((along(i) - along(j)).abs() * length_s);
            mean += both / (n * n);
            rise += both * along(i) * along(j) / (square * n);
        }
    }
    (1.0 - mean - rise).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    // By python3: C = [[exp(-abs(i-j)*L/60/400) for i in range(60)] for j in range(60)], of which the
    // mean, and the square of the slope times that of the times, are taken from one.
    #[test]
    fn a_line_takes_most_of_a_short_record() {
        for (length_s, want) in [(600.0, 0.43), (900.0, 0.52), (1800.0, 0.67), (3600.0, 0.81)] {
            let left = left_by_line(length_s);
            assert!((left - want).abs() < 0.006, "{length_s} s: {left}");
        }
    }
}
