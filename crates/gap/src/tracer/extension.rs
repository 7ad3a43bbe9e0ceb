//! A scenario that runs with what was found: the kind of air in which the cause is clearest,
//! with the median weather of its trials.

use std::fmt::Write as _;

use super::Answer;
use crate::verdict::Parameter;

/// Mechanisms that a scenario can run.
const RUNNABLE: [&str; 4] = [
    "sigma-z-scale",
    "sigma-z-growth",
    "sigma-y-scale",
    "dry-deposition",
];

/// The scenario as TOML. Tracer tables say nothing of the place on Earth: the site is at 0, 0.
pub(super) fn scenario(answers: &[Answer<'_>]) -> String {
    let strength = |a: &Answer<'_>| {
        a.findings[0]
            .causes
            .first()
            .map_or(0.0, |c| c.evidence.delta_log_evidence)
    };
    let Some(answer) = answers
        .iter()
        .max_by(|a, b| strength(a).total_cmp(&strength(b)))
    else {
        return String::new();
    };
    let median = |f: &dyn Fn(&super::arcs::Weather) -> f64| {
        let mut all: Vec<f64> = answer.group.trials.iter().map(|t| f(&t.weather)).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let class = median(&|w| w.class.index() as f64) as usize;
    let mut toml = format!(
        "# {} air of tracer trials; the place on Earth is not known to the tables\n\
         [site]\nlat_deg = 0.0\nlon_deg = 0.0\nground_amsl_m = 0.0\n\n\
         [weather]\nwind_speed_m_s = {:.2}\nwind_height_agl_m = {:.2}\nstability = \"{}\"\n\n\
         [plume]\nground_reflection = true\n\n\
         [[source]]\nname = \"tracer\"\nlat_deg = 0.0\nlon_deg = 0.0\nstack_height_m = {:.2}\n\
         emission_kg_s = {:.5}\n",
        answer.name,
        median(&|w| w.wind_speed_m_s),
        median(&|w| w.wind_height_m),
        ["A", "B", "C", "D", "E", "F"][class],
        median(&|w| w.source_height_m),
        median(&|w| w.release_mg_s * 1e-6),
    );
    let parameters: Vec<&Parameter> = answer
        .findings
        .iter()
        .filter_map(|f| f.causes.first())
        .flat_map(|c| &c.parameters)
        .collect();
    for p in parameters
        .iter()
        .filter(|p| RUNNABLE.contains(&p.mechanism.as_str()))
    {
        // Writing into a String cannot fail.
        let _ = write!(
            toml,
            "\n[[mechanism]]\nid = \"{}\"\n{} = {:.6} # sd {:.6}\n",
            p.mechanism, p.name, p.value, p.sd
        );
    }
    toml
}
