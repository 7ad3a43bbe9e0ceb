//! Straight passes through the plume, planned on the running estimate of where it is.
//!
//! A crosswind pass shows the axis by its centre, σy by its width and the strength by its
//! height; passes at other heights through the same cross-section show H and σz, and passes at
//! another distance whether the two grow as the model has it. A pass is as long as the plume is wide and its axis
//! uncertain, and no longer: eddies displace the plume from crossing to crossing, and their number is what counts. Clean
//! air need not be reached, since the mission's other readings show the background.

use air::geo::Enu;
use csea::Position;
use plume::{DispersionSpec, SourceSpec};
use protocol::message::Phase;

use crate::fleet::REACHED_M;
use crate::plume_estimate::PlumeEstimate;
use scenario::airspace::Airspace;

/// Shortest half width of a pass, m: a fast vehicle is across any narrower plume in seconds.
const LEAST_HALF_WIDTH_M: f64 = 220.0;
/// Half width of a pass in standard deviations of where the plume is: 1 % of a normal distribution lies beyond, and the
/// mass balance of the pass lacks no more.
const HALF_WIDTH_SDS: f64 = 2.6;
/// A pass is to be at its height from so many of them before the axis on: the mass balance counts passes that cross the plume
/// level for two standard deviations to both sides.
const LEVEL_FROM_SDS: f64 = 2.0;
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

/// Distances among which passes of a plume that has been located are chosen, as parts of the range, and heights, as
/// steps.
const PARTS: [f64; 5] = [0.0, 0.1, 0.25, 0.5, 1.0];
const STEPS: [f64; 7] = [0.0, 0.5, -0.5, 1.0, -1.0, 1.5, -1.5];

/// A curtain near the peak, from above the plume to below it; the passes through the peak before are part
/// of it.
const FLUX: [Crossing; 5] = [
    at(0.0, 2.0),
    at(0.0, 1.0),
    at(0.0, 0.0),
    at(0.0, -1.0),
    at(0.0, -2.0),
];

/// The `number`-th pass of a phase, from 0, where its passes have an order: those that locate the plume repeat, the
/// curtain is flown once. All others are chosen among [`candidates`].
pub fn in_order(phase: Phase, number: usize) -> Option<Crossing> {
    match phase {
        Phase::Preliminary | Phase::Search => LOCATE.get(number % LOCATE.len()).copied(),
        Phase::Flux => FLUX.get(number).copied(),
        Phase::Characterise | Phase::TakeOff | Phase::Home => None,
    }
}

/// Passes among which the next one is chosen.
pub fn candidates() -> impl Iterator<Item = Crossing> {
    PARTS
        .into_iter()
        .flat_map(|part| STEPS.into_iter().map(move |step| at(part, step)))
}

/// The lowest and the highest candidate nearest to the source: between them most passes are flown.
pub fn nearest() -> [Crossing; 2] {
    [at(PARTS[0], STEPS[6]), at(PARTS[0], STEPS[5])]
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
    /// Where it crosses the axis.
    pub axis: Position,
    /// Distance of that from the source, m.
    pub distance_m: f64,
    /// How far it is from its beginning to where it is to be at its height, m.
    pub lead_m: f64,
}

/// Distances from the source between which passes are flown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassRange {
    /// Nearest, m.
    pub near_m: f64,
    /// Farthest, m.
    pub far_m: f64,
    /// How far a pass is planned beyond the plume where it leaves it, m: a vehicle turns before the end of its
    /// way, and its sensor lags.
    pub beyond_m: f64,
}

/// Time constants by which a sensor reads the plume late.
const LAGS: f64 = 1.0;

impl PassRange {
    /// From the edge of the keep-out, with the margin for turns, to the distance at which c_MAX
    /// is stated, at least half as far again; for a sensor that lags by `lag_m` on its way.
    pub fn of(airspace: &Airspace, margin_m: f64, stated_m: f64, lag_m: f64) -> Self {
        let near_m = (airspace.keep_out_m() + margin_m).max(200.0) + 5.0;
        Self {
            near_m,
            far_m: stated_m.max(1.5 * near_m),
            beyond_m: REACHED_M + LAGS * lag_m,
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
    let axis = estimate.place(distance_m, 0.0);
    let sigma_z_m = estimate.sigmas_m(base, distance_m).1;
    let sigma_z_sd_m = estimate.sigma_sds_m(base, distance_m).1.min(sigma_z_m);
    // As long as H and σz are hardly known, the steps must reach as far as they may be off.
    let off_m = (OFF_AXIS_SIGMAS * sigma_z_m)
        .hypot(sigma_z_sd_m)
        .max(estimate.height_sd_m.min(2.0 * sigma_z_m));
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
    let level_m = LEVEL_FROM_SDS * estimate.across_sd_m(base, distance_m);
    Some(Pass {
        from: at(from),
        to: at(to),
        axis: at(axis),
        distance_m,
        lead_m: (from.distance_m(axis) - level_m).max(0.0),
    })
}

/// Half width of a pass through the plume of one source at a distance from it, m.
fn half_width_m(estimate: &PlumeEstimate, base: &DispersionSpec, distance_m: f64) -> f64 {
    (HALF_WIDTH_SDS * estimate.across_sd_m(base, distance_m)).max(LEAST_HALF_WIDTH_M)
}

/// How far a pass at a distance reaches to the left of the axis and to the right of it, m: through the first source's
/// plume, and those of other sources of the scenario that lie in it or touch it.
fn reach_m(estimate: &PlumeEstimate, base: &DispersionSpec, distance_m: f64) -> [f64; 2] {
    let half_m = half_width_m(estimate, base, distance_m);
    let other = |source: &SourceSpec| {
        let [along_m, right_m] = estimate.along_and_right_m(source.place);
        let other_m = half_width_m(estimate, base, (distance_m - along_m).max(0.0));
        let touches = along_m < distance_m && right_m.abs() < half_m + other_m;
        touches.then_some([other_m - right_m, other_m + right_m])
    };
    let others = base.sources.iter().filter_map(other);
    others.fold([half_m; 2], |[left, right], [l, r]| {
        [left.max(l), right.max(r)]
    })
}

/// Whether a vehicle at `here` on `pass` has left the plume behind as it is known now: a pass that was planned on less
/// ends there.
pub fn has_left_plume(
    pass: &Pass,
    estimate: &PlumeEstimate,
    base: &DispersionSpec,
    range: PassRange,
    here: Enu,
) -> bool {
    let [distance_m, right_m] = estimate.along_and_right_m(here);
    let side = |at: Enu| estimate.along_and_right_m(at)[1].signum();
    let (from, to) = (side(pass.from.at), side(pass.to.at));
    let [left_m, to_right_m] = reach_m(estimate, base, distance_m.max(0.0));
    let out_m = if to < 0.0 { left_m } else { to_right_m };
    from != to && right_m * to >= out_m + range.beyond_m - REACHED_M
}

fn across_ends(
    estimate: &PlumeEstimate,
    base: &DispersionSpec,
    airspace: &Airspace,
    distance_m: f64,
    margin_m: f64,
) -> Option<[Enu; 2]> {
    let [left_m, right_m] = reach_m(estimate, base, distance_m);
    let end = |side: f64, mut out_m: f64| {
        while out_m > 0.0 {
            let at = estimate.place(distance_m, side * out_m);
            if airspace.clearance_m(at) >= margin_m {
                return Some(at);
            }
            out_m -= SHORTEN_M;
        }
        None
    };
    let ends = [end(-1.0, left_m)?, end(1.0, right_m)?];
    airspace
        .leg_is_clear(ends[0], ends[1], margin_m)
        .then_some(ends)
}
