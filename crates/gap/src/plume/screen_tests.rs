//! The screen's algebra against the same done row by row.

use super::*;
use crate::plume::candidate;

const ROWS: [usize; 2] = [40, 30];
const PRECISION: f64 = 0.7;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// The column on one platform alone, or on all.
fn on(platform: Option<usize>, column: &DVector<f64>) -> DVector<f64> {
    let own = |i: usize| platform.is_none_or(|p| p == usize::from(i >= ROWS[0]));
    DVector::from_fn(column.len(), |i, _| if own(i) { column[i] } else { 0.0 })
}

#[test]
fn what_two_share_is_what_is_left_of_both_without_the_base() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let rows = ROWS[0] + ROWS[1];
    let columns = DMatrix::from_fn(rows, 4, |_, _| normal(&mut rng));
    let residual = DVector::from_fn(rows, |_, _| normal(&mut rng));
    // The first two are the base's; its prior counts as rows of its own.
    let base = columns.columns(0, 2).into_owned();
    let a = base.transpose() * &base + DMatrix::identity(2, 2) * PRECISION;
    let inverse = a.try_inverse().unwrap();
    let left = |c: &DVector<f64>| c - &base * (&inverse * (base.transpose() * c));

    let per_platform: Vec<Products> = [(0, ROWS[0]), (ROWS[0], ROWS[1])]
        .map(|(from, count)| {
            let own = columns.rows(from, count).into_owned();
            Products {
                gram: own.transpose() * &own,
                score: own.transpose() * residual.rows(from, count),
            }
        })
        .into();
    let gram = columns.transpose() * &columns;
    let score = columns.transpose() * &residual;
    let frame = Frame {
        base: 2,
        inverse: inverse.clone(),
        sd: vec![PRECISION.powf(-0.5); 2],
    };
    let start = candidate::single(MechanismId::SensorOffset, 1.0);
    let hypothesis = |column: usize, platform: Option<usize>| {
        let own = platform.map_or(&gram, |p| &per_platform[p].gram);
        let found = frame.hypothesis(0, platform, &[column], own, &start);
        found.unwrap()
    };
    let places = [None, Some(0), Some(1)];
    let pairs = places.iter().flat_map(|p| places.map(|q| (*p, q)));
    let checked: Vec<_> = pairs
        .map(|(p, q)| (p, q, hypothesis(2, p), hypothesis(3, q)))
        .collect();
    let equations = Equations {
        base_score: score.rows(0, 2).into_owned(),
        all: Products { gram, score },
        per_platform,
        hypotheses: Vec::new(),
        widened: Vec::new(),
    };
    for (p, q, one, other) in &checked {
        let (a, b) = (
            on(*p, &columns.column(2).into()),
            on(*q, &columns.column(3).into()),
        );
        let shared = equations.shared(one, other)[(0, 0)];
        assert!((shared - a.dot(&left(&b))).abs() < 1e-9, "{p:?} {q:?}");
        assert!((one.information[(0, 0)] - a.dot(&left(&a))).abs() < 1e-9);
        let score = equations.score_of(one)[0];
        assert!((score - a.dot(&left(&residual))).abs() < 1e-9, "{p:?}");
    }
}

// ln of N(r; 0, 1 + c cT sd2) over N(r; 0, 1), by the covariance itself.
#[test]
fn the_evidence_of_columns_is_that_of_their_covariance() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let columns = DMatrix::from_fn(12, 2, |_, _| normal(&mut rng));
    let residual = DVector::from_fn(12, |_, _| normal(&mut rng));
    let sd = [0.4, 2.0];
    let prior = DMatrix::from_fn(2, 2, |i, j| if i == j { sd[i] * sd[i] } else { 0.0 });
    let covariance = DMatrix::identity(12, 12) + &columns * prior * columns.transpose();
    let inverse = covariance.clone().try_inverse().unwrap();
    let ln = |square: f64, det: f64| -0.5 * square - 0.5 * det.ln();
    let expected = ln(
        (residual.transpose() * inverse * &residual)[0],
        covariance.determinant(),
    ) - ln(residual.norm_squared(), 1.0);
    let information = columns.transpose() * &columns;
    let (_, nats) = evidence(information, &(columns.transpose() * &residual), &sd).unwrap();
    assert!((nats - expected).abs() < 1e-9, "{nats} {expected}");
}
