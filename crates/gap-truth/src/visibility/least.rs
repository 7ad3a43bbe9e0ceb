//! The least that a base can leave of the truth's readings.

use super::base::{Base, Moved, difference, readings};
use super::{Column, Matrix};
use crate::instrument::{Faults, MeanLog, Platform};
use crate::linear;
use crate::whitening::Whitener;

impl Base<'_, '_> {
    /// The least that is left of the truth's readings, nats.
    pub(super) fn misfit(&self, truth: &[MeanLog], faults: &[Faults], chords: usize) -> f64 {
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
