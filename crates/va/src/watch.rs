//! What a vehicle watches by itself: whether the others still speak, and whether it is inside its
//! fence. Dangers begin in the air only; a vehicle on the ground is in none.

use crate::VaError;
use air::area;
use air::geo::{Enu, Geodetic, LocalFrame};
use fdm::control_level::{Danger, Event};
use protocol::{Message, SimTime};
use scenario::Scenario;
use scenario::tables::VehicleKind;

/// Silence of the squadron controller, which speaks every second, that counts, s.
const CONTROLLER_S: f64 = 5.0;
/// Silence of the world simulator towards a simulated vehicle (ten ambients a second), s.
const AMBIENT_S: f64 = 5.0;
/// Silence of the world simulator towards a real vehicle (a model every 10 s), s.
const MODEL_S: f64 = 25.0;
/// Distance from home within which a vehicle is never outside its fence, m: it may have to take
/// off and land beyond it.
const HOME_M: f64 = 500.0;
/// Height above the ceiling at which the fence is broken, m: setpoints reach up to the ceiling.
const ABOVE_CEILING_M: f64 = 30.0;
/// A broken fence is mended this far inside, m.
const BACK_INSIDE_M: f64 = 30.0;

/// Where a vehicle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seen {
    pub at: Enu,
    pub alt_amsl_m: f64,
    pub airborne: bool,
}

/// When something was last heard, and whether its silence counts now.
#[derive(Debug, Clone, Copy)]
struct Hearing {
    danger: Danger,
    patience_s: f64,
    heard: Option<SimTime>,
    lasts: bool,
}

impl Hearing {
    fn new(danger: Danger, patience_s: f64) -> Self {
        Self {
            danger,
            patience_s,
            heard: None,
            lasts: false,
        }
    }

    fn tick(&mut self, now: SimTime, airborne: bool) -> Option<Event> {
        if airborne && self.heard.is_none() {
            // Found in the air: the others have their time from now on.
            self.heard = Some(now);
        }
        let silent = self.heard.is_some_and(|t| now.since_s(t) > self.patience_s);
        change(&mut self.lasts, airborne && silent, self.danger)
    }
}

/// The event of a danger that begins or ends.
fn change(lasts: &mut bool, lasts_now: bool, danger: Danger) -> Option<Event> {
    let changed = *lasts != lasts_now;
    *lasts = lasts_now;
    changed.then_some(if lasts_now {
        Event::Begins(danger)
    } else {
        Event::Ends(danger)
    })
}

/// What one vehicle of the team watches.
#[derive(Debug, Clone)]
pub struct Watch {
    frame: LocalFrame,
    home: Enu,
    fence: Vec<Enu>,
    ceiling_amsl_m: f64,
    real: bool,
    controller: Hearing,
    world: Hearing,
    fence_broken: bool,
}

impl Watch {
    /// What the vehicle at `index` of the scenario's team watches.
    ///
    /// # Errors
    /// No such vehicle, or a site outside the frame's validity.
    pub fn new(scenario: &Scenario, index: usize) -> Result<Self, VaError> {
        let vehicle = scenario
            .vehicles
            .get(index)
            .ok_or_else(|| VaError::NoSuchVehicle(index.to_string()))?;
        let frame = scenario.frame()?;
        let real = vehicle.kind != VehicleKind::Simulated;
        Ok(Self {
            home: frame.to_enu(scenario.home(index)?),
            fence: scenario.fence_polygon()?,
            ceiling_amsl_m: frame.ground_amsl_m + scenario.fence.ceiling_agl_m,
            frame,
            real,
            controller: Hearing::new(Danger::SquadronController, CONTROLLER_S),
            world: Hearing::new(Danger::World, if real { MODEL_S } else { AMBIENT_S }),
            fence_broken: false,
        })
    }

    /// Whether it watches for a real vehicle.
    pub(crate) fn is_real(&self) -> bool {
        self.real
    }

    /// Height of the ground at the site's origin, m above mean sea level.
    pub(crate) fn ground_amsl_m(&self) -> f64 {
        self.frame.ground_amsl_m
    }

    /// Where `state` is.
    pub(crate) fn place(&self, state: &protocol::message::State) -> Seen {
        Seen {
            at: self.frame.to_enu(Geodetic {
                lat_deg: state.lat_deg,
                lon_deg: state.lon_deg,
            }),
            alt_amsl_m: state.alt_amsl_m,
            airborne: state.airborne,
        }
    }

    /// Somebody speaks.
    pub(crate) fn heard(&mut self, message: &Message, now: SimTime) {
        match message {
            Message::Plan(_) | Message::Setpoint(_) => self.controller.heard = Some(now),
            Message::Ambient(_) | Message::Model(_) => self.world.heard = Some(now),
            _ => {}
        }
    }

    /// The dangers that begin or end.
    pub(crate) fn tick(
        &mut self,
        now: SimTime,
        seen: Option<Seen>,
    ) -> impl Iterator<Item = Event> + use<> {
        let airborne = seen.is_some_and(|s| s.airborne);
        let broken = match seen {
            Some(seen) if seen.airborne => self.is_outside(&seen),
            _ => false,
        };
        [
            self.controller.tick(now, airborne),
            self.world.tick(now, airborne),
            change(&mut self.fence_broken, broken, Danger::Fence),
        ]
        .into_iter()
        .flatten()
    }

    /// Whether the fence is broken at `seen`; one that is broken is mended only well inside.
    fn is_outside(&self, seen: &Seen) -> bool {
        let inside_m = if self.fence_broken {
            BACK_INSIDE_M
        } else {
            0.0
        };
        let too_high = seen.alt_amsl_m > self.ceiling_amsl_m + ABOVE_CEILING_M - inside_m;
        let beyond = area::clearance_m(&self.fence, seen.at) < inside_m
            && seen.at.distance_m(self.home) > HOME_M - inside_m;
        too_high || beyond
    }
}
