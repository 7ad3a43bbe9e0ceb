//! The outer loop of a real vehicle is its autopilot's, or the one that simulated vehicles have: both fly the reference
//! mission's set-points, by the same measure.

use air::geo::{Enu, Geodetic};
use mission::{Run, Setup};
use protocol::message::{PathKind, Setpoint, State};
use protocol::{Message, Topic};

const STEADY: &str = include_str!("../../../scenarios/as-pontes-steady.toml");
/// Until then vehicle 6 has taken off and flown several passes.
const UNTIL_S: f64 = 900.0;
/// After a set-point this long is left to turn, climb and settle, s.
const SETTLES_S: f64 = 40.0;
/// Nearer to its end than this a leg goes over into a circle, m.
const NEAR_M: f64 = 300.0;

fn setup(change: impl Fn(&str) -> String) -> Setup {
    let none = |_: &str| Err("no such file".to_owned());
    Setup::load("s.toml", &change(STEADY), &none).unwrap()
}

fn with_outer_loop(text: &str) -> String {
    text.replace(
        "kind = \"stand-in\"",
        "outer_loop = \"plumage\"\nkind = \"stand-in\"",
    )
}

/// Root mean squares on straight legs of vehicle 6: height (m), airspeed (m/s), distance across the leg (m).
#[derive(Debug, Default)]
struct Errors {
    height_m: f64,
    airspeed_m_s: f64,
    across_m: f64,
    samples: f64,
    /// SET_ATTITUDE_TARGETs sent.
    attitudes: usize,
}

impl Errors {
    fn root_mean(mut self) -> Self {
        for sum in [
            &mut self.height_m,
            &mut self.airspeed_m_s,
            &mut self.across_m,
        ] {
            *sum = (*sum / self.samples).sqrt();
        }
        self
    }
}

/// A leg that is flown: the setpoint, since when, and from where.
struct Leg {
    to: Setpoint,
    since_s: f64,
    from: Option<From>,
}

/// Where a leg begins.
#[derive(Clone, Copy)]
struct From {
    at: Enu,
    /// Whether the vehicle flies away from its target, and turns back first. It then flies straight from the end of its
    /// turn, beside the leg; `sc` reserves the room of the turn too.
    turns_back: bool,
}

fn fly(setup: &Setup) -> Errors {
    let frame = setup.scenario.frame().unwrap();
    let at = |lat_deg: f64, lon_deg: f64| frame.to_enu(Geodetic { lat_deg, lon_deg });
    let mut errors = Errors::default();
    let mut leg: Option<Leg> = None;
    let mut measure = |state: &State, time_s: f64, leg: &mut Leg| {
        let here = at(state.lat_deg, state.lon_deg);
        let to = at(leg.to.lat_deg, leg.to.lon_deg);
        let [north_m_s, east_m_s, _] = state.vel_ned_m_s;
        let towards =
            (to.east_m - here.east_m) * east_m_s + (to.north_m - here.north_m) * north_m_s;
        let from = *leg.from.get_or_insert(From {
            at: here,
            turns_back: towards < 0.0,
        });
        if from.turns_back {
            return;
        }
        let from = from.at;
        let (east, north) = (to.east_m - from.east_m, to.north_m - from.north_m);
        let straight = leg.to.path == PathKind::GoTo;
        let settled = time_s - leg.since_s > SETTLES_S && here.distance_m(to) > NEAR_M;
        if !(straight && settled) {
            return;
        }
        let off = (here.east_m - from.east_m) * north - (here.north_m - from.north_m) * east;
        errors.samples += 1.0;
        errors.height_m += (state.alt_amsl_m - leg.to.alt_amsl_m).powi(2);
        errors.airspeed_m_s += (state.airspeed_m_s - leg.to.airspeed_m_s).powi(2);
        errors.across_m += (off / east.hypot(north)).powi(2);
    };
    let mut attitudes = 0;
    let mut run = Run::new(setup).unwrap();
    let mut time_s = 0.0;
    while time_s < UNTIL_S && !run.ended() {
        for (topic, envelope) in run.step() {
            time_s = envelope.time.s();
            match (&topic, &envelope.message) {
                (Topic::Setpoint(id), Message::Setpoint(to))
                    if id.as_str() == "6" && leg.as_ref().is_none_or(|leg| leg.to != *to) =>
                {
                    leg = Some(Leg {
                        to: to.clone(),
                        since_s: time_s,
                        from: None,
                    });
                }
                (Topic::State(id), Message::State(state)) if id.as_str() == "6" => {
                    if let Some(leg) = &mut leg {
                        measure(state, time_s, leg);
                    }
                }
                (Topic::MavlinkTx(_), Message::Mavlink(frame)) => {
                    attitudes += usize::from(frame.bytes[7..10] == [82, 0, 0]);
                }
                _ => {}
            }
        }
    }
    Errors {
        attitudes,
        ..errors
    }
    .root_mean()
}

#[test]
fn both_outer_loops_fly_the_mission() {
    let [vehicle, plumage] = std::thread::scope(|scope| {
        [
            scope.spawn(|| fly(&setup(str::to_owned))),
            scope.spawn(|| fly(&setup(with_outer_loop))),
        ]
        .map(|flight| flight.join().unwrap())
    });
    println!("its own: {vehicle:?}\nplumage: {plumage:?}");
    assert_eq!(vehicle.attitudes, 0);
    // Twenty a second since the climb.
    assert!(plumage.attitudes > 10_000, "{plumage:?}");
    for errors in [&vehicle, &plumage] {
        assert!(errors.samples > 500.0, "{errors:?}");
        // Half of what vehicles are kept apart by in height, the tenth part of what they fly at, and what is reserved
        // beside a leg (`sc`).
        assert!(errors.height_m < 15.0, "{errors:?}");
        assert!(errors.airspeed_m_s < 1.8, "{errors:?}");
        assert!(errors.across_m < 25.0, "{errors:?}");
    }
}

#[test]
fn a_simulated_vehicle_has_no_other_outer_loop() {
    let text = STEADY.replacen(
        "kind = \"simulated\"",
        "outer_loop = \"plumage\"\nkind = \"simulated\"",
        1,
    );
    let none = |_: &str| Err("no such file".to_owned());
    let refused = Setup::load("s.toml", &text, &none).unwrap_err().to_string();
    assert!(
        refused.contains("outer_loop of a simulated vehicle"),
        "{refused}"
    );
}
