//! The finder of flight on hidden cases: what it detects, names and gets wrong.
//!
//! Strengths are set by what an effect is expected to show: D is half the squared size of the
//! effect times the information of the control case without it, tolerances of the base integrated out,
//! under the finder's noise fitted to the control case. For an effect outside the catalogue D is what the
//! base at its best, tolerances in use, loses of its log score against the control case, whose gusts and
//! noise are the same.

mod table;

use crate::on_threads::on_threads;
use fdm::Aircraft;
use gap::flight::filter::huber;
use gap::flight::log::FlightLog;
use gap::flight::study::{Linear, Study};
use gap::flight::{Finding, gain, gate};
use gap::verdict::Verdict;
use gap_truth::flight::{
    FLIGHT_CATALOGUE, FLIGHT_OUTSIDE, FlightCase, FlightEffect, FlightLaw, FlightNoise, FlightSpec,
    TrueValue, make,
};

pub use table::FlightSummary;

/// What a case is about.
#[derive(Debug, Clone, PartialEq)]
pub enum FlightKind {
    /// Nothing hidden.
    Nothing(FlightNoise),
    /// One effect by the catalogue's law at so many nats.
    One(FlightEffect, f64),
    /// One effect by another law than the catalogue's.
    OtherLaw(FlightEffect, f64),
    /// One effect outside the catalogue with a misfit of so many nats.
    Outside(FlightEffect, f64),
    /// Two effects, so many nats each.
    Two(FlightEffect, FlightEffect, f64),
}

impl std::fmt::Display for FlightKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Nothing(FlightNoise::Usual) => f.write_str("none, usual noise"),
            Self::Nothing(FlightNoise::Unusual) => f.write_str("none, other noise"),
            Self::One(e, d) => write!(f, "{}, D = {d}", e.id()),
            Self::OtherLaw(e, d) => write!(f, "other law, {}, D = {d}", e.id()),
            Self::Outside(e, d) => write!(f, "outside, {}, D = {d}", e.id()),
            Self::Two(a, b, d) => write!(f, "two, {} and {}, D = {d}", a.id(), b.id()),
        }
    }
}

/// What became of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightOutcome {
    /// What it was about.
    pub kind: FlightKind,
    /// Seed.
    pub seed: u64,
    /// What was refused.
    pub error: Option<String>,
    /// The verdict.
    pub verdict: Option<Verdict>,
    /// Mechanisms of each cause.
    pub sets: Vec<Vec<String>>,
    /// Nats that each cause gains.
    pub nats: Vec<f64>,
    /// Stated probability of the first cause, and whether it holds a hidden effect.
    pub stated: Option<(f64, bool)>,
    /// For each parameter of a hidden effect that is named alone: its error in stated sd.
    pub errors_sd: Vec<f64>,
    /// Coordinate of what is unexplained.
    pub coordinate: Option<String>,
    /// Nats gained on blocks left out by what was found, and by the truth.
    pub gain: Option<(f64, f64)>,
}

impl FlightOutcome {
    /// Of a case that nothing is known of yet.
    fn new(kind: FlightKind, seed: u64) -> Self {
        Self {
            kind,
            seed,
            error: None,
            verdict: None,
            sets: Vec::new(),
            nats: Vec::new(),
            stated: None,
            errors_sd: Vec::new(),
            coordinate: None,
            gain: None,
        }
    }

    /// Hidden effects of the catalogue.
    pub fn hidden(&self) -> Vec<&'static str> {
        match &self.kind {
            FlightKind::One(e, _) | FlightKind::OtherLaw(e, _) => vec![e.id()],
            FlightKind::Two(a, b, _) => vec![a.id(), b.id()],
            _ => Vec::new(),
        }
    }

    /// Whether anything was found.
    pub fn detected(&self) -> bool {
        self.verdict.is_some_and(|v| v != Verdict::None)
    }

    /// Whether every hidden effect is in some set.
    pub fn in_sets(&self) -> bool {
        let holds = |id: &&str| self.sets.iter().any(|s| s.iter().any(|m| m == id));
        self.hidden().iter().all(holds)
    }

    /// Whether a single name was said that is not hidden, and nothing called unexplained.
    pub fn confidently_wrong(&self) -> bool {
        let hidden = self.hidden();
        self.verdict != Some(Verdict::Unexplained)
            && self
                .sets
                .iter()
                .any(|s| s.len() == 1 && !hidden.contains(&s[0].as_str()))
    }

    /// Whether exactly the hidden effects are named, each alone.
    pub fn exactly(&self) -> bool {
        let mut hidden = self.hidden();
        let mut said: Vec<&str> = self.sets.iter().flatten().map(String::as_str).collect();
        hidden.sort_unstable();
        said.sort_unstable();
        hidden == said && self.verdict == Some(Verdict::Named)
    }

    /// Describes what was found: causes with the nats that each gains, and where a rest lives.
    pub fn description(&self) -> String {
        if let Some(error) = &self.error {
            return error.clone();
        }
        let causes: Vec<String> = self
            .sets
            .iter()
            .zip(&self.nats)
            .map(|(set, nats)| format!("{} ({nats:.0} nats)", set.join(" or ")))
            .collect();
        let mut text = if causes.is_empty() {
            "nothing".to_owned()
        } else {
            causes.join(" and ")
        };
        if let Some(coordinate) = &self.coordinate {
            text += &format!(", unexplained ({coordinate})");
        }
        text
    }
}

/// Pairs of effects that manoeuvres tell apart.
const PAIRS: [(FlightEffect, FlightEffect); 6] = [
    (FlightEffect::MassChange, FlightEffect::GyroBias),
    (FlightEffect::ActuatorDelay, FlightEffect::AlphaVaneScale),
    (FlightEffect::RollDamping, FlightEffect::CgShift),
    (FlightEffect::AirspeedScale, FlightEffect::DragIncrease),
    (FlightEffect::LiftSlope, FlightEffect::AccelerometerBias),
    (FlightEffect::PitchDamping, FlightEffect::ThrustLoss),
];

/// Which parts of the benchmark are run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FlightShare {
    /// Cases without an effect.
    pub nothing: bool,
    /// Cases of single effects; of each seed every so many-th effect, 0 for none.
    pub one_in: usize,
    /// Other laws, outsiders and pairs.
    pub others: bool,
    /// Only kinds whose name contains this.
    pub only: String,
}

/// First seed of published figures: those before served to build the finder.
pub const FIRST_SEED: u64 = 5000;

impl FlightShare {
    /// All kinds whose name contains `only`; of each seed every third effect, so that each effect
    /// meets every aircraft in six seeds.
    pub fn published(only: &str) -> Self {
        Self {
            nothing: true,
            one_in: 3,
            others: true,
            only: only.to_owned(),
        }
    }

    /// Whether there are cases of it: kinds come in turn, all of them in fifteen seeds.
    pub fn holds_any(&self) -> bool {
        (0..15).any(|seed| !kinds(seed, self).is_empty())
    }
}

/// The cases of one seed.
fn kinds(seed: u64, share: &FlightShare) -> Vec<FlightKind> {
    let mut all = Vec::new();
    if share.nothing {
        all.push(FlightKind::Nothing(FlightNoise::Usual));
        all.push(FlightKind::Nothing(FlightNoise::Unusual));
    }
    let chosen = |k: usize, of: usize| of > 0 && (k + seed as usize).is_multiple_of(of);
    for (k, effect) in FLIGHT_CATALOGUE.into_iter().enumerate() {
        if chosen(k, share.one_in) {
            all.push(FlightKind::One(effect, 20.0));
            all.push(FlightKind::One(effect, 60.0));
        }
        if share.others && chosen(k, 5) {
            all.push(FlightKind::OtherLaw(effect, 60.0));
        }
    }
    if share.others {
        for (k, effect) in FLIGHT_OUTSIDE.into_iter().enumerate() {
            if chosen(k, 3) {
                all.push(FlightKind::Outside(effect, 100.0));
            }
        }
        for (k, (a, b)) in PAIRS.into_iter().enumerate() {
            if chosen(k, 3) {
                all.push(FlightKind::Two(a, b, 40.0));
            }
        }
    }
    all.retain(|kind| kind.to_string().contains(&share.only));
    all
}

/// An aircraft as its file has it, for the finder and for the truth.
pub struct BenchAircraft<'a> {
    /// Text of the file.
    pub toml: &'a str,
    /// The same, read by the simulator.
    pub aircraft: Aircraft,
}

impl<'a> BenchAircraft<'a> {
    /// Reads an aircraft file.
    ///
    /// # Errors
    /// What the simulator refuses.
    pub fn new(toml: &'a str) -> Result<Self, fdm::FdmError> {
        Ok(Self {
            toml,
            aircraft: Aircraft::from_toml("aircraft", toml)?,
        })
    }
}

/// What the flight without an effect tells about strengths.
struct Control {
    names: Vec<String>,
    linear: Linear,
    loss: f64,
}

/// What passes the gate of a flight file.
fn gated(bench: &BenchAircraft<'_>, case: &FlightCase) -> Result<gate::Gated, String> {
    if !case.flown {
        return Err("the aircraft was lost".to_owned());
    }
    let log = FlightLog::parse("case", &case.csv).map_err(|e| e.to_string())?;
    gate::pass(&[log], &bench.aircraft).map_err(|e| e.to_string())
}

/// The flight without an effect as the base sees it, with its noise fitted.
fn control(bench: &BenchAircraft<'_>, seed: u64) -> Result<Control, String> {
    let case = make(&FlightSpec::none(seed), bench.toml).ok_or("aircraft not read")?;
    let gated = gated(bench, &case)?;
    let study = Study::new(&bench.aircraft, &gated, 1);
    let linear = study.settled(study.seen_from_start());
    Ok(Control {
        names: study.parameters.iter().map(|p| p.name.clone()).collect(),
        loss: loss(&study, &linear),
        linear,
    })
}

/// Loss of the base where it fits best under the noise of `from`, nats: half the squares of the
/// innovations, counted linearly beyond the filter's bound, and of its departures in tolerances.
fn loss(study: &Study<'_>, from: &Linear) -> f64 {
    let mut linear = study.linearise(from.theta.clone(), from.noise.clone());
    for _ in 0..2 {
        let theta = study.theta_of(&linear, &[]);
        linear = study.linearise(theta, from.noise.clone());
    }
    let passes = study.passes(&linear.theta, &linear.noise);
    let rows = passes.iter().flat_map(|p| p.standardised.iter().flatten());
    let of_data: f64 = rows
        .filter(|nu| nu.is_finite())
        .map(|nu| 0.5 * huber(*nu).0)
        .sum();
    let departures = linear.theta.iter().zip(study.tolerances());
    let of_base: f64 = departures
        .map(|(value, sd)| 0.5 * (value / sd).powi(2))
        .sum();
    of_data + of_base
}

/// Strength at which an effect outside the catalogue has a misfit of `nats`.
fn outside(
    bench: &BenchAircraft<'_>,
    control: &Control,
    effect: FlightEffect,
    nats: f64,
    seed: u64,
) -> Result<f64, String> {
    let mut strength = 0.5;
    for _ in 0..3 {
        let mut spec = FlightSpec::none(seed);
        spec.hidden = vec![(effect, strength)];
        let probe = make(&spec, bench.toml).ok_or("aircraft not read")?;
        let seen = gated(bench, &probe).map(|gated| {
            let study = Study::new(&bench.aircraft, &gated, 1);
            loss(&study, &control.linear) - control.loss
        });
        strength *= match seen {
            Ok(seen) => (nats / seen.max(1.0)).sqrt().clamp(0.2, 5.0),
            // It does not fly so.
            Err(_) => 0.6,
        };
    }
    Ok(strength)
}

/// Departures of the parameters named `names` that a case hides, by what `of` takes of each.
fn shift(names: &[String], case: &FlightCase, of: fn(&TrueValue) -> f64) -> Vec<f64> {
    let mut shift = vec![0.0; names.len()];
    for value in &case.truth {
        let name = format!("{}.{}", value.mechanism, value.name);
        let neutral = if value.name.ends_with("factor") {
            1.0
        } else {
            0.0
        };
        if let Some(j) = names.iter().position(|n| *n == name) {
            shift[j] = of(value) - neutral;
        }
    }
    shift
}

/// Expected nats of a case's truth.
fn expected(control: &Control, case: &FlightCase) -> f64 {
    let shift = shift(&control.names, case, |t| t.value);
    let mut sum = 0.0;
    for (i, a) in shift.iter().enumerate() {
        for (j, b) in shift.iter().enumerate() {
            sum += 0.5 * a * b * control.linear.word.s[(i, j)];
        }
    }
    sum * control.linear.word.dispersion
}

fn effects(kind: &FlightKind) -> Vec<(FlightEffect, f64)> {
    match *kind {
        FlightKind::Nothing(_) => Vec::new(),
        FlightKind::One(e, d) | FlightKind::OtherLaw(e, d) | FlightKind::Outside(e, d) => {
            vec![(e, d)]
        }
        FlightKind::Two(a, b, d) => vec![(a, d), (b, d)],
    }
}

/// The case of a kind at the strengths asked for.
fn case(
    bench: &BenchAircraft<'_>,
    control: &Control,
    kind: &FlightKind,
    seed: u64,
) -> Result<FlightCase, String> {
    let mut spec = FlightSpec::none(seed);
    if let FlightKind::Nothing(noise) = kind {
        spec.noise = *noise;
    }
    if let FlightKind::OtherLaw(..) = kind {
        spec.law = FlightLaw::Variant;
    }
    for (effect, nats) in effects(kind) {
        if !effect.in_catalogue() {
            let strength = outside(bench, control, effect, nats, seed)?;
            spec.hidden.push((effect, strength));
            continue;
        }
        let mut probe = FlightSpec::none(seed);
        probe.hidden = vec![(effect, 1.0)];
        let tried = make(&probe, bench.toml).ok_or("aircraft not read")?;
        let seen = expected(control, &tried).max(0.05);
        let strength = (nats / seen).sqrt().clamp(0.1, 10.0);
        spec.hidden.push((effect, strength));
    }
    make(&spec, bench.toml).ok_or_else(|| "aircraft not read".into())
}

fn judge(
    bench: &BenchAircraft<'_>,
    control: &Control,
    kind: FlightKind,
    seed: u64,
) -> FlightOutcome {
    let mut outcome = FlightOutcome::new(kind, seed);
    if let Err(error) = find(bench, control, &mut outcome) {
        outcome.error = Some(error);
    }
    outcome
}

/// Makes the case of `outcome` and writes into it what is found.
fn find(
    bench: &BenchAircraft<'_>,
    control: &Control,
    outcome: &mut FlightOutcome,
) -> Result<(), String> {
    let case = case(bench, control, &outcome.kind, outcome.seed)?;
    let gated = gated(bench, &case)?;
    let found = Finding::of(&bench.aircraft, &gated, 1, &mut |_| {}).map_err(|e| e.to_string())?;
    compare(outcome, &case, &found);
    Ok(())
}

fn compare(outcome: &mut FlightOutcome, case: &FlightCase, found: &Finding<'_>) {
    let answer = &found.answer;
    outcome.verdict = Some(answer.verdict);
    outcome.sets = answer.causes.iter().map(|c| c.mechanisms.clone()).collect();
    outcome.nats = answer
        .causes
        .iter()
        .map(|c| c.evidence.delta_log_score)
        .collect();
    outcome.coordinate = answer.unexplained.as_ref().map(|u| u.coordinate.clone());
    let hidden = outcome.hidden();
    outcome.stated = answer.causes.first().map(|c| {
        let right = c.mechanisms.iter().any(|m| hidden.contains(&m.as_str()));
        (c.probability, right)
    });
    if !matches!(outcome.kind, FlightKind::OtherLaw(..)) {
        for cause in answer.causes.iter().filter(|c| c.mechanisms.len() == 1) {
            for p in &cause.parameters {
                let same = |t: &&TrueValue| t.mechanism == p.mechanism && t.name == p.name;
                if let Some(t) = case.truth.iter().find(same) {
                    outcome.errors_sd.push((p.value - t.whole) / p.sd);
                }
            }
        }
    }
    if !hidden.is_empty() {
        let (study, last) = (&found.study, &found.last);
        let names: Vec<String> = study.parameters.iter().map(|p| p.name.clone()).collect();
        let gained = gain::of_set(study, last, &answer.set).held_out;
        outcome.gain = Some((
            gained.log_score_after - gained.log_score_before,
            gain::of_truth(study, last, &shift(&names, case, |t| t.whole)),
        ));
    }
}

/// Runs the cases of `share` of `seeds` seeds from `first` on, on `threads` threads;
/// `progress` gets the seeds done.
pub fn run(
    fleet: &[BenchAircraft<'_>],
    first: u64,
    seeds: u64,
    share: &FlightShare,
    threads: usize,
    progress: &(dyn Fn(u64, &[FlightOutcome]) + Sync),
) -> FlightSummary {
    let all: Vec<u64> = (first..first + seeds).collect();
    let outcomes = on_threads(threads, &all, &|seed, done| {
        let bench = &fleet[*seed as usize % fleet.len()];
        let outcomes = of_seed(bench, *seed, share);
        progress(done() as u64, &outcomes);
        outcomes
    });
    FlightSummary::new(seeds, outcomes.concat())
}

fn of_seed(bench: &BenchAircraft<'_>, seed: u64, share: &FlightShare) -> Vec<FlightOutcome> {
    let kinds = kinds(seed, share);
    if kinds.is_empty() {
        return Vec::new();
    }
    match control(bench, seed) {
        Ok(control) => kinds
            .into_iter()
            .map(|kind| judge(bench, &control, kind, seed))
            .collect(),
        Err(error) => kinds
            .into_iter()
            .map(|kind| FlightOutcome {
                error: Some(error.clone()),
                ..FlightOutcome::new(kind, seed)
            })
            .collect(),
    }
}
