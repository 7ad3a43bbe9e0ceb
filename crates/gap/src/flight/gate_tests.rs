//! What holds of any log: it is refused with a reason, or what is told of it at once is credible.

use fdm::Aircraft;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::equation_error::{self, EquationError};
use super::gate;
use super::log::FlightLog;
use super::study::Study;

/// Nats that no delay has: ten thousand seconds of readings, each at three standard errors.
const MOST_NATS: f64 = 1e5;

fn ultra_stick() -> Aircraft {
    let text = include_str!("../../../../aircraft/ultrastick-25e.toml");
    Aircraft::from_toml("ultrastick-25e.toml", text).unwrap()
}

/// How a log is made.
struct Made {
    rows: usize,
    interval_s: f64,
    /// Rounding of every column.
    step: f64,
    /// Whether the surfaces move.
    flown: bool,
    /// Every so many-th row is the one before again.
    again: usize,
    /// Whether airspeed is the speed over ground.
    derived: bool,
}

const HEADER: &str = "time_s,airspeed_m_s,angle_of_attack_deg,roll_deg,pitch_deg,roll_rate_deg_s,\
    pitch_rate_deg_s,yaw_rate_deg_s,elevator_deg,aileron_left_deg,aileron_right_deg,rudder_deg,\
    vel_north_m_s,vel_east_m_s,vel_down_m_s";

/// A log whose rates follow the surfaces through first-order lags, with noise.
fn text(made: &Made, seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sd: f64| sd * random.random_range(-1.7..1.7);
    let mut text = HEADER.to_owned();
    let (mut rate, mut angle) = ([0.0; 3], [0.0; 2]);
    let mut before = String::new();
    for i in 0..made.rows {
        let time = made.interval_s * i as f64;
        let told = |k: f64| {
            if made.flown {
                5.0 * (1.3 * k * time).sin() + 3.0 * (3.1 * k * time).sin()
            } else {
                0.0
            }
        };
        let surfaces = [told(1.0), -told(0.7), told(0.4)];
        let keep = (-made.interval_s / 0.15).exp();
        for k in 0..3 {
            rate[k] = keep * rate[k] + (1.0 - keep) * 6.0 * surfaces[k] + noise(0.5);
        }
        for k in 0..2 {
            angle[k] += made.interval_s * (rate[k] - 0.2 * angle[k]);
        }
        let north = 18.0 + told(0.2) + noise(0.3);
        let (east, down) = (2.0 + noise(0.3), noise(0.3));
        let ground = (north * north + east * east + down * down).sqrt();
        let airspeed = if made.derived {
            ground
        } else {
            18.0 + noise(0.5)
        };
        let alpha = 3.0 + 0.1 * surfaces[1] + noise(0.4);
        let values = [
            airspeed,
            alpha,
            angle[0],
            angle[1],
            rate[0],
            rate[1],
            rate[2],
            surfaces[1],
            -surfaces[0],
            surfaces[0],
            surfaces[2],
            north,
            east,
            down,
        ];
        let cells: Vec<String> = values
            .iter()
            .map(|v| {
                // A channel that is computed is not rounded again.
                let rounded = if made.step > 0.0 {
                    (v / made.step).round() * made.step
                } else {
                    *v
                };
                format!("{rounded}")
            })
            .collect();
        if made.again == 0 || i % made.again != 1 {
            before = cells.join(",");
        }
        text += &format!("\n{time},{before}");
    }
    text
}

/// What accelerations tell of a log, or why it is refused.
fn told(made: &Made, seed: u64) -> Result<(EquationError, gate::Gated), String> {
    let aircraft = ultra_stick();
    let log = FlightLog::parse("made.csv", &text(made, seed)).map_err(|e| e.to_string())?;
    let gated = gate::pass(&[log], &aircraft).map_err(|e| e.to_string())?;
    let equations = {
        let study = Study::new(&aircraft, &gated, 1);
        let theta = study.start();
        let world = |s| study.world(s, &theta);
        let worlds: Vec<_> = gated.segments.iter().map(world).collect();
        equation_error::analyse(&gated.segments, &worlds, &aircraft)
    };
    Ok((equations, gated))
}

#[test]
fn any_log_is_refused_or_told_credibly() {
    for seed in 0..60 {
        let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
        let made = Made {
            rows: random.random_range(20..1500),
            interval_s: [0.01, 0.02, 0.04, 0.05, 0.1, 0.2, 0.4][random.random_range(0..7)],
            step: [0.0, 0.001, 0.1, 1.0, 5.0][random.random_range(0..5)],
            flown: random.random_range(0..4) > 0,
            again: [0, 2, 3, 10][random.random_range(0..4)],
            derived: random.random_range(0..3) == 0,
        };
        let Ok((equations, gated)) = told(&made, seed) else {
            continue;
        };
        assert!(made.interval_s <= 0.11, "seed {seed}");
        if !gated.tells_delays {
            continue;
        }
        for delay in &equations.delays {
            assert!(made.flown, "seed {seed}: {delay:?}");
            // A row's spacing, uniform, over at most 150 blocks.
            let least_s = made.interval_s / (12.0_f64 * 150.0).sqrt();
            assert!(delay.moment_delay_se_s >= least_s, "seed {seed}: {delay:?}");
            let nats = 0.5 * (delay.moment_delay_s / delay.moment_delay_se_s).powi(2);
            assert!(nats < MOST_NATS, "seed {seed}: {delay:?}");
        }
        for moment in &equations.moments {
            assert!(
                moment.held_out_leaves.is_finite(),
                "seed {seed}: {moment:?}"
            );
        }
    }
}

const USUAL: Made = Made {
    rows: 1500,
    interval_s: 0.02,
    step: 0.0,
    flown: true,
    again: 0,
    derived: false,
};

#[test]
fn sparse_rows_are_refused_and_delays_need_twenty_a_second() {
    let sparse = Made {
        interval_s: 0.4,
        ..USUAL
    };
    let words = told(&sparse, 1).unwrap_err();
    assert!(words.contains("0.40 s apart"), "{words}");
    let (_, gated) = told(
        &Made {
            interval_s: 0.1,
            ..USUAL
        },
        1,
    )
    .unwrap();
    assert!(!gated.tells_delays, "{:?}", gated.notices);
    let (_, gated) = told(&USUAL, 1).unwrap();
    assert!(gated.tells_delays);
}

#[test]
fn a_surface_that_does_not_move_has_no_delay() {
    let (equations, _) = told(
        &Made {
            flown: false,
            ..USUAL
        },
        1,
    )
    .unwrap();
    assert_eq!(equations.delays, []);
    assert_eq!(equations.late(), None);
}

#[test]
fn airspeed_from_ground_speed_is_masked() {
    use super::channel::at;
    let (_, gated) = told(
        &Made {
            derived: true,
            ..USUAL
        },
        1,
    )
    .unwrap();
    assert!(!gated.present[at::AIRSPEED]);
    assert!(
        gated
            .data_quality
            .iter()
            .any(|f| f.message.contains("speed over ground"))
    );
    assert!(told(&USUAL, 1).unwrap().1.present[at::AIRSPEED]);
}
