//! Finding the autopilot's gains in simulation, and judging them: flights over weather cases, step
//! responses, stability margins, and what happens when the aircraft is not as described.
//!
//! To re-tune from a measured flight, give the aircraft the mechanisms that the flight showed:
//! the extended aircraft flies, while the autopilot still counts with the base.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use crate::aircraft::{Aircraft, ControlGains};
use crate::error::FdmError;
use crate::mechanism::Mechanism;
use std::sync::Arc;

mod aircraft_file;
mod flights;
mod margins;
mod outer_loops;
mod robustness;
mod step_responses;
mod weather;

pub use aircraft_file::with_gains;
pub use flights::Evaluation;
pub use margins::{LoopMargin, Required};
pub use robustness::RobustnessCase;
pub use step_responses::StepResponse;
pub use weather::WeatherCase;

/// First spread of the search, as a share of each gain (log scale).
const FIRST_SPREAD: f64 = 0.35;
/// Spread at which the search ends.
const LAST_SPREAD: f64 = 0.05;
/// Chance that a gain is varied in a trial.
const VARIED_SHARE: f64 = 0.5;
/// Factor by which gains without margin are slowed, step by step.
const SLOWER: f64 = 0.85;
/// Most such steps: to a fifth of the speed.
const SLOWER_STEPS: i32 = 11;

/// What lacking inner margins add to every lack of outer ones.
const INNER_FIRST: f64 = 100.0;

/// What to search and with how much effort.
#[derive(Debug, Clone, PartialEq)]
pub struct TuneOrder {
    /// Seed of the search.
    pub seed: u64,
    /// Candidates tried, each flown in every weather.
    pub candidates: usize,
    /// Weather that the search flies in.
    pub weather: Vec<WeatherCase>,
    /// Weather that it does not see, for the judgement.
    pub held_out: Vec<WeatherCase>,
    /// Margins that every loop must keep.
    pub required: Required,
}

impl TuneOrder {
    /// 300 candidates in the standard weather, judged in 12 drawn cases, with 6 dB and 45°.
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            candidates: 300,
            weather: WeatherCase::standard(seed),
            held_out: WeatherCase::drawn(seed, 12),
            required: Required::USUAL,
        }
    }
}

/// A set of gains and how it does.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    /// The gains.
    pub gains: ControlGains,
    /// Flights in the weather of the search.
    pub flights: Vec<Evaluation>,
    /// Flights in weather that the search did not see.
    pub held_out: Vec<Evaluation>,
    /// Mean cost of the flights in the weather of the search, plus that of the steps.
    pub cost: f64,
    /// Mean cost of the flights that the search did not see, plus that of the steps.
    pub held_out_cost: f64,
    /// Mean cost of the steps.
    pub step_cost: f64,
    /// Step responses.
    pub steps: Vec<StepResponse>,
    /// Stability margins: roll and pitch at three airspeeds, heading, height and airspeed at
    /// cruise.
    pub margins: Vec<LoopMargin>,
    /// Whether every loop keeps the margins required.
    pub has_margins: bool,
    /// The gains on aircraft that differ from the description.
    pub robustness: Vec<RobustnessCase>,
}

/// What a tuning found; everything a report draws. Numbers that are not finite (no gain
/// destabilises, never settled) are null in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TuneReport {
    /// The form of this document.
    pub schema: &'static str,
    /// Name of the aircraft.
    pub aircraft: String,
    /// What the aircraft that flew had beyond its description.
    pub mechanism: Vec<Mechanism>,
    /// Seed of the search.
    pub seed: u64,
    /// Candidates tried.
    pub candidates: usize,
    /// Margins required.
    pub required: Required,
    /// Whether the gains changed; if not, nothing better was found that also holds on weather
    /// that the search did not see.
    pub changed: bool,
    /// The gains of the file.
    pub before: Judged,
    /// The gains found.
    pub after: Judged,
    /// Best cost after each candidate (infinite while none has the margins).
    pub history: Vec<f64>,
}

/// The gains that the search varies; limits and approach stay as the user set them.
fn varied(gains: &mut ControlGains) -> [&mut f64; 12] {
    [
        &mut gains.roll_bandwidth_rad_s,
        &mut gains.roll_damping_rad_s,
        &mut gains.roll_integral_rad_s,
        &mut gains.pitch_bandwidth_rad_s,
        &mut gains.pitch_damping_rad_s,
        &mut gains.pitch_integral_rad_s,
        &mut gains.heading_bandwidth_rad_s,
        &mut gains.orbit_gain,
        &mut gains.height_time_s,
        &mut gains.airspeed_time_s,
        &mut gains.energy_damping,
        &mut gains.energy_integral_s,
    ]
}

/// A gain as a person would write it: three significant digits.
fn three_digits(gain: f64) -> f64 {
    if gain > 0.0 {
        let unit = 10f64.powi(2 - gain.log10().floor() as i32);
        (gain * unit).round() / unit
    } else {
        gain
    }
}

/// The same loops, all slower by a factor.
fn slowed(gains: &ControlGains, factor: f64) -> ControlGains {
    let times = |gain: f64| three_digits(gain * factor);
    let over = |time_s: f64| three_digits(time_s / factor);
    ControlGains {
        roll_bandwidth_rad_s: times(gains.roll_bandwidth_rad_s),
        roll_damping_rad_s: times(gains.roll_damping_rad_s),
        roll_integral_rad_s: times(gains.roll_integral_rad_s),
        pitch_bandwidth_rad_s: times(gains.pitch_bandwidth_rad_s),
        pitch_damping_rad_s: times(gains.pitch_damping_rad_s),
        pitch_integral_rad_s: times(gains.pitch_integral_rad_s),
        heading_bandwidth_rad_s: times(gains.heading_bandwidth_rad_s),
        height_time_s: over(gains.height_time_s),
        airspeed_time_s: over(gains.airspeed_time_s),
        energy_integral_s: over(gains.energy_integral_s),
        ..*gains
    }
}

/// Searches gains by a shrinking random search from those of the file, keeping every candidate's
/// gusts the same so that only gains make the difference. A candidate is taken when it costs less,
/// every loop keeps the margins, and on aircraft that are not as described it flies wherever the
/// gains of the file do and keeps half the margins (or theirs, where these are less). What is found must then be no worse in weather that the search did not
/// see, else the gains of the file stay. `progress` is called with how many candidates of how many are done.
///
/// # Errors
/// The aircraft's own faults; [`FdmError::NoTrim`] when it cannot fly at its cruise speed;
/// [`FdmError::NoMargins`] when no gains with the margins required were found.
pub fn tune(
    aircraft: &Aircraft,
    order: &TuneOrder,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<TuneReport, FdmError> {
    aircraft.check()?;
    let aircraft = &Arc::new(aircraft.clone());
    progress(0, order.candidates);
    let before = judge(aircraft, order, &aircraft.control)?;
    let search = GainSearch {
        aircraft,
        order,
        before: &before,
    };
    let (found, history) = search.run(progress)?;
    let found = match found {
        Some(gains) if gains == before.gains => before.clone(),
        Some(gains) => judge(aircraft, order, &gains)?,
        None => return Err(no_margins(&before, order)),
    };
    // Without margins the gains of the file are no choice.
    let changed = !before.has_margins || found.held_out_cost < before.held_out_cost;
    let after = if changed { found } else { before.clone() };
    Ok(TuneReport {
        schema: "plumage.tune/1",
        aircraft: aircraft.name.clone(),
        mechanism: aircraft.mechanism.clone(),
        seed: order.seed,
        candidates: order.candidates,
        required: order.required,
        changed,
        before,
        after,
        history,
    })
}

fn no_margins(before: &Judged, order: &TuneOrder) -> FdmError {
    let failing: Vec<String> = before
        .margins
        .iter()
        .filter(|m| !order.required.met_by(m))
        .map(|m| {
            format!(
                "{} at {:.1} m/s has {:.1} dB and {:.0}°",
                m.name, m.airspeed_m_s, m.gain_margin_db, m.phase_margin_deg
            )
        })
        .collect();
    FdmError::NoMargins {
        gain_db: order.required.gain_db,
        phase_deg: order.required.phase_deg,
        candidates: order.candidates,
        before: failing.join(", "),
    }
}

/// What a search needs to know.
struct GainSearch<'a> {
    aircraft: &'a Arc<Aircraft>,
    order: &'a TuneOrder,
    before: &'a Judged,
}

impl GainSearch<'_> {
    /// The best gains, if any have the margins, and the best cost after each candidate.
    fn run(
        &self,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<(Option<ControlGains>, Vec<f64>), FdmError> {
        let order = self.order;
        let mut best = self.start()?;
        let mut least = f64::INFINITY;
        let mut rng = ChaCha8Rng::seed_from_u64(order.seed);
        let mut history = Vec::with_capacity(order.candidates);
        for trial in 0..order.candidates {
            let done = trial as f64 / order.candidates.max(1) as f64;
            let spread = FIRST_SPREAD * (LAST_SPREAD / FIRST_SPREAD).powf(done);
            let mut gains = best.0;
            for gain in varied(&mut gains) {
                let step: f64 = StandardNormal.sample(&mut rng);
                if rng.random::<f64>() < VARIED_SHARE {
                    *gain = three_digits(*gain * (spread * step).exp());
                }
            }
            if let Some(cost) = self.better(&gains, best.1)? {
                best = (gains, cost);
            } else if best.1.is_infinite() {
                // Until some gains may be taken, those that lack least lead on.
                let lacking = self.lacking(&gains)?;
                if lacking < least {
                    (best.0, least) = (gains, lacking);
                }
            }
            history.push(best.1);
            progress(trial + 1, order.candidates);
        }
        Ok((best.1.is_finite().then_some(best.0), history))
    }

    /// Where the search begins: the gains of the file, or, where these lack margins, the cheaper
    /// of these and of the general ones, each slowed until it has them.
    fn start(&self) -> Result<(ControlGains, f64), FdmError> {
        let file = self.before.gains;
        if self.before.has_margins {
            return Ok((file, self.before.cost));
        }
        let mut general = file;
        let mut usual = ControlGains::default();
        for (gain, value) in varied(&mut general).into_iter().zip(varied(&mut usual)) {
            *gain = *value;
        }
        let mut best = (file, f64::INFINITY);
        for from in [file, general] {
            for step in 0..SLOWER_STEPS {
                let gains = slowed(&from, SLOWER.powi(step));
                if let Some(cost) = self.better(&gains, best.1)? {
                    best = (gains, cost);
                    break;
                }
            }
        }
        Ok(best)
    }

    /// How much margin gains lack, as shares of what is required; the outer loops count once the
    /// inner ones lack nothing.
    fn lacking(&self, gains: &ControlGains) -> Result<f64, FdmError> {
        let required = &self.order.required;
        let lack = |margins: &[LoopMargin]| -> f64 {
            let one = |m: &LoopMargin| {
                let gain = 1.0 - m.gain_margin_db / required.gain_db;
                let phase = 1.0 - m.phase_margin_deg / required.phase_deg;
                gain.max(0.0) + phase.max(0.0)
            };
            margins.iter().map(one).sum()
        };
        if gains.check().is_err() {
            return Ok(f64::INFINITY);
        }
        let inner = lack(&inner_margins(self.aircraft, gains)?);
        if inner > 0.0 {
            return Ok(INNER_FIRST + inner);
        }
        Ok(lack(&outer_loops::margins(self.aircraft, gains)?))
    }

    /// The cost of gains that may be taken and cost less than `than`.
    fn better(&self, gains: &ControlGains, than: f64) -> Result<Option<f64>, FdmError> {
        let (aircraft, order) = (self.aircraft, self.order);
        let kept = |margins: &[LoopMargin]| margins.iter().all(|m| order.required.met_by(m));
        if gains.check().is_err() || !kept(&inner_margins(aircraft, gains)?) {
            return Ok(None);
        }
        let cost = flights::cost(&flights::fly_all(aircraft, gains, &order.weather)?)
            + step_responses::cost(&step_responses::responses(aircraft, gains)?);
        let taken = cost < than
            && kept(&outer_loops::margins(aircraft, gains)?)
            && robustness::as_robust_as(
                &self.before.robustness,
                &order.required,
                aircraft,
                gains,
                &order.weather,
            )?;
        Ok(taken.then_some(cost))
    }
}

/// Margins of the inner loops between the slowest and the fastest flight.
fn inner_margins(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
) -> Result<Vec<LoopMargin>, FdmError> {
    let l = &aircraft.limits;
    let cruise = l.airspeed_cruise_m_s;
    let slow = l.airspeed_min_m_s + 0.25 * (cruise - l.airspeed_min_m_s);
    let fast = cruise + 0.5 * (l.airspeed_max_m_s - cruise);
    let mut out = Vec::new();
    for speed in [slow, cruise, fast] {
        out.extend(margins::inner_loops(aircraft, gains, speed)?);
    }
    Ok(out)
}

/// Everything about a set of gains.
fn judge(
    aircraft: &Arc<Aircraft>,
    order: &TuneOrder,
    gains: &ControlGains,
) -> Result<Judged, FdmError> {
    let flown = flights::fly_all(aircraft, gains, &order.weather)?;
    let held_out = flights::fly_all(aircraft, gains, &order.held_out)?;
    let mut margins = inner_margins(aircraft, gains)?;
    margins.extend(outer_loops::margins(aircraft, gains)?);
    let steps = step_responses::responses(aircraft, gains)?;
    let step_cost = step_responses::cost(&steps);
    Ok(Judged {
        gains: *gains,
        cost: flights::cost(&flown) + step_cost,
        held_out_cost: flights::cost(&held_out) + step_cost,
        step_cost,
        flights: flown,
        held_out,
        steps,
        has_margins: margins.iter().all(|m| order.required.met_by(m)),
        margins,
        robustness: robustness::judged(aircraft, gains, &order.weather)?,
    })
}
