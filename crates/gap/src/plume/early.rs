//! Readings of air that set out before the record. Which wind carried it then nobody logged; what
//! the log's beginning and its mean suggest is as good as the log itself shows, where the same is
//! done in its midst. Where that is too far off to be taken up by small steps of a straight line,
//! such readings say nothing.

use ::plume::field::Transport;

use super::data::{Data, Setup};
use super::model::Model;
use super::wind_series::{Grid, first_minute, kept, mean, towards};

/// How far off the wind's mean direction over such a way may be, degrees and as a part of the angle
/// under which the source sees the plume's standard deviation, and its speed at the emission, as a part
/// of it, for a reading to count.
const MOST_TURNED_DEG: f64 = 2.5;
const MOST_TURNED_PART: f64 = 0.6;
const MOST_SURGED: f64 = 0.12;
/// Smoothing of the log, and distance of the places in it that are looked at, s.
const SMOOTHED_S: f64 = 8.0;
const APART_S: f64 = 10.0;
/// How long air takes to pass a place with its puff, s: over which its speed is meant.
const PASSING_S: f64 = 30.0;
/// Places in the log from which what it does may be told.
const FEWEST_PLACES: usize = 8;

/// What the wind before the record may be off by.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Off {
    /// Its mean direction, degrees.
    turned_deg: f64,
    /// Its speed where the air set out, as a part.
    surged: f64,
}

/// Leaves out the readings whose wind before the record is too uncertain, at most two in three
/// and then the worst; a notice says how many.
pub(super) fn leave_out(setup: &Setup, data: &mut Data) {
    if !data.on_board_wind {
        return;
    }
    let excess = excess(setup, data);
    let mut known: Vec<f64> = (0..data.len())
        .filter(|i| data.used[*i])
        .map(|i| excess[i])
        .collect();
    known.sort_by(f64::total_cmp);
    let most = known.get(known.len() / 3).map_or(1.0, |m| m.max(1.0));
    let out: Vec<usize> = (0..data.len())
        .filter(|i| data.used[*i] && excess[*i] > most)
        .collect();
    if out.is_empty() {
        return;
    }
    for i in &out {
        data.used[*i] = false;
    }
    data.notices.push(format!(
        "{} readings are left out: their air set out before the record, and the logged wind turns \
         and changes too much to tell what it was then",
        out.len()
    ));
}

/// For each row how far off the wind of its air may be over what may be, beyond 1 too far.
fn excess(setup: &Setup, data: &Data) -> Vec<f64> {
    let vectors = (0..data.len()).filter_map(|i| data.logged_wind(i));
    let span = data.span_s();
    let Some(mut grid) = Grid::new(vectors, span) else {
        return vec![0.0; data.len()];
    };
    grid.smooth(SMOOTHED_S);
    let speed_m_s = towards(mean(&grid.values)).speed_m_s;
    let way_s = |far_m: f64| far_m / speed_m_s.max(0.5);
    // Of each row the distance, and how much of the way of its air lies before the record, s.
    let rows: Vec<(f64, f64)> = data
        .distance_m(setup.base.sources[0].place)
        .zip(data.track.time_s())
        .map(|(far_m, time_s)| (far_m, way_s(far_m) - (time_s - span.0)))
        .collect();
    let longest_s = rows
        .iter()
        .fold(0.0f64, |most, (_, before)| most.max(*before));
    let past = Past::of(&grid, longest_s);
    let world = Model::base(setup, true).world(&setup.base, data.track.platforms());
    let most_turned_deg = |far_m: f64| {
        let sigma_y_m = world.as_ref().map_or(far_m, |w| w.sigmas_m(far_m).0);
        let seen_deg = sigma_y_m.atan2(far_m).to_degrees();
        MOST_TURNED_DEG.min(MOST_TURNED_PART * seen_deg)
    };
    let beyond = |far_m: f64, before_s: f64| {
        let off = past.off(before_s).unwrap_or_default();
        let turned = off.turned_deg * before_s / way_s(far_m) / most_turned_deg(far_m);
        turned.max(off.surged / MOST_SURGED)
    };
    rows.iter()
        .map(|&(far_m, before_s)| {
            if before_s > 0.0 {
                beyond(far_m, before_s)
            } else {
                0.0
            }
        })
        .collect()
}

/// How well a stretch of the log tells the wind before it.
struct Past<'a> {
    grid: &'a Grid<2>,
    all: [f64; 2],
    mean: Transport,
    /// Sums of the winds up to every cell, and of what is kept of the first minute so many cells
    /// before it.
    winds: Vec<[f64; 2]>,
    kept: Vec<f64>,
    /// By whole steps of [`APART_S`] before the stretch, as far as is asked and the log reaches.
    off: Vec<Off>,
}

impl<'a> Past<'a> {
    /// As far back as `longest_s`.
    fn of(grid: &'a Grid<2>, longest_s: f64) -> Self {
        let all = mean(&grid.values);
        let mut winds = vec![[0.0; 2]];
        let mut kept_sums = vec![0.0];
        for (k, value) in grid.values.iter().enumerate() {
            winds.push([0, 1].map(|c| winds[k][c] + value[c]));
            kept_sums.push(kept_sums[k] + kept((k + 1) as f64 * grid.step_s));
        }
        let mut out = Self {
            grid,
            all,
            mean: towards(all),
            winds,
            kept: kept_sums,
            off: Vec::new(),
        };
        let asked = (longest_s / APART_S).ceil() as usize;
        out.off = (1..=asked).map_while(|steps| out.seen(steps)).collect();
        out
    }

    /// What the wind may be off by `before_s` before the record; none where the log is too short to
    /// tell anything.
    fn off(&self, before_s: f64) -> Option<Off> {
        let k = (before_s / APART_S).ceil() as usize;
        let last = self.off.len().checked_sub(1)?;
        self.off.get(k.saturating_sub(1).min(last)).copied()
    }

    /// The root mean square of what is told wrongly of the wind `steps` before places in the log.
    fn seen(&self, steps: usize) -> Option<Off> {
        let values = self.grid.values.len();
        let cells = |s: f64| ((s / self.grid.step_s).round() as usize).max(1);
        let (apart, passing) = (cells(APART_S), cells(PASSING_S));
        let before = steps * apart;
        let set_out = passing.min(before);
        let mut sums = [0.0; 2];
        let mut count = 0usize;
        for place in (before.max(passing)..values).step_by(apart) {
            let minute = first_minute(self.grid.step_s, values - place);
            let first = self.met(place, minute);
            let over_way = self.wrong(place, first, before, before);
            sums[0] += over_way[1].atan2(self.mean.speed_m_s).to_degrees().powi(2);
            let at_start = self.wrong(place, first, before, set_out);
            sums[1] += (at_start[0] / self.mean.speed_m_s).powi(2);
            count += 1;
        }
        // The mean that what is told tends to is that of the log itself, with the stretch in it: means of
        // L out of T differ from it by a variance in proportion to 1/L - 1/T, those before it to 1/L + 1/T.
        let unseen = |cells: usize| {
            let part = cells as f64 / values as f64;
            (1.0 + part) / (1.0 - part).max(1e-9)
        };
        let rms = |sum: f64, cells: usize| (unseen(cells) * sum / count.max(1) as f64).sqrt();
        (count >= FEWEST_PLACES && self.mean.speed_m_s > 0.0).then_some(Off {
            turned_deg: rms(sums[0], before),
            surged: rms(sums[1], set_out),
        })
    }

    /// The mean of `count` winds of the log.
    fn met(&self, from: usize, count: usize) -> [f64; 2] {
        [0, 1].map(|c| (self.winds[from + count][c] - self.winds[from][c]) / count as f64)
    }

    /// What `count` cells from `before` cells before a place on are in the mean, less what the
    /// mean of the `first` minute there tells of them, along and across the wind.
    fn wrong(&self, place: usize, first: [f64; 2], before: usize, count: usize) -> [f64; 2] {
        let kept = (self.kept[before] - self.kept[before - count]) / count as f64;
        let met = self.met(place - before, count);
        let off = [0, 1].map(|c| met[c] - (self.all[c] + kept * (first[c] - self.all[c])));
        let Transport { east, north, .. } = self.mean;
        [
            off[0] * east + off[1] * north,
            off[1] * east - off[0] * north,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::wind_series::carried_on;
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// An hour of gusts of `sd_m_s` that last about a minute, about 7.07 m/s from the south-west.
    fn gusts(sd_m_s: f64) -> Grid<2> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let keep = (-1.0 / 60.0f64).exp();
        let mut gust = [0.0; 2];
        let winds = (0..3600).map(|t| {
            gust = gust.map(|g| keep * g + (1.0 - keep * keep).sqrt() * normal());
            (f64::from(t), gust.map(|g| 5.0 + sd_m_s * g))
        });
        Grid::new(winds, (0.0, 3599.0)).unwrap()
    }

    fn off(sd_m_s: f64, before_s: f64) -> Off {
        Past::of(&gusts(sd_m_s), before_s).off(before_s).unwrap()
    }

    // Against the winds as they are put before a record, one by one.
    #[test]
    fn sums_say_what_the_winds_before_a_record_are_off_by() {
        let grid = gusts(1.0);
        let past = Past::of(&grid, 0.0);
        for (place, before, count) in [(700, 120, 120), (3580, 250, 30), (30, 10, 10)] {
            let told = carried_on(&grid.values[place..], grid.step_s, past.all, before);
            let met = &grid.values[place - before..][..count];
            let (met, told) = (mean(met), mean(&told[..count]));
            let off = [met[0] - told[0], met[1] - told[1]];
            let minute = first_minute(grid.step_s, grid.values.len() - place);
            let [along, across] = past.wrong(place, past.met(place, minute), before, count);
            let Transport { east, north, .. } = past.mean;
            assert!((along - off[0] * east - off[1] * north).abs() < 1e-9);
            assert!((across - off[1] * east + off[0] * north).abs() < 1e-9);
        }
    }

    // A minute's gusts have over 120 s a mean of .75 of their deviation (the integral of their
    // autocorrelation), which is 6.1 degrees of 7.07 m/s; what the first minute tells is small.
    #[test]
    fn what_gusts_do_before_the_record_is_uncertain() {
        let gusty = off(1.0, 120.0);
        assert!((4.0..9.0).contains(&gusty.turned_deg), "{gusty:?}");
        assert!((0.08..0.25).contains(&gusty.surged), "{gusty:?}");
        let steady = off(0.0, 120.0);
        assert!(
            steady.turned_deg < 1e-6 && steady.surged < 1e-9,
            "{steady:?}"
        );
    }

    #[test]
    fn a_short_log_tells_nothing() {
        let winds = (0..40).map(|t| (f64::from(t), [5.0, 0.0]));
        let grid = Grid::new(winds, (0.0, 39.0)).unwrap();
        assert_eq!(Past::of(&grid, 60.0).off(60.0), None);
    }
}
