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
mod on_threads;
mod plan;
mod rates;
mod sensitivity;
mod summary;

use on_threads::on_threads;

pub use judge::{
    Considered, FinderReport, FlownOn, Hidden, Judging, Outcome, ReportedCause, ReportedParameter,
    find, judge, read,
};
pub use made::{Made, make};
pub use plan::{Generator, Kind, Task, plan, share_by, share_of};
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
    let known_count = tasks.len() - open.len();
    let judged = on_threads(options.threads, &open, &|task, done| {
        let outcome = judge(task, &options.judging);
        progress(&outcome, known_count + done(), tasks.len());
        outcome
    });
    let mut judged = judged.into_iter();
    let of = |t: &Task| known(t).cloned().or_else(|| judged.next());
    Summary::new(tasks.iter().filter_map(of).collect())
}
