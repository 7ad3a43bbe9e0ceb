//! `report.html` of an emission rate, with the sheet of a site-level measurement: what was measured, how well it is
//! known, what it rests on, and what a person fills in and signs.

use crate::flux_figures as figures;
use crate::html::{Document, number};
use formats::number::{plus_minus, significant};
use plume::Gas;
use study::combine::SourceMean;
use study::flux::{Conclusion, Method, Refusal, SourceFlux};
use study::units::RateUnit;
use study::{Interval, Share, Term};

/// Passes that the table lists.
const MOST_PASSES: usize = 60;
/// Visits whose differences are less probable than this vary.
const LEAST_AGREEMENT_P: f64 = 0.05;
/// A line to write on.
const BLANK: &str = "______________________________";

/// What the report is made of.
#[derive(Debug)]
pub struct FluxPage<'a> {
    /// The answer; none where no method applies.
    pub conclusion: Option<&'a Conclusion>,
    /// Methods that give no rate.
    pub refused: &'a [Refusal],
    /// Labels of the sheet's fields with what is filled in.
    pub fields: Vec<(String, String)>,
    /// Name, SHA-256 and rows of each file that was read.
    pub inputs: Vec<(String, String, usize)>,
    /// What the checks of raw data left out.
    pub left_out: Vec<String>,
    /// Logged winds: speed, m/s, and direction from which they blow, degrees.
    pub winds: Vec<(f64, f64)>,
}

/// The report.
pub fn page(of: &FluxPage<'_>) -> Document {
    let headline = of.conclusion.map(|c| &c.headline);
    let title = headline.map_or("Emission rate", |h| h.name.as_str());
    let mut page = Document::new("Plumage emission report", title);
    page.lead(&lead(of));
    sheet(&mut page, of);
    if let Some(conclusion) = of.conclusion {
        result(&mut page, &conclusion.headline);
        methods(&mut page, conclusion, of.refused);
        passes(&mut page, &conclusion.headline);
    } else {
        refused(&mut page, of.refused);
    }
    wind(&mut page, of);
    left_out(&mut page, of);
    files(&mut page, of);
    signature(&mut page);
    page
}

/// The report of means over several visits.
pub fn combined(sources: &[SourceMean]) -> Document {
    let mut page = Document::new("Plumage emission report: several visits", &named(sources));
    let most = sources.iter().map(|s| s.visits.len()).max();
    let found: Vec<String> = sources.iter().map(mean_sentence).collect();
    let agree = sources
        .iter()
        .all(|s| s.mean.agreement_p.is_none_or(|p| p >= LEAST_AGREEMENT_P));
    page.lead(&[
        format!("The rates of {} visits were combined to the mean of each source.", most.unwrap_or(0)),
        format!("{}.", found.join("; ")),
        if agree {
            "The visits agree within their intervals.".to_owned()
        } else {
            "The visits differ by more than their intervals explain: the mean's interval holds what the source varies."
                .to_owned()
        },
    ]);
    for source in sources {
        mean_of_visits(&mut page, source);
    }
    page
}

fn named(sources: &[SourceMean]) -> String {
    let names: Vec<&str> = sources.iter().map(|s| s.name.as_str()).collect();
    names.join(", ")
}

/// The mean of a source in a sentence, without its full stop.
pub fn mean_sentence(source: &SourceMean) -> String {
    let rate = source.mean.kg_s;
    let [value, low, high] = [rate.value, rate.low95, rate.high95].map(|q| rate_text(1e3 * q));
    format!(
        "{} emits {value} g/s of {} (95 % interval {low} to {high}) in the mean of {} visits",
        source.name,
        source.gas.formula(),
        source.visits.len()
    )
}

fn mean_of_visits(page: &mut Document, source: &SourceMean) {
    let in_g_s = |rate: Interval| [rate.value, rate.low95, rate.high95].map(|kg_s| 1e3 * kg_s);
    let visits = source
        .visits
        .iter()
        .map(|(name, visit)| (name.clone(), visit.kg_s));
    let all: Vec<(String, Interval)> = visits
        .chain([("mean".to_owned(), source.mean.kg_s)])
        .collect();
    page.section(&source.name);
    let rates: Vec<(String, [f64; 3])> = all
        .iter()
        .map(|(name, rate)| (name.clone(), in_g_s(*rate)))
        .collect();
    page.intervals(
        "Rates of the visits and their mean, with 95 % intervals.",
        ("rate", "g/s"),
        &rates,
    );
    let row = |(name, values): &(String, [f64; 3])| {
        let mut row = vec![name.clone()];
        row.extend(values.map(rate_text));
        row
    };
    page.table(
        "The same in numbers, g/s.",
        &["visit", "rate", "low 95 %", "high 95 %"],
        &rates.iter().map(row).collect::<Vec<_>>(),
    );
    if let Some(p) = source.mean.agreement_p {
        page.paragraph(&format!(
            "If the source emits the same on all visits, differences as large as these have the probability {}.",
            number(p, 3)
        ));
    }
    if !source.mean.budget.is_empty() {
        page.figure(
            figures::budget(&source.mean.budget, &term),
            "What makes the mean's interval wide. Terms of the instrument and the spread are the same on all visits, so \
             more visits do not reduce them.",
        );
    }
    page.list(&source.notes);
}

/// What was measured, the rate, and what limits it.
fn lead(of: &FluxPage<'_>) -> [String; 3] {
    let rows: usize = of.inputs.iter().map(|i| i.2).sum();
    let done = match of.inputs.len() {
        1 => format!("One file with {rows} rows was read."),
        n => format!("{n} files with {rows} rows were read."),
    };
    let Some(conclusion) = of.conclusion else {
        let found = "No method applies to these observations.".to_owned();
        return [
            done,
            found,
            "The table of methods gives the reason of each.".to_owned(),
        ];
    };
    let flux = &conclusion.headline;
    let widest = flux
        .budget
        .iter()
        .max_by(|a, b| a.share.total_cmp(&b.share));
    let limits = widest.map_or(String::new(), |w| {
        format!(
            " Most of what is not known comes from the {} ({:.0} % of the variance).",
            term(w),
            100.0 * w.share
        )
    });
    let checks = match (flux.method, conclusion.alternatives.len()) {
        (Method::Combined, n) => format!("The {n} methods that apply agree."),
        (_, 0) => "No other method applies to check it.".to_owned(),
        (_, 1) => "One other method checks it.".to_owned(),
        (_, n) => format!("{n} other methods check it."),
    };
    [
        done,
        format!("{}.", sentence(flux)),
        format!("{checks}{limits}"),
    ]
}

/// A rate with three digits: more are noise, in however small a unit.
fn rate_text(value: f64) -> String {
    significant(format!("{value:.2e}").parse().unwrap_or(value))
}

/// The answer in a sentence.
pub fn sentence(flux: &SourceFlux) -> String {
    let gas = flux.gas.formula();
    let method = match flux.method {
        Method::Curtain => "the mass balance of a curtain of passes",
        Method::Network => "a network of sensors",
        Method::Point => "one sensor at rest",
        Method::Inversion => "inversion of the plume model",
        Method::Tracer => "the ratio to the tracer",
        Method::Combined => "the combined methods",
    };
    let unit = unit_of(flux);
    let show = |kg_s: f64| rate_text(unit.of_kg_s(kg_s, flux.gas));
    match (flux.kg_s, flux.upper_limit_kg_s) {
        (Some(rate), _) => format!(
            "{} emits {} {} of {gas} (95 % interval {} to {}) by {method}",
            flux.name,
            show(rate.value),
            unit.symbol(),
            show(rate.low95),
            show(rate.high95)
        ),
        (None, limit) => format!(
            "{} emits less than {} {} of {gas} (95 %) by {method}: the plume was not met",
            flux.name,
            show(limit.unwrap_or(f64::NAN)),
            unit.symbol()
        ),
    }
}

/// The unit in which a rate reads best.
fn unit_of(flux: &SourceFlux) -> RateUnit {
    let kg_s = flux.kg_s.map(|r| r.value).or(flux.upper_limit_kg_s);
    if kg_s.is_some_and(|kg_s| kg_s > 1.0) {
        RateUnit::KilogramPerHour
    } else {
        RateUnit::GramPerSecond
    }
}

fn in_units(gas: Gas, kg_s: f64) -> Vec<String> {
    RateUnit::ALL
        .iter()
        .map(|unit| rate_text(unit.of_kg_s(kg_s, gas)))
        .collect()
}

fn sheet(page: &mut Document, of: &FluxPage<'_>) {
    page.section("Measurement");
    let blank = |text: &str| {
        if text.is_empty() {
            BLANK.to_owned()
        } else {
            text.to_owned()
        }
    };
    let mut rows: Vec<Vec<String>> = of
        .fields
        .iter()
        .map(|(label, text)| vec![label.clone(), blank(text)])
        .collect();
    if let Some(conclusion) = of.conclusion {
        let flux = &conclusion.headline;
        rows.push(vec!["Method".to_owned(), flux.method.name().to_owned()]);
        rows.push(vec!["Gas".to_owned(), flux.gas.formula().to_owned()]);
        if flux.distance_m > 0.0 {
            rows.push(vec![
                "Distance of the readings".to_owned(),
                format!("{:.0} m", flux.distance_m),
            ]);
        }
    }
    page.table(
        "Fields on a line are filled in by hand, or from the file of --sheet.",
        &["", ""],
        &rows,
    );
}

fn result(page: &mut Document, flux: &SourceFlux) {
    page.section("Emission rate");
    let mut head = vec![""];
    head.extend(RateUnit::ALL.iter().map(|u| u.symbol()));
    let mut rows = Vec::new();
    let mut push = |label: &str, kg_s: f64| {
        let mut row = vec![label.to_owned()];
        row.extend(in_units(flux.gas, kg_s));
        rows.push(row);
    };
    match (flux.kg_s, flux.upper_limit_kg_s) {
        (Some(rate), _) => {
            push("rate", rate.value);
            push("95 % interval, lower end", rate.low95);
            push("95 % interval, upper end", rate.high95);
        }
        (None, limit) => push("upper limit (95 %)", limit.unwrap_or(f64::NAN)),
    }
    page.table(
        "t/a: if the source emits the same all year. scfh: at 60 °F and 14.696 psi.",
        &head,
        &rows,
    );
    if !flux.budget.is_empty() {
        page.figure(
            figures::budget(&flux.budget, &term),
            "What makes the interval wide.",
        );
    }
    if let Some(stability) = &flux.stability
        && let Some(rate) = flux.kg_s
    {
        let in_class =
            |kg_s: Option<f64>| kg_s.map_or_else(|| "–".to_owned(), |q| relative(q, rate));
        page.paragraph(&format!(
            "Stability class {} ({}). The rate would be {} in the next less stable class and {} in the next more \
             stable one.",
            stability.value,
            stability.by,
            in_class(stability.if_one_class_down),
            in_class(stability.if_one_class_up)
        ));
    }
    page.list(&flux.notes);
}

fn relative(kg_s: f64, rate: Interval) -> String {
    format!("{:+.0} %", 100.0 * (kg_s / rate.value - 1.0))
}

fn term(share: &Share) -> String {
    match share.term {
        Term::WindSpeed => "wind speed",
        Term::WindDirection => "wind direction",
        Term::SourcePosition => "position of the source",
        Term::Dispersion => "dispersion",
        Term::Height => "height",
        Term::Background => "background",
        Term::Sensor => "sensor",
        Term::Turbulence => "turbulence",
        Term::Representativeness => "representativeness",
    }
    .to_owned()
}

fn methods(page: &mut Document, conclusion: &Conclusion, refusals: &[Refusal]) {
    page.section("Methods");
    let mut all = vec![&conclusion.headline];
    all.extend(&conclusion.alternatives);
    if all.iter().filter(|e| e.kg_s.is_some()).count() > 1 {
        page.figure(
            figures::methods(&all),
            "Rates with their 95 % intervals, by method.",
        );
    }
    if let Some(p) = conclusion.agreement_p {
        page.paragraph(&format!(
            "If all methods are right, a difference as large as theirs has the probability {}.",
            number(p, 3)
        ));
    }
    let rows: Vec<Vec<String>> = all
        .iter()
        .map(|e| {
            let g_s =
                |kg_s: Option<f64>| kg_s.map_or_else(|| "–".to_owned(), |q| rate_text(1e3 * q));
            vec![
                e.method.name().to_owned(),
                g_s(e.kg_s.map(|r| r.value)),
                g_s(e.kg_s.map(|r| r.low95)),
                g_s(e.kg_s.map(|r| r.high95)),
                g_s(e.upper_limit_kg_s),
                e.notes.join("; "),
            ]
        })
        .collect();
    page.table(
        "Estimates, g/s.",
        &[
            "method",
            "rate",
            "low 95 %",
            "high 95 %",
            "upper limit",
            "remarks",
        ],
        &rows,
    );
    refused(page, refusals);
}

fn refused(page: &mut Document, refusals: &[Refusal]) {
    if refusals.is_empty() {
        return;
    }
    let rows: Vec<Vec<String>> = refusals
        .iter()
        .map(|r| vec![r.method.name().to_owned(), r.reason.clone()])
        .collect();
    page.table("Methods that do not apply.", &["method", "reason"], &rows);
}

fn passes(page: &mut Document, flux: &SourceFlux) {
    if flux.passes.is_empty() {
        return;
    }
    page.section("Passes");
    page.figure(
        figures::passes(&flux.passes),
        "Rate of each pass, or the part of a curtain's rate that it stands for. Grey: not used.",
    );
    let rows: Vec<Vec<String>> = flux
        .passes
        .iter()
        .take(MOST_PASSES)
        .map(|p| {
            vec![
                format!("{:.0} to {:.0}", p.from_s, p.to_s),
                p.kg_s
                    .map_or_else(|| "–".to_owned(), |q| rate_text(1e3 * q)),
                format!("{:.0}", p.distance_m),
                if p.used { "yes" } else { "no" }.to_owned(),
                p.reason.clone().unwrap_or_default(),
            ]
        })
        .collect();
    page.table(
        &format!("The first {} of {} passes.", rows.len(), flux.passes.len()),
        &["time, s", "rate, g/s", "distance, m", "used", "why not"],
        &rows,
    );
}

fn wind(page: &mut Document, of: &FluxPage<'_>) {
    page.section("Wind");
    let used = of.conclusion.and_then(|c| c.headline.wind.as_ref());
    if let Some(wind) = used {
        page.paragraph(&format!(
            "{} wind: {} m/s from {}° in the mean.",
            if wind.treatment == "logged" {
                "Logged"
            } else {
                "The scenario's"
            },
            number(wind.speed_m_s, 1),
            match wind.sd_deg {
                Some(sd) => plus_minus(wind.from_deg, sd),
                None => number(wind.from_deg, 0),
            }
        ));
    }
    if of.winds.is_empty() {
        page.paragraph("No wind was logged.");
    } else {
        page.figure(
            figures::wind_rose(&of.winds),
            "Wind rose: how often the wind blew from each direction. The lines enclose all speeds up to their class.",
        );
    }
}

fn left_out(page: &mut Document, of: &FluxPage<'_>) {
    page.section("Left out");
    if of.left_out.is_empty() {
        page.paragraph("The checks of the raw data left out nothing.");
    } else {
        page.list(&of.left_out);
    }
}

fn files(page: &mut Document, of: &FluxPage<'_>) {
    page.section("Raw files");
    let rows: Vec<Vec<String>> = of
        .inputs
        .iter()
        .map(|(file, sha256, rows)| {
            let (first, second) = sha256.split_at(sha256.len() / 2);
            vec![file.clone(), rows.to_string(), format!("{first} {second}")]
        })
        .collect();
    page.table(
        "Files with their SHA-256.",
        &["file", "rows", "SHA-256"],
        &rows,
    );
}

fn signature(page: &mut Document) {
    page.section("Statement");
    page.paragraph(
        "This sheet states a site-level measurement as OGMP 2.0 level 5 and Regulation (EU) 2024/1787 ask for, to be \
         reconciled with the source-level estimates of the same time. The signatory confirms the fields above, that \
         the raw files are those listed, and that the state of operation was as stated.",
    );
    let rows: Vec<Vec<String>> = [
        "Reconciled with source-level estimate, kg/h",
        "Place and date",
        "Name",
        "Signature",
    ]
    .iter()
    .map(|label| vec![(*label).to_owned(), BLANK.to_owned()])
    .collect();
    page.table("To be filled in by hand.", &["", ""], &rows);
}
