//! A scenario that runs with what was found: the kind of air in which the cause is clearest,
//! with the median weather of its trials.

use std::fmt::Write as _;

use super::arcs::Weather;
use super::parameters::parameters;
use super::trial_scores::Scored;
use super::{Answer, Question};

/// Mechanisms that a scenario can run, over Briggs' curves and its own wind.
const RUNNABLE: [&str; 5] = [
    "sigma-z-scale",
    "sigma-z-growth",
    "sigma-y-scale",
    "dry-deposition",
    "emission-scale",
];

/// The scenario as TOML. Tracer tables say nothing of the place on Earth: the site is at 0, 0.
/// The other kind of air follows as a comment.
pub(super) fn scenario(answers: &[Answer<'_>]) -> String {
    let strength = |a: &Answer<'_>| {
        let causes = a.questions().flat_map(|q| &q.finding.causes);
        causes
            .map(|c| c.evidence.delta_log_evidence)
            .fold(0.0, f64::max)
    };
    let mut order: Vec<&Answer<'_>> = answers.iter().collect();
    order.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
    let mut toml = String::new();
    for (k, answer) in order.into_iter().enumerate() {
        if k == 0 {
            toml.push_str(
                "# tracer trials; the tables do not give the place on Earth\n[site]\nlat_deg = 0.0\nlon_deg = \
                 0.0\nground_amsl_m = 0.0\n\n[plume]\nground_reflection = true\n\n",
            );
            toml.push_str(&air(answer));
        } else {
            toml.push_str("\n# The other kind of air: these in place of the tables above.\n");
            for line in air(answer).lines() {
                let _ = writeln!(toml, "# {line}");
            }
        }
    }
    toml
}

/// Weather, source and mechanisms of one kind of air.
fn air(answer: &Answer<'_>) -> String {
    let median = |f: &dyn Fn(&Weather) -> f64| {
        let mut all: Vec<f64> = answer.group.trials.iter().map(|t| f(&t.weather)).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let class = median(&|w| w.class.index() as f64) as usize;
    let mut toml = format!(
        "# {} air\n[weather]\nwind_speed_m_s = {:.2}\nwind_height_agl_m = {:.2}\n\
         stability = \"{}\"\n\n\
         [[source]]\nname = \"tracer\"\nlat_deg = 0.0\nlon_deg = 0.0\nstack_height_m = {:.2}\n\
         emission_kg_s = {:.5}\n",
        answer.name,
        median(&|w| w.wind_speed_m_s),
        median(&|w| w.wind_height_m),
        ["A", "B", "C", "D", "E", "F"][class],
        median(&|w| w.source_height_m),
        median(&|w| w.release_mg_s * 1e-6),
    );
    for question in answer.questions() {
        toml.push_str(&mechanisms(question));
    }
    toml
}

/// What a scenario can run of a question's answer: the best model over Briggs' curves and the
/// wind as measured, fitted as such, since numbers found on top of other inputs hold there only.
fn mechanisms(question: &Question) -> String {
    if question.finding.causes.is_empty() {
        return String::new();
    }
    let runs = |s: &&Scored| s.ids.iter().all(|id| RUNNABLE.contains(id));
    let candidates = question.scored.iter().map(|s| &s.1).filter(runs);
    let best = candidates.max_by(|a, b| a.fit.log_evidence.total_cmp(&b.fit.log_evidence));
    let sets = question.finding.causes.iter();
    let found: Vec<String> = sets.map(|c| c.mechanisms.join(" or ")).collect();
    let Some(best) = best.filter(|b| !b.ids.is_empty()) else {
        return format!(
            "\n# {}: no mechanism of a scenario improves on Briggs' curves enough for its parameters\n",
            found.join("; ")
        );
    };
    let mut toml = String::new();
    for p in parameters(best) {
        // Writing into a String cannot fail.
        let _ = write!(
            toml,
            "\n[[mechanism]] # for {}, fitted over Briggs' class curve and the wind as measured\n\
             id = \"{}\"\n{} = {:.6} # sd {:.6}\n",
            found.join("; "),
            p.mechanism,
            p.name,
            p.value,
            p.sd
        );
    }
    toml
}
