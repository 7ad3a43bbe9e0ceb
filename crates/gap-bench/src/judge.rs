//! One case: what the finder says of it, held against the truth.

use gap::plume::{Analysis, Labelled, Options, Setup, analyse};
use gap::verdict::GapJson;
use gap_truth::case::DamageKind;
use gap_truth::{Case, CaseSpec, Forward, FurtherFlight, PlumeEffect, TrueEffect, further};
use scenario::Scenario;
use scenario::observations::{self, Observations};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::made::{Made, make};
use crate::plan::{Generator, Kind, Task};

/// What became of one case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The task.
    pub task: Task,
    /// No scene tried shows the effect as strongly as asked; nothing else is set.
    pub unreachable: bool,
    /// What the finder or the reader refused.
    pub error: Option<String>,
    /// Forward model of the truth; none where no case was made.
    pub forward: Option<Forward>,
    /// What is hidden.
    pub truth: Vec<Hidden>,
    /// What the finder said; none where it refused.
    pub said: Option<FinderReport>,
    /// The causes of every set that was judged, in the order of judging.
    #[serde(default)]
    pub considered: Vec<Vec<Considered>>,
    /// Passes by which they were judged.
    #[serde(default)]
    pub passes: usize,
    /// Readings in use.
    #[serde(default)]
    pub readings: usize,
    /// Where the answer is ambiguous: the next flight.
    pub next_flight: Option<FlownOn>,
    /// Time that the finder took, s; 0 where nobody measured it.
    pub seconds: f64,
}

/// A hidden effect and how visible it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    /// The effect.
    pub effect: PlumeEffect,
    /// Platforms that it acts on; empty for all.
    pub platforms: Vec<String>,
    /// Name and true value of each parameter; none where its law is not the catalogue's.
    pub parameters: Vec<(String, f64)>,
    /// D beside the other effects by the generator's noise, nats.
    pub nats: f64,
}

impl Hidden {
    fn new(truth: &TrueEffect, nats: f64, other_laws: bool) -> Self {
        let value = |p: &gap_truth::case::TrueParameter| (p.name.to_owned(), p.value);
        let known = truth.parameters.iter().filter(|_| !other_laws);
        Self {
            effect: truth.effect,
            platforms: truth.platforms.clone(),
            parameters: known.map(value).collect(),
            nats,
        }
    }

    /// Whether `id` names the effect or what no such data tell from it.
    fn is_named_by(&self, id: &str) -> bool {
        let like = self.effect.inseparable_from(self.platforms.is_empty());
        self.effect.id() == id || like.iter().any(|e| e.id() == id)
    }

    fn is_in(&self, cause: &ReportedCause) -> bool {
        cause.mechanisms.iter().any(|id| self.is_named_by(id))
    }

    fn is_on(&self, cause: &ReportedCause) -> bool {
        self.platforms.is_empty() || cause.platforms == self.platforms
    }
}

/// What the finder said, of what is judged.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FinderReport {
    /// The verdict.
    pub verdict: String,
    /// The causes.
    pub causes: Vec<ReportedCause>,
    /// What an unexplained rest might be.
    pub candidates: Vec<ReportedCause>,
    /// Coordinate of an unexplained rest.
    pub coordinate: Option<String>,
    /// Kinds of flaws of the raw data, with their platforms.
    pub flaws: Vec<(String, String)>,
}

/// A cause or a candidate.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ReportedCause {
    /// Its mechanisms.
    pub mechanisms: Vec<String>,
    /// Platforms that it acts on; empty for all.
    pub platforms: Vec<String>,
    /// Its probability.
    pub probability: Option<f64>,
    /// Of a candidate: evidence over the base's, nats.
    pub log_evidence: Option<f64>,
    /// Its parameters.
    pub parameters: Vec<ReportedParameter>,
}

/// A cause that the finder judged, whether it stated it or not, by which probabilities are calibrated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Considered {
    /// Its mechanisms, the likeliest first.
    pub mechanisms: Vec<String>,
    /// Platforms of its mechanisms; none where one acts on all.
    pub platforms: Vec<Option<String>>,
    /// Whether a hidden effect is among them, on its platform: one of those that data cannot tell from it counts.
    pub is_true: bool,
    /// Probability that one of them is at work.
    pub probability: f64,
    /// The same by evidence alone.
    pub by_evidence: f64,
    /// Terms of the regression that bounds it.
    pub terms: Vec<f64>,
    /// Lower bound of the gain on passes left out, nats.
    pub left_out_low: f64,
    /// Draws in which errors on passes left out are larger with it.
    pub worse: [f64; 3],
}

impl Considered {
    fn of(cause: &infer::Cause<Labelled>, truth: &[Hidden]) -> Self {
        let holds = |(id, platform): &Labelled| {
            truth.iter().any(|h| {
                h.is_named_by(id)
                    && match (platform, h.platforms.as_slice()) {
                        (_, []) => true,
                        (Some(own), [other]) => own == other,
                        _ => false,
                    }
            })
        };
        let names = || cause.mechanisms.iter().map(|n| &n.0);
        Self {
            mechanisms: names().map(|n| n.0.clone()).collect(),
            platforms: names().map(|n| n.1.clone()).collect(),
            is_true: names().any(holds),
            probability: cause.probability,
            by_evidence: cause.by_evidence,
            terms: cause.features.terms().to_vec(),
            left_out_low: cause.hold_out.1,
            worse: cause.worse,
        }
    }
}

/// A fitted parameter.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ReportedParameter {
    /// Name, as in the contract.
    pub name: String,
    /// Estimate.
    pub value: Option<f64>,
    /// One standard deviation.
    pub sd: Option<f64>,
}

impl FinderReport {
    /// What is judged of `gap.json`. By its text and not its types: fields that come and go with a
    /// finder are no matter of the benchmark.
    ///
    /// # Errors
    /// A field of the contract that has another form.
    pub fn of(json: &Value) -> Result<Self, String> {
        let unexplained = &json["unexplained"];
        let kept = serde_json::json!({
            "verdict": json["verdict"],
            "causes": json["causes"],
            "candidates": unexplained.get("candidates").cloned().unwrap_or(Value::Array(Vec::new())),
            "coordinate": unexplained["coordinate"],
        });
        let said: Self = serde_json::from_value(kept).map_err(|e| e.to_string())?;
        let word = |flaw: &Value, key: &str| flaw[key].as_str().unwrap_or("").to_owned();
        let flaws = json["data_quality"].as_array().into_iter().flatten();
        Ok(Self {
            flaws: flaws
                .map(|f| (word(f, "kind"), word(f, "platform")))
                .collect(),
            ..said
        })
    }
}

/// A next flight: what it promised, and what came of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlownOn {
    /// Separation that it promised, nats.
    pub expected_nats: f64,
    /// Probability of settling the matter that it promised.
    pub settles_probability: f64,
    /// Whether it settled the matter.
    pub settled: bool,
}

impl Outcome {
    fn new(task: &Task) -> Self {
        Self {
            task: task.clone(),
            unreachable: false,
            error: None,
            forward: None,
            truth: Vec::new(),
            said: None,
            considered: Vec::new(),
            passes: 0,
            readings: 0,
            next_flight: None,
            seconds: 0.0,
        }
    }

    /// The verdict; "" where the finder refused.
    pub fn verdict(&self) -> &str {
        self.said.as_ref().map_or("", |s| s.verdict.as_str())
    }

    /// Whether anything was found: any verdict but `none` and `insufficient`.
    pub fn detected(&self) -> bool {
        !matches!(self.verdict(), "" | "none" | "insufficient")
    }

    /// D of the effect that is hardest to see, nats; 0 where nothing is hidden.
    pub fn nats(&self) -> f64 {
        let least = self.truth.iter().map(|h| h.nats).reduce(f64::min);
        least.unwrap_or(0.0)
    }

    fn causes(&self) -> &[ReportedCause] {
        self.said.as_ref().map_or(&[], |s| &s.causes)
    }

    fn candidates(&self) -> &[ReportedCause] {
        self.said.as_ref().map_or(&[], |s| &s.candidates)
    }

    /// Hidden effects that some cause holds.
    pub fn in_sets(&self) -> usize {
        let held = |h: &&Hidden| self.causes().iter().any(|c| h.is_in(c));
        self.truth.iter().filter(held).count()
    }

    /// Hidden effects that some cause or candidate holds.
    pub fn said_at_all(&self) -> usize {
        let all = || self.causes().iter().chain(self.candidates());
        let held = |h: &&Hidden| all().any(|c| h.is_in(c));
        self.truth.iter().filter(held).count()
    }

    /// Hidden effects that are named alone, or with what no such data tell from them, on the right
    /// platforms where one has it.
    pub fn named(&self) -> usize {
        let alone = |h: &Hidden, c: &ReportedCause| {
            h.is_in(c) && c.mechanisms.iter().all(|id| h.is_named_by(id)) && h.is_on(c)
        };
        let said = |h: &&Hidden| self.causes().iter().any(|c| alone(h, c));
        self.truth.iter().filter(said).count()
    }

    /// How many names one has to choose from for a hidden effect on average: of the set that holds it,
    /// or of all candidates; what cannot be told from it not counted.
    pub fn set_size(&self) -> Option<f64> {
        let sizes: Vec<f64> = self.truth.iter().filter_map(|h| self.size_of(h)).collect();
        let sum: f64 = sizes.iter().sum();
        (!sizes.is_empty()).then(|| sum / sizes.len() as f64)
    }

    fn size_of(&self, hidden: &Hidden) -> Option<f64> {
        let of = |ids: &mut dyn Iterator<Item = &String>| {
            let mut others: Vec<&String> = ids.filter(|id| !hidden.is_named_by(id)).collect();
            others.sort();
            others.dedup();
            1.0 + others.len() as f64
        };
        if let Some(cause) = self.causes().iter().find(|c| hidden.is_in(c)) {
            return Some(of(&mut cause.mechanisms.iter()));
        }
        let candidates = self.candidates();
        let held = candidates.iter().any(|c| hidden.is_in(c));
        // Other hidden effects beside it in a candidate are right.
        let known = |id: &&String| {
            let mut rest = self.truth.iter().filter(|h| *h != hidden);
            !rest.any(|h| h.is_named_by(id))
        };
        let mut ids = candidates.iter().flat_map(|c| &c.mechanisms).filter(known);
        held.then(|| of(&mut ids))
    }

    /// A cause of a single name that is not a hidden effect, nor one that cannot be told from it,
    /// in a verdict that does not say that something is unexplained.
    pub fn wrong_single(&self) -> bool {
        // A ceiling is what saturation is, wherever it comes from.
        let clipped = self.task.kind == Kind::Damaged(DamageKind::Clipped);
        let right = |c: &ReportedCause| {
            self.truth.iter().any(|h| h.is_in(c))
                || (clipped && c.mechanisms[0] == PlumeEffect::SensorSaturation.id())
        };
        let wrong = |c: &ReportedCause| c.mechanisms.len() == 1 && !right(c);
        matches!(self.verdict(), "named" | "ambiguous") && self.causes().iter().any(wrong)
    }

    /// `named`, and a hidden effect is in no cause.
    pub fn silently_dropped(&self) -> bool {
        self.verdict() == "named" && self.in_sets() < self.truth.len()
    }

    /// The stated probability of the first cause, and whether it holds a hidden effect.
    pub fn stated(&self) -> Option<(f64, bool)> {
        let first = self.causes().first()?;
        Some((
            first.probability?,
            self.truth.iter().any(|h| h.is_in(first)),
        ))
    }

    /// For each fitted parameter of a hidden effect that is named alone: whether 1.96 sd cover the
    /// truth.
    pub fn covered(&self) -> Vec<bool> {
        let mut covered = Vec::new();
        for hidden in &self.truth {
            let id = hidden.effect.id();
            // What is said of another platform says nothing of the truth's parameters.
            let right = |c: &&ReportedCause| c.mechanisms == [id] && hidden.is_on(c);
            for cause in self.causes().iter().filter(right) {
                for (name, value) in &hidden.parameters {
                    let fitted = cause.parameters.iter().find(|p| p.name == *name);
                    let both = fitted.and_then(|p| Some((p.value?, p.sd?)));
                    // Settings such as a pivot come without a deviation.
                    if let Some((found, sd)) = both.filter(|b| b.1 > 0.0) {
                        covered.push((found - value).abs() < 1.96 * sd);
                    }
                }
            }
        }
        covered
    }
}

/// How a case is judged.
#[derive(Debug, Clone, Copy)]
pub struct Judging {
    /// Seconds on some clock, to say how long the finder took.
    pub clock_s: fn() -> f64,
    /// Whether the next flight that an ambiguous answer proposes is flown, which takes a second
    /// analysis.
    pub fly_on: bool,
}

/// Makes the case of `task`, gives its files to the finder, and judges the answer.
pub fn judge(task: &Task, judging: &Judging) -> Outcome {
    let Some(made) = make(task) else {
        return Outcome {
            unreachable: true,
            ..Outcome::new(task)
        };
    };
    let options = Options {
        seed: task.seed,
        ..Options::default()
    };
    judge_made(task, &made, judging, &options)
}

/// The same of a case that is made, with a finder of other options.
pub(crate) fn judge_made(
    task: &Task,
    made: &Made,
    judging: &Judging,
    options: &Options,
) -> Outcome {
    let truth = &made.case.truth;
    let hidden = truth.effects.iter().zip(&made.nats);
    let mut outcome = Outcome {
        forward: Some(truth.forward),
        truth: hidden
            .map(|(e, nats)| Hidden::new(e, *nats, truth.other_laws))
            .collect(),
        ..Outcome::new(task)
    };
    let start_s = (judging.clock_s)();
    let found = find_with(options, &made.case.scenario_toml, &made.case.observations);
    outcome.seconds = (judging.clock_s)() - start_s;
    let judged = found.and_then(|analysis| {
        let as_text = serde_json::to_value(&analysis.json).map_err(|e| e.to_string())?;
        let considered = analysis.considered;
        let of = |cause| Considered::of(cause, &outcome.truth);
        let sets = considered.sets.iter();
        outcome.considered = sets.map(|set| set.iter().map(of).collect()).collect();
        (outcome.passes, outcome.readings) = (considered.passes, considered.readings);
        Ok((FinderReport::of(&as_text)?, as_text))
    });
    match judged {
        Ok((said, json)) => {
            // The second generator flies no further.
            let may_fly_on = judging.fly_on && task.generator == Generator::Plume;
            if may_fly_on && said.verdict == "ambiguous" {
                outcome.next_flight = fly_on(task, made, &outcome.truth, &json);
            }
            outcome.said = Some(said);
        }
        Err(error) => outcome.error = Some(error),
    }
    outcome
}

/// Reads files of a case as the finder reads them.
///
/// # Errors
/// What the reader or the finder says of them.
pub fn read(
    scenario_toml: &str,
    files: &[(String, String)],
) -> Result<(Setup, Observations), String> {
    let scenario = Scenario::parse("scenario.toml", scenario_toml).map_err(|e| e.to_string())?;
    let setup = Setup::new(&scenario).map_err(|e| e.to_string())?;
    let texts: Vec<(&str, &str)> = files
        .iter()
        .map(|(n, t)| (n.as_str(), t.as_str()))
        .collect();
    let observations = observations::parse(&texts, scenario.gas()).map_err(|e| e.to_string())?;
    Ok((setup, observations))
}

/// The finder's answer to files.
///
/// # Errors
/// What the reader or the finder says of them.
pub fn find(seed: u64, scenario_toml: &str, files: &[(String, String)]) -> Result<GapJson, String> {
    let options = Options {
        seed,
        ..Options::default()
    };
    find_with(&options, scenario_toml, files).map(|a| a.json)
}

fn find_with(
    options: &Options,
    scenario_toml: &str,
    files: &[(String, String)],
) -> Result<Analysis, String> {
    let (setup, observations) = read(scenario_toml, files)?;
    let analysis = analyse(&setup, &observations, options, &mut |_| {});
    analysis.map_err(|e| e.to_string())
}

/// What the next flight promises, and whether the matter is settled once it is flown: a cause
/// holds the effect, and no longer both it and what the flight was to separate.
fn fly_on(task: &Task, made: &Made, truth: &[Hidden], json: &Value) -> Option<FlownOn> {
    let next = &json["next_flight"];
    let flight = FurtherFlight {
        platform: next["platform"].as_str().unwrap_or("uav1").to_owned(),
        waypoints: next["waypoints"]
            .as_array()?
            .iter()
            .map(waypoint)
            .collect::<Option<_>>()?,
    };
    let spec: &CaseSpec = &made.spec;
    let files = Case::flown_on(spec, &flight);
    let after = find(task.seed, &made.case.scenario_toml, &files).ok()?;
    let after = FinderReport::of(&serde_json::to_value(&after).ok()?).ok()?;
    let separates: Vec<&str> = next["separates"]
        .as_array()?
        .iter()
        .filter_map(Value::as_str)
        .collect();
    let (first, others) = separates.split_first()?;
    let hidden = truth.first()?;
    let settled = after.causes.iter().any(|c| {
        let has = |id: &&str| c.mechanisms.iter().any(|m| m == id);
        hidden.is_in(c) && !(has(first) && others.iter().any(has))
    });
    Some(FlownOn {
        expected_nats: next["expected_nats"].as_f64()?,
        settles_probability: next["settles_probability"].as_f64()?,
        settled,
    })
}

fn waypoint(w: &Value) -> Option<further::TrackWaypoint> {
    Some(further::TrackWaypoint {
        time_s: w["time_s"].as_f64()?,
        lat_deg: w["lat_deg"].as_f64()?,
        lon_deg: w["lon_deg"].as_f64()?,
        alt_amsl_m: w["alt_amsl_m"].as_f64()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::share_of;

    fn hidden(effect: PlumeEffect) -> Hidden {
        Hidden {
            effect,
            platforms: Vec::new(),
            parameters: vec![("factor".to_owned(), 1.3)],
            nats: 80.0,
        }
    }

    fn outcome(truth: Vec<Hidden>, json: Value) -> Outcome {
        Outcome {
            truth,
            said: Some(FinderReport::of(&json).unwrap()),
            ..Outcome::new(&share_of(1, 0)[0])
        }
    }

    #[test]
    fn candidates_count_as_said_but_not_as_named() {
        let truth = vec![hidden(PlumeEffect::SigmaYScale)];
        let json = serde_json::json!({"verdict": "unexplained", "causes": [], "unexplained": {
            "coordinate": "map", "candidates": [{"mechanisms": ["meander"], "probability": 0.4,
            "log_evidence": 3.0, "parameters": []}, {"mechanisms": ["sigma-y-scale"],
            "probability": 0.3, "log_evidence": 2.5, "parameters": []}]}, "data_quality": []});
        let one = outcome(truth, json);
        assert!(one.detected() && !one.wrong_single());
        assert_eq!((one.said_at_all(), one.in_sets(), one.named()), (1, 0, 0));
        assert_eq!(one.set_size(), Some(2.0));
    }

    #[test]
    fn a_second_effect_that_is_dropped_is_counted() {
        let truth = vec![
            hidden(PlumeEffect::SigmaYScale),
            hidden(PlumeEffect::SensorLag),
        ];
        let json = serde_json::json!({"verdict": "named", "causes": [{"mechanisms":
            ["sigma-y-scale"], "probability": 0.99, "platforms": [], "parameters": [
            {"mechanism": "sigma-y-scale", "name": "factor", "value": 1.2, "sd": 0.06}]}],
            "unexplained": null, "data_quality": [{"kind": "gap", "platform": "uav1"}]});
        let one = outcome(truth, json);
        assert!(one.silently_dropped() && !one.wrong_single());
        assert_eq!(one.covered(), [true]);
        assert_eq!(
            one.said.unwrap().flaws,
            [("gap".to_owned(), "uav1".to_owned())]
        );
    }

    // By hand: a lag hidden on uav2 is not found on uav1, nor on all; where all have it, one is right.
    #[test]
    fn what_was_judged_is_true_on_its_platform() {
        let judged = |id: &str, platform: Option<&str>| infer::Cause {
            mechanisms: vec![((id.to_owned(), platform.map(str::to_owned)), 0.9)],
            probability: 0.9,
            by_evidence: 0.95,
            features: infer::Features {
                departs_sd: 20.0,
                widening: 1.2,
                others: 0,
            },
            gain: 5.0,
            nats_to_next: 3.0,
            hold_out: (4.0, 1.0),
            worse: [0.0; 3],
        };
        let lag = |platforms: &[&str]| Hidden {
            platforms: platforms.iter().map(|p| (*p).to_owned()).collect(),
            ..hidden(PlumeEffect::SensorLag)
        };
        for (truth, platform, is_true) in [
            (&["uav2"][..], Some("uav2"), true),
            (&["uav2"], Some("uav1"), false),
            (&["uav2"], None, false),
            (&[], None, true),
            (&[], Some("uav1"), true),
        ] {
            let one = Considered::of(&judged("sensor-lag", platform), &[lag(truth)]);
            assert_eq!(one.is_true, is_true, "{truth:?} {platform:?}");
            assert!(one.terms.iter().all(|t| t.is_finite()));
        }
        let other = Considered::of(&judged("clock-offset", None), &[lag(&[])]);
        assert!(!other.is_true);
        assert!(!Considered::of(&judged("sensor-lag", None), &[]).is_true);
    }

    #[test]
    fn too_little_is_no_detection() {
        let json = serde_json::json!({"verdict": "insufficient", "causes": [],
            "insufficient": {"reason": "r", "would_do": "w"}, "data_quality": []});
        assert!(!outcome(Vec::new(), json).detected());
    }
}
