//! The verdict as `gap.json` has it (schema "plumage.gap/2"): one set of types for plume,
//! tracer and flight. What is not finite is written as null.

use formats::number::plus_minus;
use plume::Gas;
use scenario::observations::Observations;
pub use scenario::observations::{DataQuality, Flaw};
use serde::{Deserialize, Deserializer, Serialize};

use crate::applied::Applied;

/// Value of `schema`.
pub const SCHEMA: &str = "plumage.gap/2";

/// The answer in one word.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The base and its noise explain the data.
    #[default]
    None,
    /// Every cause is one mechanism, of a probability of .95 at least.
    Named,
    /// At least one cause is a set that the data cannot tell apart, or less sure.
    Ambiguous,
    /// Something is there that no mechanism of the catalogue explains, or that none explains well
    /// enough to be named.
    Unexplained,
    /// The data could not have shown anything.
    Insufficient,
}

impl Verdict {
    /// What causes, and whether something is left that none of them explains, come to.
    pub fn of(causes: &[Cause], unexplained: bool) -> Self {
        if unexplained {
            Self::Unexplained
        } else if causes.is_empty() {
            Self::None
        } else if causes.iter().all(Cause::is_named) {
            Self::Named
        } else {
            Self::Ambiguous
        }
    }
}

/// Reads a number that is null where it is not finite.
pub(crate) fn number_or_null<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// How strongly the data speak for a cause.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Gain of the maximal log score, nats.
    #[serde(deserialize_with = "number_or_null")]
    pub delta_log_score: f64,
    /// Gain of the log evidence, nats, after paying for parameters.
    #[serde(deserialize_with = "number_or_null")]
    pub delta_log_evidence: f64,
    /// Probability of so large a best score where nothing is hidden.
    #[serde(deserialize_with = "number_or_null")]
    pub p_value: f64,
}

/// A fitted parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Mechanism it belongs to.
    pub mechanism: String,
    /// Name, as in `docs/mechanisms.md`.
    pub name: String,
    /// Estimate.
    #[serde(deserialize_with = "number_or_null")]
    pub value: f64,
    /// One standard deviation.
    #[serde(deserialize_with = "number_or_null")]
    pub sd: f64,
    /// Unit.
    pub unit: String,
}

impl Parameter {
    /// Its unit as it follows a number in a sentence; nothing for a bare number.
    pub fn unit_after(&self) -> String {
        match self.unit.as_str() {
            "1" | "" => String::new(),
            unit => format!(" {unit}"),
        }
    }
}

/// One cause: a mechanism, or a set that the data cannot tell apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Mechanism ids, the most probable first.
    pub mechanisms: Vec<String>,
    /// Probability that the true cause is in the set.
    #[serde(deserialize_with = "number_or_null")]
    pub probability: f64,
    /// How strongly the data speak for it.
    pub evidence: Evidence,
    /// Parameters of the first mechanism.
    pub parameters: Vec<Parameter>,
    /// Its settings: numbers that it needs and that are not fitted; their standard deviation is 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub settings: Vec<Parameter>,
    /// Platforms it applies to; empty for all.
    pub platforms: Vec<String>,
    /// When it set in, s; null where it was there from the beginning or that is not asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub onset_s: Option<Measured>,
    /// Nats to the nearest rival outside the set.
    #[serde(deserialize_with = "number_or_null")]
    pub nats_to_next: f64,
}

impl Cause {
    /// Whether it is sure enough to extend a scenario. A probability that is not known is that of a mechanism without
    /// rival.
    pub fn is_sure(&self) -> bool {
        self.probability.is_nan() || self.probability >= infer::NAMED
    }

    /// Whether it is one mechanism, and sure.
    pub fn is_named(&self) -> bool {
        self.mechanisms.len() == 1 && self.is_sure()
    }

    /// When it set in, in words that follow its name; empty where it was there from the beginning or that is not asked.
    pub fn onset_after(&self) -> String {
        self.onset_s.map_or_else(String::new, |at| {
            format!(" from {} s on", plus_minus(at.value, at.sd))
        })
    }
}

/// A model that was tried.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// Mechanisms added to the base.
    pub mechanisms: Vec<String>,
    /// Platform it was tried for; null for all.
    pub platform: Option<String>,
    /// Gain of the log score over the model before, nats.
    pub delta_log_score: f64,
    /// Gain of the log evidence over the model before, nats.
    pub log_evidence: f64,
    /// Probability among all tried in this round.
    pub probability: f64,
}

/// Mean misfit in a part of the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualBin {
    /// Along what: "time", "across_wind", "along_wind", "height", "platform".
    pub coordinate: String,
    /// Platform; null for all.
    pub platform: Option<String>,
    /// From, in the coordinate's unit.
    pub from: f64,
    /// To, in the coordinate's unit.
    pub to: f64,
    /// Unit of `from` and `to`.
    pub unit: String,
    /// Readings in it.
    pub count: usize,
    /// Mean of measured minus predicted, ppm.
    pub mean_ppm: f64,
    /// The same in standard deviations of the noise model.
    pub standardised: f64,
}

/// Scores on data that the fit did not see, before and after the extension.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HeldOut {
    /// Log score, nats, of the base.
    pub log_score_before: f64,
    /// Log score, nats, of the extended model.
    pub log_score_after: f64,
    /// 95 % interval of the gain in log score, nats.
    pub log_score_gain_low: f64,
    /// 95 % interval of the gain in log score, nats.
    pub log_score_gain_high: f64,
    /// Root mean square error of the base.
    pub rmse_before: f64,
    /// Root mean square error of the extended model.
    pub rmse_after: f64,
    /// 95 % interval of the change of the RMSE (after minus before).
    pub rmse_change_low: f64,
    /// 95 % interval of the change of the RMSE (after minus before).
    pub rmse_change_high: f64,
    /// Part within a factor of two.
    pub fac2_before: f64,
    /// Part within a factor of two.
    pub fac2_after: f64,
    /// Fractional bias.
    pub fb_before: f64,
    /// Fractional bias.
    pub fb_after: f64,
    /// Normalised mean square error.
    pub nmse_before: f64,
    /// Normalised mean square error.
    pub nmse_after: f64,
    /// Geometric mean bias.
    pub mg_before: f64,
    /// Geometric mean bias.
    pub mg_after: f64,
    /// Geometric variance.
    pub vg_before: f64,
    /// Geometric variance.
    pub vg_after: f64,
    /// 95 % intervals of fac2, fb, nmse, mg, vg before: low then high of each.
    pub intervals_before: [[f64; 2]; 5],
    /// 95 % intervals of fac2, fb, nmse, mg, vg after: low then high of each.
    pub intervals_after: [[f64; 2]; 5],
}

/// What the extension gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gain {
    /// Number of blocks held out in turn.
    pub blocks: usize,
    /// Scores on them.
    pub held_out: HeldOut,
}

/// Gain of the log score at which an effect is almost surely detected, nats.
pub(crate) const DETECTABLE_NATS: f64 = 20.0;

/// The smallest effect that these data could have shown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Detectable {
    /// Mechanism id.
    pub mechanism: String,
    /// Its parameter.
    pub parameter: String,
    /// Size of the effect, as a departure from the neutral value.
    pub value: f64,
    /// Unit.
    pub unit: String,
}

/// A point of a proposed flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Waypoint {
    /// Time, s.
    pub time_s: f64,
    /// Latitude, degrees.
    pub lat_deg: f64,
    /// Longitude, degrees.
    pub lon_deg: f64,
    /// Altitude above mean sea level, m.
    pub alt_amsl_m: f64,
}

/// The flight that would tell rivals apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NextFlight {
    /// The rivals.
    pub separates: Vec<String>,
    /// Who must fly it; none where any platform will do.
    pub platform: Option<String>,
    /// What it is, in words.
    pub description: String,
    /// Where to fly.
    pub waypoints: Vec<Waypoint>,
    /// By how much the odds between those that it separates will shift on average, nats; not
    /// finite where that is not computed.
    pub expected_nats: f64,
    /// How probably they are told apart at 95 % once it is flown; not finite likewise.
    pub settles_probability: f64,
}

impl NextFlight {
    /// One that is described in words alone, for any platform.
    pub(crate) fn in_words(separates: &[String], description: &str) -> Self {
        Self {
            separates: separates.to_vec(),
            platform: None,
            description: description.to_owned(),
            waypoints: Vec::new(),
            expected_nats: f64::NAN,
            settles_probability: f64::NAN,
        }
    }
}

/// A parameter of the base.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BaseParameter {
    /// Dotted key of the scenario; of one sensor of a network `zero_ppm`, what it reads in clean air, or `gain`.
    pub name: String,
    /// Whose sensor it is of, where it is of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub platform: Option<String>,
    /// Estimate.
    pub value: f64,
    /// One standard deviation.
    pub sd: f64,
    /// One standard deviation of the prior.
    pub prior: f64,
}

impl BaseParameter {
    /// Its name, and whose it is.
    pub fn label(&self) -> String {
        let of = |platform: &String| format!("{} of {platform}", self.name);
        self.platform.as_ref().map_or(self.name.clone(), of)
    }
}

/// What kind of deviation no mechanism explains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum UnexplainedKind {
    /// Concentrations fluctuate, or the sensors scatter, beyond what is ordinary.
    Fluctuation,
    /// The plume's axis moves in a way that neither the logged wind nor ordinary turbulence explains.
    AxisMotion,
    /// The mean plume has another form than the model's.
    Discrepancy,
    /// The background varies in time or with height, the same for all sensors.
    Background,
    /// A mechanism explains much, but fails a check.
    FailedCheck,
    /// The readings do not follow the modelled plume.
    NoContact,
}

impl UnexplainedKind {
    /// It in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Fluctuation => "noise or fluctuation of concentrations beyond what is ordinary",
            Self::AxisMotion => "motion of the plume's axis",
            Self::Discrepancy => "a discrepancy of the model",
            Self::Background => "a background that varies for all sensors alike",
            Self::FailedCheck => "a mechanism that fails a check",
            Self::NoContact => "the readings do not follow the modelled plume",
        }
    }

    /// What to do about it.
    pub fn next_step(self) -> &'static str {
        match self {
            Self::Fluctuation => {
                "fly more passes, and learn the sensor's noise from five minutes of clean air (calibrate --learn-noise)"
            }
            Self::AxisMotion => "log the wind near the source, at the height of the plume",
            Self::Discrepancy => "fly passes at other distances and heights",
            Self::Background => {
                "measure the background: one vehicle or a fixed sensor upwind, or a profile beside the plume"
            }
            Self::FailedCheck => "repeat the passes: the mechanism stands if it predicts them",
            Self::NoContact => {
                "check the source's position, the wind direction and the clock of the log"
            }
        }
    }
}

impl From<infer::RestKind> for UnexplainedKind {
    fn from(kind: infer::RestKind) -> Self {
        match kind {
            infer::RestKind::Noise => Self::Fluctuation,
            infer::RestKind::AxisMotion => Self::AxisMotion,
            infer::RestKind::Discrepancy => Self::Discrepancy,
            infer::RestKind::Background(_) => Self::Background,
            infer::RestKind::None => Self::FailedCheck,
        }
    }
}

/// Where a misfit without a name lives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// What kind of deviation it is.
    pub kind: UnexplainedKind,
    /// "time", "platform", "across_wind", "along_wind", "height" or "map".
    pub coordinate: String,
    /// The flexible term that describes it, in words.
    pub term: String,
    /// Start of the stretch where it is strongest, s.
    pub from_s: f64,
    /// End of that stretch, s.
    pub to_s: f64,
    /// Platforms that show it.
    pub platforms: Vec<String>,
    /// Gain of the log evidence by that term, nats.
    pub delta_log_evidence: f64,
    /// What would explain much of it; at most four.
    pub candidates: Vec<Candidate>,
}

/// A number and how far it may be off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Estimate.
    #[serde(deserialize_with = "number_or_null")]
    pub value: f64,
    /// One standard deviation.
    #[serde(deserialize_with = "number_or_null")]
    pub sd: f64,
}

/// Two sensors on one platform, held against each other without any plume: the first reads
/// `zero + gain × (what the second read, late)`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pair {
    /// Who follows, and whom.
    pub platforms: [String; 2],
    /// Readings of the follower that were compared.
    pub rows: usize,
    /// Time constant of a first-order lag behind the other, s.
    pub time_constant_s: Measured,
    /// Delay behind the other, s.
    pub delay_s: Measured,
    /// Factor on what the other reads.
    pub gain: Measured,
    /// Reading where the other reads zero, ppm.
    pub zero_ppm: Measured,
    /// Correlation of the two as read.
    pub correlation_before: f64,
    /// The same with lag and delay.
    pub correlation_after: f64,
    /// Evidence for lag and delay over a sensor that differs by gain, zero and noise alone, nats.
    pub evidence_nats: f64,
}

impl Pair {
    /// It in a sentence.
    pub fn says(&self) -> String {
        let [follower, leader] = &self.platforms;
        let (lag, delay) = (self.time_constant_s, self.delay_s);
        format!(
            "{follower} follows {leader} with a time constant of {} s and a delay of {} s (correlation {:.2} as read, \
             {:.2} with them).",
            plus_minus(lag.value, lag.sd),
            plus_minus(delay.value, delay.sd),
            self.correlation_before,
            self.correlation_after
        )
    }
}

/// Whether the readings follow the plume at all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contact {
    /// Part of what passes show of a plume, in whatever direction each of them has it, that they show
    /// where the model has it: 1 where they follow it, 0 where they do not.
    pub share: f64,
    /// Passes that show a plume.
    pub passes: usize,
    /// Direction from which the wind would have to blow, degrees, with the standard deviation from pass
    /// to pass; null where no pass shows a plume.
    pub best_wind_from_deg: Option<Measured>,
    /// The same in words.
    pub says: String,
}

/// Why data could not have shown anything, and what would.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Insufficient {
    /// Why.
    pub reason: String,
    /// What would do.
    pub would_do: String,
}

/// A cause that would explain much of what is unexplained, but is not named.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// Mechanism ids.
    pub mechanisms: Vec<String>,
    /// Part of the passes drawn anew in which it is the likeliest.
    pub probability: f64,
    /// Gain of the log evidence where the model has no discrepancy, nats.
    pub log_evidence: f64,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
}

/// The error of the model's form that the readings show; it never goes into the extended file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Discrepancy {
    /// Its relative size: one standard deviation of the logarithm of the plume.
    pub size: f64,
    /// Axis drift and wander of the axis about the model's, degrees.
    pub wander_deg: f64,
    /// Log evidence of it, and of more noise than is known, over none, nats.
    pub log_evidence: f64,
}

/// The noise of readings and air that a fit found; standard deviations and memories.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Noise {
    /// White noise of a reading, ppm.
    pub white_ppm: f64,
    /// Slow wander of a sensor's zero, ppm.
    pub slow_ppm: f64,
    /// Its memory, s.
    pub slow_s: f64,
    /// Fluctuation of concentrations: standard deviation of the logarithm of the plume's part of a reading.
    pub fluctuation: f64,
    /// Its memory, s.
    pub fluctuation_s: f64,
    /// Fast wander of the plume's axis to the sides, degrees.
    pub axis_wander_deg: f64,
    /// Fast wander of the plume's axis up and down, as a part of the plume's σz.
    pub axis_wander_sigma_z: f64,
}

/// All of `gap.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct GapJson {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// The gas whose readings these are; absent where none was read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gas: Option<Gas>,
    /// Which readings these are; absent of tracers and flights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub readings: Option<Readings>,
    /// The answer.
    pub verdict: Verdict,
    /// The answer in words.
    pub summary: String,
    /// Named causes, the strongest first.
    pub causes: Vec<Cause>,
    /// Every model tried, the best first.
    pub ranking: Vec<Ranked>,
    /// Where and when the misfit of the base lives.
    pub residual: Vec<ResidualBin>,
    /// What the extension gains; null when nothing was added.
    pub gain: Option<Gain>,
    /// Smallest effects that these data could have shown.
    pub detectable: Vec<Detectable>,
    /// When ambiguous.
    pub next_flight: Option<NextFlight>,
    /// Fitted base.
    pub base: Vec<BaseParameter>,
    /// When unexplained.
    pub unexplained: Option<Unexplained>,
    /// When insufficient.
    pub insufficient: Option<Insufficient>,
    /// Whether the readings follow the plume at all; null where that is not asked.
    pub contact: Option<Contact>,
    /// Platforms that carry two sensors, held against each other; empty where none does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<Pair>,
    /// The error of the model's form; null where that is not asked.
    pub discrepancy: Option<Discrepancy>,
    /// The noise of readings and air; null where no plume was fitted.
    pub noise: Option<Noise>,
    /// Where an extension found before was applied: verdict and causes are those of that finding,
    /// and `gain` is that on these data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub applied: Option<Applied>,
    /// Flaws of the raw data.
    pub data_quality: Vec<DataQuality>,
    /// What a user should know besides.
    pub notices: Vec<String>,
}

/// By what readings are known again.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Readings {
    /// How many there are.
    pub count: usize,
    /// Time of the first, s.
    pub from_s: f64,
    /// Time of the last, s.
    pub to_s: f64,
    /// Their mean, ppm.
    pub mean_ppm: f64,
}

impl Readings {
    /// Those of the rows that hold one.
    pub fn of(observations: &Observations) -> Self {
        let rows = observations.rows.iter();
        let read = rows.filter_map(|r| r.co2_ppm.map(|ppm| (r.time_s, ppm)));
        let mut of = Self {
            count: 0,
            from_s: f64::INFINITY,
            to_s: f64::NEG_INFINITY,
            mean_ppm: 0.0,
        };
        for (time_s, ppm) in read {
            of.count += 1;
            of.from_s = of.from_s.min(time_s);
            of.to_s = of.to_s.max(time_s);
            of.mean_ppm += ppm;
        }
        of.mean_ppm /= of.count.max(1) as f64;
        of
    }

    /// Whether they are the same, but for the rounding of a file.
    pub fn are(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(1.0);
        self.count == other.count
            && near(self.from_s, other.from_s)
            && near(self.to_s, other.to_s)
            && near(self.mean_ppm, other.mean_ppm)
    }
}

impl GapJson {
    /// The text of `gap.json`, indented.
    ///
    /// # Errors
    /// Only if serialisation itself fails.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contract_names_and_null() {
        let evidence = Evidence {
            delta_log_score: 20.0,
            delta_log_evidence: 17.0,
            p_value: f64::NAN,
        };
        let text = serde_json::to_value(evidence).unwrap();
        assert!(text["p_value"].is_null());
        assert_eq!(
            serde_json::to_value(Verdict::Unexplained).unwrap(),
            "unexplained"
        );
        assert_eq!(serde_json::to_value(Flaw::Frozen).unwrap(), "frozen");
    }
}
