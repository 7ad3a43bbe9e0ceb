//! What numbers of an aircraft go together, so that one in another unit (mm, cm, g, kg cm²) is refused by its name and
//! not found out by a simulation that never ends. The ranges hold for anything from a model for the room to an
//! airliner; a unit is wrong by a factor of 10 or more.

use crate::error::{FdmError, refuse};
use std::ops::RangeInclusive;

/// Wing span, m: the smallest models that carry an autopilot, the largest aircraft that has flown (117 m).
pub(super) const SPAN_M: RangeInclusive<f64> = 0.1..=120.0;
/// Mean chord over span, the inverse of the aspect ratio: sailplanes have 1/51, flying discs and deltas about 1.
pub(super) const CHORD_OF_SPAN: RangeInclusive<f64> = 0.015..=2.0;
/// Wing area over span times chord: 1 for the geometric mean chord, 0.7 to 1 for the aerodynamic one of tapered wings
/// and deltas, and more where the chord is that of the tip.
pub(super) const AREA_OF_RECTANGLE: RangeInclusive<f64> = 0.3..=3.0;
/// Mass over wing area, kg/m²: models for the room 0.1, airliners up to 800.
pub(super) const WING_LOADING_KG_M2: RangeInclusive<f64> = 0.05..=1_000.0;
/// Moment of inertia over mass times span squared, the square of the radius of gyration in spans: Raymer's table of
/// aircraft has radii of 0.1 to 0.25 of span or length, and so squares of 0.01 to 0.06; less for short flying wings about
/// the pitch axis.
pub(super) const INERTIA_OF_SPAN: RangeInclusive<f64> = 0.000_5..=0.5;

/// Whether `value` over `reference` is in `range`.
pub(super) fn within(
    range: RangeInclusive<f64>,
    key: &'static str,
    value: f64,
    reference: f64,
) -> Result<(), FdmError> {
    if range.contains(&(value / reference)) {
        return Ok(());
    }
    let (low, high) = (range.start() * reference, range.end() * reference);
    let expected = format!(
        "{low:.3e} to {high:.3e}, plausible for the other numbers of mass and wing; check its unit"
    );
    Err(refuse(key, value, expected))
}
