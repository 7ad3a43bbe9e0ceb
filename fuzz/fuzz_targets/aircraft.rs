//! Aircraft files: no panic, an accepted one, written, is the same aircraft, and one that can fly level flies on for two
//! seconds with numbers.

#![no_main]

use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
use fdm::{AirAround, Aircraft, FlightSim};
use libfuzzer_sys::fuzz_target;
use std::sync::Arc;

fuzz_target!(|text: &str| {
    let aircraft = match Aircraft::from_toml("fuzz.toml", text) {
        Ok(aircraft) => Arc::new(aircraft),
        Err(refused) => {
            assert!(refused.to_string().starts_with("fuzz.toml"), "{refused}");
            return;
        }
    };
    let again = aircraft.to_toml().and_then(|text| Aircraft::from_toml("written.toml", &text));
    assert_eq!(again.as_ref(), Ok(&*aircraft));
    let speed_m_s = aircraft.limits.airspeed_cruise_m_s;
    let Ok(mut sim) = FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 0.0, speed_m_s) else {
        return;
    };
    let mut autopilot = Autopilot::new(&aircraft);
    let (air, dt_s) = (AirAround::STANDARD_CALM, 0.02);
    let demand = Demand {
        path: Path::Course { deg: 90.0 },
        alt_amsl_m: 430.0,
        airspeed_m_s: speed_m_s,
    };
    for _ in 0..100 {
        let sensed = Sensed::perfect(&sim.state(), air.density_kg_m3);
        let command = autopilot.command(dt_s, &sensed, &demand);
        sim.step(dt_s, &air, &command);
    }
    let state = sim.state();
    assert!(state.alt_amsl_m.is_finite() && state.yaw_rad.is_finite(), "{text}");
});
