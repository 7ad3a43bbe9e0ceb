//! A vehicle outside the team, which receives no setpoints: its readings and positions come
//! from observations. On the bus it appears as a real vehicle under its pilot.

use crate::{MissionError, Setup};
use air::geo::{Enu, Geodetic, LocalFrame};
use air::terrain::Terrain;
use air::wind::WindVector;
use protocol::key::Name;
use protocol::message::{ControlLevel, Mode, Reading, Severity, State, VehicleKind};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};
use scenario::observations::ObservationRow;
use std::collections::VecDeque;

/// Height above ground from which it counts as flying, m: above the error of a fix at rest.
const AIRBORNE_ABOVE_M: f64 = 5.0;
/// Slower than this it keeps the heading it had: the course is noise, m/s.
const COURSE_FROM_M_S: f64 = 1.0;

/// Times at which rows of a file or stream are published in the mission, and times of their readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedTimes {
    /// Time of the first row by its own clock, s.
    pub first_s: f64,
    /// Time of publication and reading of the first row.
    pub start: SimTime,
    /// Ratio of publication speed to reading speed; infinite: one row a tick.
    pub speed: f64,
    /// Length of a tick, ns.
    pub tick_ns: i64,
    /// Rows published so far.
    pub said: i64,
}

impl FeedTimes {
    /// When the next row, read at `row_s` by its own clock, is said, and when it counts as read. The
    /// latter keeps the rows' own distances in time whatever the speed: a lag of a sensor, or a
    /// memory of the air, is no other for being looked at quickly.
    pub fn next(&mut self, row_s: f64) -> (SimTime, SimTime) {
        let after_s = row_s - self.first_s;
        let read = SimTime::from_s(self.start.s() + after_s);
        let said = if self.speed.is_infinite() {
            SimTime::from_ns(self.start.ns() + self.said * self.tick_ns)
        } else {
            SimTime::from_s(self.start.s() + after_s / self.speed)
        };
        self.said += 1;
        (said, read)
    }
}

/// A vehicle that is fed into a mission.
#[derive(Debug)]
pub struct FedVehicle {
    id: AgentId,
    name: Name,
    frame: LocalFrame,
    terrain: Terrain,
    /// Messages to publish with their times, in order.
    waiting: VecDeque<(SimTime, Message)>,
    last: Option<(ObservationRow, State)>,
}

impl FedVehicle {
    /// The vehicle `name` over the site of a mission, of which nothing is known yet.
    ///
    /// # Errors
    /// A name that cannot be part of a key, or that a vehicle of the team has.
    pub fn new(setup: &Setup, name: &str) -> Result<Self, MissionError> {
        let team: Vec<&str> = setup
            .scenario
            .vehicles
            .iter()
            .map(|v| v.id.as_str())
            .collect();
        if team.contains(&name) {
            return Err(MissionError::Request(format!(
                "vehicle {name} belongs to the team ({}); expected another id for the fed vehicle",
                team.join(", ")
            )));
        }
        Ok(Self {
            id: AgentId::va(name)?,
            name: Name::new(name)?,
            frame: setup.frame()?,
            terrain: setup.terrain.clone(),
            waiting: VecDeque::new(),
            last: None,
        })
    }

    /// Adds a row with its times of publication (`said`) and reading (`read`). Rows come in order of time.
    pub fn push(&mut self, (said, read): (SimTime, SimTime), row: &ObservationRow) {
        if self.last.is_none() {
            let mode = Mode {
                level: ControlLevel::Pilot,
                reason: "fed vehicle outside the team".to_owned(),
                setpoints_obeyed: false,
            };
            self.waiting.push_back((said, Message::Mode(mode)));
        }
        let state = self.state(row);
        self.last = Some((*row, state.clone()));
        self.waiting.push_back((said, Message::State(state)));
        if let Some(reading) = reading(row, said, read) {
            self.waiting.push_back((said, Message::Reading(reading)));
        }
    }

    /// Adds a message of a recorded mission, to publish it again.
    pub fn repeat(&mut self, said: SimTime, message: Message) {
        self.waiting.push_back((said, message));
    }

    /// Whether all messages are published.
    pub fn has_said_all(&self) -> bool {
        self.waiting.is_empty()
    }

    /// The state of a row: its position, and the motion since the row before.
    fn state(&self, row: &ObservationRow) -> State {
        let (velocity, heading_deg) = self.motion(row);
        let [north, east, _] = velocity;
        let wind = row.wind_speed_m_s.zip(row.wind_from_deg);
        let wind = wind.map_or(WindVector::default(), |(speed, from)| {
            WindVector::from_speed_and_direction(speed, from)
        });
        let at = geodetic(row);
        State {
            kind: VehicleKind::Real,
            lat_deg: row.lat_deg,
            lon_deg: row.lon_deg,
            alt_amsl_m: row.alt_amsl_m,
            vel_ned_m_s: velocity,
            roll_deg: 0.0,
            pitch_deg: 0.0,
            heading_deg,
            airspeed_m_s: (east - wind.east_m_s).hypot(north - wind.north_m_s),
            throttle: 0.0,
            airborne: row.alt_amsl_m > self.terrain.ground_amsl_m(at) + AIRBORNE_ABOVE_M,
        }
    }

    /// Velocity over ground since the row before, north, east, down, m/s, and heading, degrees.
    fn motion(&self, row: &ObservationRow) -> ([f64; 3], f64) {
        let Some((before, was)) = &self.last else {
            return ([0.0; 3], 0.0);
        };
        let for_s = row.time_s - before.time_s;
        if for_s <= 0.0 {
            return (was.vel_ned_m_s, was.heading_deg);
        }
        let [here, there] = [row, before].map(|r| self.frame.to_enu(geodetic(r)));
        let velocity = [
            (here.north_m - there.north_m) / for_s,
            (here.east_m - there.east_m) / for_s,
            (before.alt_amsl_m - row.alt_amsl_m) / for_s,
        ];
        let [north_m, east_m, _] = velocity;
        let heading_deg = if north_m.hypot(east_m) < COURSE_FROM_M_S {
            was.heading_deg
        } else {
            Enu::default().bearing_deg(Enu::new(east_m, north_m))
        };
        (velocity, heading_deg)
    }
}

fn geodetic(row: &ObservationRow) -> Geodetic {
    Geodetic::new(row.lat_deg, row.lon_deg)
}

/// The reading of a row, if any.
fn reading(row: &ObservationRow, said: SimTime, read: SimTime) -> Option<Reading> {
    Some(Reading {
        kind: VehicleKind::Real,
        lat_deg: row.lat_deg,
        lon_deg: row.lon_deg,
        alt_amsl_m: row.alt_amsl_m,
        co2_ppm: row.co2_ppm?,
        wind_speed_m_s: row.wind_speed_m_s,
        wind_from_deg: row.wind_from_deg,
        temperature_c: row.temperature_c,
        pressure_hpa: row.pressure_hpa,
        time_ns: (read != said).then(|| read.ns()),
    })
}

impl Agent for FedVehicle {
    fn id(&self) -> &AgentId {
        &self.id
    }

    fn interests(&self) -> Vec<Interest> {
        vec![Interest::One(Topic::Control(self.name.clone()))]
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        if let Event::Message(..) = event {
            let words = "it is a fed vehicle outside the team and accepts no commands";
            return out.event(&self.id, Severity::Warning, "control-refused", words);
        }
        while let Some((_, message)) = self.waiting.pop_front_if(|(said, _)| *said <= now) {
            let topic = match &message {
                Message::State(_) => Topic::State(self.name.clone()),
                Message::Mode(_) => Topic::Mode(self.name.clone()),
                Message::Reading(_) => Topic::Reading(self.name.clone()),
                _ => continue,
            };
            out.say(topic, message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vehicle(name: &str) -> Result<FedVehicle, MissionError> {
        let text = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n\
            [[source]]\nlat_deg=43.4\nlon_deg=-7.8\nemission_kg_s=300\n";
        let setup = Setup::load("s.toml", text, &|_| Err("no such file".to_owned()))?;
        FedVehicle::new(&setup, name)
    }

    fn row(time_s: f64, lat_deg: f64, alt_amsl_m: f64) -> ObservationRow {
        ObservationRow {
            time_s,
            platform: 0,
            lat_deg,
            lon_deg: -7.8,
            alt_amsl_m,
            co2_ppm: Some(450.0),
            wind_speed_m_s: Some(5.0),
            wind_from_deg: Some(0.0),
            ..ObservationRow::default()
        }
    }

    fn times(speed: f64) -> FeedTimes {
        FeedTimes {
            first_s: 1000.0,
            start: SimTime::from_s(60.0),
            speed,
            tick_ns: 20_000_000,
            said: 0,
        }
    }

    #[test]
    fn rows_keep_their_distance_in_time_at_any_speed() {
        for (speed, said_s) in [
            (1.0, 70.0),
            (10.0, 61.0),
            (0.5, 80.0),
            (f64::INFINITY, 60.02),
        ] {
            let mut times = times(speed);
            assert_eq!(
                times.next(1000.0),
                (SimTime::from_s(60.0), SimTime::from_s(60.0))
            );
            assert_eq!(
                times.next(1010.0),
                (SimTime::from_s(said_s), SimTime::from_s(70.0))
            );
        }
    }

    #[test]
    fn rows_are_said_when_they_are_due_as_of_a_real_vehicle_that_moves() {
        // 0.001 degrees of latitude at 43.4 are 111.1 m (WGS84 meridian: 111,095 m a degree), in 5 s
        // 22.2 m/s, northwards against 5 m/s of wind from north.
        let (mut fed, mut times) = (vehicle("feed").unwrap(), times(1.0));
        fed.push(times.next(1000.0), &row(1000.0, 43.400, 342.0));
        fed.push(times.next(1005.0), &row(1005.0, 43.401, 500.0));
        let mut out = Outbox::default();
        fed.handle(Event::Tick, SimTime::from_s(59.0), &mut out);
        assert!(out.messages().is_empty());
        fed.handle(Event::Tick, SimTime::from_s(60.0), &mut out);
        let said: Vec<&str> = out.messages().iter().map(|m| m.1.name()).collect();
        assert_eq!(said, ["Mode", "State", "Reading"]);
        out.drain().for_each(drop);
        fed.handle(Event::Tick, SimTime::from_s(66.0), &mut out);
        let [(_, Message::State(state)), (_, Message::Reading(reading))] = out.messages() else {
            panic!("{:?}", out.messages());
        };
        assert!(state.airborne && state.kind == VehicleKind::Real);
        assert!((state.vel_ned_m_s[0] - 22.22).abs() < 0.02, "{state:?}");
        assert!((state.airspeed_m_s - 27.22).abs() < 0.02, "{state:?}");
        assert!(state.heading_deg.min(360.0 - state.heading_deg) < 0.1);
        assert_eq!((reading.co2_ppm, reading.time_ns), (450.0, None));
        assert!(fed.has_said_all());
    }

    #[test]
    fn a_vehicle_of_the_team_cannot_be_fed_in() {
        let refused = vehicle("6").unwrap_err().to_string();
        assert!(
            refused.contains("vehicle 6 belongs to the team (1, 2, 3, 4, 5, 6)"),
            "{refused}"
        );
        assert!(vehicle("a b").is_err());
    }
}
