//! The table of the benchmark of flight.

use std::fmt::Write as _;

use gap::verdict::Verdict;
use gap_truth::flight::FlightNoise;

use super::{FIRST_SEED, FlightKind, FlightOutcome};
use crate::rates::{Rate, mean_or_dash};
use crate::summary::Line;

/// All outcomes.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightSummary {
    /// Seeds.
    pub seeds: u64,
    /// Outcomes, by seed.
    pub outcomes: Vec<FlightOutcome>,
}

impl FlightSummary {
    /// Of these outcomes.
    pub fn new(seeds: u64, outcomes: Vec<FlightOutcome>) -> Self {
        Self { seeds, outcomes }
    }

    fn rate(&self, of: impl Fn(&FlightKind) -> bool, hit: impl Fn(&FlightOutcome) -> bool) -> Rate {
        let judged = self.outcomes.iter().filter(|o| o.error.is_none());
        Rate::of(judged, |o| of(&o.kind).then(|| hit(o)))
    }

    /// False alarms with this noise.
    pub fn false_alarms(&self, noise: FlightNoise) -> Rate {
        self.rate(
            |k| *k == FlightKind::Nothing(noise),
            FlightOutcome::detected,
        )
    }

    /// Detected single effects at so many nats.
    pub fn detected(&self, nats: f64) -> Rate {
        self.rate(|k| is_one(k, nats), FlightOutcome::detected)
    }

    /// Sets that hold the truth, of those detected.
    pub fn in_sets(&self, nats: f64) -> Rate {
        let judged = self
            .outcomes
            .iter()
            .filter(|o| o.error.is_none() && o.detected());
        Rate::of(judged, |o| is_one(&o.kind, nats).then(|| o.in_sets()))
    }

    /// Wrong names said with confidence, of kinds that `of` picks.
    pub fn wrong(&self, of: impl Fn(&FlightKind) -> bool) -> Rate {
        self.rate(of, FlightOutcome::confidently_wrong)
    }

    /// Mean size of the sets that hold the truth.
    pub fn set_size(&self, nats: f64) -> f64 {
        let sizes: Vec<f64> = self
            .outcomes
            .iter()
            .filter(|o| is_one(&o.kind, nats))
            .flat_map(|o| {
                let hidden = o.hidden();
                o.sets
                    .iter()
                    .filter(move |s| s.iter().any(|m| hidden.contains(&m.as_str())))
                    .map(|s| s.len() as f64)
            })
            .collect();
        sizes.iter().sum::<f64>() / sizes.len() as f64
    }

    /// Coverage of stated 95 % intervals.
    pub fn coverage(&self) -> Rate {
        let errors = self.outcomes.iter().flat_map(|o| &o.errors_sd);
        Rate::of(errors, |e| Some(e.abs() < 1.96))
    }

    /// Held-out gain over that of the truth on the same blocks, pooled; cases in which nothing is
    /// found gain nothing.
    pub fn gain(&self, nats: f64) -> f64 {
        let mut pooled = (0.0, 0.0);
        for o in self.outcomes.iter().filter(|o| is_one(&o.kind, nats)) {
            let (found, truth) = o.gain.unwrap_or((0.0, 0.0));
            pooled = (pooled.0 + found, pooled.1 + truth);
        }
        pooled.0 / pooled.1
    }

    /// The table as Markdown.
    pub fn to_markdown(&self) -> String {
        let seeds = self.outcomes.iter().map(|o| o.seed);
        let (first, last) = (seeds.clone().min(), seeds.max());
        let mut text = format!(
            "# Finding hidden causes in flight: benchmark\n\n{} seeds ({} to {}; nothing was tuned \
             on seeds from {FIRST_SEED} on), {} cases. Rates with their counts and 95 % intervals \
             (Clopper & Pearson).\n\n| what | bar | reached |\n|---|---|---|\n",
            self.seeds,
            first.unwrap_or(0),
            last.unwrap_or(0),
            self.outcomes.len()
        );
        for (what, bar, reached) in self.lines() {
            // Writing into a String cannot fail.
            let _ = writeln!(text, "| {what} | {bar} | {reached} |");
        }
        text += "\nWhat was said where the truth was not named alone:\n\n";
        for o in self.outcomes.iter().filter(|o| !o.exactly()) {
            let nothing = matches!(o.kind, FlightKind::Nothing(_)) && !o.detected();
            if !nothing {
                let _ = writeln!(text, "- {}, seed {}: {}", o.kind, o.seed, o.description());
            }
        }
        text
    }

    /// The rates, each with the bar that it has.
    pub fn lines(&self) -> Vec<Line> {
        let mut rows = vec![
            row(
                "nothing hidden: false alarms",
                "≤ 1 %",
                self.false_alarms(FlightNoise::Usual),
            ),
            row(
                "nothing hidden, other noise: false alarms",
                "≤ 3 %",
                self.false_alarms(FlightNoise::Unusual),
            ),
        ];
        for (nats, detected, held, gain) in [
            (20.0, "≥ 95 %", "≥ 99 %", "≥ 90 %"),
            (60.0, "≥ 99 %", "≥ 98 %", "≥ 97 %"),
        ] {
            let name = |what: &str| format!("D = {nats}: {what}");
            rows.push(row(&name("detected"), detected, self.detected(nats)));
            rows.push(row(&name("truth in the set"), held, self.in_sets(nats)));
            let size = mean_or_dash(self.set_size(nats), 2, "");
            rows.push((name("mean size of the set"), "≤ 1.25".into(), size));
            let wrong = self.wrong(|k| is_one(k, nats));
            rows.push(row(&name("wrong with confidence"), "≤ 1 %", wrong));
            let share = mean_or_dash(100.0 * self.gain(nats), 1, " %");
            rows.push((name("held-out gain / the truth's own"), gain.into(), share));
        }
        rows.extend(self.other_rows());
        rows.push(row("95 % intervals cover", "92–98 %", self.coverage()));
        let lost = self.outcomes.iter().filter(|o| o.error.is_some()).count();
        rows.push((
            "not flown or refused".into(),
            String::new(),
            lost.to_string(),
        ));
        rows
    }

    /// Rows of what is not one effect by the catalogue's law.
    fn other_rows(&self) -> [Line; 6] {
        let outside = |k: &FlightKind| matches!(k, FlightKind::Outside(..));
        let other_law = |k: &FlightKind| matches!(k, FlightKind::OtherLaw(..));
        let two = |k: &FlightKind| matches!(k, FlightKind::Two(..));
        let unexplained = |o: &FlightOutcome| o.verdict == Some(Verdict::Unexplained);
        let placed = |o: &FlightOutcome| {
            let FlightKind::Outside(effect, _) = o.kind else {
                return false;
            };
            let there = |c: &String| effect.coordinates().contains(&c.as_str());
            unexplained(o) && o.coordinate.as_ref().is_some_and(there)
        };
        let in_sets = self.rate(other_law, FlightOutcome::in_sets);
        [
            row("other law: truth in the set", "", in_sets),
            row(
                "other law: wrong with confidence",
                "≤ 2 %",
                self.wrong(other_law),
            ),
            row(
                "outside the catalogue: unexplained",
                "",
                self.rate(outside, unexplained),
            ),
            row(
                "outside the catalogue: unexplained, right coordinate",
                "≥ 90 %",
                self.rate(outside, placed),
            ),
            row(
                "outside the catalogue: named with confidence",
                "≤ 2 %",
                self.wrong(outside),
            ),
            row(
                "two effects: exactly both",
                "≥ 92 %",
                self.rate(two, FlightOutcome::exactly),
            ),
        ]
    }
}

fn row(what: &str, bar: &str, rate: Rate) -> Line {
    (what.to_owned(), bar.to_owned(), rate.to_string())
}

fn is_one(kind: &FlightKind, nats: f64) -> bool {
    matches!(kind, FlightKind::One(_, d) if *d == nats)
}
