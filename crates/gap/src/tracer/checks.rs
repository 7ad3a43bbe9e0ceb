//! What looks wrong with the tables as a whole before anything is fitted: amounts that are off
//! by a factor, and plumes that lie elsewhere than the wind blows.

use air::geo::wrap_signed_deg;
use formats::number::significant;

use super::arcs::{self, TrialArcs, flaw, mean_azimuth};
use super::predicted::{ArcDetail, Models, arc};
use super::table::Tables;
use crate::statistics::median;
use crate::verdict::{DataQuality, Flaw};

/// Measured over predicted, in the middle of all arcs, that no spread explains: Briggs' curves
/// are within a factor of two on flat ground (Hanna, Briggs & Hosker 1982), and the least slip of
/// a unit, km/h for m/s, is a factor of 3.6.
const LARGEST_FACTOR: f64 = 3.0;
/// Part of arc maxima within a factor of two below which the same holds.
const LEAST_FAC2: f64 = 0.15;
/// Plumes farther than this from where the wind blows are elsewhere, degrees.
const ASIDE_DEG: f64 = 60.0;
/// Deviations of azimuth below this in the middle look like radians, degrees.
const LEAST_AZIMUTH_DEG: f64 = 1.0;
/// Obukhov lengths below this in the middle look like their inverse, m.
const LEAST_OBUKHOV_M: f64 = 1.0;

/// What the tables hold.
pub struct Read {
    /// The trials with weather, their arcs and towers.
    pub trials: Vec<TrialArcs>,
    /// Amounts that are off so far that no cause can be named.
    pub amounts: Option<String>,
    /// Flaws of the tables, those of all trials first.
    pub flaws: Vec<DataQuality>,
    /// What a user should know besides.
    pub notices: Vec<String>,
}

/// Reads the trials and what looks wrong with them.
pub fn read(tables: &Tables) -> Read {
    let (trials, odd, notices) = arcs::trials(tables);
    let amounts = amounts(&trials);
    let messages = [amounts.clone(), direction(&trials), small_numbers(&trials)];
    let unit = |message| flaw("all trials", Flaw::Unit, message);
    Read {
        flaws: messages
            .into_iter()
            .flatten()
            .map(unit)
            .chain(odd)
            .collect(),
        trials,
        amounts,
        notices,
    }
}

fn amounts(trials: &[TrialArcs]) -> Option<String> {
    let none = Models::default();
    let arcs = trials
        .iter()
        .flat_map(|t| t.arcs.iter().map(|a| arc(&t.weather, "", a, &none)));
    let arcs: Vec<_> = arcs.collect();
    let whole = arcs.iter().filter(|a| a.whole);
    let ln_ratios = whole.map(|a| (a.integrated_mg_m2 / a.base_integrated_mg_m2).ln());
    let off = median(ln_ratios.collect())?;
    let ln_off = |a: &&ArcDetail| (a.max_mg_m3 / a.base_max_mg_m3).ln();
    let near = arcs.iter().filter(|a| ln_off(a).abs() <= 2.0_f64.ln());
    let fac2 = near.count() as f64 / arcs.len() as f64;
    if off.abs() <= LARGEST_FACTOR.ln() && fac2 >= LEAST_FAC2 {
        return None;
    }
    let factor = significant(off.exp());
    Some(format!(
        "measured crosswind integrals are {factor} times what Briggs' plume gives in the median of all arcs, and \
         a fraction of {fac2:.2} of the arc maxima is within a factor of two: no spread explains this. Check the \
         units of source_rate_g_s, concentration_mg_m3, wind_speed_m_s, east_m, north_m, height_agl_m and \
         source_height_agl_m, and the release itself"
    ))
}

/// Angle between two directions, degrees.
fn between_deg(a: f64, b: f64) -> f64 {
    wrap_signed_deg(b - a).abs()
}

fn direction(trials: &[TrialArcs]) -> Option<String> {
    // (where the wind blows, where the plume lies), degrees.
    let pair = |t: &TrialArcs| {
        let bearings = t.arcs.iter().map(|a| (a.bearing_deg.to_radians(), 1.0));
        let lies = mean_azimuth(bearings).to_degrees();
        Some((t.weather.wind_from_deg? + 180.0, lies))
    };
    let pairs: Vec<(f64, f64)> = trials.iter().filter_map(pair).collect();
    let most = |agree: &dyn Fn(&(f64, f64)) -> bool| {
        2 * pairs.iter().filter(|p| agree(p)).count() > pairs.len()
    };
    if !most(&|(towards, lies)| between_deg(*towards, *lies) > ASIDE_DEG) {
        return None;
    }
    let guess = if most(&|(towards, lies)| between_deg(towards + 180.0, *lies) < ASIDE_DEG / 2.0) {
        "wind_from_deg looks like the direction towards which the wind blows, or east_m and north_m \
         have the wrong sign"
    } else if most(&|(towards, lies)| between_deg(*towards, 90.0 - lies) < ASIDE_DEG / 2.0) {
        "east_m and north_m look swapped"
    } else {
        "check wind_from_deg, east_m and north_m"
    };
    Some(format!(
        "in most trials the plume lies more than {ASIDE_DEG} degrees from the downwind direction: {guess}. The \
         fits do not use the direction"
    ))
}

fn small_numbers(trials: &[TrialArcs]) -> Option<String> {
    let weather = || trials.iter().map(|t| &t.weather);
    let azimuth = median(weather().filter_map(|w| w.sigma_azimuth_rad).collect());
    let length = median(weather().map(|w| w.obukhov_length_m.abs()).collect());
    if azimuth.is_some_and(|a| a.to_degrees() < LEAST_AZIMUTH_DEG) {
        Some("sigma_azimuth_deg is below 1 degree in most trials; it looks like radians".into())
    } else if length.is_some_and(|l| l < LEAST_OBUKHOV_M) {
        Some("obukhov_length_m is below 1 m in most trials; it looks like its inverse".into())
    } else {
        None
    }
}
