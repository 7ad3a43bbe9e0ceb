//! The report of an analysis of tracer trials.

use super::{RANKED, causes, detectable, figures, gain_table, opening, set, unit_or_dash};
use crate::html::{Document, number};
use formats::number::{plus_minus, significant, value_and_sd};
use gap::tracer::{GroupDetail, TracerReport, TriedModel};
use gap::verdict::{Cause, GapJson, Parameter};

/// The report of an analysis of tracer trials. `title` names the data.
pub fn tracer(title: &str, report: &TracerReport) -> Document {
    let json = &report.gap;
    let mut page = opening("Plumage gap report: tracer trials", title, json);
    page.section("Where the simulation deviates from the data");
    page.figure(
        figures::arcs(&report.tracer.arcs),
        "Predicted over measured on every whole arc, by distance: crosswind-integrated \
         concentration (vertical spread, transport, loss) and width (lateral spread). Grey: the \
         base. Blue: the extended model, each trial predicted from the others. Circles: unstable \
         air; diamonds: stable air. One is right.",
    );
    if !json.residual.is_empty() {
        page.figure(
            figures::bins(&json.residual),
            "Mean of ln (measured / predicted by the base) of arc maxima at each distance, in its \
             own standard errors over trials, for each kind of air.",
        );
    }
    classes(&mut page, report);
    for group in &report.tracer.groups {
        models(&mut page, group);
    }
    causes(&mut page, json);
    added(&mut page, report);
    page.section("Gain");
    if let Some(gain) = &json.gain {
        page.paragraph(&format!(
            "Scores of arc maxima: each of {} trials is predicted from the others by the mean over all models, \
             weighted by their probability given the others.",
            gain.blocks
        ));
        gain_table(&mut page, &gain.held_out);
    }
    remains(&mut page, json);
    page
}

/// Where one stability class ends and the next begins.
fn classes(page: &mut Document, report: &TracerReport) {
    let limit = |value: f64| match value.is_finite() {
        true => format!("{value:+.3}"),
        false => "none".to_owned(),
    };
    let rows: Vec<Vec<String>> = report
        .tracer
        .class_limits
        .iter()
        .map(|c| vec![c.class.to_string(), limit(c.from_per_m), limit(c.to_per_m)])
        .collect();
    let caption = format!(
        "Classes of Briggs' curves by the inverse of the Obukhov length, after Golder (1972), for a \
         roughness length of {} m.",
        significant(report.tracer.roughness_m)
    );
    page.table(&caption, &["class", "from 1/L, 1/m", "to 1/L, 1/m"], &rows);
}

fn models(page: &mut Document, group: &GroupDetail) {
    let each = [
        ("vertical spread", &group.vertical),
        ("width", &group.lateral),
        (
            "width without a deviation of azimuth",
            &group.lateral_without_azimuth,
        ),
    ];
    for (what, tried) in each {
        if !tried.is_empty() {
            tried_models(page, &group.group, what, group.trials.len(), tried);
        }
    }
}

fn tried_models(page: &mut Document, air: &str, what: &str, trials: usize, tried: &[TriedModel]) {
    let rows: Vec<Vec<String>> = tried
        .iter()
        .take(RANKED)
        .map(|t| {
            let name = if t.mechanisms.is_empty() {
                "Briggs as it is".to_owned()
            } else {
                t.mechanisms.join(" + ")
            };
            vec![
                name,
                number(t.delta_log_score, 1),
                number(t.delta_log_evidence, 1),
                number(t.probability, 3),
                plus_minus(t.held_out_gain, t.held_out_gain_se),
            ]
        })
        .collect();
    page.table(
        &format!("Models of the {what} in {air} air, {trials} trials."),
        &[
            "changes",
            "gain, nats",
            "evidence, nats",
            "probability",
            "gain on hold-out trials, nats",
        ],
        &rows,
    );
}

/// What was added, and what the numbers are relative to.
fn added(page: &mut Document, report: &TracerReport) {
    page.section("The extended model");
    let causes = &report.gap.causes;
    let rows: Vec<Vec<String>> = causes
        .iter()
        .zip(&report.tracer.relative_to)
        .flat_map(|(c, inputs)| {
            c.parameters
                .iter()
                .map(move |p| parameter_row(c, p, inputs))
        })
        .collect();
    if rows.is_empty() {
        page.paragraph("No parameter was added.");
    } else {
        page.table(
            "Added parameters, with standard deviations over trials. Each number is relative to the inputs named \
             with it. A scenario has only Briggs' class curve and one wind; extended.toml has the numbers fitted \
             relative to those, which differ.",
            &["parameter", "air", "value", "± 1 sd", "unit", "relative to"],
            &rows,
        );
    }
}

fn parameter_row(cause: &Cause, p: &Parameter, inputs: &[String]) -> Vec<String> {
    let relative_to = if inputs.is_empty() {
        "Briggs' class curve, wind as measured".to_owned()
    } else {
        inputs.join(" + ")
    };
    let [value, sd] = value_and_sd(p.value, p.sd);
    vec![
        format!("{}.{}", p.mechanism, p.name),
        cause.platforms.join(", "),
        value,
        sd,
        unit_or_dash(&p.unit),
        relative_to,
    ]
}

fn remains(page: &mut Document, json: &GapJson) {
    page.section("Remaining deviation");
    let mut items = Vec::new();
    if let Some(u) = &json.unexplained {
        let air = u.platforms.join(" and ");
        items.push(format!("Not explained, in {air} air: {}.", u.term));
    }
    items.extend(json.notices.iter().cloned());
    if !items.is_empty() {
        page.list(&items);
    }
    if let Some(next) = &json.next_flight {
        page.section("Data that would decide");
        let of_a_set = |c: &&Cause| c.mechanisms == next.separates;
        let name = json.causes.iter().find(of_a_set).map(set);
        page.paragraph(&format!(
            "To tell {} apart: {}.",
            name.unwrap_or_else(|| next.separates.join(" and ")),
            next.description
        ));
    }
    detectable(page, json);
}
