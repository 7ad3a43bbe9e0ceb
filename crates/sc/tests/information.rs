//! What crossings tell, against a computation by another method: `tests/oracle/information.py` integrates the
//! displaced plume over correlated displacements by Gauss–Hermite quadrature and inverts the matrices by NumPy.

use sc::information::{AxisCrossing, Information, KnownPlume, Precision};

const HEIGHT_M: f64 = 880.0;

fn sigma_z_m(distance_m: f64) -> f64 {
    0.06 * distance_m / (1.0 + 0.0015 * distance_m).sqrt()
}

fn noise(_: f64) -> f64 {
    0.01
}

fn plume() -> KnownPlume<'static> {
    KnownPlume {
        height_amsl_m: HEIGHT_M,
        prior_sd: (0.3, 50.0, 0.3),
        c_max_distance_m: 2400.0,
        peak_distance_m: 1155.0,
        wind_m_s: 8.0,
        sigma_z_m: &sigma_z_m,
        noise: &noise,
    }
}

fn at(time_s: f64, distance_m: f64, height_amsl_m: f64) -> AxisCrossing {
    AxisCrossing {
        time_s,
        distance_m,
        height_amsl_m,
    }
}

fn after(crossings: &[AxisCrossing]) -> Information<'static> {
    let mut information = Information::prior(plume());
    for crossing in crossings {
        information.add(*crossing);
    }
    information
}

fn assert_precision(found: Precision, expected: [f64; 5]) {
    let found = [
        found.peak,
        found.flux,
        found.c_max,
        found.height_m,
        found.sigma_z,
    ];
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found / expected - 1.0).abs() < 1e-4,
            "{found} for {expected}"
        );
    }
}

#[test]
fn precision_is_that_of_the_quadrature() {
    assert_precision(after(&[]).precision(), [0.33376, 0.448772, 0.3, 50.0, 0.3]);
    let one = [at(0.0, 2400.0, 880.0)];
    assert_precision(
        after(&one).precision(),
        [0.288019, 0.415879, 0.248111, 50.0, 0.3],
    );
    let four = [
        at(0.0, 1155.0, 880.0),
        at(40.0, 1155.0, 910.0),
        at(90.0, 1300.0, 850.0),
        at(400.0, 2400.0, 880.0),
    ];
    let expected = [0.207652, 0.310726, 0.197472, 28.034938, 0.281191];
    assert_precision(after(&four).precision(), expected);
    // What the last one adds can be told before it is flown.
    let ahead = after(&four[..3]).precision_after(&four[3]);
    assert_precision(ahead, expected);
}

#[test]
fn crossings_that_meet_other_eddies_tell_more() {
    let pair = |apart_s: f64| after(&[at(0.0, 1155.0, 880.0), at(apart_s, 1155.0, 880.0)]);
    let peak = |apart_s: f64| pair(apart_s).precision().peak;
    assert!(peak(150.0) < peak(72.0) && peak(72.0) < peak(1.0));
    // After the travel time of 144 s nothing is left of the eddies.
    assert_eq!(peak(150.0), peak(600.0));
}

#[test]
fn height_is_told_off_the_axis_and_distance_where_c_max_is_stated() {
    let known = after(&[at(0.0, 1155.0, 880.0), at(200.0, 1155.0, 880.0)]);
    let before = known.precision();
    let off = known.precision_after(&at(400.0, 1155.0, 910.0));
    let on = known.precision_after(&at(400.0, 1155.0, 880.0));
    assert!(off.height_m < 0.9 * before.height_m);
    assert!((on.height_m / before.height_m - 1.0).abs() < 1e-9);
    let far = known.precision_after(&at(400.0, 2400.0, 880.0));
    assert!(far.c_max < on.c_max && far.peak > on.peak);
    // Nothing is gained where all that is asked for is known.
    let asked = Precision {
        peak: 1.0,
        flux: 1.0,
        c_max: 1.0,
        height_m: 100.0,
        sigma_z: 1.0,
    };
    assert_eq!(before.gain(&off, &asked), 0.0);
    assert!(before.gain(&off, &Precision::UNLIMITED) > 0.0);
}
