//! A small fixed share of the benchmark, with the same bars: of the second tier. The first has `families.rs`.

use gap::verdict::Verdict;
use gap_bench::{Outcome, Summary, Task, plan, run_tasks};
use gap_truth::NoiseForm;

/// The first `count` tasks of every row that `wanted` picks.
fn share(wanted: impl Fn(&str) -> bool, count: usize) -> Summary {
    let mut seen: Vec<(String, usize)> = Vec::new();
    let tasks: Vec<Task> = plan(1, 0)
        .into_iter()
        .filter(|t| {
            let row = t.row();
            let at = seen.iter().position(|s| s.0 == row).unwrap_or_else(|| {
                seen.push((row.clone(), 0));
                seen.len() - 1
            });
            seen[at].1 += 1;
            wanted(&row) && seen[at].1 <= count
        })
        .collect();
    let outcomes = run_tasks(&tasks, 2, &|_, _, _| {});
    assert!(outcomes.iter().all(|o| o.error.is_none()), "{outcomes:?}");
    Summary::new(1, outcomes)
}

// At most 1 % and 3 % false alarms: of 12 each, more than one has a chance below 1 % and 5 %. Five
// with slow sensors: of these none more than once in seven. Five in a gusty wind: more than one has a
// chance below 1 %. Five in a swinging wind that nobody logged, of which one in five is taken for a
// cause: more than two have a chance of 6 %.
#[test]
#[ignore = "second tier: a rate over many cases"]
fn nothing_is_found_where_nothing_is_hidden() {
    let summary = share(|row| row.starts_with("none"), 12);
    for noise in [NoiseForm::Usual, NoiseForm::Unusual] {
        let alarms = summary.false_alarms(noise);
        assert!(
            alarms.of == 12 && alarms.hits <= 1,
            "{}",
            summary.to_markdown()
        );
    }
    let slow = summary.false_alarms(NoiseForm::SlowSensors);
    assert!(slow.of == 5 && slow.hits == 0, "{}", summary.to_markdown());
    let gusty = summary.false_alarms(NoiseForm::GustyWind);
    assert!(
        gusty.of == 5 && gusty.hits <= 1,
        "{}",
        summary.to_markdown()
    );
    let unlogged = summary.false_alarms(NoiseForm::UnloggedWind);
    assert!(
        unlogged.of == 5 && unlogged.hits <= 2,
        "{}",
        summary.to_markdown()
    );
}

// Detected 99 %, in the set 98 %, wrong with confidence 1 %: of ten, more than one miss of a kind
// has a chance below 2 %.
#[test]
#[ignore = "second tier: a rate over many cases"]
fn what_is_hidden_is_found() {
    let rows = [
        "wind-direction-drift, D = 60",
        "wind-veer-with-height, D = 60",
        "sigma-z-scale, D = 60",
        "effective-height-offset, D = 60",
        "emission-trend, D = 60",
        "second-source, D = 60",
        "background-drift, D = 60",
        "sensor-lag, D = 60",
        "sensor-offset, D = 60",
        "position-offset, D = 60",
    ];
    let summary = share(|row| rows.contains(&row), 1);
    let cases: Vec<&Outcome> = summary.one(60.0);
    assert!(cases.len() >= 8, "{}", summary.to_markdown());
    let missed = cases.len() - Summary::detected(&cases).hits;
    let in_set = Summary::in_set(&cases);
    let wrong = Summary::confidently_wrong(&cases).hits;
    let good = missed <= 1 && in_set.of - in_set.hits <= 1 && wrong <= 1;
    assert!(good, "{}", summary.to_markdown());
}

// Unexplained with the right coordinate 90 %, a name said with confidence 2 %: of eight, more than
// two misses have a chance below 4 %, more than one such name below 2 %.
#[test]
#[ignore = "second tier: a rate over many cases"]
fn what_no_mechanism_explains_is_not_named() {
    let summary = share(|row| row.starts_with("outside"), 1);
    let cases: Vec<&Outcome> = summary.outcomes.iter().filter(|o| !o.unreachable).collect();
    assert!(cases.len() >= 7, "{}", summary.to_markdown());
    let missed = cases.len() - Summary::rightly_unexplained(&cases).hits;
    let named = Summary::confidently_wrong(&cases).hits;
    assert!(missed <= 2 && named <= 1, "{}", summary.to_markdown());
}

// A strength that changes with distance, which every platform met at a distance of its own, looks
// like the gain of one sensor with a probability of .9: not enough for a name to be said alone, which
// takes .95.
#[test]
#[ignore = "second tier: a case whose strength is searched for"]
fn a_name_that_is_not_sure_does_not_stand_alone() {
    let one = outcome(470_000_000, 478_100_015);
    assert_eq!(one.verdict, Some(Verdict::Unexplained), "{one:?}");
    assert_eq!(one.coordinate.as_deref(), Some("along_wind"), "{one:?}");
    assert!((0.5..0.95).contains(&one.stated.unwrap().0), "{one:?}");
}

// A delay that comes and goes looks like a lag or a clock with a probability of .65: not enough for
// a set either.
#[test]
#[ignore = "second tier: a case whose strength is searched for"]
fn a_set_that_is_not_sure_does_not_stand_alone() {
    let one = outcome(520_000_000, 528_300_013);
    assert_eq!(one.verdict, Some(Verdict::Unexplained), "{one:?}");
    assert_eq!(one.coordinate.as_deref(), Some("platform"), "{one:?}");
    assert!(one.sets[0].len() > 1, "{one:?}");
    assert!(one.stated.unwrap().0 < 0.9, "{one:?}");
}

// Behind an obstacle the plume looks narrower, until the base has a better place; there it looks so
// again, and again the base has a better place. What is neither stands, without a name.
#[test]
#[ignore = "second tier: a case whose strength is searched for"]
fn what_called_for_a_name_that_is_needless_stands_without_one() {
    let one = outcome(600_000_000, 608_200_001);
    assert_eq!(one.verdict, Some(Verdict::Unexplained), "{one:?}");
    assert_eq!(one.coordinate.as_deref(), Some("map"), "{one:?}");
}

// Both named exactly 92 %: of eight, more than two misses have a chance below 3 %.
#[test]
#[ignore = "second tier: a rate over many cases"]
fn two_effects_are_both_named() {
    let summary = share(|row| row.starts_with("two effects"), 8);
    let cases: Vec<&Outcome> = summary.outcomes.iter().filter(|o| !o.unreachable).collect();
    assert!(cases.len() >= 6, "{}", summary.to_markdown());
    let missed = cases.len() - Summary::exactly(&cases).hits;
    assert!(missed <= 2, "{}", summary.to_markdown());
}

/// The outcome of one case of the plan from a first seed.
fn outcome(first_seed: u64, seed: u64) -> Outcome {
    let mut tasks = plan(20, first_seed);
    tasks.retain(|t| t.seed == seed);
    run_tasks(&tasks, 2, &|_, _, _| {}).remove(0)
}

// A plume that came down while its source grew: each takes back what the other changes, and no
// mechanism alone gains 8 nats.
#[test]
#[ignore = "second tier: a case whose strength is searched for"]
fn causes_that_hide_each_other_are_found_together() {
    let one = outcome(450_000_000, 459_200_003);
    assert_eq!(one.sets.len(), 2, "{one:?}");
    assert_eq!(one.in_sets, 2, "{one:?}");
}

// Without a log a wind two degrees off looks, to a base that lets it turn by eight degrees an hour,
// much like one that turned for ten minutes.
#[test]
#[ignore = "second tier: a case whose strength is searched for"]
fn a_wind_that_stood_elsewhere_is_not_taken_to_have_turned() {
    let one = outcome(470_000_000, 470_300_002);
    assert_eq!(one.sets, [["wind-direction-offset"]], "{one:?}");
}

// A plume that is 8 % narrower than the base's. Swings that widen the mean plume are tolerated; seen
// from the narrow plume their straight line leads to the wide one, seen from the wide one it does not.
#[test]
#[ignore = "second tier: a case whose strength is searched for"]
fn a_narrower_plume_is_named() {
    let one = outcome(470_000_000, 470_900_007);
    assert_eq!(one.sets, [["sigma-y-scale"]], "{one:?}");
    let beside_a_zero = outcome(490_000_000, 499_000_000);
    assert_eq!(beside_a_zero.named, 2, "{beside_a_zero:?}");
    assert_eq!(beside_a_zero.sets.len(), 2, "{beside_a_zero:?}");
}

// Frozen, clipped and silent sensors are said.
#[test]
#[ignore = "second tier: a rate over many cases"]
fn damage_is_said() {
    let summary = share(|row| row.starts_with("damaged"), 1);
    for outcome in &summary.outcomes {
        let kind = outcome.task.row().replace("damaged: ", "");
        assert!(
            outcome.flaws.iter().any(|f| f.0 == kind),
            "{kind}: {:?}",
            outcome.flaws
        );
    }
}

// A changed unit or order of coordinates is said, shuffled readings do not pass for none.
#[test]
#[ignore = "second tier: a rate over many cases"]
fn changed_files_are_noticed() {
    let summary = share(|row| row.starts_with("mutated"), 1);
    for outcome in &summary.outcomes {
        let unit = outcome.flaws.iter().any(|f| f.0 == "unit");
        assert!(
            unit || outcome.detected(),
            "{}: {outcome:?}",
            outcome.task.row()
        );
    }
}
