//! How visible a hidden effect is by the noise that made the readings: D, in nats, and the strength
//! that makes it as visible as wanted.
//!
//! D is half the sum of squares of the whitened difference between what sensors read on average with
//! the effect and the best that a model without it can make of that: by what the scenario is unsure
//! of, with its priors; by each platform's own zero, gain and clock; and by a wind that is known as
//! well as its log allows (a Gaussian process of time, tied to the log). It is what somebody gains on
//! average who knows the truth and its noise. Of several effects each is judged beside the others,
//! whose strengths are free. The noise (`whitening`) is the generator's but for its outliers.

use std::cell::RefCell;

use crate::case::{Air, CaseBuilder, CaseSpec, HiddenEffect, Laws};
use crate::instrument::{
    Faults, LOG_SPEED_NOISE, LOG_TURBULENCE, LogRow, MeanLog, OWN_CLOCK_S, OWN_LOG_GAIN,
    OWN_OFFSET_PPM, Platform, wind_instrument,
};
use crate::linear;
use crate::physics::{Forward, Physics};
use crate::scene::LoggedWind;
use crate::whitening::{InputErrors, Whitener};

/// Spacing of the knots between which the wind's error is straight, s, where it acts at once: half of
/// how long the shortest gusts last; and where it acts by its mean over the way, which is long.
const KNOT_AT_ONCE_S: f64 = 10.0;
const KNOT_ON_THE_WAY_S: f64 = 25.0;
/// Steps for derivatives: direction, degrees, and height, m: far below a plume's width.
const STEP_DEG: f64 = 0.2;
const STEP_M: f64 = 1.0;
/// Step of a clock, s: far below the time that it takes to fly through a plume.
const STEP_S: f64 = 0.1;
/// Step of the logarithm of another effect's strength.
const STEP_LOG_STRENGTH: f64 = 0.05;
/// How often the base is fitted again where it came to; its derivatives stay.
const CHORDS: usize = 2;

/// What a scene is like without and with effects of any strength.
struct Worth<'a> {
    builder: CaseBuilder<'a>,
    control: Vec<Vec<LogRow>>,
    /// Air that was asked for before: sensors change none, and several effects share much.
    known: RefCell<Vec<KnownAir>>,
}

/// The air of a world, seen from so far from where platforms flew.
struct KnownAir {
    physics: Physics,
    seen_off_m: Vec<[f64; 3]>,
    airs: Vec<Air>,
}

/// Sub-steps from one whose air is computed to the next: what is straight between them, some metres,
/// is nearly the same with and without an effect.
const STRIDE: usize = 2;
/// How many airs are kept.
const KEPT: usize = 40;

/// A value for each row, by platform.
type Column = Vec<Vec<f64>>;
/// A square matrix, by rows.
type Matrix = Vec<Vec<f64>>;

/// One unknown of the base: what a unit of it adds to each row, by platform, and one over the square
/// of its prior standard deviation. Unknowns of the wind have a joint prior instead.
struct Unknown {
    column: Column,
    prior_weight: f64,
}

/// What the base's places in the world are moved by.
#[derive(Debug, Clone, Copy, Default)]
struct Moved {
    direction_deg: f64,
    axis_m: f64,
    log_emission: f64,
    background_ppm: f64,
}

impl Moved {
    fn of(self, physics: &Physics) -> Physics {
        Physics {
            direction_offset_deg: physics.direction_offset_deg + self.direction_deg,
            axis_offset_m: physics.axis_offset_m + self.axis_m,
            log_emission: physics.log_emission + self.log_emission,
            background_ppm: physics.background_ppm + self.background_ppm,
            ..physics.clone()
        }
    }
}

/// D of each effect of `spec` beside the others, nats.
pub fn nats(spec: &CaseSpec) -> Vec<f64> {
    let worth = Worth::new(spec);
    let strengths: Vec<f64> = spec.hidden.iter().map(|h| h.strength).collect();
    (0..strengths.len())
        .map(|which| worth.nats(&strengths, which, CHORDS))
        .collect()
}

impl<'a> Worth<'a> {
    fn new(spec: &'a CaseSpec) -> Self {
        let builder = CaseBuilder::new(spec);
        let control = builder.rows(&Physics::default(), &builder.no_faults());
        Self {
            builder,
            control,
            known: RefCell::new(Vec::new()),
        }
    }

    /// What each platform would read without noise; the air is that of places `seen_off_m` from
    /// those flown.
    fn mean_logs(
        &self,
        physics: &Physics,
        faults: &[Faults],
        seen_off_m: &[[f64; 3]],
    ) -> Vec<MeanLog> {
        let mut known = self.known.borrow_mut();
        let same = |k: &KnownAir| k.physics == *physics && k.seen_off_m == seen_off_m;
        if let Some(found) = known.iter().find(|k| same(k)) {
            return self.builder.mean_logs(&found.airs, faults);
        }
        let airs = self.builder.airs(physics, seen_off_m, STRIDE);
        let logs = self.builder.mean_logs(&airs, faults);
        if known.len() == KEPT {
            known.remove(0);
        }
        known.push(KnownAir {
            physics: physics.clone(),
            seen_off_m: seen_off_m.to_vec(),
            airs,
        });
        logs
    }

    fn laws(&self, strengths: &[f64]) -> Laws {
        let hidden: Vec<HiddenEffect> = self
            .builder
            .spec
            .hidden
            .iter()
            .zip(strengths)
            .map(|(h, &strength)| HiddenEffect { strength, ..*h })
            .collect();
        self.builder.hide_each(&hidden, &self.control)
    }

    /// D of the effect `which` beside the others, nats.
    fn nats(&self, strengths: &[f64], which: usize, chords: usize) -> f64 {
        let (physics, faults, _) = self.laws(strengths);
        let true_logs = self.mean_logs(&physics, &faults, &self.unmoved());
        let mut others = strengths.to_vec();
        others[which] = 0.0;
        let base = Base::new(self, &others, &faults);
        base.misfit(&true_logs, &faults, chords)
    }

    /// The same of many strengths of it: the base is the same unless the log of places is false.
    fn nats_by_strength(&self, strengths: &[f64], which: usize) -> impl FnMut(f64, usize) -> f64 {
        let mut others = strengths.to_vec();
        others[which] = 0.0;
        let mut kept: Option<Base<'_, '_>> = None;
        move |strength, chords| {
            let mut all = others.clone();
            all[which] = strength;
            let (physics, faults, _) = self.laws(&all);
            let true_logs = self.mean_logs(&physics, &faults, &self.unmoved());
            let base = match kept.take() {
                Some(base) if base.is_seen_from(&faults) => base,
                _ => Base::new(self, &others, &faults),
            };
            kept.insert(base).misfit(&true_logs, &faults, chords)
        }
    }

    fn unmoved(&self) -> Vec<[f64; 3]> {
        vec![[0.0; 3]; self.builder.scene.tracks.len()]
    }
}

/// The base: the scene with the other effects, seen from where the log says that platforms were.
struct Base<'w, 'a> {
    worth: &'w Worth<'a>,
    physics: Physics,
    faults: Vec<Faults>,
    seen_off_m: Vec<[f64; 3]>,
    logs: Vec<MeanLog>,
    /// Unknowns of the scene: which of [`Moved`], with their columns.
    places: Vec<(Moved, Unknown)>,
    /// Further unknowns, linear ones.
    others: Vec<Unknown>,
    /// Columns of the wind's knots, and their joint prior.
    wind: Vec<(Vec<Column>, Matrix)>,
    /// What errors of its inputs do to each platform's readings.
    errors: Vec<InputErrors>,
}

/// A false log of places that is no part of the base is taken for true by it.
fn seen_off_m(true_faults: &[Faults], own: &[Faults]) -> Vec<[f64; 3]> {
    let off = |(t, own): (&Faults, &Faults)| [0, 1, 2].map(|k| t.place_m[k] - own.place_m[k]);
    true_faults.iter().zip(own).map(off).collect()
}

fn readings(logs: &[MeanLog]) -> Column {
    let of = |l: &MeanLog| l.rows.iter().map(|r| r.mean_ppm).collect();
    logs.iter().map(of).collect()
}

fn excess(logs: &[MeanLog]) -> Column {
    let of = |l: &MeanLog| l.rows.iter().map(|r| r.mean_excess_ppm).collect();
    logs.iter().map(of).collect()
}

/// (a − b) / step, row by row.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>], step: f64) -> Column {
    let less =
        |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| (a - b) / step).collect();
    a.iter().zip(b).map(less).collect()
}

impl<'w, 'a> Base<'w, 'a> {
    fn new(worth: &'w Worth<'a>, strengths: &[f64], true_faults: &[Faults]) -> Self {
        let (physics, faults, _) = worth.laws(strengths);
        let seen_off_m = seen_off_m(true_faults, &faults);
        let logs = worth.mean_logs(&physics, &faults, &seen_off_m);
        let mut base = Self {
            worth,
            physics,
            faults,
            seen_off_m,
            logs,
            places: Vec::new(),
            others: Vec::new(),
            wind: Vec::new(),
            errors: Vec::new(),
        };
        let by_direction = base.derivative(Moved {
            direction_deg: STEP_DEG,
            ..Moved::default()
        });
        let by_direction = difference(&by_direction, &readings(&base.logs), STEP_DEG);
        base.add_places(&by_direction);
        base.add_instruments();
        base.add_strengths(strengths);
        base.errors = base.input_errors(&by_direction);
        base.add_wind(by_direction);
        base
    }

    fn input_errors(&self, by_direction: &[Vec<f64>]) -> Vec<InputErrors> {
        let own = readings(&self.logs);
        let mut by_place: Vec<Column> = (0..3)
            .map(|axis| {
                let mut off = self.seen_off_m.clone();
                off.iter_mut().for_each(|o| o[axis] += STEP_M);
                let there = self.worth.mean_logs(&self.physics, &self.faults, &off);
                difference(&readings(&there), &own, STEP_M)
            })
            .collect();
        (0..own.len())
            .map(|p| InputErrors {
                by_place: [0, 1, 2].map(|axis| std::mem::take(&mut by_place[axis][p])),
                by_direction: by_direction[p].clone(),
                swing_deg: self.swing_between_knots(),
            })
            .collect()
    }

    /// What a swing of the wind's direction does between two knots: standard deviation, degrees, and
    /// correlation time, s. A process of standard deviation s and time T that is known at both ends
    /// of a short stretch h has the mean variance s² h / 3 T in it (a Brownian bridge).
    fn swing_between_knots(&self) -> (f64, f64) {
        let builder = &self.worth.builder;
        let knot_s = self.knot_s();
        if builder.forward != Forward::Gaussian {
            return (0.0, knot_s / 3.0);
        }
        let law = builder.scene.wind;
        let of = |(sd, lasts_s): (f64, f64)| sd.powi(2) * knot_s / (3.0 * lasts_s);
        let variance = of(law.slow_meander) + of(law.direction_gust);
        (variance.sqrt(), knot_s / 3.0)
    }

    fn knot_s(&self) -> f64 {
        match self.worth.builder.forward {
            Forward::Gaussian => KNOT_AT_ONCE_S,
            Forward::Puffs | Forward::AgedPuffs => KNOT_ON_THE_WAY_S,
        }
    }

    /// Whether platforms whose faults are `true_faults` are where it takes them to be.
    fn is_seen_from(&self, true_faults: &[Faults]) -> bool {
        let off = seen_off_m(true_faults, &self.faults);
        off == self.seen_off_m
    }

    fn at(&self, moved: Moved) -> Vec<MeanLog> {
        let physics = moved.of(&self.physics);
        self.worth
            .mean_logs(&physics, &self.faults, &self.seen_off_m)
    }

    fn derivative(&self, moved: Moved) -> Column {
        readings(&self.at(moved))
    }

    /// What the scenario is unsure of.
    fn add_places(&mut self, by_direction: &[Vec<f64>]) {
        let scene = &self.worth.builder.scene;
        let own = readings(&self.logs);
        let unit = Moved::default();
        let mut places = Vec::new();
        for uncertain in &scene.uncertain {
            let (moved, column, sd) = match uncertain.key {
                "weather.wind_from_deg" => {
                    let moved = Moved {
                        direction_deg: 1.0,
                        ..unit
                    };
                    (moved, by_direction.to_vec(), uncertain.sd)
                }
                "source.effective_height_m" => {
                    let moved = Moved {
                        axis_m: 1.0,
                        ..unit
                    };
                    let there = self.derivative(Moved {
                        axis_m: STEP_M,
                        ..unit
                    });
                    (moved, difference(&there, &own, STEP_M), uncertain.sd)
                }
                "background.co2_ppm" => {
                    let moved = Moved {
                        background_ppm: 1.0,
                        ..unit
                    };
                    (moved, self.everywhere(1.0), uncertain.sd)
                }
                key => {
                    let moved = Moved {
                        log_emission: 1.0,
                        ..unit
                    };
                    let stated = match key {
                        "source.c_max_ppm" => scene.c_max_ppm(),
                        _ => scene.emission_kg_s,
                    };
                    (moved, excess(&self.logs), uncertain.sd / stated)
                }
            };
            let prior_weight = sd.powi(-2);
            places.push((
                moved,
                Unknown {
                    column,
                    prior_weight,
                },
            ));
        }
        self.places = places;
    }

    fn everywhere(&self, value: f64) -> Column {
        self.logs
            .iter()
            .map(|l| vec![value; l.rows.len()])
            .collect()
    }

    /// Each platform's own zero, gain and clock.
    fn add_instruments(&mut self) {
        let excess = excess(&self.logs);
        let mut late = self.faults.clone();
        late.iter_mut().for_each(|f| f.clock_s += STEP_S);
        let later = readings(&self.worth.mean_logs(&self.physics, &late, &self.seen_off_m));
        let by_clock = difference(&later, &readings(&self.logs), STEP_S);
        let none = self.everywhere(0.0);
        for index in 0..self.logs.len() {
            let mut zero = none.clone();
            zero[index].fill(1.0);
            let mut gain = none.clone();
            gain[index].clone_from(&excess[index]);
            let mut clock = none.clone();
            clock[index].clone_from(&by_clock[index]);
            for (column, sd) in [
                (zero, OWN_OFFSET_PPM),
                (gain, OWN_LOG_GAIN),
                (clock, OWN_CLOCK_S),
            ] {
                self.others.push(Unknown {
                    column,
                    prior_weight: sd.powi(-2),
                });
            }
        }
    }

    /// Strengths of the other effects.
    fn add_strengths(&mut self, strengths: &[f64]) {
        let own = readings(&self.logs);
        for (k, strength) in strengths.iter().enumerate().filter(|s| *s.1 > 0.0) {
            let mut stronger = strengths.to_vec();
            stronger[k] = strength * STEP_LOG_STRENGTH.exp();
            let (physics, faults, _) = self.worth.laws(&stronger);
            // A place that is more wrong is seen from farther away.
            let off = |k: usize| {
                [0, 1, 2].map(|i| {
                    self.seen_off_m[k][i] - (faults[k].place_m[i] - self.faults[k].place_m[i])
                })
            };
            let seen_off_m: Vec<[f64; 3]> = (0..faults.len()).map(off).collect();
            let there = readings(&self.worth.mean_logs(&physics, &faults, &seen_off_m));
            self.others.push(Unknown {
                column: difference(&there, &own, STEP_LOG_STRENGTH),
                prior_weight: 0.0,
            });
        }
    }

    /// The errors of the wind's direction and speed, straight between knots.
    fn add_wind(&mut self, by_direction: Column) {
        let slower = excess(&self.logs)
            .into_iter()
            .map(|rows| rows.into_iter().map(|e| -e).collect())
            .collect();
        let scene = &self.worth.builder.scene;
        let law = scene.wind;
        let direction = [law.slow_meander, law.direction_gust];
        let log = self.log_information(|white_deg| (LOG_TURBULENCE.0, white_deg));
        let speed_log = self.log_information(|_| (LOG_TURBULENCE.1, LOG_SPEED_NOISE));
        let parts = [
            (by_direction, &direction[..], log),
            (slower, &[law.speed_gust][..], speed_log),
        ];
        let mut wind = Vec::new();
        for (by_unit, processes, information) in parts {
            if let Some(prior) = self.knots_prior(processes, information) {
                wind.push((self.knots_columns(&by_unit), prior));
            }
        }
        self.wind = wind;
    }

    /// Start of the wind's knots, s, and their number.
    fn knots(&self) -> (f64, usize) {
        let scene = &self.worth.builder.scene;
        let (from_s, until_s) = (-self.longest_way_s(), scene.duration_s);
        (
            from_s,
            ((until_s - from_s) / self.knot_s()).ceil() as usize + 1,
        )
    }

    /// The knot before `time_s`, and how far the time is on the way to the next.
    fn knot(&self, time_s: f64) -> (usize, f64) {
        let (from_s, count) = self.knots();
        let place = ((time_s - from_s) / self.knot_s()).clamp(0.0, count as f64 - 1.000_001);
        (place as usize, place.fract())
    }

    /// Longest time that what is read has been under way, s.
    fn longest_way_s(&self) -> f64 {
        let scene = &self.worth.builder.scene;
        match self.worth.builder.forward {
            Forward::Gaussian => 0.0,
            _ => 1.3 * scene.reach.distance_m.1 / scene.wind.speed_m_s,
        }
    }

    /// What a second of all logs tells of the wind: one over the variance; none where nobody logs.
    /// `noise` gives standard deviations of turbulence and white noise of the log.
    fn log_information(&self, noise: impl Fn(f64) -> (f64, f64)) -> f64 {
        let builder = &self.worth.builder;
        let (scene, seed) = (&builder.scene, builder.spec.seed);
        let logs = match scene.logged_wind {
            LoggedWind::Absent => 0,
            LoggedWind::Site => 1,
            LoggedWind::OnBoard => scene.tracks.len(),
        };
        let step_s = scene.row_step_s as f64;
        let keep = (-step_s / LOG_TURBULENCE.2).exp();
        (0..logs)
            .map(|index| {
                let (turbulence, white) = noise(wind_instrument(scene, seed, index).0);
                // Variance of a mean of many rows of a first-order process, times their number.
                let long = turbulence.powi(2) * (1.0 + keep) / (1.0 - keep) + white.powi(2);
                1.0 / (long * step_s)
            })
            .sum()
    }

    /// Inverse covariance of the knots: `processes` (standard deviation and correlation time of
    /// each), and what a second of the log tells.
    fn knots_prior(&self, processes: &[(f64, f64)], per_second: f64) -> Option<Matrix> {
        let count = self.knots().1;
        let covariance = |i: usize, j: usize| {
            let apart_s = self.knot_s() * (i as f64 - j as f64).abs();
            let of = |(sd, lasts_s): &(f64, f64)| sd.powi(2) * (-apart_s / lasts_s).exp();
            // A trifle on the diagonal keeps a process that hardly changes from being singular.
            processes.iter().map(of).sum::<f64>() * if i == j { 1.0 + 1e-9 } else { 1.0 }
        };
        let rows: Vec<Vec<f64>> = (0..count)
            .map(|i| (0..count).map(|j| covariance(i, j)).collect())
            .collect();
        let mut prior = linear::inverse(&rows)?;
        for second in 0..self.worth.builder.scene.duration_s as usize {
            let (k, share) = self.knot(second as f64);
            for (i, a) in [(k, 1.0 - share), (k + 1, share)] {
                for (j, b) in [(k, 1.0 - share), (k + 1, share)] {
                    prior[i][j] += per_second * a * b;
                }
            }
        }
        Some(prior)
    }

    /// What each knot adds to each row, where a whole turn adds `by_unit`: the wind's mean over the
    /// way of what is read.
    fn knots_columns(&self, by_unit: &[Vec<f64>]) -> Vec<Column> {
        let (from_s, count) = self.knots();
        let mut columns = vec![self.everywhere(0.0); count];
        let scene = &self.worth.builder.scene;
        for (p, log) in self.logs.iter().enumerate() {
            for (r, row) in log.rows.iter().enumerate() {
                let way_s = match self.worth.builder.forward {
                    Forward::Gaussian => 0.0,
                    _ => {
                        let point = scene.track_at(p, row.time_s);
                        (point[0].hypot(point[1]) / scene.wind.speed_m_s).min(-from_s)
                    }
                };
                // By some points of the way: it is long beside none of the knots' spaces.
                let points = (way_s / (0.5 * self.knot_s())).ceil() as usize + 1;
                for n in 0..points {
                    let part = (n as f64 + 0.5) / points as f64;
                    let (k, share) = self.knot(row.time_s - part * way_s);
                    let whole = by_unit[p][r] / points as f64;
                    columns[k][p][r] += (1.0 - share) * whole;
                    columns[k + 1][p][r] += share * whole;
                }
            }
        }
        columns
    }

    /// The least that is left of the truth's readings, nats.
    fn misfit(&self, truth: &[MeanLog], faults: &[Faults], chords: usize) -> f64 {
        let whiteners = self.whiteners(truth, faults);
        let mut columns: Vec<Column> = Vec::new();
        columns.extend(self.places.iter().map(|(_, u)| u.column.clone()));
        columns.extend(self.others.iter().map(|u| u.column.clone()));
        columns.extend(self.wind.iter().flat_map(|w| w.0.iter().cloned()));
        whiten(&whiteners, &mut columns);
        let prior = self.prior(columns.len());
        let normal = normal_matrix(&columns, &prior);
        let read = readings(truth);
        let mut own = readings(&self.logs);
        // Where the base stands: its own unknowns exactly, the others linearly.
        let mut stands = vec![0.0; columns.len()];
        let mut least = f64::INFINITY;
        for chord in 0..=chords {
            let mut left = vec![difference(&read, &own, 1.0)];
            whiten(&whiteners, &mut left);
            for (k, column) in columns.iter().enumerate().skip(self.places.len()) {
                add(&mut left[0], column, -stands[k]);
            }
            let penalty = |x: &[f64]| -> f64 {
                let row = |(i, p): (usize, &Vec<f64>)| x[i] * inner_flat(p, x);
                prior.iter().enumerate().map(row).sum()
            };
            if chord > 0 {
                least = least.min(0.5 * (inner(&left[0], &left[0]) + penalty(&stands)));
            }
            let pull: Vec<f64> = columns
                .iter()
                .zip(&prior)
                .map(|(c, p)| inner(c, &left[0]) - inner_flat(p, &stands))
                .collect();
            let Some(step) = linear::solve(&normal, &pull) else {
                break;
            };
            if chord == chords {
                // What a last step would leave if all were linear.
                let gain: f64 = step.iter().zip(&pull).map(|(s, p)| s * p).sum();
                let linear = inner(&left[0], &left[0]) + penalty(&stands) - gain;
                return least.min(0.5 * linear.max(0.0));
            }
            stands.iter_mut().zip(&step).for_each(|(x, s)| *x += s);
            own = readings(&self.at(self.moved(&stands)));
        }
        least
    }

    fn moved(&self, stands: &[f64]) -> Moved {
        let mut moved = Moved::default();
        for ((unit, _), x) in self.places.iter().zip(stands) {
            moved.direction_deg += x * unit.direction_deg;
            moved.axis_m += x * unit.axis_m;
            moved.log_emission += x * unit.log_emission;
            moved.background_ppm += x * unit.background_ppm;
        }
        moved
    }

    fn prior(&self, count: usize) -> Matrix {
        let mut prior = vec![vec![0.0; count]; count];
        let places = self.places.iter().map(|p| &p.1);
        let mut k = 0;
        for unknown in places.chain(&self.others) {
            prior[k][k] = unknown.prior_weight;
            k += 1;
        }
        for (_, of_knots) in &self.wind {
            for (i, row) in of_knots.iter().enumerate() {
                prior[k + i][k..k + row.len()].copy_from_slice(row);
            }
            k += of_knots.len();
        }
        prior
    }

    fn whiteners(&self, truth: &[MeanLog], faults: &[Faults]) -> Vec<Whitener<'_>> {
        let builder = &self.worth.builder;
        truth
            .iter()
            .zip(faults)
            .zip(&self.errors)
            .map(|((log, faults), errors)| {
                let lags_s = Platform::stages_s(&builder.scene, faults);
                let gain = faults.log_gain.exp();
                Whitener::new(&builder.noise, log, gain, lags_s).with_errors(errors)
            })
            .collect()
    }
}

/// Whitens columns by platform and row.
fn whiten(whiteners: &[Whitener<'_>], columns: &mut [Column]) {
    for (p, whitener) in whiteners.iter().enumerate() {
        let mut own: Vec<Vec<f64>> = columns
            .iter_mut()
            .map(|c| std::mem::take(&mut c[p]))
            .collect();
        whitener.whiten(&mut own);
        for (column, own) in columns.iter_mut().zip(own) {
            column[p] = own;
        }
    }
}

fn normal_matrix(columns: &[Column], prior: &[Vec<f64>]) -> Matrix {
    let mut normal = prior.to_vec();
    for i in 0..columns.len() {
        for j in 0..=i {
            let both = inner(&columns[i], &columns[j]);
            normal[i][j] += both;
            if j < i {
                normal[j][i] += both;
            }
        }
        // A column of zeros is an unknown that nothing shows and nothing limits.
        normal[i][i] += 1e-12;
    }
    normal
}

fn inner_flat(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn inner(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| inner_flat(a, b)).sum()
}

fn add(a: &mut [Vec<f64>], b: &[Vec<f64>], times: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += times * b);
    }
}

/// A case whose effects are as visible as wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuned {
    /// What to make.
    pub spec: CaseSpec,
    /// D of each effect beside the others, nats.
    pub nats: Vec<f64>,
}

/// Strength beyond which an effect is given up as not to be seen in a scene.
const STRONGEST: f64 = 300.0;
/// The strength tried first for [`WEAK_NATS`].
const WEAK: f64 = 2.0;
/// The visibility that most effects have about at the strength [`WEAK`], nats.
const WEAK_NATS: f64 = 20.0;
/// Part of the wanted D by which the reached one may differ.
const WITHIN: f64 = 0.1;
/// The same where an effect jumps (a lid, a limit).
const WITHIN_AT_WORST: f64 = 0.3;
/// Trials for one strength.
const TRIALS: usize = 10;
/// How often several effects are tuned, each beside the others.
const ROUNDS: usize = 3;

/// `spec` with strengths that make each effect as visible as wanted beside the others, to within a
/// tenth or, where it jumps, three; `None` where the scene does not show one so strongly.
pub fn tuned(spec: &CaseSpec, wanted: &[f64]) -> Option<Tuned> {
    let worth = Worth::new(spec);
    let first = |d: &f64| WEAK * (d / WEAK_NATS).sqrt();
    let mut strengths: Vec<f64> = wanted.iter().map(first).collect();
    let nats = if let [target] = wanted {
        let (strength, nats) = worth.strength_for(*target, &strengths, 0)?;
        strengths[0] = strength;
        vec![nats]
    } else {
        worth.together(wanted, &mut strengths)?
    };
    let mut spec = spec.clone();
    for (hidden, strength) in spec.hidden.iter_mut().zip(strengths) {
        hidden.strength = strength;
    }
    Some(Tuned { spec, nats })
}

impl Worth<'_> {
    /// D of each effect once each is about as visible beside the others as wanted.
    fn together(&self, wanted: &[f64], strengths: &mut [f64]) -> Option<Vec<f64>> {
        let mut nats = Vec::new();
        for _ in 0..ROUNDS {
            for which in 0..wanted.len() {
                strengths[which] = self.strength_for(wanted[which], strengths, which)?.0;
            }
            nats = (0..wanted.len())
                .map(|which| self.nats(strengths, which, CHORDS))
                .collect();
            if nats.iter().zip(wanted).all(|(n, w)| near(*n, *w)) {
                return Some(nats);
            }
        }
        // What hides each other wholly is given up; what is seen counts as what it is.
        nats.iter().all(|n| *n > WEAK_NATS).then_some(nats)
    }

    /// The strength of the effect `which` at which its D is about `target`, and that D.
    fn strength_for(&self, target: f64, strengths: &[f64], which: usize) -> Option<(f64, f64)> {
        let mut at = self.nats_by_strength(strengths, which);
        let mut strength = strengths[which];
        // Linearly first, which is quick, and again if that misleads.
        for chords in [0, 1] {
            strength = bracketed(target, strength, |s| at(s, chords))?;
            let nats = at(strength, CHORDS);
            if near(nats, target) {
                return Some((strength, nats));
            }
        }
        None
    }
}

/// Whether a D is about as wanted.
fn near(nats: f64, target: f64) -> bool {
    (nats / target - 1.0).abs() < WITHIN_AT_WORST
}

/// Where `nats` is about `target`: growing steps from `first` until it is bracketed, then regula falsi
/// in the logarithms (D grows about as the square of strength).
fn bracketed(target: f64, first: f64, mut nats: impl FnMut(f64) -> f64) -> Option<f64> {
    let mut strength = first;
    let mut low: Option<(f64, f64)> = None;
    let mut high: Option<(f64, f64)> = None;
    let mut last = (strength, f64::NAN);
    for _ in 0..TRIALS {
        last = (strength, nats(strength));
        let reached = last.1;
        if (reached / target - 1.0).abs() < WITHIN {
            return Some(strength);
        }
        *if reached < target {
            &mut low
        } else {
            &mut high
        } = Some(last);
        let by_square = strength * (target / reached.max(0.05 * target)).sqrt();
        strength = match (low, high) {
            (Some(l), Some(h)) => {
                let log = |n: f64| n.max(0.02 * target).ln();
                let share = (log(target) - log(l.1)) / (log(h.1) - log(l.1));
                (l.0.ln() + share.clamp(0.1, 0.9) * (h.0 / l.0).ln()).exp()
            }
            _ => by_square.clamp(strength / 5.0, strength * 4.0),
        };
        if strength > STRONGEST {
            return None;
        }
    }
    near(last.1, target).then_some(last.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::PlumeEffect;
    use crate::instrument::NoiseForm;

    /// Readings less their means, whitened, of many cases in which nothing is hidden.
    fn whitened(noise: NoiseForm, row_step_s: usize) -> Vec<Vec<f64>> {
        let mut out = Vec::new();
        for seed in 0..5 {
            let spec = CaseSpec {
                noise,
                row_step_s,
                ..CaseSpec::none(seed)
            };
            let builder = CaseBuilder::new(&spec);
            let (physics, faults) = (Physics::default(), builder.no_faults());
            let airs = builder.airs(&physics, &vec![[0.0; 3]; faults.len()], 1);
            let logs = builder.mean_logs(&airs, &faults);
            let rows = builder.rows(&physics, &faults);
            for ((log, rows), faults) in logs.iter().zip(&rows).zip(&faults) {
                let lags_s = Platform::stages_s(&builder.scene, faults);
                let noise = Whitener::new(&builder.noise, log, 1.0, lags_s);
                let left = rows.iter().map(|r| r.co2_ppm.unwrap() - r.mean_ppm);
                // A spike of 40 ppm in two thousand rows is no part of what is tested.
                let cut = 6.0 * builder.noise.white_ppm() + 60.0;
                let mut columns = vec![left.map(|x| if x.abs() > cut { 0.0 } else { x }).collect()];
                noise.whiten(&mut columns);
                out.append(&mut columns);
            }
        }
        out
    }

    // The oracle is the generator's own noise: whitened it is independent and of unit variance, but
    // for its rare outliers.
    #[test]
    fn the_generators_noise_becomes_white() {
        for (noise, step) in [
            (NoiseForm::Usual, 1),
            (NoiseForm::SlowSensors, 1),
            (NoiseForm::Usual, 4),
        ] {
            let all = whitened(noise, step);
            let count = all.iter().map(Vec::len).sum::<usize>() as f64;
            let usual = |x: &f64| x.clamp(-4.0, 4.0);
            let sum = |of: &dyn Fn(&[f64]) -> f64| all.iter().map(|c| of(c)).sum::<f64>() / count;
            let variance = sum(&|c| c.iter().map(|x| usual(x).powi(2)).sum());
            let next = sum(&|c| c.windows(2).map(|w| usual(&w[0]) * usual(&w[1])).sum());
            let bar = 6.0 / count.sqrt() + 0.03;
            assert!((variance - 1.0).abs() < bar, "{noise:?} {step}: {variance}");
            assert!(next.abs() < bar, "{noise:?} {step}: {next}");
        }
    }

    #[test]
    fn more_strength_is_more_visible_and_none_is_not() {
        for effect in [PlumeEffect::SensorLag, PlumeEffect::SigmaZScale] {
            let at = |strength| nats(&CaseSpec::one(4, effect, strength))[0];
            let (none, weak, strong) = (at(0.0), at(1.0), at(3.0));
            assert!(
                none < 0.01 && none < weak && weak < strong,
                "{none} {weak} {strong}"
            );
        }
    }

    // A level of the air that the scenario states to within some ppm: whatever the readings, no more
    // than (3 ppm)²/2 sd² can be known, and without any doubt more.
    #[test]
    fn what_the_scenario_is_unsure_of_hides_what_looks_like_it() {
        let effect = PlumeEffect::BackgroundOffset;
        let spec = CaseSpec::one(4, effect, 3.0);
        let stated = nats(&spec)[0];
        let mut worth = Worth::new(&spec);
        let sd = 2.0;
        worth
            .builder
            .scene
            .uncertain
            .push(crate::scene::PriorError {
                key: "background.co2_ppm",
                sd,
                off: 0.0,
            });
        let unsure = worth.nats(&[3.0], 0, CHORDS);
        assert!(
            unsure <= 4.5 / (sd * sd) + 1e-6 && unsure < stated,
            "{unsure} {stated}"
        );
    }

    // The oracle is the readings themselves: by so much does the truth fit them better than the base,
    // on average over cases; a single gain of D nats has the variance 2 D.
    #[test]
    fn readings_gain_by_the_truth_what_is_said() {
        let (mut said, mut gained) = (0.0, 0.0);
        for (seed, effect, strength) in [
            (1, PlumeEffect::SigmaYScale, 0.6),
            (3, PlumeEffect::WindDirectionOffset, 1.3),
            (7, PlumeEffect::ClockOffset, 0.7),
            (9, PlumeEffect::WindVeerWithHeight, 1.2),
        ] {
            let spec = CaseSpec::one(seed, effect, strength);
            let worth = Worth::new(&spec);
            let (physics, faults, _) = worth.laws(&[strength]);
            let builder = &worth.builder;
            let mut read = worth.mean_logs(&physics, &faults, &worth.unmoved());
            let rows = builder.rows(&physics, &faults);
            for (log, rows) in read.iter_mut().zip(&rows) {
                for (own, row) in log.rows.iter_mut().zip(rows) {
                    let off = row.co2_ppm.unwrap() - own.mean_ppm;
                    // Spikes are no part of the noise that is known.
                    own.mean_ppm += if off.abs() < 60.0 { off } else { 0.0 };
                }
            }
            let misfit = |strengths: &[f64]| {
                Base::new(&worth, strengths, &faults).misfit(&read, &faults, CHORDS)
            };
            said += worth.nats(&[strength], 0, CHORDS);
            gained += misfit(&[0.0]) - misfit(&[strength]);
        }
        assert!(said > 40.0, "{said}");
        assert!(
            (gained - said).abs() < 3.0 * (2.0 * said).sqrt(),
            "{gained} {said}"
        );
    }

    #[test]
    fn strengths_are_found() {
        let spec = CaseSpec::one(3, PlumeEffect::EmissionTrend, 0.0);
        let tuned = tuned(&spec, &[40.0]).unwrap();
        assert!((tuned.nats[0] / 40.0 - 1.0).abs() < 0.15, "{tuned:?}");
        assert!((nats(&tuned.spec)[0] - tuned.nats[0]).abs() < 1e-9);
    }
}
