//! Emission rates from measured concentrations.
//!
//! [`flux::estimate`] tries every method whose conditions the observations meet:
//!
//! - [`plume::curtain`]: the balance of mass of passes at several heights, without a model of the plume's spread;
//! - [`point`]: one sensor at rest with a wind logged beside it: a car parked downwind, a mast, a hovering drone;
//! - [`network`]: several sensors at rest;
//! - [`transects`]: passes across the plume, each by its plume integral; [`pass_rate`] those of a mission.
//!
//! [`tracer`] compares the gas with one that is released beside the source at a known rate. [`combine`] gives the mean of
//! several visits. Each estimate carries a 95 % interval, the terms that make it wide, and the part of the record that it
//! used; where a method's conditions are not met it is refused with the reason.
//!
//! Pure: no clock, file, socket, environment or random number.

mod clean_air;
pub mod combine;
pub mod flux;
mod grid;
pub mod network;
pub mod pass_rate;
pub mod point;
pub mod position;
mod profile;
mod sectors;
mod stations;
pub mod tracer;
mod tracks;
pub mod transects;
pub mod units;
mod vertical;
mod wander;

pub use tracks::{is_same_layer, samples, site};

use plume::curtain::{BETWEEN_PASSES_S, Pass, RejectedPass};

/// Standard deviation of ln wind speed: a calibrated anemometer, carried from its height to the plume's.
pub const LOGGED_SPEED_LN_SD: f64 = 0.05;
/// Standard deviation of ln wind speed where no row carries a wind of its own.
pub const SCENARIO_SPEED_LN_SD: f64 = 0.15;
/// A wind below this mean speed, m/s, carries no plume in one direction: the threshold of calms for dispersion models (US EPA
/// 2000, EPA-454/R-99-005).
const CALM_M_S: f64 = 0.5;
/// Half width of the central 95 % interval of a normal quantity, in standard deviations: Φ⁻¹(0.975).
pub const SD_95: f64 = 1.959_964;

/// Median: of an even number the mean of the middle two; none of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let (last, n) = (values.len().checked_sub(1)?, values.len());
    Some(f64::midpoint(values[last / 2], values[n / 2]))
}

/// A positive quantity with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Interval {
    /// Median.
    pub value: f64,
    /// Half of the width of the central 68 % interval.
    pub sd: f64,
    /// 2.5 % quantile.
    pub low95: f64,
    /// 97.5 % quantile.
    pub high95: f64,
}

impl Interval {
    /// That of a quantity whose logarithm is normal about ln `value`.
    pub fn of_ln_normal(value: f64, ln_sd: f64) -> Self {
        let at = |sds: f64| value * (sds * ln_sd).exp();
        Self {
            value,
            sd: 0.5 * (at(1.0) - at(-1.0)),
            low95: at(-SD_95),
            high95: at(SD_95),
        }
    }

    /// That of a positive quantity of which mean and standard deviation are known.
    pub fn of_mean(value: f64, sd: f64) -> Self {
        Self::of_ln_normal(value, (sd / value).powi(2).ln_1p().sqrt())
    }

    /// The standard deviation over the value of which [`Self::of_mean`] makes an interval as wide.
    pub fn relative_sd(&self) -> f64 {
        self.ln_sd().powi(2).exp_m1().sqrt()
    }

    /// Standard deviation of its logarithm, by its 95 % interval.
    pub fn ln_sd(&self) -> f64 {
        (self.high95 / self.low95).ln() / (2.0 * SD_95)
    }
}

/// What makes an interval wide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Term {
    /// The speed of the wind.
    WindSpeed,
    /// The direction of the wind.
    WindDirection,
    /// Where the source stands.
    SourcePosition,
    /// The spread of the plume.
    Dispersion,
    /// The height of source and sensor, and what flows above and below the passes.
    Height,
    /// The mole fraction of clean air.
    Background,
    /// The gain of the sensor.
    Sensor,
    /// Turbulence: the record holds few independent passes of the plume.
    Turbulence,
    /// What was measured differs from what is asked for.
    Representativeness,
}

/// The share of one term in the variance of ln rate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Share {
    /// The term.
    pub term: Term,
    /// Its share, 0 to 1.
    pub share: f64,
}

/// Shares of variances of ln rate, the largest first.
pub fn budget(terms: &[(Term, f64)]) -> Vec<Share> {
    let all: f64 = terms.iter().map(|t| t.1).sum();
    let mut shares: Vec<Share> = terms
        .iter()
        .filter(|(_, variance)| *variance > 0.0)
        .map(|&(term, variance)| Share {
            term,
            share: variance / all,
        })
        .collect();
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    shares
}

/// The rate of a source by one method, or an upper limit, and what it rests on.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlumeFlux {
    /// The rate, kg/s; none where the plume was not met.
    pub kg_s: Option<Interval>,
    /// What the rate is below at 95 %, kg/s, where the plume was not met.
    pub upper_limit_kg_s: Option<f64>,
    /// Shares of the variance of ln rate, largest first; empty for an upper limit.
    pub budget: Vec<Share>,
    /// Mean distance from source to sensor, m.
    pub distance_m: f64,
    /// Direction from which the plume came, degrees in the frame of the wind vane.
    pub from_deg: f64,
    /// One standard deviation of that, degrees, where the method estimates it.
    pub from_sd_deg: Option<f64>,
    /// Mean wind speed, m/s.
    pub speed_m_s: f64,
    /// Medians with the next less and the next more stable class, kg/s; none beyond A and F, and for an upper limit.
    pub one_class_off_kg_s: [Option<f64>; 2],
    /// The passes, in order of time.
    pub passes: Vec<PassFlux>,
    /// What a reader should know beside the number.
    pub notes: Vec<String>,
}

impl PlumeFlux {
    /// States the rate whose logarithm has these values and weights, kg/s. The variances `inside` are in them; those
    /// `beside` come from independent terms, which widen them.
    pub(crate) fn state(
        &mut self,
        ln_kg_s: Vec<(f64, f64)>,
        inside: &[(Term, f64)],
        beside: &[(Term, f64)],
    ) -> Interval {
        let extra_sd = beside.iter().map(|t| t.1).sum::<f64>().sqrt();
        self.budget = budget(&[inside, beside].concat());
        *self.kg_s.insert(grid::interval(ln_kg_s, extra_sd))
    }
}

/// A pass of the plume.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PassFlux {
    /// Its first sample, s.
    pub from_s: f64,
    /// Its last sample, s.
    pub to_s: f64,
    /// Rate by this pass alone, or the part of a curtain's rate that it stands for, kg/s.
    pub kg_s: Option<f64>,
    /// Mean distance from the source, m.
    pub distance_m: f64,
    /// Whether the estimate uses it.
    pub used: bool,
    /// Why not.
    pub reason: Option<String>,
}

impl PassFlux {
    /// A pass with its own rate; with a reason it is not used.
    pub(crate) fn of(pass: &Pass, kg_s: Option<f64>, reason: Option<&str>) -> Self {
        Self {
            from_s: pass.time_s[0],
            to_s: pass.time_s[1],
            kg_s,
            distance_m: pass.distance_m,
            used: reason.is_none(),
            reason: reason.map(str::to_owned),
        }
    }

    /// Passes and ways across the wind that are no passes, but for pieces of turns, in order of time.
    pub(crate) fn in_order(
        passes: impl Iterator<Item = Self>,
        rejected: &[RejectedPass],
    ) -> Vec<Self> {
        let rejected = rejected
            .iter()
            .filter(|p| p.time_s[1] - p.time_s[0] >= BETWEEN_PASSES_S)
            .map(|pass| Self {
                from_s: pass.time_s[0],
                to_s: pass.time_s[1],
                kg_s: None,
                distance_m: pass.distance_m,
                used: false,
                reason: Some(pass.reason.to_owned()),
            });
        let mut all: Vec<Self> = passes.chain(rejected).collect();
        all.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        all
    }
}

/// Standard deviation of ln gain of the sensor that reads the scenario's gas.
pub(crate) fn gain_ln_sd(scenario: &scenario::Scenario) -> f64 {
    let sensor = scenario.sensor();
    sensor.gain_sd / sensor.gain
}

/// Refuses a mean wind that carries no plume.
///
/// # Errors
/// [`StudyError::Refused`] below 0.5 m/s.
pub fn not_calm(mean_speed_m_s: f64) -> Result<(), StudyError> {
    if mean_speed_m_s < CALM_M_S {
        return Err(StudyError::Refused(format!(
            "the mean wind is {mean_speed_m_s:.2} m/s; expected {CALM_M_S} m/s or more"
        )));
    }
    Ok(())
}

/// Why a method gives no rate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// The observations do not meet the method's conditions.
    #[error("{0}")]
    Refused(String),
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
}
