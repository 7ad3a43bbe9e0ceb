//! The finder on hidden cases: what it detects, names, gets wrong, and how sure it was.
//!
//! The cases come from `gap_truth`, which shares no code with the finder; the finder gets the
//! files only. How visible an effect is is measured in nats ([`tune`]); strengths are tuned until
//! that is what a row of the table asks for.
//!
//! Pure: seeds in, table out. Cases run on several threads; the answer does not depend on them. The
//! program of the same name, for developers, writes the tables to `docs/`.

pub mod flight;
mod judge;
mod plan;
mod rates;
mod summary;
pub mod tune;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

pub use judge::{FlownOn, Outcome, judge, judge_tuned};
pub use plan::{Kind, Task, plan};
pub use rates::{Rate, clopper_pearson};
pub use summary::Summary;

/// How the benchmark is run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Seeds a case; at least 20 for figures that count.
    pub seeds: u64,
    /// Threads, each with a case of its own.
    pub threads: usize,
    /// Only tasks whose row contains this; empty for all.
    pub only: String,
    /// Added to every seed, for figures on cases that nobody has seen.
    pub first_seed: u64,
    /// Outcomes of an earlier run of the same finder; their tasks are not judged again.
    pub known: Vec<Outcome>,
}

impl Options {
    /// `seeds` seeds a case, two threads, all rows.
    pub fn new(seeds: u64) -> Self {
        Self {
            seeds,
            threads: 2,
            only: String::new(),
            first_seed: 0,
            known: Vec::new(),
        }
    }
}

/// What is told after every task that was judged: its outcome, how many tasks are done, and of how
/// many.
pub type Progress<'a> = dyn Fn(&Outcome, usize, usize) + Sync + 'a;

/// Runs the benchmark as `options` say.
pub fn run_with(options: &Options, progress: &Progress<'_>) -> Summary {
    let mut tasks = plan(options.seeds, options.first_seed);
    tasks.retain(|t| t.row().contains(&options.only));
    let known = |t: &Task| options.known.iter().find(|o| o.task == *t);
    let open: Vec<Task> = tasks
        .iter()
        .filter(|t| known(t).is_none())
        .cloned()
        .collect();
    let done = tasks.len() - open.len();
    let tell = |outcome: &Outcome, k: usize, _: usize| progress(outcome, done + k, tasks.len());
    let mut judged = run_tasks(&open, options.threads, &tell).into_iter();
    let of = |t: &Task| known(t).cloned().or_else(|| judged.next());
    Summary::new(options.seeds, tasks.iter().filter_map(of).collect())
}

/// Judges `tasks` on `threads` threads; the outcomes are in the order of the tasks.
pub fn run_tasks(tasks: &[Task], threads: usize, progress: &Progress<'_>) -> Vec<Outcome> {
    let outcomes: Vec<Mutex<Option<Outcome>>> = tasks.iter().map(|_| Mutex::new(None)).collect();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(task) = tasks.get(i) else { break };
                    let outcome = judge(task);
                    let k = done.fetch_add(1, Ordering::Relaxed) + 1;
                    progress(&outcome, k, tasks.len());
                    if let Ok(mut slot) = outcomes[i].lock() {
                        *slot = Some(outcome);
                    }
                }
            });
        }
    });
    outcomes
        .into_iter()
        .filter_map(|o| o.into_inner().ok().flatten())
        .collect()
}
