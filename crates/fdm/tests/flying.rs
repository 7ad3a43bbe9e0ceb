//! The whole aircraft with its loops: holds what it is told, in calm air and in gusts.

use air::dryden::{Dryden, Turbulence};
use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
use fdm::{AirAround, Aircraft, FlightPhase, FlightSim, FlightState};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use std::sync::Arc;

const TICK_S: f64 = 0.02;
const X8: &str = include_str!("../../../aircraft/x8.toml");
const ULTRA_STICK: &str = include_str!("../../../aircraft/ultrastick-25e.toml");

fn x8() -> Arc<Aircraft> {
    Arc::new(Aircraft::from_toml("x8.toml", X8).unwrap())
}

/// A day: steady wind and gusts of MIL-F-8785C for the wind at 20 ft.
struct Day {
    wind_ned: [f64; 3],
    gusts: Option<(Dryden, Turbulence, ChaCha8Rng)>,
}

impl Day {
    fn calm() -> Self {
        Self {
            wind_ned: [0.0; 3],
            gusts: None,
        }
    }

    fn windy(north_m_s: f64, east_m_s: f64, seed: u64) -> Self {
        let speed = north_m_s.hypot(east_m_s);
        Self {
            wind_ned: [north_m_s, east_m_s, 0.0],
            gusts: Some((
                Dryden::new(),
                Turbulence::mil_f_8785c(100.0, speed, 1.0),
                ChaCha8Rng::seed_from_u64(seed),
            )),
        }
    }

    fn air(&mut self, airspeed_m_s: f64) -> AirAround {
        let mut wind = self.wind_ned;
        if let Some((dryden, turbulence, rng)) = &mut self.gusts {
            let gust = dryden.step(TICK_S, airspeed_m_s, turbulence, rng);
            for k in 0..3 {
                wind[k] += gust[k];
            }
        }
        AirAround {
            wind_ned_m_s: wind,
            density_kg_m3: 1.18,
        }
    }
}

struct Flown {
    sim: FlightSim,
    pilot: Autopilot,
    day: Day,
    time_s: f64,
}

impl Flown {
    fn tick(&mut self, demand: &Demand) -> FlightState {
        let state = self.sim.state();
        let air = self.day.air(state.airspeed_m_s);
        let sensed = Sensed::perfect(&state, air.density_kg_m3);
        let command = self.pilot.command(TICK_S, &sensed, demand);
        self.sim.step(TICK_S, &air, &command);
        self.time_s += TICK_S;
        self.sim.state()
    }
}

fn airborne(day: Day) -> Flown {
    let aircraft = x8();
    Flown {
        sim: FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 0.0, 18.0).unwrap(),
        pilot: Autopilot::new(&aircraft),
        day,
        time_s: 0.0,
    }
}

#[test]
fn climbs_and_holds_altitude_and_airspeed_in_calm_air() {
    let mut flown = airborne(Day::calm());
    let demand = Demand {
        path: Path::Heading { deg: 90.0 },
        alt_amsl_m: 430.0,
        airspeed_m_s: 18.0,
    };
    let mut slowest: f64 = 99.0;
    let mut highest: f64 = 0.0;
    for _ in 0..3000 {
        let state = flown.tick(&demand);
        slowest = slowest.min(state.airspeed_m_s);
        highest = highest.max(state.alt_amsl_m);
    }
    let state = flown.sim.state();
    assert!((state.alt_amsl_m - 430.0).abs() < 0.3, "{state:?}");
    assert!((state.airspeed_m_s - 18.0).abs() < 0.1, "{state:?}");
    assert!((state.yaw_rad.to_degrees() - 90.0).abs() < 0.5);
    assert!(highest < 433.0 && slowest > 16.0, "{highest} {slowest}");
}

#[test]
fn orbits_in_gusts() {
    let mut flown = airborne(Day::windy(0.0, 7.0, 1));
    let demand = Demand {
        path: Path::Orbit {
            north_m: 200.0,
            east_m: 100.0,
            radius_m: 120.0,
            clockwise: true,
        },
        alt_amsl_m: 420.0,
        airspeed_m_s: 18.0,
    };
    let (mut worst_radius, mut worst_height): (f64, f64) = (0.0, 0.0);
    for k in 0..12_000 {
        let state = flown.tick(&demand);
        assert!(!state.flags.stalled, "stalled at {} s", flown.time_s);
        if k > 3000 {
            let radius = (state.north_m - 200.0).hypot(state.east_m - 100.0);
            worst_radius = worst_radius.max((radius - 120.0).abs());
            worst_height = worst_height.max((state.alt_amsl_m - 420.0).abs());
        }
    }
    println!("radius within {worst_radius:.1} m, height within {worst_height:.1} m");
    assert!(worst_radius < 12.0 && worst_height < 8.0);
}

#[test]
fn reaches_a_point_across_the_wind_on_a_straight_track_and_circles_it() {
    let mut flown = airborne(Day::windy(0.0, 9.0, 3));
    let demand = Demand {
        path: Path::GoTo {
            north_m: 1500.0,
            east_m: 0.0,
        },
        alt_amsl_m: 400.0,
        airspeed_m_s: 18.0,
    };
    let mut off_track: f64 = 0.0;
    let mut reached = None;
    for _ in 0..9000 {
        let state = flown.tick(&demand);
        let gone = (state.north_m - 1500.0).hypot(state.east_m);
        if reached.is_none() {
            off_track = off_track.max(state.east_m.abs());
        }
        if gone < 110.0 && reached.is_none() {
            reached = Some(flown.time_s);
        }
        if reached.is_some_and(|t| flown.time_s > t + 20.0) {
            assert!((85.0..120.0).contains(&gone), "{gone}");
        }
    }
    assert!(flown.pilot.status().path_done);
    // Ground speed across 9 m/s is sqrt(18² − 9²) = 15.6 m/s: 1390 m take 89 s.
    let time = reached.unwrap();
    println!("reached in {time:.1} s, {off_track:.1} m off the straight line");
    assert!(time < 105.0 && off_track < 40.0);
}

#[test]
fn takes_off_and_lands_at_home_in_gusts() {
    for seed in 1..=8 {
        // Even seeds fly the aircraft with a tail.
        let text = if seed % 2 == 0 { ULTRA_STICK } else { X8 };
        let aircraft = Arc::new(Aircraft::from_toml("aircraft", text).unwrap());
        let mut flown = Flown {
            sim: FlightSim::on_ground(&aircraft, 0.0, 0.0, 340.0, 270.0).unwrap(),
            pilot: Autopilot::new(&aircraft),
            day: Day::windy(0.0, 5.0, seed),
            time_s: 0.0,
        };
        let mut demand = Demand {
            path: Path::TakeOff { heading_deg: 270.0 },
            alt_amsl_m: 420.0,
            airspeed_m_s: 18.0,
        };
        while flown.time_s < 60.0 {
            let state = flown.tick(&demand);
            assert!(flown.time_s < 2.0 || state.phase == FlightPhase::Flying);
        }
        assert!((flown.sim.state().alt_amsl_m - 420.0).abs() < 8.0);
        demand.path = Path::Land {
            north_m: 0.0,
            east_m: 0.0,
            ground_amsl_m: 340.0,
            course_deg: None,
        };
        while flown.sim.state().phase == FlightPhase::Flying && flown.time_s < 600.0 {
            flown.tick(&demand);
        }
        let touch = flown.sim.state();
        for _ in 0..500 {
            flown.tick(&demand);
        }
        let state = flown.sim.state();
        println!(
            "seed {seed}: touch-down at {:.1} m after {:.0} s, at rest {:.1} m from home, {:?}",
            touch.north_m.hypot(touch.east_m),
            flown.time_s,
            state.north_m.hypot(state.east_m),
            state.flags
        );
        assert_eq!(state.phase, FlightPhase::OnGround);
        assert!(!state.flags.hard_landing);
        assert!(state.north_m.hypot(state.east_m) < 40.0);
        assert!(flown.pilot.status().path_done);
    }
}

#[test]
fn no_command_or_air_makes_a_number_that_is_not_one() {
    let aircraft = x8();
    let mut sim = FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 0.0, 18.0).unwrap();
    let bad = AirAround {
        wind_ned_m_s: [f64::NAN, 1e300, -1e300],
        density_kg_m3: f64::INFINITY,
    };
    let mad = fdm::SurfaceCommand {
        elevator_rad: -1e300,
        aileron_rad: f64::NAN,
        rudder_rad: f64::INFINITY,
        throttle: 1e9,
        launch: true,
    };
    for k in 0..3000 {
        let air = if k % 3 == 0 {
            bad
        } else {
            AirAround {
                wind_ned_m_s: [60.0 * f64::from(k % 5), -80.0, 300.0],
                density_kg_m3: 1.2,
            }
        };
        sim.step(TICK_S, &air, &mad);
        let s = sim.state();
        let numbers = [
            s.north_m,
            s.east_m,
            s.alt_amsl_m,
            s.roll_rad,
            s.pitch_rad,
            s.yaw_rad,
            s.airspeed_m_s,
            s.alpha_rad,
            s.beta_rad,
        ];
        assert!(numbers.iter().all(|v| v.is_finite()), "{s:?}");
        assert!((s.attitude.iter().map(|q| q * q).sum::<f64>() - 1.0).abs() < 1e-12);
    }
    assert!(sim.state().flags.stalled || sim.state().flags.outside_model);
}

/// Commanded far outside what it can do, the autopilot keeps airspeed, bank and pitch inside the
/// limits.
#[test]
fn protects_from_stall_and_overspeed() {
    for (alt_amsl_m, airspeed_m_s) in [(900.0, 5.0), (900.0, 60.0), (100.0, 60.0), (100.0, 5.0)] {
        let mut flown = airborne(Day::windy(5.0, 0.0, 9));
        let demand = Demand {
            path: Path::Orbit {
                north_m: 0.0,
                east_m: 0.0,
                radius_m: 10.0,
                clockwise: false,
            },
            alt_amsl_m,
            airspeed_m_s,
        };
        for _ in 0..3000 {
            let state = flown.tick(&demand);
            assert!(!state.flags.stalled, "{demand:?} at {} s", flown.time_s);
            assert!(state.roll_rad.to_degrees().abs() < 50.0);
            assert!(
                (10.5..31.0).contains(&state.airspeed_m_s),
                "{}",
                state.airspeed_m_s
            );
        }
    }
}

/// An aircraft built crooked flies straight: the integrals find the trim and do not wind up while
/// the demand cannot be met.
#[test]
fn integrals_trim_a_crooked_aircraft_and_do_not_wind_up() {
    let crooked = format!(
        "{X8}\n[[mechanism]]\nid = \"surface-trim-offset\"\nelevator_deg = 3.0\naileron_deg = 2.0\n\
         [[mechanism]]\nid = \"thrust-loss\"\nlost_share = 0.2\n"
    );
    let aircraft = Arc::new(Aircraft::from_toml("crooked", &crooked).unwrap());
    let mut flown = airborne(Day::calm());
    flown.sim = FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 0.0, 18.0).unwrap();
    let mut demand = Demand {
        path: Path::Heading { deg: 0.0 },
        alt_amsl_m: 2000.0,
        airspeed_m_s: 27.0,
    };
    for _ in 0..3000 {
        flown.tick(&demand);
    }
    let height = flown.sim.state().alt_amsl_m;
    demand.alt_amsl_m = height;
    demand.airspeed_m_s = 18.0;
    let mut overshoot: f64 = 0.0;
    for _ in 0..3000 {
        overshoot = overshoot.max(flown.tick(&demand).alt_amsl_m - height);
    }
    let state = flown.sim.state();
    println!("overshoot {overshoot:.1} m");
    assert!(overshoot < 15.0);
    assert!((state.alt_amsl_m - height).abs() < 0.5, "{state:?}");
    assert!((state.airspeed_m_s - 18.0).abs() < 0.2);
    assert!(state.yaw_rad.to_degrees().abs() < 1.0 && state.roll_rad.to_degrees().abs() < 0.5);
}
