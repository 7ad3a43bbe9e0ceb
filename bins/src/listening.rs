//! Waiting for a mission. Bridges that send nothing, or nothing but questions, need none: they listen to their
//! vehicles meanwhile, and print what they hear.

use crate::Failure;
use crate::links::Links;
use mission::Member;
use net::Net;
use net::realtime::MissionClock;
use protocol::message::{Health, Reading, State};
use protocol::text::printable;
use protocol::{Agent as _, Event, Message, Outbox, SimTime};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Polling interval of the links.
const LOOK: Duration = Duration::from_millis(20);
/// Time between two lines on how a vehicle is.
const LINE: Duration = Duration::from_secs(5);

/// Asks for the mission's time until somebody tells it, and listens to the vehicles `alone` meanwhile, each with its
/// number among the links; none where the process is interrupted first.
///
/// # Errors
/// A mission that does not let this process in.
pub async fn until_joined(
    net: &Net,
    links: &mut Links,
    alone: Vec<(Member, usize)>,
    interrupted: &AtomicBool,
) -> Result<Option<MissionClock>, Failure> {
    let mut listeners: Vec<Listener> = alone.into_iter().map(Listener::new).collect();
    let ask = MissionClock::ask(net);
    tokio::pin!(ask);
    let start = Instant::now();
    let mut looks = tokio::time::interval(LOOK);
    loop {
        tokio::select! {
            clock = &mut ask => {
                if !listeners.is_empty() {
                    eprintln!("the mission has begun: joined");
                }
                return Ok(Some(clock?));
            }
            _ = looks.tick() => {
                if interrupted.load(Ordering::Relaxed) {
                    return Ok(None);
                }
                let now = SimTime::from_s(start.elapsed().as_secs_f64());
                for listener in &mut listeners {
                    listener.look(links, now);
                }
            }
        }
    }
}

/// One vehicle that is listened to.
struct Listener {
    member: Member,
    user: usize,
    out: Outbox,
    heard: Heard,
    next_line: SimTime,
}

/// Its last report.
#[derive(Default)]
struct Heard {
    state: Option<State>,
    reading: Option<Reading>,
    health: Option<Box<Health>>,
}

impl Listener {
    fn new((member, user): (Member, usize)) -> Self {
        eprintln!(
            "vehicle {}: no mission yet; the bridge only listens to the vehicle",
            member.id().name()
        );
        Self {
            member,
            user,
            out: Outbox::default(),
            heard: Heard::default(),
            next_line: after(SimTime::ZERO),
        }
    }

    fn look(&mut self, links: &mut Links, now: SimTime) {
        if let Member::Real(vehicle) = &mut self.member
            && let Some(link) = vehicle.link()
        {
            links.serve(self.user, link, now);
        }
        self.member.handle(Event::Tick, now, &mut self.out);
        for (_, message) in self.out.drain() {
            match message {
                Message::State(state) => self.heard.state = Some(state),
                Message::Reading(reading) => self.heard.reading = Some(reading),
                Message::Health(health) => self.heard.health = Some(health),
                _ => {}
            }
        }
        if now >= self.next_line {
            self.next_line = after(now);
            let words = std::mem::take(&mut self.heard).words();
            eprintln!("vehicle {}: {}", self.member.id().name(), printable(&words));
        }
    }
}

fn after(now: SimTime) -> SimTime {
    SimTime::from_s(now.s() + LINE.as_secs_f64())
}

impl Heard {
    /// All of it on one line.
    fn words(&self) -> String {
        let mut parts = Vec::new();
        if let Some(health) = self.health.as_ref().filter(|h| h.silent_s.is_some()) {
            let id = health.system_id.zip(health.component_id);
            parts.extend(
                id.map(|(system, component)| format!("system {system}, component {component}")),
            );
            parts.extend(health.flight_mode.clone());
            parts.extend(
                health
                    .armed
                    .map(|armed| if armed { "armed" } else { "disarmed" }.to_owned()),
            );
            parts.extend(
                health
                    .battery_percent
                    .map(|percent| format!("battery {percent} %")),
            );
            parts.extend(health.satellites.map(|count| format!("{count} satellites")));
            parts.extend(
                health
                    .silent_s
                    .filter(|silent_s| *silent_s > LINE.as_secs_f64())
                    .map(|silent_s| format!("no heartbeat for {silent_s:.0} s")),
            );
        }
        parts.extend(self.state.as_ref().map(|s| {
            format!(
                "at {:.6}, {:.6}, {:.0} m AMSL, heading {:.0}°",
                s.lat_deg, s.lon_deg, s.alt_amsl_m, s.heading_deg
            )
        }));
        parts.extend(
            self.reading
                .as_ref()
                .map(|r| format!("gas {:.2} ppm", r.co2_ppm)),
        );
        if parts.is_empty() {
            return "nothing received from this vehicle".to_owned();
        }
        parts.join(", ")
    }
}
