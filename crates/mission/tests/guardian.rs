//! Members of the team fall silent, batteries run low, fences are broken, pilots take over: every
//! vehicle comes home and circles, and flies on only when it is handed back.

use air::geo::{Enu, Geodetic};
use mission::{Member, Setup};
use protocol::bus::Conductor;
use protocol::key::Name;
use protocol::message::{Control, ControlLevel, ControlWish, Mode, State, Sticks};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};
use std::collections::{BTreeMap, BTreeSet};

const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");
const X8: &str = include_str!("../../../aircraft/x8.toml");
/// When the team is in the air and searches.
const FLYING_S: f64 = 700.0;

/// A member of the team that is dead from one time to another.
struct Mortal {
    member: Member,
    dead: Option<(f64, f64)>,
}

impl Agent for Mortal {
    fn id(&self) -> &AgentId {
        self.member.id()
    }

    fn interests(&self) -> Vec<Interest> {
        self.member.interests()
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        let dead = self
            .dead
            .is_some_and(|(from, to)| (from..to).contains(&now.s()));
        if !dead {
            self.member.handle(event, now, out);
        }
    }
}

/// A mission with what was last said in it.
struct Flight {
    setup: Setup,
    conductor: Conductor<Mortal>,
    states: BTreeMap<String, State>,
    modes: BTreeMap<String, Mode>,
    setpoints: BTreeMap<String, usize>,
    /// Codes of events, with the vehicles of which they are.
    events: BTreeSet<(String, String)>,
}

impl Flight {
    /// The reference mission, changed by `change`, in which `dies` is silent from [`FLYING_S`] on until
    /// `until_s`.
    fn new(change: impl Fn(&str) -> String, dies: Option<(AgentId, f64)>) -> Self {
        let read = |file: &str| match file {
            "aircraft/weak.toml" => Ok(X8.replace("237.0", "14.0").into_bytes()),
            _ => Err("no such file".to_owned()),
        };
        let setup = Setup::load("s.toml", &change(AS_PONTES), &read).unwrap();
        let mortal = |member: Member| {
            let dead = match &dies {
                Some((id, until_s)) if id == member.id() => Some((FLYING_S, *until_s)),
                _ => None,
            };
            Mortal { member, dead }
        };
        let team = Member::all(&setup).unwrap().into_iter().map(mortal);
        Self {
            conductor: Conductor::new(team.collect(), setup.tick_ns()),
            setup,
            states: BTreeMap::new(),
            modes: BTreeMap::new(),
            setpoints: BTreeMap::new(),
            events: BTreeSet::new(),
        }
    }

    fn run_until(&mut self, time_s: f64) {
        while self.conductor.now().s() < time_s {
            for (topic, envelope) in self.conductor.step() {
                match (topic, &envelope.message) {
                    (Topic::State(id), Message::State(state)) => {
                        self.states.insert(id.to_string(), state.clone());
                    }
                    (Topic::Mode(id), Message::Mode(mode)) => {
                        self.modes.insert(id.to_string(), mode.clone());
                    }
                    (Topic::Setpoint(id), _) => {
                        *self.setpoints.entry(id.to_string()).or_default() += 1
                    }
                    (Topic::Event(id), Message::Event(event)) => {
                        let name = id.name().to_string();
                        self.events.insert((event.code.clone(), name));
                    }
                    _ => {}
                }
            }
        }
    }

    /// Of whom there was an event of this code.
    fn told(&self, code: &str) -> Vec<&str> {
        let of_code = self.events.iter().filter(|(of, _)| of == code);
        of_code.map(|(_, name)| name.as_str()).collect()
    }

    fn say(&mut self, vehicle: &str, wish: ControlWish, sticks: Option<Sticks>) {
        let topic = Topic::Control(Name::new(vehicle).unwrap());
        let message = Message::Control(Control { wish, sticks });
        self.conductor.operate(topic, message).unwrap();
    }

    fn level(&self, vehicle: &str) -> ControlLevel {
        self.modes[vehicle].level
    }

    fn levels(&self) -> Vec<ControlLevel> {
        self.modes.values().map(|m| m.level).collect()
    }

    fn at(&self, vehicle: &str) -> (Enu, f64) {
        let s = &self.states[vehicle];
        let at = Geodetic {
            lat_deg: s.lat_deg,
            lon_deg: s.lon_deg,
        };
        (self.setup.frame().unwrap().to_enu(at), s.alt_amsl_m)
    }

    fn distance_home_m(&self, vehicle: &str) -> f64 {
        let home = self
            .setup
            .scenario
            .home(self.setup.index_of(vehicle).unwrap());
        let home = self.setup.frame().unwrap().to_enu(home.unwrap());
        self.at(vehicle).0.distance_m(home)
    }

    /// All vehicles circle at home, apart from each other.
    fn all_circle_at_home(&self) {
        let ids: Vec<&String> = self.states.keys().collect();
        for (k, id) in ids.iter().enumerate() {
            assert!(self.states[*id].airborne, "{id} is down");
            assert!(
                self.distance_home_m(id) < 250.0,
                "{id}: {} m",
                self.distance_home_m(id)
            );
            for other in &ids[k + 1..] {
                let ((a, up), (b, other_up)) = (self.at(id), self.at(other));
                let apart = (up - other_up).abs() > 20.0 || a.distance_m(b) > 150.0;
                assert!(apart, "{id} and {other} meet at {up} m");
            }
        }
    }
}

fn as_it_is(text: &str) -> String {
    text.to_owned()
}

#[test]
fn without_its_controller_the_team_comes_home_until_it_is_heard_again() {
    let mut flight = Flight::new(as_it_is, Some((AgentId::sc(), FLYING_S + 450.0)));
    flight.run_until(FLYING_S);
    assert_eq!(flight.levels(), [ControlLevel::Automatic; 6]);
    // The search decides which of them are far from home.
    let away = |id: &&str| flight.distance_home_m(id) > 500.0;
    assert!(["1", "2", "3", "4", "5", "6"].iter().any(away));
    flight.run_until(FLYING_S + 8.0);
    assert_eq!(flight.levels(), [ControlLevel::Guardian; 6]);
    for mode in flight.modes.values() {
        assert!(
            mode.reason
                .contains("no message from the squadron controller"),
            "{mode:?}"
        );
        assert!(!mode.setpoints_obeyed);
    }
    flight.run_until(FLYING_S + 449.0);
    flight.all_circle_at_home();
    // While it is gone nobody is handed back.
    flight.say("1", ControlWish::HandBack, None);
    // A pilot takes one over, and hands it back to the Guardian.
    flight.say("2", ControlWish::TakeOver, None);
    flight.run_until(FLYING_S + 449.5);
    flight.say("2", ControlWish::HandBack, None);
    flight.run_until(FLYING_S + 450.0);
    assert_eq!(flight.levels(), [ControlLevel::Guardian; 6]);
    // It is back: those that nobody took over fly on by themselves, a real one once it shows GUIDED.
    flight.run_until(FLYING_S + 470.0);
    let flies_on = |id| match id {
        "2" => ControlLevel::Guardian,
        _ => ControlLevel::Automatic,
    };
    let ids = ["1", "2", "3", "4", "5", "6"];
    assert_eq!(flight.levels(), ids.map(flies_on));
    assert_eq!(flight.told("resumed"), ["1", "3", "4", "5", "6"]);
    flight.run_until(FLYING_S + 550.0);
    for id in ["1", "6"] {
        assert!(
            flight.distance_home_m(id) > 250.0,
            "{id} still waits at home"
        );
    }
    assert_eq!(flight.level("2"), ControlLevel::Guardian);
}

/// As a computation or a busy host makes it: longer than a silence may last, and then all goes on.
#[test]
fn the_team_flies_on_after_a_pause_of_its_controller_or_world() {
    for (silent, s) in [(AgentId::sc(), 9.0), (AgentId::ws(), 9.0)] {
        let mut flight = Flight::new(as_it_is, Some((silent.clone(), FLYING_S + s)));
        flight.run_until(FLYING_S + 8.0);
        assert_eq!(flight.level("1"), ControlLevel::Guardian);
        flight.run_until(FLYING_S + 20.0);
        assert_eq!(flight.levels(), [ControlLevel::Automatic; 6], "{silent}");
        assert!(!flight.told("resumed").is_empty());
    }
}

#[test]
fn without_its_world_the_team_comes_home() {
    let mut flight = Flight::new(as_it_is, Some((AgentId::ws(), 1e9)));
    flight.run_until(FLYING_S + 8.0);
    for id in ["1", "2", "3", "4", "5"] {
        assert_eq!(flight.level(id), ControlLevel::Guardian, "{id}");
        assert!(
            flight.modes[id]
                .reason
                .contains("no message from the world simulator")
        );
    }
    // A real vehicle flies in the real world and can wait a little longer.
    assert_eq!(flight.level("6"), ControlLevel::Automatic);
    flight.run_until(FLYING_S + 40.0);
    assert_eq!(flight.level("6"), ControlLevel::Guardian);
    flight.run_until(FLYING_S + 450.0);
    flight.all_circle_at_home();
}

#[test]
fn a_vehicle_that_leaves_the_fence_is_brought_back() {
    let mut flight = Flight::new(as_it_is, None);
    flight.run_until(FLYING_S);
    flight.say("1", ControlWish::TakeOver, None);
    let mut time_s = FLYING_S;
    while !flight.modes["1"].reason.contains("outside the fence") {
        time_s += 1.0;
        flight.run_until(time_s);
        assert!(time_s < 1500.0, "{:?}", flight.at("1"));
    }
    // A danger does not take it from its pilot; his hand-back gives it to the Guardian.
    assert_eq!(flight.level("1"), ControlLevel::Pilot);
    flight.say("1", ControlWish::HandBack, None);
    flight.run_until(time_s + 1.0);
    assert_eq!(flight.level("1"), ControlLevel::Guardian);
    flight.run_until(time_s + 400.0);
    assert!(
        flight.distance_home_m("1") < 250.0,
        "{}",
        flight.distance_home_m("1")
    );
    assert!(flight.modes["1"].reason.contains("waits for a hand-back"));
    flight.say("1", ControlWish::HandBack, None);
    flight.run_until(time_s + 402.0);
    assert_eq!(flight.level("1"), ControlLevel::Automatic);
}

#[test]
fn a_pilot_keeps_it_as_long_as_his_sticks_come() {
    let right = Some(Sticks {
        roll: 0.5,
        pitch: 0.0,
        throttle: 0.6,
    });
    let mut flight = Flight::new(as_it_is, None);
    flight.run_until(FLYING_S);
    let before = flight.setpoints.get("1").copied();
    for k in 0..20 {
        flight.say("1", ControlWish::TakeOver, right);
        flight.run_until(FLYING_S + f64::from(k + 1));
        assert_eq!(flight.level("1"), ControlLevel::Pilot);
    }
    assert!(flight.states["1"].roll_deg > 10.0);
    assert!(!flight.modes["1"].setpoints_obeyed);
    // The controller counts on him no more.
    assert_eq!(flight.setpoints.get("1").copied(), before);
    flight.run_until(FLYING_S + 24.0);
    assert_eq!(flight.level("1"), ControlLevel::Guardian);
    flight.say("1", ControlWish::HandBack, None);
    flight.run_until(FLYING_S + 26.0);
    assert_eq!(flight.level("1"), ControlLevel::Automatic);
}

#[test]
fn a_low_battery_ends_on_the_ground() {
    let weak = |text: &str| text.replacen("aircraft/x8.toml", "aircraft/weak.toml", 1);
    let mut flight = Flight::new(weak, None);
    let mut time_s = 100.0;
    flight.run_until(time_s);
    while flight.level("1") == ControlLevel::Automatic {
        time_s += 1.0;
        flight.run_until(time_s);
        assert!(time_s < 600.0, "the battery lasts");
    }
    assert!(
        flight.modes["1"].reason.contains("battery low"),
        "{:?}",
        flight.modes["1"]
    );
    while flight.states["1"].airborne {
        time_s += 1.0;
        flight.run_until(time_s);
        assert!(time_s < 1200.0, "never landed: {:?}", flight.at("1"));
    }
    flight.run_until(time_s + 30.0);
    assert!(
        flight.distance_home_m("1") < 100.0,
        "{}",
        flight.distance_home_m("1")
    );
    flight.say("1", ControlWish::HandBack, None);
    flight.run_until(time_s + 31.0);
    assert_eq!(flight.level("1"), ControlLevel::Automatic);
    assert_eq!(flight.level("2"), ControlLevel::Automatic);
}
