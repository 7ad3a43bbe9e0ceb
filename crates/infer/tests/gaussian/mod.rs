//! A Gaussian plume of the tests' own, and realities that depart from it.

use infer::{AxisTurn, ForwardModel, InferError, PlumePlace, Prediction, Prior, Rows};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// East, north and height of a row, m, and its time, s.
pub type Row = [f64; 4];

/// Where the concentration is asked: on the true axis 1000 m from the source.
pub const PEAK: [f64; 3] = [951.056_516, 309.016_994, 540.0];

const TRUTH: [f64; 6] = [
    72.0,
    540.0,
    6.214_608_098,
    0.223_143_551,
    -0.162_518_929,
    446.0,
];
const PRIORS: [Prior; 6] = [
    Prior {
        mean: 60.0,
        sd: 12.0,
    },
    Prior {
        mean: 486.0,
        sd: 50.0,
    },
    Prior {
        mean: 6.016_157_16,
        sd: 0.3,
    },
    Prior { mean: 0.0, sd: 0.3 },
    Prior { mean: 0.0, sd: 0.3 },
    Prior {
        mean: 449.0,
        sd: 4.0,
    },
];

/// How a reality departs from the model.
#[derive(Debug, Clone, Default)]
pub struct Reality {
    pub growth: f64,
    pub class_b: bool,
    pub decay_s: f64,
    pub trend_h: f64,
    pub veer_deg_100m: f64,
    pub swing_deg: f64,
    pub wake_m2: f64,
    pub second: bool,
    pub intermittent: f64,
    pub wander_deg: f64,
}

pub fn realities() -> Vec<(&'static str, Reality)> {
    let d = Reality::default;
    vec![
        ("as the model", d()),
        (
            "intermittent",
            Reality {
                intermittent: 0.3,
                ..d()
            },
        ),
        ("growth .3", Reality { growth: 0.3, ..d() }),
        (
            "class B for D",
            Reality {
                class_b: true,
                ..d()
            },
        ),
        (
            "decay .003/s",
            Reality {
                decay_s: 0.003,
                ..d()
            },
        ),
        (
            "trend 1.5/h",
            Reality {
                trend_h: 1.5,
                ..d()
            },
        ),
        (
            "veer 5 deg/100 m",
            Reality {
                veer_deg_100m: 5.0,
                ..d()
            },
        ),
        (
            "wander alone",
            Reality {
                wander_deg: 4.0,
                ..d()
            },
        ),
        (
            "wander, intermittent",
            Reality {
                wander_deg: 4.0,
                intermittent: 0.3,
                ..d()
            },
        ),
        (
            "downwash 2e4 m2",
            Reality {
                wake_m2: 2e4,
                ..d()
            },
        ),
        (
            "swing 60 deg",
            Reality {
                swing_deg: 60.0,
                ..d()
            },
        ),
        (
            "second source",
            Reality {
                second: true,
                ..d()
            },
        ),
    ]
}

/// Briggs' (1973) rural σy and σz of class D or B, m.
fn sigmas(x: f64, class_b: bool) -> (f64, f64) {
    if class_b {
        (0.16 * x / (1.0 + 1e-4 * x).sqrt(), 0.12 * x)
    } else {
        (
            0.08 * x / (1.0 + 1e-4 * x).sqrt(),
            0.06 * x / (1.0 + 1.5e-3 * x).sqrt(),
        )
    }
}

/// Distance along and across an axis, m.
fn along_across(axis_deg: f64, east: f64, north: f64) -> (f64, f64) {
    let (sin, cos) = axis_deg.to_radians().sin_cos();
    (north * cos + east * sin, east * cos - north * sin)
}

/// Excess of a plume with unknowns `th` in a reality, ppm.
fn excess(th: &[f64], r: &Reality, [east, north, height, t]: Row, turn_deg: f64) -> f64 {
    let speed = 8.0;
    let axis = th[0]
        + turn_deg
        + r.swing_deg * (t - 1050.0) / 2100.0
        + r.veer_deg_100m * (height - th[1]) / 100.0;
    let (x, y) = along_across(axis, east, north);
    if x < 1.0 {
        return 0.0;
    }
    let scaled = |x: f64| {
        let (sy, sz) = sigmas(x, r.class_b);
        (th[3].exp() * sy, th[4].exp() * sz)
    };
    let (sy0, sz0) = scaled(2400.0);
    let (sy, sz) = scaled(x);
    let wake = r.wake_m2 / std::f64::consts::PI;
    let sy = (sy * sy + wake).sqrt();
    let sz = ((sz * (x / 1000.0).powf(r.growth)).powi(2) + wake).sqrt();
    let z = height - th[1];
    th[2].exp() * sy0 * sz0 / (sy * sz)
        * (-0.5 * (y / sy).powi(2) - 0.5 * (z / sz).powi(2)).exp()
        * (-r.decay_s * x / speed).exp()
        * (r.trend_h * (t - x / speed) / 3600.0).exp()
}

fn all_excess(r: &Reality, row: Row, turn_deg: f64) -> f64 {
    let mut sum = excess(&TRUTH, r, row, turn_deg);
    if r.second {
        let mut th = TRUTH;
        th[2] = 250f64.ln();
        let [east, north, height, t] = row;
        sum += excess(&th, r, [east - 150.0, north + 250.0, height, t], turn_deg);
    }
    sum
}

/// Mean concentration there at a time, ppm: over the wander of the axis, by a sum over its normal
/// density.
pub fn peak_truth(r: &Reality, time_s: f64) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for k in -40..=40 {
        let z = f64::from(k) / 10.0;
        let weight = (-0.5 * z * z).exp();
        sum += weight * all_excess(r, [PEAK[0], PEAK[1], PEAK[2], time_s], r.wander_deg * z);
        weights += weight;
    }
    446.0 + sum / weights
}

/// Rows of one vehicle at 18 m/s that crosses the plume at four distances and three heights.
pub fn track() -> Vec<Row> {
    let mut rows = Vec::new();
    let mut t = 84.0;
    let axis = 70.0f64;
    for k in 0..12 {
        let distance = [1300.0, 1700.0, 2200.0, 2800.0][k % 4];
        let height = [540.0, 500.0, 590.0][k / 4];
        let reach = 0.45 * distance;
        let steps = (2.0 * reach / 18.0) as usize;
        for s in 0..=steps {
            let across = if k % 2 == 0 {
                -reach + 18.0 * s as f64
            } else {
                reach - 18.0 * s as f64
            };
            let (sin, cos) = axis.to_radians().sin_cos();
            let east = distance * sin + across * cos;
            let north = distance * cos - across * sin;
            rows.push([east, north, height, t]);
            t += 1.0;
        }
        t += 20.0;
    }
    rows
}

fn ornstein_uhlenbeck(rows: &[Row], memory_s: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(rows.len());
    for (i, row) in rows.iter().enumerate() {
        let n: f64 = StandardNormal.sample(rng);
        out.push(match i {
            0 => n,
            _ => {
                let keep = (-(row[3] - rows[i - 1][3]) / memory_s).exp();
                keep * out[i - 1] + (1.0 - keep * keep).sqrt() * n
            }
        });
    }
    out
}

/// Readings with white noise of 3 ppm.
pub fn readings(r: &Reality, seed: u64) -> Rows {
    rows_of(measured(r, seed))
}

/// Rows of the track with these readings.
pub fn rows_of(measured: Vec<f64>) -> Rows {
    let n = measured.len();
    let time_s = track().iter().map(|r| r[3]).collect();
    Rows::new(
        std::iter::once(0..n).collect(),
        time_s,
        measured,
        vec![f64::NAN; n],
        vec![true; n],
    )
    .unwrap()
}

pub fn measured(r: &Reality, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let rows = track();
    let wander = ornstein_uhlenbeck(&rows, 60.0, &mut rng);
    let gusts = ornstein_uhlenbeck(&rows, 5.0, &mut rng);
    (0..rows.len())
        .map(|i| {
            let c = all_excess(r, rows[i], r.wander_deg * wander[i]);
            let n: f64 = StandardNormal.sample(&mut rng);
            let gust = (r.intermittent * gusts[i] - 0.5 * r.intermittent * r.intermittent).exp();
            446.0 + c * gust + 3.0 * n
        })
        .collect()
}

/// The plain Gaussian plume of class D, its readings in a unit of so many to the ppm.
pub struct Model {
    rows: Vec<Row>,
    priors: [Prior; 6],
}

impl Model {
    pub fn new(unit: f64) -> Self {
        let mut priors = PRIORS;
        priors[2].mean += unit.ln();
        priors[5].mean *= unit;
        priors[5].sd *= unit;
        Self {
            rows: track(),
            priors,
        }
    }

    /// Background, plume and place in the plume at a point.
    pub fn at(
        &self,
        at: &[f64],
        turn: f64,
        [east, north, height]: [f64; 3],
    ) -> (f64, f64, PlumePlace) {
        let row = [east, north, height, 1050.0];
        (
            at[5],
            excess(at, &Reality::default(), row, turn),
            place(at, row),
        )
    }
}

pub fn place_of_peak() -> PlumePlace {
    place(&TRUTH, [PEAK[0], PEAK[1], PEAK[2], 1050.0])
}

fn place(at: &[f64], [east, north, height, t]: Row) -> PlumePlace {
    let (x, y) = along_across(at[0], east, north);
    let x = x.max(1.0);
    let (sy, sz) = sigmas(x, false);
    PlumePlace {
        ln_distance: x.ln(),
        above_sigmas: (height - at[1]) / (at[4].exp() * sz),
        across_sigmas: y / (at[3].exp() * sy),
        time_s: t,
        emitted_s: t,
        sigma_z_m: at[4].exp() * sz,
    }
}

impl ForwardModel for Model {
    fn priors(&self) -> &[Prior] {
        &self.priors
    }

    fn ln_strength(&self) -> Option<usize> {
        Some(2)
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        let mut out = Vec::new();
        for axis in (30..100).step_by(3) {
            for height in [430.0, 486.0, 540.0, 590.0] {
                let mut at: Vec<f64> = self.priors.iter().map(|p| p.mean).collect();
                (at[0], at[1]) = (f64::from(axis), height);
                out.push(at);
            }
        }
        out
    }

    fn predict(&self, at: &[f64], turns: &[AxisTurn]) -> Result<Prediction, InferError> {
        let row = |(row, turn): (&Row, &AxisTurn)| {
            let mut raised = at.to_vec();
            raised[1] += row[0].hypot(row[1]) * turn.upward_deg.to_radians().tan();
            excess(&raised, &Reality::default(), *row, turn.clockwise_deg)
        };
        let plume: Vec<f64> = self.rows.iter().zip(turns).map(row).collect();
        Ok(Prediction {
            reading: plume.iter().map(|p| p + at[5]).collect(),
            plume,
        })
    }

    fn places(&self, at: &[f64]) -> Result<Vec<PlumePlace>, InferError> {
        Ok(self.rows.iter().map(|row| place(at, *row)).collect())
    }
}
