//! The tables behind a tracer verdict, and the verdict in words.

use formats::number::plus_minus;
use serde::Serialize;

use plume::stability::Stability;

use super::Answer;
use super::arcs::{Arc, Weather, class_limits_per_m};
use super::findings::Finding;
use super::ladder::{LateralModel, VerticalModel, Widths};
use super::model;
use super::trial_scores::Scored;
use super::tried::GroupDetail;
use crate::verdict::Gain;

/// Where one stability class ends and the next begins.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassLimit {
    /// The class, "A" to "F".
    pub class: char,
    /// It begins at this 1/L, 1/m; null for A.
    pub from_per_m: f64,
    /// It ends at this 1/L, 1/m; null for F.
    pub to_per_m: f64,
}

/// One arc, measured and predicted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArcDetail {
    /// Trial.
    pub trial: String,
    /// "unstable" or "stable".
    pub group: String,
    /// Class.
    pub class: char,
    /// Distance, m.
    pub distance_m: f64,
    /// Samplers with a value.
    pub samplers: usize,
    /// Whether integral and width hold (the plume ends inside the arc).
    pub whole: bool,
    /// Highest concentration, mg/m³.
    pub max_mg_m3: f64,
    /// Crosswind-integrated concentration, mg/m².
    pub integrated_mg_m2: f64,
    /// Width, m.
    pub width_m: f64,
    /// The base's maximum, mg/m³.
    pub base_max_mg_m3: f64,
    /// The base's integral, mg/m².
    pub base_integrated_mg_m2: f64,
    /// The base's width, m.
    pub base_width_m: f64,
    /// Maximum predicted from the other trials, mg/m³.
    pub held_out_max_mg_m3: f64,
    /// Integral predicted from the other trials, mg/m².
    pub held_out_integrated_mg_m2: f64,
    /// Width predicted from the other trials, m.
    pub held_out_width_m: f64,
}

pub(super) fn class_limits(roughness_m: f64) -> Vec<ClassLimit> {
    let limits = class_limits_per_m(roughness_m);
    let at = |i: usize| limits.get(i).copied().unwrap_or(f64::NAN);
    Stability::ALL
        .iter()
        .map(|c| {
            let i = c.index();
            let from_per_m = if i == 0 { f64::NAN } else { at(i - 1) };
            ClassLimit {
                class: c.letter(),
                from_per_m,
                to_per_m: at(i),
            }
        })
        .collect()
}

pub(super) fn group(answer: &Answer<'_>) -> GroupDetail {
    let lateral = |widths| answer.lateral_of(widths).map(|q| &q.finding);
    GroupDetail {
        group: answer.name.to_owned(),
        trials: answer
            .group
            .trials
            .iter()
            .map(|t| t.weather.trial.clone())
            .collect(),
        vertical: answer.vertical.finding.tried.clone(),
        lateral: lateral(Widths::WithAzimuth).map_or_else(Vec::new, |f| f.tried.clone()),
        lateral_without_azimuth: lateral(Widths::WithoutAzimuth)
            .map_or_else(Vec::new, |f| f.tried.clone()),
    }
}

/// Mean over models by their probability without trial `i`; models that cannot predict here
/// pass their share on, evenly if they had all of it.
fn averaged(
    scored: &[(usize, Scored)],
    i: usize,
    predict: impl Fn(usize, &[f64]) -> Option<f64>,
) -> f64 {
    let values: Vec<(f64, f64)> = scored
        .iter()
        .filter_map(|(m, s)| Some((s.weight_without[i], predict(*m, &s.theta_without[i])?)))
        .collect();
    let weight: f64 = values.iter().map(|v| v.0).sum();
    if weight > 0.0 {
        values.iter().map(|v| v.0 * v.1).sum::<f64>() / weight
    } else {
        values.iter().map(|v| v.1).sum::<f64>() / values.len() as f64
    }
}

/// Every arc with the base's prediction and that from the other trials.
pub(super) fn arcs(answers: &[Answer<'_>]) -> Vec<ArcDetail> {
    let vertical = VerticalModel::all();
    let mut out = Vec::new();
    for answer in answers {
        for (i, trial) in answer.group.trials.iter().enumerate() {
            let w = &trial.weather;
            let widths = answer.group.widths_of(i);
            let lateral = LateralModel::all(widths);
            let asked = answer.lateral_of(widths);
            for arc in &trial.arcs {
                let x = arc.distance_m;
                let integrated = averaged(&answer.vertical.scored, i, |m, theta| {
                    Some(model::log_integrated(w, arc, &vertical[m].changes, theta))
                });
                let base_width = || model::log_width(w, x, &[], &[]).unwrap_or(f64::NAN);
                let width = asked.map_or_else(base_width, |q| {
                    averaged(&q.scored, i, |m, theta| {
                        model::log_width(w, x, &lateral[m].changes, theta)
                    })
                });
                out.push(self::arc(w, answer.name, arc, integrated, width));
            }
        }
    }
    out
}

/// An arc in air of kind `group` with the base's prediction, and that of logarithms of integral, mg/m²,
/// and width, m.
pub(super) fn arc(
    w: &Weather,
    group: &str,
    arc: &Arc,
    log_integrated: f64,
    log_width: f64,
) -> ArcDetail {
    let base_integrated = model::log_integrated(w, arc, &[], &[]);
    let base_width = model::log_width(w, arc.distance_m, &[], &[]).unwrap_or(f64::NAN);
    ArcDetail {
        trial: w.trial.clone(),
        group: group.to_owned(),
        class: w.class.letter(),
        distance_m: arc.distance_m,
        samplers: arc.samplers,
        whole: arc.whole,
        max_mg_m3: arc.max_mg_m3,
        integrated_mg_m2: arc.integrated_mg_m2,
        width_m: arc.width_m,
        base_max_mg_m3: model::log_peak(base_integrated, base_width).exp(),
        base_integrated_mg_m2: base_integrated.exp(),
        base_width_m: base_width.exp(),
        held_out_max_mg_m3: model::log_peak(log_integrated, log_width).exp(),
        held_out_integrated_mg_m2: log_integrated.exp(),
        held_out_width_m: log_width.exp(),
    }
}

/// The verdict in a few sentences.
pub(super) fn summary(answers: &[Answer<'_>], gain: &Gain) -> String {
    let mut text = String::new();
    for answer in answers {
        let trials = answer.group.trials.len();
        text.push_str(&format!("In {} air ({trials} trials): ", answer.name));
        text.push_str(&vertical_words(answer));
        text.push_str("; ");
        text.push_str(&lateral_words(answer));
        text.push_str(". ");
    }
    let h = &gain.held_out;
    text.push_str(&format!(
        "Arc maxima of hold-out trials: FAC2 {:.2} to {:.2}, NMSE {:.2} to {:.2}.",
        h.fac2_before, h.fac2_after, h.nmse_before, h.nmse_after
    ));
    text
}

fn vertical_words(answer: &Answer<'_>) -> String {
    let finding = &answer.vertical.finding;
    let inputs = inputs_in_words(finding);
    let Some(cause) = finding.causes.first() else {
        return if inputs.is_empty() {
            format!(
                "Briggs' vertical spread and the measured wind do{}",
                hint(finding)
            )
        } else {
            format!(
                "no change of Briggs' vertical spread is needed{inputs}{}",
                hint(finding)
            )
        };
    };
    let (gain, error) = finding.held_out_gain;
    let mut words = String::new();
    if let Some(p) = cause.parameters.iter().find(|p| p.name == "exponent") {
        let sense = if p.value > 0.0 {
            "faster"
        } else {
            "more slowly"
        };
        words.push_str(&format!(
            "vertical spread grows {sense} with distance than Briggs says (exponent {})",
            plus_minus(p.value, p.sd)
        ));
    } else {
        words.push_str(&format!(
            "the vertical misfit is attributed to {}",
            cause.mechanisms[0]
        ));
    }
    if cause.mechanisms.len() > 1 {
        let set = cause.mechanisms.join(", ");
        words.push_str(&format!(
            ", in a set that these data cannot tell apart: {set} (probability {:.2}; of no cause \
             {:.2})",
            cause.probability,
            1.0 - finding.some_cause
        ));
    }
    for other in &finding.causes[1..] {
        words.push_str(&format!(", and {}", other.mechanisms.join(" or ")));
    }
    words.push_str(&inputs);
    words.push_str(&format!(
        ", {:.1} nats of evidence, {} nats on hold-out trials",
        cause.evidence.delta_log_evidence,
        plus_minus(gain, error)
    ));
    words
}

/// What numbers and gains of the best vertical model are relative to.
fn inputs_in_words(finding: &Finding) -> String {
    let mut words = String::new();
    if finding.relative_to.contains(&"spread-by-obukhov-length") {
        words.push_str(", once the spread lies between the classes' curves by 1/L");
    }
    if finding.relative_to.contains(&"wind-at-plume-height") {
        words.push_str(", with the wind at the plume's height");
    }
    words
}

/// What is likelier than not and still no name.
fn hint(finding: &Finding) -> String {
    let likely = finding.causes.is_empty() && finding.some_cause > 0.5;
    if likely && finding.tried[0].delta_log_evidence > 0.0 {
        format!(
            " (a change of it has a probability of {:.2}, too low to be named)",
            finding.some_cause
        )
    } else {
        String::new()
    }
}

fn lateral_words(answer: &Answer<'_>) -> String {
    let each = answer.lateral.iter().map(|(widths, question)| {
        let finding = &question.finding;
        let (gain, error) = finding.held_out_gain;
        let azimuth = !finding.relative_to.is_empty();
        let what = match (widths, azimuth, finding.causes.is_empty()) {
            (_, true, _) => "the measured deviation of azimuth improves the width",
            (_, _, true) => "Briggs' width does",
            (Widths::WithAzimuth, ..) => {
                "the width needs a correction of Briggs', and the deviation of azimuth does not help"
            }
            (Widths::WithoutAzimuth, ..) => {
                "the width of the trials without a deviation of azimuth needs a correction of Briggs'"
            }
        };
        let mut words = what.to_owned();
        let corrected = finding.causes.iter().flat_map(|c| &c.parameters);
        for p in corrected.filter(|p| p.mechanism.starts_with("sigma-y")) {
            words.push_str(&format!(", {} {}", p.name, plus_minus(p.value, p.sd)));
        }
        if azimuth && words.contains('±') {
            words.push_str(" relative to the width by it");
        }
        format!(
            "{words} ({} nats on hold-out trials)",
            plus_minus(gain, error)
        )
    });
    each.collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_follow_each_other_and_agree_with_the_classes() {
        let limits = class_limits(0.006);
        assert_eq!(limits.len(), 6);
        for pair in limits.windows(2) {
            assert!((pair[0].to_per_m - pair[1].from_per_m).abs() < 1e-12);
            assert!(pair[1].to_per_m.is_nan() || pair[1].to_per_m > pair[1].from_per_m);
        }
        let d = &limits[3];
        assert_eq!(
            Stability::from_obukhov(1.0 / (d.to_per_m - 1e-6), 0.006),
            Stability::D
        );
        assert_eq!(
            Stability::from_obukhov(1.0 / (d.to_per_m + 1e-6), 0.006),
            Stability::E
        );
    }
}
