//! How a plume hangs on a wind that is given at knots in time: on its direction by the mean over the way
//! that the air took from the source, on its speed by that where it set out.

use super::fit::Context;
use super::noise::Loading;
use super::nuisance::Spacing;

/// Knots in time, and the way of the air of each row among them.
pub(super) struct Knots {
    pub start_s: f64,
    pub step_s: f64,
    pub count: usize,
    /// How the plume's direction at each row hangs on them.
    pub turns: Vec<Parts>,
    /// How the plume's strength at each row hangs on them.
    sets_out: Vec<Parts>,
}

/// The parts that neighbouring knots have in something.
pub(super) struct Parts {
    pub first: usize,
    pub parts: Vec<f64>,
}

impl Knots {
    /// From before the air of the first row set out to the last row.
    pub fn over(ctx: &Context<'_>, spacing: Spacing) -> Self {
        Self::until(ctx, spacing, ctx.data.span_s().1)
    }

    /// From before the air of the first row set out to the record's beginning.
    pub fn before(ctx: &Context<'_>, spacing: Spacing) -> Self {
        Self::until(ctx, spacing, ctx.data.span_s().0)
    }

    /// To about `to_s`, where the last one is or beyond.
    fn until(ctx: &Context<'_>, spacing: Spacing, to_s: f64) -> Self {
        let ways_s: Vec<f64> = ctx.way_s().collect();
        let rows = || ctx.data.track.time_s().iter().zip(&ways_s);
        let set_out_s = rows()
            .zip(&ctx.data.used)
            .filter(|(_, used)| **used)
            .fold(to_s, |first, ((t, way_s), _)| f64::min(first, t - way_s));
        let start_s = set_out_s - spacing.s;
        let step_s = spacing.s.max((to_s - start_s) / spacing.most);
        let count = ((to_s - start_s) / step_s).ceil() as usize + 1;
        let turned = |(t, way_s): (&f64, &f64)| {
            let place = |time_s: f64| (time_s - start_s) / step_s;
            mean_of(place(t - way_s), place(t.min(to_s)), way_s / step_s, count)
        };
        let set_out = |(t, way_s): (&f64, &f64)| at((t - way_s - start_s) / step_s, count);
        Self {
            turns: rows().map(turned).collect(),
            sets_out: rows().map(set_out).collect(),
            start_s,
            step_s,
            count,
        }
    }

    /// What a degree of the wind at each knot changes in the readings.
    pub fn turning(&self, loading: &[Loading]) -> Vec<Vec<f64>> {
        self.columns(&self.turns, loading.iter().map(|l| l.swing))
    }

    /// What readings change by where the air that sets out at each knot takes up its whole more.
    pub fn taking_up(&self, loading: &[Loading]) -> Vec<Vec<f64>> {
        self.columns(&self.sets_out, loading.iter().map(|l| l.gust))
    }

    fn columns(&self, rows: &[Parts], loads: impl Iterator<Item = f64>) -> Vec<Vec<f64>> {
        let mut out = vec![vec![0.0; rows.len()]; self.count];
        for (i, (row, load)) in rows.iter().zip(loads).enumerate() {
            for (k, part) in row.parts.iter().enumerate() {
                out[row.first + k][i] = part * load;
            }
        }
        out
    }
}

/// The part that each knot has in the mean from `from` over a `length`, of which what lies beyond `to`
/// is not told, all in knots.
fn mean_of(from: f64, to: f64, length: f64, count: usize) -> Parts {
    let (from, to) = (from.max(0.0), to.min((count - 1) as f64));
    let first = from as usize;
    if to <= from {
        return Parts {
            first: 0,
            parts: Vec::new(),
        };
    }
    let last = (to as usize + 1).min(count - 1);
    // The integral of a hat about 0 up to a place.
    let up_to = |x: f64| match x {
        x if x <= -1.0 => 0.0,
        x if x <= 0.0 => 0.5 * (x + 1.0).powi(2),
        x if x <= 1.0 => 1.0 - 0.5 * (1.0 - x).powi(2),
        _ => 1.0,
    };
    let part = |k: usize| (up_to(to - k as f64) - up_to(from - k as f64)) / length.max(1e-6);
    Parts {
        first,
        parts: (first..=last).map(part).collect(),
    }
}

/// The parts of the two knots about a place, in knots; none beyond the last.
fn at(place: f64, count: usize) -> Parts {
    let first = place.max(0.0) as usize;
    let part = place.max(0.0) - first as f64;
    let parts = if first + 1 < count {
        vec![1.0 - part, part]
    } else {
        Vec::new()
    };
    Parts { first, parts }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_has_the_mean_of_what_is_straight_along_it() {
        for (from, to) in [(2.3, 7.9), (4.0, 4.2), (0.0, 9.0), (5.5, 5.5 + 1e-3)] {
            let way = mean_of(from, to, to - from, 10);
            let parts = way.parts.iter().enumerate();
            let (sum, mean) = parts.fold((0.0, 0.0), |(sum, mean), (k, part)| {
                (sum + part, mean + part * (way.first + k) as f64)
            });
            assert!((sum - 1.0).abs() < 1e-9, "{from} to {to}: {sum}");
            assert!(
                (mean - 0.5 * (from + to)).abs() < 1e-9,
                "{from} to {to}: {mean}"
            );
        }
        let told = |to: f64| mean_of(2.0, to, 6.0, 10).parts.iter().sum::<f64>();
        assert!((told(5.0) - 0.5).abs() < 1e-9 && told(1.0) == 0.0);
    }

    #[test]
    fn air_sets_out_between_two_knots() {
        let parts = at(3.25, 5);
        assert_eq!((parts.first, parts.parts), (3, vec![0.75, 0.25]));
        assert!(at(4.5, 5).parts.is_empty());
    }
}
