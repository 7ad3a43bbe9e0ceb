//! Log likelihoods of fits that are held against each other.

use super::super::fit::{Context, Fitted};
use super::super::start::start;
use super::*;

/// By how much the vane is off: so far that the readings do not follow the base's plume.
const OFF_DEG: f64 = 8.0;
/// What is within rounding of sums over all rows, nats.
const ROUNDED_NATS: f64 = 1e-6;

/// A vane that is off: the base stands where it was stated, under the noise of where the plume is.
fn with_started(check: impl Fn(&Context<'_>, &Fitted)) {
    let mut turned = observe(&[], 8);
    for row in &mut turned.rows {
        row.wind_from_deg = row.wind_from_deg.map(|from| from + OFF_DEG);
    }
    let setup = setup();
    let mut data = Data::new(&setup, &turned).unwrap();
    let started = start(&setup, &mut data, 1);
    let ctx = Context {
        setup: &setup,
        data: &data,
        threads: 1,
    };
    check(&ctx, &started.fitted);
}

#[test]
fn a_fit_that_settles_where_it_stands_is_as_likely_as_it_was() {
    with_started(|ctx, base| {
        let fitted = ctx.refine(&base.model, base.noise);
        let again = ctx.settle(&fitted.model, &fitted.metric, &fitted, 0);
        let off = [
            again.log_score - fitted.log_score,
            again.log_evidence - fitted.log_evidence,
        ];
        assert!(off.iter().all(|o| o.abs() < ROUNDED_NATS), "{off:?}");
    });
}

#[test]
fn a_base_that_points_elsewhere_is_less_likely_than_one_that_does_not() {
    with_started(|ctx, base| {
        let offset = base.model.free_of(MechanismId::WindDirectionOffset);
        let mut there = base.model.widened(offset.unwrap());
        there.set_coordinate(offset.unwrap(), -OFF_DEG);
        let there = ctx.refine(&there, base.noise);
        let (there, base) = (there.score_with_prior(), base.score_with_prior());
        assert!(there > base + 100.0, "{there} {base}");
    });
}
