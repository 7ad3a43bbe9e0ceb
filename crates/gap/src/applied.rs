//! An extension that was found before, held against data that had no part in finding it: what of an
//! earlier `gap.json` is needed, and what an application comes to.

use ::plume::Gas;
use serde::{Deserialize, Serialize};

use crate::GapError;
use crate::tracer::GroupDetail;
use crate::verdict::{Cause, HeldOut, Readings, SCHEMA, Verdict};

/// Whether an extension helps on data that had no part in finding it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// A score is better beyond chance, and none is worse.
    Helps,
    /// A score is worse beyond chance, and none is better.
    Hurts,
    /// One score is better beyond chance and another one worse.
    Mixed,
    /// Neither is beyond chance.
    Undecided,
}

impl Outcome {
    /// From the 95 % intervals, over independent parts of the data, of changes that are gains where
    /// they are below zero.
    pub fn of(changes: &[[f64; 2]]) -> Self {
        let better = changes.iter().any(|c| c[1] < 0.0);
        let worse = changes.iter().any(|c| c[0] > 0.0);
        match (better, worse) {
            (true, false) => Self::Helps,
            (false, true) => Self::Hurts,
            (true, true) => Self::Mixed,
            (false, false) => Self::Undecided,
        }
    }

    /// It in a few words.
    pub fn says(self) -> &'static str {
        match self {
            Self::Helps => "The extension helps here",
            Self::Hurts => "The extension makes it worse here",
            Self::Mixed => "The extension improves one score here and worsens another",
            Self::Undecided => "These data cannot show whether the extension helps",
        }
    }
}

/// One quantity, predicted by the base and by the extension.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AppliedScore {
    /// What is predicted: "maximum", "integral" or "width" of an arc.
    pub what: String,
    /// Kind of air or platform; null for all.
    pub of: Option<String>,
    /// How many were measured.
    pub count: usize,
    /// Part within a factor of two, base.
    pub fac2_before: f64,
    /// Part within a factor of two, extension.
    pub fac2_after: f64,
    /// Normalised mean square error, base.
    pub nmse_before: f64,
    /// Normalised mean square error, extension.
    pub nmse_after: f64,
    /// Root mean square of ln(measured / predicted), base.
    pub rms_ln_before: f64,
    /// Root mean square of ln(measured / predicted), extension.
    pub rms_ln_after: f64,
}

/// An application of an earlier finding.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Applied {
    /// Where the extension comes from.
    pub from: String,
    /// Whether it helps.
    pub outcome: Outcome,
    /// The same in words.
    pub says: String,
    /// What of the base was fitted to the new data; empty where nothing was.
    pub fitted: Vec<String>,
    /// Scores of the parts of the new data; empty where they have none.
    pub scores: Vec<AppliedScore>,
}

/// What an application takes of an earlier `gap.json`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Earlier {
    /// Where it comes from, for messages.
    #[serde(skip)]
    pub name: String,
    schema: String,
    /// The gas that it was found on; none of tracers and flights.
    gas: Option<Gas>,
    /// The readings that it was found in.
    readings: Option<Readings>,
    /// What it said.
    pub verdict: Verdict,
    /// The causes that it names.
    pub causes: Vec<Cause>,
    tracer: Option<EarlierTracer>,
    flight: Option<serde::de::IgnoredAny>,
    applied: Option<serde::de::IgnoredAny>,
}

/// What an application takes of the models of an earlier tracer analysis.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct EarlierTracer {
    /// For each of the causes the inputs that its numbers are relative to.
    pub relative_to: Vec<Vec<String>>,
    /// Kinds of air with the models tried.
    pub groups: Vec<GroupDetail>,
}

impl Earlier {
    /// Reads the text of a `gap.json`; `name` serves the messages only.
    ///
    /// # Errors
    /// Text that is no `gap.json` of this schema, or that of an application, which found nothing itself.
    pub fn parse(name: &str, text: &str) -> Result<Self, GapError> {
        let wrong = |problem: String, expected: &str| GapError::Data {
            what: name.to_owned(),
            problem,
            expected: expected.to_owned(),
        };
        let expected = format!("gap.json of plumage gap, schema {SCHEMA}");
        let mut earlier: Self = serde_json::from_str(text)
            .map_err(|e| wrong(format!("not a readable gap.json: {e}"), &expected))?;
        if earlier.schema != SCHEMA {
            let problem = format!("its schema is {:?}", earlier.schema);
            return Err(wrong(problem, &expected));
        }
        if earlier.applied.is_some() {
            let problem = "it describes an applied extension, not one that was found".to_owned();
            return Err(wrong(
                problem,
                "the gap.json in which the extension was found",
            ));
        }
        earlier.name = name.to_owned();
        Ok(earlier)
    }

    /// A warning where the readings are those that the extension was found in: it helps there by its making.
    pub(crate) fn was_found_in(&self, readings: &Readings) -> Option<String> {
        let same = self.readings.is_some_and(|r| r.are(readings));
        same.then(|| {
            format!(
                "these are the readings in which {} was found, so their scores are not a hold-out test",
                self.name
            )
        })
    }

    /// Checks that the readings are of the gas that the extension was found on: its numbers are of that sensor and
    /// that source.
    ///
    /// # Errors
    /// Another gas, or a finding that does not say it.
    pub(crate) fn check_gas(&self, gas: Gas) -> Result<(), GapError> {
        if self.gas == Some(gas) {
            return Ok(());
        }
        let said = self.gas.map_or("no gas", Gas::formula);
        Err(GapError::Data {
            what: self.name.clone(),
            problem: format!(
                "it is about {said}, but the readings are of {}",
                gas.formula()
            ),
            expected: format!("a gap.json from readings of {}", gas.formula()),
        })
    }

    fn kind(&self) -> &'static str {
        match (&self.tracer, &self.flight) {
            (Some(_), _) => "tracer",
            (_, Some(_)) => "flight",
            _ => "plume",
        }
    }

    fn other_kind(&self, asked: &str) -> GapError {
        GapError::Data {
            what: self.name.clone(),
            problem: format!("it was written by plumage gap {}", self.kind()),
            expected: format!(
                "a gap.json of plumage gap {asked}, since extensions apply to data of their kind"
            ),
        }
    }

    /// The models of tracer trials.
    ///
    /// # Errors
    /// A finding of another kind of data.
    pub fn tracer(&self) -> Result<&EarlierTracer, GapError> {
        self.tracer
            .as_ref()
            .ok_or_else(|| self.other_kind("tracer"))
    }

    /// The causes found in readings along tracks, at least one.
    ///
    /// # Errors
    /// A finding of another kind of data, or one that names nothing.
    pub fn plume(&self) -> Result<&[Cause], GapError> {
        if self.kind() != "plume" {
            return Err(self.other_kind("plume"));
        }
        if self.causes.is_empty() {
            return Err(GapError::Data {
                what: self.name.clone(),
                problem: "it names no cause, so there is no extension".to_owned(),
                expected: "a gap.json with causes".to_owned(),
            });
        }
        Ok(&self.causes)
    }
}

/// FAC2, NMSE and RMSE of base and extension in a sentence; `unit` follows the RMSE.
pub(crate) fn scores_in_words(h: &HeldOut, unit: &str, digits: usize) -> String {
    format!(
        "FAC2 {:.2} to {:.2}, NMSE {:.2} to {:.2}, RMSE {:.digits$} to {:.digits$} {unit} (95 % interval of its \
         change {:.digits$} to {:.digits$})",
        h.fac2_before,
        h.fac2_after,
        h.nmse_before,
        h.nmse_after,
        h.rmse_before,
        h.rmse_after,
        h.rmse_change_low,
        h.rmse_change_high
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outcome_needs_an_interval_on_one_side_of_zero() {
        let of = |changes: &[[f64; 2]]| Outcome::of(changes);
        assert_eq!(of(&[[-2.0, -1.0], [-1.0, 1.0]]), Outcome::Helps);
        assert_eq!(of(&[[1.0, 2.0], [-1.0, 1.0]]), Outcome::Hurts);
        assert_eq!(of(&[[1.0, 2.0], [-2.0, -1.0]]), Outcome::Mixed);
        assert_eq!(of(&[[-1.0, 2.0]]), Outcome::Undecided);
        assert_eq!(of(&[[f64::NAN; 2]]), Outcome::Undecided);
    }

    #[test]
    fn another_kind_is_refused_in_words() {
        let head = r#"{"schema":"plumage.gap/2","verdict":"named","causes":[]"#;
        let of = |rest: &str| Earlier::parse("g.json", &format!("{head}{rest}}}"));
        let tracer = of(r#","tracer":{"relative_to":[],"groups":[]}"#).unwrap();
        let flight = of(r#","flight":{}"#).unwrap();
        assert!(tracer.tracer().is_ok());
        let says = |e: Result<&[Cause], GapError>| e.unwrap_err().to_string();
        assert_eq!(
            says(tracer.plume()),
            "g.json: it was written by plumage gap tracer; expected a gap.json of plumage gap plume, since \
             extensions apply to data of their kind"
        );
        assert!(flight.tracer().is_err() && flight.plume().is_err());
        assert!(says(of("").unwrap().plume()).contains("names no cause"));
        assert!(of(r#","applied":{}"#).is_err());
        assert!(Earlier::parse("g.json", "{}").is_err());
    }
}
