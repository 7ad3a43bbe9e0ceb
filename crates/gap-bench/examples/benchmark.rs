//! The benchmark with a choice of rows: `benchmark SEEDS [ROW [FIRST_SEED]]`, where ROW is part
//! of a row's name such as "none" or "D = 60". The whole of it is `plumage gap benchmark`.

use std::time::Instant;

use gap_bench::{Options, run_with};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).and_then(|a| a.parse::<u64>().ok());
    let options = Options {
        only: arguments.get(1).cloned().unwrap_or_default(),
        first_seed: number(2).unwrap_or(0),
        ..Options::new(number(0).unwrap_or(1))
    };
    let start = Instant::now();
    let summary = run_with(&options, &|_, done, all| {
        if done % 10 == 0 || done == all {
            eprintln!("{done} of {all}, {:.0} s", start.elapsed().as_secs_f64());
        }
    });
    println!("{}", summary.to_markdown());
}
