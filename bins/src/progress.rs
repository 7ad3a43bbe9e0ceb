//! How far a command is, for everything that may take longer than a moment: a bar on a terminal, and without one a
//! line on standard error now and then.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Nothing is said of what ends sooner.
const PATIENCE: Duration = Duration::from_secs(2);
/// Without a terminal a line is said this often: a log is to be read afterwards.
const AGAIN: Duration = Duration::from_secs(15);
/// A bar without a known length moves this often.
const TICK: Duration = Duration::from_millis(120);

/// Something whose end is known.
pub struct Bar {
    bar: ProgressBar,
    doing: &'static str,
    begun: Instant,
    /// When a line is said next, since the beginning; none on a terminal.
    next: Option<Mutex<Duration>>,
}

impl Bar {
    /// Begins with `doing` ("flying missions") for `of` steps; `template` is that of the bar on a terminal.
    pub fn new(doing: &'static str, of: u64, template: &str) -> Self {
        let bar = ProgressBar::new(of);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.tick();
        Self {
            bar,
            doing,
            begun: Instant::now(),
            next: (!std::io::stderr().is_terminal()).then(|| Mutex::new(PATIENCE)),
        }
    }

    /// So many steps are done.
    pub fn set_position(&self, done: u64) {
        self.bar.set_position(done);
        self.say();
    }

    /// One more step is done.
    pub fn inc(&self) {
        self.bar.inc(1);
        self.say();
    }

    /// So many steps there are.
    pub fn set_length(&self, of: u64) {
        self.bar.set_length(of);
    }

    /// What is being done.
    pub fn set_message(&self, message: impl Into<String>) {
        self.bar.set_message(message.into());
    }

    /// Prints a line above the bar.
    pub fn println(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    /// Ends it.
    pub fn finish_and_clear(&self) {
        self.bar.finish_and_clear();
    }

    fn say(&self) {
        let Some(Ok(mut next)) = self.next.as_ref().map(Mutex::lock) else {
            return;
        };
        let since = self.begun.elapsed();
        if since < *next {
            return;
        }
        *next = since + AGAIN;
        let message = self.bar.message();
        let apart = if message.is_empty() { "" } else { ", " };
        let (done, of) = (self.bar.position(), self.bar.length().unwrap_or(0));
        eprintln!(
            "{}: {done} of {of}{apart}{message}, {:.0} s",
            self.doing,
            since.as_secs_f64()
        );
    }
}

/// Something whose end is not known, until it is dropped.
pub struct Waiting {
    bar: ProgressBar,
    end: Option<Sender<()>>,
    watch: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Begins with `doing`: "reading the recording" and so on.
    pub fn new(doing: &'static str) -> Self {
        if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new_spinner().with_message(doing);
            if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
                bar.set_style(style);
            }
            bar.enable_steady_tick(TICK);
            return Self {
                bar,
                end: None,
                watch: None,
            };
        }
        let (end, ended) = channel();
        let watch = std::thread::spawn(move || {
            let begun = Instant::now();
            let mut wait = PATIENCE;
            while ended.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                eprintln!("{doing}: {:.0} s", begun.elapsed().as_secs_f64());
                wait = AGAIN;
            }
        });
        Self {
            bar: ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()),
            end: Some(end),
            watch: Some(watch),
        }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
        drop(self.end.take());
        if let Some(watch) = self.watch.take() {
            // A thread that has nothing more to say.
            let _ = watch.join();
        }
    }
}
