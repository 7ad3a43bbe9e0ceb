//! Speed of flight: one vehicle, against JSBSim with the same coefficients.
//!
//! `cargo bench -p fdm` runs all; JSBSim's figure comes from `benches/peers/jsbsim_loop.py` in the
//! same run when Python and the wheel are there (`pip install jsbsim`).
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;
use std::process::Command;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
use fdm::{AirAround, Aircraft, FlightSim, SurfaceCommand};

const AIR: AirAround = AirAround {
    wind_ned_m_s: [-2.0, 6.0, 0.1],
    density_kg_m3: 1.18,
};

fn x8() -> Arc<Aircraft> {
    Arc::new(Aircraft::from_toml("x8.toml", include_str!("../aircraft/x8.toml")).unwrap())
}

fn orbit() -> Demand {
    Demand {
        path: Path::Orbit {
            north_m: 0.0,
            east_m: 0.0,
            radius_m: 150.0,
            clockwise: true,
        },
        alt_amsl_m: 430.0,
        airspeed_m_s: 18.0,
    }
}

/// One RK4 step of 10 ms with servos, and the autopilot's loops with it.
fn single(c: &mut Criterion) {
    let aircraft = x8();
    let mut group = c.benchmark_group("one vehicle");
    group.throughput(Throughput::Elements(1));
    group.bench_function("RK4 step with actuators and loops", |b| {
        let mut sim = FlightSim::airborne(&aircraft, 0.0, 150.0, 400.0, 90.0, 18.0).unwrap();
        let mut pilot = Autopilot::new(&aircraft);
        let demand = orbit();
        b.iter(|| {
            let sensed = Sensed::perfect(&sim.state(), AIR.density_kg_m3);
            let command = pilot.command(0.01, &sensed, &demand);
            sim.step(0.01, black_box(&AIR), &command);
        });
    });
    group.bench_function("RK4 step with actuators", |b| {
        let mut sim = FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 90.0, 18.0).unwrap();
        let command = SurfaceCommand {
            elevator_rad: 0.03,
            throttle: 0.13,
            ..SurfaceCommand::default()
        };
        b.iter(|| sim.step(0.01, black_box(&AIR), &command));
    });
    group.bench_function("tick of 20 ms with loops", |b| {
        let mut sim = FlightSim::airborne(&aircraft, 0.0, 150.0, 400.0, 90.0, 18.0).unwrap();
        let mut pilot = Autopilot::new(&aircraft);
        let demand = orbit();
        b.iter(|| {
            let sensed = Sensed::perfect(&sim.state(), AIR.density_kg_m3);
            let command = pilot.command(0.02, &sensed, &demand);
            sim.step(0.02, black_box(&AIR), &command);
        });
    });
    group.finish();
}

/// JSBSim's own loop with the same coefficients, by its Python wheel.
fn jsbsim(_: &mut Criterion) {
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../benches/peers/jsbsim_loop.py"
    );
    match Command::new("python3").arg(script).output() {
        Ok(out) if out.status.success() => println!("{}", String::from_utf8_lossy(&out.stdout)),
        Ok(out) => println!(
            "JSBSim did not run: {}",
            String::from_utf8_lossy(&out.stderr)
        ),
        Err(error) => println!("JSBSim did not run: {error}"),
    }
}

criterion_group!(benches, single, jsbsim);
criterion_main!(benches);
