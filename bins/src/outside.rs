//! What a run in one process has to do with beside its page: the links to real vehicles, and the
//! FlightGears that show some.

use crate::agent::signing_from;
use crate::feeding::{FeedFiles, FeedOptions, LineFeed};
use crate::flightgear::{self, Viewer};
use crate::links::{self, Links};
use crate::pace::Speed;
use crate::weather_file::WeatherFile;
use crate::{Failure, runtime};
use mission::setup::SigningKey;
use mission::{Member, Run, Setup};
use protocol::{Agent as _, AgentId, SimTime};
use scenario::tables::VehicleKind;
use std::collections::BTreeMap;
use std::path::Path;

/// A real vehicle on its links.
struct Served {
    user: usize,
    key: Option<SigningKey>,
}

/// Links and viewers of a run.
#[derive(Default)]
pub struct Outside {
    links: Links,
    /// The real vehicles.
    served: BTreeMap<AgentId, Served>,
    viewers: BTreeMap<AgentId, Viewer>,
    lines: Option<LineFeed>,
    weather: Option<WeatherFile>,
    /// The links live on it.
    _runtime: Option<tokio::runtime::Runtime>,
}

impl Outside {
    /// Opens the links of the scenario's real vehicles and the FlightGears of `shown`
    /// (`ID=HOST:PORT`) and of the scenario, for a run at `speed`.
    ///
    /// # Errors
    /// An invalid address, a port in use, or a real vehicle at another speed than
    /// its own.
    pub fn open(setup: &Setup, shown: &[String], speed: Speed) -> Result<Self, Failure> {
        let scenario = &setup.scenario;
        let ids: Vec<&str> = scenario.vehicles.iter().map(|v| v.id.as_str()).collect();
        let addresses = flightgear::addresses(shown, &ids, scenario)?;
        let mut outside = Self::default();
        for (id, address) in ids.iter().zip(addresses) {
            if let Some(address) = address {
                let id = AgentId::va(id).map_err(Failure::input)?;
                outside.viewers.insert(id, Viewer::open(&address)?);
            }
        }
        let linked: Vec<_> = scenario
            .vehicles
            .iter()
            .filter(|v| v.kind == VehicleKind::Mavlink)
            .collect();
        let Some(first) = linked.first() else {
            return Ok(outside);
        };
        if speed != Speed(1.0) {
            return Err(Failure::usage(format!(
                "vehicle {} is a real aircraft on a MAVLink link; expected --speed real",
                first.id
            )));
        }
        let runtime = runtime::start("links", 1)?;
        for vehicle in linked {
            let addresses = links::addresses(&vehicle.link)?;
            let user = outside
                .links
                .add(&vehicle.id, vehicle.system_id, &addresses);
            let user = runtime.block_on(user)?;
            let key = setup.signing_keys.get(&vehicle.id).cloned();
            let id = AgentId::va(&vehicle.id).map_err(Failure::input)?;
            outside.served.insert(id, Served { user, key });
        }
        outside._runtime = Some(runtime);
        Ok(outside)
    }

    /// The same with what is fed into `run`, which flies at `speed`; nothing where no files are named.
    ///
    /// # Errors
    /// Files that are no observations, ids that cannot be, or standard input at another speed than its own.
    pub fn with_feed(
        mut self,
        setup: &Setup,
        options: &FeedOptions<'_>,
        speed: Speed,
        run: &mut Run,
    ) -> Result<Self, Failure> {
        if options.files.is_empty() {
            return Ok(self);
        }
        if options.is_stream() {
            if speed != Speed(1.0) {
                return Err(Failure::usage(
                    "--feed -: standard input needs real time; expected --speed real",
                ));
            }
            self.lines = Some(LineFeed::new(setup, options)?);
        }
        let vehicles = match &self.lines {
            Some(lines) => vec![lines.vehicle(setup)?],
            None => {
                FeedFiles::open(setup, options)?
                    .vehicles(setup, options, run.now())?
                    .0
            }
        };
        for vehicle in vehicles {
            run.join(vehicle).map_err(Failure::input)?;
        }
        Ok(self)
    }

    /// The same with the file of reported weather of the scenario at `path`, which is looked at again where the
    /// run flies in real time.
    ///
    /// # Errors
    /// A scenario that describes no wind.
    pub fn with_weather(
        mut self,
        setup: &Setup,
        path: &Path,
        speed: Speed,
    ) -> Result<Self, Failure> {
        if speed == Speed(1.0) {
            self.weather = WeatherFile::of(setup, path)?;
        }
        Ok(self)
    }

    /// Whether real vehicles fly in this run.
    pub fn has_links(&self) -> bool {
        !self.served.is_empty()
    }

    /// Carries bytes, lines and weather and shows vehicles before the next tick of `run`.
    ///
    /// # Errors
    /// Lines that are no observations.
    pub fn serve(&mut self, run: &mut Run) -> Result<(), Failure> {
        let now = run.now();
        let mut weather = self.weather.as_mut().and_then(|file| file.poll(now));
        let nothing = self.served.is_empty() && self.viewers.is_empty() && self.lines.is_none();
        if nothing && weather.is_none() {
            return Ok(());
        }
        for member in run.members_mut() {
            if let Some(viewer) = self.viewers.get_mut(member.id()) {
                viewer.show(member);
            }
            if let Member::World(world) = &mut *member
                && let Some(weather) = weather.take()
            {
                world.set_weather(weather);
            }
            if let (Some(lines), Member::Fed(vehicle)) = (&mut self.lines, &mut *member) {
                lines.serve(vehicle, now)?;
            }
            let Some(served) = self.served.get_mut(member.id()) else {
                continue;
            };
            if let Member::Real(vehicle) = member {
                if now == SimTime::ZERO
                    && let Some(key) = &served.key
                {
                    vehicle.sign(signing_from(key, now));
                }
                if let Some(link) = vehicle.link() {
                    self.links.serve(served.user, link, now);
                }
            }
        }
        Ok(())
    }
}
