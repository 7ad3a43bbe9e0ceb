//! What stands on the ground in the plume's way: behind it, on a strip along the wind, the plume
//! is weaker or stronger. Where the strip lies, where it begins and how wide it is are searched
//! for with a matched filter; nothing is taken of how it fades.

use super::fit::{Context, Fitted};

/// Half widths tried, in standard deviations of where across the wind the plume was met.
const HALF_WIDTHS: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
/// Standard deviations on either side of the middle over which strips are tried.
const REACH: f64 = 2.5;
/// Places along the wind at which a lee may begin.
const EDGES: usize = 16;

/// Where rows lie on the ground from the source, along and across the mean wind, m.
pub(crate) struct Ground {
    pub along_m: Vec<f64>,
    pub across_m: Vec<f64>,
}

impl Ground {
    /// Of the rows of the data: places that stay where they are when the plume swings.
    pub fn new(ctx: &Context<'_>) -> Self {
        let track = &ctx.data.track;
        let source = ctx.setup.base.sources[0].place;
        let mean = track
            .transport()
            .iter()
            .fold([0.0, 0.0], |sum, w| [sum[0] + w.east, sum[1] + w.north]);
        let (sin, cos) = mean[0].atan2(mean[1]).sin_cos();
        let (along_m, across_m) = (0..track.len())
            .map(|i| {
                let p = track.place(i);
                let (east_m, north_m) = (p.east_m - source.east_m, p.north_m - source.north_m);
                (east_m * sin + north_m * cos, east_m * cos - north_m * sin)
            })
            .unzip();
        Self { along_m, across_m }
    }
}

/// A strip of ground behind an edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lee {
    from_m: f64,
    middle_m: f64,
    half_width_m: f64,
}

impl Lee {
    /// How much of a row lies in it: 1 in its middle.
    pub fn share(&self, along_m: f64, across_m: f64) -> f64 {
        if along_m < self.from_m {
            return 0.0;
        }
        let away = (across_m - self.middle_m) / self.half_width_m;
        (1.0 - away * away).max(0.0).powi(2)
    }
}

/// What one row in the plume tells.
struct Told {
    along_m: f64,
    across_m: f64,
    /// Score of a change of the plume there, and about its information.
    score: f64,
    information: f64,
}

/// The most telling strip of each width, and how many strips were tried. `left` is the whitened
/// residual that the base leaves.
pub(crate) fn search(
    ctx: &Context<'_>,
    fitted: &Fitted,
    left: &[f64],
    ground: &Ground,
) -> (Vec<Lee>, usize) {
    let whitener = &fitted.metric.whitener;
    let mut back = left.to_vec();
    whitener.whiten_back(&mut back);
    let scales = whitener.scales();
    let mut told: Vec<Told> = (0..back.len())
        .filter(|i| ctx.data.used[*i] && fitted.loading[*i].gust > 0.0)
        .map(|i| {
            let load = fitted.loading[i].gust;
            Told {
                along_m: ground.along_m[i],
                across_m: ground.across_m[i],
                score: load * back[i],
                information: (load * scales[i]).powi(2),
            }
        })
        .collect();
    told.sort_by(|a, b| b.along_m.total_cmp(&a.along_m));
    let total: f64 = told.iter().map(|t| t.information).sum();
    let mean = |of: &dyn Fn(&Told) -> f64| {
        told.iter().map(|t| t.information * of(t)).sum::<f64>() / total.max(1e-300)
    };
    let middle = mean(&|t| t.across_m);
    let sd = mean(&|t| (t.across_m - middle).powi(2)).sqrt();
    if told.is_empty() || sd <= 0.0 {
        return (Vec::new(), 0);
    }
    let mut tried = 0;
    let mut found = Vec::new();
    for half in HALF_WIDTHS {
        let steps = (2.0 * REACH / half).ceil() as i32;
        let mut best: Option<(f64, Lee)> = None;
        for k in -steps..=steps {
            let lee = Lee {
                from_m: f64::NEG_INFINITY,
                middle_m: middle + 0.5 * half * sd * f64::from(k),
                half_width_m: half * sd,
            };
            tried += EDGES;
            let edge = best_edge(&told, lee, total / EDGES as f64);
            if best.is_none_or(|b| edge.0 > b.0) {
                best = Some(edge);
            }
        }
        found.extend(best.map(|b| b.1));
    }
    (found, tried)
}

/// The edge from which on the strip tells most, and how much. Edges lie at even shares of the
/// information, `step` apart.
fn best_edge(told: &[Told], strip: Lee, step: f64) -> (f64, Lee) {
    let (mut score, mut information, mut passed) = (0.0, 0.0, 0.0);
    let mut best = (0.0, strip);
    let mut due = step;
    for (k, t) in told.iter().enumerate() {
        let share = strip.share(t.along_m, t.across_m);
        score += share * t.score;
        information += share * share * t.information;
        passed += t.information;
        if (passed >= due || k + 1 == told.len()) && information > 0.0 {
            due += step;
            let value = score * score / information;
            if value > best.0 {
                let from_m = t.along_m;
                best = (value, Lee { from_m, ..strip });
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows every 50 m from 400 m to 2,000 m along and every 10 m within 300 m across the wind.
    fn told(score: impl Fn(f64, f64) -> f64 + Copy) -> Vec<Told> {
        let along = (0..33).rev().map(|k| 400.0 + 50.0 * f64::from(k));
        along
            .flat_map(|x| (-30..=30).map(move |k| (x, 10.0 * f64::from(k))))
            .map(|(along_m, across_m)| Told {
                along_m,
                across_m,
                score: score(along_m, across_m),
                information: 1.0,
            })
            .collect()
    }

    const STRIP: Lee = Lee {
        from_m: f64::NEG_INFINITY,
        middle_m: -60.0,
        half_width_m: 80.0,
    };

    #[test]
    fn the_edge_is_where_the_plume_weakens() {
        let in_lee = |x: f64, y: f64| x >= 1_200.0 && (y + 60.0).abs() < 60.0;
        let rows = told(|x, y| if in_lee(x, y) { -0.2 } else { 0.0 });
        let step = rows.len() as f64 / EDGES as f64;
        let (value, lee) = best_edge(&rows, STRIP, step);
        // Edges lie 33 / 16 rows of 50 m apart.
        assert!((lee.from_m - 1_200.0).abs() <= 103.0, "{}", lee.from_m);
        let middle_m = 150.0;
        assert!(best_edge(&rows, Lee { middle_m, ..STRIP }, step).0 < 0.1 * value);
    }

    #[test]
    fn a_row_counts_by_how_deep_in_the_strip_it_is() {
        let lee = Lee {
            from_m: 500.0,
            ..STRIP
        };
        assert_eq!(lee.share(499.0, -60.0), 0.0);
        assert_eq!(lee.share(501.0, -60.0), 1.0);
        assert_eq!(lee.share(501.0, 20.0), 0.0);
        assert!((lee.share(501.0, -20.0) - 0.5625).abs() < 1e-12);
    }
}
