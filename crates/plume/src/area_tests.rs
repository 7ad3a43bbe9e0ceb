use super::*;
use crate::field::tests::spec;
use crate::field::{DispersionModel, DispersionSpec, Place, Strength};
use crate::mechanism::Mechanism;
use crate::stability::Stability;
use air::wind::{WindProfile, WindSeries, WindVector};
use proptest::prelude::*;

/// Molar mass of CO2 and the air of one mol/m³ at a height make kg/m³ of ppm.
fn kg_m3(model: &DispersionModel, excess_ppm: f64, height_agl_m: f64) -> f64 {
    excess_ppm / model.ppm_per_mol_m3(height_agl_m) * 0.044_009
}

fn of_area(area: AreaSpec, stability: Stability, from_deg: f64, height_m: f64) -> DispersionSpec {
    let mut out = spec(Strength::EmissionKgS(1.0));
    out.wind = WindProfile::new(3.0, 10.0, from_deg, 0.0).unwrap();
    out.stability = stability;
    out.ground_reflection = true;
    out.background_ppm = 0.0;
    out.sources[0].stack_height_m = 0.0;
    out.sources[0].effective_height_agl_m = height_m;
    out.sources[0].area = Some(area);
    out
}

fn area(outline: Outline, length_m: f64, width_m: f64, axis_deg: f64) -> AreaSpec {
    AreaSpec {
        outline,
        length_m,
        width_m,
        axis_deg,
    }
}

const PLACES: [[f64; 3]; 10] = [
    [0.0, 0.0, 40.0],
    [120.0, 0.0, 25.0],
    [120.0, 60.0, 30.0],
    [220.0, 0.0, 25.0],
    [300.0, -80.0, 40.0],
    [250.0, 40.0, 60.0],
    [600.0, 0.0, 25.0],
    [600.0, 150.0, 60.0],
    [1500.0, 0.0, 100.0],
    [1500.0, 100.0, 25.0],
];

fn at([east_m, north_m, height_agl_m]: [f64; 3]) -> Place {
    Place {
        east_m,
        north_m,
        height_agl_m,
    }
}

// Point sources every half metre over the area, kg/m³ (python3 tests/oracle/area_source.py).
#[test]
fn an_area_is_the_integral_of_points_over_it() {
    use Outline::{Ellipse, Rectangle};
    for (outline, length_m, width_m, axis_deg, from_deg, stability, height_m, expected) in [
        (
            Rectangle,
            300.0,
            200.0,
            0.0,
            270.0,
            Stability::D,
            0.0,
            [
                1.26709e-17,
                1.36782e-06,
                3.58700e-07,
                7.34725e-06,
                1.95868e-06,
                1.50066e-08,
                2.13280e-05,
                1.21721e-06,
                1.95310e-06,
                1.03436e-05,
            ],
        ),
        (
            Rectangle,
            300.0,
            200.0,
            30.0,
            265.0,
            Stability::D,
            5.0,
            [
                5.61233e-12,
                4.10182e-06,
                6.16723e-07,
                1.24153e-05,
                2.51548e-06,
                4.20493e-08,
                2.23011e-05,
                1.99365e-06,
                1.35116e-06,
                1.30495e-05,
            ],
        ),
        (
            Ellipse,
            400.0,
            250.0,
            60.0,
            280.0,
            Stability::A,
            0.0,
            [
                2.45137e-06,
                1.40751e-05,
                8.31025e-06,
                1.82198e-05,
                1.15440e-05,
                5.58454e-06,
                5.10010e-06,
                1.26089e-06,
                7.80030e-07,
                6.08687e-07,
            ],
        ),
        (
            Ellipse,
            400.0,
            250.0,
            90.0,
            270.0,
            Stability::D,
            2.0,
            [
                3.87763e-09,
                5.61887e-06,
                1.76881e-06,
                1.24264e-05,
                2.64238e-06,
                1.11006e-07,
                2.95573e-05,
                7.03336e-07,
                2.19728e-06,
                1.08076e-05,
            ],
        ),
        (
            Rectangle,
            150.0,
            150.0,
            45.0,
            270.0,
            Stability::F,
            0.0,
            [
                1.24912e-136,
                7.12087e-18,
                2.83475e-31,
                1.46929e-11,
                1.10808e-19,
                6.38596e-38,
                2.45631e-06,
                2.04480e-18,
                1.32490e-12,
                1.08711e-05,
            ],
        ),
    ] {
        let shape = area(outline, length_m, width_m, axis_deg);
        let model = DispersionModel::new(of_area(shape, stability, from_deg, height_m)).unwrap();
        let greatest = expected.iter().fold(0.0f64, |a, b| a.max(*b));
        for (place, expected) in PLACES.into_iter().zip(expected) {
            let found = kg_m3(&model, model.mean_ppm(&at(place), 0.0), place[2]);
            let allowed = if expected > 0.1 * greatest {
                0.01 * expected
            } else {
                0.002 * greatest
            };
            assert!(
                (found - expected).abs() < allowed,
                "{shape:?} {stability:?} {place:?}: {found:e} for {expected:e}"
            );
        }
    }
}

#[test]
fn what_is_emitted_goes_through_a_curtain() {
    let shape = area(Outline::Ellipse, 400.0, 250.0, 35.0);
    let model = DispersionModel::new(of_area(shape, Stability::C, 270.0, 3.0)).unwrap();
    for x_m in [250.0, 800.0] {
        // Steps of 4 m: the sum over a smooth shape is its integral.
        let mut flux_kg_s = 0.0;
        for k in 0..150 {
            for j in -150..=150 {
                let (north_m, up_m) = (4.0 * f64::from(j), 4.0 * (f64::from(k) + 0.5));
                let place = at([x_m, north_m, up_m]);
                flux_kg_s += 16.0 * 3.0 * kg_m3(&model, model.mean_ppm(&place, 0.0), up_m);
            }
        }
        assert!(
            (flux_kg_s - 1.0).abs() < 0.01,
            "{x_m} m: {flux_kg_s} kg/s of 1"
        );
    }
    let stated = model.emissions_kg_s()[0].1;
    assert!((stated - 1.0).abs() < 1e-12, "{stated}");
}

#[test]
fn in_steady_air_the_puffs_of_an_area_are_its_plume() {
    let shape = area(Outline::Rectangle, 300.0, 200.0, 20.0);
    let model = DispersionModel::new(of_area(shape, Stability::D, 270.0, 2.0)).unwrap();
    let west = WindSeries::constant(WindVector::from_speed_and_direction(3.0, 270.0));
    let puffs = model.puffs(&west, 0.0, None, 900.0);
    for place in PLACES
        .into_iter()
        .filter(|p| p[0] > 200.0 && p[1].abs() < 100.0)
    {
        let (steady, sum) = (
            model.mean_ppm(&at(place), 0.0),
            model.ppm_among(&puffs, &at(place)),
        );
        let greatest = model.mean_ppm(&at([place[0], 0.0, 2.0]), 0.0);
        // Puffs are round: along the wind they smooth by σy/x, as those of a stack.
        assert!(
            (sum - steady).abs() < 0.025 * greatest,
            "{place:?}: {sum} for {steady}"
        );
    }
}

#[test]
fn c_max_on_the_axis_is_the_areas() {
    let shape = area(Outline::Rectangle, 300.0, 200.0, 20.0);
    let model = DispersionModel::new(of_area(shape, Stability::D, 270.0, 2.0)).unwrap();
    let (stated, met) = (model.stated_c_max_ppm(800.0), model.axis_excess_ppm(800.0));
    assert!((stated / met - 1.0).abs() < 1e-9, "{stated} {met}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Far away an area is a point.
    #[test]
    fn far_away_it_is_a_stack(
        length_m in 1.0..60.0f64, slender in 0.2..1.0f64, axis_deg in 0.0..360.0f64, oval in any::<bool>(),
    ) {
        let outline = if oval { Outline::Ellipse } else { Outline::Rectangle };
        let mut specification = of_area(area(outline, length_m, slender * length_m, axis_deg), Stability::D, 270.0, 2.0);
        let wide = DispersionModel::new(specification.clone()).unwrap();
        specification.sources[0].area = None;
        let point = DispersionModel::new(specification).unwrap();
        for place in [[6000.0, 0.0, 60.0], [6000.0, 300.0, 30.0]] {
            let ratio = wide.mean_ppm(&at(place), 0.0) / point.mean_ppm(&at(place), 0.0);
            prop_assert!((ratio - 1.0).abs() < 0.01, "{}", ratio);
        }
    }

    /// Shares are the whole, and the middle of the cells that of the area.
    #[test]
    fn cells_make_the_area(
        length_m in 1.0..2000.0f64, slender in 0.02..1.0f64, axis_deg in 0.0..360.0f64, oval in any::<bool>(),
    ) {
        let outline = if oval { Outline::Ellipse } else { Outline::Rectangle };
        let shape = area(outline, length_m, slender * length_m, axis_deg);
        let cells = shape.cells();
        prop_assert!((60..160).contains(&cells.len()), "{}", cells.len());
        let sum = |of: fn(&Cell) -> f64| cells.iter().map(of).sum::<f64>();
        prop_assert!((sum(|c| c.share) - 1.0).abs() < 1e-12);
        prop_assert!(sum(|c| c.share * c.east_m).abs() < 1e-9 * length_m);
        // Variance of the whole, both ways together.
        let about = sum(|c| c.share * (c.east_m.powi(2) + c.north_m.powi(2)));
        let variance_m2 = 0.5 * about + shape.cell_variance_m2();
        prop_assert!((variance_m2 / shape.variance_m2() - 1.0).abs() < 0.03, "{}", variance_m2);
    }
}

#[test]
fn mechanisms_and_vector_instructions_hold_for_an_area() {
    let shape = area(Outline::Ellipse, 300.0, 200.0, 20.0);
    let mut wet = of_area(shape, Stability::D, 270.0, 2.0);
    wet.mechanisms
        .push(Mechanism::new("first-order-decay", &[("rate_per_s", 0.002)]).unwrap());
    wet.mechanisms
        .push(Mechanism::new("dry-deposition", &[("velocity_m_s", 0.01)]).unwrap());
    let (dry, wet) = (
        DispersionModel::new(of_area(shape, Stability::D, 270.0, 2.0)).unwrap(),
        DispersionModel::new(wet).unwrap(),
    );
    let place = at([900.0, 0.0, 25.0]);
    let left = wet.mean_ppm(&place, 0.0) / dry.mean_ppm(&place, 0.0);
    // exp(-.002 × 900/3) is .55; what deposits comes on top.
    assert!((0.3..0.55).contains(&left), "{left}");
    let mut out = Vec::new();
    let columns = crate::PlaceColumns {
        east_m: &[900.0, 100.0],
        north_m: &[0.0, 20.0],
        height_agl_m: &[25.0, 40.0],
    };
    dry.fill_mean_ppm(columns, 0.0, &mut out).unwrap();
    assert!((out[0] / dry.mean_ppm(&place, 0.0) - 1.0).abs() < 1e-9);
}

#[test]
fn what_is_no_area_is_refused() {
    for (length_m, width_m, named) in [
        (0.0, 10.0, "length_m"),
        (300.0, 1.0, "width_m"),
        (300.0, f64::NAN, "width_m"),
    ] {
        let broken = of_area(
            area(Outline::Ellipse, length_m, width_m, 0.0),
            Stability::D,
            270.0,
            0.0,
        );
        let refused = DispersionModel::new(broken).unwrap_err().to_string();
        assert!(
            refused.contains(named) && refused.contains("stack"),
            "{refused}"
        );
    }
}
