//! The benchmark of flight with a choice: `flight SEEDS [FIRST_SEED [ONE_IN [nothing|others]]]`.

use gap_bench::flight::{Bird, FlightShare, run};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).and_then(|a| a.parse::<u64>().ok());
    let files = ["aircraft/x8.toml", "aircraft/ultrastick-25e.toml"];
    let texts = files.map(|f| std::fs::read_to_string(f).unwrap_or_default());
    let birds: Vec<Bird<'_>> = texts.iter().filter_map(|t| Bird::new(t).ok()).collect();
    let word = arguments.get(3).map_or("", String::as_str);
    let share = FlightShare {
        nothing: word != "others",
        one_in: number(2).unwrap_or(1) as usize,
        others: word != "nothing",
    };
    let summary = run(
        &birds,
        number(1).unwrap_or(0),
        number(0).unwrap_or(1),
        share,
        1,
        &|done, outcomes| {
            for o in outcomes {
                eprintln!(
                    "{done}: {:?} {:?} {:?} {:?}",
                    o.kind, o.verdict, o.sets, o.coordinate
                );
            }
        },
    );
    println!("{}", summary.to_markdown());
}
