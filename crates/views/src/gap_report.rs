//! `report.html` of a gap analysis: it shows what is wrong, names it, extends the model, gives
//! the gain, and says what remains.

mod applied;
mod figures;
mod flight;
mod tracer;

pub use applied::{applied_plume, applied_tracer};
pub use flight::{estimate, flight};
pub use tracer::tracer;

use crate::html::{Document, number};
use formats::number::{plus_minus, significant, value_and_sd};
use gap::plume::{GapReport, Series};
use gap::verdict::{
    BaseParameter, Cause, DataQuality, GapJson, HeldOut, Measured, NextFlight, Pair, Parameter,
    Verdict,
};
use plume::Gas;

/// Rows of the ranking that are listed.
const RANKED: usize = 15;
/// Mechanisms whose smallest visible effect is listed.
const DETECTABLE: usize = 30;
/// Effects that the lead names.
const NAMED_EFFECTS: usize = 3;
/// No probability is shown as larger: none of models that are all wrong is worth more digits.
const MOST_SURE_PERCENT: f64 = 99.9;

/// The report of an analysis of concentrations along tracks. `title` names the data.
pub fn plume(title: &str, json: &GapJson, report: &GapReport) -> Document {
    let mut page = opening("Plumage gap report: plume and sensors", title, json);
    measured(&mut page, json, report);
    pairs(&mut page, json);
    page.section("Where the simulation deviates from the data");
    departs_most(&mut page, json, report);
    maps(&mut page, report);
    autocorrelation(&mut page, report);
    bins(&mut page, json);
    if !report.noise.is_empty() {
        let rows: Vec<Vec<String>> = report
            .noise
            .iter()
            .map(|(name, value, unit)| vec![name.clone(), significant(*value), unit.clone()])
            .collect();
        page.table(
            "The noise fitted with the base.",
            &["term", "size", "unit"],
            &rows,
        );
    }
    name_extend_gain(&mut page, json);
    if !report.blocks.is_empty() {
        page.figure(
            figures::blocks(&report.blocks),
            "Gain of the log score on each hold-out block. A gain in a single block is not a finding.",
        );
    }
    remains(&mut page, json, &[]);
    page
}

/// The readings of the platform that departs most from the base.
fn departs_most(page: &mut Document, json: &GapJson, report: &GapReport) {
    if let Some(series) = report
        .series
        .iter()
        .max_by(|a, b| misfit(a).total_cmp(&misfit(b)))
    {
        page.figure(
            figures::series(series, gas(json)),
            &format!(
                "Above: readings of platform {}, which deviates most from the base, with the predictions of the \
                 base and of the extended model. Below: the misfit in standard deviations of the fitted noise; \
                 an explained reading stays within about two.",
                series.platform
            ),
        );
    }
}

/// The misfit on the map.
fn maps(page: &mut Document, report: &GapReport) {
    if report.series.is_empty() {
        return;
    }
    page.figure(
        figures::maps(report),
        "Standardised misfit on the map, base on the left and extended model on the right: red where readings \
         exceed the prediction, blue where they fall below it. Square: the first source.",
    );
}

/// The memory of the misfit.
fn autocorrelation(page: &mut Document, report: &GapReport) {
    if report.series.is_empty() {
        return;
    }
    page.figure(
        figures::autocorrelation(report),
        "Autocorrelation of the misfit by lag in readings. A complete model leaves none.",
    );
}

/// The gas that was read.
fn gas(json: &GapJson) -> Gas {
    json.gas.unwrap_or_default()
}

/// What was measured: who read how much, when and where.
fn measured(page: &mut Document, json: &GapJson, report: &GapReport) {
    let digits = gas(json).digits();
    let series = report.series.iter();
    let rows: Vec<Vec<String>> = series.filter_map(|s| measured_row(s, digits)).collect();
    if rows.is_empty() {
        return;
    }
    page.section("Measured data");
    page.table(
        "Readings of each platform. A reading is used if it is not missing, not masked for its quality, and its \
         wind is known.",
        &[
            "platform",
            "readings",
            "used",
            "time, s",
            "height above ground, m",
            &format!("lowest and highest, ppm {}", gas(json).formula()),
        ],
        &rows,
    );
}

/// Two sensors on one platform, held against each other.
fn pairs(page: &mut Document, json: &GapJson) {
    let stated = |m: &Measured| plus_minus(m.value, m.sd);
    let row = |p: &Pair| {
        vec![
            p.platforms[0].clone(),
            p.platforms[1].clone(),
            stated(&p.time_constant_s),
            stated(&p.delay_s),
            stated(&p.gain),
            stated(&p.zero_ppm),
            number(p.correlation_before, 2),
            number(p.correlation_after, 2),
            number(p.evidence_nats, 1),
        ]
    };
    if json.pairs.is_empty() {
        return;
    }
    page.table(
        "Platforms at the same place, compared without a plume model: the first reads zero + gain × the reading \
         of the second, after a first-order lag and a delay. Correlation as measured, and with lag and delay; \
         evidence for lag and delay over a sensor that differs only by gain, zero and noise.",
        &[
            "follows",
            "whom",
            "time constant, s",
            "delay, s",
            "gain",
            &format!("zero, ppm {}", gas(json).formula()),
            "correlation",
            "with them",
            "evidence, nats",
        ],
        &json.pairs.iter().map(row).collect::<Vec<_>>(),
    );
}

fn measured_row(series: &Series, digits: usize) -> Option<Vec<String>> {
    let range = |values: &[f64], digits: usize| {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = finite().fold(f64::NEG_INFINITY, f64::max);
        format!("{} to {}", number(low, digits), number(high, digits))
    };
    let read = series.measured_ppm.iter().filter(|c| c.is_finite());
    (!series.time_s.is_empty()).then(|| {
        vec![
            series.platform.clone(),
            read.count().to_string(),
            series.used.iter().filter(|u| **u).count().to_string(),
            range(&series.time_s, 0),
            range(&series.height_agl_m, 0),
            range(&series.measured_ppm, digits),
        ]
    })
}

/// Mean square of what a platform's readings differ by from the base, in the noise's variance.
fn misfit(series: &Series) -> f64 {
    let used = series.used.iter().filter(|u| **u).count().max(1) as f64;
    let squares = series.before_standardised.iter().map(|z| z * z);
    squares.sum::<f64>() / used
}

/// The report of an analysis of which only the verdict is known. `kind` and `title` name it.
pub fn verdict(kind: &str, title: &str, json: &GapJson) -> Document {
    let mut page = opening(kind, title, json);
    if !json.residual.is_empty() {
        page.section("Where the simulation deviates from the data");
        bins(&mut page, json);
    }
    name_extend_gain(&mut page, json);
    remains(&mut page, json, &[]);
    page
}

/// The verdict as a sentence.
fn sentence(json: &GapJson) -> String {
    let causes: Vec<String> = json.causes.iter().map(set).collect();
    let causes = causes.join("; ");
    let lacks = if json.causes.iter().all(gap::verdict::Cause::is_sure) {
        "lacks"
    } else {
        "probably lacks"
    };
    match json.verdict {
        Verdict::None => "The model and its noise explain the data.".to_owned(),
        Verdict::Named => format!("The model lacks: {causes}."),
        Verdict::Ambiguous if json.causes.iter().all(|c| c.mechanisms.len() == 1) => {
            format!("The model {lacks}: {causes}.")
        }
        Verdict::Ambiguous => {
            format!(
                "The model {lacks} one of several causes that these data cannot tell apart: {causes}."
            )
        }
        Verdict::Unexplained => {
            let term = json.unexplained.as_ref().map_or("a misfit", |u| &u.term);
            // The headline says no more than the verdict: causes of a part are in the section of causes.
            let whole = if causes.is_empty() { "it" } else { "all of it" };
            format!(
                "The data deviate from the model, and no listed mechanism accounts for {whole}: {term}."
            )
        }
        Verdict::Insufficient => "These data are too few or too weak to test the model.".to_owned(),
    }
}

/// What was compared, what was found, and how far that goes, with how far the extended model is better.
fn lead(title: &str, json: &GapJson, found: String, worth: &str) -> [String; 3] {
    let done = format!("The data of {title} were compared with what the simulation predicts.");
    let better = match json.gain.as_ref().map(|g| &g.held_out) {
        Some(h) if h.rmse_before > 0.0 && h.rmse_after >= h.rmse_before => format!(
            " On data that had no part in the fit, the log score of the extended model is higher by {} nats, and its root mean \
             square error does not fall.",
            significant(h.log_score_after - h.log_score_before)
        ),
        Some(h) if h.rmse_before > 0.0 => format!(
            " On data that had no part in the fit, the extended model is off by {} where the model of the scenario is off \
             by {} (root mean square).",
            significant(h.rmse_after),
            significant(h.rmse_before)
        ),
        _ => String::new(),
    };
    [done, found, format!("{worth}{better}")]
}

/// How far a verdict goes, or what to do about it.
fn worth(json: &GapJson) -> String {
    match json.verdict {
        Verdict::None => match &json.detectable[..] {
            [] => "Effects too small for these data are not excluded.".to_owned(),
            all => {
                let effects = all.iter().take(NAMED_EFFECTS).map(|d| {
                    let unit = unit_or_dash(&d.unit).replace('–', "");
                    format!("{} {} {unit}", d.mechanism, significant(d.value))
                });
                let effects: Vec<String> = effects.map(|e| e.trim_end().to_owned()).collect();
                format!(
                    "These data would have shown effects from these sizes on: {}. The last table lists all; smaller effects \
                     are not excluded.",
                    effects.join(", ")
                )
            }
        },
        Verdict::Named => {
            "The file extended.toml is the model with the causes that predict hold-out data better."
                .to_owned()
        }
        Verdict::Ambiguous => match json.next_flight {
            Some(_) => "The report ends with the measurement that would decide.".to_owned(),
            None => "The section on causes gives the probability of each.".to_owned(),
        },
        Verdict::Unexplained => {
            "Do not rely on the simulation where it deviates: the last section shows where that is."
                .to_owned()
        }
        Verdict::Insufficient => json.insufficient.as_ref().map_or(String::new(), |i| {
            format!(
                "{}. To decide: {}.",
                i.reason.trim_end_matches('.'),
                i.would_do.trim_end_matches('.')
            )
        }),
    }
}

/// A number with its unit and what it is.
type Card = (String, &'static str, String);

fn opening(kicker: &str, title: &str, json: &GapJson) -> Document {
    let held_out = json.gain.as_ref().map(|gain| &gain.held_out);
    let known = held_out.filter(|held_out| held_out.rmse_before > 0.0);
    let change = known.map(|held_out| {
        let (before, after) = (held_out.rmse_before, held_out.rmse_after);
        let unit = if json.gas.is_some() { "ppm" } else { "" };
        let what = "error (RMSE) on hold-out data, before and after".to_owned();
        (
            format!("{} → {}", significant(before), significant(after)),
            unit,
            what,
        )
    });
    opening_with(kicker, title, json, change.as_slice())
}

/// The opening with `change` as what became of the error.
fn opening_with(kicker: &str, title: &str, json: &GapJson, change: &[Card]) -> Document {
    let mut page = Document::new(kicker, title);
    page.lead(&lead(title, json, sentence(json), &worth(json)));
    let mut cards = Vec::new();
    if json.gain.is_some() {
        cards.extend_from_slice(change);
    }
    for cause in json.causes.iter().take(2) {
        let percent = number((100.0 * cause.probability).min(MOST_SURE_PERCENT), 1);
        cards.push((percent, "%", format!("probability of {}", set(cause))));
    }
    if let Some(gain) = &json.gain {
        let held_out = &gain.held_out;
        let nats = held_out.log_score_after - held_out.log_score_before;
        let what = "gain of the log score on hold-out data".to_owned();
        cards.push((number(nats, 1), "nats", what));
    }
    page.cards(&cards);
    page
}

fn set(cause: &Cause) -> String {
    let mut text = cause.mechanisms.join(" or ");
    if !cause.platforms.is_empty() {
        text += &format!(" ({})", cause.platforms.join(", "));
    }
    text + &cause.onset_after()
}

fn bins(page: &mut Document, json: &GapJson) {
    if json.residual.is_empty() {
        return;
    }
    page.figure(
        figures::bins(&json.residual),
        "Mean misfit of the base in standard deviations of the noise, along each coordinate and for each \
         platform: where and when the model deviates.",
    );
}

fn name_extend_gain(page: &mut Document, json: &GapJson) {
    causes(page, json);
    extended(page, json);
    page.section("Gain");
    match &json.gain {
        None => page.paragraph("The model was not extended, so there is no gain."),
        Some(gain) => {
            page.paragraph(&format!(
                "Hold-out scores: each of {} blocks is predicted from the others; blocks are longer than the \
                 correlation of the noise.",
                gain.blocks
            ));
            gain_table(page, &gain.held_out);
        }
    }
}

fn gain_table(page: &mut Document, held_out: &HeldOut) {
    let head = [
        "score",
        "before",
        "after",
        "95 % before",
        "95 % after",
        "perfect",
    ];
    page.table(
        "Base and extended model on hold-out data (Chang and Hanna 2004).",
        &head,
        &scores(held_out),
    );
}

fn causes(page: &mut Document, json: &GapJson) {
    page.section("Causes");
    page.paragraph(&json.summary);
    if json.causes.is_empty() {
        page.paragraph(if json.unexplained.is_some() {
            "The data deviate from the model, but no mechanism of the catalogue describes the deviation well \
             enough to be named. The last section shows where it occurs."
        } else {
            "These data need no mechanism of the catalogue."
        });
    } else {
        page.table(
            "Causes, the strongest first. These data cannot tell apart several mechanisms in one row; a single \
             mechanism needs a probability of .95.",
            &[
                "cause",
                "size",
                "probability",
                "gain, nats",
                "evidence, nats",
                "nats to next rival",
            ],
            &json.causes.iter().map(cause_row).collect::<Vec<_>>(),
        );
    }
    if !json.ranking.is_empty() {
        let caption = "Every model tried, by its gain of evidence, which penalises parameters, with its probability \
                       among the models of its round. Negative: the data favour the base. The best of these models is \
                       a cause only if it also predicts hold-out data better and passes the checks.";
        page.figure(figures::ranking(&json.ranking, RANKED), caption);
    }
}

fn extended(page: &mut Document, json: &GapJson) {
    page.section("The extended model");
    let parameters: Vec<Vec<String>> = json
        .causes
        .iter()
        .filter(|c| c.is_sure())
        .flat_map(|c| &c.parameters)
        .map(|p| {
            let [value, sd] = value_and_sd(p.value, p.sd);
            let name = format!("{}.{}", p.mechanism, p.name);
            vec![name, value, sd, unit_or_dash(&p.unit)]
        })
        .collect();
    if parameters.is_empty() {
        page.paragraph(
            "The extended scenario is the base with its fitted parameters; no mechanism is sure enough to be added.",
        );
    } else {
        let caption = "Added mechanisms, as in extended.toml, which plumage run can fly.";
        page.table(
            caption,
            &["parameter", "value", "± 1 sd", "unit"],
            &parameters,
        );
    }
    if !json.base.is_empty() {
        base_table(page, json, "Fitted parameters of the base.");
    }
}

/// What was fitted of the base.
fn base_table(page: &mut Document, json: &GapJson, caption: &str) {
    let row = |b: &BaseParameter| {
        let [value, sd] = value_and_sd(b.value, b.sd);
        vec![b.label(), value, sd, significant(b.prior)]
    };
    let rows: Vec<Vec<String>> = json.base.iter().map(row).collect();
    page.table(caption, &["key", "value", "± 1 sd", "prior sd"], &rows);
}

fn cause_row(cause: &Cause) -> Vec<String> {
    let evidence = &cause.evidence;
    let size = |p: &Parameter| {
        let name = quantity(&p.name, &p.unit);
        format!("{name} {}{}", plus_minus(p.value, p.sd), p.unit_after())
    };
    vec![
        set(cause),
        cause
            .parameters
            .iter()
            .map(size)
            .collect::<Vec<_>>()
            .join(", "),
        number(cause.probability, 3),
        number(evidence.delta_log_score, 1),
        number(evidence.delta_log_evidence, 1),
        number(cause.nats_to_next, 1),
    ]
}

/// The name of a parameter in words, without the unit in which it ends.
fn quantity(name: &str, unit: &str) -> String {
    let unit = unit.to_lowercase();
    let ends = [unit.replace('/', "_"), unit.replace('/', "_per_")];
    let stem = ends.iter().find_map(|end| name.strip_suffix(end.as_str()));
    stem.unwrap_or(name).replace('_', " ").trim_end().to_owned()
}

/// A unit for a column of its own; a bare number has none.
fn unit_or_dash(unit: &str) -> String {
    if unit == "1" {
        "–".to_owned()
    } else {
        unit.to_owned()
    }
}

fn scores(h: &HeldOut) -> Vec<Vec<String>> {
    let range = |[low, high]: [f64; 2]| format!("{} to {}", significant(low), significant(high));
    let row = |name: &str, values: [f64; 2], intervals: [String; 2], perfect: &str| {
        let mut row = vec![name.to_owned()];
        row.extend(values.map(significant));
        row.extend(intervals);
        row.push(perfect.to_owned());
        row
    };
    let change = |what: &str, of: [f64; 2]| [String::new(), format!("{what} {}", range(of))];
    let mut rows = vec![row(
        "RMSE",
        [h.rmse_before, h.rmse_after],
        change("change", [h.rmse_change_low, h.rmse_change_high]),
        "0",
    )];
    // In the order of the intervals.
    let statistics = [
        ("FAC2", h.fac2_before, h.fac2_after, "1"),
        ("FB", h.fb_before, h.fb_after, "0"),
        ("NMSE", h.nmse_before, h.nmse_after, "0"),
        ("MG", h.mg_before, h.mg_after, "1"),
        ("VG", h.vg_before, h.vg_after, "1"),
    ];
    let intervals = h.intervals_before.into_iter().zip(h.intervals_after);
    for ((name, before, after, perfect), (i, j)) in statistics.into_iter().zip(intervals) {
        // Ratios of what has both signs are no numbers.
        if !(before.is_finite() && after.is_finite()) {
            continue;
        }
        rows.push(row(name, [before, after], [range(i), range(j)], perfect));
    }
    rows.push(row(
        "log score, nats",
        [h.log_score_before, h.log_score_after],
        change("gain", [h.log_score_gain_low, h.log_score_gain_high]),
        "higher is better",
    ));
    rows
}

/// What is not explained, and notices but those that were shown already.
fn remains(page: &mut Document, json: &GapJson, shown: &[&str]) {
    page.section("Remaining deviation");
    let mut items = Vec::new();
    if let Some(u) = &json.unexplained {
        items.push(format!(
            "A misfit that no mechanism explains occurs along {}: {}, strongest from {} to {} s{} ({} nats).",
            u.coordinate.replace('_', " "),
            u.term,
            number(u.from_s, 0),
            number(u.to_s, 0),
            if u.platforms.is_empty() {
                String::new()
            } else {
                format!(", on {}", u.platforms.join(", "))
            },
            number(u.delta_log_evidence, 1)
        ));
    }
    let notices = json.notices.iter().filter(|n| !shown.contains(&n.as_str()));
    items.extend(notices.cloned());
    if !items.is_empty() {
        page.list(&items);
    }
    left_out(page, &json.data_quality);
    if let Some(flight) = &json.next_flight {
        next_flight(page, flight);
    }
    detectable(page, json);
}

/// Stretches of raw data with a flaw, those of one platform that say the same in one row.
fn left_out(page: &mut Document, flaws: &[DataQuality]) {
    let mut alike: Vec<Vec<&DataQuality>> = Vec::new();
    for flaw in flaws {
        let same = |of: &&mut Vec<&DataQuality>| {
            of[0].platform == flaw.platform && wording(of[0]) == wording(flaw)
        };
        match alike.iter_mut().find(same) {
            Some(of) => of.push(flaw),
            None => alike.push(vec![flaw]),
        }
    }
    if alike.is_empty() {
        return;
    }
    let row = |of: &Vec<&DataQuality>| {
        let first = of.iter().map(|f| f.from_s).fold(f64::INFINITY, f64::min);
        let last = of.iter().map(|f| f.to_s).fold(f64::NEG_INFINITY, f64::max);
        let together: f64 = of.iter().map(|f| f.to_s - f.from_s).sum();
        vec![
            of[0].platform.clone(),
            of[0].message.clone(),
            of.len().to_string(),
            format!("{} to {}", number(first, 0), number(last, 0)),
            number(together, 0),
        ]
    };
    page.table(
        "Flawed raw data, which were not used; gap.json lists every stretch. Of similar stretches, this table \
         shows the first.",
        &["platform", "what", "stretches", "within, s", "together, s"],
        &alike.iter().map(row).collect::<Vec<_>>(),
    );
}

/// A flaw's message without its numbers.
fn wording(flaw: &DataQuality) -> String {
    flaw.message
        .chars()
        .filter(|c| !c.is_ascii_digit() && *c != '.')
        .collect()
}

fn detectable(page: &mut Document, json: &GapJson) {
    if !json.detectable.is_empty() {
        let rows: Vec<Vec<String>> = json
            .detectable
            .iter()
            .take(DETECTABLE)
            .map(|d| {
                vec![
                    format!("{}.{}", d.mechanism, d.parameter),
                    significant(d.value),
                    unit_or_dash(&d.unit),
                ]
            })
            .collect();
        let caption = "The smallest effect of each mechanism that these data would have shown. A verdict of none \
                       does not exclude smaller ones.";
        page.table(caption, &["effect", "size", "unit"], &rows);
    }
}

fn next_flight(page: &mut Document, flight: &NextFlight) {
    page.section("A flight that would decide");
    let who = flight.platform.as_ref();
    let mut text = format!(
        "To tell {} apart{}: {}.",
        flight.separates.join(" and "),
        who.map_or_else(String::new, |p| format!(", flown by {p}")),
        flight.description.trim_end_matches('.')
    );
    if flight.expected_nats.is_finite() {
        text += &format!(
            " Expected separation: {} nats; probability that it decides: {}.",
            number(flight.expected_nats, 1),
            number(flight.settles_probability, 2)
        );
    }
    page.paragraph(&text);
    if flight.waypoints.is_empty() {
        return;
    }
    let rows: Vec<Vec<String>> = flight
        .waypoints
        .iter()
        .map(|w| {
            vec![
                number(w.time_s, 0),
                number(w.lat_deg, 5),
                number(w.lon_deg, 5),
                number(w.alt_amsl_m, 0),
            ]
        })
        .collect();
    page.table(
        "Waypoints of that flight.",
        &["time, s", "latitude, °", "longitude, °", "m AMSL"],
        &rows,
    );
}
