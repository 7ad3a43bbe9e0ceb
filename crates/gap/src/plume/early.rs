//! Readings of air that set out before the record. Which wind carried it then nobody logged; what
//! the log's beginning and its mean suggest is as good as the log itself shows, where the same is
//! done in its midst. Where that is too far off to be taken up by small steps of a straight line,
//! such readings say nothing.

use ::plume::field::Transport;

use super::data::{Data, Setup};
use super::wind_series::{Grid, carried_on, mean};

/// How far off the wind's mean direction over such a way may be, degrees, and its speed at the
/// emission, as a part of it, for a reading to count.
const MOST_TURNED_DEG: f64 = 2.5;
const MOST_SURGED: f64 = 0.12;
/// Smoothing of the log, and distance of the places in it that are looked at, s.
const SMOOTHED_S: f64 = 8.0;
const APART_S: f64 = 10.0;
/// How long air takes to pass a place with its puff, s: over which its speed is meant.
const PASSING_S: f64 = 30.0;
/// Places in the log from which what it does may be told.
const FEWEST_PLACES: usize = 8;

/// What the wind before the record may be off by.
#[derive(Debug, Clone, Copy, PartialEq)]
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
    let mut out = vec![0.0; data.len()];
    let times = data.track.time_s();
    let logged = data.wind.iter().zip(data.track.transport()).zip(times);
    let vectors = logged.filter_map(|((wind, t), time_s)| {
        let own = [t.east, t.north].map(|c| c * t.speed_m_s);
        wind.map(|_| (*time_s, own))
    });
    let span = data.span_s();
    let Some(mut grid) = Grid::new(vectors, span) else {
        return out;
    };
    grid.smooth(SMOOTHED_S);
    let past = Past::of(&grid);
    let source = setup.base.sources[0].place;
    for (i, far_m) in data.distance_m(source).enumerate() {
        let way_s = far_m / past.mean.speed_m_s.max(0.5);
        let before_s = way_s - (times[i] - span.0);
        if before_s > 0.0
            && let Some(off) = past.off(before_s)
        {
            let turned = off.turned_deg * before_s / way_s / MOST_TURNED_DEG;
            out[i] = turned.max(off.surged / MOST_SURGED);
        }
    }
    out
}

/// How well a stretch of the log tells the wind before it.
struct Past<'a> {
    grid: &'a Grid,
    mean: Transport,
    /// By whole steps of [`APART_S`] before the stretch, as far as the log reaches.
    off: Vec<Off>,
}

impl<'a> Past<'a> {
    fn of(grid: &'a Grid) -> Self {
        let all = mean(&grid.values);
        let mut out = Self {
            grid,
            mean: super::wind_series::towards(all),
            off: Vec::new(),
        };
        while let Some(next) = out.seen(out.off.len() + 1, all) {
            out.off.push(next);
        }
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
    fn seen(&self, steps: usize, all: [f64; 2]) -> Option<Off> {
        let values = &self.grid.values;
        let cells = |s: f64| ((s / self.grid.step_s).round() as usize).max(1);
        let (apart, passing) = (cells(APART_S), cells(PASSING_S));
        let before = steps * apart;
        let mut sums = [0.0; 2];
        let mut count = 0usize;
        let mut place = before.max(passing);
        while place < values.len() {
            let told = carried_on(&values[place..], self.grid.step_s, all, before);
            let met = &values[place - before..place];
            let off = self.along_and_across(mean(met), mean(&told));
            sums[0] += off[1].atan2(self.mean.speed_m_s).to_degrees().powi(2);
            let set_out = &met[..passing.min(met.len())];
            let first = &told[..set_out.len()];
            let off = self.along_and_across(mean(set_out), mean(first));
            sums[1] += (off[0] / self.mean.speed_m_s).powi(2);
            count += 1;
            place += apart;
        }
        let rms = sums.map(|s| (s / count.max(1) as f64).sqrt());
        (count >= FEWEST_PLACES && self.mean.speed_m_s > 0.0).then_some(Off {
            turned_deg: rms[0],
            surged: rms[1],
        })
    }

    /// How one wind differs from another along and across the mean of all.
    fn along_and_across(&self, one: [f64; 2], other: [f64; 2]) -> [f64; 2] {
        let off = [one[0] - other[0], one[1] - other[1]];
        let Transport { east, north, .. } = self.mean;
        [
            off[0] * east + off[1] * north,
            off[1] * east - off[0] * north,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// An hour of gusts of `sd_m_s` that last about a minute, about 7.07 m/s from the south-west.
    fn off(sd_m_s: f64, before_s: f64) -> Off {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let keep = (-1.0 / 60.0f64).exp();
        let mut gust = [0.0; 2];
        let winds = (0..3600).map(|t| {
            gust = gust.map(|g| keep * g + (1.0 - keep * keep).sqrt() * normal());
            (f64::from(t), gust.map(|g| 5.0 + sd_m_s * g))
        });
        let grid = Grid::new(winds, (0.0, 3599.0)).unwrap();
        Past::of(&grid).off(before_s).unwrap()
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
        assert_eq!(Past::of(&grid).off(60.0), None);
    }
}
