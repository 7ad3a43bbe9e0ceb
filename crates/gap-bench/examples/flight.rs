//! The benchmark of flight with a choice: `flight SEEDS [FIRST_SEED [ONE_IN [nothing|others|ones|all
//! [NAME]]]]`: of each seed every so many-th effect; cases whose name contains NAME.

use gap_bench::flight::{BenchAircraft, FlightShare, run};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).and_then(|a| a.parse::<u64>().ok());
    let files = ["aircraft/x8.toml", "aircraft/ultrastick-25e.toml"];
    let texts = files.map(|f| std::fs::read_to_string(f).unwrap_or_default());
    let fleet: Vec<BenchAircraft<'_>> = texts
        .iter()
        .filter_map(|t| BenchAircraft::new(t).ok())
        .collect();
    let word = arguments.get(3).map_or("all", String::as_str);
    let share = FlightShare {
        nothing: matches!(word, "nothing" | "all"),
        one_in: number(2).unwrap_or(1) as usize,
        others: matches!(word, "others" | "all"),
        only: arguments.get(4).cloned().unwrap_or_default(),
    };
    let summary = run(
        &fleet,
        number(1).unwrap_or(0),
        number(0).unwrap_or(1),
        &share,
        std::thread::available_parallelism().map_or(1, usize::from),
        &|done, outcomes| {
            for o in outcomes {
                eprintln!(
                    "{done}: {}, seed {}: {}; held out {:.1?}; errors {:.1?}",
                    o.kind,
                    o.seed,
                    o.description(),
                    o.gain,
                    o.errors_sd
                );
            }
        },
    );
    println!("{}", summary.to_markdown());
}
