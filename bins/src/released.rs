//! The heartbeat to a real aircraft in whose place a simulated one flies on.

use crate::links::Links;
use mission::Member;
use mission::released::ReleasedAircraft;
use protocol::SimTime;

/// Answers to an operator who ends a heartbeat.
pub const ENDED: &str = "the heartbeat to the real aircraft has ended; without another ground station its failsafe acts";
/// The same where there is none.
pub const NONE: &str = "no real aircraft of this vehicle gets a heartbeat";

/// What an operator hears of a swap after which the heartbeat goes on.
pub fn kept(swapped: &str) -> String {
    format!(
        "{swapped}; the real aircraft gets the heartbeat until its pilot's own ground station is received, or until \
         plumage swap --simulated --release"
    )
}

/// What is said when the pilot's station has taken over.
pub fn taken_by(station: u8) -> String {
    format!(
        "the pilot's ground station, system {station}, is received: the heartbeat to the real aircraft has ended"
    )
}

/// A released aircraft on its links.
pub struct Released {
    aircraft: ReleasedAircraft,
    user: usize,
}

impl Released {
    /// The real aircraft of `member`, which was the user `served` of the links; none if no aircraft needs its heartbeat.
    pub fn of(member: Member, served: Option<usize>, links: &mut Links) -> Option<Self> {
        let user = served?;
        let released = match member {
            Member::Real(vehicle) => vehicle.release(),
            _ => None,
        };
        if released.is_none() {
            links.forget(user);
        }
        Some(Self {
            aircraft: released?,
            user,
        })
    }

    /// Lets time pass; the pilot's ground station once it is heard.
    pub fn serve(&mut self, links: &mut Links, now: SimTime) -> Option<u8> {
        links.serve(self.user, self.aircraft.link(), now);
        self.aircraft.tick(now);
        links.serve(self.user, self.aircraft.link(), now);
        self.aircraft.pilots_station(now)
    }

    /// Whether the aircraft flies, or its motor may run, and would miss the heartbeat.
    pub fn is_missed(&self) -> bool {
        self.aircraft.is_up()
    }

    /// Ends the heartbeat.
    pub fn end(self, links: &mut Links) {
        links.forget(self.user);
    }
}
