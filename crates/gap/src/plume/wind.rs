//! The wind that carried the plume: a log is noisy, but the wind it shows may also really change.

use ::plume::field::Transport;
use ::plume::track::Track;
use infer::{InferError, Question};

use super::data::{Data, Setup};
use super::model::PlumeModel;

/// Logged winds are averaged over one of these times on both sides, s: as it is logged, over gusts,
/// over minutes, over the time of a mean, and over the whole record.
const AVERAGED_S: [f64; 5] = [0.0, 30.0, 120.0, 600.0, f64::INFINITY];

/// `track` in a wind that is the mean of what was logged within `averaged_s` before and after each
/// row, by any platform.
fn averaged(track: &Track, logged: &[bool], averaged_s: f64) -> Track {
    let mut out = track.clone();
    if averaged_s == 0.0 {
        return out;
    }
    let times = track.time_s();
    let mut order: Vec<usize> = (0..track.len()).collect();
    order.sort_by(|a, b| times[*a].total_cmp(&times[*b]));
    let (mut first, mut next) = (0, 0);
    // East, north, speed, number: each row enters and leaves the sums once.
    let mut sum = [0.0; 4];
    let mut add = |i: usize, times: f64| {
        let t = track.transport()[i];
        let own = [t.east * t.speed_m_s, t.north * t.speed_m_s, t.speed_m_s, 1.0];
        if logged[i] {
            for (s, own) in sum.iter_mut().zip(own) {
                *s += times * own;
            }
        }
        sum
    };
    for &i in &order {
        let mut now = [0.0; 4];
        while next < order.len() && times[order[next]] <= times[i] + averaged_s {
            now = add(order[next], 1.0);
            next += 1;
        }
        while times[order[first]] < times[i] - averaged_s {
            now = add(order[first], -1.0);
            first += 1;
        }
        if now[3] == 0.0 {
            now = add(i, 0.0);
        }
        let length = now[0].hypot(now[1]);
        if now[3] > 0.5 && length > 0.0 {
            out.transport_mut()[i] = Transport {
                east: now[0] / length,
                north: now[1] / length,
                speed_m_s: now[2] / now[3],
            };
        }
    }
    out
}

/// The track of `data` in the wind under which the base fits its readings best, and over what time a
/// log was averaged for it, s; none without a log.
pub(crate) fn carrying(
    setup: &Setup,
    data: &Data,
    question: &Question<'_>,
) -> Result<(Track, Option<f64>), InferError> {
    if !data.on_board_wind {
        return Ok((data.track.clone(), None));
    }
    let logged: Vec<bool> = data.wind.iter().map(Option::is_some).collect();
    let mut best: Option<(f64, Track, f64)> = None;
    for averaged_s in AVERAGED_S {
        let track = averaged(&data.track, &logged, averaged_s);
        let evidence = question.quick(&PlumeModel::new(setup, &track))?;
        if best.as_ref().is_none_or(|b| evidence > b.0) {
            best = Some((evidence, track, averaged_s));
        }
    }
    Ok(best.map_or_else(
        || (data.track.clone(), None),
        |(_, track, averaged_s)| (track, Some(averaged_s)),
    ))
}

/// A wind in words.
pub(crate) fn describe(averaged_s: Option<f64>) -> String {
    match averaged_s {
        None => "the scenario's wind".to_string(),
        Some(0.0) => "the logged wind of each row".to_string(),
        Some(s) if s.is_finite() => {
            format!("the logged wind, averaged over {s:.0} s before and after each row")
        }
        Some(_) => "the mean of the logged wind".to_string(),
    }
}
