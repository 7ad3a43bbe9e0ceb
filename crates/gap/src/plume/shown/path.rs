//! The most probable path of a plume's direction in time: a walk that the weather pulls back
//! (Ornstein & Uhlenbeck 1930), by dynamic programming (Viterbi 1967).

use super::super::model::{Model, Part};
use super::super::wind_series::{Grid, Line};
use super::Readings;

/// Directions that are looked at on either side, and their distance, degrees.
const REACH_DEG: f64 = 30.0;
const APART_DEG: f64 = 0.5;
/// Stretches of time in which the direction is one, s, and the most of them.
const STRETCH_S: f64 = 5.0;
const MOST_STRETCHES: f64 = 2000.0;
/// Standard deviations of the walk, degrees, and times that it remembers, s, that are tried.
const WALKS_DEG: [f64; 3] = [2.0, 4.0, 8.0];
const REMEMBERED_S: [f64; 3] = [60.0, 180.0, 600.0];
/// A step of the walk is at most so many of its standard deviations.
const LONGEST_STEP: f64 = 6.0;
/// A stretch shows where the plume lies if its directions differ by more than this, nats.
const TELLS_NATS: f64 = 3.0;

/// The log likelihood of the readings of each stretch of time for each direction, nats.
pub(super) struct Table {
    start_s: f64,
    step_s: f64,
    turned_deg: Vec<f64>,
    nats: Vec<Vec<f64>>,
}

/// A path through a table: the direction at the middle of each stretch, degrees, and its log
/// probability, nats.
pub(super) struct Path {
    pub turned_deg: Grid<1>,
    pub nats: f64,
}

impl Table {
    /// The table of a model turned as a whole.
    pub fn new(readings: &Readings<'_, '_>, model: &Model) -> Self {
        let ctx = readings.ctx;
        let (from, to) = ctx.data.span_s();
        let step_s = STRETCH_S.max((to - from) / MOST_STRETCHES);
        let reach = (REACH_DEG / APART_DEG) as i32;
        let turned_deg: Vec<f64> = (-reach..=reach).map(|k| f64::from(k) * APART_DEG).collect();
        let count = ((to - from) / step_s) as usize + 1;
        let mut nats = vec![vec![0.0; turned_deg.len()]; count];
        for (k, turned) in turned_deg.iter().enumerate() {
            let mut with = model.clone();
            with.parts.push(Part::turn(*turned));
            let there = ctx.predict(&with);
            for (i, time_s) in ctx.data.track.time_s().iter().enumerate() {
                let stretch = (((time_s - from) / step_s) as usize).min(count - 1);
                nats[stretch][k] += readings.nats(i, there.reading[i], there.plume[i]);
            }
        }
        Self {
            start_s: from,
            step_s,
            turned_deg,
            nats,
        }
    }

    /// The log probability of the best direction that stays, nats.
    pub fn still_nats(&self) -> f64 {
        (0..self.turned_deg.len())
            .map(|k| self.nats.iter().map(|stretch| stretch[k]).sum())
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// The most probable path of the most probable walk.
    pub fn likeliest(&self) -> Path {
        let first = self.walked(WALKS_DEG[0], REMEMBERED_S[0]);
        let walks = WALKS_DEG
            .iter()
            .flat_map(|deg| REMEMBERED_S.map(|s| (*deg, s)));
        walks.skip(1).fold(first, |best, (deg, remembered_s)| {
            let path = self.walked(deg, remembered_s);
            if path.nats > best.nats { path } else { best }
        })
    }

    /// Log probabilities of the directions about `mean_deg`, nats.
    fn ln_about(&self, mean_deg: f64, sd_deg: f64) -> Vec<f64> {
        let raw = |d: &f64| -0.5 * ((d - mean_deg) / sd_deg).powi(2);
        let raw: Vec<f64> = self.turned_deg.iter().map(raw).collect();
        let ln_sum = raw.iter().map(|r| r.exp()).sum::<f64>().ln();
        raw.iter().map(|r| r - ln_sum).collect()
    }

    /// The most probable path of a walk with this standard deviation that is remembered so long.
    fn walked(&self, walk_deg: f64, remembered_s: f64) -> Path {
        let keep = (-self.step_s / remembered_s).exp();
        let sd_deg = walk_deg * (1.0 - keep * keep).sqrt();
        let n = self.turned_deg.len();
        let reach = (LONGEST_STEP * sd_deg / APART_DEG).ceil() as usize + 1;
        let steps: Vec<Vec<f64>> = self
            .turned_deg
            .iter()
            .map(|d| self.ln_about(keep * d, sd_deg))
            .collect();
        let mut here = self.ln_about(0.0, walk_deg);
        here.iter_mut()
            .zip(&self.nats[0])
            .for_each(|(h, v)| *h += v);
        let mut origins: Vec<Vec<usize>> = Vec::with_capacity(self.nats.len());
        for stretch in &self.nats[1..] {
            let mut next = vec![f64::NEG_INFINITY; n];
            let mut origin = vec![0; n];
            for j in 0..n {
                for k in j.saturating_sub(reach)..(j + reach + 1).min(n) {
                    let nats = here[k] + steps[k][j];
                    if nats > next[j] {
                        (next[j], origin[j]) = (nats, k);
                    }
                }
                next[j] += stretch[j];
            }
            origins.push(origin);
            here = next;
        }
        let last = (0..n).max_by(|a, b| here[*a].total_cmp(&here[*b]));
        let mut k = last.unwrap_or(0);
        let nats = here[k];
        let mut values = vec![[self.turned_deg[k]]];
        for origin in origins.iter().rev() {
            k = origin[k];
            values.push([self.turned_deg[k]]);
        }
        values.reverse();
        let turned_deg = Grid {
            start_s: self.start_s + 0.5 * self.step_s,
            step_s: self.step_s,
            values,
        };
        Path { turned_deg, nats }
    }

    /// The straight line through a path where the plume shows, and the root mean square of what it
    /// leaves there, degrees; `None` where it shows nowhere.
    pub fn about_line(&self, path: &Path) -> Option<(Line<1>, f64)> {
        let tells = |stretch: &usize| {
            let nats = &self.nats[*stretch];
            let most = nats.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
            nats.iter().any(|v| most - v > TELLS_NATS)
        };
        let swing = &path.turned_deg;
        let shows: Vec<(f64, [f64; 1])> = (0..self.nats.len())
            .filter(tells)
            .map(|k| (swing.time_s(k), swing.values[k]))
            .collect();
        let line = Line::through(shows.iter().copied())?;
        let left = shows
            .iter()
            .map(|(t, [deg])| (deg - line.at(*t)[0]).powi(2));
        let left_deg = (left.sum::<f64>() / shows.len() as f64).sqrt();
        Some((line, left_deg))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEEN_SD_DEG: f64 = 0.4;

    /// A plume that swings so, seen in every fourth stretch.
    fn seen(stretches: usize, at_deg: impl Fn(f64) -> f64) -> Table {
        let turned_deg: Vec<f64> = (-60..=60).map(|k| f64::from(k) * APART_DEG).collect();
        let of = |stretch: usize| {
            let time_s = (stretch as f64 + 0.5) * STRETCH_S;
            let nats = |deg: &f64| match stretch % 4 {
                0 => -0.5 * ((deg - at_deg(time_s)) / SEEN_SD_DEG).powi(2),
                _ => 0.0,
            };
            turned_deg.iter().map(nats).collect()
        };
        Table {
            start_s: 0.0,
            step_s: STRETCH_S,
            nats: (0..stretches).map(of).collect(),
            turned_deg,
        }
    }

    #[test]
    fn a_swing_is_followed_also_where_it_is_not_seen() {
        let swing = |time_s: f64| 8.0 * (time_s / 120.0).sin();
        let table = seen(120, swing);
        let path = table.likeliest();
        for second in 10..590 {
            let time_s = f64::from(second);
            let off = path.turned_deg.at(time_s)[0] - swing(time_s);
            assert!(off.abs() < 2.0, "{off} at {time_s} s");
        }
        assert!(path.nats > table.still_nats() + 100.0);
        // By python3: a straight line through 8 sin(t / 120) at 2.5, 22.5 ... 582.5 s leaves this.
        let (_, left_deg) = table.about_line(&path).unwrap();
        assert!((left_deg - 3.48).abs() < 0.3, "{left_deg}");
    }

    #[test]
    fn a_plume_that_turns_evenly_leaves_nothing_about_its_line() {
        let table = seen(120, |time_s| -3.0 + 0.01 * time_s);
        let (line, left_deg) = table.about_line(&table.likeliest()).unwrap();
        assert!(left_deg < 0.4, "{left_deg}");
        let ([at_0_deg], [per_s]) = (line.at(0.0), line.per_s);
        assert!((at_0_deg + 3.0).abs() < 0.6 && (per_s - 0.01).abs() < 2e-3);
        let still = seen(120, |_| 4.0);
        assert!(still.likeliest().nats < still.still_nats());
    }
}
