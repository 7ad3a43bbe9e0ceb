//! Emission rates from observations, as `flux.json` states them.

use crate::TaskError;
use air::geo::{Enu, Geodetic};
use mission::Setup;
use plume::{DispersionModel, Gas};
use protocol::digest::sha256_hex;
use protocol::message::Estimate;
use scenario::Scenario;
use scenario::observations::Observations;
use scenario::uncertain::Uncertain;
use serde::{Deserialize, Serialize};
use serde_json::json;
use study::combine::{SourceMean, Visit, site_mean};
pub use study::flux::Method;
use study::flux::{self, Conclusion, Fluxes, Refusal, SourceFlux, Wind};
use study::{Interval, Share, StudyError, Term};
use ws::calibration::offline::{self, OfflineCalibration};

mod sheet;

pub use sheet::Sheet;

/// Name and version of the document.
pub const SCHEMA: &str = "plumage.flux/1";
/// Standard deviation of the stated emission in a fit, as a part of it: about nothing is known beforehand.
const STRENGTH_SD: f64 = 3.0;
/// A fit is repeated with a stated emission that is so many times as large.
const STRONGER: f64 = 4.0;
/// The readings say more of a rate than the scenario does where the stated emission has less than half of the weight.
const MOST_PULL: f64 = 0.5;

/// A file that was read, for the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Input {
    /// Its name.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Its rows below the header.
    pub rows: usize,
}

impl Input {
    /// The record of a file with these bytes.
    pub fn new(file: String, bytes: &[u8]) -> Self {
        let lines = bytes.iter().filter(|b| **b == b'\n').count();
        Self {
            file,
            sha256: sha256_hex(bytes),
            rows: lines.saturating_sub(1),
        }
    }
}

/// Rates by every method whose conditions are met.
#[derive(Debug, Clone)]
pub struct FluxReport {
    /// The answer; none where no method applies.
    pub conclusion: Option<Conclusion>,
    /// Methods that give none, and why.
    pub refused: Vec<Refusal>,
    /// The files.
    pub inputs: Vec<Input>,
    /// The text of `flux.json`.
    pub json: String,
}

/// A gas that is released beside the source.
#[derive(Debug, Clone)]
pub struct Tracer {
    /// Its readings.
    pub observations: Observations,
    /// Its rate, kg/s.
    pub kg_s: f64,
}

/// Estimates the rate of the scenario's source from `observations`, which were read from `inputs`, by `methods` and, if
/// given, by the `tracer`.
///
/// # Errors
/// A scenario that describes no world.
pub fn of(
    setup: &Setup,
    observations: &Observations,
    methods: &[Method],
    tracer: Option<&Tracer>,
    inputs: Vec<Input>,
) -> Result<FluxReport, TaskError> {
    let scenario = &setup.scenario;
    let mut fluxes = flux::estimate(scenario, observations, methods)
        .map_err(|e| TaskError::Argument(e.to_string()))?;
    if methods.contains(&Method::Inversion) {
        by_fit(setup, observations, methods.len() == 1, &mut fluxes)?;
    }
    if let Some(tracer) = tracer {
        by_tracer(setup, observations, tracer, &mut fluxes);
    }
    let conclusion = fluxes.conclude();
    let sources: Vec<serde_json::Value> = conclusion
        .iter()
        .map(|c| entry(c, &fluxes.refused))
        .collect();
    let document = json!({
        "schema": SCHEMA,
        "version": env!("CARGO_PKG_VERSION"),
        "inputs": inputs,
        "sources": sources,
        "refused": fluxes.refused,
    });
    Ok(FluxReport {
        conclusion,
        refused: fluxes.refused,
        inputs,
        json: format!("{document:#}\n"),
    })
}

fn entry(conclusion: &Conclusion, refused: &[Refusal]) -> serde_json::Value {
    let mut entry = json!(conclusion.headline);
    entry["alternatives"] = json!(conclusion.alternatives);
    entry["agreement_p"] = json!(conclusion.agreement_p);
    entry["refused"] = json!(refused);
    entry
}

/// The fit of the whole model, of platforms that move, or of any if `asked` for.
fn by_fit(
    setup: &Setup,
    observations: &Observations,
    asked: bool,
    fluxes: &mut Fluxes,
) -> Result<(), TaskError> {
    let applies = |m: Method| fluxes.estimates.iter().any(|e| e.method == m);
    // The plume integrals of the passes are the inversion.
    if applies(Method::Inversion) {
        return Ok(());
    }
    if !asked && (applies(Method::Point) || applies(Method::Network)) {
        let reason =
            "the sensors are at rest; --method inversion fits the whole model all the same";
        // The passes' own refusal says less.
        fluxes.refused.retain(|r| r.method != Method::Inversion);
        fluxes.refused.push(Refusal {
            method: Method::Inversion,
            reason: reason.to_owned(),
        });
        return Ok(());
    }
    if let Some(Err(calm)) = logged_wind(observations).map(study::not_calm) {
        refuse_fit(fluxes, calm.to_string());
        return Ok(());
    }
    let setup = &stating(setup, 1.0);
    match fit(setup, observations).and_then(|found| without_pull(setup, observations, found)) {
        Ok(Some((kg_s, pull))) if pull <= MOST_PULL => {
            fluxes.refused.retain(|r| r.method != Method::Inversion);
            fluxes.estimates.push(fitted(setup, observations, (kg_s, pull)));
        }
        Ok(Some(_)) => refuse_fit(
            fluxes,
            "the readings do not determine the rate: the fit of the whole model follows the emission that the scenario states".to_owned(),
        ),
        Ok(None) => refuse_fit(fluxes, "the fit finds no plume in the readings".to_owned()),
        Err(TaskError::World(error)) => return Err(error.into()),
        Err(error) => refuse_fit(fluxes, error.to_string()),
    }
    Ok(())
}

/// The rate by a fit of the whole model; none where the fit knows nothing of it.
fn fit(setup: &Setup, observations: &Observations) -> Result<Option<Interval>, TaskError> {
    let found = offline::calibrate_in(&setup.scenario, &setup.classes, observations, None)?;
    Ok(emission(setup, observations, &found))
}

/// A fit draws its rate towards the emission that the scenario states. A second fit, with a stated emission that is
/// [`STRONGER`] times as large, shows by how much; the rate without it, and the pull as a part (0: the readings alone
/// determine the rate; 1: they say nothing). None where either fit gives no rate.
fn without_pull(
    setup: &Setup,
    observations: &Observations,
    found: Option<Interval>,
) -> Result<Option<(Interval, f64)>, TaskError> {
    let Some(found) = found else { return Ok(None) };
    let Some(stronger) = fit(&stating(setup, STRONGER), observations)? else {
        return Ok(None);
    };
    let spec = setup.scenario.dispersion_spec()?;
    let stated = DispersionModel::new(spec).map_err(|e| TaskError::Argument(e.to_string()))?;
    let stated_kg_s = stated.emissions_kg_s().first().map_or(f64::NAN, |e| e.1);
    let pull = (stronger.value / found.value).ln() / STRONGER.ln();
    if !(pull.abs() <= MOST_PULL && stated_kg_s > 0.0) {
        return Ok(Some((found, f64::INFINITY)));
    }
    let pull = pull.max(0.0);
    // The rate is a mean of the stated one, with the weight of the pull, and of what the readings say.
    let of_readings = (found.value.ln() - pull * stated_kg_s.ln()) / (1.0 - pull);
    let ln_sd = found.ln_sd() / (1.0 - pull).sqrt();
    Ok(Some((
        Interval::of_ln_normal(of_readings.exp(), ln_sd),
        pull,
    )))
}

/// The scenario with sources so many times as strong, and hardly known beforehand.
fn stating(setup: &Setup, factor: f64) -> Setup {
    let mut changed = setup.clone();
    for source in &mut changed.scenario.sources {
        source.emission_kg_s = source.emission_kg_s.map(|q| factor * q);
        source.c_max_ppm = source.c_max_ppm.map(|c| factor * c);
    }
    let first = &changed.scenario.sources[0];
    let strengths = [
        (Uncertain::Emission, first.emission_kg_s),
        (Uncertain::CMax, first.c_max_ppm),
    ];
    for (key, value) in strengths {
        if let Some(value) = value {
            let key = key.key(setup.scenario.gas());
            changed.scenario.uncertain.insert(key, STRENGTH_SD * value);
        }
    }
    changed
}

fn refuse_fit(fluxes: &mut Fluxes, reason: String) {
    fluxes.refused.push(Refusal {
        method: Method::Inversion,
        reason,
    });
}

fn fitted(setup: &Setup, observations: &Observations, (kg_s, pull): (Interval, f64)) -> SourceFlux {
    let scenario = &setup.scenario;
    let wind = logged_wind(observations);
    let distance_m = distance_m(scenario, observations);
    let terms = terms_of_fit(setup, observations, (kg_s, pull), distance_m);
    let ln_sd = terms.iter().map(|t| t.1).sum::<f64>().sqrt();
    SourceFlux {
        name: scenario.sources[0].name.clone(),
        gas: scenario.gas(),
        method: Method::Inversion,
        kg_s: Some(Interval::of_ln_normal(kg_s.value, ln_sd)),
        upper_limit_kg_s: None,
        budget: study::budget(&terms),
        wind: Some(Wind {
            treatment: if wind.is_some() { "logged" } else { "scenario" },
            speed_m_s: wind.unwrap_or(scenario.weather.wind_speed_m_s),
            from_deg: scenario.weather.wind_from_deg,
            sd_deg: None,
        }),
        stability: None,
        distance_m,
        passes: Vec::new(),
        notes: vec!["fit of the whole model, as of plumage calibrate".to_owned()],
    }
}

/// Variances of ln rate: those of the wind and of the source's position are known; the fit does not part the rest.
fn terms_of_fit(
    setup: &Setup,
    observations: &Observations,
    (kg_s, pull): (Interval, f64),
    distance_m: f64,
) -> [(Term, f64); 3] {
    let all = kg_s.ln_sd().powi(2);
    let wind = reference_speed(&setup.scenario, observations);
    let speed = (wind.sd / wind.value).powi(2).min(all);
    let sd_m = setup.scenario.sources[0].position_sd_m;
    let position = study::position::variance(sd_m, distance_m, &|displaced| {
        let moved = displaced_source(setup, displaced);
        // As far as the fit goes for a source that is displaced; else it changes in proportion to the distance.
        match fit(&moved, observations) {
            Ok(Some(there)) => there.value.ln() / (1.0 - pull),
            _ => f64::NAN,
        }
    });
    let position = if position.is_finite() {
        position
    } else {
        (sd_m / distance_m).powi(2)
    };
    [
        (Term::Dispersion, all - speed),
        (Term::WindSpeed, speed),
        (Term::SourcePosition, position),
    ]
}

/// The scenario with its first source so many metres east and north.
fn displaced_source(setup: &Setup, [east_m, north_m]: [f64; 2]) -> Setup {
    let mut moved = setup.clone();
    let Ok(frame) = setup.scenario.frame() else {
        return moved;
    };
    let source = &mut moved.scenario.sources[0];
    let at = frame.to_enu(Geodetic {
        lat_deg: source.lat_deg,
        lon_deg: source.lon_deg,
    });
    let there = frame.to_geodetic(Enu::new(at.east_m + east_m, at.north_m + north_m));
    (source.lat_deg, source.lon_deg) = (there.lat_deg, there.lon_deg);
    moved
}

/// Mean distance of the readings from the first source, m.
fn distance_m(scenario: &Scenario, observations: &Observations) -> f64 {
    let Ok(frame) = scenario.frame() else {
        return 0.0;
    };
    let at = |lat_deg, lon_deg| frame.to_enu(Geodetic { lat_deg, lon_deg });
    let source = at(scenario.sources[0].lat_deg, scenario.sources[0].lon_deg);
    let read = observations.rows.iter().filter(|r| r.co2_ppm.is_some());
    let distances: Vec<f64> = read
        .map(|r| source.distance_m(at(r.lat_deg, r.lon_deg)))
        .collect();
    distances.iter().sum::<f64>() / distances.len() as f64
}

/// Mean speed of the logged winds, m/s.
fn logged_wind(observations: &Observations) -> Option<f64> {
    let speeds: Vec<f64> = observations
        .rows
        .iter()
        .filter_map(|r| r.wind_speed_m_s)
        .collect();
    let n = speeds.len() as f64;
    (!speeds.is_empty()).then(|| speeds.iter().sum::<f64>() / n)
}

/// The wind's speed at the scenario's reference height: as logged, brought there by the scenario's profile, or as the
/// scenario states it.
fn reference_speed(scenario: &Scenario, observations: &Observations) -> Estimate {
    let stated_m_s = scenario.weather.wind_speed_m_s;
    let profile = scenario.wind_profile().ok();
    let logged = observations.rows.iter().filter_map(|row| {
        let height_agl_m = row.alt_amsl_m - scenario.site.ground_amsl_m;
        Some((
            row.wind_speed_m_s?,
            profile.as_ref()?.speed_at_m_s(height_agl_m),
        ))
    });
    // A ratio of sums: rows at the ground, where the profile is almost still, weigh little.
    let [logged_m_s, expected_m_s] = logged.fold([0.0; 2], |[a, b], (c, d)| [a + c, b + d]);
    let (value, ln_sd) = if expected_m_s > 0.0 {
        let value = stated_m_s * logged_m_s / expected_m_s;
        (value, study::LOGGED_SPEED_LN_SD)
    } else {
        let sd = scenario.prior_sd(Uncertain::WindSpeed);
        let ln_sd = sd.map_or(study::SCENARIO_SPEED_LN_SD, |sd| sd / stated_m_s);
        (stated_m_s, ln_sd)
    };
    Estimate {
        value,
        sd: value * ln_sd,
    }
}

/// What the first source emits, by a calibrated model; none where the fit knows nothing of it.
pub(crate) fn emission(
    setup: &Setup,
    observations: &Observations,
    found: &OfflineCalibration,
) -> Option<Interval> {
    let wind = reference_speed(&setup.scenario, observations);
    let (_, kg_s) = found.calibrator.flux(wind).into_iter().next()?;
    let is_known = kg_s.value > 0.0 && kg_s.sd > 0.0 && kg_s.sd.is_finite();
    is_known.then(|| Interval::of_mean(kg_s.value, kg_s.sd))
}

fn by_tracer(setup: &Setup, observations: &Observations, tracer: &Tracer, fluxes: &mut Fluxes) {
    let by = (&tracer.observations, tracer.kg_s);
    let scenario = &setup.scenario;
    match study::tracer::estimate(scenario, observations, by) {
        Ok(found) => {
            let estimate = SourceFlux {
                name: scenario.sources[0].name.clone(),
                gas: observations.gas,
                method: Method::Tracer,
                kg_s: Some(found.kg_s),
                upper_limit_kg_s: None,
                budget: found.budget,
                wind: None,
                stability: None,
                distance_m: 0.0,
                passes: Vec::new(),
                notes: vec![format!(
                    "ratio to {} over {} minutes, correlation {:.2}",
                    tracer.observations.gas.formula(),
                    found.blocks,
                    found.correlation
                )],
            };
            // The best method there is.
            fluxes.estimates.insert(0, estimate);
        }
        Err(StudyError::Refused(reason)) => fluxes.refused.push(Refusal {
            method: Method::Tracer,
            reason,
        }),
        Err(StudyError::World(error)) => fluxes.refused.push(Refusal {
            method: Method::Tracer,
            reason: error.to_string(),
        }),
    }
}

/// A `flux.json` as a visit.
#[derive(Debug, Deserialize)]
struct Read {
    schema: String,
    sources: Vec<ReadSource>,
}

#[derive(Debug, Deserialize)]
struct ReadSource {
    name: String,
    gas: Gas,
    kg_s: Option<Interval>,
    upper_limit_kg_s: Option<f64>,
    #[serde(default)]
    budget: Vec<Share>,
}

/// The visits to a source.
#[derive(Default)]
struct Visited {
    name: String,
    gas: Gas,
    visits: Vec<(String, Visit)>,
    notes: Vec<String>,
}

/// The means over visits, and the text of `flux.json`.
#[derive(Debug, Clone)]
pub struct CombinedReport {
    /// One entry a source and gas.
    pub sources: Vec<SourceMean>,
    /// The text of `flux.json`.
    pub json: String,
}

/// Combines the `flux.json` files of several visits, each with its text.
///
/// # Errors
/// A text that is no `flux.json`, or visits without a source in common.
pub fn combine(files: &[(String, String)]) -> Result<CombinedReport, TaskError> {
    let mut visited: Vec<Visited> = Vec::new();
    let mut inputs = Vec::new();
    for (file, text) in files {
        let read: Read = serde_json::from_str(text)
            .map_err(|e| TaskError::Argument(format!("{file}: expected a flux.json: {e}")))?;
        if read.schema != SCHEMA {
            return Err(TaskError::Argument(format!(
                "{file}: schema {}; expected {SCHEMA}",
                read.schema
            )));
        }
        inputs.push(json!({
            "file": file,
            "sha256": sha256_hex(text.as_bytes()),
            "rows": read.sources.len(),
        }));
        for source in read.sources {
            let at = visited
                .iter()
                .position(|v| v.name == source.name && v.gas == source.gas);
            let at = at.unwrap_or_else(|| {
                visited.push(Visited {
                    name: source.name.clone(),
                    gas: source.gas,
                    ..Visited::default()
                });
                visited.len() - 1
            });
            let slot = &mut visited[at];
            match (source.kg_s, source.upper_limit_kg_s) {
                (Some(kg_s), _) => {
                    let budget = source.budget;
                    slot.visits.push((file.clone(), Visit { kg_s, budget }));
                }
                (None, Some(limit)) => {
                    // A rate anywhere between nothing and the limit: its mean, and the standard deviation of a uniform quantity.
                    let visit = Visit {
                        kg_s: Interval::of_mean(0.5 * limit, limit / 12f64.sqrt()),
                        budget: Vec::new(),
                    };
                    slot.visits.push((file.clone(), visit));
                    slot.notes.push(format!(
                        "{file} gives an upper limit, and counts as half of it"
                    ));
                }
                (None, None) => {}
            }
        }
    }
    let sources: Vec<SourceMean> = visited
        .into_iter()
        .filter_map(|of| {
            let Visited {
                name,
                gas,
                visits,
                notes,
            } = of;
            let rates: Vec<Visit> = visits.iter().map(|(_, visit)| visit.clone()).collect();
            let mean = site_mean(&rates)?;
            Some(SourceMean {
                name,
                gas,
                mean,
                visits,
                notes,
            })
        })
        .collect();
    if sources.is_empty() {
        return Err(TaskError::Argument(
            "the files state no rate and no upper limit; expected flux.json files with sources"
                .to_owned(),
        ));
    }
    let entries: Vec<serde_json::Value> = sources
        .iter()
        .map(|s| {
            let mut notes = vec![format!("mean of {} visits", s.visits.len())];
            notes.extend(s.notes.iter().cloned());
            json!({
                "name": s.name,
                "gas": s.gas,
                "method": Method::Combined,
                "kg_s": s.mean.kg_s,
                "upper_limit_kg_s": null,
                "budget": s.mean.budget,
                "wind": null,
                "stability": null,
                "passes": [],
                "notes": notes,
                "alternatives": [],
                "agreement_p": s.mean.agreement_p,
                "refused": [],
            })
        })
        .collect();
    let document = json!({
        "schema": SCHEMA,
        "version": env!("CARGO_PKG_VERSION"),
        "inputs": inputs,
        "sources": entries,
        "refused": [],
    });
    Ok(CombinedReport {
        sources,
        json: format!("{document:#}\n"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logged_wind_counts_at_the_reference_height() {
        let scenario = "[site]\nlat_deg = 43.0\nlon_deg = -7.0\nground_amsl_m = 300.0\n[weather]\nwind_speed_m_s = 7.0\n\
            wind_height_agl_m = 10.0\nwind_exponent = 0.15\n[[source]]\nlat_deg = 43.0\nlon_deg = -7.0\nemission_kg_s = 1.0\n";
        let scenario = Scenario::parse("s.toml", scenario).unwrap();
        let speed = |wind: &str| {
            let text = format!(
                "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,wind_speed_m_s,wind_from_deg\n\
                 0,a,43,-7,400,420,{wind}\n1,a,43,-7,400,420,{wind}\n"
            );
            let rows = scenario::observations::parse(&[("o.csv", &text)], Gas::Co2).unwrap();
            reference_speed(&scenario, &rows)
        };
        // The power law: u(10 m) = u(100 m) (10 / 100)^0.15.
        let logged = speed("5,270");
        assert!(
            (logged.value - 5.0 * 0.1f64.powf(0.15)).abs() < 1e-9,
            "{logged:?}"
        );
        assert!((logged.sd / logged.value - 0.05).abs() < 1e-12);
        let stated = speed(",");
        assert!(stated.value == 7.0 && (stated.sd / 7.0 - 0.15).abs() < 1e-12);
    }
}
