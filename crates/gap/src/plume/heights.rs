//! Heights of another unit or datum than they are taken for. Readings that do not follow the
//! predicted plume at the heights as they are written may follow it where these are feet, or heights
//! above ground; then nothing can be said of a plume until that is put right.

use scenario::observations::Observations;

use super::fit::{Context, Fitted};
use super::followed::{followed, reach_ppm};
use super::{gate, start};

/// What the base's evidence at other heights must gain over that of all that was named at these,
/// nats: a height that is off by the site's own may be named an offset.
const CLEARLY_NATS: f64 = 10.0;
/// Standard deviations of the white noise that a plume stands out by.
const STANDS_OUT: f64 = 5.0;
/// Heights that differ by less are alike, m.
const ALIKE_M: f64 = 20.0;
/// Highest that the middle of a track is expected, m above ground.
const HIGHEST_M: f64 = 5_000.0;
/// Metres in a foot (exact, 1959).
const FOOT_M: f64 = 0.3048;

/// What `alt_amsl_m` may hold instead, in words, the metres in its unit, and whether it counts from
/// the ground.
const OTHERS: [(&str, f64, bool); 3] = [
    ("feet", FOOT_M, false),
    ("metres above ground", 1.0, true),
    ("feet above ground", FOOT_M, true),
];

/// What the heights look like, in words, if the readings do not follow the plume of `base` and the
/// base at other heights is clearly better than all that was named, which is `last`.
pub(super) fn doubted(
    ctx: &Context<'_>,
    observations: &Observations,
    base: &Fitted,
    last: &Fitted,
) -> Option<String> {
    let data = ctx.data;
    let (low, high) = reach_ppm(data);
    let has_plume = high - low > 2.0 * STANDS_OUT * last.noise.white_ppm();
    if !has_plume || followed(data, &base.prediction.reading) {
        return None;
    }
    // Names were ranked under one noise: with its own they compare with what has another.
    let named = ctx.refine(&last.model, last.noise).log_evidence;
    let ground_m = ctx.setup.base.ground_amsl_m;
    let (words, ..) = OTHERS.iter().find(|(_, unit_m, from_ground)| {
        let other = |alt: f64| unit_m * alt + if *from_ground { ground_m } else { 0.0 };
        plausible(observations, ground_m, other) && follows(ctx, observations, other, named)
    })?;
    Some(format!(
        "the readings do not follow the plume at these heights, and do if alt_amsl_m is in {words}: \
         it must be in metres above mean sea level"
    ))
}

/// Whether heights turned into `other` ones could be flown, and differ.
fn plausible(observations: &Observations, ground_m: f64, other: impl Fn(f64) -> f64) -> bool {
    let mut heights: Vec<f64> = observations.rows.iter().map(|r| r.alt_amsl_m).collect();
    heights.sort_by(f64::total_cmp);
    let Some(middle_m) = heights.get(heights.len() / 2) else {
        return false;
    };
    let there_m = other(*middle_m);
    (0.0..HIGHEST_M).contains(&(there_m - ground_m)) && (there_m - middle_m).abs() > ALIKE_M
}

/// Whether the readings follow the base's plume at `other` heights, and that is clearly more probable
/// than what was `named`, by its log evidence.
fn follows(
    ctx: &Context<'_>,
    observations: &Observations,
    other: impl Fn(f64) -> f64,
    named: f64,
) -> bool {
    let mut own = observations.clone();
    for row in &mut own.rows {
        row.alt_amsl_m = other(row.alt_amsl_m);
    }
    let Ok((Some(mut there), _)) = gate::passed(ctx.setup, &own) else {
        return false;
    };
    let base = start::start(ctx.setup, &mut there, ctx.threads).fitted;
    // Of another number of readings the evidence does not compare.
    there.used_count() == ctx.data.used_count()
        && base.log_evidence > named + CLEARLY_NATS
        && followed(&there, &base.prediction.reading)
}
