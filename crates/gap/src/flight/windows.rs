//! What improved in a pilot's units: the error of motion predicted for a few seconds from its own
//! start, channel by channel.
//!
//! An aircraft flown by its commands alone drifts off, the best model too, since gusts are not in
//! the commands. So a window is short, starts where the aircraft was, and the middle window is
//! told: one in which the simulation ran away does not count for all.

use serde::Serialize;

use super::channel::ALL;
use super::histories::{History, WINDOW_S};
use crate::statistics::median;

/// Least part of a window's rows that must have been read.
const READ_PART: f64 = 0.2;
/// Channels that are told in words.
const TOLD: [&str; 6] = [
    "roll rate",
    "pitch rate",
    "yaw rate",
    "roll angle",
    "pitch angle",
    "airspeed",
];

/// Error of the predicted motion in one channel: root mean square in a window, of the middle one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionError {
    /// Channel.
    pub label: &'static str,
    /// Unit of the errors.
    pub unit: &'static str,
    /// Length of a window, s.
    pub window_s: f64,
    /// Number of windows.
    pub windows: usize,
    /// Error of the aircraft of the file.
    pub before: f64,
    /// Error of the extended aircraft.
    pub after: f64,
    /// Windows in which the extended aircraft is nearer.
    pub better_in: usize,
}

/// Root mean square errors of both models in the window from `from` to `to`; none where too little
/// of it was read.
fn window(history: &History, from: usize, to: usize) -> Option<[f64; 2]> {
    let read: Vec<usize> = (from..to)
        .filter(|&i| history.measured[i].is_finite())
        .collect();
    let enough = !read.is_empty() && read.len() as f64 >= READ_PART * (to - from) as f64;
    let of = |told: &[f64]| {
        let squares = read
            .iter()
            .map(|&i| (told[i] - history.measured[i]).powi(2));
        (squares.sum::<f64>() / read.len() as f64).sqrt()
    };
    let errors = [of(&history.base), of(&history.extended)];
    (enough && errors.iter().all(|e| e.is_finite())).then_some(errors)
}

/// Errors over all windows of each channel.
pub fn errors(histories: &[History]) -> Vec<MotionError> {
    let of_channel = |label: &str| -> Vec<[f64; 2]> {
        let all = histories.iter().filter(|h| h.label == label);
        let each = all.flat_map(|h| {
            let ends = h.starts.iter().skip(1).copied().chain([h.time_s.len()]);
            let windows = h.starts.iter().copied().zip(ends);
            windows.filter_map(|(from, to)| window(h, from, to))
        });
        each.collect()
    };
    ALL.iter()
        .filter_map(|channel| {
            let windows = of_channel(channel.label);
            let middle = |k: usize| median(windows.iter().map(|w| w[k]).collect());
            Some(MotionError {
                label: channel.label,
                unit: channel.unit,
                window_s: WINDOW_S,
                windows: windows.len(),
                before: middle(0)?,
                after: middle(1)?,
                better_in: windows.iter().filter(|w| w[1] < w[0]).count(),
            })
        })
        .collect()
}

/// The errors in a sentence; `extended` says whether anything was added to the aircraft.
pub fn in_words(errors: &[MotionError], extended: bool) -> Option<String> {
    let told: Vec<String> = TOLD
        .iter()
        .filter_map(|label| errors.iter().find(|e| e.label == *label))
        .map(|e| {
            if extended {
                let (before, after) = (e.before, e.after);
                format!("{} {before:.1} -> {after:.1} {}", e.label, e.unit)
            } else {
                format!("{} {:.1} {}", e.label, e.before, e.unit)
            }
        })
        .collect();
    let first = errors.first()?;
    let whose = if extended {
        "the aircraft of the file -> the extended one"
    } else {
        "the aircraft of the file"
    };
    Some(format!(
        "Predicted for {:.0} s from its own start, {} times, the motion has an error of (middle window; \
         {whose}): {}.",
        first.window_s,
        first.windows,
        told.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three windows of four rows; the base is off by 3, 1 and 100, the extension by 2, 2 and 2.
    fn history() -> History {
        let rows = |each: [f64; 3]| each.iter().flat_map(|v| [*v; 4]).collect::<Vec<f64>>();
        History {
            label: "roll rate",
            unit: "deg/s",
            time_s: (0..12).map(|i| 0.5 * f64::from(i)).collect(),
            measured: vec![0.0; 12],
            base: rows([3.0, -1.0, 100.0]),
            extended: rows([2.0, 2.0, -2.0]),
            starts: vec![0, 4, 8],
            base_standardised: Vec::new(),
            extended_standardised: Vec::new(),
        }
    }

    #[test]
    fn a_window_that_ran_away_does_not_count_for_all() {
        let told = errors(&[history()]);
        let [roll] = &told[..] else {
            panic!("{told:?}")
        };
        assert_eq!((roll.before, roll.after), (3.0, 2.0));
        assert_eq!((roll.windows, roll.better_in), (3, 2));
        let words = in_words(&told, true).unwrap();
        assert!(words.contains("roll rate 3.0 -> 2.0 deg/s"), "{words}");
        let words = in_words(&told, false).unwrap();
        assert!(words.ends_with("roll rate 3.0 deg/s."), "{words}");
    }

    #[test]
    fn windows_that_were_not_read_are_not_told() {
        let mut unread = history();
        unread.measured.fill(f64::NAN);
        assert_eq!(errors(&[unread]), []);
        assert_eq!(in_words(&[], true), None);
    }
}
