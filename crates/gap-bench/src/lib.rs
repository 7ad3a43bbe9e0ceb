//! The finder on hidden cases: what it detects, names, gets wrong, and how sure it was.
//!
//! The cases come from `gap_truth`, which shares no code with the finder; the finder gets the
//! files only. How visible an effect is (D, nats) follows from the generator's own noise; strengths are
//! tuned until that is what a row of the table asks for.
//!
//! Pure: seeds in, table out. Cases run on several threads; the answer does not depend on them. The
//! program of the same name, for developers, writes the tables to `docs/`.

pub mod flight;
mod judge;
mod made;
mod plan;
mod rates;
mod sensitivity;
mod summary;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

pub use judge::{
    FlownOn, Hidden, Judging, Outcome, Said, SaidCause, SaidParameter, find, judge, read,
};
pub use made::{Made, make};
pub use plan::{Kind, Task, plan, share_of};
pub use rates::{Rate, clopper_pearson, reaches};
pub use sensitivity::sensitivity;
pub use summary::{Line, Summary};

/// How the benchmark is run.
#[derive(Debug, Clone)]
pub struct Options {
    /// What is judged.
    pub tasks: Vec<Task>,
    /// Threads, each with a case of its own.
    pub threads: usize,
    /// Outcomes of an earlier run of the same finder; their tasks are not judged again.
    pub known: Vec<Outcome>,
    /// How a case is judged.
    pub judging: Judging,
}

impl Options {
    /// Judges `tasks` on two threads, without a clock and without flying on.
    pub fn new(tasks: Vec<Task>) -> Self {
        Self {
            tasks,
            threads: 2,
            known: Vec::new(),
            judging: Judging {
                clock_s: || 0.0,
                fly_on: false,
            },
        }
    }
}

/// What is told after every task that was judged: its outcome, how many tasks are done, and of how
/// many.
pub type Progress<'a> = dyn Fn(&Outcome, usize, usize) + Sync + 'a;

/// Runs the benchmark as `options` say.
pub fn run_with(options: &Options, progress: &Progress<'_>) -> Summary {
    let tasks = &options.tasks;
    let known = |t: &Task| options.known.iter().find(|o| o.task == *t);
    let open: Vec<Task> = tasks
        .iter()
        .filter(|t| known(t).is_none())
        .cloned()
        .collect();
    let done = tasks.len() - open.len();
    let tell = |outcome: &Outcome, k: usize, _: usize| progress(outcome, done + k, tasks.len());
    let mut judged = run_tasks(&open, options, &tell).into_iter();
    let of = |t: &Task| known(t).cloned().or_else(|| judged.next());
    Summary::new(tasks.iter().filter_map(of).collect())
}

/// Judges `tasks`; the outcomes are in the order of the tasks.
fn run_tasks(tasks: &[Task], options: &Options, progress: &Progress<'_>) -> Vec<Outcome> {
    let outcomes: Vec<Mutex<Option<Outcome>>> = tasks.iter().map(|_| Mutex::new(None)).collect();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..options.threads.max(1) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(task) = tasks.get(i) else { break };
                    let outcome = judge(task, &options.judging);
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
