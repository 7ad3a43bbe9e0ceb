//! Identification of the vehicle among the systems on a link. A configured id excludes all others;
//! without one it is the only autopilot received, and of two neither is commanded.

use super::config::BridgeConfig;
use crate::dialect::{HEARTBEAT_DATA, MavAutopilot, MavType};
use crate::wire::RawFrame;
use protocol::SimTime;
use std::collections::{BTreeMap, BTreeSet};

/// Time to wait for a second autopilot before the first is commanded, s: two heartbeats of each.
const LISTEN_S: f64 = 2.5;

/// A ground station whose last heartbeat is older has gone, s: two of three heartbeats may be lost.
const STATION_LASTS_S: f64 = 3.5;

/// Finding from a heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing new.
    Nothing,
    /// An autopilot beside the configured one or the one already flown.
    Another(u8),
    /// A second autopilot without a configured id.
    Ambiguous(u8, u8),
    /// Another ground station with the bridge's own system id; that of its component.
    SameStation(u8),
}

/// The systems on the link.
#[derive(Debug, Clone)]
pub(super) struct Identity {
    own: u8,
    asked: bool,
    component: u8,
    system: Option<u8>,
    since: Option<SimTime>,
    /// Autopilots received, by system id.
    heard: BTreeSet<u8>,
    /// Other ground stations and the time of each one's last heartbeat.
    stations: BTreeMap<u8, SimTime>,
    same_station: bool,
    ambiguous: bool,
    certain: bool,
}

impl Identity {
    pub(super) fn new(config: &BridgeConfig) -> Self {
        Self {
            own: config.system_id,
            asked: config.vehicle_system_id.is_some(),
            component: config.vehicle_component_id,
            system: config.vehicle_system_id,
            since: None,
            heard: BTreeSet::new(),
            stations: BTreeMap::new(),
            same_station: false,
            ambiguous: false,
            certain: config.vehicle_system_id.is_some(),
        }
    }

    /// The vehicle's system and the component of its autopilot; none before it is known.
    pub(super) fn address(&self) -> Option<(u8, u8)> {
        self.system.map(|system| (system, self.component))
    }

    /// Whether it is known well enough to command it.
    pub(super) fn is_certain(&self) -> bool {
        self.certain
    }

    /// Other ground stations received in the last seconds, by system id.
    pub(super) fn stations(&self, now: SimTime) -> impl Iterator<Item = u8> {
        let heard = move |at: &SimTime| now.since_s(*at) <= STATION_LASTS_S;
        let stations = self.stations.iter();
        stations.filter(move |(_, at)| heard(at)).map(|(id, _)| *id)
    }

    /// Time has passed.
    pub(super) fn tick(&mut self, now: SimTime) {
        let listened = |since: SimTime| now.since_s(since) >= LISTEN_S;
        self.certain |= !self.ambiguous && self.since.is_some_and(listened);
    }

    /// Whether a frame comes from the vehicle: from its autopilot (`Some(true)`), or another component of the
    /// same system (`Some(false)`).
    pub(super) fn of_vehicle(&self, frame: &RawFrame) -> Option<bool> {
        (self.system == Some(frame.system_id())).then(|| frame.component_id() == self.component)
    }

    /// Whether a frame comes from an autopilot that is another vehicle's.
    pub(super) fn of_another(&self, frame: &RawFrame) -> bool {
        self.system.is_some_and(|own| own != frame.system_id())
            && self.heard.contains(&frame.system_id())
    }

    /// Receives a heartbeat of any system; `committed`: the vehicle has been commanded to fly already.
    pub(super) fn heartbeat(
        &mut self,
        frame: &RawFrame,
        heartbeat: &HEARTBEAT_DATA,
        committed: bool,
        now: SimTime,
    ) -> Found {
        let system = frame.system_id();
        if heartbeat.mavtype == MavType::MAV_TYPE_GCS {
            self.stations.insert(system, now);
            let told = system != self.own || std::mem::replace(&mut self.same_station, true);
            return if told {
                Found::Nothing
            } else {
                Found::SameStation(frame.component_id())
            };
        }
        let autopilot = heartbeat.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID
            && frame.component_id() == self.component;
        if !autopilot || !self.heard.insert(system) {
            return Found::Nothing;
        }
        match self.system {
            None if self.ambiguous => Found::Nothing,
            None => {
                (self.system, self.since) = (Some(system), Some(now));
                Found::Nothing
            }
            Some(own) if own == system => Found::Nothing,
            Some(_) if self.asked || committed => Found::Another(system),
            Some(own) => {
                (self.system, self.ambiguous, self.certain) = (None, true, false);
                Found::Ambiguous(own, system)
            }
        }
    }
}
