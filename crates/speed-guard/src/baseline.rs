//! The figures in the repository, what was measured beside them, and the page of both.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use crate::measure::Figure;

/// Between these lines of BENCHMARKS.md stands what is written here.
const PLACE: [&str; 2] = ["<!-- measured -->", "<!-- end of measured -->"];
/// The peer of benches that have none.
const REFERENCE: &str = "reference";

/// `benches/baseline.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// When its ratios were measured.
    pub measured: String,
    /// A ratio so many times its own is too slow.
    pub slower_than: f64,
    /// What is measured: `package/bench`, or `mission`.
    pub suites: Vec<String>,
    /// The benches by their full names.
    #[serde(default)]
    pub bench: BTreeMap<String, Known>,
}

/// What is known of a bench.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// The bench by whose time its own is divided, or [`REFERENCE`].
    pub against: String,
    /// Time over that of `against`.
    pub ratio: f64,
}

/// A bench as measured now.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Full name.
    pub name: String,
    /// Times and size.
    pub figure: Figure,
    /// What it is measured by.
    pub against: String,
    /// Time over that of `against`.
    pub ratio: f64,
    /// The ratio over the baseline's; none for a bench that the baseline lacks or another is
    /// measured by.
    pub change: Option<f64>,
}

impl Baseline {
    /// The figures of one suite as rows.
    ///
    /// # Errors
    /// A bench by which another is measured was not run.
    pub fn rows(&self, figures: &BTreeMap<String, Figure>) -> anyhow::Result<Vec<Row>> {
        figures
            .iter()
            .map(|(name, figure)| self.row(name, figure, figures))
            .collect()
    }

    fn row(
        &self,
        name: &str,
        figure: &Figure,
        figures: &BTreeMap<String, Figure>,
    ) -> anyhow::Result<Row> {
        let known = self.bench.get(name);
        let against = known.map_or(REFERENCE, |k| &k.against);
        let by_s = if against == REFERENCE {
            figure.reference_s
        } else {
            figures
                .get(against)
                .with_context(|| format!("'{against}' was not run"))?
                .least_s
        };
        let ratio = figure.least_s / by_s;
        let is_peer = self.bench.values().any(|k| k.against == name);
        Ok(Row {
            name: name.to_owned(),
            figure: *figure,
            against: against.to_owned(),
            ratio,
            change: known.filter(|_| !is_peer).map(|k| ratio / k.ratio),
        })
    }

    /// Whether a row is slower than allowed.
    pub fn is_slow(&self, row: &Row) -> bool {
        row.change.is_some_and(|change| change > self.slower_than)
    }

    /// That every bench of the baseline is among `rows`.
    ///
    /// # Errors
    /// One is not.
    pub fn check_all_ran(&self, rows: &[Row]) -> anyhow::Result<()> {
        for name in self.bench.keys() {
            ensure!(
                rows.iter().any(|r| r.name == *name),
                "'{name}' of the baseline was not run"
            );
        }
        for row in rows {
            ensure!(
                self.bench.contains_key(&row.name),
                "'{}' is not in the baseline: take it with --set-baseline",
                row.name
            );
        }
        Ok(())
    }

    /// Takes the ratios of `rows` for its own.
    pub fn set(&mut self, rows: &[Row], head: &str) {
        head.clone_into(&mut self.measured);
        let known = |r: &Row| Known {
            against: r.against.clone(),
            ratio: r.ratio,
        };
        self.bench = rows.iter().map(|r| (r.name.clone(), known(r))).collect();
    }

    /// BENCHMARKS.md with the table of `rows` in its place.
    ///
    /// # Errors
    /// The page has no place for it.
    pub fn write_into(&self, page: &str, head: &str, rows: &[Row]) -> anyhow::Result<String> {
        let [from, to] = PLACE;
        let place = page.split_once(from).zip(page.split_once(to));
        let ((before, _), (_, after)) = place.context("BENCHMARKS.md: no place for the table")?;
        Ok(format!(
            "{before}{from}\n\n{}\n{to}{after}",
            self.table(head, rows)
        ))
    }

    fn table(&self, head: &str, rows: &[Row]) -> String {
        let mut text = format!(
            "Measured: {head}. Baseline: {}.\n\n\
             | bench | least time | a second | measured by | ratio | of the baseline's |\n\
             |---|---|---|---|---|---|\n",
            self.measured
        );
        for row in rows {
            let Figure {
                least_s, elements, ..
            } = row.figure;
            let rate = elements.map_or("–".to_owned(), |n| rounded(n / least_s));
            let change = row.change.map_or("–".to_owned(), |c| format!("{c:.2}"));
            let (name, time, by) = (&row.name, time(least_s), &row.against);
            let ratio = rounded(row.ratio);
            // Writing into a string cannot fail.
            let _ = writeln!(
                text,
                "| {name} | {time} | {rate} | {by} | {ratio} | {change} |"
            );
        }
        text
    }
}

/// Three digits and a unit that suits.
fn time(seconds: f64) -> String {
    let units = [(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")];
    let suits = units.into_iter().find(|(size, _)| seconds >= *size);
    let (size, unit) = suits.unwrap_or((1e-9, "ns"));
    format!("{} {unit}", rounded(seconds / size))
}

/// Three digits.
fn rounded(value: f64) -> String {
    let digits = 2.0 - value.abs().log10().floor();
    if (-3.0..=5.0).contains(&digits) {
        format!("{value:.*}", digits.max(0.0) as usize)
    } else {
        format!("{value:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn baseline() -> Baseline {
        toml::from_str(
            r#"
            measured = "once"
            slower_than = 1.2
            suites = ["a/a"]
            [bench]
            "own" = { against = "reference", ratio = 2.0 }
            "beside a peer" = { against = "peer", ratio = 0.5 }
            "peer" = { against = "reference", ratio = 1.0 }
            "#,
        )
        .unwrap()
    }

    fn figures(own_s: f64, beside_s: f64) -> BTreeMap<String, Figure> {
        let figure = |least_s| Figure {
            least_s,
            elements: Some(10.0),
            reference_s: 1e-3,
        };
        let all = [("own", own_s), ("beside a peer", beside_s), ("peer", 4e-3)];
        all.into_iter()
            .map(|(name, s)| (name.to_owned(), figure(s)))
            .collect()
    }

    #[test]
    fn a_fifth_slower_is_slow_and_a_slow_peer_is_not() {
        let baseline = baseline();
        let slow = |own_s, beside_s| -> Vec<String> {
            let rows = baseline.rows(&figures(own_s, beside_s)).unwrap();
            let slow = rows.into_iter().filter(|r| baseline.is_slow(r));
            slow.map(|r| r.name).collect()
        };
        assert_eq!(slow(2.3e-3, 2.3e-3), [""; 0]);
        assert_eq!(slow(2.5e-3, 2.3e-3), ["own"]);
        assert_eq!(slow(1e-3, 2.5e-3), ["beside a peer"]);
    }

    #[test]
    fn a_bench_that_is_no_longer_run_is_told() {
        let mut rows = baseline().rows(&figures(1.0, 1.0)).unwrap();
        assert!(baseline().check_all_ran(&rows).is_ok());
        let mut further = rows.clone();
        further[0].name.push_str(" of another kind");
        further.extend(rows.clone());
        assert!(baseline().check_all_ran(&further).is_err());
        rows.pop();
        assert!(baseline().check_all_ran(&rows).is_err());
    }

    #[test]
    fn the_table_replaces_the_one_before() {
        let rows = baseline().rows(&figures(2e-3, 2e-3)).unwrap();
        let page = "# B\n<!-- measured -->old<!-- end of measured -->\nrest\n";
        let once = baseline().write_into(page, "today", &rows).unwrap();
        assert!(
            once.contains("| own | 2.00 ms | 5000 | reference | 2.00 | 1.00 |"),
            "{once}"
        );
        assert!(once.starts_with("# B\n") && once.ends_with("\nrest\n") && !once.contains("old"));
        assert_eq!(baseline().write_into(&once, "today", &rows).unwrap(), once);
        assert!(baseline().write_into("# B", "today", &rows).is_err());
    }
}
