//! A recording on the page, with a timeline to wind it.

use crate::commands::run::interrupt_flag;
use crate::pace::Speed;
use crate::page::{LivePage, PageArguments, Serve};
use crate::{Failure, mission_files, site};
use protocol::bus::Publication;
use protocol::{SimTime, Topic};
use record::Recording;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use views::live::RunStatus;
use views::page::{DEFAULT_ADDRESS, Offered, PageCommand, PageOptions};

/// Time between two moments that are shown.
const MOMENT: Duration = Duration::from_millis(50);
/// Least time between two states, readings or modes of a vehicle that are kept, s: enough for a page, and a mission
/// of an hour with a hundred vehicles fits into memory.
const KEEP_EVERY_S: f64 = 0.5;
/// Vehicles with which that time begins to grow.
const KEEP_WITH: usize = 20;

/// Where and how a recording is shown.
#[derive(Debug, clap::Args)]
pub struct ShowArguments {
    /// Serve the recording on a page with a timeline
    #[arg(long, help_heading = "Page")]
    pub serve: bool,
    /// Serve the page at this address
    #[arg(
        long,
        help_heading = "Page",
        value_name = "ADDR",
        default_value = DEFAULT_ADDRESS,
        requires = "serve"
    )]
    address: String,
    /// Initial speed: real, max, or a factor of real time above 0
    #[arg(long, default_value = "10", requires = "serve", help_heading = "Page")]
    speed: Speed,
    #[command(flatten)]
    page: PageArguments,
}

/// What a page shows of a recording, in memory, so that it can be wound.
struct Shown {
    said: Vec<Publication>,
}

impl Shown {
    /// Reads a recording of a team of `vehicles`.
    fn read(recording: &Recording, vehicles: usize) -> Result<Self, Failure> {
        let thin = (vehicles as f64 / KEEP_WITH as f64).max(1.0);
        let every = SimTime::from_s(KEEP_EVERY_S * thin);
        let mut due: BTreeMap<Topic, SimTime> = BTreeMap::new();
        let mut said = Vec::new();
        for message in recording.in_order().map_err(Failure::input)? {
            let (topic, envelope) = message.map_err(Failure::input)?;
            match &topic {
                Topic::State(_) | Topic::Reading(_) | Topic::Health(_) => {
                    let next = due.get(&topic).copied().unwrap_or(SimTime::ZERO);
                    if envelope.time < next {
                        continue;
                    }
                    due.insert(topic.clone(), envelope.time.later(every.ns()));
                }
                Topic::Mode(_)
                | Topic::Plan
                | Topic::Population
                | Topic::Model
                | Topic::Extension
                | Topic::Event(_) => {}
                _ => continue,
            }
            said.push((topic, envelope));
        }
        Ok(Self { said })
    }

    fn span_s(&self) -> (f64, f64) {
        let time = |p: Option<&Publication>| p.map_or(0.0, |(_, e)| e.time.s());
        (time(self.said.first()), time(self.said.last()))
    }

    /// How many messages were said until `time_s`.
    fn until(&self, time_s: f64) -> usize {
        self.said.partition_point(|(_, e)| e.time.s() <= time_s)
    }
}

/// The page of a recording as it plays.
struct Player {
    shown: Shown,
    page: LivePage,
    /// Messages shown so far.
    at: usize,
    time_s: f64,
    run: RunStatus,
}

impl Player {
    /// Shows the recording as it was at `time_s`.
    fn wind(&mut self, time_s: f64) {
        let to = self.shown.until(time_s);
        if to < self.at {
            self.page.with(|live| live.forget());
            self.at = 0;
        }
        let said = self.shown.said.get(self.at..to).unwrap_or_default();
        self.page.take(said);
        self.at = to;
        self.time_s = time_s;
    }

    fn obey(&mut self) {
        let (first_s, last_s) = self.shown.span_s();
        for command in self.page.commands() {
            match command {
                PageCommand::Pause => self.run.paused = true,
                PageCommand::Resume => {
                    self.run.paused = false;
                    // From the end it goes on at the beginning.
                    if self.time_s >= last_s {
                        self.wind(first_s);
                    }
                }
                PageCommand::Speed(factor) => self.run.speed = factor,
                PageCommand::Seek(time_s) => self.wind(time_s.clamp(first_s, last_s)),
                // Nobody flies in a recording.
                PageCommand::HandBack(_)
                | PageCommand::TakeOver(..)
                | PageCommand::SendTo(..)
                | PageCommand::Home(_) => {}
            }
        }
    }

    fn play(&mut self, stop: &AtomicBool) {
        let (_, last_s) = self.shown.span_s();
        let mut since = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(MOMENT);
            let passed_s = since.elapsed().as_secs_f64();
            since = Instant::now();
            self.obey();
            if !self.run.paused && self.time_s < last_s {
                self.wind((self.time_s + passed_s * self.run.speed).min(last_s));
            }
            self.run.real_time_factor = self.run.speed;
            self.run.ended = self.time_s >= last_s;
            self.page.show(self.run);
        }
    }
}

/// Shows a recording until it is interrupted.
///
/// # Errors
/// A recording that cannot be read, or an address that is taken.
pub fn show(recording: &Recording, arguments: &ShowArguments) -> Result<(), Failure> {
    let setup = mission_files::load_recorded(recording)?;
    let site = Arc::new(site::of(&setup)?);
    eprintln!("reading {} …", recording.path().display());
    let shown = Shown::read(recording, setup.scenario.vehicles.len())?;
    let report = recording.path().with_file_name("report.html");
    let options = PageOptions {
        offered: Offered {
            pause: true,
            speed: true,
            control: false,
            timeline_s: Some(shown.span_s()),
        },
        tiles: arguments.page.tiles()?,
        token: arguments.page.token()?,
        report: Some(report.clone()),
    };
    let page = LivePage::open(&Serve::At(arguments.address.clone()), &setup, site, options)?;
    let Some(page) = page else {
        return Ok(());
    };
    let stop = interrupt_flag()?;
    eprintln!("page: http://{}/ (interrupt to stop)", page.address);
    let run = RunStatus {
        speed: arguments.speed.0,
        reported: report.is_file(),
        ..RunStatus::default()
    };
    let mut player = Player {
        shown,
        page,
        at: 0,
        time_s: 0.0,
        run,
    };
    player.play(&stop);
    player.page.close();
    Ok(())
}
