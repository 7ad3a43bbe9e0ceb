//! The highest place that may be flown to, against places known without a search.

use air::geo::{Enu, Position};
use plume::Place;
use proptest::prelude::*;
use scenario::Scenario;
use scenario::airspace::{Airspace, SETPOINT_MARGIN_M};
use scenario::peak::highest_of;

fn as_pontes() -> Scenario {
    let text = include_str!("../../../scenarios/as-pontes.toml");
    Scenario::parse("as-pontes.toml", text).unwrap()
}

fn highest(s: &Scenario) -> (Enu, f64, f64) {
    let (model, airspace) = (s.dispersion_model().unwrap(), Airspace::of(s).unwrap());
    let found = highest_of(&model, &airspace, SETPOINT_MARGIN_M, 0.0).unwrap();
    let height_agl_m = found.position.height_m - s.site.ground_amsl_m;
    (found.position.at, height_agl_m, found.co2_ppm)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Along the axis a plume only thins out, so its maximum is where the axis leaves the
    /// keep-out and its margin, at H, or at the ceiling or floor where H is beyond them.
    #[test]
    fn lies_where_the_axis_leaves_the_keep_out(
        from_deg in 0.0f64..360.0, height_m in 80.0f64..1000.0, keep_out_m in 300.0f64..2000.0,
        scale in 0.5f64..2.0,
    ) {
        let mut s = as_pontes();
        s.weather.wind_from_deg = from_deg;
        s.sources[0].effective_height_m = Some(height_m);
        s.plume.sigma_y_scale = scale;
        s.fence.keep_out_radius_m = keep_out_m;
        s.fence.polygon.clear();
        let (at, height_agl_m, co2_ppm) = highest(&s);
        let expected = Enu::default().displaced(from_deg + 180.0, keep_out_m + SETPOINT_MARGIN_M);
        // Above the ceiling or below the floor the maximum lies farther out, where the plume has
        // grown down or up to the band: there only the height and the axis are known.
        let band = (s.fence.floor_agl_m, s.fence.ceiling_agl_m);
        let expected_m = height_m.clamp(band.0, band.1);
        prop_assert!((height_agl_m - expected_m).abs() < 1.0, "{height_agl_m} {expected_m}");
        if expected_m == height_m {
            prop_assert!(at.distance_m(expected) < 2.0, "{at:?} {expected:?}");
        } else {
            let miss = air::geo::wrap_signed_deg(Enu::default().bearing_deg(at) - from_deg - 180.0);
            prop_assert!(miss.abs() < 0.2, "{miss}");
        }
        prop_assert!(co2_ppm >= s.background.ppm(s.gas()));
    }

    /// No place drawn from the airspace is higher.
    #[test]
    fn is_not_beaten_by_any_allowed_place(
        from_deg in 0.0f64..360.0,
        places in proptest::collection::vec((-3400.0..5000.0f64, -4000.0..4200.0f64, 120.0..900.0f64), 200),
    ) {
        let mut s = as_pontes();
        s.weather.wind_from_deg = from_deg;
        let (airspace, world) = (Airspace::of(&s).unwrap(), s.dispersion_model().unwrap());
        let (_, _, best_ppm) = highest(&s);
        for (east_m, north_m, height_agl_m) in places {
            let at = Position::new(east_m, north_m, height_agl_m + s.site.ground_amsl_m);
            let place = Place { east_m, north_m, height_agl_m };
            if airspace.contains(at, SETPOINT_MARGIN_M) {
                prop_assert!(world.mean_ppm(&place, 0.0) <= best_ppm);
            }
        }
    }
}
