//! A scenario that runs with what was found: the kind of air in which the cause is clearest,
//! with the median weather of its trials.

use plume::stability::Stability;

use super::Answer;
use super::arcs::Weather;
use super::findings::Finding;
use super::fit::Scored;
use super::model::{DEPOSITION, EMISSION, Y_SCALE, Z_GROWTH, Z_SCALE};
use crate::statistics::median;

/// Changes that a scenario can run, over Briggs' curves and its own wind.
const RUNNABLE: [&str; 5] = [Z_SCALE, Z_GROWTH, Y_SCALE, DEPOSITION, EMISSION];

/// The scenario as TOML. Tracer tables say nothing of the place on Earth: the site is at 0, 0.
/// The other kind of air follows as a comment.
pub fn scenario(answers: &[Answer<'_>]) -> String {
    let strength = |a: &&Answer<'_>| {
        let causes = a.findings().flat_map(|f| &f.causes);
        let nats = causes.map(|c| c.evidence.delta_log_evidence);
        nats.fold(0.0, f64::max)
    };
    let mut order: Vec<&Answer<'_>> = answers.iter().collect();
    order.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
    let mut toml = String::from(
        "# tracer trials; the tables do not give the place on Earth\n[site]\nlat_deg = 0.0\nlon_deg = \
         0.0\nground_amsl_m = 0.0\n\n[plume]\nground_reflection = true\n\n",
    );
    toml.push_str(&air(order[0]));
    for other in &order[1..] {
        toml.push_str("\n# The other kind of air: these in place of the tables above.\n");
        let lines = air(other);
        toml.extend(lines.lines().map(|line| format!("# {line}\n")));
    }
    toml
}

/// Weather, source and mechanisms of one kind of air.
fn air(answer: &Answer<'_>) -> String {
    let middle = |f: fn(&Weather) -> f64| {
        let all = answer.trials.iter().map(|t| f(&t.weather));
        median(all.collect()).unwrap_or(f64::NAN)
    };
    let class = middle(|w| w.class.index() as f64) as usize;
    let mut toml = format!(
        "# {} air\n[weather]\nwind_speed_m_s = {:.2}\nwind_height_agl_m = {:.2}\n\
         stability = \"{}\"\n\n\
         [[source]]\nname = \"tracer\"\nlat_deg = 0.0\nlon_deg = 0.0\nstack_height_m = {:.2}\n\
         emission_kg_s = {:.5}\n",
        answer.name,
        middle(|w| w.wind_speed_m_s),
        middle(|w| w.wind_height_m),
        Stability::ALL[class].letter(),
        middle(|w| w.source_height_m),
        middle(|w| w.release_mg_s * 1e-6),
    );
    toml.extend(answer.findings().map(mechanisms));
    toml
}

/// What a scenario can run of a question's answer: the best model over Briggs' curves and the
/// wind as measured, fitted as such, since numbers found on top of other inputs hold there only.
fn mechanisms(finding: &Finding) -> String {
    let causes = finding.causes.iter();
    let found: Vec<String> = causes.map(|c| c.mechanisms.join(" or ")).collect();
    let found = found.join("; ");
    let runs = |s: &&Scored| s.model.ids.iter().all(|id| RUNNABLE.contains(id));
    let best = finding.scored.iter().find(runs);
    match best.filter(|b| !b.model.ids.is_empty()) {
        _ if found.is_empty() => String::new(),
        None => format!(
            "\n# {found}: no mechanism of a scenario improves on Briggs' curves enough for its parameters\n"
        ),
        Some(best) => {
            let parameters = best.parameters().into_iter();
            let table = parameters.map(|p| {
                format!(
                    "\n[[mechanism]] # for {found}, fitted over Briggs' class curve and the wind as measured\n\
                     id = \"{}\"\n{} = {:.6} # sd {:.6}\n",
                    p.mechanism, p.name, p.value, p.sd
                )
            });
            table.collect()
        }
    }
}
