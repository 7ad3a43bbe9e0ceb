//! Channels whose unit, sign or place looks wrong, told by what other channels must then read.

use super::channel::{ALL, at};
use super::log::FlightLog;

/// Degrees in a radian.
const DEG_PER_RAD: f64 = 180.0 / std::f64::consts::PI;
/// Units that an airspeed may be in, in m/s.
const SPEED_UNITS: [(f64, &str); 4] = [
    (0.514_444, "knots"),
    (0.277_778, "km/h"),
    (0.447_04, "miles an hour"),
    (0.3048, "feet a second"),
];

/// Channels to mask, each with what was seen. `channels` are in SI.
pub fn suspected(
    log: &FlightLog,
    parts: &[(usize, usize)],
    channels: &[Vec<f64>],
) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    rates(log, parts, channels, &mut found);
    forces(parts, channels, &mut found);
    speeds(parts, channels, &mut found);
    found
}

/// Sum over the parts of what `f` gives of a row, for rows where it is finite, and their number.
fn mean(parts: &[(usize, usize)], f: impl Fn(usize) -> f64) -> (f64, usize) {
    let values = parts.iter().flat_map(|&(a, b)| a..b).map(f);
    let (sum, count) = values
        .filter(|v| v.is_finite())
        .fold((0.0, 0), |(s, n), v| (s + v, n + 1));
    (sum / count.max(1) as f64, count)
}

/// Rates against the change of the angles.
fn rates(
    log: &FlightLog,
    parts: &[(usize, usize)],
    channels: &[Vec<f64>],
    found: &mut Vec<(usize, String)>,
) {
    let time = log.time_s();
    let roll = &channels[at::ROLL];
    let slope = |k: usize, i: usize| {
        // Over five rows, so that the noise of an angle does not hide its change.
        let angle = &channels[at::ROLL + k];
        (angle[(i + 2).min(angle.len() - 1)] - angle[i.saturating_sub(2)])
            / (time[(i + 2).min(time.len() - 1)] - time[i.saturating_sub(2)])
    };
    // Which rate each change of angle goes with: roll with p; pitch with q cos(roll).
    let rate = |k: usize, i: usize| {
        let value = channels[at::ROLL_RATE + k][i];
        if k == 1 { value * roll[i].cos() } else { value }
    };
    let regression = |angle: usize, gyro: usize| {
        let (xy, n) = mean(parts, |i| slope(angle, i) * rate(gyro, i));
        let (xx, _) = mean(parts, |i| rate(gyro, i).powi(2));
        let (yy, _) = mean(parts, |i| slope(angle, i).powi(2));
        (xy / xx, xy / (xx * yy).sqrt(), n)
    };
    for k in 0..2 {
        let (gain, correlation, n) = regression(k, k);
        let (_, other, _) = regression(k, 1 - k);
        if n < 50 {
            continue;
        }
        let label = ALL[at::ROLL_RATE + k].label;
        let problem = if other.abs() > 0.8 && other.abs() > correlation.abs() + 0.3 {
            Some("follows the other angle: roll and pitch rate look swapped".to_owned())
        } else if correlation < -0.7 {
            Some("runs against its angle: check its sign".to_owned())
        } else if correlation > 0.7 {
            factor(
                gain,
                &[
                    (DEG_PER_RAD, "rad/s"),
                    (1.0 / DEG_PER_RAD, "deg/s twice converted"),
                ],
            )
            .map(|unit| format!("looks as if in {unit}: its angle changes {gain:.3} times it"))
        } else {
            None
        };
        if let Some(problem) = problem {
            found.push((at::ROLL_RATE + k, format!("{label} {problem}")));
        }
    }
}

/// Name of the unit whose factor `gain` is, within 25 %.
fn factor<'a>(gain: f64, units: &[(f64, &'a str)]) -> Option<&'a str> {
    let near = |unit: &&(f64, &str)| (gain / unit.0).ln().abs() < 0.22;
    units.iter().find(near).map(|unit| unit.1)
}

/// The mean specific force down is minus gravity, more or less.
fn forces(parts: &[(usize, usize)], channels: &[Vec<f64>], found: &mut Vec<(usize, String)>) {
    let (down, n) = mean(parts, |i| channels[at::FORCE + 2][i]);
    if n < 50 {
        return;
    }
    let gravity = air::STANDARD_GRAVITY_M_S2;
    if (down - gravity).abs() < 0.4 * gravity {
        found.push((
            at::FORCE + 2,
            format!("specific force down is {down:.1} m/s² on average: sign (up positive?)"),
        ));
    } else if (down.abs() - 1.0).abs() < 0.4 {
        for k in 0..3 {
            let message = format!(
                "{} looks as if in g: downwards {down:.2} on average",
                ALL[at::FORCE + k].label
            );
            found.push((at::FORCE + k, message));
        }
    }
}

/// Airspeed against speed over ground, over a whole flight with turns.
fn speeds(parts: &[(usize, usize)], channels: &[Vec<f64>], found: &mut Vec<(usize, String)>) {
    let ground = |i: usize| {
        (0..3)
            .map(|k| channels[at::VELOCITY + k][i].powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let (over_ground, n) = mean(parts, ground);
    let (through_air, _) = mean(parts, |i| channels[at::AIRSPEED][i]);
    if n < 20 || over_ground < 3.0 {
        return;
    }
    let ratio = over_ground / through_air;
    // Wind alone makes the ratio differ by a quarter only when no turn is flown.
    let near = SPEED_UNITS
        .iter()
        .find(|(unit, _)| (ratio / unit).ln().abs() < 0.12);
    if let Some((_, unit)) = near.filter(|_| ratio < 0.62) {
        let message = format!(
            "airspeed looks as if in {unit}: {through_air:.1} on average at {over_ground:.1} m/s \
             over ground"
        );
        found.push((at::AIRSPEED, message));
    }
}
