//! `campaign.html`: realities, strategies and teams beside each other.

use crate::html::Document;
use crate::plot::rounded;
use record::campaign::table::{self, Group};
use record::campaign::{FOUND_WITHIN_M, MissionRow, NEAR_M, Question};
use serde_json::{Value, json};

/// The report of the missions `rows`, in the order of `question`.
pub fn page(question: &Question, rows: &[MissionRow]) -> String {
    let groups = table::groups(rows);
    let mut page = Document::new("Plumage campaign", &question.mission);
    page.lead(&lead(question, rows));
    page.section("Comparison");
    let cells: Vec<Vec<String>> = groups.iter().map(Group::cells).collect();
    let head = table::head();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    page.table(table::LEGEND, &head, &cells);
    let names: Vec<String> = groups.iter().map(|g| g.name(question)).collect();
    let height_px = 140 + 34 * groups.len() as u32;
    let known = dots(
        &groups,
        &names,
        "mission time, s",
        |r| r.known.map(|m| m.time_s),
        true,
    );
    page.plot(
        height_px,
        known,
        "When the peak was first confirmed or supported: a dot for each mission, a line for the median. Missions \
         that never reached it are not shown.",
    );
    let near = dots(
        &groups,
        &names,
        "mission time, s",
        |r| r.near.map(|m| m.time_s),
        true,
    );
    page.plot(
        height_px,
        near,
        &format!("When a vehicle was first within {NEAR_M:.0} m of the true peak: dots and median as above."),
    );
    let off = dots(&groups, &names, "distance, m", |r| r.peak_off_m, false);
    page.plot(
        height_px,
        off,
        &format!("Distance of the final peak from the true one; within {FOUND_WITHIN_M:.0} m it counts as found."),
    );
    page.section("Stated values against the truth");
    for (group, name) in groups.iter().zip(&names) {
        page.paragraph(&format!("{name}: {}", group.endings()));
        page.table(name, &table::STATED_HEAD, &group.stated_cells());
    }
    page.finish()
}

fn lead(question: &Question, rows: &[MissionRow]) -> Vec<String> {
    let count =
        |n: usize, what: &str, many: &str| format!("{n} {}", if n == 1 { what } else { many });
    let of = question.missions().len();
    let first = format!(
        "{} of {}, {}, {} of the team and {}.",
        count(of, "mission", "missions"),
        count(question.realities.len(), "reality", "realities"),
        count(question.strategies.len(), "strategy", "strategies"),
        count(question.vehicles.len(), "size", "sizes"),
        count(question.seeds.len(), "seed", "seeds"),
    );
    let mut lead = vec![first];
    if rows.len() < of {
        lead.push(format!("{} of them are flown so far.", rows.len()));
    }
    lead
}

const DOT: &str = "#2f6f9f";
const LINE: &str = "#16181d";

/// A row of dots a group, with its median: of all missions, those to which it never happened as later than any, where
/// `counts_all`, else of those that tell it.
fn dots(
    groups: &[Group<'_>],
    names: &[String],
    title: &str,
    of: fn(&MissionRow) -> Option<f64>,
    counts_all: bool,
) -> Value {
    let mut data = Vec::new();
    let mut medians = Vec::new();
    for (k, group) in groups.iter().enumerate() {
        let known = group.rows.iter().filter_map(|r| Some((of(r)?, r.key.seed)));
        let (x, seeds): (Vec<f64>, Vec<u64>) = known.unzip();
        let x: Vec<Value> = x.into_iter().map(|v| rounded(v, 10.0)).collect();
        let seeds: Vec<String> = seeds.iter().map(|s| format!("seed {s}")).collect();
        data.push(json!({"type": "scatter", "mode": "markers", "showlegend": false,
            "x": x, "y": vec![k; x.len()], "text": seeds, "hovertemplate": "%{x}, %{text}<extra></extra>",
            "marker": {"color": DOT, "size": 8, "opacity": 0.55}}));
        let all = if counts_all {
            group.median_until(of)
        } else {
            group.median_of(of)
        };
        if let Some(all) = all.filter(|all| all.median.is_finite()) {
            let m = rounded(all.median, 10.0);
            medians.push(
                json!({"type": "line", "x0": m, "x1": m, "y0": k as f64 - 0.32,
                "y1": k as f64 + 0.32, "line": {"color": LINE, "width": 2}}),
            );
        }
    }
    let ticks: Vec<usize> = (0..names.len()).collect();
    json!({"data": data, "layout": {"shapes": medians, "margin": {"l": 190, "t": 10},
        "xaxis": {"title": {"text": title}, "rangemode": "tozero"},
        "yaxis": {"tickvals": ticks, "ticktext": names, "range": [names.len() as f64 - 0.5, -0.5], "zeroline": false}}})
}
