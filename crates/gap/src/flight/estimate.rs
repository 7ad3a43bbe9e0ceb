//! Coefficients of an aircraft of which none are published, from its flights.
//!
//! The filter of the gap follows the flight (filter-error method: Maine & Iliff 1985, Jategaonkar 2015, ch. 5) with all
//! coefficients free that a flight may tell, from a start of the user's (those of an aircraft like it) and the priors
//! of [`parameters`](super::parameters): step by step to the most probable values, the noise fitted anew at each. What
//! a scale and a ruler tell (mass, inertia, lengths) stays: moments are known by the inertia only.
//!
//! The flights are then halved. Each half estimates for itself; where the two differ by more than they say, all
//! standard deviations are widened by that factor, and what the one predicts of the other is the error that the
//! aircraft has on a flight that it has not seen.

use std::sync::Arc;

use fdm::Aircraft;
use serde::Serialize;

use super::evidence::sum;
use super::gate::Gated;
use super::log::FlightLog;
use super::parameters::{Effect, Parameter, applied, value_of};
use super::study::{Linear, Study};
use super::windows::{self, MotionError};
use super::{gate, histories};
use crate::GapError;
use crate::verdict::DataQuality;

/// Identity of the written estimate.
pub const SCHEMA: &str = "plumage.estimate/1";
/// Most steps of a search.
const ROUNDS: usize = 15;
/// It has come to its end when no parameter moves by more than this part of its standard deviation.
const SETTLED_SD: f64 = 0.1;
/// A coefficient is told by the flight if its standard deviation has shrunk to this part of what it was before: the
/// flight then weighs three times what was known.
const TOLD_PART: f64 = 0.5;
/// What a coefficient is off by, as a part of it, beside what the filter states: gusts are not as the filter has them.
/// Flights of a flight model that shares nothing with this one (`gap-bench`, tests/flight_estimate.rs) are off by 2 to
/// 6 per cent, a wing without a tail more than an aircraft with one.
const LAW_PART: f64 = 0.05;
/// Parts of a step with all coefficients free that are tried, and what one may lose, nats: with the gains held the score
/// that is nil at its end is not the slope of what is scored, and one nat for each of thirty may be lost; beyond, the
/// filter has lost the flight.
const STEP: (i32, f64) = (4, 30.0);

/// One coefficient.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coefficient {
    /// Dotted name, as in an aircraft file.
    pub name: String,
    /// Unit; "1" for what is per radian.
    pub unit: &'static str,
    /// Value in the file that the estimate began with.
    pub start: f64,
    /// What it was taken to be off by there, one standard deviation.
    pub prior_sd: f64,
    /// Estimate.
    pub value: f64,
    /// One standard deviation.
    pub sd: f64,
    /// Whether the flight tells it, rather than what was known before.
    pub told: bool,
}

/// What the flights tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// In words.
    pub summary: String,
    /// Coefficients and delay.
    pub coefficients: Vec<Coefficient>,
    /// Factor by which all standard deviations were widened, since two halves of the flights differ by so much more.
    pub widened: f64,
    /// Errors of the motion predicted for short windows: by the file that it began with, and by an estimate that has
    /// not seen the window.
    pub motion: Vec<MotionError>,
    /// Flaws of the raw data.
    pub data_quality: Vec<DataQuality>,
    /// What a user should know besides.
    pub notices: Vec<String>,
    /// The aircraft with the estimated coefficients.
    #[serde(skip)]
    pub aircraft: Aircraft,
}

impl Estimate {
    /// The text of `estimate.json`, indented.
    ///
    /// # Errors
    /// Only if serialisation itself fails.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }
}

/// A search that has come to its end.
struct Fitted<'a> {
    study: Study<'a>,
    view: Linear,
    /// Standard deviations of all parameters, as the filter states them.
    sds: Vec<f64>,
}

/// Estimates the coefficients of `aircraft`, whose file has lengths, masses and a start, from flights of it; `progress`
/// gets the part done, 0 to 1.
///
/// # Errors
/// [`GapError::Data`] when nothing flies in the logs, rows are too far apart, the model cannot follow them from that
/// start, or what is found is no aircraft.
pub fn estimate(
    flights: &[FlightLog],
    aircraft: &Aircraft,
    progress: &mut dyn FnMut(f64),
) -> Result<Estimate, GapError> {
    let gated = gate::pass(flights, aircraft)?;
    if !gated.tells_delays {
        return Err(GapError::Data {
            what: "flight".into(),
            problem: "its rows are too far apart to show the effect of moments".into(),
            expected: "rows at most 0.055 s apart".into(),
        });
    }
    let count = flights.len();
    let all = Fitted::of(aircraft, &gated, count, None)?;
    progress(0.4);
    let halves = halves(&gated);
    let mut of_halves = Vec::new();
    for half in &halves {
        of_halves.push(Fitted::of(aircraft, half, count, Some(&all.view))?);
        progress(0.4 + 0.25 * of_halves.len() as f64);
    }
    let widened = widened(&of_halves);
    let coefficients = all.coefficients(widened);
    let motion = unseen(&of_halves);
    let theta = &all.view.theta;
    let found = applied(aircraft, &all.study.parameters, theta, 0)
        .extended
        .aircraft;
    found.check().map_err(|e| GapError::Data {
        what: "flight".into(),
        problem: format!("the estimate is not a valid aircraft: {e}"),
        expected: "closer starting values, or flights with more manoeuvres".into(),
    })?;
    progress(1.0);
    Ok(Estimate {
        schema: SCHEMA,
        summary: summary(&coefficients, &motion),
        coefficients,
        widened,
        motion,
        data_quality: gated.data_quality.clone(),
        notices: gated.notices.clone(),
        aircraft: Arc::unwrap_or_clone(found),
    })
}

impl<'a> Fitted<'a> {
    /// Searches from the file, or from where another search has ended.
    fn of(
        aircraft: &'a Aircraft,
        gated: &'a Gated,
        logs: usize,
        from: Option<&Linear>,
    ) -> Result<Self, GapError> {
        let study = Study::of_unknown(aircraft, gated, logs);
        let mut view = match from {
            Some(view) => study.seen_with_own_noise(view.theta.clone(), view.noise.clone()),
            None => study.seen_from_start(),
        };
        let mut sds = stated(&study, &view);
        for _ in 0..ROUNDS {
            let theta = study.step_towards(&view, &[], STEP);
            let next = study.seen_with_own_noise(theta, view.noise.clone());
            let move_of = |(j, sd): (usize, &f64)| (next.theta[j] - view.theta[j]).abs() / sd;
            let farthest = sds.iter().enumerate().map(move_of).fold(0.0, f64::max);
            if !next.log_score.is_finite() {
                break;
            }
            view = next;
            sds = stated(&study, &view);
            if farthest < SETTLED_SD {
                break;
            }
        }
        if !view.log_score.is_finite() {
            return Err(GapError::Data {
                what: "flight".into(),
                problem: "the flight model cannot follow the measured motion from that start"
                    .into(),
                expected: "the file of a similar aircraft".into(),
            });
        }
        Ok(Self { study, view, sds })
    }

    /// The coefficients, their standard deviations `widened`.
    fn coefficients(&self, widened: f64) -> Vec<Coefficient> {
        let of = |(j, p): (usize, &Parameter)| {
            let start = neutral(self.study.aircraft, p)?;
            let value = start + self.view.theta[j];
            let law_sd = LAW_PART * value.abs();
            let sd = (self.sds[j] * widened).hypot(law_sd).min(p.tolerance);
            Some(Coefficient {
                name: p.name.clone(),
                unit: p.unit,
                start,
                prior_sd: p.tolerance,
                value,
                sd,
                told: sd <= TOLD_PART * p.tolerance,
            })
        };
        let each = self.study.parameters.iter().enumerate();
        each.filter_map(of).collect()
    }
}

/// Standard deviations of all parameters as the filter states them.
fn stated(study: &Study<'_>, view: &Linear) -> Vec<f64> {
    let (a, b) = sum(&view.blocks);
    let spread = view.word.dispersion;
    let (_, covariance) = study.posterior(&(a / spread), &(b / spread), &[]);
    let sd = |j: usize| covariance[(j, j)].max(0.0).sqrt();
    (0..study.parameters.len()).map(sd).collect()
}

/// What a parameter of the aircraft is without a departure; none for what is of sensors and air.
fn neutral(aircraft: &Aircraft, parameter: &Parameter) -> Option<f64> {
    match parameter.effect {
        Effect::Coefficient(place) => Some(value_of(aircraft, place)),
        Effect::Mechanism(..) if parameter.servo => Some(aircraft.surfaces.delay_s),
        _ => None,
    }
}

/// The first and the second half of every stretch.
fn halves(gated: &Gated) -> [Gated; 2] {
    [0, 1].map(|half| Gated {
        segments: gated
            .segments
            .iter()
            .map(|s| s.cut(half * (s.len() / 2)..[s.len() / 2, s.len()][half]))
            .collect(),
        ..gated.clone()
    })
}

/// How much more two halves differ than they say, at least 1: root mean square over what both tell.
fn widened(halves: &[Fitted<'_>]) -> f64 {
    let [a, b] = halves else { return 1.0 };
    let mut squares = Vec::new();
    for (j, p) in a.study.parameters.iter().enumerate() {
        let told = |half: &Fitted<'_>| half.sds[j] <= TOLD_PART * p.tolerance;
        if neutral(a.study.aircraft, p).is_some() && told(a) && told(b) {
            let off = a.view.theta[j] - b.view.theta[j];
            squares.push(off * off / (a.sds[j].powi(2) + b.sds[j].powi(2)));
        }
    }
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    mean.sqrt().max(1.0)
}

/// Errors of each half's motion, by the file and by what the other half tells.
fn unseen(fitted: &[Fitted<'_>]) -> Vec<MotionError> {
    let mut histories = Vec::new();
    for (k, own) in fitted.iter().enumerate() {
        let (study, other) = (&own.study, &fitted[1 - k]);
        // The air of this half is its own.
        let aircraft_of = |theta: &[f64]| -> Vec<f64> {
            let own_air = own.view.theta.iter().zip(&study.parameters);
            let mixed = own_air.zip(theta).map(|((own, p), theirs)| {
                let is_air = matches!(p.effect, Effect::Wind(..));
                if is_air { *own } else { *theirs }
            });
            mixed.collect()
        };
        let file = vec![0.0; own.view.theta.len()];
        let [before, after] = [&file, &other.view.theta].map(|theta| aircraft_of(theta));
        let noise = &own.view.noise;
        histories.extend(histories::histories(study, noise, [&before, &after]));
    }
    windows::errors(&histories)
}

fn summary(coefficients: &[Coefficient], motion: &[MotionError]) -> String {
    let told = coefficients.iter().filter(|c| c.told).count();
    let mut words = format!(
        "The flights determine {told} of {} coefficients to less than half of their prior uncertainty.",
        coefficients.len()
    );
    if let Some(errors) = windows::in_words(motion, true) {
        words = format!("{words} {errors}");
    }
    words
}
