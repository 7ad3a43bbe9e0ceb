//! Whether readings follow a predicted plume at all.

use super::data::Data;

/// Correlation of readings with what is predicted of them from which on they follow it.
const FOLLOWS: f64 = 0.5;
/// Part of the readings at either end that is cut to what the rest reaches.
const CUT_PART: f64 = 0.005;

/// Whether the readings follow what is predicted of them.
pub(super) fn followed(data: &Data, predicted_ppm: &[f64]) -> bool {
    correlation(data, predicted_ppm) >= FOLLOWS
}

/// Correlation of the readings with what is predicted of them; a few that are far off do not decide.
pub(super) fn correlation(data: &Data, predicted_ppm: &[f64]) -> f64 {
    let (low, high) = reach_ppm(data);
    let used = (0..data.len()).filter(|i| data.used[*i]);
    let pairs: Vec<(f64, f64)> = used
        .map(|i| (data.reading_ppm[i].clamp(low, high), predicted_ppm[i]))
        .collect();
    let n = pairs.len() as f64;
    let (ma, mb) = pairs
        .iter()
        .fold((0.0, 0.0), |s, (a, b)| (s.0 + a / n, s.1 + b / n));
    let [both, aa, bb] = pairs.iter().fold([0.0; 3], |[ab, aa, bb], (a, b)| {
        let (a, b) = (a - ma, b - mb);
        [ab + a * b, aa + a * a, bb + b * b]
    });
    both / (aa * bb).sqrt().max(1e-300)
}

/// What all but a few readings reach, down and up, ppm.
pub(super) fn reach_ppm(data: &Data) -> (f64, f64) {
    let mut sorted: Vec<f64> = (0..data.len())
        .filter(|i| data.used[*i])
        .map(|i| data.reading_ppm[i])
        .collect();
    sorted.sort_by(f64::total_cmp);
    let at = |part: f64| sorted[(part * (sorted.len() - 1) as f64) as usize];
    (at(CUT_PART), at(1.0 - CUT_PART))
}
