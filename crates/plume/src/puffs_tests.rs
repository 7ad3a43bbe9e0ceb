use super::*;
use crate::field::tests::spec;
use crate::field::{DispersionSpec, Strength};
use crate::mechanism::Mechanism;
use air::wind::WindVector;
use rand::SeedableRng;

fn at(east_m: f64, north_m: f64, height_agl_m: f64) -> Place {
    Place {
        east_m,
        north_m,
        height_agl_m,
    }
}

fn west_wind() -> WindSeries {
    WindSeries::constant(WindVector::from_speed_and_direction(7.0, 270.0))
}

fn with(strength: Strength, mechanisms: &[(&str, &[(&str, f64)])]) -> DispersionSpec {
    let made = mechanisms
        .iter()
        .map(|(id, p)| Mechanism::new(id, p).unwrap());
    DispersionSpec {
        mechanisms: made.collect(),
        background_ppm: 0.0,
        ..spec(strength)
    }
}

const EMISSION: Strength = Strength::EmissionKgS(352.0);
const C_MAX: Strength = Strength::CMax {
    excess_ppm: 410.0,
    distance_m: 2400.0,
};

#[test]
fn in_steady_air_the_puffs_are_the_plume() {
    for (strength, mechanisms) in [
        (EMISSION, &[][..]),
        (C_MAX, &[]),
        (
            EMISSION,
            &[("first-order-decay", &[("rate_per_s", 0.002)][..])],
        ),
        (
            C_MAX,
            &[("wind-direction-offset", &[("offset_deg", 9.0)][..])],
        ),
        (EMISSION, &[("wind-speed-scale", &[("factor", 0.7)][..])]),
        (
            EMISSION,
            &[("wind-veer-with-height", &[("rate_deg_per_100m", 4.0)][..])],
        ),
        (C_MAX, &[("wind-speed-scale", &[("factor", 1.4)][..])]),
        (C_MAX, &[("emission-trend", &[("rate_per_h", 1.5)][..])]),
        (C_MAX, &[("mixing-lid", &[("height_m", 560.0)][..])]),
    ] {
        let model = DispersionModel::new(with(strength, mechanisms)).unwrap();
        let puffs = model.puffs(&west_wind(), 0.0, None, 500.0);
        for x_m in [300.0, 1000.0, 2400.0, 6000.0] {
            let (y, z) = model.sigmas_m(x_m);
            for (across, above) in [(0.0, 0.0), (1.0, 0.0), (-0.7, 0.9), (0.5, -1.4)] {
                let place = at(x_m, across * y, 486.0 + above * z);
                let steady = model.mean_ppm(&place, 500.0);
                let sum = model.ppm_among(&puffs, &place);
                // The puffs are round: along the wind they smooth by σy/x, which is some per cent of σy.
                let peak = model.axis_excess_ppm(x_m);
                assert!(
                    (sum - steady).abs() < 0.025 * peak,
                    "{mechanisms:?} {place:?}: {sum} for {steady}"
                );
            }
        }
    }
}

fn unsteady(model: &DispersionModel, seed: u64) -> UnsteadyAir {
    let rng = |k: u64| ChaCha8Rng::seed_from_u64(2 * seed + k);
    UnsteadyAir::new(model, UnsteadySpec::default(), rng(0), rng(1))
}

#[test]
fn the_mean_over_meanders_is_the_steady_plume() {
    let model = DispersionModel::new(with(EMISSION, &[])).unwrap();
    let count = 600;
    for x_m in [500.0, 2400.0] {
        let (y, z) = model.sigmas_m(x_m);
        for (across, above) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            let place = at(x_m, across * y, 486.0 + above * z);
            let steady = model.mean_ppm(&place, 0.0);
            let read: Vec<f64> = (0..count)
                .map(|seed| {
                    let mut air = unsteady(&model, seed);
                    let puffs = model.puffs(&west_wind(), 0.0, Some(&mut air), 300.0);
                    model.ppm_among(&puffs, &place)
                })
                .collect();
            let mean = read.iter().sum::<f64>() / f64::from(count as u32);
            let variance =
                read.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / f64::from(count as u32 - 1);
            let error = (variance / f64::from(count as u32)).sqrt();
            // Four standard errors of the mean, and two per cent for round puffs.
            assert!(
                (mean - steady).abs() < 4.0 * error + 0.02 * steady,
                "{place:?}: {mean} ± {error} for {steady}"
            );
            // And it is unsteady: from moment to moment it differs by a good part of its mean.
            assert!(
                variance.sqrt() > 0.3 * mean,
                "{place:?}: {} of {mean}",
                variance.sqrt()
            );
        }
    }
}

#[test]
fn a_wind_that_has_turned_leaves_the_far_plume_where_it_was() {
    let model = DispersionModel::new(with(EMISSION, &[])).unwrap();
    // From the west until 200 s ago, from the south since: what is older has moved 1400 m north.
    let wind = WindSeries::new(&[
        (0.0, 7.0, 270.0),
        (800.0, 7.0, 270.0),
        (800.001, 7.0, 180.0),
    ]);
    let puffs = model.puffs(&wind.unwrap(), 0.0, None, 1000.0);
    let near = model.ppm_among(&puffs, &at(0.0, 700.0, 486.0));
    let far = model.ppm_among(&puffs, &at(1000.0, 1400.0, 486.0));
    let gone = model.ppm_among(&puffs, &at(1000.0, 0.0, 486.0));
    // Both are as far on their way from the source as the plume's axis at 700 m and 2400 m.
    assert!(
        (near / model.axis_excess_ppm(700.0) - 1.0).abs() < 0.02,
        "{near}"
    );
    assert!(
        (far / model.axis_excess_ppm(2400.0) - 1.0).abs() < 0.02,
        "{far}"
    );
    assert!(gone < 1e-3 * far, "{gone}");
}

#[test]
fn the_same_seed_is_the_same_plume() {
    let model = DispersionModel::new(with(C_MAX, &[])).unwrap();
    let read = |seed| {
        let mut air = unsteady(&model, seed);
        let puffs = model.puffs(&west_wind(), 0.0, Some(&mut air), 321.0);
        model.ppm_among(&puffs, &at(1500.0, 40.0, 486.0))
    };
    assert_eq!(read(5), read(5));
    assert_ne!(read(5), read(6));
}
