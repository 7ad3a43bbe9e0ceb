//! Laws that hold whatever the coefficients: energy, momentum, the quaternion's norm, and the
//! order of the integration.

use fdm::dynamics::{AirState, Body, Controls, Dynamics, rotation};
use fdm::quaternion;
use fdm::{AirAround, Aircraft, FlightSim, SurfaceCommand};
use proptest::prelude::*;
use std::sync::Arc;

const G: f64 = 9.806_65;

fn x8() -> Arc<Aircraft> {
    Arc::new(Aircraft::from_toml("x8.toml", include_str!("../../../aircraft/x8.toml")).unwrap())
}

fn still_air(density: f64) -> AirState {
    AirState {
        wind_ned: [0.0; 3],
        density,
    }
}

/// Kinetic and potential energy, J.
fn energy(craft: &Aircraft, body: &Body) -> f64 {
    let b = &craft.body;
    let [p, q, r] = body.rate;
    let v2: f64 = body.vel_ned.iter().map(|v| v * v).sum();
    let turning =
        b.ixx_kg_m2 * p * p + b.iyy_kg_m2 * q * q + b.izz_kg_m2 * r * r - 2.0 * b.ixz_kg_m2 * p * r;
    0.5 * b.mass_kg * v2 + 0.5 * turning - b.mass_kg * G * body.pos_ned[2]
}

/// Angular momentum in NED, kg m²/s.
fn angular_momentum(craft: &Aircraft, body: &Body) -> [f64; 3] {
    let b = &craft.body;
    let [p, q, r] = body.rate;
    let h = [
        b.ixx_kg_m2 * p - b.ixz_kg_m2 * r,
        b.iyy_kg_m2 * q,
        b.izz_kg_m2 * r - b.ixz_kg_m2 * p,
    ];
    rotation(&body.attitude).map(|row| row[0] * h[0] + row[1] * h[1] + row[2] * h[2])
}

#[test]
fn in_vacuum_energy_and_angular_momentum_stay_and_the_path_is_a_parabola() {
    let craft = x8();
    let dynamics = Dynamics::new(&craft);
    let mut body = Body {
        pos_ned: [0.0, 0.0, -400.0],
        vel_ned: [10.0, -3.0, -5.0],
        attitude: quaternion(0.3, 0.2, 1.0),
        rate: [2.0, 3.0, -1.0],
    };
    let (e0, h0) = (energy(&craft, &body), angular_momentum(&craft, &body));
    let controls = Controls {
        elevator: 0.1,
        aileron: -0.1,
        rudder: 0.0,
        throttle: 0.5,
    };
    for _ in 0..500 {
        body = dynamics.rk4(&body, &[controls; 3], &still_air(0.0), 0.01).0;
    }
    assert!((energy(&craft, &body) / e0 - 1.0).abs() < 1e-8);
    for (now, before) in angular_momentum(&craft, &body).iter().zip(h0) {
        assert!((now - before).abs() < 1e-6, "{now} {before}");
    }
    let drop = -400.0 - 5.0 * 5.0 + 0.5 * G * 25.0;
    assert!((body.pos_ned[2] - drop).abs() < 1e-9);
    assert!((body.pos_ned[0] - 50.0).abs() < 1e-9 && (body.pos_ned[1] + 15.0).abs() < 1e-9);
}

/// In air, the change of energy is the work of the loads (force along the path, moment along the
/// rotation), integrated by Simpson's rule.
#[test]
fn in_air_the_change_of_energy_is_the_work_of_the_loads() {
    let craft = x8();
    let dynamics = Dynamics::new(&craft);
    let air = still_air(1.225);
    let controls = Controls {
        elevator: 0.0,
        aileron: 0.06,
        rudder: 0.0,
        throttle: 0.4,
    };
    let mut body = Body {
        pos_ned: [0.0, 0.0, -400.0],
        vel_ned: [18.0, 0.5, 0.0],
        attitude: quaternion(0.1, 0.05, 0.0),
        rate: [0.1, 0.0, 0.0],
    };
    let power = |body: &Body| {
        let m = rotation(&body.attitude);
        let flow = fdm::dynamics::flow(&m, &body.vel_ned, &air.wind_ned);
        let (force, moment) = dynamics.load(&flow, &body.rate, &controls, air.density);
        (0..3)
            .map(|k| force[k] * flow.body[k] + moment[k] * body.rate[k])
            .sum::<f64>()
    };
    let e0 = energy(&craft, &body);
    let (dt, mut work) = (0.002, 0.0);
    for _ in 0..1000 {
        let before = power(&body);
        let middle = dynamics.rk4(&body, &[controls; 3], &air, 0.5 * dt).0;
        body = dynamics.rk4(&body, &[controls; 3], &air, dt).0;
        work += dt / 6.0 * (before + 4.0 * power(&middle) + power(&body));
    }
    let change = energy(&craft, &body) - e0;
    assert!(change.abs() > 1.0);
    assert!(
        (work - change).abs() < 1e-6 * change.abs(),
        "{work} {change}"
    );
}

#[test]
fn convergence_is_of_fourth_order_under_smooth_inputs() {
    let dynamics = Dynamics::new(&x8());
    let controls = |t: f64| Controls {
        elevator: 0.037 + 0.03 * (3.0 * t).sin(),
        aileron: 0.05 * (2.0 * t).sin(),
        rudder: 0.0,
        throttle: 0.12 + 0.05 * t.sin(),
    };
    let end = |steps: u32| {
        let dt = 2.0 / f64::from(steps);
        let mut body = Body {
            pos_ned: [0.0; 3],
            vel_ned: [18.0, 0.0, 0.0],
            attitude: quaternion(0.0, 0.0308, 0.0),
            rate: [0.0; 3],
        };
        for k in 0..steps {
            let t = f64::from(k) * dt;
            let inputs = [controls(t), controls(t + 0.5 * dt), controls(t + dt)];
            body = dynamics.rk4(&body, &inputs, &still_air(1.225), dt).0;
        }
        [body.pos_ned, body.vel_ned, body.rate].concat()
    };
    let best = end(12_800);
    let error = |steps| {
        end(steps)
            .iter()
            .zip(&best)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let errors: Vec<f64> = [100, 200, 400, 800].into_iter().map(error).collect();
    println!("errors at 20, 10, 5, 2.5 ms: {errors:?}");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((3.7..4.6).contains(&order), "order {order} of {errors:?}");
    }
    // 20 ms, the longest step used, is within 0.01 mm, mm/s and mrad/s of the solution after 2 s.
    assert!(errors[0] < 1e-5);
}

/// Servos, fourth-order steps and held commands together: 20 ms against 0.5 ms.
#[test]
fn the_longest_step_is_enough_with_the_servos() {
    let craft = x8();
    let mut coarse = FlightSim::airborne(&craft, 0.0, 0.0, 400.0, 0.0, 18.0).unwrap();
    let mut fine = coarse.clone();
    for tick in 0..500 {
        let phase = f64::from(tick) * 0.02;
        let command = SurfaceCommand {
            elevator_rad: 0.037 + 0.03 * (4.0 * phase).sin(),
            aileron_rad: 0.04 * (3.0 * phase).sin(),
            throttle: 0.15,
            ..SurfaceCommand::default()
        };
        coarse.step(0.02, &AirAround::STANDARD_CALM, &command);
        for _ in 0..40 {
            fine.step(0.0005, &AirAround::STANDARD_CALM, &command);
        }
    }
    let (a, b) = (coarse.state(), fine.state());
    let off = (a.north_m - b.north_m)
        .hypot(a.east_m - b.east_m)
        .hypot(a.alt_amsl_m - b.alt_amsl_m);
    let turned = (a.roll_rad - b.roll_rad).hypot(a.pitch_rad - b.pitch_rad);
    println!("after 10 s: {off:.5} m, {:.5} deg", turned.to_degrees());
    assert!(off < 0.01 && turned.to_degrees() < 0.01);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn flight_stays_finite_and_the_quaternion_of_norm_one(
        wind in prop::array::uniform3(-40.0..40.0_f64),
        density in 0.3..1.5_f64,
        commands in prop::collection::vec(prop::array::uniform4(-1.5..1.5_f64), 1..40),
        dt in 0.001..0.2_f64,
    ) {
        let mut sim = FlightSim::airborne(&x8(), 0.0, 0.0, 400.0, 45.0, 18.0).unwrap();
        sim.set_ground_amsl_m(350.0);
        for c in commands {
            let command = SurfaceCommand {
                elevator_rad: c[0],
                aileron_rad: c[1],
                rudder_rad: c[2],
                throttle: c[3],
                launch: c[3] > 1.0,
            };
            let air = AirAround { wind_ned_m_s: wind, density_kg_m3: density };
            for _ in 0..20 {
                sim.step(dt, &air, &command);
            }
            let s = sim.state();
            let norm: f64 = s.attitude.iter().map(|q| q * q).sum();
            prop_assert!((norm - 1.0).abs() < 1e-9);
            let numbers = [s.north_m, s.east_m, s.alt_amsl_m, s.roll_rad, s.pitch_rad, s.yaw_rad,
                s.airspeed_m_s, s.alpha_rad, s.beta_rad, s.elevator_rad, s.throttle];
            prop_assert!(numbers.iter().chain(&s.vel_ned_m_s).chain(&s.rate_rad_s)
                .chain(&s.specific_force_m_s2).all(|v| v.is_finite()));
            prop_assert!(s.alt_amsl_m >= 349.0);
        }
    }
}
