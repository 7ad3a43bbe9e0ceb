//! What passes read of a plume whose axis wanders up and down.
//!
//! The mean plume at a distance has the vertical spread σz; at a moment it is narrower, and its axis is displaced by
//! eddies that are larger than it (fluctuating plume, Gifford 1959, Adv. Geophys. 6:117). A pass that misses the axis
//! therefore says little of the rate, and passes that follow each other meet the same displacement. The likelihood of all
//! passes is that of a Markov chain of displacements, by the forward algorithm (Rabiner 1989, Proc. IEEE 77:257).

use crate::grid::normal_grid;
use crate::vertical::MeanPlume;

/// Part of σz² that is wander, with its weight beforehand: about half within some minutes' travel of the source, more near
/// it and less far away (Hanna, Briggs & Hosker 1982, chapter 4). The passes choose.
const WANDER_PARTS: [(f64, f64); 3] = [(0.2, 0.25), (0.5, 0.5), (0.8, 0.25)];
/// Displacements of the axis on the grid.
const STEPS: usize = 11;
/// Correlation of the displacements of passes that are [`CORRELATED_S`] apart, as in [`plume::curtain`].
const CORRELATION: f64 = 1.0 / 3.0;
const CORRELATED_S: f64 = 80.0;
/// The most correlated displacements that the grid can tell apart.
const MOST_CORRELATED: f64 = 0.9;
/// Standard deviation of ln of what a pass carries, beside the wander of the axis: with half of σz² as wander, passes on
/// the axis scatter by [`plume::curtain::PASS_SCATTER`]. The passes choose among half, all and twice of it. The mean
/// of what they carry is the rate of the plume, because mass is conserved.
const SCATTER: [(f64, f64); 3] = [(0.15, 0.25), (0.3, 0.5), (0.6, 0.25)];
/// What a pass carries is not Gaussian by this part of the strongest pass, one standard deviation: large eddies carry gas
/// far aside, where a Gaussian has none.
const FLOOR: f64 = 0.1;

/// The mean plumes of several sources at one distance, each with its share of what all emit. The same eddies displace all.
pub(crate) type PlumeParts = Vec<(f64, MeanPlume)>;

/// What a pass carries through each metre of height.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    pub time_s: f64,
    pub height_agl_m: f64,
    pub kg_s_m: f64,
    /// Standard deviation by the sensor's noise.
    pub noise_kg_s_m: f64,
}

/// Passes in order of time, prepared for many likelihoods.
pub(crate) struct Wander<'a> {
    crossings: &'a [Crossing],
    /// Displacements, in standard deviations, with their weights.
    displacements: Vec<(f64, f64)>,
    /// Probability of each displacement after each other one, from pass to pass.
    transitions: Vec<Vec<Vec<f64>>>,
    floor_kg_s_m: f64,
}

impl<'a> Wander<'a> {
    pub fn new(crossings: &'a [Crossing]) -> Self {
        let displacements = normal_grid(STEPS);
        let after = |gap_s: f64| {
            let r = CORRELATION.powf(gap_s / CORRELATED_S).min(MOST_CORRELATED);
            let row = |to: &(f64, f64)| {
                let bell =
                    |from: &(f64, f64)| (-0.5 * (to.0 - r * from.0).powi(2) / (1.0 - r * r)).exp();
                displacements.iter().map(bell).collect::<Vec<f64>>()
            };
            let mut rows: Vec<Vec<f64>> = displacements.iter().map(row).collect();
            for from in 0..STEPS {
                let all: f64 = rows.iter().map(|row| row[from]).sum();
                for row in &mut rows {
                    row[from] /= all;
                }
            }
            rows
        };
        let highest = crossings.iter().map(|c| c.kg_s_m).fold(0.0, f64::max);
        Self {
            crossings,
            transitions: crossings
                .windows(2)
                .map(|pair| after(pair[1].time_s - pair[0].time_s))
                .collect(),
            displacements,
            floor_kg_s_m: FLOOR * highest,
        }
    }

    /// ln likelihood of the passes at each of `rates`, kg/s, where `plumes` are the mean plumes at the passes.
    pub fn ln_likelihood(&self, plumes: &[PlumeParts], rates: &[f64]) -> Vec<f64> {
        let by_wander =
            WANDER_PARTS.map(|(part, weight)| (self.densities_1_m(plumes, part), weight));
        let of_rate = |rate: &f64| {
            let mut ln = Vec::with_capacity(WANDER_PARTS.len() * SCATTER.len());
            for (densities, by_part) in &by_wander {
                for (scatter, by_scatter) in SCATTER {
                    let weight: f64 = by_part * by_scatter;
                    ln.push(self.forward(densities, (*rate, scatter)) + weight.ln());
                }
            }
            let top = ln.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            top + ln.iter().map(|l| (l - top).exp()).sum::<f64>().ln()
        };
        rates.iter().map(of_rate).collect()
    }

    /// Density of the plume of a moment at each pass by displacement, 1/m.
    fn densities_1_m(&self, plumes: &[PlumeParts], wander_part: f64) -> Vec<Vec<f64>> {
        let at = |(crossing, plume): (&Crossing, &PlumeParts)| {
            let height = crossing.height_agl_m;
            let of_parts = |displaced: f64| {
                let of = |(share, part): &(f64, MeanPlume)| {
                    share * momentary_1_m(part, height, (displaced, wander_part))
                };
                plume.iter().map(of).sum()
            };
            self.displacements.iter().map(|d| of_parts(d.0)).collect()
        };
        self.crossings.iter().zip(plumes).map(at).collect()
    }

    fn forward(&self, densities: &[Vec<f64>], (rate, scatter): (f64, f64)) -> f64 {
        let mut state: Vec<f64> = self.displacements.iter().map(|d| d.1).collect();
        let mut ln = 0.0;
        for (k, (crossing, densities)) in self.crossings.iter().zip(densities).enumerate() {
            if k > 0 {
                let moved =
                    |row: &Vec<f64>| row.iter().zip(&state).map(|(p, s)| p * s).sum::<f64>();
                state = self.transitions[k - 1].iter().map(moved).collect();
            }
            let fixed = self.floor_kg_s_m.hypot(crossing.noise_kg_s_m) / scatter;
            let seen = (crossing.kg_s_m / fixed).asinh();
            // Where x is normal with mean m and standard deviation s, the mean of sinh x is e^(s²/2) sinh m.
            let median = rate / fixed * (-0.5 * scatter * scatter).exp();
            for (s, density) in state.iter_mut().zip(densities) {
                let off = (seen - asinh_of_positive(median * density)) / scatter;
                *s *= (-0.5 * off * off).exp() / scatter;
            }
            let sum = state.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            ln += sum.ln();
            state.iter_mut().for_each(|s| *s /= sum);
        }
        ln
    }
}

/// asinh of a number that is not negative. Near zero the standard library's is exact to the last digit, which is not needed
/// here, and costs an unsteady mission 5 % more processor time.
fn asinh_of_positive(x: f64) -> f64 {
    (x + (x * x + 1.0).sqrt()).ln()
}

/// Density over height of the plume of a moment whose axis is displaced by so many standard deviations, 1/m.
fn momentary_1_m(mean: &MeanPlume, height_agl_m: f64, (displaced, wander_part): (f64, f64)) -> f64 {
    let momentary = MeanPlume {
        axis_agl_m: mean.axis_agl_m + mean.sigma_z_m * wander_part.sqrt() * displaced,
        sigma_z_m: mean.sigma_z_m * (1.0 - wander_part).sqrt(),
        ..*mean
    };
    momentary.density_1_m(height_agl_m)
}
