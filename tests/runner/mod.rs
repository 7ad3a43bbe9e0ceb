//! Tests as trials of libtest-mimic: a trial may report when it runs that this machine lacks what it needs. All
//! trials are started at once. Those that wait for real time pass side by side, those that compute share the cores.

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::process::ExitCode;
use std::sync::{Arc, Condvar, Mutex};

/// Missions in real time that this many tests fly side by side. Each takes a tenth to a fifth of a core, and much more while
/// its processes start; a process that gets none for five seconds counts as missing.
const WAITING: usize = 3;

/// What a test returns.
pub trait Ending {
    /// The same as an outcome of libtest-mimic.
    fn completion(self) -> Result<Completion, Failed>;
}

impl Ending for () {
    fn completion(self) -> Result<Completion, Failed> {
        Ok(Completion::Completed)
    }
}

impl Ending for Result<(), Failed> {
    fn completion(self) -> Result<Completion, Failed> {
        self.map(|()| Completion::Completed)
    }
}

impl Ending for Result<Completion, Failed> {
    fn completion(self) -> Result<Completion, Failed> {
        self
    }
}

/// What a test spends its time with.
#[derive(Clone, Copy)]
pub enum Spends {
    /// Computing: one test at a time for each core but one.
    Cores,
    /// Waiting for processes that fly in real time: [`WAITING`] tests at a time.
    RealTime,
}

/// One test.
pub struct Test {
    name: String,
    spends: Spends,
    second_tier: Option<&'static str>,
    run: Box<dyn FnOnce() -> Result<Completion, Failed> + Send>,
}

impl Test {
    /// A test of the module `path`.
    pub fn new<E: Ending>(
        path: &str,
        name: &str,
        spends: Spends,
        run: impl FnOnce() -> E + Send + 'static,
    ) -> Self {
        let module = path.split_once("::").map_or(path, |(_, module)| module);
        Self {
            name: format!("{module}::{name}"),
            spends,
            second_tier: None,
            run: Box::new(|| run().completion()),
        }
    }

    /// The same, of the second tier for `reason`.
    pub fn of_second_tier(mut self, reason: &'static str) -> Self {
        self.second_tier = Some(reason);
        self
    }
}

/// Lists the tests of a module as `pub fn tests()`.
macro_rules! tests {
    ($($spends:ident { $($(#[ignore = $reason:literal])? $name:ident,)* })*) => {
        pub fn tests() -> Vec<crate::runner::Test> {
            vec![$($({
                let test = crate::runner::Test::new(
                    module_path!(),
                    stringify!($name),
                    crate::runner::Spends::$spends,
                    $name,
                );
                $(let test = test.of_second_tier($reason);)?
                test
            }),*),*]
        }
    };
}
pub(crate) use tests;

/// How many may run at once, and how many of those do not.
struct Permits {
    free: Mutex<usize>,
    given_back: Condvar,
}

impl Permits {
    fn new(count: usize) -> Arc<Self> {
        Arc::new(Self {
            free: Mutex::new(count),
            given_back: Condvar::new(),
        })
    }

    /// Runs `test` once there is a permit for it.
    fn within<T>(&self, test: impl FnOnce() -> T) -> T {
        struct GivesBack<'a>(&'a Permits);
        impl Drop for GivesBack<'_> {
            fn drop(&mut self) {
                *self.0.free.lock().unwrap() += 1;
                self.0.given_back.notify_one();
            }
        }
        let free = self.free.lock().unwrap();
        *self.given_back.wait_while(free, |free| *free == 0).unwrap() -= 1;
        let _gives_back = GivesBack(self);
        test()
    }
}

/// Runs the tests that the command line asks for.
pub fn run(tests: Vec<Test>) -> ExitCode {
    let mut arguments = Arguments::from_args();
    arguments.test_threads.get_or_insert(tests.len());
    // One core is left to those that fly in real time.
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    let cores = Permits::new((count - 1).max(1));
    let waiting = Permits::new(WAITING);
    let trials = tests.into_iter().map(|test| {
        let permits = match test.spends {
            Spends::Cores => Arc::clone(&cores),
            Spends::RealTime => Arc::clone(&waiting),
        };
        let trial = Trial::ignorable_test(test.name, move || permits.within(test.run));
        match test.second_tier {
            Some(reason) => trial.with_kind(reason).with_ignored_flag(true),
            None => trial,
        }
    });
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}
