//! The wind that carried the plume: a log is noisy, but the wind it shows may also really change.

use ::plume::field::Transport;
use ::plume::track::Track;
use infer::{ForwardModel, InferError, Question};

use super::catalogue;
use super::data::{Data, Setup};
use super::elsewhere;
use super::model::{PlumeModel, Scale};

/// What of a log carries the plume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Carried {
    /// The mean within this time before and after each row, s.
    About(f64),
    /// The mean over the way that the air took from the source.
    OnItsWay,
}

/// What is tried: as it is logged, over the noise of a vane, over gusts, over minutes, over the time of a mean, over the whole
/// record, and over the air's way.
const TRIED: [Carried; 8] = [
    Carried::About(0.0),
    Carried::About(4.0),
    Carried::About(12.0),
    Carried::About(30.0),
    Carried::About(120.0),
    Carried::About(600.0),
    Carried::About(f64::INFINITY),
    Carried::OnItsWay,
];
/// The same where little time is to be had.
const TRIED_IN_FLIGHT: [Carried; 4] = [
    Carried::About(30.0),
    Carried::About(120.0),
    Carried::About(f64::INFINITY),
    Carried::OnItsWay,
];
/// The air's way is reckoned with at least this wind, m/s: a calm carries nothing.
const LEAST_WIND_M_S: f64 = 0.5;

/// `track` in a wind that is the mean of what was logged from `before_s` before each row to
/// `after_s` after it, by any platform.
fn averaged(
    track: &Track,
    logged: &[bool],
    before_s: impl Fn(usize) -> f64,
    after_s: f64,
) -> Track {
    let times = track.time_s();
    let mut order: Vec<usize> = (0..track.len()).filter(|i| logged[*i]).collect();
    order.sort_by(|a, b| times[*a].total_cmp(&times[*b]));
    // Sums of east, north, speed and number of the rows before each.
    let mut sums = vec![[0.0; 4]];
    for &i in &order {
        let t = track.transport()[i];
        let own = [
            t.east * t.speed_m_s,
            t.north * t.speed_m_s,
            t.speed_m_s,
            1.0,
        ];
        let last = sums[sums.len() - 1];
        sums.push(std::array::from_fn(|k| last[k] + own[k]));
    }
    let upto = |time_s: f64| order.partition_point(|i| times[*i] <= time_s);
    let mut out = track.clone();
    for (i, transport) in out.transport_mut().iter_mut().enumerate() {
        let end = upto(times[i] + after_s).max(1);
        let first = upto(times[i] - before_s(i)).min(end - 1);
        let [east, north, speed, count] = std::array::from_fn(|k| sums[end][k] - sums[first][k]);
        let length = f64::hypot(east, north);
        if length > 0.0 {
            *transport = Transport {
                east: east / length,
                north: north / length,
                speed_m_s: speed / count,
            };
        }
    }
    out
}

/// What of a log carries the plume where the base fits its readings best; none without a log.
pub(crate) fn chosen(
    setup: &Setup,
    data: &Data,
    question: &Question<'_>,
    scale: Scale,
    in_flight: bool,
) -> Result<Option<Carried>, InferError> {
    if !data.on_board_wind {
        return Ok(None);
    }
    // Where the readings lie elsewhere, a plume that is turned there tells which wind carried it.
    let still = PlumeModel::of(setup, &data.track, scale);
    let beforehand: Vec<f64> = still.priors().iter().map(|p| p.mean).collect();
    let contact = question.contact(&still, &beforehand)?;
    let aim_deg = contact.filter(elsewhere).map(|c| c.turn_deg.value);
    let mut best: Option<(f64, Carried)> = None;
    let tried = if in_flight {
        &TRIED_IN_FLIGHT[..]
    } else {
        &TRIED
    };
    for &carried in tried {
        let track = carrying(setup, data, Some(carried));
        let model = PlumeModel::of(setup, &track, scale);
        let model = aim_deg.map_or_else(
            || model.clone(),
            |deg| model.aimed(&catalogue::aimed(deg, scale).part, deg),
        );
        let evidence = question.quick(&model)?;
        if best.is_none_or(|b| evidence > b.0) {
            best = Some((evidence, carried));
        }
    }
    Ok(best.map(|b| b.1))
}

/// The track of `data` in what of its log carries the plume; in the scenario's wind where that is
/// none.
pub(crate) fn carrying(setup: &Setup, data: &Data, carried: Option<Carried>) -> Track {
    let logged: Vec<bool> = data.wind.iter().map(Option::is_some).collect();
    match carried {
        None | Some(Carried::About(0.0)) => data.track.clone(),
        Some(Carried::About(s)) => averaged(&data.track, &logged, |_| s, s),
        Some(Carried::OnItsWay) => {
            let source = setup.base.sources[0].place;
            let way_s: Vec<f64> = data
                .distance_m(source)
                .zip(data.track.transport())
                .map(|(far_m, wind)| far_m / wind.speed_m_s.max(LEAST_WIND_M_S))
                .collect();
            averaged(&data.track, &logged, |i| way_s[i], 0.0)
        }
    }
}

/// A wind in words.
pub(crate) fn describe(carried: Option<Carried>) -> String {
    match carried {
        None => "the scenario's wind".to_string(),
        Some(Carried::About(0.0)) => "the logged wind of each row".to_string(),
        Some(Carried::About(s)) if s.is_finite() => {
            format!("the logged wind, averaged over {s:.0} s before and after each row")
        }
        Some(Carried::About(_)) => "the mean of the logged wind".to_string(),
        Some(Carried::OnItsWay) => {
            "the logged wind, averaged over the way of the air from the source".to_string()
        }
    }
}
