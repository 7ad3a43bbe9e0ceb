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

/// Effective swept area of the propellers over wing area: motor gliders and airliners 0.02, tilt rotors 6. Several
/// propellers count together.
pub(super) const SWEPT_OF_WING: RangeInclusive<f64> = 0.001..=10.0;
/// Energy on board over mass, Wh/kg, at most: petrol alone has 12,000.
pub(super) const MOST_ENERGY_WH_KG: f64 = 12_000.0;
/// Speed of a slipstream, m/s, at most: the exhaust of jets.
pub(super) const MOST_EXIT_SPEED_M_S: f64 = 600.0;
/// Rate of a surface, degrees per second, at most: the fastest servos do 60° in 0.03 s.
pub(super) const MOST_SURFACE_RATE_DEG_S: f64 = 5_000.0;
/// Slope of the lift, 1/rad, at most: thin wings of any aspect ratio have up to 2 π.
pub(super) const MOST_LIFT_SLOPE: f64 = 10.0;
/// Drag without lift, at most: a flat plate across the stream has 2.
pub(super) const MOST_DRAG: f64 = 2.0;
/// Stiffness in pitch and effect of the elevator, 1/rad, at most: a lift slope times a tail arm of three chords.
pub(super) const MOST_PITCH: f64 = 20.0;
/// Damping in pitch, at most: light aircraft have 10 to 40.
pub(super) const MOST_PITCH_DAMPING: f64 = 500.0;
/// Linear drag by sideslip, 1/rad, at most.
pub(super) const MOST_DRAG_BY_BETA: f64 = 2.0;
/// Rolling moments and side forces, 1/rad, at most: of roll damping, the largest, aircraft have up to 1.
pub(super) const MOST_LATERAL: f64 = 10.0;
/// Yawing moments, 1/rad, at most: of the fin's, the largest, aircraft have up to 0.5.
pub(super) const MOST_YAW: f64 = 2.0;
/// Acceleration of a launcher, m/s², at most: 100 times that of gravity.
pub(super) const MOST_LAUNCH_M_S2: f64 = 1_000.0;
/// Airspeed of a launch, m/s, at most, as of the airframe.
pub(super) const MOST_AIRSPEED_M_S: f64 = 300.0;
/// Sink rate of a hard landing, m/s, at most: a fall from 10 m.
pub(super) const MOST_SINK_M_S: f64 = 14.0;

/// Refuses a number of more than `most`, of either sign.
pub(super) fn at_most(key: &'static str, value: f64, most: f64) -> Result<(), FdmError> {
    if value.abs() <= most {
        return Ok(());
    }
    let expected = format!("{most} at most, of either sign; check its unit");
    Err(refuse(key, value, expected))
}

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
