//! Which of the systems on a link is the vehicle. One that was asked for by its id is taken and no other;
//! without an id the one autopilot that is heard is, and where two are heard neither is commanded.

use super::BridgeConfig;
use crate::dialect::{HEARTBEAT_DATA, MavAutopilot, MavType};
use crate::wire::RawFrame;
use protocol::SimTime;
use std::collections::{BTreeMap, BTreeSet};

/// How long is listened for a second autopilot before the first is commanded, s: two heartbeats of each.
const LISTEN_S: f64 = 2.5;

/// A ground station whose last heartbeat is older has gone, s: two of three heartbeats may be lost.
const STATION_LASTS_S: f64 = 3.5;

/// What a heartbeat brings to light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing new.
    Nothing,
    /// An autopilot beside the one that was asked for or is flown already.
    Another(u8),
    /// A second autopilot, and none was asked for.
    Ambiguous(u8, u8),
    /// Another ground station with the bridge's own system id; that of its component.
    SameStation(u8),
}

/// Who is who on the link.
#[derive(Debug, Clone)]
pub(super) struct Identity {
    own: u8,
    asked: bool,
    component: u8,
    system: Option<u8>,
    since: Option<SimTime>,
    /// Autopilots heard, by their systems.
    heard: BTreeSet<u8>,
    /// Other ground stations and when each was heard last.
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

    /// Other ground stations that were heard in the last seconds, by their systems.
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

    /// Takes in a heartbeat of anybody; `committed` if the vehicle has been commanded to fly already.
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
