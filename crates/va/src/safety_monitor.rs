//! What a vehicle monitors by itself: whether the others still send, and whether it is inside its
//! fence. Dangers begin in the air only; a vehicle on the ground is in none.

use crate::error::VaError;
use air::area;
use air::geo::{Enu, Geodetic, LocalFrame};
use protocol::control_level::{ControlEvent, Danger};
use protocol::{Message, Pauses, SimTime};
use scenario::Scenario;
use scenario::tables::VehicleKind;

/// Silence of the squadron controller, which publishes every second, that counts, s.
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
/// Depth below the floor at which a vehicle does not go, m: setpoints reach down to the floor.
const BELOW_FLOOR_M: f64 = 30.0;
/// Distance beyond the edge at which a place counts as outside, m: rounding of degrees.
const ROUNDING_M: f64 = 1.0;
/// Hysteresis: a broken fence counts as kept again this far inside, m.
const BACK_INSIDE_M: f64 = 30.0;

/// Where a vehicle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ObservedPosition {
    pub at: Enu,
    pub alt_amsl_m: f64,
    pub airborne: bool,
}

/// A watchdog timer: when a peer was last received, and whether its silence counts as a danger now.
#[derive(Debug, Clone, Copy)]
struct Watchdog {
    danger: Danger,
    timeout_s: f64,
    last_received: Option<SimTime>,
    active: bool,
}

impl Watchdog {
    fn new(danger: Danger, timeout_s: f64) -> Self {
        Self {
            danger,
            timeout_s,
            last_received: None,
            active: false,
        }
    }

    /// `pause_ns` is how long this side did not listen before `now`.
    fn check(&mut self, now: SimTime, pause_ns: i64, airborne: bool) -> Option<ControlEvent> {
        self.last_received = self.last_received.map(|t| t.later(pause_ns).min(now));
        if airborne && self.last_received.is_none() {
            // Found in the air, as after a restart: the others have their time from now on.
            self.last_received = Some(now);
        }
        let silent = self
            .last_received
            .is_some_and(|t| now.since_s(t) > self.timeout_s);
        transition(&mut self.active, airborne && silent, self.danger)
    }
}

/// The event of a danger that begins or ends.
fn transition(active: &mut bool, active_now: bool, danger: Danger) -> Option<ControlEvent> {
    let changed = *active != active_now;
    *active = active_now;
    changed.then_some(if active_now {
        ControlEvent::Begins(danger)
    } else {
        ControlEvent::Ends(danger)
    })
}

/// The watchdogs and the fence of one vehicle of the team.
#[derive(Debug, Clone)]
pub struct SafetyMonitor {
    frame: LocalFrame,
    home: Enu,
    fence: Vec<Enu>,
    ceiling_amsl_m: f64,
    /// None where it follows a terrain, which only the squadron controller has.
    floor_amsl_m: Option<f64>,
    real: bool,
    controller: Watchdog,
    world: Watchdog,
    fence_broken: bool,
    pauses: Pauses,
}

impl SafetyMonitor {
    /// The monitor of the vehicle at `index` of the scenario's team.
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
            ceiling_amsl_m: scenario.fence_top_amsl_m(),
            floor_amsl_m: (!scenario.fence.follows_terrain)
                .then_some(scenario.site.ground_amsl_m + scenario.fence.floor_agl_m),
            frame,
            real,
            controller: Watchdog::new(Danger::SquadronController, CONTROLLER_S),
            world: Watchdog::new(Danger::World, AMBIENT_S),
            fence_broken: false,
            pauses: Pauses::default(),
        }
        .of_kind(real))
    }

    /// Height of the ground at the site's origin, m above mean sea level.
    pub(crate) fn ground_amsl_m(&self) -> f64 {
        self.frame.ground_amsl_m
    }

    /// Where `state` is.
    pub(crate) fn locate(&self, state: &protocol::message::State) -> ObservedPosition {
        ObservedPosition {
            at: self.frame.to_enu(Geodetic {
                lat_deg: state.lat_deg,
                lon_deg: state.lon_deg,
            }),
            alt_amsl_m: state.alt_amsl_m,
            airborne: state.airborne,
        }
    }

    /// Why the vehicle does not go to a place, whoever sends it there; nothing where it may. Near home the height alone
    /// counts, as it has to take off and land there.
    pub(crate) fn refuses(&self, to: Geodetic, alt_amsl_m: f64) -> Option<String> {
        if ![to.lat_deg, to.lon_deg, alt_amsl_m]
            .iter()
            .all(|v| v.is_finite())
        {
            return Some("the place is not a finite number".to_owned());
        }
        let at = self.frame.to_enu(to);
        let near_home = at.distance_m(self.home) <= HOME_M;
        let beyond_m = -area::clearance_m(&self.fence, at);
        if !near_home && (beyond_m.is_nan() || beyond_m > ROUNDING_M) {
            return Some(format!("it is {beyond_m:.0} m outside the fence"));
        }
        let (top_m, height_m) = (self.ceiling_amsl_m + ABOVE_CEILING_M, alt_amsl_m);
        if height_m > top_m {
            return Some(format!(
                "it is at {height_m:.0} m AMSL: expected at most {top_m:.0} m"
            ));
        }
        let low_m = self.floor_amsl_m? - BELOW_FLOOR_M;
        (!near_home && height_m < low_m)
            .then(|| format!("it is at {height_m:.0} m AMSL: expected at least {low_m:.0} m"))
    }

    /// The same for a vehicle that is real or simulated, whatever the scenario has in its place.
    #[must_use]
    pub(crate) fn of_kind(self, real: bool) -> Self {
        let world_s = if real { MODEL_S } else { AMBIENT_S };
        Self {
            real,
            world: Watchdog::new(Danger::World, world_s),
            ..self
        }
    }

    /// Resets the watchdog of whoever has sent `message`. A real vehicle knows the world alive by its model, a
    /// simulated one by its own air.
    pub(crate) fn observe(&mut self, message: &Message, now: SimTime) {
        match message {
            Message::Plan(_) | Message::Setpoint(_) => self.controller.last_received = Some(now),
            Message::Ambient(_) if !self.real => self.world.last_received = Some(now),
            Message::Model(_) if self.real => self.world.last_received = Some(now),
            _ => {}
        }
    }

    /// The dangers that begin or end.
    pub(crate) fn check(
        &mut self,
        now: SimTime,
        position: Option<ObservedPosition>,
    ) -> impl Iterator<Item = ControlEvent> + use<> {
        let airborne = position.is_some_and(|s| s.airborne);
        let broken = match position {
            Some(position) if position.airborne => self.is_outside(&position),
            _ => false,
        };
        let pause_ns = self.pauses.tick(now);
        [
            self.controller.check(now, pause_ns, airborne),
            self.world.check(now, pause_ns, airborne),
            transition(&mut self.fence_broken, broken, Danger::Fence),
        ]
        .into_iter()
        .flatten()
    }

    /// Whether the fence is broken at `position`. The hysteresis keeps a vehicle on the edge from
    /// setting off the danger again and again.
    fn is_outside(&self, position: &ObservedPosition) -> bool {
        let inside_m = if self.fence_broken {
            BACK_INSIDE_M
        } else {
            0.0
        };
        let too_high = position.alt_amsl_m > self.ceiling_amsl_m + ABOVE_CEILING_M - inside_m;
        // Near home the polygon does not count: a vehicle may have to take off and land beyond it.
        let beyond = area::clearance_m(&self.fence, position.at) < inside_m
            && position.at.distance_m(self.home) > HOME_M - inside_m;
        too_high || beyond
    }
}
