//! How far passes reach to both sides of the axis.

use crate::common::as_pontes;
use air::geo::Enu;
use sc::passes::{Crossing, PassRange, plan};
use sc::plume_estimate::PlumeEstimate;
use scenario::airspace::Airspace;

/// 2.6 σ_y of class D (Briggs 1973) at 1,200 m: `2.6 * .08 * 1200 / 1.12 ** .5`.
const HALF_M: f64 = 235.85;

/// How far a pass 1,200 m down the axis reaches to its left and right, m, with another source so far down the axis and to
/// the right of the first.
fn reach_m(other_m: Option<(f64, f64)>) -> [f64; 2] {
    let scenario = as_pontes(1);
    let airspace = Airspace::of(&scenario).unwrap();
    let mut base = scenario.dispersion_spec().unwrap();
    let estimate = PlumeEstimate {
        source: base.sources[0].place,
        axis_deg: 72.0,
        axis_sd_deg: 0.0,
        height_amsl_m: 880.0,
        height_sd_m: 0.0,
        sigma_factors: (1.0, 1.0),
        sigma_factor_sds: (0.0, 0.0),
    };
    if let Some((along_m, right_m)) = other_m {
        let mut other = base.sources[0].clone();
        other.place = estimate.place(along_m, right_m);
        base.sources.push(other);
    }
    let range = PassRange {
        near_m: 1200.0,
        far_m: 2400.0,
        beyond_m: 0.0,
    };
    let crossing = Crossing {
        part: 0.0,
        step: 0.0,
    };
    let from = Enu::default();
    let pass = plan(crossing, &estimate, &base, &airspace, range, 120.0, from).unwrap();
    let right_m = |at: Enu| estimate.along_and_right_m(at)[1];
    let (a_m, b_m) = (right_m(pass.from.at), right_m(pass.to.at));
    [-a_m.min(b_m), a_m.max(b_m)]
}

fn assert_reach(found: [f64; 2], expected: [f64; 2]) {
    let near = |k: usize| (found[k] - expected[k]).abs() < 1.0;
    assert!(near(0) && near(1), "{found:?} for {expected:?}");
}

#[test]
fn a_pass_reaches_through_the_plumes_of_sources_that_touch() {
    assert_reach(reach_m(None), [HALF_M, HALF_M]);
    assert_reach(reach_m(Some((0.0, 376.0))), [HALF_M, 376.0 + HALF_M]);
    // Nearer to its source a plume is narrower, and a pass reaches 220 m beyond its axis at the least.
    assert_reach(reach_m(Some((600.0, -100.0))), [320.0, HALF_M]);
    // A plume that lies apart, or begins farther down, is not crossed.
    assert_reach(reach_m(Some((0.0, 1000.0))), [HALF_M, HALF_M]);
    assert_reach(reach_m(Some((1500.0, 300.0))), [HALF_M, HALF_M]);
}
