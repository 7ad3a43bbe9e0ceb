//! `plumage run`: a mission in one process.

use super::control;
use crate::feeding::{FeedOptions, Start};
use crate::ground_station::GroundStation;
use crate::interrupts::{Interrupts, TERMINATED};
use crate::metrics::OfRun;
use crate::mission_files::MissionOptions;
use crate::outputs::{self, Outputs, fresh_folder};
use crate::outside::Outside;
use crate::pace::{Pace, Reached, Speed};
use crate::page::{self, LivePage, PageArguments, Serve};
use crate::progress::Bar;
use crate::ros2::{Ros2, Ros2Arguments};
use crate::{Failure, preflight, ranges, runtime, site};
use anyhow::Context as _;
use mav_bridge::link::LinkAddress;
use mission::run::{MESSAGES_WORTH_A_THREAD, beside};
use mission::{Run, Setup};
use protocol::bus::Publication;
use protocol::message::{Control, ControlWish, Message, Phase};
use stand_in::TeamWish;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use views::page::PageCommand;

/// Speed at which a mission of half an hour is watched in a minute, simulated over wall time.
const WATCHED: f64 = 30.0;

/// Arguments of `plumage run`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage run scenarios/as-pontes.toml --seed 7 --out out/seed-7")]
pub struct RunArguments {
    /// Scenario to fly (TOML)
    pub scenario: PathBuf,
    /// Seed, length and gas
    #[command(flatten)]
    pub mission: MissionOptions,
    /// Speed of the mission: real, max, or a factor of real time above 0 [default: max; 30 when started from a terminal
    /// with a live page and without --out]
    #[arg(long, help_heading = "Mission")]
    pub speed: Option<Speed>,
    /// Apply named causes to the simulated world while the mission flies
    #[arg(long, help_heading = "Mission")]
    pub adopt: bool,
    /// Folder for the outputs [default: a new folder in out/]
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    pub out: Option<PathBuf>,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long, help_heading = "Outputs")]
    pub force: bool,
    /// Write the MAVLink traffic with ground stations to this telemetry log, which they can replay
    #[arg(long, value_name = "FILE", help_heading = "Outputs")]
    pub tlog: Option<PathBuf>,
    /// Serve the live page at this address [default: 127.0.0.1:8787, if it is free]
    #[arg(
        long,
        value_name = "ADDR",
        conflicts_with = "no_serve",
        help_heading = "Page"
    )]
    pub serve: Option<String>,
    /// Do not serve the live page
    #[arg(long, help_heading = "Page")]
    pub no_serve: bool,
    /// Keep serving the page after the mission until interrupted
    #[arg(long, help_heading = "Page")]
    pub hold: bool,
    /// What lies under the map
    #[command(flatten)]
    pub page: PageArguments,
    /// Fly vehicle ID with the real aircraft on LINK, such as 3=udpin:0.0.0.0:14550; needs --speed real; repeatable
    #[arg(long, value_name = "ID=LINK", help_heading = "Real vehicles")]
    pub real: Vec<String>,
    /// Fly the last N vehicles of the team as stand-ins, simulated ArduPlanes in place of real aircraft, and simulate
    /// the others, 0 to the team's size
    #[arg(
        long,
        value_name = "N",
        value_parser = ranges::whole(0..=ranges::TEAM),
        help_heading = "Real vehicles"
    )]
    pub real_stand_ins: Option<usize>,
    /// Feed observations into the mission as those of a real vehicle outside the team: CSV, MCAP, or - for standard
    /// input (needs --speed real); repeatable
    #[arg(long, value_name = "OBS", help_heading = "Measured data")]
    pub feed: Vec<PathBuf>,
    /// Id of the fed vehicle [default: the platform's name; "feed" for standard input]
    #[arg(
        long,
        value_name = "ID",
        requires = "feed",
        help_heading = "Measured data"
    )]
    pub feed_id: Option<String>,
    /// Mission time of the first fed row, 0 to 1000000 s, or `file` for the times in the file [default: the mission's
    /// start]
    #[arg(
        long,
        value_name = "S|file",
        requires = "feed",
        help_heading = "Measured data"
    )]
    pub feed_start: Option<Start>,
    /// Show each vehicle to ground stations (QGroundControl, MAVProxy …) as an ArduPlane or ArduCopter; its system id is its
    /// number in the scenario. LINK: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or serial:PATH:BAUD
    #[arg(long, value_name = "LINK", help_heading = "Integrations")]
    pub gcs: Option<LinkAddress>,
    /// Show vehicle ID in the FlightGear at HOST:PORT, with 50 packets a second; repeatable
    #[arg(long, value_name = "ID=HOST:PORT", help_heading = "Integrations")]
    pub flightgear: Vec<String>,
    /// Whether the mission is published to ROS 2
    #[command(flatten)]
    pub ros2: Ros2Arguments,
    /// Serve metrics for Prometheus at this address, such as 127.0.0.1:9100
    #[arg(long, value_name = "ADDR", help_heading = "Integrations")]
    pub metrics: Option<String>,
}

impl RunArguments {
    /// The mission that the arguments ask for.
    ///
    /// # Errors
    /// Wrong input, with what was expected.
    pub fn setup(&self) -> Result<Setup, Failure> {
        let mut setup = self.mission.setup(&self.scenario)?;
        setup.scenario.gap.adopt |= self.adopt;
        if let Some(count) = self.real_stand_ins {
            setup = setup.with_stand_ins(count).map_err(Failure::input)?;
        }
        for real in &self.real {
            let wrong = || {
                Failure::usage(format!(
                    "--real {real}: expected ID=LINK, such as 3=udpin:0.0.0.0:14550"
                ))
            };
            let (id, link) = real.split_once('=').ok_or_else(wrong)?;
            // A link that is none is found out now, not in flight.
            let link: LinkAddress = link.parse().map_err(Failure::input)?;
            let index = setup.index_of(id).map_err(Failure::input)?;
            setup = setup.with_real(index, link.to_string());
        }
        Ok(setup)
    }

    /// Observations to feed, as fast as they were read.
    fn feed_options(&self) -> FeedOptions<'_> {
        FeedOptions {
            files: &self.feed,
            map: None,
            id: self.feed_id.as_deref(),
            start: self.feed_start,
            speed: Speed(1.0),
        }
    }

    fn serve_at(&self) -> Serve {
        match self.no_serve {
            true => Serve::No,
            false => Serve::at(self.serve.as_ref()),
        }
    }

    /// Whether a person at a terminal may watch the page: neither speed nor folder is given.
    fn is_watched(&self) -> bool {
        let at_terminal = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
        at_terminal && !self.no_serve && self.out.is_none() && self.speed.is_none()
    }

    /// Keeps the page after the end: until an interrupt where that was asked for, until a key is pressed where
    /// somebody has watched.
    fn stay(&self, page: &mut LivePage, stop: &Arc<AtomicBool>) -> Result<(), Failure> {
        if !self.hold && !self.is_watched() {
            return Ok(());
        }
        let until = if self.hold {
            "until interrupted"
        } else {
            let pressed = Arc::clone(stop);
            let wait = move || {
                // An error ends the waiting as a key does.
                let _ = console::Term::stderr().read_key();
                pressed.store(true, Ordering::Relaxed);
            };
            std::thread::Builder::new()
                .name("key".to_owned())
                .spawn(wait)
                .context("cannot watch for a key")?;
            "until a key is pressed"
        };
        eprintln!("live page and report: http://{}/ {until}", page.address);
        page.hold(stop);
        Ok(())
    }

    /// The speed to begin with, if there is a page or not.
    fn first_speed(&self, has_page: bool) -> Speed {
        let watched = has_page && self.is_watched();
        let unasked = if watched { WATCHED } else { f64::INFINITY };
        self.speed.unwrap_or(Speed(unasked))
    }
}

/// Flies the mission.
///
/// # Errors
/// Wrong input, or a run that failed; what was recorded until then stays.
pub fn run(arguments: &RunArguments) -> Result<(), Failure> {
    let setup = arguments.setup()?;
    preflight::check(&setup)?;
    let folder = arguments
        .out
        .clone()
        .unwrap_or_else(|| fresh_folder(&setup.scenario.mission.name));
    let speed = arguments.speed.unwrap_or(Speed(f64::INFINITY));
    let outside = Outside::open(&setup, &arguments.flightgear, speed)?;
    let run = if !outside.has_links() {
        Run::new(&setup)
    } else {
        Run::with_links(&setup)
    };
    let mut run = run.map_err(Failure::input)?;
    let outside = outside.with_weather(&setup, &arguments.scenario, speed)?;
    let outside = outside.with_feed(&setup, &arguments.feed_options(), speed, &mut run)?;
    let site = Arc::new(site::of(&setup)?);
    let ground_station = GroundStation::open(
        &setup,
        arguments.gcs.as_ref(),
        arguments.tlog.as_deref(),
        arguments.force,
    )?;
    let ros2 = Ros2::open(&arguments.ros2, &setup)?;
    let options = page::options_of_run(
        outside.has_links(),
        folder.join("report.html"),
        &arguments.page,
    )?;
    let page = LivePage::open(&arguments.serve_at(), &setup, Arc::clone(&site), options)?;
    let outputs = Outputs::open(&folder, arguments.force, &setup, site)?;
    if let Some(page) = &page {
        eprintln!("live page: http://{}/", page.address);
    }
    let (stop, at_once) = if outside.has_links() {
        interrupt_flags().map(|[stop, at_once]| (stop, at_once))?
    } else {
        (interrupt_flag()?, Arc::default())
    };
    let mut flight = Flight {
        bar: progress_bar(&setup),
        pace: Pace::new(arguments.first_speed(page.is_some()), 0.0),
        paused: false,
        started: Instant::now(),
        reached: Reached::new(),
        phase: None,
        stop,
        at_once,
        comes_down: false,
        duration_s: setup.scenario.mission.duration_s,
        told_that_it_goes_on: false,
        outside,
        figures: arguments.metrics.as_deref().map(OfRun::serve).transpose()?,
        ground_station,
        ros2,
        team: setup
            .scenario
            .vehicles
            .iter()
            .map(|v| v.id.clone())
            .collect(),
        run,
        outputs,
        behind: Arc::default(),
        page,
    };
    let failed = flight.fly().err();
    flight.catch_up();
    if let Some(ros2) = flight.ros2.take() {
        ros2.close();
    }
    let digest = flight.run.digest();
    let wall_s = flight.started.elapsed().as_secs_f64();
    flight.show();
    flight.bar.finish_and_clear();
    let (summary, written) = flight.outputs.finish(&digest, wall_s);
    print!("{}", record::text::summary(&summary));
    println!("{}", outputs::listed(&folder));
    if let Some(mut page) = flight.page {
        page.with(|live| {
            live.run.reported = folder.join("report.html").is_file();
            live.conclusion = Some(record::text::peak(&summary));
        });
        arguments.stay(&mut page, &flight.stop)?;
        page.close();
    }
    match failed {
        Some(failure) => Err(failure),
        None => written,
    }
}

/// A mission in flight, with everything that follows it.
struct Flight {
    run: Run,
    outputs: Outputs,
    /// What was said in the last tick, where the outputs have not taken it yet.
    behind: Arc<Vec<Publication>>,
    page: Option<LivePage>,
    bar: Bar,
    pace: Pace,
    paused: bool,
    started: Instant,
    reached: Reached,
    phase: Option<Phase>,
    stop: Arc<AtomicBool>,
    /// Interrupted again: real vehicles are not waited for.
    at_once: Arc<AtomicBool>,
    /// It was interrupted, and real vehicles come down.
    comes_down: bool,
    /// Length of the mission, s.
    duration_s: f64,
    told_that_it_goes_on: bool,
    outside: Outside,
    /// Metrics of the process.
    figures: Option<Arc<OfRun>>,
    ground_station: Option<GroundStation>,
    ros2: Option<Ros2>,
    /// Ids of all vehicles.
    team: Vec<String>,
}

impl Flight {
    fn fly(&mut self) -> Result<(), Failure> {
        while !self.run.ended() {
            if self.stop.load(Ordering::Relaxed) && !self.comes_down_first() {
                break;
            }
            self.tell_that_it_goes_on();
            self.obey();
            if self.paused {
                self.catch_up();
                self.outputs.flush();
                self.show();
                std::thread::sleep(Duration::from_millis(20));
                continue;
            }
            self.keep_pace();
            self.outside.serve(&mut self.run)?;
            self.serve_ground_station()?;
            let said = self.step();
            let said = said.as_slice();
            if let Some(station) = &mut self.ground_station {
                station.take(said);
            }
            if let Some(ros2) = &mut self.ros2 {
                ros2.take(said);
            }
            if let Some(page) = &mut self.page {
                page.take(said);
            }
            let messages = said.len();
            for (_, envelope) in said {
                if let Message::Plan(plan) = &envelope.message {
                    self.phase = Some(plan.phase);
                }
            }
            if let Some(figures) = &self.figures {
                figures.take(self.run.now(), messages);
            }
            // Showing costs a look at the wall clock: once in ten ticks is often enough.
            if self.run.now().ns() % 200_000_000 == 0 || self.pace.speed().0 < 10.0 {
                self.show();
            }
        }
        if self.stop.load(Ordering::Relaxed) {
            eprintln!(
                "interrupted at {:.0} s of simulated time",
                self.run.now().s()
            );
        }
        Ok(())
    }

    /// Runs the next tick and returns what was said in it. Of a large team the outputs follow a tick later, beside the
    /// next one.
    fn step(&mut self) -> Arc<Vec<Publication>> {
        let behind = std::mem::take(&mut self.behind);
        let (run, outputs) = (&mut self.run, &mut self.outputs);
        beside(
            behind.len(),
            || outputs.take(&behind),
            || {
                run.step();
            },
        );
        let said = Arc::clone(self.run.said());
        self.behind = Arc::clone(&said);
        if said.len() < MESSAGES_WORTH_A_THREAD {
            self.catch_up();
        }
        said
    }

    /// Lets the outputs take what they are behind.
    fn catch_up(&mut self) {
        let behind = std::mem::take(&mut self.behind);
        self.outputs.take(&behind);
    }

    /// Says once that the mission goes on beyond its time, since a real vehicle is not down.
    fn tell_that_it_goes_on(&mut self) {
        let over = self.run.now().s() > self.duration_s;
        if over && !std::mem::replace(&mut self.told_that_it_goes_on, true) {
            eprintln!(
                "the mission's time is over; the run continues until all real vehicles are on the ground and \
                 disarmed. An interrupt calls all vehicles home"
            );
        }
    }

    /// Whether the run goes on after an interrupt, since a real vehicle is not down; the others are called home
    /// with it.
    fn comes_down_first(&mut self) -> bool {
        if !self.run.is_anybody_up() {
            return false;
        }
        if self.at_once.load(Ordering::Relaxed) {
            eprintln!(
                "interrupted again: stopped at once; real vehicles rely on their own failsafe"
            );
            return false;
        }
        if std::mem::replace(&mut self.comes_down, true) {
            return true;
        }
        eprintln!(
            "interrupted: a real vehicle is airborne or armed; all vehicles are called home first. A second interrupt \
             stops the run at once and leaves real vehicles to their own failsafe"
        );
        self.call_home();
        self.run.end();
        true
    }

    fn call_home(&mut self) {
        for vehicle in &self.team {
            let wish = ControlWish::Home;
            let control = Control { wish, sticks: None };
            // The scenario's ids were checked when it was read.
            let _ = self.run.operate(vehicle, control);
        }
    }

    fn keep_pace(&mut self) {
        let wait = self.pace.wait(self.run.now().s());
        if wait > Duration::from_millis(500) {
            self.catch_up();
            self.outputs.flush();
        }
        if !wait.is_zero() {
            std::thread::sleep(wait);
        }
    }

    /// What a ground station wants is what the page may want, too.
    fn serve_ground_station(&mut self) -> Result<(), Failure> {
        let Some(station) = &mut self.ground_station else {
            return Ok(());
        };
        for (vehicle, wish) in station.serve(self.run.now())? {
            // The scenario's ids were checked when it was read.
            let _ = match wish {
                TeamWish::Control(control) => self.run.operate(&vehicle, control),
                TeamWish::SendTo(place) => self.run.send_to(&vehicle, place),
            };
        }
        Ok(())
    }

    fn obey(&mut self) {
        let Some(page) = &mut self.page else { return };
        for command in page.commands() {
            let speed = match command {
                PageCommand::Pause => {
                    self.paused = !self.outside.has_links();
                    continue;
                }
                PageCommand::Resume => {
                    self.paused = false;
                    self.pace.speed()
                }
                // A real vehicle knows no other time than the wall's.
                PageCommand::Speed(_) if self.outside.has_links() => continue,
                PageCommand::Speed(factor) => Speed(factor),
                // Only a recording is wound.
                PageCommand::Seek(_) => continue,
                wish => {
                    self.tell(wish);
                    continue;
                }
            };
            self.pace = Pace::new(speed, self.run.now().s());
        }
    }

    /// Publishes a command from the page to vehicles.
    fn tell(&mut self, wish: PageCommand) {
        for (topic, message) in control::told_by_page(wish, &self.team) {
            // A vehicle that is not in the team has no agent that would listen.
            let _ = self.run.say_as_operator(topic, message);
        }
    }

    fn show(&mut self) {
        let sim_s = self.run.now().s();
        self.bar.set_position(sim_s as u64);
        if let Some(phase) = self.phase {
            self.bar.set_message(format!("{phase:?}"));
        }
        let run = views::live::RunStatus {
            paused: self.paused,
            speed: self.pace.speed().0,
            real_time_factor: self.reached.factor(sim_s),
            ended: self.run.ended(),
            reported: false,
        };
        if let Some(page) = &mut self.page {
            page.show(run);
        }
    }
}

fn progress_bar(setup: &Setup) -> Bar {
    let template = "{msg:>14} {wide_bar} {pos}/{len} s simulated, {eta} left";
    let of = setup.scenario.mission.duration_s as u64;
    let bar = Bar::new("simulated s", of, template);
    bar.set_message("TakeOff");
    bar
}

/// A flag that an interrupt (Ctrl-C) or a request to terminate raises: the run then ends as if its time were over.
///
/// # Errors
/// The system takes no handler.
pub fn interrupt_flag() -> Result<Arc<AtomicBool>, Failure> {
    let [flag] = interrupt_flags()?;
    Ok(flag)
}

/// Flags that interrupts raise, one each; one more ends the program at once.
fn interrupt_flags<const N: usize>() -> Result<[Arc<AtomicBool>; N], Failure> {
    let flags: [Arc<AtomicBool>; N] = std::array::from_fn(|_| Arc::default());
    let raised = flags.clone();
    let runtime = runtime::start("interrupt", 1)?;
    runtime.spawn(async {
        let mut interrupts = Interrupts::watch();
        for flag in raised {
            // An interrupt at the keyboard needs no message.
            let how = interrupts.next().await;
            if how == TERMINATED {
                eprintln!("{how}");
            }
            flag.store(true, Ordering::Relaxed);
        }
        interrupts.next().await;
        std::process::exit(130);
    });
    runtime::keep(runtime);
    Ok(flags)
}
