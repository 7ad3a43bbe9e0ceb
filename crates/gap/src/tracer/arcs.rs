//! From samplers to arcs: the maximum, the crosswind-integrated concentration and the width,
//! so that vertical and lateral causes can be told apart; and the vertical spread at towers.

use std::collections::BTreeMap;

use plume::stability::Stability;

use super::table::{Receptor, Tables, Trial};

/// A trial with the weather that the analysis needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Weather {
    /// Trial.
    pub trial: String,
    /// Release, mg/s.
    pub release_mg_s: f64,
    /// Height of the release, m above ground.
    pub source_height_m: f64,
    /// Wind speed, m/s, at `wind_height_m`.
    pub wind_speed_m_s: f64,
    /// Height of the wind speed, m above ground.
    pub wind_height_m: f64,
    /// Obukhov length, m.
    pub obukhov_length_m: f64,
    /// Roughness length, m.
    pub roughness_m: f64,
    /// Mixing height, m.
    pub mixing_height_m: Option<f64>,
    /// Standard deviation of azimuth, radians.
    pub sigma_azimuth_rad: Option<f64>,
    /// Class from Obukhov length and roughness.
    pub class: Stability,
    /// Place between the classes by 1/L: 0 for the middle of A to 5 for that of F, half-way at
    /// their limits.
    pub class_position: f64,
}

/// One arc of one trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Arc {
    /// Distance from the source, m.
    pub distance_m: f64,
    /// Height of the samplers above ground, m.
    pub height_m: f64,
    /// Number of samplers with a value.
    pub samplers: usize,
    /// Highest concentration, mg/m³.
    pub max_mg_m3: f64,
    /// Crosswind-integrated concentration, mg/m².
    pub integrated_mg_m2: f64,
    /// Standard deviation of the distribution across, m.
    pub width_m: f64,
    /// Whether the plume ends inside the arc and is resolved, so that integral and width hold.
    pub whole: bool,
}

/// A trial with its arcs.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialArcs {
    /// Weather and release.
    pub weather: Weather,
    /// Arcs by distance.
    pub arcs: Vec<Arc>,
    /// Distance, m, and vertical spread σ_z, m, seen by towers.
    pub tower_spread_m: Option<(f64, f64)>,
}

/// Samplers whose distances differ by less than this part are on one arc.
const ARC_TOLERANCE: f64 = 0.05;
/// An arc whose end samplers read more than this part of its maximum is cut off.
const CUT_OFF: f64 = 0.1;
/// Fewest samplers that read more than a tenth of the maximum for a width.
const LEAST_INSIDE: usize = 3;
/// Roughness length where the trials give none, m.
const DEFAULT_ROUGHNESS_M: f64 = 0.03;
/// A sampling correction below this is taken for a slip of the pen.
const LEAST_CORRECTION: f64 = 0.5;

/// The trials with weather, their arcs and towers, and what was left out and why.
pub fn trials(tables: &Tables) -> (Vec<TrialArcs>, Vec<String>) {
    let mut notices = Vec::new();
    let by_trial = |rows: &[Receptor]| {
        let mut map: BTreeMap<String, Vec<Receptor>> = BTreeMap::new();
        for row in rows {
            map.entry(row.trial.clone()).or_default().push(row.clone());
        }
        map
    };
    let (receptors, towers) = (by_trial(&tables.receptors), by_trial(&tables.towers));
    let mut out = Vec::new();
    let mut without = Vec::new();
    for trial in &tables.trials {
        let Some(weather) = weather(trial) else {
            without.push(trial.trial.clone());
            continue;
        };
        let Some(rows) = receptors.get(&trial.trial) else {
            notices.push(format!("trial {}: no receptors", trial.trial));
            continue;
        };
        let arcs = arcs(&trial.trial, rows, &mut notices);
        let factor = middle_factor(rows);
        let tower_spread_m = towers
            .get(&trial.trial)
            .and_then(|t| tower_spread(t, factor));
        if !arcs.is_empty() {
            out.push(TrialArcs {
                weather,
                arcs,
                tower_spread_m,
            });
        }
    }
    if !without.is_empty() {
        notices.push(format!(
            "{} trials without wind speed or Obukhov length are left out: {}",
            without.len(),
            without.join(", ")
        ));
    }
    (out, notices)
}

fn weather(trial: &Trial) -> Option<Weather> {
    let obukhov_length_m = trial.obukhov_length_m.filter(|l| *l != 0.0)?;
    let roughness_m = trial.roughness_length_m.unwrap_or(DEFAULT_ROUGHNESS_M);
    Some(Weather {
        trial: trial.trial.clone(),
        release_mg_s: trial.source_rate_g_s * 1000.0,
        source_height_m: trial.source_height_agl_m,
        wind_speed_m_s: trial.wind_speed_m_s?,
        wind_height_m: trial.wind_height_m.unwrap_or(2.0),
        obukhov_length_m,
        roughness_m,
        mixing_height_m: trial.mixing_height_m,
        sigma_azimuth_rad: trial.sigma_azimuth_deg.map(f64::to_radians),
        class: Stability::from_obukhov(obukhov_length_m, roughness_m),
        class_position: class_position(obukhov_length_m, roughness_m),
    })
}

/// The limits of 1/L, 1/m, between A and B, B and C and so on to E and F, by bisection on the
/// classification itself.
pub fn class_limits_per_m(roughness_m: f64) -> [f64; 5] {
    let mut limits = [0.0; 5];
    for (limit, next) in limits.iter_mut().zip(&Stability::ALL[1..]) {
        let (mut low, mut high) = (-1.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if Stability::from_obukhov(1.0 / middle, roughness_m) < *next {
                low = middle;
            } else {
                high = middle;
            }
        }
        *limit = 0.5 * (low + high);
    }
    limits
}

fn class_position(obukhov_length_m: f64, roughness_m: f64) -> f64 {
    let limits = class_limits_per_m(roughness_m);
    let inverse = 1.0 / obukhov_length_m;
    // The pair of limits about 1/L, or the nearest pair beyond the ends.
    let upper = limits
        .partition_point(|l| *l < inverse)
        .clamp(1, limits.len() - 1);
    let (a, b) = (limits[upper - 1], limits[upper]);
    (upper as f64 - 0.5 + (inverse - a) / (b - a)).clamp(0.0, 5.0)
}

/// Median of the plausible sampling corrections of a trial; 1 where none is known.
fn middle_factor(rows: &[Receptor]) -> f64 {
    let mut factors: Vec<f64> = rows
        .iter()
        .filter_map(|r| r.evaporation_factor)
        .filter(|f| *f >= LEAST_CORRECTION)
        .collect();
    factors.sort_by(f64::total_cmp);
    factors.get(factors.len() / 2).copied().unwrap_or(1.0)
}

fn arcs(trial: &str, rows: &[Receptor], notices: &mut Vec<String>) -> Vec<Arc> {
    let usual = middle_factor(rows);
    let mut odd = 0;
    // (distance, azimuth, height, corrected concentration)
    let mut points: Vec<[f64; 4]> = Vec::new();
    for row in rows {
        let Some(concentration) = row.concentration_mg_m3 else {
            continue;
        };
        let factor = match row.evaporation_factor {
            Some(f) if f >= LEAST_CORRECTION => f,
            Some(_) => {
                odd += 1;
                usual
            }
            None => usual,
        };
        let azimuth = row.east_m.atan2(row.north_m);
        let distance = row.east_m.hypot(row.north_m);
        points.push([distance, azimuth, row.height_agl_m, concentration * factor]);
    }
    if odd > 0 {
        notices.push(format!(
            "trial {trial}: {odd} sampling corrections below {LEAST_CORRECTION} are implausible; \
             the trial's median {usual} is used instead"
        ));
    }
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut arcs = Vec::new();
    let mut start = 0;
    for end in 1..=points.len() {
        if end == points.len() || points[end][0] > points[start][0] * (1.0 + ARC_TOLERANCE) {
            match arc(&points[start..end]) {
                Some(arc) => arcs.push(arc),
                None => notices.push(format!(
                    "trial {trial}: nothing detected on the arc at {:.0} m",
                    points[start][0]
                )),
            }
            start = end;
        }
    }
    arcs
}

fn arc(points: &[[f64; 4]]) -> Option<Arc> {
    let count = points.len() as f64;
    let distance_m = points.iter().map(|p| p[0]).sum::<f64>() / count;
    let height_m = points.iter().map(|p| p[2]).sum::<f64>() / count;
    // Azimuths about the plume's own direction, so that an arc may cross north.
    let (sin, cos) = points.iter().fold((0.0, 0.0), |s, p| {
        (s.0 + p[3] * p[1].sin(), s.1 + p[3] * p[1].cos())
    });
    let middle = sin.atan2(cos);
    let wrap = |a: f64| (a + 3.0 * std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
    let mut across: Vec<(f64, f64)> = points
        .iter()
        .map(|p| {
            (
                distance_m * (wrap(p[1] - middle) - std::f64::consts::PI),
                p[3],
            )
        })
        .collect();
    across.sort_by(|a, b| a.0.total_cmp(&b.0));
    let max_mg_m3 = across.iter().map(|p| p.1).fold(0.0, f64::max);
    if max_mg_m3 <= 0.0 {
        return None;
    }
    // Trapezoids for the moments of the distribution across.
    let moment = |power: i32, about: f64| -> f64 {
        let f = |p: &(f64, f64)| p.1 * (p.0 - about).powi(power);
        across
            .windows(2)
            .map(|w| 0.5 * (f(&w[0]) + f(&w[1])) * (w[1].0 - w[0].0))
            .sum()
    };
    let integrated_mg_m2 = moment(0, 0.0);
    let mean = moment(1, 0.0) / integrated_mg_m2;
    let width_m = (moment(2, mean) / integrated_mg_m2).max(0.0).sqrt();
    let ends = across[0].1.max(across[across.len() - 1].1);
    let inside = across.iter().filter(|p| p.1 > 0.1 * max_mg_m3).count();
    let whole = integrated_mg_m2 > 0.0
        && width_m > 0.0
        && ends < CUT_OFF * max_mg_m3
        && inside >= LEAST_INSIDE;
    let samplers = across.len();
    Some(Arc {
        distance_m,
        height_m,
        samplers,
        max_mg_m3,
        integrated_mg_m2,
        width_m,
        whole,
    })
}

/// σ_z of a plume from the ground at towers, from the second moment of the profile summed over
/// the towers; the profile below the lowest sampler is that of the lowest. `None` where the
/// plume reaches above the towers or too few heights saw it.
fn tower_spread(rows: &[Receptor], factor: f64) -> Option<(f64, f64)> {
    let mut levels: Vec<(f64, f64, usize)> = Vec::new();
    let mut distance = 0.0;
    for row in rows {
        let Some(concentration) = row.concentration_mg_m3 else {
            continue;
        };
        distance += row.east_m.hypot(row.north_m) / rows.len() as f64;
        let c = concentration * factor;
        match levels
            .iter_mut()
            .find(|l| (l.0 - row.height_agl_m).abs() < 0.01)
        {
            Some(level) => {
                level.1 += c;
                level.2 += 1;
            }
            None => levels.push((row.height_agl_m, c, 1)),
        }
    }
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let profile: Vec<(f64, f64)> = levels.iter().map(|l| (l.0, l.1 / l.2 as f64)).collect();
    let (first, last) = (profile.first()?, profile.last()?);
    let highest = profile.iter().map(|p| p.1).fold(0.0, f64::max);
    let seen = profile.iter().filter(|p| p.1 > 0.0).count();
    if profile.len() < 5 || seen < 4 || last.1 > 0.05 * highest || first.1 < 0.3 * highest {
        return None;
    }
    let mut sums = (first.1 * first.0, first.1 * first.0.powi(3) / 3.0);
    for w in profile.windows(2) {
        let step = w[1].0 - w[0].0;
        sums.0 += 0.5 * (w[0].1 + w[1].1) * step;
        sums.1 += 0.5 * (w[0].1 * w[0].0.powi(2) + w[1].1 * w[1].0.powi(2)) * step;
    }
    Some((distance, (sums.1 / sums.0).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_between_classes_agree_with_the_classes() {
        for inverse in [-0.2, -0.1, -0.05, -0.01, 0.001, 0.01, 0.03, 0.06, 0.1, 0.3] {
            let position = class_position(1.0 / inverse, 0.006);
            let class = Stability::from_obukhov(1.0 / inverse, 0.006);
            assert_eq!(
                position.round() as usize,
                class.index(),
                "{inverse}: {position}"
            );
        }
        assert!((class_position(1e6, 0.006) - 3.0).abs() < 0.03);
    }

    fn fan(c: impl Fn(f64) -> f64) -> Vec<[f64; 4]> {
        // Samplers every 2 degrees from 290 to 70 degrees, crossing north, at 100 m.
        (-35..=35)
            .map(|k| {
                let azimuth = (2.0 * f64::from(k)).to_radians();
                [100.0, azimuth, 1.5, c(100.0 * azimuth)]
            })
            .collect()
    }

    // A normal distribution across with σ 15 m and peak 3: integral 3·15·√2π = 112.80.
    #[test]
    fn moments_of_a_normal_distribution() {
        let arc = arc(&fan(|y| 3.0 * (-0.5 * ((y - 10.0) / 15.0).powi(2)).exp())).unwrap();
        assert!(
            (arc.integrated_mg_m2 / 112.80 - 1.0).abs() < 1e-3,
            "{arc:?}"
        );
        assert!((arc.width_m / 15.0 - 1.0).abs() < 1e-3 && arc.whole);
        assert!((arc.max_mg_m3 - 3.0).abs() < 0.05);
    }

    #[test]
    fn a_plume_at_the_end_of_the_arc_is_cut_off() {
        let arc = arc(&fan(|y| (-0.5 * ((y - 120.0) / 15.0).powi(2)).exp())).unwrap();
        assert!(!arc.whole);
        assert_eq!(super::arc(&fan(|_| 0.0)), None);
    }
}
