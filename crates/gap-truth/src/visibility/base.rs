//! The base: what a model without the effect knows, and what it is unsure of.

use super::{Column, Matrix, Worth};
use crate::instrument::{Faults, MeanLog, OWN_CLOCK_S, OWN_LOG_GAIN, OWN_OFFSET_PPM};
use crate::physics::Physics;
use crate::whitening::InputErrors;

/// Steps for derivatives: direction, degrees, and height, m: far below a plume's width.
const STEP_DEG: f64 = 0.2;
const STEP_M: f64 = 1.0;
/// Step of a clock, s: far below the time that it takes to fly through a plume.
const STEP_S: f64 = 0.1;
/// Step of the logarithm of another effect's strength.
const STEP_LOG_STRENGTH: f64 = 0.05;

/// One unknown of the base: what a unit of it adds to each row, by platform, and one over the square
/// of its prior standard deviation. Unknowns of the wind have a joint prior instead.
pub(super) struct Unknown {
    pub(super) column: Column,
    pub(super) prior_weight: f64,
}

/// What the base's places in the world are moved by.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moved {
    pub(super) direction_deg: f64,
    pub(super) axis_m: f64,
    pub(super) log_emission: f64,
    pub(super) background_ppm: f64,
}

impl Moved {
    pub(super) fn of(self, physics: &Physics) -> Physics {
        Physics {
            direction_offset_deg: physics.direction_offset_deg + self.direction_deg,
            axis_offset_m: physics.axis_offset_m + self.axis_m,
            log_emission: physics.log_emission + self.log_emission,
            background_ppm: physics.background_ppm + self.background_ppm,
            ..physics.clone()
        }
    }
}

/// The base: the scene with the other effects, seen from where the log says that platforms were.
pub(super) struct Base<'w, 'a> {
    pub(super) worth: &'w Worth<'a>,
    pub(super) physics: Physics,
    pub(super) faults: Vec<Faults>,
    pub(super) seen_off_m: Vec<[f64; 3]>,
    pub(super) logs: Vec<MeanLog>,
    /// Unknowns of the scene: which of [`Moved`], with their columns.
    pub(super) places: Vec<(Moved, Unknown)>,
    /// Further unknowns, linear ones.
    pub(super) others: Vec<Unknown>,
    /// Columns of the wind's knots, and their joint prior.
    pub(super) wind: Vec<(Vec<Column>, Matrix)>,
    /// What errors of its inputs do to each platform's readings.
    pub(super) errors: Vec<InputErrors>,
}

/// A false log of places that is no part of the base is taken for true by it.
pub(super) fn seen_off_m(true_faults: &[Faults], own: &[Faults]) -> Vec<[f64; 3]> {
    let off = |(t, own): (&Faults, &Faults)| [0, 1, 2].map(|k| t.place_m[k] - own.place_m[k]);
    true_faults.iter().zip(own).map(off).collect()
}

pub(super) fn readings(logs: &[MeanLog]) -> Column {
    let of = |l: &MeanLog| l.rows.iter().map(|r| r.mean_ppm).collect();
    logs.iter().map(of).collect()
}

pub(super) fn excess(logs: &[MeanLog]) -> Column {
    let of = |l: &MeanLog| l.rows.iter().map(|r| r.mean_excess_ppm).collect();
    logs.iter().map(of).collect()
}

/// (a − b) / step, row by row.
pub(super) fn difference(a: &[Vec<f64>], b: &[Vec<f64>], step: f64) -> Column {
    let less =
        |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| (a - b) / step).collect();
    a.iter().zip(b).map(less).collect()
}

impl<'w, 'a> Base<'w, 'a> {
    pub(super) fn new(worth: &'w Worth<'a>, strengths: &[f64], true_faults: &[Faults]) -> Self {
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

    /// Whether platforms whose faults are `true_faults` are where it takes them to be.
    pub(super) fn is_seen_from(&self, true_faults: &[Faults]) -> bool {
        let off = seen_off_m(true_faults, &self.faults);
        off == self.seen_off_m
    }

    pub(super) fn at(&self, moved: Moved) -> Vec<MeanLog> {
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

    pub(super) fn everywhere(&self, value: f64) -> Column {
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
}
