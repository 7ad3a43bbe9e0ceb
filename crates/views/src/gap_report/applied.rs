//! The report of an extension found before, on data that had no part in finding it.

use super::{autocorrelation, base_table, departs_most, figures, gain_table, gas, lead, maps, set};
use crate::html::{Document, number};
use formats::number::{significant, value_and_sd};
use gap::applied::{Applied, AppliedScore, Outcome};
use gap::plume::GapReport;
use gap::tracer::TracerReport;
use gap::verdict::GapJson;

/// The report of models of earlier tracer trials on others. `title` names the data.
pub fn applied_tracer(title: &str, report: &TracerReport) -> Document {
    let mut page = opening(
        "Plumage gap report: an extension on other trials",
        title,
        &report.gap,
    );
    page.figure(
        figures::arcs(&report.tracer.arcs),
        "Predicted over measured on every whole arc, by distance: crosswind-integrated \
         concentration (vertical spread, transport, loss) and width (lateral spread). Grey: the \
         base. Blue: the extension, found on other trials. Circles: unstable air; diamonds: stable \
         air. One is right.",
    );
    page.paragraph(
        "The extension is the mean of the earlier models, weighted by their probability, with the parameters \
         found there. Nothing was fitted to these trials.",
    );
    closing(&mut page, &report.gap);
    page
}

/// The report of a cause found in earlier readings, on others. `title` names the data.
pub fn applied_plume(title: &str, json: &GapJson, report: &GapReport) -> Document {
    let mut page = opening(
        "Plumage gap report: an extension on other readings",
        title,
        json,
    );
    departs_most(&mut page, json, report);
    maps(&mut page, report);
    autocorrelation(&mut page, report);
    closing(&mut page, json);
    page
}

fn opening(kicker: &str, title: &str, json: &GapJson) -> Document {
    let mut page = Document::new(kicker, title);
    let found = match json.applied.as_ref().map(|a| a.outcome) {
        Some(Outcome::Helps) => "The earlier extension predicts these data better than the base.",
        Some(Outcome::Hurts) => "The earlier extension predicts these data worse than the base.",
        Some(Outcome::Mixed) => {
            "The earlier extension predicts a part of these data better than the base and a part worse."
        }
        Some(Outcome::Undecided) | None => {
            "These data do not decide whether the earlier extension is better than the base."
        }
    };
    page.lead(&lead(title, json, found.to_owned(), &json.summary));
    let mut cards = Vec::new();
    if let Some(applied) = &json.applied {
        cards.push((
            word(applied.outcome).to_owned(),
            "",
            "the extension here".to_owned(),
        ));
    }
    if let Some(h) = json.gain.as_ref().map(|g| &g.held_out) {
        let part = 100.0 * (h.rmse_after / h.rmse_before - 1.0);
        cards.push((
            number(part, 0),
            "%",
            "change of the error (RMSE)".to_owned(),
        ));
        let fac2 = format!(
            "{} to {}",
            number(h.fac2_before, 2),
            number(h.fac2_after, 2)
        );
        cards.push((fac2, "", "within a factor of two".to_owned()));
    }
    page.cards(&cards);
    page.section("Base and extension on these data");
    page
}

fn word(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Helps => "helps",
        Outcome::Hurts => "hurts",
        Outcome::Mixed => "mixed",
        Outcome::Undecided => "undecided",
    }
}

fn closing(page: &mut Document, json: &GapJson) {
    let Some(applied) = &json.applied else { return };
    if let Some(gain) = &json.gain {
        gain_table(page, &gain.held_out);
    }
    scores(page, &applied.scores);
    what(page, json, applied);
    if !json.notices.is_empty() {
        page.section("Notes");
        page.list(&json.notices);
    }
}

fn scores(page: &mut Document, scores: &[AppliedScore]) {
    if scores.is_empty() {
        return;
    }
    let pair = |a: f64, b: f64| format!("{} to {}", significant(a), significant(b));
    let row = |s: &AppliedScore| {
        vec![
            s.what.clone(),
            s.of.clone().unwrap_or_else(|| "all".to_owned()),
            s.count.to_string(),
            pair(s.fac2_before, s.fac2_after),
            pair(s.nmse_before, s.nmse_after),
            pair(s.rms_ln_before, s.rms_ln_after),
        ]
    };
    page.table(
        "Base to extension: part within a factor of two, normalised mean square error, and root mean square of \
         ln (measured / predicted).",
        &["of arcs", "air", "number", "FAC2", "NMSE", "rms ln"],
        &scores.iter().map(row).collect::<Vec<_>>(),
    );
}

/// What was applied, and what of the base was fitted.
fn what(page: &mut Document, json: &GapJson, applied: &Applied) {
    page.section("Applied causes");
    let rows: Vec<Vec<String>> = json
        .causes
        .iter()
        .flat_map(|c| c.parameters.iter().map(move |p| (c, p)))
        .map(|(c, p)| {
            let [value, sd] = value_and_sd(p.value, p.sd);
            let name = format!("{}.{}", p.mechanism, p.name);
            vec![set(c), name, value, sd, p.unit.clone()]
        })
        .collect();
    if rows.is_empty() {
        page.paragraph(&format!("{} names no cause.", applied.from));
    } else {
        page.table(
            &format!("Causes in {}.", applied.from),
            &["cause", "parameter", "value", "± 1 sd", "unit"],
            &rows,
        );
    }
    page.paragraph(&if applied.fitted.is_empty() {
        "No base parameter was fitted to these data.".to_owned()
    } else {
        format!(
            "Fitted to these data, in base and extension: {}.",
            applied.fitted.join(", ")
        )
    });
    if !json.base.is_empty() {
        let gas = gas(json).formula();
        let caption = format!("The base, fitted together with the extension (gas: {gas}).");
        base_table(page, json, &caption);
    }
}
