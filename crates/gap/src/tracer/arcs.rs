//! From samplers to arcs: the maximum, the crosswind-integrated concentration and the width,
//! so that vertical and lateral causes can be told apart; and the vertical spread at towers.

use std::collections::{BTreeMap, BTreeSet};

use air::geo::wrap_signed_rad;
use formats::list::listed;
use plume::stability::Stability;

use super::table::{Receptor, Tables, Trial};
use crate::statistics::median;
use crate::verdict::{DataQuality, Flaw};

/// A trial's release and weather.
#[derive(Debug, Clone, PartialEq)]
pub struct Weather {
    /// Trial.
    pub trial: String,
    pub release_mg_s: f64,
    /// Above ground, as all heights here.
    pub source_height_m: f64,
    pub wind_speed_m_s: f64,
    pub wind_height_m: f64,
    pub obukhov_length_m: f64,
    pub roughness_m: f64,
    pub mixing_height_m: Option<f64>,
    /// Standard deviation of azimuth.
    pub sigma_azimuth_rad: Option<f64>,
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
    pub distance_m: f64,
    /// Height of the samplers.
    pub height_m: f64,
    /// Number of samplers with a value.
    pub samplers: usize,
    /// Direction from the source in which the middle of the plume lies.
    pub bearing_deg: f64,
    /// Highest concentration.
    pub max_mg_m3: f64,
    /// Crosswind-integrated concentration.
    pub integrated_mg_m2: f64,
    /// Standard deviation of the distribution across.
    pub width_m: f64,
    /// Whether the plume ends inside the arc and is resolved, so that integral and width hold.
    pub whole: bool,
}

/// A trial with its arcs.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialArcs {
    pub weather: Weather,
    /// By distance.
    pub arcs: Vec<Arc>,
    /// Distance, m, and vertical spread σ_z, m, seen by the towers at each distance.
    pub tower_spreads_m: Vec<(f64, f64)>,
}

impl TrialArcs {
    /// The arcs whose integral and width hold.
    pub fn whole(&self) -> impl Iterator<Item = &Arc> {
        self.arcs.iter().filter(|a| a.whole)
    }
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
/// Roughness lengths that differ by more than this factor have class limits of their own.
const LARGEST_ROUGHNESS_RATIO: f64 = 1.5;
/// Most trials that a notice lists.
pub const MOST_LISTED: usize = 20;

/// A sampler with a reading.
#[derive(Debug, Clone, Copy)]
struct Point {
    x_m: f64,
    azimuth_rad: f64,
    height_m: f64,
    /// Corrected for the sampling loss.
    mg_m3: f64,
}

fn by_trial(rows: &[Receptor]) -> BTreeMap<&str, Vec<&Receptor>> {
    let mut map: BTreeMap<&str, Vec<&Receptor>> = BTreeMap::new();
    for row in rows {
        map.entry(&row.trial).or_default().push(row);
    }
    map
}

/// The trials with weather, their arcs and towers, samplers that are odd, and what a user should know besides.
pub fn trials(tables: &Tables) -> (Vec<TrialArcs>, Vec<DataQuality>, Vec<String>) {
    let mut notices = tables.notices.clone();
    let mut odd = Vec::new();
    notices.extend(table_notices(tables));
    let (receptors, towers) = (by_trial(&tables.receptors), by_trial(&tables.towers));
    let mut trials = Vec::new();
    let mut without = Vec::new();
    let (mut mixed_heights, mut other_height) = (0, 0);
    for trial in &tables.trials {
        let name = trial.trial.as_str();
        let Some(weather) = weather(trial) else {
            without.push(name);
            continue;
        };
        let Some(rows) = receptors.get(name) else {
            notices.push(format!("trial {name}: no receptors"));
            continue;
        };
        let usual = middle_factor(rows);
        let mut arcs = Vec::new();
        let points = corrected(name, rows, usual, &mut odd);
        let usual_m = shared_height_m(&points);
        for points in split(&points) {
            let level = of_one_height(points, usual_m);
            mixed_heights += usize::from(level.len() < points.len());
            other_height += points.len() - level.len();
            match arc(&level) {
                Some(arc) => arcs.push(arc),
                None => notices.push(format!(
                    "trial {name}: nothing detected on the arc at {:.0} m",
                    points[0].x_m
                )),
            }
        }
        if !arcs.is_empty() {
            let towers = towers.get(name).map_or(&[][..], Vec::as_slice);
            trials.push(TrialArcs {
                weather,
                arcs,
                tower_spreads_m: tower_spreads(towers, usual),
            });
        }
    }
    if !without.is_empty() {
        notices.push(format!(
            "{} trials without wind speed or Obukhov length are ignored: {}",
            without.len(),
            listed(&without, MOST_LISTED)
        ));
    }
    if mixed_heights > 0 {
        notices.push(format!(
            "on {mixed_heights} arcs samplers stand at several heights: the height with the most detections is used, \
             and {other_height} samplers at others are ignored"
        ));
    }
    (trials, odd, notices)
}

/// A flaw without a stretch of time.
pub fn flaw(platform: &str, kind: Flaw, message: String) -> DataQuality {
    DataQuality {
        platform: platform.to_owned(),
        kind,
        from_s: f64::NAN,
        to_s: f64::NAN,
        message,
    }
}

/// What the tables lack or have twice.
fn table_notices(tables: &Tables) -> Vec<String> {
    let mut notices = Vec::new();
    let known: BTreeSet<&str> = tables.trials.iter().map(|t| t.trial.as_str()).collect();
    for (what, rows) in [("receptors", &tables.receptors), ("towers", &tables.towers)] {
        let names = rows.iter().map(|r| r.trial.as_str());
        let strange: Vec<&str> = names.filter(|n| !known.contains(n)).collect();
        if !strange.is_empty() {
            let distinct: BTreeSet<&str> = strange.iter().copied().collect();
            notices.push(format!(
                "{} rows of the {what} are ignored, since the table of trials lacks their trials: {}",
                strange.len(),
                listed(&distinct.into_iter().collect::<Vec<_>>(), MOST_LISTED)
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
    if high > LARGEST_ROUGHNESS_RATIO * low {
        notices.push(format!(
            "roughness lengths go from {low} to {high} m: each trial has its own class limits, of which the \
             first are shown"
        ));
    }
    let height = lacking(&|t| t.wind_height_m.is_some() || t.wind_speed_m_s.is_none());
    notices.extend((height > 0).then(|| {
        format!("{height} trials have no wind_height_m: {DEFAULT_WIND_HEIGHT_M} m is assumed")
    }));
    notices
}

/// Why no trial can be used, from the counts of what they lack.
pub fn lacking(tables: &Tables) -> String {
    let receptors = by_trial(&tables.receptors);
    let count = |which: &dyn Fn(&Trial) -> bool| tables.trials.iter().filter(|t| which(t)).count();
    let reads = |t: &Trial| {
        let rows = receptors.get(t.trial.as_str());
        let read = |r: &&Receptor| r.concentration_mg_m3.is_some_and(|c| c > 0.0);
        rows.is_some_and(|rows| rows.iter().any(read))
    };
    format!(
        "of {} trials {} have no wind_speed_m_s, {} no obukhov_length_m, {} no receptors under their \
         name, and {} a reading above 0",
        tables.trials.len(),
        count(&|t| t.wind_speed_m_s.is_none()),
        count(&|t| t.obukhov_length_m.is_none_or(|l| l == 0.0)),
        count(&|t| !receptors.contains_key(t.trial.as_str())),
        count(&reads),
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

fn class_position(obukhov_length_m: f64, roughness_m: f64) -> f64 {
    let limits = Stability::limits_per_m(roughness_m);
    let inverse = 1.0 / obukhov_length_m;
    // The pair of limits about 1/L, or the nearest pair beyond the ends.
    let upper = limits
        .partition_point(|l| *l < inverse)
        .clamp(1, limits.len() - 1);
    let (a, b) = (limits[upper - 1], limits[upper]);
    (upper as f64 - 0.5 + (inverse - a) / (b - a)).clamp(0.0, 5.0)
}

/// Median of the plausible sampling corrections of a trial; 1 where none is known.
fn middle_factor(rows: &[&Receptor]) -> f64 {
    let factors = rows.iter().filter_map(|r| r.evaporation_factor);
    let plausible = factors.filter(|f| *f >= LEAST_CORRECTION);
    median(plausible.collect()).unwrap_or(1.0)
}

/// Samplers with a reading, by distance; `usual` is the factor of those without a plausible one.
fn corrected(
    trial: &str,
    rows: &[&Receptor],
    usual: f64,
    flaws: &mut Vec<DataQuality>,
) -> Vec<Point> {
    let plausible = |r: &Receptor| r.evaporation_factor.filter(|f| *f >= LEAST_CORRECTION);
    let is_odd = |r: &Receptor| plausible(r) != r.evaporation_factor;
    let read = rows.iter().filter(|r| r.concentration_mg_m3.is_some());
    let odd = read.filter(|r| is_odd(r)).count();
    if odd > 0 {
        let message = format!(
            "trial {trial}: {odd} sampling corrections below {LEAST_CORRECTION} are implausible; \
             the trial's median {usual} is used instead"
        );
        flaws.push(flaw(trial, Flaw::Outlier, message));
    }
    points(rows, |r| plausible(r).unwrap_or(usual))
}

/// Samplers with a reading, by distance.
fn points(rows: &[&Receptor], factor: impl Fn(&Receptor) -> f64) -> Vec<Point> {
    let point = |r: &&Receptor| {
        Some(Point {
            x_m: r.east_m.hypot(r.north_m),
            azimuth_rad: r.east_m.atan2(r.north_m),
            height_m: r.height_agl_m,
            mg_m3: factor(r) * r.concentration_mg_m3?,
        })
    };
    let mut points: Vec<Point> = rows.iter().filter_map(point).collect();
    points.sort_by(|a, b| a.x_m.total_cmp(&b.x_m));
    points
}

/// The samplers of each arc.
fn split(points: &[Point]) -> Vec<&[Point]> {
    let mut first_m = None;
    let same = |a: &Point, b: &Point| {
        let start = *first_m.get_or_insert(a.x_m);
        let same = b.x_m <= a.x_m * (1.0 + ARC_STEP) && b.x_m <= start * (1.0 + ARC_SPAN);
        if !same {
            first_m = None;
        }
        same
    };
    points.chunk_by(same).collect()
}

fn at_height(points: &[Point], height_m: f64) -> Vec<Point> {
    let near = |p: &&Point| (p.height_m - height_m).abs() <= HEIGHT_TOLERANCE_M;
    points.iter().filter(near).copied().collect()
}

/// The height at which most samplers read something, the lowest of several.
fn shared_height_m(points: &[Point]) -> f64 {
    let mut heights: Vec<f64> = points.iter().map(|p| p.height_m).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    let readings = |h: f64| {
        let level = at_height(points, h);
        level.iter().filter(|p| p.mg_m3 > 0.0).count()
    };
    // Of equal counts the last is the maximum: from above.
    let most = heights.into_iter().rev().max_by_key(|h| readings(*h));
    most.unwrap_or(f64::NAN)
}

/// The samplers of an arc at one height: that of most of the trial, or of most of the arc.
fn of_one_height(points: &[Point], usual_m: f64) -> Vec<Point> {
    let usual = at_height(points, usual_m);
    if 2 * usual.len() >= LEAST_INSIDE.max(points.len() / 2) {
        usual
    } else {
        at_height(points, shared_height_m(points))
    }
}

fn mean(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    points.iter().map(of).sum::<f64>() / points.len() as f64
}

/// The direction of the mean of unit vectors with these azimuths and weights, radians.
pub fn mean_azimuth(of: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (sin, cos) = of.fold((0.0, 0.0), |s, (azimuth, weight)| {
        (s.0 + weight * azimuth.sin(), s.1 + weight * azimuth.cos())
    });
    sin.atan2(cos)
}

fn arc(points: &[Point]) -> Option<Arc> {
    let distance_m = mean(points, |p| p.x_m);
    // Azimuths about the plume's own direction, so that an arc may cross north.
    let middle = mean_azimuth(points.iter().map(|p| (p.azimuth_rad, p.mg_m3)));
    let place = |p: &Point| {
        let across_m = distance_m * wrap_signed_rad(p.azimuth_rad - middle);
        (across_m, p.mg_m3)
    };
    let mut across: Vec<(f64, f64)> = points.iter().map(place).collect();
    across.sort_by(|a, b| a.0.total_cmp(&b.0));
    let max_mg_m3 = across.iter().map(|p| p.1).fold(0.0, f64::max);
    if max_mg_m3 <= 0.0 {
        return None;
    }
    let moment = |power: i32, about: f64| integral(&across, |y| (y - about).powi(power));
    let integrated_mg_m2 = moment(0, 0.0);
    let mean_m = moment(1, 0.0) / integrated_mg_m2;
    let width_m = (moment(2, mean_m) / integrated_mg_m2).max(0.0).sqrt();
    let ends = across[0].1.max(across[across.len() - 1].1);
    let inside = across.iter().filter(|p| p.1 > 0.1 * max_mg_m3).count();
    Some(Arc {
        distance_m,
        height_m: mean(points, |p| p.height_m),
        samplers: points.len(),
        bearing_deg: middle.to_degrees(),
        max_mg_m3,
        integrated_mg_m2,
        width_m,
        whole: integrated_mg_m2 > 0.0
            && width_m > 0.0
            && ends < CUT_OFF * max_mg_m3
            && inside >= LEAST_INSIDE,
    })
}

/// Integral over (place, value) of the value times a function of the place, by trapezoids.
fn integral(profile: &[(f64, f64)], factor: impl Fn(f64) -> f64) -> f64 {
    let at = |p: &(f64, f64)| p.1 * factor(p.0);
    let step = |w: &[(f64, f64)]| 0.5 * (at(&w[0]) + at(&w[1])) * (w[1].0 - w[0].0);
    profile.windows(2).map(step).sum()
}

/// Distance and σ_z, m, for the towers at each distance that show it.
fn tower_spreads(rows: &[&Receptor], factor: f64) -> Vec<(f64, f64)> {
    let points = points(rows, |_| factor);
    let rings = points.chunk_by(|a, b| b.x_m <= a.x_m * (1.0 + ARC_STEP));
    rings.filter_map(tower_spread).collect()
}

/// Mean distance and σ_z, m, of a plume from the ground at towers: the second moment of the profile summed over the
/// towers; the profile below the lowest sampler is that of the lowest. None where the plume reaches above the towers or
/// too few heights saw it.
fn tower_spread(points: &[Point]) -> Option<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    let levels = sorted.chunk_by(|a, b| b.height_m - a.height_m < 0.01);
    let level = |l: &[Point]| (l[0].height_m, mean(l, |p| p.mg_m3));
    let profile: Vec<(f64, f64)> = levels.map(level).collect();
    let (first, last) = (profile.first()?, profile.last()?);
    let highest = profile.iter().map(|p| p.1).fold(0.0, f64::max);
    let seen = profile.iter().filter(|p| p.1 > 0.0).count();
    if profile.len() < 5 || seen < 4 || last.1 > 0.05 * highest || first.1 < 0.3 * highest {
        return None;
    }
    let sum = first.1 * first.0 + integral(&profile, |_| 1.0);
    let square = first.1 * first.0.powi(3) / 3.0 + integral(&profile, |z| z * z);
    Some((mean(points, |p| p.x_m), (square / sum).sqrt()))
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

    fn fan(c: impl Fn(f64) -> f64) -> Vec<Point> {
        // Samplers every 2 degrees from 290 to 70 degrees, crossing north, at 100 m.
        (-35..=35)
            .map(|k| {
                let azimuth_rad = (2.0 * f64::from(k)).to_radians();
                Point {
                    x_m: 100.0,
                    azimuth_rad,
                    height_m: 1.5,
                    mg_m3: c(100.0 * azimuth_rad),
                }
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
        let spreads = tower_spreads(&rows.iter().collect::<Vec<_>>(), 1.0);
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
