//! Straight passes through the plume, planned on the running estimate of where it is.
//!
//! A crosswind pass shows the axis by its centre, σy by its width and the strength by its
//! height; passes at other heights through the same cross-section show H and σz, and passes at
//! another distance whether the two grow as the model has it. Each pass reaches clean air on
//! both sides of the plume, which shows the background and keeps a lagging sensor honest.

use air::geo::Enu;
use csea::Position;
use plume::DispersionSpec;

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

/// What a pass shall show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PassKind {
    /// Across the plume at a distance (0: nearest, 1: farthest of the mission's range) and a
    /// height off the axis in steps (−1, 0, 1).
    Across {
        /// Part of the way from the nearest to the farthest distance.
        part: f64,
        /// Steps above the axis.
        step: f64,
    },
    /// Along the axis, at a height off it in steps.
    Along {
        /// Steps above the axis.
        step: f64,
    },
}

/// Preliminary passes, in order; from the fourth on they repeat.
pub const PRELIMINARY: [PassKind; 9] = [
    across(0.35, 0.0),
    across(0.1, 1.0),
    across(0.1, -1.0),
    across(0.9, 0.0),
    across(0.1, 0.0),
    across(0.9, 1.0),
    across(0.9, -1.0),
    across(0.4, 1.0),
    across(0.4, -1.0),
];

/// Passes around a peak that has been found, in order; they repeat.
pub const CHARACTERISE: [PassKind; 6] = [
    across(0.0, 0.0),
    PassKind::Along { step: 0.0 },
    across(0.0, 1.0),
    across(0.0, -1.0),
    across(0.6, 0.0),
    across(1.0, 0.0),
];

const fn across(part: f64, step: f64) -> PassKind {
    PassKind::Across { part, step }
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
}

impl PassRange {
    /// From the edge of the keep-out, with the margin for turns, to the distance at which c_MAX
    /// is stated, at least half as far again.
    pub fn of(airspace: &Airspace, margin_m: f64, stated_m: f64) -> Self {
        let near_m = (airspace.keep_out_m() + margin_m).max(200.0) + 5.0;
        Self {
            near_m,
            far_m: stated_m.max(1.5 * near_m),
        }
    }
}

/// Plans the pass `kind` for a vehicle that is at `here`, so that it begins at the nearer end;
/// shortened to what the airspace allows with `margin_m`. `None` where nothing of it is left.
pub fn plan(
    kind: PassKind,
    estimate: &PlumeEstimate,
    base: &DispersionSpec,
    airspace: &Airspace,
    range: PassRange,
    margin_m: f64,
    here: Enu,
) -> Option<Pass> {
    let (step, ends) = match kind {
        PassKind::Across { part, step } => {
            let distance_m = range.near_m + part * (range.far_m - range.near_m);
            (
                step,
                across_ends(estimate, base, airspace, distance_m, margin_m)?,
            )
        }
        PassKind::Along { step } => (step, along_ends(estimate, airspace, range, margin_m)?),
    };
    let middle_m =
        0.5 * (estimate.source.distance_m(ends[0]) + estimate.source.distance_m(ends[1]));
    let sigma_z_m = estimate.sigmas_m(base, middle_m.max(1.0)).1;
    // As long as H is hardly known, the steps must reach as far as it may be off.
    let off_m = (OFF_AXIS_SIGMAS * sigma_z_m).max(estimate.height_sd_m.min(2.0 * sigma_z_m));
    let wanted_m = estimate.height_amsl_m + step * off_m;
    let [mut from, mut to] = ends;
    // Flown from the nearer end; either direction shows the same.
    if here.distance_m(to) < here.distance_m(from) {
        std::mem::swap(&mut from, &mut to);
    }
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

fn along_ends(
    estimate: &PlumeEstimate,
    airspace: &Airspace,
    range: PassRange,
    margin_m: f64,
) -> Option<[Enu; 2]> {
    let near = estimate.place(range.near_m, 0.0);
    let mut far_m = range.far_m;
    while far_m > range.near_m + 2.0 * SHORTEN_M {
        let far = estimate.place(far_m, 0.0);
        if airspace.clearance_m(far) >= margin_m && airspace.leg_is_clear(near, far, margin_m) {
            return Some([near, far]);
        }
        far_m -= SHORTEN_M;
    }
    None
}
