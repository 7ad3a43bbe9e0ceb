//! The verdict on tracer trials in a few sentences.

use formats::number::plus_minus;

use super::Answer;
use super::findings::{Finding, LIKELY};
use super::model::{CONTINUUM, PLUME_WIND};
use crate::verdict::Gain;

/// The verdict in words.
pub fn summary(answers: &[Answer<'_>], gain: &Gain) -> String {
    let mut text = String::new();
    for answer in answers {
        let (name, trials) = (answer.name, answer.trials.len());
        let [vertical, lateral @ ..] = &answer.findings;
        let vertical = vertical.as_ref().map(vertical_words);
        let lateral = lateral.iter().zip([LATERAL, LATERAL_WITHOUT_AZIMUTH]);
        let lateral = lateral.filter_map(|(q, what)| Some(lateral_words(q.as_ref()?, what)));
        let words: Vec<String> = vertical.into_iter().chain(lateral).collect();
        let words = words.join("; ");
        text.push_str(&format!("In {name} air ({trials} trials): {words}. "));
    }
    let h = &gain.held_out;
    text.push_str(&format!(
        "Arc maxima of hold-out trials: FAC2 {:.2} to {:.2}, NMSE {:.2} to {:.2}.",
        h.fac2_before, h.fac2_after, h.nmse_before, h.nmse_after
    ));
    text
}

fn vertical_words(finding: &Finding) -> String {
    let inputs = inputs_in_words(finding);
    let Some(cause) = finding.causes.first() else {
        let hint = hint(finding);
        return if inputs.is_empty() {
            format!("Briggs' vertical spread and the measured wind do{hint}")
        } else {
            format!("no change of Briggs' vertical spread is needed{inputs}{hint}")
        };
    };
    let exponent = cause.parameters.iter().find(|p| p.name == "exponent");
    let mut words = match exponent.map(|p| (p.value > 0.0, plus_minus(p.value, p.sd))) {
        Some((is_faster, exponent)) => {
            let sense = if is_faster { "faster" } else { "more slowly" };
            format!(
                "vertical spread grows {sense} with distance than Briggs says (exponent {exponent})"
            )
        }
        None => format!(
            "the vertical misfit is attributed to {}",
            cause.mechanisms[0]
        ),
    };
    if cause.mechanisms.len() > 1 {
        words.push_str(&format!(
            ", in a set that these data cannot tell apart: {} (probability {:.2}; of no cause {:.2})",
            cause.mechanisms.join(", "),
            cause.probability,
            1.0 - finding.some_cause
        ));
    }
    for other in &finding.causes[1..] {
        words.push_str(&format!(", and {}", other.mechanisms.join(" or ")));
    }
    let (gain, error) = finding.held_out_gain;
    format!(
        "{words}{inputs}, {:.1} nats of evidence, {} nats on hold-out trials",
        cause.evidence.delta_log_evidence,
        plus_minus(gain, error)
    )
}

/// What numbers and gains of the best vertical model are relative to.
fn inputs_in_words(finding: &Finding) -> String {
    let uses = |id: &str| finding.relative_to.iter().any(|i| i == id);
    let mut words = String::new();
    if uses(CONTINUUM) {
        words.push_str(", once the spread lies between the classes' curves by 1/L");
    }
    if uses(PLUME_WIND) {
        words.push_str(", with the wind at the plume's height");
    }
    words
}

/// What is likelier than not and still no name.
fn hint(finding: &Finding) -> String {
    let some_cause = finding.some_cause;
    if some_cause > LIKELY && finding.tried[0].delta_log_evidence > 0.0 {
        format!(" (a change of it has a probability of {some_cause:.2}, too low to be named)")
    } else {
        String::new()
    }
}

/// What is corrected where the widths of trials with and without a deviation of azimuth need it.
const LATERAL: &str =
    "the width needs a correction of Briggs', and the deviation of azimuth does not help";
const LATERAL_WITHOUT_AZIMUTH: &str =
    "the width of the trials without a deviation of azimuth needs a correction of Briggs'";

fn lateral_words(finding: &Finding, corrected: &str) -> String {
    let azimuth = !finding.relative_to.is_empty();
    let mut words = match (azimuth, finding.causes.is_empty()) {
        (true, _) => "the measured deviation of azimuth improves the width",
        (false, true) => "Briggs' width does",
        (false, false) => corrected,
    }
    .to_owned();
    let parameters = finding.causes.iter().flat_map(|c| &c.parameters);
    for p in parameters {
        words.push_str(&format!(", {} {}", p.name, plus_minus(p.value, p.sd)));
    }
    if azimuth && words.contains('±') {
        words.push_str(" relative to the width by it");
    }
    let (gain, error) = finding.held_out_gain;
    format!(
        "{words} ({} nats on hold-out trials)",
        plus_minus(gain, error)
    )
}
