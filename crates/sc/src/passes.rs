//! Straight passes through the plume, planned on the running estimate of where it is.
//!
//! A crosswind pass shows the axis by its centre, σy by its width and the strength by its
//! height; passes at other heights through the same cross-section show H and σz, and passes at
//! another distance whether the two grow as the model has it. Each pass reaches clean air on
//! both sides of the plume, which shows the background and keeps a lagging sensor honest.

use air::geo::Enu;
use csea::Position;
use plume::DispersionSpec;
use protocol::message::Phase;

use crate::fleet::REACHED_M;
use crate::plume_estimate::PlumeEstimate;
use scenario::airspace::Airspace;

/// Shortest half width of a pass, m: a fast vehicle is across any narrower plume in seconds.
const LEAST_HALF_WIDTH_M: f64 = 220.0;
/// Standard deviations of the axis that a pass reaches beyond the plume's own width.
const AXIS_SDS: f64 = 2.0;
/// Half width of the plume in σy, out to 1 % of the axis.
const PLUME_SIGMAS: f64 = 3.0;
/// Steps by which a pass is shortened to fit the airspace, m.
const SHORTEN_M: f64 = 25.0;
/// Height of passes off the axis in σz: where a Gaussian's slope is steepest is 1.
const OFF_AXIS_SIGMAS: f64 = 1.0;

/// Where a pass crosses the plume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Part of the way from the nearest to the farthest distance of the mission's range.
    pub part: f64,
    /// Height above the axis in steps of about the plume's own height.
    pub step: f64,
}

/// Passes that show where the plume is, in order; they repeat. From one to the next the height changes by one step at
/// most: a climb of two takes longer than a pass.
const LOCATE: [Crossing; 10] = [
    at(0.35, 0.0),
    at(0.1, 1.0),
    at(0.1, 0.0),
    at(0.1, -1.0),
    at(0.9, -1.0),
    at(0.9, 0.0),
    at(0.9, 1.0),
    at(0.4, 1.0),
    at(0.4, 0.0),
    at(0.4, -1.0),
];

/// Passes around a peak that has been found, in order; they repeat. A plume that meanders is another
/// at each crossing: most of them are where the peak is.
const CHARACTERISE: [Crossing; 6] = [
    at(0.0, 0.0),
    at(0.0, 1.0),
    at(0.0, 0.0),
    at(0.0, -1.0),
    at(0.6, 0.0),
    at(1.0, 0.0),
];

/// A curtain near the peak, from above the plume to below it; the passes through the peak before are part
/// of it.
const FLUX: [Crossing; 5] = [
    at(0.0, 2.0),
    at(0.0, 1.0),
    at(0.0, 0.0),
    at(0.0, -1.0),
    at(0.0, -2.0),
];

/// The passes of a phase.
pub fn of(phase: Phase) -> &'static [Crossing] {
    match phase {
        Phase::Preliminary | Phase::Search => &LOCATE,
        Phase::Characterise => &CHARACTERISE,
        Phase::Flux => &FLUX,
        Phase::TakeOff | Phase::Home => &[],
    }
}

const fn at(part: f64, step: f64) -> Crossing {
    Crossing { part, step }
}

/// A straight pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// Where it begins.
    pub from: Position,
    /// Where it ends, at the same height unless terrain is followed.
    pub to: Position,
}

/// Distances from the source between which passes are flown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassRange {
    /// Nearest, m.
    pub near_m: f64,
    /// Farthest, m.
    pub far_m: f64,
    /// How far a pass is planned beyond the plume where it leaves it, m: a vehicle turns before the end of its
    /// way, and its sensor has to come back to clean air.
    pub beyond_m: f64,
}

/// Time constants after which a sensor reads clean air again, to 5 %.
const BACK_TO_CLEAN: f64 = 3.0;

impl PassRange {
    /// From the edge of the keep-out, with the margin for turns, to the distance at which c_MAX
    /// is stated, at least half as far again; for a sensor that lags by `lag_m` on its way.
    pub fn of(airspace: &Airspace, margin_m: f64, stated_m: f64, lag_m: f64) -> Self {
        let near_m = (airspace.keep_out_m() + margin_m).max(200.0) + 5.0;
        Self {
            near_m,
            far_m: stated_m.max(1.5 * near_m),
            beyond_m: REACHED_M + BACK_TO_CLEAN * lag_m,
        }
    }
}

/// Plans a pass for a vehicle that is at `here`, so that it begins at the nearer end;
/// shortened to what the airspace allows with `margin_m`. `None` where nothing of it is left.
pub fn plan(
    crossing: Crossing,
    estimate: &PlumeEstimate,
    base: &DispersionSpec,
    airspace: &Airspace,
    range: PassRange,
    margin_m: f64,
    here: Enu,
) -> Option<Pass> {
    let distance_m = range.near_m + crossing.part * (range.far_m - range.near_m);
    let ends = across_ends(estimate, base, airspace, distance_m, margin_m)?;
    let sigma_z_m = estimate.sigmas_m(base, distance_m).1;
    // As long as H is hardly known, the steps must reach as far as it may be off.
    let off_m = (OFF_AXIS_SIGMAS * sigma_z_m).max(estimate.height_sd_m.min(2.0 * sigma_z_m));
    let wanted_m = estimate.height_amsl_m + crossing.step * off_m;
    let [mut from, mut to] = ends;
    // Flown from the nearer end; either direction shows the same.
    if here.distance_m(to) < here.distance_m(from) {
        std::mem::swap(&mut from, &mut to);
    }
    let bearing_deg = from.bearing_deg(to);
    let beyond = |m: f64| to.displaced(bearing_deg, m);
    let mut beyond_m = range.beyond_m;
    while beyond_m > 0.0 && !airspace.leg_is_clear(from, beyond(beyond_m), margin_m) {
        beyond_m -= SHORTEN_M;
    }
    to = beyond(beyond_m.max(0.0));
    let at = |at: Enu| Position {
        at,
        height_m: airspace.clamp_at_m(at, wanted_m),
    };
    Some(Pass {
        from: at(from),
        to: at(to),
    })
}

fn across_ends(
    estimate: &PlumeEstimate,
    base: &DispersionSpec,
    airspace: &Airspace,
    distance_m: f64,
    margin_m: f64,
) -> Option<[Enu; 2]> {
    let axis_sd_m = distance_m * estimate.axis_sd_deg.to_radians();
    let sigma_y_m = estimate.sigmas_m(base, distance_m).0;
    let half_m = (AXIS_SDS * axis_sd_m + PLUME_SIGMAS * sigma_y_m).max(LEAST_HALF_WIDTH_M);
    let end = |side: f64| {
        let mut out_m = half_m;
        while out_m > 0.0 {
            let at = estimate.place(distance_m, side * out_m);
            if airspace.clearance_m(at) >= margin_m {
                return Some(at);
            }
            out_m -= SHORTEN_M;
        }
        None
    };
    let ends = [end(-1.0)?, end(1.0)?];
    airspace
        .leg_is_clear(ends[0], ends[1], margin_m)
        .then_some(ends)
}
