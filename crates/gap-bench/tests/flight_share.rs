//! A small fixed share of the benchmark of flight: of the second tier. The first has `families.rs`.

use gap_bench::flight::{BenchAircraft, FlightShare, FlightSummary, run};
use gap_truth::flight::FlightNoise;

fn share(first: u64, seeds: u64, share: FlightShare) -> FlightSummary {
    let fleet = [
        BenchAircraft::new(include_str!("../../../aircraft/x8.toml")).unwrap(),
        BenchAircraft::new(include_str!("../../../aircraft/ultrastick-25e.toml")).unwrap(),
    ];
    let summary = run(&fleet, first, seeds, &share, 2, &|_, _| {});
    let lost: Vec<_> = summary
        .outcomes
        .iter()
        .filter(|o| o.error.is_some())
        .collect();
    assert!(lost.is_empty(), "{lost:?}");
    summary
}

#[test]
#[ignore = "second tier: a rate over many cases"]
fn nothing_is_found_where_nothing_is_hidden() {
    let nothing = FlightShare {
        nothing: true,
        one_in: 0,
        others: false,
        only: String::new(),
    };
    let summary = share(100, 4, nothing);
    let alarms = summary.false_alarms(FlightNoise::Usual);
    assert_eq!(
        (alarms.hits, alarms.of),
        (0, 4),
        "{}",
        summary.to_markdown()
    );
}

// One effect in four of the catalogue, of the first seed, at D = 20 and 60. Bars of 95 and 99 %:
// of eight cases, more than one miss has a chance below 2 %. Wrong with confidence is at most one
// in a hundred: none of these.
#[test]
#[ignore = "second tier: a rate over many cases"]
fn what_is_hidden_is_found_and_nothing_else() {
    let one = FlightShare {
        nothing: false,
        one_in: 4,
        others: false,
        only: String::new(),
    };
    let summary = share(0, 1, one);
    let mut missed = 0;
    for nats in [20.0, 60.0] {
        let found = summary.detected(nats);
        assert!(found.of >= 3, "{}", summary.to_markdown());
        missed += found.of - found.hits;
        let held = summary.in_sets(nats);
        assert_eq!(held.hits, held.of, "{}", summary.to_markdown());
    }
    assert!(missed <= 1, "{}", summary.to_markdown());
    let wrong = summary.wrong(|_| true);
    assert_eq!(wrong.hits, 0, "{}", summary.to_markdown());
}
