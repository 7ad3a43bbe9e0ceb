//! The outcomes as rates, and as a page.

use std::fmt::Write as _;
use std::ops::RangeInclusive;

use gap_truth::{NoiseForm, PlumeEffect};

use crate::judge::{FlownOn, Outcome};
use crate::plan::{CLASSES, Kind, class};
use crate::rates::{Rate, mean_or_dash};

/// What was asked, the bar, and what was reached.
pub type Line = (String, String, String);

fn line(what: &str, bar: &str, reached: impl ToString) -> Line {
    (what.to_owned(), bar.to_owned(), reached.to_string())
}

/// All outcomes of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Every case, in the order of the plan.
    pub outcomes: Vec<Outcome>,
}

/// Families of effects of the catalogue, and the bars of naming one alone.
const FAMILIES: [(&str, &str, RangeInclusive<PlumeEffect>); 3] = [
    (
        "sensor and background",
        "≥ 70 %",
        PlumeEffect::BackgroundOffset..=PlumeEffect::AltitudeOffset,
    ),
    (
        "spread and transport",
        "≥ 30 %",
        PlumeEffect::WindDirectionOffset..=PlumeEffect::MixingLid,
    ),
    (
        "source and sink",
        "",
        PlumeEffect::EmissionScale..=PlumeEffect::BuildingDownwash,
    ),
];

impl Summary {
    /// A summary of outcomes.
    pub fn new(outcomes: Vec<Outcome>) -> Self {
        Self { outcomes }
    }

    /// Cases that were made and that `which` picks.
    fn cases(&self, which: impl Fn(&Outcome) -> bool) -> Vec<&Outcome> {
        self.outcomes
            .iter()
            .filter(|o| !o.unreachable && which(o))
            .collect()
    }

    /// Cases with one effect of the catalogue by its own law, of this class of D.
    pub fn one(&self, name: &str) -> Vec<&Outcome> {
        self.cases(|o| matches!(o.task.kind, Kind::One(_)) && class(o.nats()) == name)
    }

    /// Cases in which nothing is hidden, of this noise and with sparse rows or not.
    pub fn nothing(&self, noise: NoiseForm, sparse: bool) -> Vec<&Outcome> {
        self.cases(|o| {
            let task = &o.task;
            task.kind == Kind::Nothing && task.noise == noise && (task.row_step_s > 1) == sparse
        })
    }

    /// Any verdict but `none` and `insufficient`.
    pub fn detected(cases: &[&Outcome]) -> Rate {
        Rate::of(cases, |o| Some(o.detected()))
    }

    /// The verdict `insufficient`.
    pub fn insufficient(cases: &[&Outcome]) -> Rate {
        Rate::of(cases, |o| Some(o.verdict() == "insufficient"))
    }

    /// Every hidden effect in the stated sets or among the candidates, of what is detected.
    pub fn said_at_all(cases: &[&Outcome]) -> Rate {
        let all = |o: &Outcome| o.said_at_all() == o.truth.len();
        Rate::of(cases, |o| o.detected().then(|| all(o)))
    }

    /// Mean size of the sets and candidates that hold the truth, what cannot be told from it not
    /// counted.
    pub fn mean_set_size(cases: &[&Outcome]) -> f64 {
        mean(cases.iter().filter_map(|o| o.set_size()))
    }

    /// Every hidden effect named alone.
    pub fn named(cases: &[&Outcome]) -> Rate {
        Rate::of(cases, |o| Some(o.named() == o.truth.len()))
    }

    /// A wrong single name, said without a word of what is unexplained.
    pub fn wrong_single(cases: &[&Outcome]) -> Rate {
        Rate::of(cases, |o| Some(o.wrong_single()))
    }

    /// Stated 95 % intervals that hold the truth.
    pub fn coverage(cases: &[&Outcome]) -> Rate {
        Rate::of(cases.iter().flat_map(|o| o.covered()), Some)
    }

    /// Proposed flights that settled the matter, of those that `count`.
    pub fn settled(cases: &[&Outcome], count: impl Fn(&FlownOn) -> bool) -> Rate {
        Rate::of(cases, |o| {
            let flown = o.next_flight.as_ref()?;
            count(flown).then_some(flown.settled)
        })
    }

    /// The page, in Markdown.
    pub fn to_markdown(&self) -> String {
        let mut page = format!(
            "# Finding hidden causes: benchmark\n\n\
             {} cases. Rates with their counts and 95 % intervals (Clopper & Pearson). D is half the \
             sum of squares of the whitened difference between the truth and the best that the base \
             can make of it, nats, by the noise of the generator and not of the finder; of several \
             effects each beside the others. Strengths are tuned to a D drawn evenly in its logarithm \
             from a class; effects that no scene tried shows so strongly are left out and counted \
             below. Detected is any verdict but `none` and `insufficient`. What no data of this kind \
             tell from the truth is not counted in the size of a set.\n\n",
            self.outcomes.len()
        );
        self.headline(&mut page);
        self.reliability(&mut page);
        self.table_of_rows(&mut page);
        self.confusions(&mut page);
        self.unreachable_cases(&mut page);
        page
    }

    /// The rates, each with the bar that it has.
    pub fn lines(&self) -> Vec<Line> {
        let mut lines = self.lines_of_nothing();
        let bars = ["≥ 80 %", "≥ 97 %", ""];
        for (low, bar) in CLASSES.into_iter().zip(bars) {
            lines.extend(self.lines_of_one(class(low), bar));
        }
        lines.extend(self.lines_of_all());
        lines.extend(self.lines_of_families());
        lines.extend(self.lines_beyond_one());
        lines
    }

    fn headline(&self, page: &mut String) {
        page.push_str("| what | bar | reached |\n|---|---|---|\n");
        for (what, bar, reached) in self.lines() {
            // Writing into a String cannot fail.
            let _ = writeln!(page, "| {what} | {bar} | {reached} |");
        }
        page.push('\n');
    }

    fn lines_of_nothing(&self) -> Vec<Line> {
        let nothing = |o: &Outcome| o.task.kind == Kind::Nothing;
        let unlogged = |o: &Outcome| o.task.noise == NoiseForm::UnloggedWind;
        // A wind that swings and that nobody logs is something hidden of a kind.
        let all = self.cases(|o| nothing(o) && !unlogged(o));
        let mut lines = vec![
            line(
                "nothing hidden: false alarms",
                "≤ 2 %",
                Self::detected(&all),
            ),
            line("nothing hidden: insufficient", "", Self::insufficient(&all)),
        ];
        for (row, cases) in self.rows().into_iter().filter(|r| nothing(r.1[0])) {
            let bar = if unlogged(cases[0]) { "" } else { "≤ 2 %" };
            let reached = Self::detected(&cases);
            lines.push(line(&format!("{row}: false alarms"), bar, reached));
        }
        lines
    }

    fn lines_of_one(&self, name: &str, detected: &str) -> Vec<Line> {
        let cases = self.one(name);
        vec![
            line(
                &format!("{name}: detected"),
                detected,
                Self::detected(&cases),
            ),
            line(
                &format!("{name}: insufficient"),
                "",
                Self::insufficient(&cases),
            ),
            line(
                &format!("{name}: of detected, truth in sets or candidates"),
                "≥ 97 %",
                Self::said_at_all(&cases),
            ),
            line(
                &format!("{name}: mean size of sets and candidates"),
                "≤ 2.5",
                mean_or_dash(Self::mean_set_size(&cases), 2, ""),
            ),
            line(&format!("{name}: named alone"), "", Self::named(&cases)),
        ]
    }

    fn lines_of_all(&self) -> Vec<Line> {
        let one = self.cases(|o| matches!(o.task.kind, Kind::One(_)));
        vec![
            line(
                "one effect: of detected, truth in sets or candidates",
                "≥ 97 %",
                Self::said_at_all(&one),
            ),
            line(
                "one effect: mean size of sets and candidates",
                "≤ 2.5",
                mean_or_dash(Self::mean_set_size(&one), 2, ""),
            ),
            line(
                "one effect: a wrong single name",
                "≤ 1 %",
                Self::wrong_single(&one),
            ),
        ]
    }

    fn lines_of_families(&self) -> Vec<Line> {
        let of = |family: &RangeInclusive<PlumeEffect>, o: &Outcome| match o.task.kind {
            Kind::One(effect) => o.nats() >= CLASSES[1] && family.contains(&effect),
            _ => false,
        };
        FAMILIES
            .iter()
            .map(|(name, bar, family)| {
                let named = Self::named(&self.cases(|o| of(family, o)));
                line(&format!("D ≥ 60, {name}: named alone"), bar, named)
            })
            .collect()
    }

    fn lines_beyond_one(&self) -> Vec<Line> {
        let wrong = |cases: &[&Outcome]| Self::wrong_single(cases);
        let mut lines = Vec::new();
        for count in [2, 3] {
            let several = self.cases(|o| o.truth.len() == count && o.nats() >= CLASSES[0]);
            let words = ["two effects", "three effects"][count - 2];
            let all = Rate::of(&several, |o| Some(o.said_at_all() == count));
            let dropped = Rate::of(&several, |o| Some(o.silently_dropped()));
            let alone = Self::named(&several);
            let bars = if count == 2 {
                ["≥ 75 %", "≤ 5 %"]
            } else {
                [""; 2]
            };
            lines.extend([
                line(&format!("{words}: all in sets or candidates"), bars[0], all),
                line(
                    &format!("{words}: `named` with one missing"),
                    bars[1],
                    dropped,
                ),
                line(&format!("{words}: each named alone"), "", alone),
                line(
                    &format!("{words}: a wrong single name"),
                    "",
                    wrong(&several),
                ),
            ]);
        }
        let other = self.cases(|o| matches!(o.task.kind, Kind::OtherLaw(_)));
        let outside =
            self.cases(|o| matches!(o.task.kind, Kind::Outside(_)) && o.nats() >= CLASSES[1]);
        let verdict = |word: &str| Rate::of(&outside, |o| Some(o.verdict() == word));
        let all = self.cases(|o| matches!(o.task.kind, Kind::One(_) | Kind::Several(_)));
        let damaged = self.cases(|o| matches!(o.task.kind, Kind::Damaged(_)));
        let mutated = self.cases(|o| matches!(o.task.kind, Kind::Mutated(_)));
        let seen = Rate::of(&mutated, |o| Some(noticed(o)));
        lines.extend([
            line(
                "other law: of detected, truth in sets or candidates",
                "",
                Self::said_at_all(&other),
            ),
            line("other law: a wrong single name", "", wrong(&other)),
            line("outside, D ≥ 60: none", "≤ 5 %", verdict("none")),
            line("outside, D ≥ 60: insufficient", "", verdict("insufficient")),
            line("outside, D ≥ 60: wrong name", "≤ 3 %", wrong(&outside)),
            line("outside, D ≥ 60: unexplained", "", verdict("unexplained")),
            line(
                "outside, D ≥ 60: unexplained, right coordinate",
                "",
                Rate::of(&outside, |o| Some(right_coordinate(o))),
            ),
            line("95 % intervals cover", "92–98 %", Self::coverage(&all)),
            line(
                "next flight that says it will (probability ≥ 0.5): settles the matter",
                "",
                Self::settled(&all, |f| f.settles_probability >= 0.5),
            ),
            line(
                "damaged data: said so",
                "",
                Rate::of(&damaged, |o| Some(damage_said(o))),
            ),
            line("damaged data: a wrong single name", "", wrong(&damaged)),
            line("damaged data: detected", "", Self::detected(&damaged)),
            line("changed files: noticed", "", seen),
            line(
                "refused",
                "",
                Rate::of(&self.cases(|_| true), |o| Some(o.error.is_some())),
            ),
        ]);
        lines
    }

    /// Stated probabilities of first causes against how often they were right.
    fn reliability(&self, page: &mut String) {
        let known = |o: &&Outcome| matches!(o.task.kind, Kind::One(_) | Kind::Several(_));
        let stated = self
            .outcomes
            .iter()
            .filter(known)
            .filter_map(Outcome::stated);
        page.push_str("Stated probability of a cause against how often it was right:\n\n");
        by_tenths(page, &stated.collect::<Vec<_>>());
    }

    fn rows(&self) -> Vec<(String, Vec<&Outcome>)> {
        let mut rows: Vec<(String, Vec<&Outcome>)> = Vec::new();
        for outcome in &self.outcomes {
            let name = outcome.task.row();
            match rows.iter_mut().find(|r| r.0 == name) {
                Some(row) => row.1.push(outcome),
                None => rows.push((name, vec![outcome])),
            }
        }
        rows
    }

    fn table_of_rows(&self, page: &mut String) {
        page.push_str(
            "| case | made | detected | insufficient | in sets or candidates | named alone | \
             unexplained | wrong name |\n|---|---|---|---|---|---|---|---|\n",
        );
        for (name, all) in self.rows() {
            let made: Vec<&&Outcome> = all.iter().filter(|o| !o.unreachable).collect();
            let count = |f: &dyn Fn(&Outcome) -> bool| made.iter().filter(|o| f(o)).count();
            let hidden = |o: &Outcome| o.truth.len().max(1);
            let _ = writeln!(
                page,
                "| {name} | {} | {} | {} | {} | {} | {} | {} |",
                made.len(),
                count(&|o| o.detected()),
                count(&|o| o.verdict() == "insufficient"),
                count(&|o| o.said_at_all() == hidden(o)),
                count(&|o| o.named() == hidden(o)),
                count(&|o| o.verdict() == "unexplained"),
                count(&|o| o.wrong_single()),
            );
        }
        page.push('\n');
    }

    /// What was said instead of the truth.
    fn confusions(&self, page: &mut String) {
        page.push_str("What was said where the truth was not named alone:\n\n");
        for (name, all) in self.rows() {
            let mut said: Vec<(String, usize)> = Vec::new();
            for o in all.iter().filter(|o| !o.unreachable) {
                let quiet = o.truth.is_empty() && !o.detected() && o.error.is_none();
                let right = o.named() > 0 && o.named() == o.truth.len();
                if quiet || right {
                    continue;
                }
                let words = words(o);
                match said.iter_mut().find(|s| s.0 == words) {
                    Some(entry) => entry.1 += 1,
                    None => said.push((words, 1)),
                }
            }
            said.sort_by_key(|s| std::cmp::Reverse(s.1));
            if !said.is_empty() {
                let list: Vec<String> = said.iter().map(|(w, n)| format!("{n} × {w}")).collect();
                let _ = writeln!(page, "- {name}: {}", list.join("; "));
            }
        }
        page.push('\n');
    }

    fn unreachable_cases(&self, page: &mut String) {
        let mut lines = Vec::new();
        for (name, all) in self.rows() {
            let count = all.iter().filter(|o| o.unreachable).count();
            if count > 0 {
                lines.push(format!("{name}: {count} of {}", all.len()));
            }
        }
        if !lines.is_empty() {
            let _ = writeln!(page, "Not to be made so visible: {}.", lines.join("; "));
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / count
}

/// The answer in a few words.
fn words(outcome: &Outcome) -> String {
    if let Some(error) = &outcome.error {
        return format!("refused ({error})");
    }
    let Some(said) = &outcome.said else {
        return "nothing".into();
    };
    let mut parts: Vec<String> = said
        .causes
        .iter()
        .map(|c| c.mechanisms.join(" or "))
        .collect();
    if said.verdict == "unexplained" {
        parts.push(format!(
            "unexplained ({})",
            said.coordinate.as_deref().unwrap_or("")
        ));
    }
    if parts.is_empty() {
        return said.verdict.clone();
    }
    parts.join(" and ")
}

fn right_coordinate(outcome: &Outcome) -> bool {
    let Kind::Outside(effect) = outcome.task.kind else {
        return false;
    };
    let said = outcome.said.as_ref().and_then(|s| s.coordinate.as_deref());
    let right = |c: &str| effect.coordinates().contains(&c);
    outcome.verdict() == "unexplained" && said.is_some_and(right)
}

fn flaw_said(outcome: &Outcome, kind: &str) -> bool {
    let said = outcome.said.as_ref();
    said.is_some_and(|s| s.flaws.iter().any(|f| f.0 == kind))
}

fn damage_said(outcome: &Outcome) -> bool {
    match outcome.task.kind {
        Kind::Damaged(kind) => flaw_said(outcome, kind.as_str()),
        _ => false,
    }
}

/// A changed file is noticed by a refusal, a flaw of unit or a verdict other than none.
fn noticed(outcome: &Outcome) -> bool {
    outcome.error.is_some() || outcome.detected() || flaw_said(outcome, "unit")
}

/// A table of stated probabilities against what came of them, a row for each tenth.
fn by_tenths(page: &mut String, stated: &[(f64, bool)]) {
    // Writing into a String cannot fail.
    let _ = writeln!(
        page,
        "| stated | cases | mean stated | right |\n|---|---|---|---|"
    );
    for tenth in 0..10 {
        let (low, high) = (f64::from(tenth) / 10.0, f64::from(tenth + 1) / 10.0);
        let within = |s: &&(f64, bool)| s.0 >= low && (s.0 < high || tenth == 9);
        let here: Vec<&(f64, bool)> = stated.iter().filter(within).collect();
        if here.is_empty() {
            continue;
        }
        let mean = here.iter().map(|s| s.0).sum::<f64>() / here.len() as f64;
        let rate = Rate::of(here, |s| Some(s.1));
        let _ = writeln!(
            page,
            "| {low:.1}–{high:.1} | {} | {mean:.3} | {rate} |",
            rate.of
        );
    }
    page.push('\n');
}
