//! Straight passes through the plume, planned on the running estimate of where it is.
//!
//! A crosswind pass shows the axis by its centre, σy by its width and the strength by its
//! height; passes at other heights through the same cross-section show H and σz, and passes at
//! another distance whether the two grow as the model has it. Each pass reaches clean air on
//! both sides of the plume, which shows the background and keeps a lagging sensor honest.

use air::geo::Enu;
use csea::Position;
use plume::DispersionSpec;
use plume::sigma::{sigma_y_m, sigma_z_m};
use protocol::message::Model;

use crate::airspace::Airspace;

/// Shortest half width of a pass, m: a fast vehicle is across any narrower plume in seconds.
const LEAST_HALF_WIDTH_M: f64 = 220.0;
/// Standard deviations of the axis that a pass reaches beyond the plume's own width.
const AXIS_SDS: f64 = 2.0;
/// Half width of the plume in σy, out to 1 % of the axis.
const PLUME_SIGMAS: f64 = 3.0;
/// Factors on σ outside these are not believed in planning: an estimate that has gone astray
/// must not lead the passes out of the plume.
const LEAST_FACTOR: f64 = 0.3;
/// See [`LEAST_FACTOR`].
const GREATEST_FACTOR: f64 = 2.5;
/// Steps by which a pass is shortened to fit the airspace, m.
const SHORTEN_M: f64 = 25.0;
/// Height of passes off the axis in σz: where a Gaussian's slope is steepest is 1.
const OFF_AXIS_SIGMAS: f64 = 1.0;

/// Where the plume is believed to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief {
    /// Foot of the stack.
    pub source: Enu,
    /// Direction towards which the axis runs, degrees.
    pub axis_deg: f64,
    /// Its standard deviation, degrees.
    pub axis_sd_deg: f64,
    /// Height of the axis, m above mean sea level.
    pub height_amsl_m: f64,
    /// Its standard deviation, m.
    pub height_sd_m: f64,
    /// c_MAX's standard deviation as a part of it.
    pub strength_sd: f64,
    /// Factors on σy and σz, each with one standard deviation added: passes had rather be long.
    pub sigma_factors: (f64, f64),
}

impl Belief {
    /// What a model says.
    pub fn of(model: &Model, base: &DispersionSpec) -> Self {
        let [y, z] = [&model.sigma_y_scale, &model.sigma_z_scale]
            .map(|s| (s.value + s.sd).clamp(LEAST_FACTOR, GREATEST_FACTOR));
        Self {
            source: base.sources.first().map_or(Enu::default(), |s| s.place),
            axis_deg: model.axis_deg.value,
            axis_sd_deg: model.axis_deg.sd.clamp(0.0, 30.0),
            height_amsl_m: base.ground_amsl_m + model.effective_height_agl_m.value,
            height_sd_m: model.effective_height_agl_m.sd.clamp(0.0, 200.0),
            strength_sd: model.c_max_ppm.sd / model.c_max_ppm.value.max(1.0),
            sigma_factors: (y, z),
        }
    }

    /// Spread (σy, σz) at a distance, generously, m.
    pub fn sigmas_m(&self, base: &DispersionSpec, distance_m: f64) -> (f64, f64) {
        (
            self.sigma_factors.0 * sigma_y_m(distance_m, base.stability, base.setting),
            self.sigma_factors.1 * sigma_z_m(distance_m, base.stability, base.setting),
        )
    }

    /// Whether passes have shown enough: axis to 1.5°, height to 8 m, c_MAX to 8 %.
    pub fn is_sharp(&self) -> bool {
        self.axis_sd_deg < 1.5 && self.height_sd_m < 8.0 && self.strength_sd < 0.08
    }

    /// The place `distance_m` down the axis and `right_m` to its right.
    pub fn place(&self, distance_m: f64, right_m: f64) -> Enu {
        self.source
            .displaced(self.axis_deg, distance_m)
            .displaced(self.axis_deg + 90.0, right_m)
    }
}

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
    /// Where it ends, at the same height.
    pub to: Position,
}

/// Distances from the source between which passes are flown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Nearest, m.
    pub near_m: f64,
    /// Farthest, m.
    pub far_m: f64,
}

impl Range {
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
    belief: &Belief,
    base: &DispersionSpec,
    airspace: &Airspace,
    range: Range,
    margin_m: f64,
    here: Enu,
) -> Option<Pass> {
    let (step, ends) = match kind {
        PassKind::Across { part, step } => {
            let distance_m = range.near_m + part * (range.far_m - range.near_m);
            (
                step,
                across_ends(belief, base, airspace, distance_m, margin_m)?,
            )
        }
        PassKind::Along { step } => (step, along_ends(belief, airspace, range, margin_m)?),
    };
    let middle_m = 0.5 * (belief.source.distance_m(ends[0]) + belief.source.distance_m(ends[1]));
    let sigma_z_m = belief.sigmas_m(base, middle_m.max(1.0)).1;
    // As long as H is hardly known, the steps must reach as far as it may be off.
    let off_m = (OFF_AXIS_SIGMAS * sigma_z_m).max(belief.height_sd_m.min(2.0 * sigma_z_m));
    let height_m = airspace.clamp_height_m(belief.height_amsl_m + step * off_m);
    let [mut from, mut to] = ends;
    if here.distance_m(to) < here.distance_m(from) {
        std::mem::swap(&mut from, &mut to);
    }
    let at = |at: Enu| Position { at, height_m };
    Some(Pass {
        from: at(from),
        to: at(to),
    })
}

fn across_ends(
    belief: &Belief,
    base: &DispersionSpec,
    airspace: &Airspace,
    distance_m: f64,
    margin_m: f64,
) -> Option<[Enu; 2]> {
    let axis_sd_m = distance_m * belief.axis_sd_deg.to_radians();
    let sigma_y_m = belief.sigmas_m(base, distance_m).0;
    let half_m = (AXIS_SDS * axis_sd_m + PLUME_SIGMAS * sigma_y_m).max(LEAST_HALF_WIDTH_M);
    let end = |side: f64| {
        let mut out_m = half_m;
        while out_m > 0.0 {
            let at = belief.place(distance_m, side * out_m);
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
    belief: &Belief,
    airspace: &Airspace,
    range: Range,
    margin_m: f64,
) -> Option<[Enu; 2]> {
    let near = belief.place(range.near_m, 0.0);
    let mut far_m = range.far_m;
    while far_m > range.near_m + 2.0 * SHORTEN_M {
        let far = belief.place(far_m, 0.0);
        if airspace.clearance_m(far) >= margin_m && airspace.leg_is_clear(near, far, margin_m) {
            return Some([near, far]);
        }
        far_m -= SHORTEN_M;
    }
    None
}
