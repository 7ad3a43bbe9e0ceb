//! The page of a run or a recording, on its own runtime, so that the run never waits for a browser.

use crate::{Failure, runtime};
use air::geo::{Geodetic, Position};
use mission::Setup;
use protocol::bus::Publication;
use protocol::message::{Destination, Severity};
use scenario::airspace::Airspace;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tasks::loopback;
use tokio::sync::{mpsc, watch};
use views::live::{LiveState, RunStatus};
use views::page::{self, DEFAULT_ADDRESS, Live, Offered, PageCommand, PageOptions};
use views::site::SiteMap;
use views::tiles::Tiles;

/// Clicks that may wait for the run.
const CLICKS: usize = 64;

/// Choice of the page's address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Serve {
    /// At the default address, if that is free.
    Default,
    /// At this address or not at all.
    At(String),
    /// No page.
    No,
}

impl Serve {
    /// At the address that is given, else at the default one.
    pub fn at(address: Option<&String>) -> Self {
        address.cloned().map_or(Self::Default, Self::At)
    }
}

/// Options of a page on the command line.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Page")]
pub struct PageArguments {
    /// Raster tiles for the map: a URL with {z}, {x} and {y}, or an MBTiles file; ${NAME} in a URL stands for that
    /// environment variable, such as an API key [default: no tiles]
    #[arg(long, value_name = "URL|FILE")]
    tiles: Option<String>,
    /// Token that a browser must send to open the page, as http://ADDR/?token=TOKEN; required if other hosts can reach
    /// the page [default: PLUMAGE_PAGE_TOKEN]
    #[arg(long, value_name = "TOKEN")]
    page_token: Option<String>,
}

/// The environment variable that may hold the token.
const TOKEN: &str = "PLUMAGE_PAGE_TOKEN";

impl PageArguments {
    /// The token asked for.
    ///
    /// # Errors
    /// One that no address can hold.
    pub fn token(&self) -> Result<Option<String>, Failure> {
        let token = self
            .page_token
            .clone()
            .or_else(|| std::env::var(TOKEN).ok());
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        match token {
            Some(token) if token.is_empty() || !token.chars().all(is_plain) => Err(Failure::usage(
                format!("--page-token or {TOKEN}: expected only letters, digits, '-' and '_'"),
            )),
            token => Ok(token),
        }
    }

    /// The tiles asked for.
    ///
    /// # Errors
    /// An invalid address, an unreadable file, or an environment variable that is not set.
    pub fn tiles(&self) -> Result<Option<Tiles>, Failure> {
        let Some(text) = &self.tiles else {
            return Ok(None);
        };
        let refused = |why: String| Failure::usage(format!("--tiles {text}: {why}"));
        let mut address = String::new();
        let mut rest = text.as_str();
        while let Some((before, after)) = rest.split_once("${") {
            let (name, after) = after
                .split_once('}')
                .ok_or_else(|| refused("'${' has no closing '}'".to_owned()))?;
            let value = std::env::var(name)
                .map_err(|_| refused(format!("the environment variable {name} is not set")))?;
            address.push_str(before);
            address.push_str(&value);
            rest = after;
        }
        address.push_str(rest);
        address.parse().map(Some).map_err(refused)
    }
}

/// The page of a mission.
pub struct LivePage {
    runtime: tokio::runtime::Runtime,
    live: Live,
    open: watch::Sender<()>,
    commands: mpsc::Receiver<PageCommand>,
    server: tokio::task::JoinHandle<()>,
    airspace: Airspace,
    /// Its address.
    pub address: String,
}

impl LivePage {
    /// Opens the page of a mission that `serve` asks for; none if none was asked for or the default address
    /// is taken, which is a warning.
    ///
    /// # Errors
    /// An address that was asked for and is not to be had.
    pub fn open(
        serve: &Serve,
        setup: &Setup,
        site: Arc<SiteMap>,
        options: PageOptions,
    ) -> Result<Option<Self>, Failure> {
        let address = match serve {
            Serve::No => return Ok(None),
            Serve::Default => DEFAULT_ADDRESS,
            Serve::At(address) => address,
        };
        if !loopback::is_address(address) && options.token.is_none() {
            return Err(Failure::usage(format!(
                "--serve {address}: other hosts can reach this address and could command the team; expected a secret in \
                 --page-token or {TOKEN}, or an address of this host alone, such as {DEFAULT_ADDRESS}"
            )));
        }
        let runtime = runtime::start("page", 1)?;
        let listener = match runtime.block_on(page::listen(address)) {
            Ok(listener) => listener,
            Err(e) if *serve == Serve::Default => {
                eprintln!("warning: no live page: {e}");
                return Ok(None);
            }
            Err(e) => return Err(Failure::input(e)),
        };
        let address = listener.local_addr()?.to_string();
        let airspace = Airspace::of(&setup.scenario).map_err(Failure::input)?;
        let live = Live::new(LiveState::new(site));
        let (open, is_open) = watch::channel(());
        let (commands_sender, commands) = mpsc::channel(CLICKS);
        let shown = live.clone();
        let server = runtime.spawn(async move {
            page::serve(listener, shown, options, commands_sender, is_open).await;
        });
        Ok(Some(Self {
            runtime,
            live,
            open,
            commands,
            server,
            airspace: airspace.over(&setup.terrain),
            address,
        }))
    }

    /// Receives the messages of a tick.
    pub fn take(&mut self, said: &[Publication]) {
        self.live.with(|live| {
            for (topic, envelope) in said {
                live.take(topic, envelope);
            }
        });
    }

    /// Shows how the run goes.
    pub fn show(&mut self, run: RunStatus) {
        self.live.with(|live| live.run = run);
    }

    /// Does something with what is shown.
    pub fn with<T>(&self, work: impl FnOnce(&mut LiveState) -> T) -> T {
        self.live.with(work)
    }

    /// Commands from the page since the last call; targets outside the airspace are rejected there.
    pub fn commands(&mut self) -> Vec<PageCommand> {
        let mut asked: Vec<_> = std::iter::from_fn(|| self.commands.try_recv().ok()).collect();
        asked.retain(|command| match command {
            PageCommand::SendTo(id, place) => self.may_be_sent(id, place),
            _ => true,
        });
        asked
    }

    fn may_be_sent(&self, vehicle: &str, place: &Destination) -> bool {
        let at = self
            .airspace
            .frame()
            .to_enu(Geodetic::new(place.lat_deg, place.lon_deg));
        let to = Position {
            at,
            height_m: place.alt_amsl_m,
        };
        let inside = self.airspace.contains(to, 0.0);
        if !inside {
            let (low, high) = self.airspace.heights_at_amsl_m(at);
            let text = format!(
                "{vehicle} was not sent to {}: expected a place inside the fence, at least {:.0} m from each stack, at \
                 {low:.0} to {high:.0} m AMSL",
                record::text::place(place.lat_deg, place.lon_deg, place.alt_amsl_m),
                self.airspace.keep_out_m()
            );
            self.live
                .with(|live| live.tell("page", Severity::Warning, text));
        }
        inside
    }

    /// Keeps the page up until `stop`.
    pub fn hold(&self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Sends the last news and closes the page.
    pub fn close(self) {
        drop(self.open);
        let grace = Duration::from_secs(2);
        let server = self.server;
        // Whoever still reads the page has this long to get the last frame.
        let _ = self
            .runtime
            .block_on(async move { tokio::time::timeout(grace, server).await });
        self.runtime.shutdown_timeout(Duration::from_millis(200));
    }
}

/// The page of a mission that runs here: everything is offered, speed and pause where no real vehicle is linked.
///
/// # Errors
/// Wrong options.
pub fn options_of_run(
    has_links: bool,
    report: PathBuf,
    page: &PageArguments,
) -> Result<PageOptions, Failure> {
    Ok(PageOptions {
        offered: Offered {
            pause: !has_links,
            speed: !has_links,
            control: true,
            timeline_s: None,
        },
        tiles: page.tiles()?,
        report: Some(report),
        token: page.token()?,
    })
}
