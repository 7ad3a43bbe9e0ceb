//! What flows through a curtain of passes downwind: an emission by the balance of mass, without a model of
//! the plume (as in White et al. 1976 and, with unmanned aircraft, Nathan et al. 2015).
//!
//! A pass across the wind at one height carries ∫ (c − c₀) u⊥ dl through each metre of height, where u⊥ is the wind
//! across the track and c₀ the background ([`CleanAir`]): the straight line between the clean air at both ends of the pass,
//! or what is known of it from elsewhere. The height of a pass is that in which it crosses the plume: a vehicle may climb
//! on its way there. Passes of several
//! heights at about one distance are a curtain; integrated over height it is what the sources upwind
//! emit, if the wind holds. A sensor's lag moves a plume along a pass and takes nothing from the
//! integral.
//!
//! ```
//! use plume::curtain::{CleanAir, Site, Sample, curtain, passes};
//! # use plume::{Gas, Place};
//! # use air::{geo::Enu, isa::Atmosphere, wind::WindVector};
//! let site = Site {
//!     source: Enu::default(),
//!     ground_amsl_m: 340.0,
//!     gas: Gas::Co2,
//!     atmosphere: Atmosphere::standard(),
//! };
//! let wind = |_height_agl_m: f64| WindVector::from_speed_and_direction(8.0, 270.0);
//! let none: [Sample; 0] = [];
//! let clean = CleanAir::AtEnds { noise_sd_ppm: 3.0 };
//! let (passes, _) = passes(&none, &site, clean, &wind);
//! assert!(curtain(&passes).is_none());
//! ```

use crate::field::Place;
use crate::units::Gas;
use air::geo::{Enu, wrap_signed_deg};
use air::isa::Atmosphere;
use air::wind::WindVector;

/// A pass keeps within this of its height where it crosses the plume, m: as well as an aircraft holds it in turbulence.
const SAME_LEVEL_M: f64 = 15.0;
/// The height of a pass is its mean within so many standard deviations of the plume's bearing.
const AT_AXIS_SD: f64 = 1.0;
/// Samples farther apart than this belong to different passes, s.
pub const BETWEEN_PASSES_S: f64 = 10.0;
/// A track is across the wind while the sine of the angle between them is at least this: 45 degrees.
const ACROSS: f64 = 0.7;
/// Part of a pass at each end that is clean air.
const END_PART: f64 = 0.1;
/// Fewest samples at an end.
const LEAST_AT_END: usize = 3;
/// The ends of a pass may differ by this part of its highest excess: more, and one of them is in the plume.
const ENDS_DIFFER: f64 = 0.25;
/// Or by so many standard errors of the noise: 95 % of a normal distribution.
const ENDS_DIFFER_SD: f64 = 2.0;
/// A pass must cover the plume's bearing from the source and so many standard deviations to both sides: 95 %
/// of a normal distribution.
const COVERED_SD: f64 = 2.0;
/// Parts of passes with less than this part of the highest flow do not show where the plume lies: over a long way through
/// clean air, noise would.
const IN_PLUME: f64 = 0.05;
/// Passes of one curtain are at distances that differ by less than this factor: over it a plume's spread
/// grows by a quarter or less.
const SAME_DISTANCE: f64 = 1.25;
/// Fewest heights of a curtain: a middle and what is above and below.
const LEAST_LEVELS: usize = 3;
/// The highest and lowest level of a curtain carry at most this part of the most: a Gaussian plume carries 0.61 a standard
/// deviation off its axis, and a sixth of it lies beyond. Levels that are closer show scatter between passes and not the
/// plume's end: three within 40 m of a plume with σz of 75 m weighed a quarter of it.
const EDGE_PART: f64 = 0.65;
/// Scatter of passes through one place, as a part of them: plumes of power plants vary by a factor of two
/// from pass to pass.
pub const PASS_SCATTER: f64 = 0.5;
/// How many passes that counts for beforehand.
const BEFOREHAND_PASSES: f64 = 3.0;
/// Passes that follow each other after about eighty seconds meet the same eddies, whose time scale is one to two
/// minutes: with a correlation r of a third the variance is (1 + r) / (1 − r) times that of independent ones
/// (Bayley and Hammersley 1946).
const SAME_EDDIES: f64 = 2.0;
/// Of what lies beyond the lowest and highest pass as much is not known, one standard deviation.
const EDGE_SD: f64 = 0.5;

/// A reading on the way.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Index of the platform.
    pub platform: usize,
    /// Time, s; it grows from sample to sample of a platform.
    pub time_s: f64,
    /// Where.
    pub place: Place,
    /// Reading, ppm.
    pub ppm: f64,
}

/// Where the curtain hangs.
#[derive(Debug, Clone)]
pub struct Site {
    /// The first source.
    pub source: Enu,
    /// Ground, m above mean sea level.
    pub ground_amsl_m: f64,
    /// The gas that is read.
    pub gas: Gas,
    /// The air, by which ppm become kg/m³.
    pub atmosphere: Atmosphere,
}

/// What the background of passes is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CleanAir {
    /// Each pass begins and ends in clean air, where readings have this noise, ppm.
    AtEnds {
        /// One standard deviation.
        noise_sd_ppm: f64,
    },
    /// It is known, and subtracted from the samples already; passes may begin and end at the edge of the plume.
    Subtracted,
}

/// What flows through a curtain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurtainFlux {
    /// Emission of all sources upwind, kg/s.
    pub kg_s: f64,
    /// One standard deviation, from the scatter of passes and what lies beyond the lowest and highest; that of the wind is
    /// not in it.
    pub sd_kg_s: f64,
    /// Distance from the source, m.
    pub distance_m: f64,
    /// Number of heights.
    pub levels: usize,
    /// Number of passes.
    pub passes: usize,
}

/// A straight way across the wind at one height.
#[derive(Debug, Clone, PartialEq)]
pub struct Pass {
    /// Its first and last sample, s.
    pub time_s: [f64; 2],
    /// Mean height above ground where it crosses the plume's bearing, m.
    pub height_agl_m: f64,
    /// Mean distance from the source there, m.
    pub distance_m: f64,
    /// What flows through each metre of height, kg/(s m).
    pub kg_s_m: f64,
    /// Standard deviation of that if each reading has a noise of 1 ppm, kg/(s m ppm).
    pub noise_kg_s_m_ppm: f64,
    /// What 1 ppm of background that was not known would add, kg/(s m ppm).
    pub background_kg_s_m_ppm: f64,
    /// The integral of the excess over the way as a vector, east and north, kg/m².
    pub along_kg_m2: [f64; 2],
    /// Where the excess lies in the mean; none where nothing exceeds the background.
    pub centroid: Option<Enu>,
    parts: Vec<Part>,
}

/// The way from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    /// Bearing from the source, degrees.
    bearing_deg: f64,
    /// What flows through each metre of height there, kg/(s m).
    kg_s_m: f64,
    height_agl_m: f64,
    distance_m: f64,
}

/// Where the plume lies as seen from its source: what flows through all of some passes.
#[derive(Debug, Clone, Copy)]
struct Bearing {
    mean_deg: f64,
    sd_deg: f64,
}

/// A way across the wind that is no pass, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct RejectedPass {
    /// Its first and last sample, s.
    pub time_s: [f64; 2],
    /// Mean distance from the source, m.
    pub distance_m: f64,
    /// The condition that is not met.
    pub reason: &'static str,
}

/// A mass balance with the passes that it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Curtain {
    /// What flows through it.
    pub flux: CurtainFlux,
    /// Its passes, with the part of the flux that each stands for, kg/s.
    pub used: Vec<(Pass, f64)>,
    /// What lies above the highest pass and below the lowest by the triangles at the ends, kg/s.
    pub above_kg_s: f64,
    /// The same below the lowest.
    pub below_kg_s: f64,
}

/// A height of a curtain.
#[derive(Debug, Clone, Copy)]
struct Level {
    height_agl_m: f64,
    kg_s_m: f64,
    passes: f64,
    /// Squares of what its passes are off their mean.
    off_sq: f64,
}

/// All ways across the wind among `samples`, which stand platform by platform in order of time: passes, and what is none.
/// `wind` is that of a height above ground, m.
pub fn passes(
    samples: &[Sample],
    site: &Site,
    clean: CleanAir,
    wind: &dyn Fn(f64) -> WindVector,
) -> (Vec<Pass>, Vec<RejectedPass>) {
    let (mut passes, mut rejected) = (Vec::new(), Vec::new());
    for stretch in stretches(samples, wind) {
        match Pass::of(stretch, site, clean, wind) {
            Ok(pass) => passes.push(pass),
            Err(reason) if stretch.len() >= LEAST_AT_END => rejected.push(RejectedPass {
                time_s: [stretch[0].time_s, stretch[stretch.len() - 1].time_s],
                distance_m: stretch
                    .iter()
                    .map(|s| {
                        site.source
                            .distance_m(Enu::new(s.place.east_m, s.place.north_m))
                    })
                    .sum::<f64>()
                    / stretch.len() as f64,
                reason,
            }),
            Err(_) => {}
        }
    }
    let plume = Bearing::of(passes.iter());
    let mut level = Vec::with_capacity(passes.len());
    for mut pass in passes {
        if pass.is_level_across(plume) {
            pass.cross(plume);
            level.push(pass);
        } else {
            rejected.push(RejectedPass {
                time_s: pass.time_s,
                distance_m: pass.distance_m,
                reason: "it climbs or descends through the plume",
            });
        }
    }
    (level, rejected)
}

/// The curtain with the most heights among `passes`; none where none has the plume inside, or nothing flows through it.
pub fn curtain(passes: &[Pass]) -> Option<Curtain> {
    let curtains = passes.iter().map(|nearest| {
        let far_m = SAME_DISTANCE * nearest.distance_m;
        let within = |p: &&Pass| (nearest.distance_m..=far_m).contains(&p.distance_m);
        covering(passes.iter().filter(within).collect())
    });
    let with_levels = curtains.map(|passes| (levels(&passes), passes));
    let (levels, passes) = with_levels
        .filter(|(levels, _)| holds_the_plume(levels))
        .max_by_key(|(levels, passes)| (levels.len(), passes.len()))?;
    let distance_m = passes.iter().map(|p| p.distance_m).sum::<f64>() / passes.len() as f64;
    let whole = integral(&levels)?;
    let share = |pass: &Pass| {
        let off_m = |k: &usize| (levels[*k].height_agl_m - pass.height_agl_m).abs();
        let level = (0..levels.len()).min_by(|a, b| off_m(a).total_cmp(&off_m(b)));
        level.map_or(0.0, |k| whole.weights_m[k] * pass.kg_s_m / levels[k].passes)
    };
    Some(Curtain {
        flux: CurtainFlux {
            kg_s: whole.kg_s,
            sd_kg_s: whole.sd_kg_s,
            distance_m,
            levels: levels.len(),
            passes: passes.len(),
        },
        used: passes.iter().map(|p| ((*p).clone(), share(p))).collect(),
        above_kg_s: whole.above_kg_s,
        below_kg_s: whole.below_kg_s,
    })
}

/// Stretches across the wind, in one direction.
fn stretches<'a>(samples: &'a [Sample], wind: &dyn Fn(f64) -> WindVector) -> Vec<&'a [Sample]> {
    let side = |a: &Sample, b: &Sample| {
        let (east, north) = step_m(a, b);
        let there = wind(a.place.height_agl_m);
        let across = east * there.north_m_s - north * there.east_m_s;
        let sine = across / (east.hypot(north) * there.speed_m_s());
        if sine.abs() >= ACROSS {
            sine.signum()
        } else {
            0.0
        }
    };
    let mut out = Vec::new();
    let mut first = 0;
    for k in 1..=samples.len() {
        let goes_on = samples.get(k).is_some_and(|next| {
            let last = &samples[k - 1];
            let way = side(last, next);
            let turns = k > first + 1 && way != side(&samples[first], &samples[first + 1]);
            next.platform == last.platform
                && next.time_s - last.time_s <= BETWEEN_PASSES_S
                && way != 0.0
                && !turns
        });
        if !goes_on {
            out.push(&samples[first..k]);
            first = k;
        }
    }
    out
}

/// From one sample to the next, m east and north.
fn step_m(a: &Sample, b: &Sample) -> (f64, f64) {
    (
        b.place.east_m - a.place.east_m,
        b.place.north_m - a.place.north_m,
    )
}

impl Pass {
    /// The condition that is not met where its ends are not in clean air.
    fn of(
        samples: &[Sample],
        site: &Site,
        clean: CleanAir,
        wind: &dyn Fn(f64) -> WindVector,
    ) -> Result<Self, &'static str> {
        let at_end = ((END_PART * samples.len() as f64) as usize).max(LEAST_AT_END);
        if samples.len() < 4 * at_end {
            return Err("too few readings");
        }
        let excess = match clean {
            CleanAir::AtEnds { noise_sd_ppm } => above_ends(samples, at_end, noise_sd_ppm)?,
            CleanAir::Subtracted => samples.iter().map(|s| s.ppm).collect(),
        };
        let (mut along_kg_m2, mut parts) = ([0.0; 2], Vec::new());
        let (mut weight, mut centroid) = (0.0, [0.0; 2]);
        let mut weights_kg_s_m_ppm = vec![0.0; samples.len()];
        for k in 0..samples.len() - 1 {
            let (a, b) = (&samples[k], &samples[k + 1]);
            let (east, north) = step_m(a, b);
            let height_agl_m = f64::midpoint(a.place.height_agl_m, b.place.height_agl_m);
            let there = wind(height_agl_m);
            let across_m2_s = (east * there.north_m_s - north * there.east_m_s).abs();
            let air = site.atmosphere.at(site.ground_amsl_m + height_agl_m);
            let kg_m3_ppm = site.gas.kg_m3(1.0, air);
            let kg_m3 = kg_m3_ppm * f64::midpoint(excess[k], excess[k + 1]);
            let at = Enu::new(a.place.east_m + 0.5 * east, a.place.north_m + 0.5 * north);
            along_kg_m2[0] += kg_m3 * east;
            along_kg_m2[1] += kg_m3 * north;
            let positive = kg_m3.max(0.0) * east.hypot(north);
            weight += positive;
            centroid[0] += positive * at.east_m;
            centroid[1] += positive * at.north_m;
            parts.push(Part {
                bearing_deg: site.source.bearing_deg(at),
                kg_s_m: kg_m3 * across_m2_s,
                height_agl_m,
                distance_m: site.source.distance_m(at),
            });
            weights_kg_s_m_ppm[k] += 0.5 * kg_m3_ppm * across_m2_s;
            weights_kg_s_m_ppm[k + 1] += 0.5 * kg_m3_ppm * across_m2_s;
        }
        let of_all = weights_kg_s_m_ppm.iter().sum::<f64>();
        // Each reading by itself, and the line through the ends under all of them.
        let of_line = match clean {
            CleanAir::AtEnds { .. } => of_all.powi(2) / (2 * at_end) as f64,
            CleanAir::Subtracted => 0.0,
        };
        let of_readings: f64 = weights_kg_s_m_ppm.iter().map(|w| w * w).sum();
        let mut pass = Self {
            time_s: [samples[0].time_s, samples[samples.len() - 1].time_s],
            height_agl_m: 0.0,
            distance_m: 0.0,
            kg_s_m: parts.iter().map(|p| p.kg_s_m).sum(),
            noise_kg_s_m_ppm: (of_line + of_readings).sqrt(),
            background_kg_s_m_ppm: of_all,
            along_kg_m2,
            centroid: (weight > 0.0).then(|| Enu::new(centroid[0] / weight, centroid[1] / weight)),
            parts,
        };
        pass.is_at(|_| true);
        Ok(pass)
    }

    /// States height and distance as the means of those of its parts that are `there`; they stay where none is.
    fn is_at(&mut self, there: impl Fn(&Part) -> bool) {
        let those: Vec<&Part> = self.parts.iter().filter(|p| there(p)).collect();
        let mean =
            |of: fn(&Part) -> f64| those.iter().map(|p| of(p)).sum::<f64>() / those.len() as f64;
        if !those.is_empty() {
            (self.height_agl_m, self.distance_m) =
                (mean(|p| p.height_agl_m), mean(|p| p.distance_m));
        }
    }

    /// States height and distance where it crosses the plume's bearing.
    fn cross(&mut self, plume: Bearing) {
        self.is_at(|part| plume.off_deg(part).abs() <= AT_AXIS_SD * plume.sd_deg);
    }

    /// Whether it keeps its height across the plume.
    fn is_level_across(&self, plume: Bearing) -> bool {
        let within = COVERED_SD * plume.sd_deg;
        let across = self
            .parts
            .iter()
            .filter(|p| plume.off_deg(p).abs() <= within);
        // Minus infinity where it does not come to the plume.
        let (low, high) = range(across.map(|p| p.height_agl_m));
        high - low <= 2.0 * SAME_LEVEL_M
    }

    /// Whether it crosses all bearings within so many degrees of one.
    pub fn covers(&self, bearing_deg: f64, within_deg: f64) -> bool {
        let off = |p: &Part| wrap_signed_deg(p.bearing_deg - bearing_deg);
        // On the other side of the source nothing is crossed.
        let ahead = self.parts.iter().map(off).filter(|off| off.abs() < 90.0);
        let (low, high) = range(ahead);
        low <= -within_deg && high >= within_deg
    }
}

/// The least and the most of values.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

/// The excess over the line through the middles of the ends of a pass, each of `at_end` samples, ppm; the condition that is
/// not met where an end is not in clean air.
fn above_ends(
    samples: &[Sample],
    at_end: usize,
    noise_sd_ppm: f64,
) -> Result<Vec<f64>, &'static str> {
    let before = mean(&samples[..at_end]);
    let after = mean(&samples[samples.len() - at_end..]);
    let slope = (after - before) / (samples.len() - at_end) as f64;
    let middle = 0.5 * (at_end - 1) as f64;
    let excess_of = |k: usize| samples[k].ppm - before - slope * (k as f64 - middle);
    let excess: Vec<f64> = (0..samples.len()).map(excess_of).collect();
    let most = excess.iter().copied().fold(0.0, f64::max);
    let by_noise = ENDS_DIFFER_SD * noise_sd_ppm * (2.0 / at_end as f64).sqrt();
    if (after - before).abs() > by_noise.max(ENDS_DIFFER * most) {
        return Err("one end lies in the plume");
    }
    Ok(excess)
}

fn mean(samples: &[Sample]) -> f64 {
    samples.iter().map(|s| s.ppm).sum::<f64>() / samples.len() as f64
}

impl Bearing {
    fn of<'a>(passes: impl Iterator<Item = &'a Pass>) -> Self {
        let parts: Vec<&Part> = passes.flat_map(|p| &p.parts).collect();
        let (highest_deg, most) = parts
            .iter()
            .max_by(|a, b| a.kg_s_m.total_cmp(&b.kg_s_m))
            .map_or((0.0, 0.0), |p| (p.bearing_deg, p.kg_s_m.max(0.0)));
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        for part in parts.iter().filter(|p| p.kg_s_m > IN_PLUME * most) {
            let off = wrap_signed_deg(part.bearing_deg - highest_deg);
            sum += part.kg_s_m;
            first += part.kg_s_m * off;
            second += part.kg_s_m * off * off;
        }
        let off = first / sum;
        Self {
            mean_deg: highest_deg + off,
            sd_deg: (second / sum - off * off).max(0.0).sqrt(),
        }
    }

    /// How far a part lies off, degrees.
    fn off_deg(self, part: &Part) -> f64 {
        wrap_signed_deg(part.bearing_deg - self.mean_deg)
    }
}

/// Those of passes that cross the whole plume: where it lies is what flows through all of them.
pub fn covering(passes: Vec<&Pass>) -> Vec<&Pass> {
    let plume = Bearing::of(passes.iter().copied());
    let covers = |p: &&Pass| p.covers(plume.mean_deg, COVERED_SD * plume.sd_deg);
    passes.iter().copied().filter(covers).collect()
}

/// Passes of one height together, the lowest first: those less than [`SAME_LEVEL_M`] above the lowest of them.
fn levels(passes: &[&Pass]) -> Vec<Level> {
    let mut sorted = passes.to_vec();
    sorted.sort_by(|a, b| a.height_agl_m.total_cmp(&b.height_agl_m));
    let of = |same: &[&Pass]| {
        let n = same.len() as f64;
        let mean = |of: fn(&Pass) -> f64| same.iter().map(|p| of(p)).sum::<f64>() / n;
        let kg_s_m = mean(|p| p.kg_s_m);
        Level {
            height_agl_m: mean(|p| p.height_agl_m),
            kg_s_m,
            passes: n,
            off_sq: same.iter().map(|p| (p.kg_s_m - kg_s_m).powi(2)).sum(),
        }
    };
    let mut rest = sorted.as_slice();
    let mut levels = Vec::new();
    while let Some(lowest) = rest.first() {
        let top_m = lowest.height_agl_m + SAME_LEVEL_M;
        let (same, higher) = rest.split_at(rest.partition_point(|p| p.height_agl_m < top_m));
        levels.push(of(same));
        rest = higher;
    }
    levels
}

/// Whether the highest and the lowest level carry much less than the one between that carries the most: else more may flow
/// beyond the curtain than through it. Below a plume that lies on the ground there is nothing.
fn holds_the_plume(levels: &[Level]) -> bool {
    if levels.len() < LEAST_LEVELS {
        return false;
    }
    let most = levels.iter().map(|l| l.kg_s_m).fold(0.0, f64::max);
    let ends = |k: usize| levels[k].kg_s_m <= EDGE_PART * most;
    let on_ground = levels[0].height_agl_m <= levels[1].height_agl_m - levels[0].height_agl_m;
    ends(levels.len() - 1) && (on_ground || ends(0))
}

/// The integral over height.
struct Integral {
    kg_s: f64,
    sd_kg_s: f64,
    /// The height for which each level stands, m.
    weights_m: Vec<f64>,
    above_kg_s: f64,
    below_kg_s: f64,
}

/// The integral over height by trapezoids, down to nothing over one more spacing at both ends, or to the ground;
/// with its standard deviation. None where nothing flows.
fn integral(levels: &[Level]) -> Option<Integral> {
    let last = levels.len() - 1;
    let gap_m = |k: usize| levels[k + 1].height_agl_m - levels[k].height_agl_m;
    // Half the spacing to both sides; beyond the ends a triangle, and what the ground cuts off it is reflected.
    let above_ground_m = levels[0].height_agl_m.max(0.0);
    let (below_m, above_m) = ((0.5 * gap_m(0)).min(above_ground_m), 0.5 * gap_m(last - 1));
    let weight_m = |k: usize| match k {
        0 => 0.5 * gap_m(0) + below_m,
        k if k == last => 0.5 * gap_m(last - 1) + above_m,
        k => 0.5 * (gap_m(k - 1) + gap_m(k)),
    };
    let kg_s: f64 = (0..=last).map(|k| weight_m(k) * levels[k].kg_s_m).sum();
    if kg_s <= 0.0 {
        return None;
    }
    let seen: f64 = levels.iter().map(|l| l.off_sq).sum();
    let of_mean: f64 = levels
        .iter()
        .map(|l| (l.passes - 1.0) * l.kg_s_m.powi(2))
        .sum();
    let freedom: f64 = levels.iter().map(|l| l.passes - 1.0).sum();
    let relative_sq = if of_mean > 0.0 {
        freedom * seen / of_mean
    } else {
        0.0
    };
    let scatter_sq =
        (relative_sq + BEFOREHAND_PASSES * PASS_SCATTER.powi(2)) / (freedom + BEFOREHAND_PASSES);
    let own = |k: usize| (weight_m(k) * levels[k].kg_s_m).powi(2) * scatter_sq / levels[k].passes;
    let edge = |k: usize, edge_m: f64| (EDGE_SD * edge_m * levels[k].kg_s_m).powi(2);
    let variance =
        SAME_EDDIES * (0..=last).map(own).sum::<f64>() + edge(0, below_m) + edge(last, above_m);
    Some(Integral {
        kg_s,
        sd_kg_s: variance.sqrt(),
        weights_m: (0..=last).map(weight_m).collect(),
        above_kg_s: above_m * levels[last].kg_s_m,
        below_kg_s: below_m * levels[0].kg_s_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const Q_KG_S: f64 = 500.0;
    const SIGMA_Y_M: f64 = 90.0;
    const SIGMA_Z_M: f64 = 50.0;
    const AXIS_AGL_M: f64 = 500.0;
    const WIND_M_S: f64 = 8.0;
    const AT_ENDS: CleanAir = CleanAir::AtEnds { noise_sd_ppm: 0.0 };

    fn site() -> Site {
        Site {
            source: Enu::default(),
            ground_amsl_m: 340.0,
            gas: Gas::Co2,
            atmosphere: Atmosphere::standard(),
        }
    }

    fn wind(_height_agl_m: f64) -> WindVector {
        WindVector::from_speed_and_direction(WIND_M_S, 270.0)
    }

    fn weighed(
        samples: &[Sample],
        clean: CleanAir,
        wind: &dyn Fn(f64) -> WindVector,
    ) -> Option<CurtainFlux> {
        Some(curtain(&passes(samples, &site(), clean, wind).0)?.flux)
    }

    /// Passes at 1100 m east of a source, 20 m apart, in a Gaussian plume whose flux is Q by its formula
    /// c = Q / (2π u σy σz) exp(−y²/2σy² − z²/2σz²), far above the ground.
    fn flown(heights_agl_m: &[f64], strength: impl Fn(usize) -> f64) -> Vec<Sample> {
        let mut samples = Vec::new();
        for (pass, height_agl_m) in heights_agl_m.iter().enumerate() {
            let air = site().atmosphere.at(340.0 + height_agl_m);
            for k in 0..=40 {
                let north_m = -400.0 + 20.0 * f64::from(k);
                let off = (north_m / SIGMA_Y_M).powi(2)
                    + ((height_agl_m - AXIS_AGL_M) / SIGMA_Z_M).powi(2);
                let kg_m3 = Q_KG_S / (std::f64::consts::TAU * WIND_M_S * SIGMA_Y_M * SIGMA_Z_M)
                    * (-0.5 * off).exp();
                samples.push(Sample {
                    platform: 0,
                    time_s: 100.0 * pass as f64 + f64::from(k),
                    place: Place {
                        east_m: 1100.0,
                        north_m: if pass % 2 == 0 { north_m } else { -north_m },
                        height_agl_m: *height_agl_m,
                    },
                    ppm: 420.0 + 0.05 * f64::from(k) + strength(pass) * Gas::Co2.ppm(kg_m3, air),
                });
            }
        }
        samples
    }

    const STEPS: [f64; 5] = [400.0, 450.0, 500.0, 550.0, 600.0];

    /// Trapezoids a standard deviation apart over a Gaussian are right to a hundredth
    /// (`50*sum(exp(-.5*k*k) for k in range(-2,3))/sqrt(2*pi)/50` = .991, and the triangles add .054/2 at both ends).
    #[test]
    fn what_was_emitted_flows_through_the_curtain() {
        let samples = flown(&STEPS, |_| 1.0);
        let found = weighed(&samples, AT_ENDS, &wind).unwrap();
        assert!((found.kg_s / Q_KG_S - 1.0).abs() < 0.02, "{found:?}");
        assert_eq!((found.levels, found.passes), (5, 5));
        assert!((found.distance_m - 1100.0).abs() < 60.0);
        assert!(
            (0.1..0.4).contains(&(found.sd_kg_s / found.kg_s)),
            "{found:?}"
        );
    }

    /// The samples within 220 m of the axis of passes that turn there lack 1 % of the plume; the line through their ends,
    /// three samples each, takes a sixth more (NumPy, by trapezoids: .976 and .802 of the whole).
    #[test]
    fn passes_that_turn_at_the_edge_of_the_plume_need_the_background() {
        let mut samples = flown(&STEPS, |_| 1.0);
        samples.retain(|s| s.place.north_m.abs() <= 220.0);
        let by_ends = weighed(&samples, AT_ENDS, &wind).unwrap();
        assert!((by_ends.kg_s / Q_KG_S - 0.802).abs() < 0.01, "{by_ends:?}");
        for s in &mut samples {
            s.ppm -= 420.0 + 0.05 * (s.time_s % 100.0);
        }
        let known = weighed(&samples, CleanAir::Subtracted, &wind).unwrap();
        assert!((known.kg_s / Q_KG_S - 0.976).abs() < 0.01, "{known:?}");
        // A background that is 1 ppm lower adds 1 ppm over 440 m in the wind of 8 m/s.
        let (flown, _) = passes(&samples, &site(), CleanAir::Subtracted, &wind);
        for pass in flown {
            let air = site().atmosphere.at(340.0 + pass.height_agl_m);
            let per_ppm = Gas::Co2.kg_m3(1.0, air) * 440.0 * WIND_M_S;
            assert!((pass.background_kg_s_m_ppm / per_ppm - 1.0).abs() < 1e-3);
        }
    }

    /// A vehicle that reaches its height before the plume, and leaves it behind the plume, has crossed the plume level; one
    /// that climbs by more than 30 m within two standard deviations has not. The balance of the level part is that of
    /// [`what_was_emitted_flows_through_the_curtain`].
    #[test]
    fn a_pass_is_level_where_it_crosses_the_plume() {
        let climbing = |beyond_m: f64| {
            let mut samples = flown(&STEPS, |_| 1.0);
            for s in &mut samples {
                let beyond = (s.place.north_m.abs() - beyond_m).max(0.0);
                s.place.height_agl_m += 0.4 * beyond * s.place.north_m.signum();
            }
            samples
        };
        let found = weighed(&climbing(200.0), AT_ENDS, &wind).unwrap();
        assert!((found.kg_s / Q_KG_S - 1.0).abs() < 0.02, "{found:?}");
        assert_eq!(found.levels, 5);
        let (_, rejected) = passes(&climbing(20.0), &site(), AT_ENDS, &wind);
        assert_eq!(rejected.len(), 5);
        assert!(rejected[0].reason.contains("climbs"));
    }

    /// Heights closer than those of one level are still several levels, as passes are that follow an axis whose estimate
    /// moves; ten pairs and a single one hold .988 of the whole (NumPy, by trapezoids).
    #[test]
    fn passes_at_many_heights_are_not_one_level() {
        let heights: Vec<f64> = (0..21).map(|k| 380.0 + 12.0 * f64::from(k)).collect();
        let found = weighed(&flown(&heights, |_| 1.0), AT_ENDS, &wind).unwrap();
        assert!((found.kg_s / Q_KG_S - 0.988).abs() < 0.01, "{found:?}");
        assert_eq!((found.levels, found.passes), (11, 21));
    }

    #[test]
    fn all_scales_with_the_wind_and_the_readings() {
        let twice = |height: f64| {
            let w = wind(height);
            WindVector::from_speed_and_direction(2.0 * w.speed_m_s(), 270.0)
        };
        let of = |strength: f64, wind: &dyn Fn(f64) -> WindVector| {
            weighed(&flown(&STEPS, |_| strength), AT_ENDS, wind).unwrap()
        };
        let (one, faster, stronger) = (of(1.0, &wind), of(1.0, &twice), of(3.0, &wind));
        assert!((faster.kg_s / one.kg_s - 2.0).abs() < 1e-9);
        assert!((stronger.kg_s / one.kg_s - 3.0).abs() < 1e-6);
        assert!((stronger.sd_kg_s / one.sd_kg_s - 3.0).abs() < 1e-6);
    }

    #[test]
    fn a_curtain_has_three_heights_and_whole_passes() {
        let two = flown(&STEPS[1..3], |_| 1.0);
        assert_eq!(weighed(&two, AT_ENDS, &wind), None);
        // Half of each pass: one end is in the plume.
        let half: Vec<Sample> = flown(&STEPS, |_| 1.0)
            .into_iter()
            .filter(|s| s.place.north_m < 50.0)
            .collect();
        assert_eq!(weighed(&half, AT_ENDS, &wind), None);
        // Along the wind nothing is crossed.
        let along = |_: f64| WindVector::from_speed_and_direction(WIND_M_S, 0.0);
        assert_eq!(weighed(&flown(&STEPS, |_| 1.0), AT_ENDS, &along), None);
    }

    /// Beyond a height that carries the most the plume may go on: 12 kg/s were weighed for 528 so.
    #[test]
    fn a_curtain_with_the_plume_at_its_edge_weighs_nothing_but_one_on_the_ground_does() {
        let of = |heights: &[f64]| weighed(&flown(heights, |_| 1.0), AT_ENDS, &wind);
        assert!(of(&STEPS[1..4]).is_some());
        assert_eq!(of(&STEPS[2..]), None);
        assert_eq!(of(&STEPS[..3]), None);
        // The same with the plume's axis on the ground.
        let grounded = |samples: Vec<Sample>| -> Vec<Sample> {
            let down = |s: Sample| Sample {
                place: Place {
                    height_agl_m: s.place.height_agl_m - AXIS_AGL_M,
                    ..s.place
                },
                ..s
            };
            samples.into_iter().map(down).collect()
        };
        let low = grounded(flown(&STEPS[2..], |_| 1.0));
        assert!(weighed(&low, AT_ENDS, &wind).is_some());
    }

    /// Passes that agree make it surer, passes that do not less sure.
    #[test]
    fn the_scatter_of_passes_is_in_the_standard_deviation() {
        let twice: Vec<f64> = STEPS.iter().chain(&STEPS).copied().collect();
        let of = |strength: fn(usize) -> f64| {
            let found = weighed(&flown(&twice, strength), AT_ENDS, &wind).unwrap();
            found.sd_kg_s / found.kg_s
        };
        let alike = of(|_| 1.0);
        let unlike = of(|pass| if pass < 5 { 0.3 } else { 1.7 });
        assert!(alike < 0.3 && unlike > 1.5 * alike, "{alike} {unlike}");
    }
}
