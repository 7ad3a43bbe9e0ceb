//! Channels that do not hold what their columns say: in another unit, with the other sign or in the wrong place, told by
//! what other channels must then read; or computed from others, not measured, beside which they tell nothing, and a fit
//! would take the agreement for a sensor without noise.

use super::channel::{ALL, CHANNELS, at};

/// Part of a channel's own spread within which it must agree with others to be taken for derived
/// from them: measured by sensors of their own, two channels differ by the noise of both, which is
/// a hundredth of the motion at the very least; numbers in a file are rounded to a thousandth.
const DERIVED_PART: f64 = 2e-3;
/// Fewest rows by which that is told, and by which a unit is.
const LEAST_ROWS: f64 = 20.0;
const LEAST_ROWS_OF_UNITS: f64 = 50.0;
/// Correlation of a rate with the change of its angle from which on it is that rate; that of a swapped one with the
/// change of the other angle, and by how much that is more.
const SAME: f64 = 0.7;
const SWAPPED: [f64; 2] = [0.8, 0.3];
/// Units that a rate may be in, each by what its angle changes by as a factor of it.
const RATE_UNITS: [(f64, &str); 2] = [(57.3, "rad/s"), (1.0 / 57.3, "deg/s twice converted")];
/// Units that an airspeed may be in, in m/s.
const SPEED_UNITS: [(f64, &str); 4] = [
    (0.514_444, "knots"),
    (0.277_778, "km/h"),
    (0.447_04, "miles an hour"),
    (0.3048, "feet a second"),
];
/// Logarithms by which the factor of a unit may be missed: of rates, and of airspeeds, which differ by the wind.
const RATE_MISS: f64 = 0.22;
const SPEED_MISS: f64 = 0.12;
/// Speed over ground as a part of the airspeed below which the airspeed is in another unit: wind alone makes the ratio
/// differ by a quarter only when no turn is flown.
const LEAST_GROUND_PART: f64 = 0.62;
/// Slowest mean speed over ground by which that is told, m/s.
const SLOWEST_M_S: f64 = 3.0;

/// Means of the products of pairs of values.
struct Pairs {
    n: f64,
    a: f64,
    b: f64,
    aa: f64,
    ab: f64,
    bb: f64,
}

impl Pairs {
    /// Of the pairs of which both are known.
    fn of(pairs: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut n, mut sums) = (0.0, [0.0; 5]);
        for (a, b) in pairs.filter(|(a, b)| a.is_finite() && b.is_finite()) {
            n += 1.0;
            for (sum, value) in sums.iter_mut().zip([a, b, a * a, a * b, b * b]) {
                *sum += value;
            }
        }
        let [a, b, aa, ab, bb] = sums.map(|s| s / n);
        Self {
            n,
            a,
            b,
            aa,
            ab,
            bb,
        }
    }

    /// Correlation of values that are nil in the mean.
    fn correlation(&self) -> f64 {
        self.ab / (self.aa * self.bb).sqrt()
    }

    /// Whether the second is so nearly the first times `slope` plus a constant, or plus `offset`, that it is derived.
    fn agrees(&self, slope: f64, offset: Option<f64>) -> bool {
        let mean = self.b - slope * self.a - offset.unwrap_or(self.b - slope * self.a);
        let spread = self.bb - self.b * self.b;
        let across = self.ab - self.a * self.b;
        let left = spread - 2.0 * slope * across + slope * slope * (self.aa - self.a * self.a);
        self.n >= LEAST_ROWS
            && spread > 1e-12 * self.bb
            && left + mean * mean < DERIVED_PART.powi(2) * spread
    }
}

/// Channels to mask, each with what was seen. `channels` are in SI.
pub fn suspected(
    time: &[f64],
    parts: &[(usize, usize)],
    channels: &[Vec<f64>],
) -> Vec<(usize, String)> {
    let rows: Vec<usize> = parts.iter().flat_map(|&(a, b)| a..b).collect();
    let mut found: Vec<(usize, String)> = (0..2)
        .filter_map(|k| rate(time, &rows, channels, k))
        .collect();
    found.extend(forces(&rows, channels));
    found.extend(speed(&rows, channels));
    found.extend(derived(&rows, channels));
    found
}

/// Roll or pitch rate against the change of its angle.
fn rate(time: &[f64], rows: &[usize], channels: &[Vec<f64>], k: usize) -> Option<(usize, String)> {
    let value = |k: usize, i: usize| {
        // Roll goes with p, pitch with q cos(roll).
        let part = if k == 1 {
            channels[at::ROLL][i].cos()
        } else {
            1.0
        };
        channels[at::ROLL_RATE + k][i] * part
    };
    let against = |angle: usize| {
        let slope = |i: usize| {
            // Over five rows, so that the noise of an angle does not hide its change.
            let (from, to) = (i.saturating_sub(2), (i + 2).min(time.len() - 1));
            let angles = &channels[at::ROLL + angle];
            (angles[to] - angles[from]) / (time[to] - time[from])
        };
        Pairs::of(rows.iter().map(|&i| (value(k, i), slope(i))))
    };
    let (own, other) = (against(k), against(1 - k).correlation().abs());
    let (gain, correlation) = (own.ab / own.aa, own.correlation());
    let unit = RATE_UNITS
        .iter()
        .find(|unit| (gain / unit.0).ln().abs() < RATE_MISS);
    let problem = if own.n < LEAST_ROWS_OF_UNITS {
        None
    } else if other > SWAPPED[0] && other > correlation.abs() + SWAPPED[1] {
        Some("follows the other angle: roll and pitch rate look swapped".to_owned())
    } else if correlation < -SAME {
        Some("runs against its angle: check its sign".to_owned())
    } else {
        let unit = unit.filter(|_| correlation > SAME);
        unit.map(|(_, unit)| format!("looks as if in {unit}: its angle changes {gain:.3} times it"))
    };
    let label = ALL[at::ROLL_RATE + k].label;
    problem.map(|problem| (at::ROLL_RATE + k, format!("{label} {problem}")))
}

/// The mean specific force down is minus gravity, more or less.
fn forces(rows: &[usize], channels: &[Vec<f64>]) -> Vec<(usize, String)> {
    let forces = rows.iter().map(|&i| (0.0, channels[at::FORCE + 2][i]));
    let Pairs { n, b: down, .. } = Pairs::of(forces);
    let gravity = air::STANDARD_GRAVITY_M_S2;
    if n < LEAST_ROWS_OF_UNITS {
        Vec::new()
    } else if (down - gravity).abs() < 0.4 * gravity {
        let words =
            format!("specific force down is {down:.1} m/s² on average: sign (up positive?)");
        vec![(at::FORCE + 2, words)]
    } else if (down.abs() - 1.0).abs() < 0.4 {
        let words = |k: usize| {
            format!(
                "{} looks as if in g: downwards {down:.2} on average",
                ALL[k].label
            )
        };
        (at::FORCE..at::FORCE + 3).map(|k| (k, words(k))).collect()
    } else {
        Vec::new()
    }
}

/// Speed over ground in the plane (2) or in space (3).
fn over_ground(channels: &[Vec<f64>], i: usize, axes: usize) -> f64 {
    let squares = (0..axes).map(|k| channels[at::VELOCITY + k][i].powi(2));
    squares.sum::<f64>().sqrt()
}

/// Airspeed against speed over ground, over a whole flight with turns.
fn speed(rows: &[usize], channels: &[Vec<f64>]) -> Option<(usize, String)> {
    let mean = |of: &dyn Fn(usize) -> f64| Pairs::of(rows.iter().map(|&i| (0.0, of(i))));
    let ground = mean(&|i| over_ground(channels, i, 3));
    let (ground_m_s, air_m_s) = (ground.b, mean(&|i| channels[at::AIRSPEED][i]).b);
    let ratio = ground_m_s / air_m_s;
    let near = |unit: &&(f64, &str)| (ratio / unit.0).ln().abs() < SPEED_MISS;
    let (_, unit) = SPEED_UNITS.iter().find(near)?;
    let is_told = ground.n >= LEAST_ROWS && ground_m_s >= SLOWEST_M_S && ratio < LEAST_GROUND_PART;
    let words = || {
        format!(
            "airspeed looks as if in {unit}: {air_m_s:.1} on average at {ground_m_s:.1} m/s over ground"
        )
    };
    is_told.then(|| (at::AIRSPEED, words()))
}

/// Channels that are derived, each with what it agrees with.
fn derived(rows: &[usize], channels: &[Vec<f64>]) -> Vec<(usize, String)> {
    let is_ground = |axes: usize| {
        let pair = |&i: &usize| (over_ground(channels, i, axes), channels[at::AIRSPEED][i]);
        Pairs::of(rows.iter().map(pair)).agrees(1.0, Some(0.0))
    };
    let words = "airspeed equals the speed over ground, so it is computed, not measured, and contains no wind";
    let ground = (is_ground(2) || is_ground(3)).then(|| (at::AIRSPEED, words.to_owned()));
    let copied = (1..CHANNELS).filter_map(|c| {
        let is_copy = |of: &usize| {
            let pairs = Pairs::of(rows.iter().map(|&i| (channels[*of][i], channels[c][i])));
            let spread = pairs.aa - pairs.a * pairs.a;
            spread > 1e-12 * pairs.aa && pairs.agrees((pairs.ab - pairs.a * pairs.b) / spread, None)
        };
        let of = (0..c).find(is_copy)?;
        let words = format!(
            "{} is {} in another form, computed and not measured",
            ALL[c].label, ALL[of].label
        );
        Some((c, words))
    });
    ground.into_iter().chain(copied).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(rows: usize, channels: &[Vec<f64>]) -> Vec<(usize, String)> {
        derived(&(0..rows).collect::<Vec<_>>(), channels)
    }

    /// Channels of so many rows, each with a motion of its own.
    fn channels(rows: usize) -> Vec<Vec<f64>> {
        let of = |c: usize| {
            (0..rows)
                .map(|i| 15.0 + (0.1 * (i as f64) * (1.0 + 0.37 * c as f64)).sin())
                .collect()
        };
        (0..CHANNELS).map(of).collect()
    }

    #[test]
    fn what_moves_by_itself_is_measured() {
        assert_eq!(found(400, &channels(400)), []);
        // Nothing at all is known of a few rows, or of columns that stand still.
        assert_eq!(found(5, &channels(5)), []);
        assert_eq!(found(400, &vec![vec![3.0; 400]; CHANNELS]), []);
    }

    #[test]
    fn ground_speed_and_copies_are_said() {
        let mut all = channels(400);
        for i in 0..400 {
            all[at::AIRSPEED][i] = (0..3)
                .map(|k| all[at::VELOCITY + k][i].powi(2))
                .sum::<f64>()
                .sqrt();
            all[at::BETA][i] = 0.3 - 2.0 * all[at::ALPHA][i];
        }
        let told = found(400, &all);
        let places: Vec<usize> = told.iter().map(|t| t.0).collect();
        assert_eq!(places, [at::AIRSPEED, at::BETA], "{told:?}");
    }
}
