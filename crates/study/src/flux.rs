//! The rate of a source by every method whose conditions the observations meet.

use crate::point::{self, PointFlux};
use crate::{Interval, Share, StudyError, Term};
use air::geo::Geodetic;
use air::wind::WindVector;
use plume::curtain::{Sample, Site, mass_balance};
use plume::{Gas, Place};
use scenario::Scenario;
use scenario::observations::{ObservationRow, Observations, checks};
use serde::Serialize;
use statrs::function::erf::erfc;

/// Standard deviation of ln wind speed where the passes carry no wind of their own and the scenario states none.
const SCENARIO_SPEED_LN_SD: f64 = 0.15;
/// The same of a logged wind.
const LOGGED_SPEED_LN_SD: f64 = 0.05;

/// A way to estimate a rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// One sensor at rest with a wind beside it ([`crate::point`]).
    Point,
    /// The balance of mass of passes at several heights ([`plume::curtain`]).
    Curtain,
}

impl Method {
    /// All methods, in the order in which they are preferred: a method without a model of the plume's spread first.
    pub const ALL: [Self; 2] = [Self::Curtain, Self::Point];
}

/// The wind of an estimate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Wind {
    /// Where it comes from: `logged` or `scenario`.
    pub treatment: &'static str,
    /// Mean speed, m/s.
    pub speed_m_s: f64,
    /// Mean direction from which it blows, degrees.
    pub from_deg: f64,
}

/// The stability of an estimate, and what it would be in the neighbouring classes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StabilityUsed {
    /// The class.
    pub value: char,
    /// Who states it.
    pub by: &'static str,
    /// Rate in the next less stable class, kg/s.
    pub if_one_class_down: Option<f64>,
    /// Rate in the next more stable class, kg/s.
    pub if_one_class_up: Option<f64>,
}

/// The rate of a source by one method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SourceFlux {
    /// The source.
    pub name: String,
    /// Its gas.
    pub gas: Gas,
    /// The method.
    pub method: Method,
    /// The rate, kg/s.
    pub kg_s: Option<Interval>,
    /// What the rate is below at 95 %, kg/s, where the plume was not met. Exactly one of both is set.
    pub upper_limit_kg_s: Option<f64>,
    /// Shares of the variance of ln rate.
    pub budget: Vec<Share>,
    /// The wind.
    pub wind: Wind,
    /// The stability; none where the method needs none.
    pub stability: Option<StabilityUsed>,
    /// Mean distance of the readings from the source, m.
    pub distance_m: f64,
    /// What a reader should know beside the number.
    pub notes: Vec<String>,
}

impl SourceFlux {
    /// Probability of a difference of ln rate as large as that from `other`, if both estimate the same rate and err
    /// independently; none where one of them gives no rate.
    pub fn agreement_p(&self, other: &Self) -> Option<f64> {
        let (own, other) = (self.kg_s?, other.kg_s?);
        let variance = (own.sd / own.value).powi(2) + (other.sd / other.value).powi(2);
        let z = (own.value / other.value).ln().abs() / variance.sqrt();
        Some(erfc(z / std::f64::consts::SQRT_2))
    }
}

/// A method that gives no rate, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refusal {
    /// The method.
    pub method: Method,
    /// The condition that is not met.
    pub reason: String,
}

/// What all methods give.
#[derive(Debug, Clone, PartialEq)]
pub struct Fluxes {
    /// Estimates, the preferred first.
    pub estimates: Vec<SourceFlux>,
    /// Methods that give none.
    pub refused: Vec<Refusal>,
}

/// Tries `methods` in their order.
///
/// # Errors
/// A scenario that describes no world.
pub fn estimate(
    scenario: &Scenario,
    observations: &Observations,
    methods: &[Method],
) -> Result<Fluxes, StudyError> {
    let mut out = Fluxes {
        estimates: Vec::new(),
        refused: Vec::new(),
    };
    for &method in methods {
        let by_method = match method {
            Method::Point => by_point(scenario, observations),
            Method::Curtain => by_curtain(scenario, observations),
        };
        match by_method {
            Ok(flux) => out.estimates.push(flux),
            Err(StudyError::Refused(reason)) => out.refused.push(Refusal { method, reason }),
            Err(other) => return Err(other),
        }
    }
    Ok(out)
}

fn by_point(scenario: &Scenario, observations: &Observations) -> Result<SourceFlux, StudyError> {
    let PointFlux {
        kg_s,
        upper_limit_kg_s,
        budget,
        distance_m,
        from_deg,
        speed_m_s,
        one_class_off_kg_s: [if_one_class_down, if_one_class_up],
        notes,
        ..
    } = point::estimate(scenario, observations)?;
    Ok(SourceFlux {
        name: scenario.sources[0].name.clone(),
        gas: scenario.gas(),
        method: Method::Point,
        kg_s,
        upper_limit_kg_s,
        budget,
        wind: Wind {
            treatment: "logged",
            speed_m_s,
            from_deg,
        },
        stability: Some(StabilityUsed {
            value: scenario.weather.stability.letter(),
            by: "scenario",
            if_one_class_down,
            if_one_class_up,
        }),
        distance_m,
        notes,
    })
}

fn by_curtain(scenario: &Scenario, observations: &Observations) -> Result<SourceFlux, StudyError> {
    let spec = scenario.dispersion_spec()?;
    let frame = scenario.frame()?;
    let checked = checks::check(observations, &spec, &frame).observations;
    let site = Site {
        source: spec.sources[0].place,
        ground_amsl_m: spec.ground_amsl_m,
        gas: spec.sources[0].gas,
        atmosphere: spec.atmosphere,
    };
    let sample = |row: &ObservationRow| {
        let at = Geodetic {
            lat_deg: row.lat_deg,
            lon_deg: row.lon_deg,
        };
        let place = Place::from_geodetic(&frame, at, row.alt_amsl_m);
        let of_a_place = row.averaging_s.is_none() && row.line_end.is_none();
        row.co2_ppm.filter(|_| of_a_place).map(|ppm| Sample {
            platform: row.platform,
            time_s: row.time_s,
            place,
            ppm,
        })
    };
    let mut samples: Vec<Sample> = checked.rows.iter().filter_map(sample).collect();
    samples.sort_by_key(|s| s.platform);
    let logged = mean_wind(&checked);
    let wind = |height_agl_m: f64| logged.unwrap_or_else(|| spec.wind.at(height_agl_m));
    let Some(found) = mass_balance(&samples, &site, &wind) else {
        return Err(StudyError::Refused(
            "no curtain: expected passes across the wind at three heights at least, at about one distance, with the plume between their ends".into(),
        ));
    };
    let speed_ln_sd = match logged {
        Some(_) => LOGGED_SPEED_LN_SD,
        None => SCENARIO_SPEED_LN_SD,
    };
    let passes_ln_sd = (found.sd_kg_s / found.kg_s).powi(2).ln_1p().sqrt();
    let there = logged.unwrap_or_else(|| spec.wind.at(spec.sources[0].effective_height_agl_m));
    let all = passes_ln_sd.powi(2) + speed_ln_sd.powi(2);
    Ok(SourceFlux {
        name: scenario
            .sources
            .iter()
            .map(|s| s.name.as_str())
            .collect::<Vec<_>>()
            .join(" + "),
        gas: scenario.gas(),
        method: Method::Curtain,
        kg_s: Some(Interval::of_ln_normal(found.kg_s, all.sqrt())),
        upper_limit_kg_s: None,
        budget: vec![
            Share {
                term: Term::Turbulence,
                share: passes_ln_sd.powi(2) / all,
            },
            Share {
                term: Term::WindSpeed,
                share: speed_ln_sd.powi(2) / all,
            },
        ],
        wind: Wind {
            treatment: if logged.is_some() {
                "logged"
            } else {
                "scenario"
            },
            speed_m_s: there.speed_m_s(),
            from_deg: there.from_deg(),
        },
        stability: None,
        distance_m: found.distance_m,
        notes: vec![format!(
            "{} passes at {} heights",
            found.passes, found.levels
        )],
    })
}

/// Mean of the logged winds as a vector; none where no row has one.
fn mean_wind(observations: &Observations) -> Option<WindVector> {
    let winds = observations.rows.iter().filter_map(|row| {
        Some(WindVector::from_speed_and_direction(
            row.wind_speed_m_s?,
            row.wind_from_deg?,
        ))
    });
    let (mut sum, mut count) = (WindVector::default(), 0.0);
    for wind in winds {
        sum.east_m_s += wind.east_m_s;
        sum.north_m_s += wind.north_m_s;
        count += 1.0;
    }
    (count > 0.0).then(|| WindVector {
        east_m_s: sum.east_m_s / count,
        north_m_s: sum.north_m_s / count,
    })
}
