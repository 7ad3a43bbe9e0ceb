//! Safety monitor of a vehicle: the silence of its peers and its fence.
//! Dangers begin in the air only.

use crate::error::VaError;
use air::geo::{Enu, Geodetic};
use protocol::control_level::{ControlEvent, Danger};
use protocol::{Message, Pauses, SimTime};
use scenario::Scenario;
use scenario::bounds::Bounds;
use scenario::tables::VehicleKind;

/// Silence of the squadron controller, which publishes every second, that counts as a danger, s.
const CONTROLLER_S: f64 = 5.0;
/// Silence of the world simulator towards a simulated vehicle (ten ambients a second), s.
const AMBIENT_S: f64 = 5.0;
/// Silence of the world simulator towards a real vehicle, which does not fly by it (an ambient a second), s.
const HEARTBEAT_S: f64 = 25.0;
/// Hysteresis: a broken fence counts as kept again this far inside, m.
const BACK_INSIDE_M: f64 = 30.0;

/// Position of a vehicle.
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

    /// `pause_ns`: time before `now` during which this process was not running.
    fn check(&mut self, now: SimTime, pause_ns: i64, airborne: bool) -> Option<ControlEvent> {
        self.last_received = self.last_received.map(|t| t.later(pause_ns).min(now));
        if airborne && self.last_received.is_none() {
            // In the air at the first tick, as after a restart: the time limits count from now.
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
    bounds: Bounds,
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
        let real = vehicle.kind != VehicleKind::Simulated;
        Ok(Self {
            bounds: Bounds::of(scenario, index)?,
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
        self.bounds.frame().ground_amsl_m
    }

    /// Position in `state`.
    pub(crate) fn locate(&self, state: &protocol::message::State) -> ObservedPosition {
        ObservedPosition {
            at: self
                .bounds
                .frame()
                .to_enu(Geodetic::new(state.lat_deg, state.lon_deg)),
            alt_amsl_m: state.alt_amsl_m,
            airborne: state.airborne,
        }
    }

    /// The reason to reject a place; none if the vehicle may fly there.
    pub(crate) fn refuses(&self, to: Geodetic, alt_amsl_m: f64) -> Option<String> {
        self.bounds.refuses(to, alt_amsl_m)
    }

    /// The same for a vehicle whose kind differs from the scenario, as after a swap.
    #[must_use]
    pub(crate) fn of_kind(self, real: bool) -> Self {
        let world_s = if real { HEARTBEAT_S } else { AMBIENT_S };
        Self {
            real,
            world: Watchdog::new(Danger::World, world_s),
            ..self
        }
    }

    /// Resets the watchdog of the sender of `message`. A simulated vehicle needs its own ambient, a real one any message
    /// of the world simulator.
    pub(crate) fn observe(&mut self, message: &Message, now: SimTime) {
        match message {
            Message::Plan(_) | Message::Setpoint(_) => self.controller.last_received = Some(now),
            Message::Ambient(_) => self.world.last_received = Some(now),
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
        self.bounds
            .is_outside(position.at, position.alt_amsl_m, inside_m)
    }
}
