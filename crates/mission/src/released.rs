//! A real aircraft that a simulated one has replaced. The team does not command it, but its failsafe still
//! monitors the bridge's heartbeat, which continues until the pilot's own ground station is present.

use crate::real_vehicle::LinkBuffers;
use mav_bridge::{Bridge, BridgeOutput};
use protocol::SimTime;

/// A real aircraft that was given to its pilot.
pub struct ReleasedAircraft {
    bridge: Bridge,
    link: LinkBuffers,
    output: BridgeOutput,
}

impl ReleasedAircraft {
    pub(crate) fn new(bridge: Bridge, link: LinkBuffers) -> Self {
        Self {
            bridge,
            link,
            output: BridgeOutput::default(),
        }
    }

    /// The owner's end of its link.
    pub fn link(&mut self) -> &mut LinkBuffers {
        &mut self.link
    }

    /// Whether it is in the air or armed, by its last telemetry.
    pub fn is_up(&self) -> bool {
        self.bridge.is_up()
    }

    /// Advances time: sends the heartbeat when due.
    pub fn tick(&mut self, now: SimTime) {
        for (link, bytes) in self.link.from_vehicle.drain(..) {
            self.bridge
                .receive_over(link, &bytes, now, &mut self.output);
        }
        self.bridge.keep_alive(now, &mut self.output);
        self.link.best_link = self.bridge.best_link(now);
        self.link.notices.clear();
        let frames = self.output.frames_to_vehicle.drain(..);
        self.link.to_vehicle.extend(frames);
        self.output.clear();
    }

    /// MAVLink system id of the ground station that its failsafe now monitors, once received.
    pub fn pilots_station(&self, now: SimTime) -> Option<u8> {
        self.bridge.other_station(now)
    }
}
