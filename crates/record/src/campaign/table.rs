//! What a campaign shows, in Markdown: reality, strategy and team beside each other, with intervals.

use super::{FOUND_WITHIN_M, MissionKey, MissionRow, Moment, NEAR_M, Question, Stated};
use formats::number::{significant, value_and_sd};
use protocol::message::{FluxMethod, PeakStatus};
use std::fmt::Write as _;
use study::{SD_95, median};

/// Missions that differ in their seeds alone.
#[derive(Debug, Clone)]
pub struct Group<'a> {
    /// Reality, strategy and team; the seed is that of the first.
    pub key: &'a MissionKey,
    /// The missions.
    pub rows: Vec<&'a MissionRow>,
}

/// A median with the interval that holds it with a chance of at least 95 %.
///
/// The interval is that of the order statistics, which needs no distribution (David and Nagaraja 2003, chapter 7.1); of
/// fewer than six values it is their whole range, which holds the median with less. What never came is infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianOf {
    /// The median.
    pub median: f64,
    /// Ends of its interval.
    pub from_to: (f64, f64),
}

/// Chance that an interval misses what it is of.
const MISSES: f64 = 0.05;

impl MedianOf {
    /// Of some values; none of nothing.
    pub fn new(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let (first, last) = (*values.first()?, *values.last()?);
        let n = values.len();
        // The k lowest of n values all lie above the median with the chance that fewer than k of n coins fall heads.
        let (mut below, mut chance) = (0, 0.0);
        let mut exactly = 0.5_f64.powi(n as i32);
        while below < n / 2 && chance + exactly <= MISSES / 2.0 {
            chance += exactly;
            exactly *= (n - below) as f64 / (below + 1) as f64;
            below += 1;
        }
        let from_to = match below {
            0 => (first, last),
            k => (values[k - 1], values[n - k]),
        };
        Some(Self {
            median: median(values)?,
            from_to,
        })
    }
}

/// The interval of a share of `count` of `of`, in which the true one lies with a chance of about 95 % (Wilson 1927).
pub fn share_from_to(count: usize, of: usize) -> (f64, f64) {
    let (n, p) = (of as f64, count as f64 / of as f64);
    let z2 = SD_95 * SD_95;
    let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = SD_95 / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// The missions of a campaign by reality, strategy and team, in the question's order.
pub fn groups(rows: &[MissionRow]) -> Vec<Group<'_>> {
    let same = |a: &MissionKey, b: &MissionKey| {
        (&a.reality, &a.strategy, a.vehicles) == (&b.reality, &b.strategy, b.vehicles)
    };
    let mut groups: Vec<Group<'_>> = Vec::new();
    for row in rows {
        match groups.iter_mut().find(|g| same(g.key, &row.key)) {
            Some(group) => group.rows.push(row),
            None => groups.push(Group {
                key: &row.key,
                rows: vec![row],
            }),
        }
    }
    groups
}

impl Group<'_> {
    /// Name beside the others: what of reality, strategy and team differs.
    pub fn name(&self, question: &Question) -> String {
        let key = self.key;
        let parts = [
            (question.realities.len() > 1).then(|| key.reality.clone()),
            (question.strategies.len() > 1).then(|| key.strategy.clone()),
            (question.vehicles.len() > 1).then(|| key.vehicles.to_string()),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        if parts.is_empty() {
            key.strategy.clone()
        } else {
            parts.join(" · ")
        }
    }

    /// Median over the missions; what a mission does not tell is left out.
    pub fn median_of(&self, of: impl Fn(&MissionRow) -> Option<f64>) -> Option<MedianOf> {
        MedianOf::new(self.rows.iter().filter_map(|r| of(r)).collect())
    }

    /// Median over all missions of what some never come to. All of them are watched for the same time, so that it is that of
    /// Kaplan and Meier (1958), and its interval that of the order statistics.
    pub fn median_until(&self, of: impl Fn(&MissionRow) -> Option<f64>) -> Option<MedianOf> {
        let or_never = |r: &&MissionRow| of(r).unwrap_or(f64::INFINITY);
        MedianOf::new(self.rows.iter().map(or_never).collect())
    }

    /// How many missions are so.
    pub fn count(&self, is: impl Fn(&MissionRow) -> bool) -> usize {
        self.rows.iter().filter(|r| is(r)).count()
    }

    /// Its cells of the table under [`head`].
    pub fn cells(&self) -> Vec<String> {
        let of = self.rows.len();
        let until = |of: fn(&MissionRow) -> Option<Moment>| {
            let time = self.median_until(|r| of(r).map(|m| m.time_s));
            let km = self.median_until(|r| of(r).map(|m| m.flown_km));
            [interval(time), interval(km)]
        };
        let flux = |method: FluxMethod| {
            interval(self.median_of(|r| r.flux_by(method).map(|s| s.error.abs())))
        };
        let map = |r: &MissionRow| r.map.map(|m| 100.0 * m.rmse_ppm / m.plume_rms_ppm);
        let key = self.key;
        let mut cells = vec![
            key.reality.clone(),
            key.strategy.clone(),
            format!("{} ({} real)", key.vehicles, self.rows[0].real),
        ];
        cells.extend(until(|r| r.near));
        cells.extend(until(|r| r.known));
        cells.push(interval(
            self.median_until(|r| r.confirmed.map(|m| m.time_s)),
        ));
        cells.extend([
            share(self.count(|r| r.status.stands()), of),
            share(self.count(MissionRow::is_found), self.count(|r| r.has_peak)),
            interval(self.median_of(|r| r.peak_off_m)),
            interval(self.median_of(map)),
            flux(FluxMethod::Inference),
            flux(FluxMethod::MassBalance),
            flux(FluxMethod::Combined),
        ]);
        cells
    }

    /// What its missions state with a standard deviation against the reality of their stand-ins, under [`STATED_HEAD`].
    pub fn stated_cells(&self) -> Vec<Vec<String>> {
        let all = || self.rows.iter().flat_map(|r| &r.stated);
        let mut names: Vec<&str> = Vec::new();
        for s in all() {
            if !names.contains(&s.name.as_str()) {
                names.push(&s.name);
            }
        }
        let of = |name: &str| {
            let those: Vec<&Stated> = all().filter(|s| s.name == name).collect();
            let error = median(those.iter().map(|s| s.error.abs()).collect()).unwrap_or(f64::NAN);
            let left = median(those.iter().filter_map(|s| s.left()).collect());
            vec![
                name.to_owned(),
                format!(
                    "{} of {}",
                    those.iter().filter(|s| s.holds()).count(),
                    those.len()
                ),
                format!("{} {}", significant(error), those[0].unit),
                left.map_or(NOTHING.to_owned(), |l| format!("{l:.3}")),
            ]
        };
        names.into_iter().map(of).collect()
    }

    /// How its missions ended, in words: what stands behind their peaks, where their vehicles are, and how much of what
    /// they state holds.
    pub fn endings(&self) -> String {
        let all = [
            PeakStatus::Confirmed,
            PeakStatus::Supported,
            PeakStatus::Doubtful,
            PeakStatus::NotFound,
        ];
        let by_status = all.map(|status| {
            let count = self.count(|r| r.status == status);
            format!("{count} {}", status.words())
        });
        let landed: usize = self.rows.iter().map(|r| r.landed).sum();
        let vehicles: usize = self.rows.iter().map(|r| r.key.vehicles).sum();
        let stated = || self.rows.iter().flat_map(|r| &r.stated);
        format!(
            "{}. {landed} of {vehicles} vehicles landed. {} of {} stated values are within two standard \
             deviations of the truth.",
            by_status.join(", "),
            stated().filter(|s| s.holds()).count(),
            stated().count()
        )
    }
}

/// What stands where nothing can be told.
const NOTHING: &str = "–";

/// What stands where it happened in no mission, or in so few that nothing can be told.
const NEVER: &str = "never";

/// A median with its interval, for people.
fn interval(of: Option<MedianOf>) -> String {
    let Some(of) = of else {
        return NOTHING.to_owned();
    };
    let (from, to) = of.from_to;
    // Of a number that is infinite where a thing never came, only what is finite is written.
    match [of.median, from, to].map(f64::is_finite) {
        [true, _, true] => format!("{:.0} ({from:.0}–{to:.0})", of.median),
        [true, _, false] => format!("{:.0} (from {from:.0})", of.median),
        [false, true, _] => format!("from {from:.0}"),
        [false, false, _] => NEVER.to_owned(),
    }
}

fn share(count: usize, of: usize) -> String {
    if of == 0 {
        return NOTHING.to_owned();
    }
    let (from, to) = share_from_to(count, of);
    format!("{count} of {of} ({:.0}–{:.0} %)", 100.0 * from, 100.0 * to)
}

/// Head of the table of all groups.
pub fn head() -> Vec<String> {
    let near = format!("within {NEAR_M:.0} m of the peak, s");
    let found = format!("found within {FOUND_WITHIN_M:.0} m");
    [
        "reality",
        "strategy",
        "vehicles",
        &near,
        "km",
        "peak known, s",
        "km",
        "peak confirmed, s",
        "known at the end",
        &found,
        "peak error, m",
        "map error, %",
        "flux error by inference, %",
        "by mass balance, %",
        "by both, %",
    ]
    .map(str::to_owned)
    .to_vec()
}

/// Head of the table of what one group's missions state.
pub const STATED_HEAD: [&str; 4] = [
    "number",
    "truth within 2 sd",
    "median error",
    "median remaining share of the error",
];

fn markdown(head: &[impl AsRef<str>], rows: &[Vec<String>]) -> String {
    let line = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
    let mut text = line(head.iter().map(AsRef::as_ref).collect());
    let _ = writeln!(text, "|{}", "---|".repeat(head.len()));
    for row in rows {
        text += &line(row.iter().map(String::as_str).collect());
    }
    text
}

/// What the missions of a campaign, in its order, show.
pub fn to_markdown(question: &Question, rows: &[MissionRow]) -> String {
    let groups = groups(rows);
    let cells: Vec<Vec<String>> = groups.iter().map(Group::cells).collect();
    let mut text = markdown(&head(), &cells) + "\n" + LEGEND + "\n";
    let of = question.missions().len();
    if rows.len() < of {
        let _ = writeln!(text, "\n{} of {of} missions are flown so far.", rows.len());
    }
    for group in &groups {
        let what = if groups.len() > 1 {
            format!("## {}", group.name(question))
        } else {
            by_seed(group)
        };
        let stated = markdown(&STATED_HEAD, &group.stated_cells());
        let _ = write!(text, "\n{what}\n\n{}\n\n{stated}", group.endings());
    }
    text
}

/// What the numbers of the table are.
pub const LEGEND: &str = "Medians with their 95 % interval (for fewer than six missions: the range). \
                          “From”: in some missions it did not happen, so the interval has no upper end; without a \
                          number before it, it did not happen in half of them. Shares with Wilson's 95 % interval. Mission time and distance flown by the \
                          team are given until a vehicle was near the true peak, and until the peak was \
                          confirmed or supported; the time until it was confirmed is that until it was as well \
                          known as the scenario asks. The map error is the root-mean-square error over the fence's \
                          volume, divided by the root mean square of the plume.";

/// One line a mission.
fn by_seed(group: &Group<'_>) -> String {
    let first = group.rows[0].stated.iter().filter(|s| s.before.is_some());
    let corrected: Vec<&Stated> = first.collect();
    let mut head = vec!["seed".to_owned(), "peak error, m".to_owned()];
    head.extend(
        corrected
            .iter()
            .map(|n| format!("{} before → after", n.name)),
    );
    let number = |row: &MissionRow, name: &str| {
        let stated = row.stated_of(name).and_then(|s| Some((s.before?, s)));
        stated.map_or(NOTHING.to_owned(), |(before, s)| {
            let [error, _] = value_and_sd(s.error, s.sd.unwrap_or(f64::NAN));
            format!("{} → {error} {}", significant(before), s.unit)
        })
    };
    let of = |row: &&MissionRow| {
        let off = row
            .peak_off_m
            .map_or(NOTHING.to_owned(), |m| format!("{m:.0}"));
        let numbers = corrected.iter().map(|n| number(row, &n.name));
        [row.key.seed.to_string(), off]
            .into_iter()
            .chain(numbers)
            .collect()
    };
    let rows: Vec<Vec<String>> = group.rows.iter().map(of).collect();
    markdown(&head, &rows)
}

#[cfg(test)]
mod tests {
    use super::super::made_up;
    use super::*;

    #[test]
    fn intervals_of_medians_are_those_of_the_tables() {
        // Table of order statistics for the 95 % interval of a median (e.g. Altman 2000, table 18.4): of 10 values the
        // 2nd and 9th, of 20 the 6th and 15th, of 6 the 1st and 6th. Of fewer than 6 nothing holds 95 %.
        let of = |n: usize| MedianOf::new((1..=n).map(|k| k as f64).collect()).unwrap();
        assert_eq!(of(10).from_to, (2.0, 9.0));
        assert_eq!(of(20).from_to, (6.0, 15.0));
        assert_eq!(of(6).from_to, (1.0, 6.0));
        assert_eq!(of(3).from_to, (1.0, 3.0));
        assert_eq!(of(20).median, 10.5);
        assert_eq!(MedianOf::new(Vec::new()), None);
    }

    #[test]
    fn shares_have_wilsons_interval() {
        // python: z=1.959964; m=(p+z*z/2/n)/(1+z*z/n); h=z/(1+z*z/n)*sqrt(p*(1-p)/n+z*z/4/n/n), of 17/20 and 20/20.
        let (from, to) = share_from_to(17, 20);
        assert!((from - 0.6396).abs() < 1e-4 && (to - 0.9476).abs() < 1e-4);
        let (from, to) = share_from_to(20, 20);
        assert!((from - 0.8389).abs() < 1e-4 && (to - 1.0).abs() < 1e-12);
    }

    #[test]
    fn strategies_stand_beside_each_other() {
        let question = made_up::question();
        let known = |key: &MissionKey| match (key.strategy.as_str(), key.seed) {
            ("cs-ea", 1..=3) => None,
            ("cs-ea", _) => Some(800.0),
            (_, seed) => Some(300.0 + seed as f64),
        };
        let rows: Vec<MissionRow> = question
            .missions()
            .into_iter()
            .map(|key| made_up::row(key.clone(), known(&key)))
            .collect();
        let text = to_markdown(&question, &rows);
        assert!(
            text.contains("| own | cs-ea | 6 (1 real) | from 400 | from 8 | from 800 |"),
            "{text}"
        );
        assert!(
            text.contains("| own | posterior | 6 (1 real) | 151 (150–152) |"),
            "{text}"
        );
        assert!(text.contains("4 of 4 (51–100 %)"), "{text}");
        assert!(text.contains("## posterior"), "{text}");
        // 1.5 of 12 degrees before.
        assert!(
            text.contains("| axis (towards) | 4 of 4 | 1.50 ° | 0.125 |"),
            "{text}"
        );
    }
}
