//! The team for any ground station: every vehicle as a MAVLink vehicle of its own, on a link and in a
//! telemetry log.

use crate::{Failure, runtime};
use anyhow::Context as _;
use mav_bridge::link::{Link, LinkAddress};
use mav_bridge::wire::FrameDecoder;
use mission::Setup;
use protocol::bus::Publication;
use protocol::message::Message;
use protocol::{SimTime, Topic};
use stand_in::{TeamVehicle, TeamWish};
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// A telemetry log as ground stations write and play it: before each frame its time, µs since 1970 in
/// eight bytes, the highest first.
struct TelemetryLog {
    file: BufWriter<File>,
    /// When the mission began, µs since 1970.
    start_us: u64,
    /// Finds the frames in what ground stations send.
    decoder: FrameDecoder,
}

impl TelemetryLog {
    fn create(path: &Path, force: bool) -> Result<Self, Failure> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let file = if force {
            File::create(path)
        } else {
            File::create_new(path)
        };
        let file = file
            .with_context(|| {
                format!(
                    "--tlog {}: cannot create the file (--force replaces one)",
                    path.display()
                )
            })
            .map_err(Failure::Input)?;
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        let start_us = since_1970.map_or(0, |d| u64::try_from(d.as_micros()).unwrap_or(0));
        Ok(Self {
            file: BufWriter::new(file),
            start_us,
            decoder: FrameDecoder::new(),
        })
    }

    fn write(&mut self, frame: &[u8], now: SimTime) -> Result<(), Failure> {
        let time_us = self.start_us.saturating_add_signed(now.ns() / 1000);
        self.file.write_all(&time_us.to_be_bytes())?;
        Ok(self.file.write_all(frame)?)
    }

    fn write_heard(&mut self, bytes: &[u8], now: SimTime) -> Result<(), Failure> {
        self.decoder.push(bytes);
        while let Some(frame) = self.decoder.next_frame(now) {
            self.write(frame.bytes(), now)?;
        }
        Ok(())
    }
}

/// The team as ground stations see it.
pub struct GroundStation {
    /// Ids in the scenario, and the vehicles.
    vehicles: Vec<(String, TeamVehicle)>,
    link: Option<Link>,
    log: Option<TelemetryLog>,
    /// The link lives on it.
    _runtime: Option<tokio::runtime::Runtime>,
}

impl GroundStation {
    /// Opens the link and the log that are asked for; none where neither is.
    ///
    /// # Errors
    /// An address that cannot be had, a log that is there already (without `force`) or cannot be made.
    pub fn open(
        setup: &Setup,
        link: Option<&LinkAddress>,
        log: Option<&Path>,
        force: bool,
    ) -> Result<Option<Self>, Failure> {
        if link.is_none() && log.is_none() {
            return Ok(None);
        }
        let mut vehicles = Vec::new();
        for (index, vehicle) in setup.scenario.vehicles.iter().enumerate() {
            let on_link = setup.team_vehicle(index).map_err(Failure::input)?;
            vehicles.push((vehicle.id.clone(), on_link));
        }
        let mut station = Self {
            vehicles,
            link: None,
            log: log
                .map(|path| TelemetryLog::create(path, force))
                .transpose()?,
            _runtime: None,
        };
        if let Some(address) = link {
            let runtime = runtime::start("gcs", 1)?;
            let open = runtime.block_on(Link::open(address));
            station.link = Some(open.map_err(Failure::input)?);
            station._runtime = Some(runtime);
        }
        Ok(Some(station))
    }

    /// Takes in what was said in a tick.
    pub fn take(&mut self, said: &[Publication]) {
        for (topic, envelope) in said {
            if let Message::Model(model) = &envelope.message {
                let team = self.vehicles.iter_mut();
                team.for_each(|(_, vehicle)| vehicle.model(model));
                continue;
            }
            let (Topic::State(name) | Topic::Reading(name) | Topic::Mode(name)) = topic else {
                continue;
            };
            let mut team = self.vehicles.iter_mut();
            let Some((_, vehicle)) = team.find(|(id, _)| id == name.as_str()) else {
                continue;
            };
            match &envelope.message {
                Message::State(state) => vehicle.state(state),
                Message::Reading(reading) => vehicle.reading(reading),
                Message::Mode(mode) => vehicle.mode(mode),
                _ => {}
            }
        }
    }

    /// Tells where the vehicles are, and what ground stations want of which.
    ///
    /// # Errors
    /// The log cannot be written.
    pub fn serve(&mut self, now: SimTime) -> Result<Vec<(String, TeamWish)>, Failure> {
        let link = &mut self.link;
        let heard: Vec<Vec<u8>> =
            std::iter::from_fn(|| link.as_mut().and_then(Link::try_receive)).collect();
        if let Some(log) = &mut self.log {
            for bytes in &heard {
                log.write_heard(bytes, now)?;
            }
        }
        if let Some(log) = &mut self.log
            && now.ns() % 1_000_000_000 == 0
        {
            // Who is killed has lost a second.
            log.file.flush()?;
        }
        let mut wishes = Vec::new();
        for (id, vehicle) in &mut self.vehicles {
            for frame in vehicle.step(now, &heard) {
                if let Some(log) = &mut self.log {
                    log.write(&frame, now)?;
                }
                if let Some(link) = &self.link {
                    link.send(frame);
                }
            }
            let wanted = vehicle.take_wishes().into_iter();
            wishes.extend(wanted.map(|wish| (id.clone(), wish)));
        }
        Ok(wishes)
    }
}
