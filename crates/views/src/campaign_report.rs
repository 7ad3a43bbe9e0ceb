//! `campaign.html`: realities, strategies and teams beside each other.

use crate::figure::{
    Axis, Column, Detail, Figure, INK, Interval, Layer, MODEL, Panel, Points, Symbol,
};
use crate::html::Document;
use record::campaign::table::{self, Group, MedianOf};
use record::campaign::{FOUND_WITHIN_M, MissionRow, NEAR_M, Question};

/// The report of the missions `rows`, in the order of `question`.
pub fn page(question: &Question, rows: &[MissionRow]) -> Document {
    let groups = table::groups(rows);
    let mut page = Document::new("Plumage campaign", &question.mission);
    page.lead(&lead(question, rows));
    page.section("Comparison");
    let cells: Vec<Vec<String>> = groups.iter().map(Group::cells).collect();
    let head = table::head();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    page.table(table::LEGEND, &head, &cells);
    let time = || Axis::new("mission time", "s");
    // Of what happened in no mission there is nothing to draw.
    let mut figure = |across, of: fn(&MissionRow) -> Option<f64>, counts_all, caption: &str| {
        if rows.iter().any(|row| of(row).is_some()) {
            page.figure(dots(&groups, question, across, of, counts_all), caption);
        }
    };
    figure(
        time(),
        |r| r.known.map(|m| m.time_s),
        true,
        "When the peak was first confirmed or supported: a dot for each mission, an upright line for the median of all missions \
         and a level line for its 95 % interval. Missions that never reached it have no dot; the number in brackets counts \
         those that did.",
    );
    figure(
        time(),
        |r| r.near.map(|m| m.time_s),
        true,
        &format!(
            "When a vehicle was first within {NEAR_M:.0} m of the true peak, in the same form."
        ),
    );
    let distance = Axis::new("distance", "m");
    figure(
        distance,
        |r| r.peak_off_m,
        false,
        &format!(
            "Distance of the final peak from the true one; within {FOUND_WITHIN_M:.0} m it counts as found."
        ),
    );
    page.section("Stated values against the truth");
    for group in &groups {
        let name = group.name(question);
        page.paragraph(&format!("{name}: {}", group.endings()));
        page.table(&name, &table::STATED_HEAD, &group.stated_cells());
    }
    page
}

fn lead(question: &Question, rows: &[MissionRow]) -> [String; 3] {
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
    let done = match rows.len() < of {
        true => format!("{first} {} of them are flown so far.", rows.len()),
        false => first,
    };
    let groups = table::groups(rows);
    let known = |g: &Group<'_>| g.count(|r| r.status.stands()) as f64 / g.rows.len() as f64;
    let best = groups.iter().max_by(|a, b| known(a).total_cmp(&known(b)));
    let are_alike = groups
        .windows(2)
        .all(|pair| known(&pair[0]) == known(&pair[1]));
    let found = match best {
        None => "No mission is flown yet.".to_owned(),
        Some(_) if are_alike => {
            let stands = rows.iter().filter(|r| r.status.stands()).count();
            format!(
                "{stands} of {} missions end with a confirmed or supported peak, the same share in each group.",
                rows.len()
            )
        }
        Some(best) => format!(
            "{} of {} missions of {} end with a confirmed or supported peak, the largest share.",
            best.count(|r| r.status.stands()),
            best.rows.len(),
            best.name(question)
        ),
    };
    let stated = || rows.iter().flat_map(|r| &r.stated);
    let worth = format!(
        "{} of {} stated values are within two standard deviations of the truth of the simulated reality; 95 % are to be \
         expected.",
        stated().filter(|s| s.holds()).count(),
        stated().count()
    );
    [done, found, worth]
}

/// A row of dots a group, with its median and the interval of that: of all missions, those to which it never happened
/// as later than any, where `counts_all`, else of those that tell it.
fn dots(
    groups: &[Group<'_>],
    question: &Question,
    across: Axis,
    of: fn(&MissionRow) -> Option<f64>,
    counts_all: bool,
) -> Figure {
    let known = |g: &Group<'_>| g.rows.iter().filter(|r| of(r).is_some()).count();
    let row_name =
        |g: &Group<'_>| format!("{} ({} of {})", g.name(question), known(g), g.rows.len());
    let mut layers: Vec<Layer> = groups
        .iter()
        .enumerate()
        .map(|(k, g)| missions(g, k, of))
        .collect();
    let median = |(k, group): (usize, &Group<'_>)| {
        let all = match counts_all {
            true => group.median_until(of),
            false => group.median_of(of),
        };
        all.filter(|m| m.median.is_finite()).map(|m| (k as f64, m))
    };
    let medians: Vec<(f64, MedianOf)> = groups.iter().enumerate().filter_map(median).collect();
    let column = |of: fn(&MedianOf) -> f64| Column::new(medians.iter().map(|(_, m)| of(m)), 10.0);
    layers.push(Layer::Points(Points {
        name: "median".to_owned(),
        colour: Some(INK),
        symbol: Symbol::Bar,
        size: 20.0,
        x: column(|m| m.median),
        y: Column::new(medians.iter().map(|(k, _)| *k), 1.0),
        interval: Some(Interval {
            along: "x",
            low: column(|m| m.from_to.0),
            high: column(|m| m.from_to.1),
        }),
        ..Points::default()
    }));
    let panel = Panel {
        x: Axis {
            include: vec![0.0],
            floor: Some(0.0),
            ..across
        },
        y: Axis {
            names: Some(groups.iter().map(row_name).collect()),
            ..Axis::default()
        },
        layers,
        ..Panel::default()
    };
    Figure {
        columns: 1,
        panels: vec![panel],
        scale: None,
    }
}

/// The missions of the `k`-th group as dots.
fn missions(group: &Group<'_>, k: usize, of: fn(&MissionRow) -> Option<f64>) -> Layer {
    let known = group.rows.iter().filter_map(|r| Some((of(r)?, r.key.seed)));
    let (values, seeds): (Vec<f64>, Vec<u64>) = known.unzip();
    Layer::Points(Points {
        name: "one mission".to_owned(),
        colour: Some(MODEL),
        size: 8.0,
        opacity: Some(0.55),
        y: Column::new(vec![k as f64; values.len()], 1.0),
        x: Column::new(values, 10.0),
        details: vec![Detail {
            name: "seed".to_owned(),
            texts: Some(seeds.iter().map(u64::to_string).collect()),
            ..Detail::default()
        }],
        ..Points::default()
    })
}
