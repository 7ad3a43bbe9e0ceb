//! A mission in one process in virtual time.

use crate::fed_vehicle::FedVehicle;
use crate::team::Member;
use crate::{MissionError, Setup};
use protocol::bus::{Conductor, Publication};
use protocol::digest::Digest;
use protocol::key::Name;
use protocol::message::{Control, Destination};
use protocol::{Agent as _, Message, SimTime, Topic};
use scenario::tables::VehicleKind;
use std::sync::Arc;

/// A mission under way.
pub struct Run {
    conductor: Conductor<Member>,
    /// Of all ticks but the last.
    digest: Digest,
    ticks: u64,
}

impl Run {
    /// A mission at its start, all of it in this process.
    ///
    /// # Errors
    /// An invalid member, a vehicle behind a link that is not served, or the strategy of an external program.
    pub fn new(setup: &Setup) -> Result<Self, MissionError> {
        refuse_outside(setup)?;
        Self::led(setup)
    }

    /// The same, whose owner tells vehicles where to look, between the ticks, by [`Self::send_to`], where the strategy
    /// is that of an external program.
    ///
    /// # Errors
    /// An invalid member, or a vehicle behind a link that is not served.
    pub fn led(setup: &Setup) -> Result<Self, MissionError> {
        let mut vehicles = setup.scenario.vehicles.iter();
        if let Some(linked) = vehicles.find(|v| v.kind == VehicleKind::Mavlink) {
            return Err(MissionError::Request(format!(
                "vehicle {} is a real aircraft on a MAVLink link, which needs real time; use plumage run --speed \
                 real, or a process of its own with va or mav-bridge",
                linked.id
            )));
        }
        Self::begin(setup)
    }

    /// A mission at its start whose links to real vehicles the owner serves, between the ticks,
    /// at the members' [`RealVehicle::link`](crate::real_vehicle::RealVehicle::link).
    ///
    /// # Errors
    /// An invalid member, or the strategy of an external program.
    pub fn with_links(setup: &Setup) -> Result<Self, MissionError> {
        refuse_outside(setup)?;
        let run = Self::begin(setup)?;
        Ok(Self {
            conductor: run.conductor.in_real_time(),
            ..run
        })
    }

    fn begin(setup: &Setup) -> Result<Self, MissionError> {
        Ok(Self {
            conductor: Conductor::new(Member::all(setup)?, setup.tick_ns()),
            digest: Digest::new(),
            ticks: setup.ticks(),
        })
    }

    /// The same on the caller's thread alone, as a mission of a campaign that flies others at the same time.
    #[must_use]
    pub fn on_one_thread(self) -> Self {
        Self {
            conductor: self.conductor.on_one_thread(),
            ..self
        }
    }

    /// Lets a vehicle that is not of the team take part, before the first tick.
    ///
    /// # Errors
    /// A mission under way, or a vehicle that is there already.
    pub fn join(&mut self, vehicle: FedVehicle) -> Result<(), MissionError> {
        if self.conductor.next_tick() > 0 {
            let why = format!(
                "{}: cannot join, the mission has started already",
                vehicle.id()
            );
            return Err(MissionError::Request(why));
        }
        if self.members().any(|m| m.id() == vehicle.id()) {
            let why = format!("{} is in the mission already", vehicle.id());
            return Err(MissionError::Request(why));
        }
        self.conductor.join(Member::Fed(Box::new(vehicle)));
        Ok(())
    }

    /// Simulated time of the tick to come.
    pub fn now(&self) -> SimTime {
        self.conductor.now()
    }

    /// Whether the mission has come to its end.
    pub fn ended(&self) -> bool {
        self.conductor.next_tick() > self.ticks
    }

    /// Runs the next tick and returns what was said in it, in order; nothing after the end. The
    /// last tick is the one at the mission's duration, in which the agents say their last words.
    /// While a vehicle behind a link is not down ([`RealVehicle::is_up`](crate::real_vehicle::RealVehicle::is_up)),
    /// the mission goes on beyond its duration.
    pub fn step(&mut self) -> &[Publication] {
        if self.conductor.next_tick() == self.ticks && self.is_anybody_up() {
            self.ticks += 1;
        }
        let is_last = match self.conductor.next_tick().cmp(&self.ticks) {
            std::cmp::Ordering::Less => false,
            std::cmp::Ordering::Equal => true,
            std::cmp::Ordering::Greater => return &[],
        };
        let (conductor, digest) = (&mut self.conductor, &mut self.digest);
        let before = Arc::clone(conductor.said());
        let shared = if conductor.shares_work() {
            before.len()
        } else {
            0
        };
        beside(
            shared,
            || add(digest, &before),
            || {
                if is_last {
                    conductor.stop();
                } else {
                    conductor.step();
                }
            },
        );
        self.said()
    }

    /// What was said in the last tick.
    pub fn said(&self) -> &Arc<Vec<Publication>> {
        self.conductor.said()
    }

    /// Whether a vehicle behind a link is in the air or armed.
    pub fn is_anybody_up(&self) -> bool {
        let up = |m: &Member| matches!(m, Member::Real(vehicle) if vehicle.is_up());
        self.members().any(up)
    }

    /// The mission ends with the next tick, or when all vehicles behind links are down.
    pub fn end(&mut self) {
        self.ticks = self.ticks.min(self.conductor.next_tick());
    }

    /// The members, ordered by their ids.
    pub fn members(&self) -> impl Iterator<Item = &Member> {
        self.conductor.agents()
    }

    /// The members, for what is not a bus.
    pub fn members_mut(&mut self) -> impl Iterator<Item = &mut Member> {
        self.conductor.agents_mut()
    }

    /// The operator does something to the control level of `vehicle` in the tick to come.
    ///
    /// # Errors
    /// A name that cannot be part of a key.
    pub fn operate(&mut self, vehicle: &str, control: Control) -> Result<(), MissionError> {
        let topic = Topic::Control(Name::new(vehicle)?);
        self.say_as_operator(topic, Message::Control(control))
    }

    /// The operator sends `vehicle`, which he has taken over, to a place in the tick to come.
    ///
    /// # Errors
    /// A name that cannot be part of a key.
    pub fn send_to(&mut self, vehicle: &str, place: Destination) -> Result<(), MissionError> {
        let topic = Topic::Destination(Name::new(vehicle)?);
        self.say_as_operator(topic, Message::Destination(place))
    }

    /// Says in the operator's name, in the tick to come, what he has said before.
    ///
    /// # Errors
    /// A topic that is not his.
    pub fn say_as_operator(&mut self, topic: Topic, message: Message) -> Result<(), MissionError> {
        Ok(self.conductor.operate(topic, message)?)
    }

    /// Digest of all that was said so far.
    pub fn digest(&self) -> String {
        let mut digest = self.digest.clone();
        add(&mut digest, self.said());
        digest.hex()
    }
}

fn add(digest: &mut Digest, said: &[Publication]) {
    for (topic, envelope) in said {
        digest.add(topic, envelope);
    }
}

/// Messages of a tick that take longer to follow than it takes to wake a thread, some 50 µs.
pub const MESSAGES_WORTH_A_THREAD: usize = 200;

/// Does `follow` with the `messages` of the tick before while `next` runs, if they are many.
pub fn beside<T: Send>(
    messages: usize,
    follow: impl FnOnce() + Send,
    next: impl FnOnce() -> T + Send,
) -> T {
    if messages < MESSAGES_WORTH_A_THREAD {
        follow();
        return next();
    }
    rayon::join(next, follow).0
}

fn refuse_outside(setup: &Setup) -> Result<(), MissionError> {
    if setup.scenario.search.strategy != sc::OUTSIDE {
        return Ok(());
    }
    Err(MissionError::Request(
        "search.strategy = \"outside\": an outside strategy cannot reach a mission in one process; expected sc, \
         ws and va as separate processes in real time, or a strategy in Python"
            .to_owned(),
    ))
}
