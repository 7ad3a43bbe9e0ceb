//! The quadrotor of `aircraft/quad.toml`: its dynamics against SciPy, and what its autopilot holds in wind with gusts.
//!
//! The expected flights are written by `tests/oracle/multirotor.py` (PyPI `scipy` 1.17.1).

use air::dryden::{Dryden, Turbulence};
use fdm::autopilot::{Demand, Path, Sensed, Sticks};
use fdm::multirotor::MultirotorSim;
use fdm::{AirAround, Airframe, FlightPhase, FlightState, Multirotor, PilotedFlight};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use std::collections::BTreeMap;

const TICK_S: f64 = 0.02;
const QUAD: &str = include_str!("../../../aircraft/quad.toml");

fn airframe() -> Airframe {
    Airframe::from_toml("quad.toml", QUAD).unwrap()
}

fn quad() -> Multirotor {
    match airframe() {
        Airframe::Multirotor(quad) => *quad,
        Airframe::FixedWing(_) => panic!("a multirotor"),
    }
}

fn rows(text: &str) -> BTreeMap<String, Vec<Vec<f64>>> {
    let mut cases: BTreeMap<String, Vec<Vec<f64>>> = BTreeMap::new();
    for record in csv::Reader::from_reader(text.as_bytes()).records() {
        let record = record.unwrap();
        let numbers = record.iter().skip(1).map(|n| n.parse().unwrap()).collect();
        cases.entry(record[0].to_owned()).or_default().push(numbers);
    }
    cases
}

/// Python: T = 2.064*9.80665/4; n = sqrt(T/(.1290*1.225*.254**4)); 4*8.06428e-5*2*pi*n/2.064 = .0861292; 2.064/.0206 =
/// 100.194.
#[test]
fn the_drag_of_an_arducopter_is_that_of_the_model() {
    let expected = [
        ("EK3_DRAG_BCOEF_X", 100.194),
        ("EK3_DRAG_BCOEF_Y", 100.194),
        ("EK3_DRAG_MCOEF", 0.086_129_2),
    ];
    for ((name, value), (wanted, number)) in quad().ardupilot_drag().into_iter().zip(expected) {
        assert!(
            name == wanted && (value / number - 1.0).abs() < 1e-5,
            "{name} {value}"
        );
    }
}

#[test]
fn step_responses_are_those_of_scipy() {
    let inputs = rows(include_str!("../../../tests/oracle/multirotor_inputs.csv"));
    let flights = rows(include_str!("../../../tests/oracle/multirotor_flight.csv"));
    assert_eq!(flights.len(), 6);
    for (case, expected) in &flights {
        let mut sim = MultirotorSim::airborne(&quad(), 0.0, 0.0, 100.0, 0.0).unwrap();
        let mut air = AirAround::STANDARD_CALM;
        let mut shares = [0.0; 4];
        let mut changes = inputs[case].iter().peekable();
        let (mut tick, mut off, mut size) = (0_u32, [0.0_f64; 3], [0.0_f64; 3]);
        for row in expected {
            while f64::from(tick) * 0.01 < row[0] - 1e-9 {
                let now = f64::from(tick) * 0.01;
                while let Some(change) = changes.next_if(|c| c[0] <= now + 1e-9) {
                    shares = [change[1], change[2], change[3], change[4]];
                    air.wind_ned_m_s = [change[5], change[6], change[7]];
                }
                sim.step_rotors(0.01, &air, &shares);
                tick += 1;
            }
            let s = sim.state();
            let ours = [
                [s.north_m, s.east_m, s.alt_amsl_m - 100.0],
                s.vel_ned_m_s,
                [s.roll_rad, s.pitch_rad, s.yaw_rad].map(f64::to_degrees),
            ];
            let theirs = [
                [row[1], row[2], row[3] - 100.0],
                [row[4], row[5], row[6]],
                [row[7], row[8], row[9]],
            ];
            for k in 0..3 {
                for (a, b) in ours[k].iter().zip(&theirs[k]) {
                    off[k] = off[k].max((a - b).abs());
                    size[k] = size[k].max(b.abs());
                }
            }
        }
        println!("{case}: off {off:?} of {size:?}");
        for k in 0..3 {
            assert!(
                off[k] <= 1e-3 * size[k] + 1e-6,
                "{case}: {off:?} of {size:?}"
            );
        }
    }
}

/// Wind from the north with the gusts of MIL-F-8785C, and a position estimate with slow errors.
struct Weather {
    wind_m_s: f64,
    dryden: Dryden,
    turbulence: Turbulence,
    rng: ChaCha8Rng,
    position_sd_m: [f64; 3],
    error_m: [f64; 3],
}

impl Weather {
    fn new(wind_m_s: f64, position_sd_m: [f64; 3], seed: u64) -> Self {
        Self {
            wind_m_s,
            dryden: Dryden::new(),
            turbulence: Turbulence::mil_f_8785c(30.0, wind_m_s, 1.0),
            rng: ChaCha8Rng::seed_from_u64(seed),
            position_sd_m,
            error_m: [0.0; 3],
        }
    }

    fn tick(&mut self, state: &FlightState) -> (AirAround, Sensed) {
        let [u, v, w] =
            self.dryden
                .step(TICK_S, state.airspeed_m_s, &self.turbulence, &mut self.rng);
        let air = AirAround {
            wind_ned_m_s: [-self.wind_m_s - u, v, w],
            density_kg_m3: 1.2,
        };
        let keep = (-TICK_S / 60.0_f64).exp();
        for (error, sd) in self.error_m.iter_mut().zip(self.position_sd_m) {
            let draw: f64 = self.rng.sample(StandardNormal);
            *error = keep * *error + sd * (1.0 - keep * keep).sqrt() * draw;
        }
        let mut sensed = Sensed::perfect(state, air.density_kg_m3);
        sensed.north_m += self.error_m[0];
        sensed.east_m += self.error_m[1];
        sensed.alt_amsl_m += self.error_m[2];
        (air, sensed)
    }
}

fn airborne() -> PilotedFlight {
    PilotedFlight::airborne(&airframe(), [0.0, 0.0, 30.0], 0.0, 0.0, [0.0; 3]).unwrap()
}

fn at(north_m: f64, east_m: f64, airspeed_m_s: f64) -> Demand {
    Demand {
        path: Path::GoTo { north_m, east_m },
        alt_amsl_m: 30.0,
        airspeed_m_s,
    }
}

/// Root mean square of the true position off the commanded one in hover, horizontal and vertical, m.
fn hover_rms_m(position_sd_m: [f64; 3], seed: u64) -> (f64, f64) {
    let mut weather = Weather::new(8.0, position_sd_m, seed);
    let mut craft = airborne();
    let (mut horizontal, mut vertical, mut count) = (0.0, 0.0, 0.0);
    for tick in 0..(140.0 / TICK_S) as u32 {
        let state = craft.state();
        let (air, sensed) = weather.tick(&state);
        craft.fly(TICK_S, &air, &sensed, &at(0.0, 0.0, 5.0));
        if f64::from(tick) * TICK_S >= 20.0 {
            let s = craft.state();
            horizontal += s.north_m * s.north_m + s.east_m * s.east_m;
            vertical += (s.alt_amsl_m - 30.0) * (s.alt_amsl_m - 30.0);
            count += 1.0;
        }
    }
    ((horizontal / count).sqrt(), (vertical / count).sqrt())
}

#[test]
fn hovers_in_8_m_s_with_gusts() {
    let navigation = quad().navigation;
    let noise = [
        navigation.horizontal_sd_m,
        navigation.horizontal_sd_m,
        navigation.vertical_sd_m,
    ];
    for seed in 1..=8 {
        let without = hover_rms_m([0.0; 3], seed);
        let with = hover_rms_m(noise, seed);
        println!("seed {seed}: without noise {without:?}, with {with:?} m");
        assert!(without.0 <= 0.2 && without.1 <= 0.2, "{without:?}");
        assert!(with.0 <= 0.5 && with.1 <= 0.3, "{with:?}");
    }
}

#[test]
fn transects_at_5_m_s_across_the_wind_stay_on_their_line() {
    for seed in 1..=4 {
        let mut weather = Weather::new(8.0, [0.03, 0.03, 0.05], seed);
        let mut craft = airborne();
        let (mut square, mut count, mut speed) = (0.0, 0.0, 0.0_f64);
        for leg in 0..4 {
            let east_m = if leg % 2 == 0 { 150.0 } else { 0.0 };
            for _ in 0..(45.0 / TICK_S) as u32 {
                let state = craft.state();
                let (air, sensed) = weather.tick(&state);
                craft.fly(TICK_S, &air, &sensed, &at(0.0, east_m, 5.0));
                let s = craft.state();
                if (20.0..130.0).contains(&s.east_m) {
                    square += s.north_m * s.north_m + (s.alt_amsl_m - 30.0).powi(2);
                    speed += s.vel_ned_m_s[1].abs();
                    count += 1.0;
                }
            }
        }
        let (rms_m, mean_m_s) = ((square / count).sqrt(), speed / count);
        println!("seed {seed}: {rms_m:.3} m off the line at {mean_m_s:.2} m/s");
        assert!(rms_m <= 0.5 && (mean_m_s - 5.0).abs() < 0.2);
    }
}

#[test]
fn estimates_the_wind_from_its_drag() {
    let mut weather = Weather::new(8.0, [0.0; 3], 3);
    let mut craft = airborne();
    let (mut north, mut east, mut count) = (0.0, 0.0, 0.0);
    for tick in 0..6000 {
        let state = craft.state();
        let (air, sensed) = weather.tick(&state);
        craft.fly(TICK_S, &air, &sensed, &at(0.0, 0.0, 5.0));
        if tick > 500 {
            let wind = craft.status().wind_estimate_m_s;
            north += wind[0] - air.wind_ned_m_s[0];
            east += wind[1] - air.wind_ned_m_s[1];
            count += 1.0;
        }
    }
    let off = (north / count, east / count);
    println!("{off:?} m/s");
    assert!(off.0.abs() < 0.2 && off.1.abs() < 0.2, "{off:?}");
}

#[test]
fn takes_off_flies_a_square_and_lands_at_home() {
    let mut weather = Weather::new(6.0, [0.03, 0.03, 0.05], 5);
    let mut craft = PilotedFlight::on_ground(&airframe(), 0.0, 0.0, 340.0, 90.0).unwrap();
    let mut fly = |craft: &mut PilotedFlight, demand: &Demand, seconds: f64| {
        for _ in 0..(seconds / TICK_S) as u32 {
            let state = craft.state();
            let (air, sensed) = weather.tick(&state);
            craft.fly(TICK_S, &air, &sensed, demand);
        }
        craft.state()
    };
    let demand = |path| Demand {
        path,
        alt_amsl_m: 380.0,
        airspeed_m_s: 6.0,
    };
    let state = fly(
        &mut craft,
        &demand(Path::GoTo {
            north_m: 0.0,
            east_m: 0.0,
        }),
        2.0,
    );
    assert_eq!(state.phase, FlightPhase::OnGround);
    let state = fly(
        &mut craft,
        &demand(Path::TakeOff { heading_deg: 0.0 }),
        30.0,
    );
    assert!((state.alt_amsl_m - 380.0).abs() < 1.0 && state.north_m.hypot(state.east_m) < 2.0);
    for (north_m, east_m) in [(50.0, 0.0), (50.0, 50.0), (0.0, 50.0), (0.0, 0.0)] {
        let state = fly(&mut craft, &demand(Path::GoTo { north_m, east_m }), 20.0);
        let off = (state.north_m - north_m).hypot(state.east_m - east_m);
        assert!(off < 1.0 && craft.status().path_done, "{off}");
    }
    let orbit = Path::Orbit {
        north_m: 0.0,
        east_m: 0.0,
        radius_m: 25.0,
        clockwise: true,
    };
    let state = fly(&mut craft, &demand(orbit), 30.0);
    let radius_m = state.north_m.hypot(state.east_m);
    assert!((radius_m - 25.0).abs() < 1.0, "{radius_m}");
    let land = Path::Land {
        north_m: 0.0,
        east_m: 0.0,
        ground_amsl_m: 340.0,
        course_deg: None,
    };
    let state = fly(&mut craft, &demand(land), 70.0);
    assert_eq!(state.phase, FlightPhase::OnGround);
    assert!(state.north_m.hypot(state.east_m) < 1.5 && !state.flags.hard_landing);
    assert!(craft.status().path_done);
}

#[test]
fn sticks_in_the_middle_hold_level_and_height() {
    let mut craft = airborne();
    let air = AirAround::STANDARD_CALM;
    let fly = |craft: &mut PilotedFlight, sticks: Sticks, seconds: f64| {
        for _ in 0..(seconds / TICK_S) as u32 {
            let sensed = Sensed::perfect(&craft.state(), 1.225);
            craft.fly_by_wire(TICK_S, &air, &sensed, &sticks);
        }
        craft.state()
    };
    let middle = Sticks {
        roll: 0.0,
        pitch: 0.0,
        throttle: 0.55,
    };
    let state = fly(&mut craft, middle, 10.0);
    assert!((state.alt_amsl_m - 30.0).abs() < 0.2 && state.roll_rad.abs() < 0.01);
    let state = fly(
        &mut craft,
        Sticks {
            roll: 0.3,
            ..middle
        },
        3.0,
    );
    assert!(
        (state.roll_rad.to_degrees() - 0.3 * 35.0).abs() < 1.0,
        "{state:?}"
    );
    let state = fly(
        &mut craft,
        Sticks {
            throttle: 1.0,
            ..middle
        },
        5.0,
    );
    assert!((state.vel_ned_m_s[2] + 3.0).abs() < 0.2, "{state:?}");
}

#[test]
fn no_command_or_air_makes_a_number_that_is_not_one() {
    let mut craft = airborne();
    for k in 0..3000 {
        let air = AirAround {
            wind_ned_m_s: if k % 3 == 0 {
                [f64::NAN, 1e300, -1e300]
            } else {
                [60.0, -80.0, 30.0]
            },
            density_kg_m3: f64::INFINITY,
        };
        let mut sensed = Sensed::perfect(&craft.state(), 1.2);
        if k % 5 == 0 {
            sensed.alt_amsl_m = f64::NAN;
        }
        craft.fly(TICK_S, &air, &sensed, &at(f64::INFINITY, 1e9, f64::NAN));
        let s = craft.state();
        assert!(
            [
                s.north_m,
                s.east_m,
                s.alt_amsl_m,
                s.roll_rad,
                s.airspeed_m_s
            ]
            .iter()
            .all(|v| v.is_finite())
        );
    }
}

/// By hand: hovering takes 5.06 N of each rotor, at CT 0.1290 551 rad/s or 87.7 revolutions a second; with CP 0.0524 each
/// shaft takes 1.225 · 87.7³ · 0.254⁵ · 0.0524 = 45.8 W, four over 0.75 and 12 W of avionics 256 W.
#[test]
fn power_in_hover() {
    let power_w = quad().level_power_w(0.0, 1.225).unwrap();
    assert!((power_w - 256.0).abs() < 1.0, "{power_w}");
    let fast_w = quad().level_power_w(12.0, 1.225).unwrap();
    assert!(fast_w > power_w, "{fast_w}");
}

#[test]
fn wrong_files_are_refused_with_their_line() {
    for (from, to, word) in [
        ("mass_kg = 2.064", "mass_kg = 9.0", "body.mass_kg"),
        ("ixx_kg_m2 = 0.0239", "ixx_kg_m2 = 23.9", "body.ixx_kg_m2"),
        ("max_rad_s = 716.0", "max_rad_s = -1.0", "rotors.max_rad_s"),
        (
            "tilt_max_deg = 35.0",
            "tilt_max_deg = 89.0",
            "limits.tilt_max_deg",
        ),
        (
            "type = \"multirotor\"",
            "type = \"helicopter\"",
            "multirotor",
        ),
    ] {
        assert!(QUAD.contains(from));
        let text = QUAD.replace(from, to);
        let error = Airframe::from_toml("quad.toml", &text)
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("quad.toml:") && error.contains(word),
            "{error}"
        );
    }
    let again = airframe().to_toml().unwrap();
    assert_eq!(
        Airframe::from_toml("again.toml", &again).unwrap(),
        airframe()
    );
}
