//! The rate of a source by every method whose conditions the observations meet, and the conclusion from all.

use crate::combine::{AGREEMENT_P, agreement_p, of_one_record};
use crate::tracks::{ALWAYS, Winds, mean_height_agl_m, samples, site};
use crate::{
    Interval, PassFlux, PlumeFlux, Share, StudyError, Term, budget, gain_ln_sd, network, not_calm,
    point, transects,
};
use plume::Gas;
use plume::curtain::{CleanAir, Curtain, Pass, RejectedPass, curtain, passes};
use scenario::Scenario;
use scenario::observations::{Observations, checks};
use serde::Serialize;

/// Of what lies beyond the lowest and highest pass as much is not known, one standard deviation, as in
/// [`plume::curtain`].
const EDGE_SD: f64 = 0.5;

/// A way to estimate a rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The balance of mass of passes at several heights ([`plume::curtain`]).
    Curtain,
    /// Several sensors at rest ([`crate::network`]).
    Network,
    /// One sensor at rest with a wind beside it ([`crate::point`]).
    Point,
    /// Tracks: plume integrals of passes at one height ([`crate::transects`]), or the fit of the whole model.
    Inversion,
    /// The ratio to a gas that is released beside the source ([`crate::tracer`]).
    Tracer,
    /// Several methods that agree.
    Combined,
}

impl Method {
    /// What observations are tried by, in the order in which the methods are preferred: one without a model of the plume's
    /// spread first.
    pub const ALL: [Self; 4] = [Self::Curtain, Self::Network, Self::Point, Self::Inversion];

    /// Its name in `flux.json` and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Curtain => "curtain",
            Self::Network => "network",
            Self::Point => "point",
            Self::Inversion => "inversion",
            Self::Tracer => "tracer",
            Self::Combined => "combined",
        }
    }
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
    /// One standard deviation of that, degrees, where the method estimates it.
    pub sd_deg: Option<f64>,
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
    /// The wind; none where the method needs none.
    pub wind: Option<Wind>,
    /// The stability; none where the method needs none.
    pub stability: Option<StabilityUsed>,
    /// Mean distance of the readings from the source, m.
    pub distance_m: f64,
    /// The passes, in order of time.
    pub passes: Vec<PassFlux>,
    /// What a reader should know beside the number.
    pub notes: Vec<String>,
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
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fluxes {
    /// Estimates, the preferred first.
    pub estimates: Vec<SourceFlux>,
    /// Methods that give none.
    pub refused: Vec<Refusal>,
}

/// The answer from all estimates.
#[derive(Debug, Clone, PartialEq)]
pub struct Conclusion {
    /// The combined estimate where methods agree, else that of the preferred method.
    pub headline: SourceFlux,
    /// The estimates beside it.
    pub alternatives: Vec<SourceFlux>,
    /// The least probability of so large a difference between two of the methods, if both are right.
    pub agreement_p: Option<f64>,
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
    let mut out = Fluxes::default();
    for &method in methods {
        let by_method = match method {
            Method::Curtain => by_curtain(scenario, observations),
            Method::Network => {
                network::estimate(scenario, observations).map(|f| of_plume(scenario, method, f))
            }
            Method::Point => {
                point::estimate(scenario, observations).map(|f| of_plume(scenario, method, f))
            }
            Method::Inversion => {
                transects::estimate(scenario, observations).map(|f| of_plume(scenario, method, f))
            }
            Method::Tracer | Method::Combined => continue,
        };
        match by_method {
            Ok(flux) => out.estimates.push(flux),
            Err(StudyError::Refused(reason)) => out.refused.push(Refusal { method, reason }),
            Err(other) => return Err(other),
        }
    }
    Ok(out)
}

impl Fluxes {
    /// The answer: methods that agree are combined. Those that do not are never averaged; the preferred one stands, and
    /// says so. None without an estimate.
    pub fn conclude(&self) -> Option<Conclusion> {
        let first = self.estimates.first()?;
        let rated: Vec<&SourceFlux> = self.estimates.iter().filter(|e| e.kg_s.is_some()).collect();
        // A rate says more than a limit, and a tracer needs no model at all.
        let preferred = rated.first().copied().unwrap_or(first);
        let mut others: Vec<SourceFlux> = self
            .estimates
            .iter()
            .filter(|e| !std::ptr::eq(*e, preferred))
            .cloned()
            .collect();
        let p = rated
            .iter()
            .enumerate()
            .flat_map(|(k, a)| rated[k + 1..].iter().map(move |b| (a, b)))
            .filter_map(|(a, b)| agreement_p(a.kg_s?, b.kg_s?))
            .reduce(f64::min);
        let mut headline = preferred.clone();
        match p {
            Some(p) if p >= AGREEMENT_P && preferred.method != Method::Tracer => {
                others.insert(0, preferred.clone());
                headline = combined(&rated);
            }
            Some(p) if p < AGREEMENT_P => headline.notes.push(format!(
                "methods disagree (p = {p:.3}): {} stands, and nothing is averaged",
                preferred.method.name()
            )),
            _ => {}
        }
        for limited in self.estimates.iter().filter(|e| e.kg_s.is_none()) {
            if let (Some(limit), Some(rate)) = (limited.upper_limit_kg_s, headline.kg_s)
                && limit < rate.low95
            {
                headline.notes.push(format!(
                    "{} did not meet the plume, and gives a limit below this rate",
                    limited.method.name()
                ));
            }
        }
        Some(Conclusion {
            headline,
            alternatives: others,
            agreement_p: p,
        })
    }
}

/// The mean of ln rates by their variances. Its interval is as wide as the narrowest: the methods read the same eddies.
fn combined(estimates: &[&SourceFlux]) -> SourceFlux {
    let rates: Vec<Interval> = estimates.iter().filter_map(|e| e.kg_s).collect();
    let narrowest = estimates
        .iter()
        .filter(|e| e.kg_s.is_some())
        .min_by(|a, b| {
            let ln_sd = |e: &SourceFlux| e.kg_s.map_or(f64::INFINITY, |r| r.ln_sd());
            ln_sd(a).total_cmp(&ln_sd(b))
        })
        .copied()
        .unwrap_or(estimates[0]);
    let names: Vec<&str> = estimates.iter().map(|e| e.method.name()).collect();
    SourceFlux {
        method: Method::Combined,
        kg_s: of_one_record(&rates),
        notes: vec![format!(
            "weighted mean of {}, which agree; the interval is no narrower than that of the best of them",
            names.join(" and ")
        )],
        ..narrowest.clone()
    }
}

/// Names of all sources.
fn names(scenario: &Scenario) -> String {
    let names: Vec<&str> = scenario.sources.iter().map(|s| s.name.as_str()).collect();
    names.join(" + ")
}

fn of_plume(scenario: &Scenario, method: Method, flux: PlumeFlux) -> SourceFlux {
    let [if_one_class_down, if_one_class_up] = flux.one_class_off_kg_s;
    SourceFlux {
        name: names(scenario),
        gas: scenario.gas(),
        method,
        kg_s: flux.kg_s,
        upper_limit_kg_s: flux.upper_limit_kg_s,
        budget: flux.budget,
        wind: Some(Wind {
            treatment: "logged",
            speed_m_s: flux.speed_m_s,
            from_deg: flux.from_deg,
            sd_deg: flux.from_sd_deg,
        }),
        stability: Some(StabilityUsed {
            value: scenario.weather.stability.letter(),
            by: "scenario",
            if_one_class_down,
            if_one_class_up,
        }),
        distance_m: flux.distance_m,
        passes: flux.passes,
        notes: flux.notes,
    }
}

fn by_curtain(scenario: &Scenario, observations: &Observations) -> Result<SourceFlux, StudyError> {
    let spec = scenario.dispersion_spec()?;
    let frame = scenario.frame()?;
    let checked = checks::check(observations, &spec, &frame).observations;
    let samples = samples(&frame, &checked);
    let winds = Winds::new((scenario, &spec), &frame, &checked);
    let wind = |height_agl_m: f64| winds.at(height_agl_m, ALWAYS).vector;
    not_calm(winds.at(mean_height_agl_m(&samples), ALWAYS).speed_m_s)?;
    let clean = CleanAir::AtEnds {
        noise_sd_ppm: spec.sensor.noise_sd_ppm,
    };
    let (passes, rejected) = passes(&samples, &site(&spec), clean, &wind);
    let Some(found) = curtain(&passes) else {
        return Err(StudyError::Refused(
            "no curtain: expected passes across the wind at three heights at least, at about one distance, with the plume between their ends".into(),
        ));
    };
    let heights_agl_m = found.used.iter().map(|(pass, _)| pass.height_agl_m);
    let there = winds.at(heights_agl_m.sum::<f64>() / found.used.len() as f64, ALWAYS);
    let flux = found.flux;
    let passes_variance = (flux.sd_kg_s / flux.kg_s).powi(2).ln_1p();
    let edges = EDGE_SD * found.above_kg_s.hypot(found.below_kg_s) / flux.kg_s;
    let edge_variance = edges.powi(2).min(passes_variance);
    let terms = [
        (Term::Turbulence, passes_variance - edge_variance),
        (Term::Height, edge_variance),
        (Term::WindSpeed, there.speed_ln_sd().powi(2)),
        (Term::Sensor, gain_ln_sd(scenario).powi(2)),
    ];
    let ln_sd = terms.iter().map(|t| t.1).sum::<f64>().sqrt();
    Ok(SourceFlux {
        name: names(scenario),
        gas: scenario.gas(),
        method: Method::Curtain,
        kg_s: Some(Interval::of_ln_normal(flux.kg_s, ln_sd)),
        upper_limit_kg_s: None,
        budget: budget(&terms),
        wind: Some(Wind {
            treatment: if there.is_logged {
                "logged"
            } else {
                "scenario"
            },
            speed_m_s: there.speed_m_s,
            from_deg: there.vector.from_deg(),
            sd_deg: None,
        }),
        stability: None,
        distance_m: flux.distance_m,
        passes: of_curtain(&found, &passes, &rejected),
        notes: vec![format!(
            "{} passes at {} heights; {:.0} % of the rate lies above the highest pass and {:.0} % below the lowest, by extrapolation",
            flux.passes,
            flux.levels,
            100.0 * found.above_kg_s / flux.kg_s,
            100.0 * found.below_kg_s / flux.kg_s,
        )],
    })
}

/// The passes of a curtain with those that it does not use, in order of time.
fn of_curtain(found: &Curtain, passes: &[Pass], rejected: &[RejectedPass]) -> Vec<PassFlux> {
    let used = |pass: &Pass| {
        let own = found.used.iter().find(|(p, _)| p.time_s == pass.time_s);
        own.map(|(_, kg_s)| *kg_s)
    };
    let of = |pass: &Pass| {
        let kg_s = used(pass);
        let unused = "at another distance, or its ends do not enclose the plume";
        PassFlux::of(pass, kg_s, kg_s.is_none().then_some(unused))
    };
    PassFlux::in_order(passes.iter().map(of), rejected)
}
