//! From samplers to arcs: the maximum, the crosswind-integrated concentration and the width,
//! so that vertical and lateral causes can be told apart; and the vertical spread at towers.

use std::collections::{BTreeMap, BTreeSet};

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
    /// Direction from which the wind blows, degrees.
    pub wind_from_deg: Option<f64>,
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
    /// Direction from the source in which the middle of the plume lies, degrees.
    pub bearing_deg: f64,
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
    /// Distance, m, and vertical spread σ_z, m, seen by the towers at each distance.
    pub tower_spreads_m: Vec<(f64, f64)>,
}

/// Samplers on one arc follow each other in distance by less than this part…
const ARC_STEP: f64 = 0.05;
/// … and differ by less than this part in all: roads are not circles.
const ARC_SPAN: f64 = 0.25;
/// Samplers of one arc whose heights differ by more than this are at different heights, m.
const HEIGHT_TOLERANCE_M: f64 = 0.25;
/// An arc whose end samplers read more than this part of its maximum is cut off.
const CUT_OFF: f64 = 0.1;
/// Fewest samplers that read more than a tenth of the maximum for a width.
const LEAST_INSIDE: usize = 3;
/// Roughness length where the trials give none, m.
const DEFAULT_ROUGHNESS_M: f64 = 0.03;
/// Height of the wind where the trials give none, m.
const DEFAULT_WIND_HEIGHT_M: f64 = 2.0;
/// A sampling correction below this is taken for a slip of the pen.
const LEAST_CORRECTION: f64 = 0.5;

/// What was odd about samplers, counted over all trials.
#[derive(Default)]
struct Oddities {
    mixed_heights: usize,
    other_height: usize,
}

fn by_trial(rows: &[Receptor]) -> BTreeMap<&str, Vec<Receptor>> {
    let mut map: BTreeMap<&str, Vec<Receptor>> = BTreeMap::new();
    for row in rows {
        map.entry(&row.trial).or_default().push(row.clone());
    }
    map
}

/// The trials with weather, their arcs and towers, and what was left out and why.
pub fn trials(tables: &Tables) -> (Vec<TrialArcs>, Vec<String>) {
    let mut notices = table_notices(tables);
    let (receptors, towers) = (by_trial(&tables.receptors), by_trial(&tables.towers));
    let mut out = Vec::new();
    let mut without = Vec::new();
    let mut odd = Oddities::default();
    for trial in &tables.trials {
        let Some(weather) = weather(trial) else {
            without.push(trial.trial.as_str());
            continue;
        };
        let Some(rows) = receptors.get(trial.trial.as_str()) else {
            notices.push(format!("trial {}: no receptors", trial.trial));
            continue;
        };
        let arcs = arcs(&trial.trial, rows, &mut odd, &mut notices);
        let factor = middle_factor(rows);
        let tower_spreads_m = towers
            .get(trial.trial.as_str())
            .map_or_else(Vec::new, |t| tower_spreads(t, factor));
        if !arcs.is_empty() {
            out.push(TrialArcs {
                weather,
                arcs,
                tower_spreads_m,
            });
        }
    }
    if !without.is_empty() {
        notices.push(format!(
            "{} trials without wind speed or Obukhov length are ignored: {}",
            without.len(),
            listed(&without)
        ));
    }
    if odd.mixed_heights > 0 {
        notices.push(format!(
            "on {} arcs samplers stand at several heights: the height with the most detections is used, and {} \
             samplers at others are ignored",
            odd.mixed_heights, odd.other_height
        ));
    }
    (out, notices)
}

/// The first names, and how many more.
pub(super) fn listed(names: &[&str]) -> String {
    const MOST: usize = 20;
    let mut text = names[..names.len().min(MOST)].join(", ");
    if names.len() > MOST {
        text.push_str(&format!(" and {} more", names.len() - MOST));
    }
    text
}

/// What the tables lack or have twice.
fn table_notices(tables: &Tables) -> Vec<String> {
    let mut notices = Vec::new();
    let known: BTreeSet<&str> = tables.trials.iter().map(|t| t.trial.as_str()).collect();
    for (what, rows) in [("receptors", &tables.receptors), ("towers", &tables.towers)] {
        let strange = |r: &&Receptor| !known.contains(r.trial.as_str());
        let names: BTreeSet<&str> = rows
            .iter()
            .filter(strange)
            .map(|r| r.trial.as_str())
            .collect();
        if !names.is_empty() {
            notices.push(format!(
                "{} rows of the {what} are ignored, since the table of trials lacks their trials: {}",
                rows.iter().filter(strange).count(),
                listed(&names.into_iter().collect::<Vec<_>>())
            ));
        }
        let place = |r: &Receptor| {
            let numbers = [r.east_m, r.north_m, r.height_agl_m].map(f64::to_bits);
            (r.trial.clone(), numbers)
        };
        let places: BTreeSet<_> = rows.iter().map(place).collect();
        if places.len() < rows.len() {
            notices.push(format!(
                "{} rows of the {what} are at the place of another row of their trial: all are used",
                rows.len() - places.len()
            ));
        }
    }
    let lacking = |has: &dyn Fn(&Trial) -> bool| tables.trials.iter().filter(|t| !has(t)).count();
    let roughness = lacking(&|t| t.roughness_length_m.is_some());
    if roughness > 0 {
        notices.push(format!(
            "{roughness} trials have no roughness_length_m: {DEFAULT_ROUGHNESS_M} m is assumed, on which the \
             limits of the classes depend"
        ));
    }
    let roughness_m = tables.trials.iter().filter_map(|t| t.roughness_length_m);
    let (low, high) = roughness_m.fold((f64::MAX, 0.0_f64), |r, z| (r.0.min(z), r.1.max(z)));
    if high > 1.5 * low {
        notices.push(format!(
            "roughness lengths go from {low} to {high} m: each trial has its own class limits, of which the \
             first are shown"
        ));
    }
    let height = lacking(&|t| t.wind_height_m.is_some() || t.wind_speed_m_s.is_none());
    if height > 0 {
        notices.push(format!(
            "{height} trials have no wind_height_m: {DEFAULT_WIND_HEIGHT_M} m is assumed"
        ));
    }
    notices
}

/// Why no trial can be used, from the counts of what they lack.
pub fn lacking(tables: &Tables) -> String {
    let receptors = by_trial(&tables.receptors);
    let count = |which: &dyn Fn(&Trial) -> bool| tables.trials.iter().filter(|t| which(t)).count();
    format!(
        "of {} trials {} have no wind_speed_m_s, {} no obukhov_length_m, {} no receptors under their \
         name, and {} a reading above 0",
        tables.trials.len(),
        count(&|t| t.wind_speed_m_s.is_none()),
        count(&|t| t.obukhov_length_m.is_none_or(|l| l == 0.0)),
        count(&|t| !receptors.contains_key(t.trial.as_str())),
        count(&|t| {
            let rows = receptors.get(t.trial.as_str());
            let read = |r: &Receptor| r.concentration_mg_m3.is_some_and(|c| c > 0.0);
            rows.is_some_and(|rows| rows.iter().any(read))
        }),
    )
}

fn weather(trial: &Trial) -> Option<Weather> {
    let obukhov_length_m = trial.obukhov_length_m.filter(|l| *l != 0.0)?;
    let roughness_m = trial.roughness_length_m.unwrap_or(DEFAULT_ROUGHNESS_M);
    Some(Weather {
        trial: trial.trial.clone(),
        release_mg_s: trial.source_rate_g_s * 1000.0,
        source_height_m: trial.source_height_agl_m,
        wind_speed_m_s: trial.wind_speed_m_s?,
        wind_height_m: trial.wind_height_m.unwrap_or(DEFAULT_WIND_HEIGHT_M),
        obukhov_length_m,
        roughness_m,
        mixing_height_m: trial.mixing_height_m,
        sigma_azimuth_rad: trial.sigma_azimuth_deg.map(f64::to_radians),
        wind_from_deg: trial.wind_from_deg,
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

fn arcs(trial: &str, rows: &[Receptor], odd: &mut Oddities, notices: &mut Vec<String>) -> Vec<Arc> {
    let mut points = corrected(trial, rows, notices);
    let usual_m = shared_height_m(&points);
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut arcs = Vec::new();
    let mut start = 0;
    for end in 1..=points.len() {
        let same = end < points.len()
            && points[end][0] <= points[end - 1][0] * (1.0 + ARC_STEP)
            && points[end][0] <= points[start][0] * (1.0 + ARC_SPAN);
        if same {
            continue;
        }
        let level = of_one_height(&points[start..end], usual_m);
        if level.len() < end - start {
            odd.mixed_heights += 1;
            odd.other_height += end - start - level.len();
        }
        match arc(&level) {
            Some(arc) => arcs.push(arc),
            None => notices.push(format!(
                "trial {trial}: nothing detected on the arc at {:.0} m",
                points[start][0]
            )),
        }
        start = end;
    }
    arcs
}

fn at_height(points: &[[f64; 4]], height_m: f64) -> Vec<[f64; 4]> {
    let near = |p: &&[f64; 4]| (p[2] - height_m).abs() <= HEIGHT_TOLERANCE_M;
    points.iter().filter(near).copied().collect()
}

/// The height at which most samplers read something, the lowest of several.
fn shared_height_m(points: &[[f64; 4]]) -> f64 {
    let mut heights: Vec<f64> = points.iter().map(|p| p[2]).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    let readings = |h: f64| at_height(points, h).iter().filter(|p| p[3] > 0.0).count();
    // Of equal counts the last is the maximum: from above.
    let most = heights.into_iter().rev().max_by_key(|h| readings(*h));
    most.unwrap_or(f64::NAN)
}

/// The samplers of an arc at one height: that of most of the trial, or of most of the arc.
fn of_one_height(points: &[[f64; 4]], usual_m: f64) -> Vec<[f64; 4]> {
    let usual = at_height(points, usual_m);
    if 2 * usual.len() >= LEAST_INSIDE.max(points.len() / 2) {
        usual
    } else {
        at_height(points, shared_height_m(points))
    }
}

/// Samplers with a reading: distance, m, azimuth, radians, height, m, and concentration, mg/m³,
/// corrected for the sampling loss.
fn corrected(trial: &str, rows: &[Receptor], notices: &mut Vec<String>) -> Vec<[f64; 4]> {
    let usual = middle_factor(rows);
    let mut odd = 0;
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
    points
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
        bearing_deg: middle.to_degrees(),
        max_mg_m3,
        integrated_mg_m2,
        width_m,
        whole,
    })
}

/// Distance and σ_z, m, for the towers at each distance that show it.
fn tower_spreads(rows: &[Receptor], factor: f64) -> Vec<(f64, f64)> {
    let mut read: Vec<[f64; 3]> = rows
        .iter()
        .filter_map(|r| {
            let distance_m = r.east_m.hypot(r.north_m);
            Some([distance_m, r.height_agl_m, factor * r.concentration_mg_m3?])
        })
        .collect();
    read.sort_by(|a, b| a[0].total_cmp(&b[0]));
    read.chunk_by(|a, b| b[0] <= a[0] * (1.0 + ARC_STEP))
        .filter_map(tower_spread)
        .collect()
}

/// Mean distance and σ_z, m, of a plume from the ground at towers, from samplers' distances, heights
/// and concentrations: the second moment of the profile summed over the towers; the profile below
/// the lowest sampler is that of the lowest. `None` where the plume reaches above the towers or too
/// few heights saw it.
fn tower_spread(rows: &[[f64; 3]]) -> Option<(f64, f64)> {
    let mut levels: Vec<(f64, f64, usize)> = Vec::new();
    for &[_, height_m, c] in rows {
        match levels.iter_mut().find(|l| (l.0 - height_m).abs() < 0.01) {
            Some(level) => {
                level.1 += c;
                level.2 += 1;
            }
            None => levels.push((height_m, c, 1)),
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
    let distance_m = rows.iter().map(|r| r[0]).sum::<f64>() / rows.len() as f64;
    Some((distance_m, (sums.1 / sums.0).sqrt()))
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

    // Two rings of towers with samplers every half metre. The second moment of a half-normal profile
    // from the ground is σ²; one reading is missing, as happens.
    #[test]
    fn towers_at_each_distance_show_their_own_spread() {
        let ring = |distance_m: f64, sigma_m: f64| {
            (1..=40).map(move |k| {
                let height_agl_m = 0.5 * f64::from(k);
                let c = (-0.5 * (height_agl_m / sigma_m).powi(2)).exp();
                Receptor {
                    trial: "t".into(),
                    east_m: 0.6 * distance_m,
                    north_m: 0.8 * distance_m,
                    height_agl_m,
                    concentration_mg_m3: (k != 20).then_some(c),
                    evaporation_factor: None,
                }
            })
        };
        let rows: Vec<Receptor> = ring(100.0, 5.0).chain(ring(50.0, 3.0)).collect();
        let spreads = tower_spreads(&rows, 1.0);
        for ((distance_m, sigma_m), [x, sigma]) in spreads.iter().zip([[50.0, 3.0], [100.0, 5.0]]) {
            assert!((distance_m - x).abs() < 1e-9, "{spreads:?}");
            assert!((sigma_m / sigma - 1.0).abs() < 0.01, "{spreads:?}");
        }
        assert_eq!(spreads.len(), 2);
    }

    #[test]
    fn a_plume_at_the_end_of_the_arc_is_cut_off() {
        let arc = arc(&fan(|y| (-0.5 * ((y - 120.0) / 15.0).powi(2)).exp())).unwrap();
        assert!(!arc.whole);
        assert_eq!(super::arc(&fan(|_| 0.0)), None);
    }
}
