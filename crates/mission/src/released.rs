//! A real aircraft in whose place a simulated one flies on: nobody of the team commands it, but its failsafe still
//! listens for the bridge's heartbeat, which goes on until the pilot's own ground station is there.

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

    /// Whether it is in the air or armed, as far as it was heard.
    pub fn is_up(&self) -> bool {
        self.bridge.is_up()
    }

    /// Lets time pass: the heartbeat goes out when it is due.
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

    /// The ground station that has taken over its failsafe, by its MAVLink system, once one is heard.
    pub fn pilots_station(&self, now: SimTime) -> Option<u8> {
        self.bridge.other_station(now)
    }
}
