//! What it does to a rate that the position of the source is uncertain.

/// The rate is compared for sources displaced by this part of their distance: small against the plume's growth.
const STEP_PART: f64 = 0.05;

/// Variance of ln rate by a position that is known to `sd_m` east and north, where `ln_rate` gives the estimate for a
/// source that is displaced by so many metres, and readings lie at `distance_m`.
pub fn variance(sd_m: f64, distance_m: f64, ln_rate: &dyn Fn([f64; 2]) -> f64) -> f64 {
    if sd_m <= 0.0 {
        return 0.0;
    }
    let step_m = sd_m.min(STEP_PART * distance_m);
    let along = |to: [f64; 2]| {
        let at = |sign: f64| ln_rate(to.map(|part| sign * step_m * part));
        (at(1.0) - at(-1.0)) / (2.0 * step_m)
    };
    let [east, north] = [along([1.0, 0.0]), along([0.0, 1.0])];
    (sd_m * east.hypot(north)).powi(2)
}
