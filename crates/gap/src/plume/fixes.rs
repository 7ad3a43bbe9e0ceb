//! Where a platform was: its logged places without the jitter of their fixes.
//!
//! An aircraft does not jump a metre to and fro from second to second, its logged places may. A
//! plume predicted at such places jumps with them, and a sensor that is slow and early by as much
//! would seem to mend it, since it averages them. So the jitter is measured (by how far a fix lies
//! from the cubic through its neighbours) and averaged out by parabolas over as many fixes as they
//! fit: each fix has the widest stretch about it over which the estimates of all narrower ones agree
//! (intersection of confidence intervals; Goldenshluger & Nemirovski 1997).

use std::ops::Range;

use ::plume::track::Row;

/// Fixes farther apart than this tell nothing of each other's jitter, s.
const LONGEST_STEP_S: f64 = 2.5;
/// Jitter that is not worth a change, m.
const LEAST_JITTER_M: f64 = 0.1;
/// Half widths of the stretches, in fixes, the narrowest first.
const HALF_WIDTHS: [usize; 6] = [2, 3, 4, 6, 8, 11];
/// Half width of the confidence intervals, standard deviations.
const CONFIDENT_SD: f64 = 1.3;
/// Part of the fixes that at least lie on a way that a cubic follows, and the normal law's quantile
/// of a size that this part stays below half of.
const SMOOTH_PART: f64 = 0.3;
const NORMAL_AT_SMOOTH_PART: f64 = 0.385_320_466_407_567_7;

/// The axes of a place.
const AXES: usize = 3;

/// Takes the jitter out of the places of `rows`, which stand platform by platform in order of time.
pub fn without_jitter(rows: &mut [Row]) {
    let stretches: Vec<Range<usize>> = steady_stretches(rows);
    let mut start = 0;
    while start < stretches.len() {
        let platform = rows[stretches[start].start].platform;
        let of_platform = |s: &&Range<usize>| rows[s.start].platform == platform;
        let count = stretches[start..].iter().take_while(of_platform).count();
        smooth(rows, &stretches[start..start + count]);
        start += count;
    }
}

/// Stretches of one platform whose fixes follow each other closely.
fn steady_stretches(rows: &[Row]) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        let follows = |before: &Row| {
            before.platform == row.platform && row.time_s - before.time_s <= LONGEST_STEP_S
        };
        match out.last_mut() {
            Some(last) if follows(&rows[i - 1]) => last.end = i + 1,
            _ => out.push(i..i + 1),
        }
    }
    out
}

/// Takes the jitter out of the fixes of one platform.
fn smooth(rows: &mut [Row], stretches: &[Range<usize>]) {
    let jitter_m = jitter_m(rows, stretches);
    if jitter_m.iter().all(|j| *j < LEAST_JITTER_M) {
        return;
    }
    for stretch in stretches {
        let fixes: Vec<(f64, [f64; AXES])> = rows[stretch.clone()]
            .iter()
            .map(|r| (r.time_s, axes(r)))
            .collect();
        for (i, row) in rows[stretch.clone()].iter_mut().enumerate() {
            let at = agreed(&fixes, i, &jitter_m);
            row.place.east_m = at[0];
            row.place.north_m = at[1];
            row.place.height_agl_m = at[2];
        }
    }
}

fn axes(row: &Row) -> [f64; AXES] {
    let place = row.place;
    [place.east_m, place.north_m, place.height_agl_m]
}

/// One standard deviation of the jitter of a platform's fixes along every axis, m.
fn jitter_m(rows: &[Row], stretches: &[Range<usize>]) -> [f64; AXES] {
    let mut sizes: [Vec<f64>; AXES] = Default::default();
    for stretch in stretches {
        for five in rows[stretch.clone()].windows(5) {
            let time_s = |k: usize| five[k].time_s;
            let others = [0, 1, 3, 4];
            // Lagrange's cubic through the two fixes on either side.
            let weights = others.map(|k| {
                others
                    .iter()
                    .filter(|j| **j != k)
                    .map(|j| (time_s(2) - time_s(*j)) / (time_s(k) - time_s(*j)))
                    .product::<f64>()
            });
            let size = (1.0 + weights.iter().map(|w| w * w).sum::<f64>()).sqrt();
            let own = axes(&five[2]);
            for (axis, sizes) in sizes.iter_mut().enumerate() {
                let cubic = others
                    .iter()
                    .zip(weights)
                    .map(|(k, w)| w * axes(&five[*k])[axis]);
                sizes.push((own[axis] - cubic.sum::<f64>()).abs() / size);
            }
        }
    }
    sizes.map(|mut sizes| {
        sizes.sort_by(f64::total_cmp);
        let place = (SMOOTH_PART * sizes.len() as f64) as usize;
        sizes.get(place).map_or(0.0, |s| s / NORMAL_AT_SMOOTH_PART)
    })
}

/// Where fix `i` is: by the parabola over the widest stretch that agrees with all narrower ones.
fn agreed(fixes: &[(f64, [f64; AXES])], i: usize, jitter_m: &[f64; AXES]) -> [f64; AXES] {
    let mut at = fixes[i].1;
    let mut low = [0, 1, 2].map(|k| at[k] - CONFIDENT_SD * jitter_m[k]);
    let mut high = [0, 1, 2].map(|k| at[k] + CONFIDENT_SD * jitter_m[k]);
    let mut open = jitter_m.map(|j| j >= LEAST_JITTER_M);
    for half in HALF_WIDTHS {
        let (from, to) = (i.saturating_sub(half), (i + half + 1).min(fixes.len()));
        let Some(weights) = parabola_weights(&fixes[from..to], fixes[i].0) else {
            break;
        };
        let known = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        for k in 0..AXES {
            if !open[k] {
                continue;
            }
            let around = fixes[from..to].iter().zip(&weights);
            let estimate: f64 = around.map(|(f, w)| w * f.1[k]).sum();
            let sd = known * jitter_m[k];
            low[k] = low[k].max(estimate - CONFIDENT_SD * sd);
            high[k] = high[k].min(estimate + CONFIDENT_SD * sd);
            if low[k] > high[k] {
                open[k] = false;
            } else {
                at[k] = estimate;
            }
        }
    }
    at
}

/// Weights of the fixes in the value at `time_s` of the parabola through them by least squares;
/// none of fewer than four, which it would follow wherever they are.
fn parabola_weights(fixes: &[(f64, [f64; AXES])], time_s: f64) -> Option<Vec<f64>> {
    if fixes.len() < 4 {
        return None;
    }
    let times: Vec<f64> = fixes.iter().map(|f| f.0 - time_s).collect();
    let moment = |power: i32| times.iter().map(|t| t.powi(power)).sum::<f64>();
    let [m0, m1, m2, m3, m4] = [0, 1, 2, 3, 4].map(moment);
    // The first row of the inverse of the normal equations, by cofactors.
    let cofactors = [m2 * m4 - m3 * m3, m2 * m3 - m1 * m4, m1 * m3 - m2 * m2];
    let determinant = m0 * cofactors[0] + m1 * cofactors[1] + m2 * cofactors[2];
    let weight = |t: &f64| (cofactors[0] + cofactors[1] * t + cofactors[2] * t * t) / determinant;
    (determinant > 0.0).then(|| times.iter().map(weight).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::plume::effects::SensorAir;
    use ::plume::field::Place;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn row(time_s: f64, [east_m, north_m, height_agl_m]: [f64; 3]) -> Row {
        Row {
            platform: 0,
            time_s,
            place: Place {
                east_m,
                north_m,
                height_agl_m,
            },
            wind: None,
            air: SensorAir::UNKNOWN,
        }
    }

    /// Legs of 40 s at 18 m/s to and fro with sharp corners, climbing a step at each.
    fn legs(time_s: f64) -> [f64; 3] {
        let leg = (time_s / 40.0).floor();
        let along = 18.0 * (time_s - 40.0 * leg);
        let east = if leg % 2.0 == 0.0 {
            along
        } else {
            720.0 - along
        };
        [east, 60.0 * leg, 300.0]
    }

    /// A circle of 100 m at 18 m/s.
    fn circle(time_s: f64) -> [f64; 3] {
        let angle = 0.18 * time_s;
        [100.0 * angle.cos(), 100.0 * angle.sin(), 250.0]
    }

    /// Root mean square of what is left of the jitter of `sd_m`, and the most that any fix moved.
    fn left_m(way: impl Fn(f64) -> [f64; 3], step_s: f64, sd_m: f64) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let times: Vec<f64> = (0..600).map(|k| f64::from(k) * step_s).collect();
        let fix = |t: &f64| row(*t, way(*t).map(|x| x + sd_m * noise()));
        let logged: Vec<Row> = times.iter().map(fix).collect();
        let mut rows = logged.clone();
        without_jitter(&mut rows);
        let far =
            |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let square: f64 = rows.iter().map(|r| far(axes(r), way(r.time_s))).sum();
        let moved = rows.iter().zip(&logged).map(|(a, b)| far(axes(a), axes(b)));
        let most = moved.fold(0.0, f64::max).sqrt();
        ((square / 3.0 / rows.len() as f64).sqrt(), most)
    }

    #[test]
    fn jitter_goes_and_the_way_stays() {
        for (step_s, sd_m) in [(1.0, 1.0), (0.5, 2.0), (1.0, 0.3)] {
            assert!(left_m(legs, step_s, sd_m).0 < 0.6 * sd_m);
            assert!(left_m(circle, step_s, sd_m).0 < 0.8 * sd_m);
        }
    }

    #[test]
    fn a_smooth_way_is_left_alone() {
        for way in [legs, circle] {
            assert_eq!(left_m(way, 1.0, 0.0).1, 0.0);
            assert_eq!(left_m(way, 0.2, 0.0).1, 0.0);
        }
        // Fixes that far apart are nobody's neighbours.
        assert_eq!(left_m(circle, 3.0, 2.0).1, 0.0);
    }

    #[test]
    fn a_parabola_is_followed_wherever_it_is_asked() {
        let way = |t: f64| [3.0 - 2.0 * t + 0.5 * t * t, t, 1.0];
        let fixes: Vec<(f64, [f64; 3])> =
            [0.0, 0.7, 1.1, 2.5, 3.0, 4.2].map(|t| (t, way(t))).into();
        for at in [0.0, 1.1, 4.2] {
            let weights = parabola_weights(&fixes, at).unwrap();
            let value: f64 = weights.iter().zip(&fixes).map(|(w, f)| w * f.1[0]).sum();
            assert!((value - way(at)[0]).abs() < 1e-9);
        }
        assert!(parabola_weights(&fixes[..3], 0.7).is_none());
    }
}
