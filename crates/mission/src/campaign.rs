//! One scenario flown with many seeds, and what the missions show together.

use crate::{MissionError, Run, Setup, truth};
use protocol::message::{Flux, PeakStatus};
use record::summary::{
    CORRECTED, MissionSummary, ModelNumber, Outcome, Summariser, SummaryContext,
};
use record::text;
use std::fmt::Write as _;

/// A found peak within this distance of the truth counts as found, m.
pub const FOUND_WITHIN_M: f64 = 150.0;

/// What a summary needs to know of a scenario beside its messages.
///
/// # Errors
/// A scenario that describes no world.
pub fn summary_context(setup: &Setup) -> Result<SummaryContext, MissionError> {
    let scenario = &setup.scenario;
    let has_reality = truth::has_stand_in(scenario);
    let reality = has_reality
        .then(|| truth::reality_numbers(scenario))
        .transpose()?;
    let true_peak = has_reality.then(|| truth::true_peak(setup)).transpose()?;
    let true_flux = if has_reality {
        truth::true_flux(scenario)?
    } else {
        Vec::new()
    };
    Ok(SummaryContext {
        seed: scenario.mission.seed,
        team: scenario.vehicles.iter().map(|v| v.id.clone()).collect(),
        frame: setup.frame()?,
        before: truth::numbers(scenario)?,
        reality,
        true_peak,
        true_flux,
    })
}

/// Flies one mission in virtual time and summarises it; `wall_s` of the summary is zero.
///
/// # Errors
/// A mission that cannot be flown.
pub fn fly(setup: &Setup) -> Result<MissionSummary, MissionError> {
    let mut run = Run::new(setup)?;
    let mut summariser = Summariser::new(summary_context(setup)?);
    while !run.ended() {
        for (topic, envelope) in run.step() {
            summariser.take(topic, envelope);
        }
    }
    Ok(summariser.summary(&run.digest(), 0.0))
}

/// Summaries of missions with different seeds.
#[derive(Debug, Clone, Default)]
pub struct Campaign {
    /// One summary a seed.
    pub missions: Vec<MissionSummary>,
}

impl Campaign {
    /// Errors left over errors before, one a mission, of the n-th of the corrected numbers;
    /// only where there was an error before.
    pub fn remaining(&self, number: usize) -> Vec<f64> {
        let all = self.missions.iter().flat_map(stated);
        let those = all.filter(|s| s.name == CORRECTED[number].name);
        those.filter_map(|s| s.left).collect()
    }

    /// Missions whose peak was found, and missions in which there was one to find.
    pub fn found(&self) -> (usize, usize) {
        let errors: Vec<f64> = self
            .missions
            .iter()
            .filter(|m| m.peak.truth.is_some())
            .map(|m| m.peak.error_m.unwrap_or(f64::INFINITY))
            .collect();
        (
            errors.iter().filter(|e| **e <= FOUND_WITHIN_M).count(),
            errors.len(),
        )
    }

    /// The campaign as a table in Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = String::from("| seed | peak error, m |");
        for number in &CORRECTED {
            let _ = write!(text, " {} before → after |", number.name);
        }
        text.push_str("\n|---|---|");
        text.push_str(&"---|".repeat(CORRECTED.len()));
        for mission in &self.missions {
            let error = mission
                .peak
                .error_m
                .map_or("-".to_owned(), |e| format!("{e:.0}"));
            let _ = write!(text, "\n| {} | {error} |", mission.seed);
            for number in &CORRECTED {
                let Some(errors) = NumberErrors::of(mission, number) else {
                    text.push_str(" - |");
                    continue;
                };
                let digits = number.digits;
                let _ = write!(
                    text,
                    " {:+.digits$} → {:+.digits$} {} |",
                    errors.before, errors.after, number.unit
                );
            }
        }
        let (found, of) = self.found();
        let _ = writeln!(
            text,
            "\n\nPeak found within {FOUND_WITHIN_M:.0} m: {found} of {of}. {}\n",
            self.endings()
        );
        text.push_str(&self.stated_table());
        text
    }

    /// What the missions show in one row of [`compared`].
    fn row(&self, name: &str) -> String {
        let m = || self.missions.iter();
        let (found, of) = self.found();
        let known: Vec<f64> = m().filter_map(|m| m.peak.known_s).collect();
        let count = known.len();
        let whole = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.0}"));
        // A mission that never knew its peak took longer than any that did.
        let never = vec![f64::INFINITY; self.missions.len() - count];
        let known_s = median(known.into_iter().chain(never).collect());
        let off_m = median(m().filter_map(|m| m.peak.error_m).collect());
        let flux_percent = m().flat_map(stated).filter(|s| s.name.starts_with(FLUX));
        let flux_percent = median(flux_percent.map(|s| s.error.abs()).collect());
        let km = median(
            m().map(|m| m.vehicles.iter().map(|v| v.distance_m).sum::<f64>() / 1000.0)
                .collect(),
        );
        format!(
            "| {name} | {found} of {of} | {count} of {} | {} | {} | {} | {} |",
            self.missions.len(),
            whole(known_s.filter(|s| s.is_finite())),
            whole(off_m),
            whole(flux_percent),
            whole(km)
        )
    }

    /// How missions ended, in words: what stands behind their peaks, and where their vehicles are.
    fn endings(&self) -> String {
        let is = |status: PeakStatus| {
            let those = self.missions.iter().filter(|m| m.peak.status == status);
            those.count()
        };
        let vehicles = || self.missions.iter().flat_map(|m| &m.vehicles);
        let landed = vehicles().filter(|v| v.outcome == Outcome::Landed).count();
        format!(
            "{} confirmed, {} supported, {} doubtful, {} not found. {landed} of {} vehicles landed.",
            is(PeakStatus::Confirmed),
            is(PeakStatus::Supported),
            is(PeakStatus::Doubtful),
            is(PeakStatus::NotFound),
            vehicles().count(),
        )
    }

    /// What missions state with a standard deviation against the reality of their stand-ins.
    fn stated_table(&self) -> String {
        let all: Vec<Stated> = self.missions.iter().flat_map(stated).collect();
        let mut names: Vec<&str> = Vec::new();
        for s in &all {
            if !names.contains(&s.name.as_str()) {
                names.push(&s.name);
            }
        }
        let mut text = String::from(
            "| number | truth within 2 sd | median error | median of the error before that is left |\n|---|---|---|---|\n",
        );
        let within = |those: &[&Stated]| those.iter().filter(|s| s.holds()).count();
        for name in names {
            let those: Vec<&Stated> = all.iter().filter(|s| s.name == name).collect();
            let error = median(those.iter().map(|s| s.error.abs()).collect()).unwrap_or(f64::NAN);
            let left = median(those.iter().filter_map(|s| s.left).collect());
            let _ = writeln!(
                text,
                "| {name} | {} of {} | {error:.digits$} {} | {} |",
                within(&those),
                those.len(),
                those[0].unit,
                left.map_or("-".to_owned(), |l| format!("{l:.3}")),
                digits = those[0].digits,
            );
        }
        let every: Vec<&Stated> = all.iter().collect();
        let _ = writeln!(
            text,
            "\nAll together: {} of {} within two standard deviations.",
            within(&every),
            every.len()
        );
        text
    }
}

/// Campaigns of the same missions beside each other, by name: a table in Markdown.
pub fn compared(campaigns: &[(String, Campaign)]) -> String {
    let mut text = format!(
        "| strategy | peak within {FOUND_WITHIN_M:.0} m | confirmed or supported | first at, s (median) | \
         peak off, m (median) | flux off, % (median) | flown, km (median) |\n|---|---|---|---|---|---|---|\n"
    );
    for (name, campaign) in campaigns {
        let _ = writeln!(text, "{}", campaign.row(name));
    }
    text
}

/// How far one of the model's numbers is from that of a stand-in's reality, in its unit.
pub(crate) struct NumberErrors {
    before: f64,
    /// After the mission, with the standard deviation that is stated then.
    pub after: f64,
    pub sd: f64,
}

impl NumberErrors {
    /// None where there is no stand-in, and so no reality that is known.
    pub fn of(mission: &MissionSummary, number: &ModelNumber) -> Option<Self> {
        let model = &mission.model;
        let truth = (number.of)(model.reality.as_ref()?).value;
        let [before, after] = [&model.before, &model.after].map(number.of);
        Some(Self {
            before: number.error(before.value, truth),
            after: number.error(after.value, truth),
            sd: after.sd,
        })
    }
}

/// How names of fluxes begin.
const FLUX: &str = "flux of";

/// A number that a mission states, against the truth.
struct Stated {
    name: String,
    unit: &'static str,
    digits: usize,
    error: f64,
    sd: f64,
    /// Error over that before the mission, where there was one.
    left: Option<f64>,
}

impl Stated {
    fn holds(&self) -> bool {
        self.error.abs() <= 2.0 * self.sd
    }
}

/// What a mission states of which the truth is known.
fn stated(mission: &MissionSummary) -> Vec<Stated> {
    let mut out = Vec::new();
    if let (Some(estimate), Some(truth)) = (&mission.peak.estimate, &mission.peak.truth) {
        out.push(Stated {
            name: "peak".to_owned(),
            unit: "ppm",
            digits: 0,
            error: estimate.co2_ppm - truth.co2_ppm,
            sd: estimate.sd_ppm,
            left: None,
        });
    }
    let of = |number: &ModelNumber| {
        let NumberErrors { before, after, sd } = NumberErrors::of(mission, number)?;
        Some(Stated {
            name: number.name.to_owned(),
            unit: number.unit,
            digits: number.digits,
            error: after,
            sd,
            left: (before != 0.0).then_some((after / before).abs()),
        })
    };
    out.extend(CORRECTED.iter().filter_map(of));
    for flux in &mission.flux {
        let Some(truth) = flux.truth_kg_s.filter(|q| *q > 0.0) else {
            continue;
        };
        let Flux {
            source,
            method,
            kg_s,
        } = &flux.found;
        out.push(Stated {
            name: format!("{FLUX} {source} by {}", text::flux_method(*method)),
            unit: "%",
            digits: 0,
            error: 100.0 * (kg_s.value / truth - 1.0),
            sd: 100.0 * kg_s.sd / truth,
            left: None,
        });
    }
    out
}

/// Median; none of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => None,
        _ if n % 2 == 1 => Some(values[n / 2]),
        _ => Some(f64::midpoint(values[n / 2 - 1], values[n / 2])),
    }
}
