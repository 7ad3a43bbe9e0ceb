//! The highest concentration where set-points may go, and how far readings stand behind it.

use super::Calibrator;
use air::geo::{Enu, Position};
use gap::plume::PlumeModel;
use infer::ForwardModel;
use nalgebra::DVector;
use plume::curtain::{BETWEEN_PASSES_S, PASS_SCATTER};
use plume::track::Track;
use plume::{DispersionModel, Place};
use protocol::message::{Estimate, Peak, PeakStatus};
use scenario::airspace::{Airspace, SETPOINT_MARGIN_M};
use scenario::peak::{climb, highest_of};

/// The place of the peak is looked for to this, m: as well as a vehicle flies to it.
const FINEST_M: f64 = 5.0;
/// Rows that are predicted to meet this part of the peak's excess are there: within a standard deviation of
/// its axis, or near it downwind.
const THERE: f64 = 0.5;
/// ... and this part is in the same plume.
const IN_PLUME: f64 = 0.1;
/// Crossings at which a mean and its scatter can be told.
const LEAST_CROSSINGS: usize = 2;
/// What agrees does so within so many standard deviations.
const AGREES_SD: f64 = 2.0;
/// A peak of which less is known than this part of its excess, one standard deviation, is hardly known.
const HARDLY_KNOWN: f64 = 0.5;
/// Where a mission asks for no precision, a peak is known where its 95 % interval has this half width over its excess: about as
/// much as [`HARDLY_KNOWN`] leaves.
pub const WITHIN: f64 = 1.0;
/// Fewest crossings of the plume for a confirmed peak: fewer do not show whether the plume meanders.
const CROSSINGS_OF_MEANDER: usize = 4;
/// Differences for the slopes of a peak: parts of the standard deviation of an unknown, within which the peak is about linear.
const DIFFERENCE_SD: f64 = 0.3;
/// A plume was read where it explains the squares of so many standard deviations of the sensor.
pub const READ_SD: f64 = 5.0;

/// A crossing of the plume: what was read in it above the background, and what is predicted.
#[derive(Debug, Clone, Copy, Default)]
struct Crossing {
    read: f64,
    predicted: f64,
}

/// The axis at a crossing of the plume.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AtCrossing {
    pub time_s: f64,
    /// Turn of the axis, degrees clockwise.
    pub turn_deg: f64,
}

/// Predictions of the corrected model without discrepancy for the rows of the last fit.
#[derive(Debug, Clone, Default)]
pub(super) struct Predicted {
    /// Platform and time of each row.
    at: Vec<(usize, f64)>,
    /// Reading beyond what is predicted besides the plume, ppm.
    read: Vec<f64>,
    /// The plume's part, ppm.
    plume: Vec<f64>,
    /// The axis at each crossing of the plume, in order of time.
    axis: Vec<AtCrossing>,
    /// The sensor's white noise as the fit found it, ppm.
    white_ppm: f64,
}

impl Predicted {
    pub fn of(
        model: &PlumeModel<'_>,
        track: &Track,
        measured: &infer::Rows,
        estimate: &DVector<f64>,
        posterior: &infer::Posterior,
    ) -> Result<Self, infer::InferError> {
        let times = track.time_s().iter();
        let turns: Vec<infer::AxisTurn> = times.map(|t| posterior.turn(*t)).collect();
        let said = model.predict(estimate.as_slice(), &turns)?;
        // A reading that does not count is one of clean air that is as predicted.
        let mut said = said;
        for k in (0..track.len()).filter(|k| !measured.is_used(*k)) {
            said.reading[k] -= said.plume[k];
            said.plume[k] = 0.0;
        }
        let read = |k: usize| {
            let rest = said.reading[k] - said.plume[k];
            if measured.is_used(k) {
                measured.measured()[k] - rest
            } else {
                0.0
            }
        };
        let mut predicted = Self {
            axis: Vec::new(),
            at: track
                .ranges()
                .iter()
                .enumerate()
                .flat_map(|(platform, rows)| rows.clone().map(move |k| (platform, k)))
                .map(|(platform, k)| (platform, track.time_s()[k]))
                .collect(),
            read: (0..track.len()).map(read).collect(),
            plume: said.plume.clone(),
            white_ppm: posterior.fit().noise.white,
        };
        predicted.axis = predicted.axis_by(posterior);
        Ok(predicted)
    }

    /// The plume's part of every row, ppm.
    pub fn plume(&self) -> &[f64] {
        &self.plume
    }

    /// The axis at each crossing of the plume.
    pub fn axis(&self) -> &[AtCrossing] {
        &self.axis
    }

    fn axis_by(&self, posterior: &infer::Posterior) -> Vec<AtCrossing> {
        let most = self.plume.iter().copied().fold(0.0, f64::max);
        let of = |rows: &Vec<usize>| {
            let time_s = rows.iter().map(|k| self.at[*k].1).sum::<f64>() / rows.len() as f64;
            AtCrossing {
                time_s,
                turn_deg: posterior.turn_deg(time_s),
            }
        };
        let crossings = self.rows_of_crossings(IN_PLUME * most);
        let mut axis: Vec<AtCrossing> = crossings.iter().map(of).collect();
        axis.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        axis
    }

    /// Whether readings show that there is a plume at all: by how much less they are off with it than
    /// without.
    pub fn shows_a_plume(&self) -> bool {
        let rows = self.read.iter().zip(&self.plume);
        let gain: f64 = rows.map(|(r, p)| r * r - (r - p) * (r - p)).sum();
        gain > (READ_SD * self.white_ppm).powi(2)
    }

    /// Crossings by the rows that are predicted to meet at least `least_ppm`.
    fn crossings(&self, least_ppm: f64) -> Vec<Crossing> {
        let of = |rows: &Vec<usize>| Crossing {
            read: rows.iter().map(|k| self.read[*k]).sum(),
            predicted: rows.iter().map(|k| self.plume[*k]).sum(),
        };
        self.rows_of_crossings(least_ppm).iter().map(of).collect()
    }

    fn rows_of_crossings(&self, least_ppm: f64) -> Vec<Vec<usize>> {
        let mut all: Vec<Vec<usize>> = Vec::new();
        let inside = (0..self.at.len()).filter(|k| self.plume[*k] >= least_ppm);
        for k in inside {
            let (platform, time_s) = self.at[k];
            match all.last_mut() {
                Some(rows)
                    if rows.last().is_some_and(|last| {
                        let (p, t) = self.at[*last];
                        p == platform && time_s - t < BETWEEN_PASSES_S
                    }) =>
                {
                    rows.push(k);
                }
                _ => all.push(vec![k]),
            }
        }
        all
    }
}

/// Whether what was read in crossings is in the mean what is predicted, of which `predicted_sd` is the
/// relative standard deviation; none without a crossing.
fn agree(crossings: &[Crossing], predicted_sd: f64) -> Option<bool> {
    let n = crossings.len() as f64;
    let ratio = |c: &Crossing| c.read / c.predicted;
    let mean = crossings.iter().map(ratio).sum::<f64>() / n;
    let scatter = if crossings.len() < LEAST_CROSSINGS {
        PASS_SCATTER
    } else {
        let squares = crossings.iter().map(|c| (ratio(c) - mean).powi(2));
        (squares.sum::<f64>() / (n - 1.0) / n).sqrt()
    };
    let within = AGREES_SD * scatter.hypot(predicted_sd);
    (!crossings.is_empty()).then_some((mean - 1.0).abs() <= within)
}

fn place_of(position: Position, airspace: &Airspace) -> Place {
    Place {
        east_m: position.at.east_m,
        north_m: position.at.north_m,
        height_agl_m: position.height_m - airspace.frame().ground_amsl_m,
    }
}

impl Calibrator {
    /// The highest concentration where set-points may go, in the mean of the last minutes in which the plume was met, and
    /// why it has its status; none before a fit, or where they may go nowhere.
    ///
    /// Where the plume meanders it is that of the plume in the mean: a discrepancy found in a few crossings is that of the
    /// puffs which they met.
    pub fn peak(&self, airspace: &Airspace) -> Option<(Peak, String)> {
        if self.meander.is_some() {
            return self.peak_in_the_mean(airspace);
        }
        let model = DispersionModel::new(self.latest_spec()).ok()?;
        let time_s = self.stated_s();
        let found = highest_of(&model, airspace, SETPOINT_MARGIN_M, time_s)?;
        // The model without its discrepancy shows where to look; the readings may know better.
        // Not farther out, though: along the axis a plume thins out, whatever its discrepancy.
        let far_m = |at: &Enu| {
            airspace
                .stacks()
                .iter()
                .map(|s| s.distance_m(*at))
                .fold(f64::MAX, f64::min)
        };
        let most_m = far_m(&found.position.at) + FINEST_M;
        let moments = self.moments();
        let ppm = |place: &Place| {
            let at = Enu {
                east_m: place.east_m,
                north_m: place.north_m,
            };
            if far_m(&at) > most_m {
                return f64::NEG_INFINITY;
            }
            self.most_probable_ppm(place, &moments)
        };
        let found = climb(&ppm, found.position, airspace, SETPOINT_MARGIN_M, FINEST_M);
        let place = place_of(found.position, airspace);
        let there = self.mean_ppm(&place)?;
        let excess_ppm = there.value - model.background_ppm(&place, time_s);
        Some(self.stated(airspace, found.position, &there, excess_ppm))
    }

    /// A peak of which `excess_ppm` is the plume's, and why it has its status.
    fn stated(
        &self,
        airspace: &Airspace,
        position: Position,
        there: &Estimate,
        excess_ppm: f64,
    ) -> (Peak, String) {
        let at = airspace.frame().to_geodetic(position.at);
        let (status, reason) = self.support(there, excess_ppm);
        let peak = Peak {
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
            alt_amsl_m: position.height_m,
            co2_ppm: there.value,
            sd_ppm: there.sd,
            time_s: self.stated_s(),
            status,
        };
        (peak, reason)
    }

    fn peak_in_the_mean(&self, airspace: &Airspace) -> Option<(Peak, String)> {
        let (at, covariance) = self.in_the_mean();
        let time_s = self.stated_s();
        let highest = |at: &DVector<f64>| -> Option<(Position, f64, f64)> {
            let model = DispersionModel::new(self.unknowns.folded(&self.base, at)).ok()?;
            let position = highest_of(&model, airspace, SETPOINT_MARGIN_M, time_s)?.position;
            let place = place_of(position, airspace);
            let ppm = model.mean_ppm(&place, time_s);
            Some((position, ppm, ppm - model.background_ppm(&place, time_s)))
        };
        let (position, co2_ppm, excess_ppm) = highest(at)?;
        let slope = |k: usize| -> Option<f64> {
            let step = DIFFERENCE_SD * covariance[(k, k)].sqrt();
            let aside = |by: f64| {
                let mut aside = at.clone();
                aside[k] += by;
                highest(&aside).map(|h| h.1)
            };
            Some(if step > 0.0 {
                (aside(step)? - aside(-step)?) / (2.0 * step)
            } else {
                0.0
            })
        };
        let slopes: Option<Vec<f64>> = (0..at.len()).map(slope).collect();
        let slopes = DVector::from_vec(slopes?);
        let there = Estimate {
            value: co2_ppm,
            sd: (covariance * &slopes).dot(&slopes).max(0.0).sqrt(),
        };
        Some(self.stated(airspace, position, &there, excess_ppm))
    }

    /// Whether a peak with which crossings near it `agree` is known as well as is asked.
    fn confirmation(&self, relative_sd: f64, agree: &str) -> (PeakStatus, String) {
        let crossings = self.predicted.axis().len();
        if crossings < CROSSINGS_OF_MEANDER {
            let words = format!(
                "{agree}, but {crossings} crossings of the plume do not show whether it meanders"
            );
            return (PeakStatus::Supported, words);
        }
        let half_width = study::SD_95 * relative_sd;
        if half_width <= self.peak_within {
            return (PeakStatus::Confirmed, agree.to_owned());
        }
        let [is, asked] = [half_width, self.peak_within].map(|part| 100.0 * part);
        let words = format!(
            "{agree}, but its 95 % interval is ± {is:.0} % of its excess, and ± {asked:.0} % are asked for"
        );
        (PeakStatus::Supported, words)
    }

    /// How far readings stand behind a peak of which `excess_ppm` is the plume's, and why.
    fn support(&self, there: &Estimate, excess_ppm: f64) -> (PeakStatus, String) {
        let because = |status, words: &str| (status, words.to_owned());
        if !self.predicted.shows_a_plume() {
            return because(PeakStatus::NotFound, "the readings show no plume");
        }
        let relative_sd = there.sd / excess_ppm;
        // What is not a number lies in no range.
        if !(0.0..HARDLY_KNOWN).contains(&relative_sd) {
            let words = "its standard deviation is more than half of its excess";
            return because(PeakStatus::Doubtful, words);
        }
        let near = self.predicted.crossings(THERE * excess_ppm);
        let all = self.predicted.crossings(IN_PLUME * excess_ppm);
        let agreeing = |n: usize, what: &str| match n {
            1 => format!("one crossing {what} agrees with the prediction"),
            n => format!("{n} crossings {what} agree with the prediction"),
        };
        match (agree(&near, relative_sd), agree(&all, relative_sd)) {
            (Some(true), _) if near.len() >= LEAST_CROSSINGS => {
                self.confirmation(relative_sd, &agreeing(near.len(), "near it"))
            }
            (Some(true), _) => (PeakStatus::Supported, agreeing(near.len(), "near it")),
            (None, Some(true)) if all.len() >= LEAST_CROSSINGS => {
                let words = agreeing(all.len(), "of the plume farther away");
                (PeakStatus::Supported, words)
            }
            (Some(false), _) => because(
                PeakStatus::Doubtful,
                "crossings near it read otherwise than predicted",
            ),
            _ => because(
                PeakStatus::Doubtful,
                "no crossing is near it, and too few agree farther away",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crossing(read: f64) -> Crossing {
        Crossing {
            read,
            predicted: 1.0,
        }
    }

    #[test]
    fn crossings_agree_by_their_mean_and_its_scatter() {
        let of =
            |read: &[f64], sd| agree(&read.iter().map(|r| crossing(*r)).collect::<Vec<_>>(), sd);
        assert_eq!(of(&[], 0.1), None);
        // A factor of two from pass to pass about the prediction, and the same passes half as strong.
        assert_eq!(of(&[0.6, 1.7, 0.7, 1.2], 0.05), Some(true));
        assert_eq!(of(&[0.3, 0.5, 0.35, 0.6], 0.05), Some(false));
        // What is known to a third only is not contradicted by that.
        assert_eq!(of(&[0.3, 0.5, 0.35, 0.6], 0.33), Some(true));
        // One alone may be off by the whole of itself.
        assert_eq!(
            (of(&[0.2], 0.0), of(&[2.2], 0.0)),
            (Some(true), Some(false))
        );
    }

    #[test]
    fn noise_is_no_plume() {
        let rows = 2000;
        let noise = |k: usize| if k * k % 7 < 3 { 3.0 } else { -3.0 };
        let with = |plume_ppm: f64| {
            let plume = |k: usize| if k % 400 < 20 { plume_ppm } else { 0.0 };
            Predicted {
                at: (0..rows).map(|k| (0, k as f64)).collect(),
                read: (0..rows).map(|k| noise(k) + plume(k)).collect(),
                plume: (0..rows)
                    .map(|k| if k % 400 < 20 { 30.0 } else { 0.0 })
                    .collect(),
                white_ppm: 3.0,
                ..Predicted::default()
            }
        };
        assert!(!with(0.0).shows_a_plume());
        assert!(with(30.0).shows_a_plume());
        assert_eq!(with(30.0).crossings(10.0).len(), 5);
    }
}
